# Compiles a program with the flags that pkg-config prints for the installed package. The flags must name everything that each
# library links.
include(${CMAKE_CURRENT_LIST_DIR}/package_test.cmake)

build_with_pkg_config("${prefix}" "${testFolder}/${NAME}.program")
run(printed "Run it" "${testFolder}/${NAME}.program")
say("${printed}")
foreach(name IN ITEMS core cpu verify vulkan gltf)
  run(flags "Ask pkg-config for dermis_${name}" "${pkgConfig}" --cflags --libs dermis_${name})
  say("${flags}")
  separate_arguments(flags UNIX_COMMAND "${flags}")
  separate_arguments(own UNIX_COMMAND "${consumerFlags}")
  # The whole archive, so that an undefined symbol is an error.
  run(ignored "Link the whole of it" "${ownCompiler}" -std=c++20 ${own} "${scriptFolder}/consumers/pkg_config/main.cpp"
      -o "${testFolder}/${NAME}.whole" -Wl,--whole-archive ${flags} -Wl,--no-whole-archive)
  run(ignored "Run it" "${testFolder}/${NAME}.whole")
endforeach()
run(folder "Ask pkg-config for the shaders" "${pkgConfig}" --variable=shaderdir dermis)
string(STRIP "${folder}" folder)
if(NOT EXISTS "${folder}/abi.h")
  wrong("shaderdir is '${folder}'")
endif()
