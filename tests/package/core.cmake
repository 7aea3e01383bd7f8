# An engine that uses only dermis::core and dermis::verify, on a machine without Vulkan headers and glslang.
include(${CMAKE_CURRENT_LIST_DIR}/package_test.cmake)

set(disabled)
foreach(package IN ITEMS Vulkan VulkanHeaders VulkanLoader glslang SPIRV-Tools SPIRV-Tools-opt SPIRV-Tools-link Threads
                         TinyGLTF nlohmann_json)
  list(APPEND disabled -DCMAKE_DISABLE_FIND_PACKAGE_${package}=TRUE)
endforeach()
build_consumer(core ${disabled} -DGLM_SETTINGS=${GLM_SETTINGS})

run(expected "Run core_consumer" "${BUILD}/core_consumer")
say("${expected}")
# The same program with engines' configurations of GLM, which must not change the library's results. package.symbols finds the functions
# that could.
set(configurations)
if(GLM_SETTINGS)
  set(configurations aligned plain)
endif()
foreach(settings IN LISTS configurations)
  run(found "Run core_consumer_${settings}" "${BUILD}/core_consumer_${settings}")
  if(NOT found STREQUAL expected)
    wrong("with the GLM settings '${settings}' the results are others:\n${found}")
  endif()
endforeach()
