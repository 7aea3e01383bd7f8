# An engine that uses dermis::core and dermis::verify alone, on a machine without Vulkan headers and glslang.
include(${CMAKE_CURRENT_LIST_DIR}/package_test.cmake)

set(disabled)
foreach(package IN ITEMS Vulkan VulkanHeaders VulkanLoader glslang SPIRV-Tools SPIRV-Tools-opt SPIRV-Tools-link Threads
                         TinyGLTF nlohmann_json)
  list(APPEND disabled -DCMAKE_DISABLE_FIND_PACKAGE_${package}=TRUE)
endforeach()
build_consumer(core ${disabled})

# The same program with GLM set up in the ways of engines: what the library computes must not change.
run(expected "Run core_consumer" "${BUILD}/core_consumer")
say("${expected}")
foreach(settings IN ITEMS aligned plain)
  run(found "Run core_consumer_${settings}" "${BUILD}/core_consumer_${settings}")
  if(NOT found STREQUAL expected)
    wrong("with the GLM settings '${settings}' the results are others:\n${found}")
  endif()
endforeach()
