# cmake --install: all expected files, no others, and none that contains the path of the build or of the first installation.
include(${CMAKE_CURRENT_LIST_DIR}/package_test.cmake)

set(staging "${testFolder}/staging")
file(REMOVE_RECURSE "${staging}" "${prefix}")
run(ignored "Install into ${staging}" ${CMAKE_COMMAND} --install "${buildFolder}" --prefix "${staging}")
say("Move it to ${prefix}")
file(RENAME "${staging}" "${prefix}")

say("Compare the list of files")
set(expected bin/dermis)
set(components core cpu gltf shader_compiler verify vulkan)
if(runtimeCompiler)
  list(APPEND components runtime_compiler)
endif()
foreach(component IN LISTS components)
  list(APPEND expected ${libFolder}/libdermis_${component}.a
       ${libFolder}/cmake/dermis/dermis_${component}_targets.cmake)
endforeach()
foreach(name IN ITEMS libdermis libdermis_compare)
  list(APPEND expected ${libFolder}/${name}.so ${libFolder}/${name}.so.${soversion} ${libFolder}/${name}.so.${version})
endforeach()
foreach(component IN ITEMS c c_compare c_static c_compare_static)
  list(APPEND expected ${libFolder}/cmake/dermis/dermis_${component}_targets.cmake)
endforeach()
list(APPEND expected ${libFolder}/libdermis.a ${libFolder}/libdermis_compare.a ${dataFolder}/dermis/dermis.cdef.h)
foreach(name IN ITEMS dermis dermis_core dermis_cpu dermis_gltf dermis_verify dermis_vulkan dermis-c dermis-c-compare)
  list(APPEND expected ${libFolder}/pkgconfig/${name}.pc)
endforeach()
list(APPEND expected ${libFolder}/cmake/dermis/dermisConfig.cmake ${libFolder}/cmake/dermis/dermisConfigVersion.cmake
     ${dataFolder}/doc/dermis/LICENSE ${dataFolder}/doc/dermis/README.md ${dataFolder}/doc/dermis/CHANGELOG.md
     ${dataFolder}/doc/dermis/SECURITY.md
     ${dataFolder}/doc/dermis/engine/README.md)
file(GLOB_RECURSE documents RELATIVE "${sourceFolder}" "${sourceFolder}/docs/*" "${sourceFolder}/samples/minimal/*"
     "${sourceFolder}/samples/allocator/*" "${sourceFolder}/samples/gpu_poses/*" "${sourceFolder}/samples/c/*"
     "${sourceFolder}/samples/python/*")
list(TRANSFORM documents PREPEND ${dataFolder}/doc/dermis/)
list(APPEND expected ${documents})
file(GLOB_RECURSE headers RELATIVE "${sourceFolder}/engine/include" "${sourceFolder}/engine/include/*.h")
list(TRANSFORM headers PREPEND ${includeFolder}/)
file(GLOB_RECURSE shaders RELATIVE "${sourceFolder}/shaders" "${sourceFolder}/shaders/*.h" "${sourceFolder}/shaders/*.glsl"
     "${sourceFolder}/shaders/*.comp")
list(TRANSFORM shaders PREPEND ${dataFolder}/dermis/shaders/)
list(APPEND expected ${headers} ${shaders})

file(GLOB_RECURSE installed RELATIVE "${prefix}" "${prefix}/*")
list(FILTER installed EXCLUDE REGEX "_targets-[a-z]+\\.cmake$")  # one for each build type
list(SORT expected)
list(SORT installed)
if(NOT installed STREQUAL expected)
  set(missing ${expected})
  list(REMOVE_ITEM missing ${installed})
  list(REMOVE_ITEM installed ${expected})
  wrong("missing: ${missing}\nnot expected: ${installed}")
endif()

say("Look for paths of this machine in what CMake and pkg-config read")
file(GLOB_RECURSE files "${prefix}/*.cmake" "${prefix}/*.pc")
foreach(file IN LISTS files)
  file(READ "${file}" text)
  foreach(path IN ITEMS "${sourceFolder}" "${buildFolder}" "${staging}")
    string(FIND "${text}" "${path}" place)
    if(NOT place EQUAL -1)
      wrong("${file} names ${path}")
    endif()
  endforeach()
endforeach()
