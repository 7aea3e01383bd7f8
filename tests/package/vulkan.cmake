# An engine that uses dermis::vulkan, and links no loader.
include(${CMAKE_CURRENT_LIST_DIR}/package_test.cmake)

build_consumer(vulkan -DCMAKE_DISABLE_FIND_PACKAGE_glm=TRUE)
run(printed "Run vulkan_consumer" "${BUILD}/vulkan_consumer")
say("${printed}")
run(dynamic "Look at what it is linked with" "${readelf}" -d "${BUILD}/vulkan_consumer")
if(dynamic MATCHES "vulkan")
  wrong("it is linked with a Vulkan loader:\n${dynamic}")
endif()
list_compiler_symbols(compiler "${BUILD}/vulkan_consumer")
if(compiler)
  wrong("it has a shader compiler: ${compiler}")
endif()
