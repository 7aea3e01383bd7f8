# Functions for the scripts of this folder.
cmake_minimum_required(VERSION 3.25)
include("${SETTINGS}")

# say(TEXT): prints progress on standard output.
function(say text)
  execute_process(COMMAND ${CMAKE_COMMAND} -E echo "${text}")
endfunction()

# wrong(TEXT): ends the test.
function(wrong text)
  message(FATAL_ERROR "${text}")
endfunction()

# run(OUTPUT what COMMAND...): runs a command that must succeed; OUTPUT gets everything that it
# printed.
function(run output what)
  say("${what}")
  execute_process(COMMAND ${ARGN} RESULT_VARIABLE status OUTPUT_VARIABLE printed ERROR_VARIABLE printed)
  if(NOT status EQUAL 0)
    wrong("${what}: failed with ${status}\n${printed}")
  endif()
  set(${output} "${printed}" PARENT_SCOPE)
endfunction()

# build_consumer(SOURCE ARGUMENTS...): configures (from scratch) and builds a project with COMPILER. SOURCE is a path, or the name
# of a folder in consumers/. A warning of CMake is an error. Sets BUILD to the build folder, and CONFIGURED to the output of CMake.
# With CONFIGURE_ONLY it builds nothing.
function(build_consumer source)
  cmake_path(ABSOLUTE_PATH source BASE_DIRECTORY "${scriptFolder}/consumers")
  set(build "${testFolder}/${NAME}")
  file(REMOVE_RECURSE "${build}")
  run(configured "Configure ${source} with ${COMPILER}" ${CMAKE_COMMAND} -S "${source}"
    -B "${build}" -G "${generator}" "-DCMAKE_MAKE_PROGRAM=${makeProgram}" "-DCMAKE_CXX_COMPILER=${COMPILER}"
    "-DCMAKE_CXX_COMPILER_LAUNCHER=${compilerLauncher}" "-DCMAKE_CXX_FLAGS=${consumerFlags}" "-DCMAKE_PREFIX_PATH=${prefix}" "-DDERMIS_VERSION=${version}"
    "-DDERMIS_INCLUDE_FOLDER=${prefix}/${includeFolder}" --no-warn-unused-cli ${ARGN})
  if(configured MATCHES "CMake (Deprecation )?Warning")
    wrong("CMake warns:\n${configured}")
  endif()
  set(BUILD "${build}" PARENT_SCOPE)
  if(CONFIGURE_ONLY)
    return()
  endif()
  run(built "Build it" ${CMAKE_COMMAND} --build "${build}" --parallel 2)
  if(built MATCHES "warning: ")
    wrong("the compiler warns:\n${built}")
  endif()
endfunction()

# list_compiler_symbols(OUTPUT PROGRAM): lists the symbols of glslang and SPIRV-Tools in a program.
function(list_compiler_symbols output program)
  run(symbols "List the symbols of ${program}" "${nm}" -C "${program}")
  if(NOT symbols MATCHES " main")
    wrong("${nm} does not list main:\n${symbols}")
  endif()
  string(REGEX MATCHALL "[^\n]*(glslang|spvtools|spvOptimizer|spvValidate)[^\n]*" found "${symbols}")
  set(${output} "${found}" PARENT_SCOPE)
endfunction()

# build_with_pkg_config(PREFIX PROGRAM FLAGS...): compiles the program of consumers/vulkan with only the flags that pkg-config
# prints for the package in PREFIX. FLAGS come first.
function(build_with_pkg_config prefix program)
  set(ENV{PKG_CONFIG_PATH} "${prefix}/${libFolder}/pkgconfig")
  run(flags "Ask pkg-config in ${prefix}" "${pkgConfig}" --cflags --libs dermis)
  separate_arguments(flags UNIX_COMMAND "${flags}")
  separate_arguments(own UNIX_COMMAND "${consumerFlags}")
  run(ignored "Compile ${program}" "${ownCompiler}" -std=c++20 ${own} ${ARGN} "${scriptFolder}/consumers/vulkan/main.cpp" -o "${program}"
      ${flags})
endfunction()
