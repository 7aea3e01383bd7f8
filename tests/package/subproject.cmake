# An engine with Dermis as a subproject: the folders that a build needs are copied into an engine's source, so that files written
# there are found. The kernels are those of this build; in nightly tests, with the other compiler, the engine's build compiles them.
# With CONFIGURE_ONLY the engine is only configured, which says what Dermis sets and adds.
include(${CMAKE_CURRENT_LIST_DIR}/package_test.cmake)

set(engine "${testFolder}/${NAME}.source")
file(REMOVE_RECURSE "${engine}")
file(COPY "${scriptFolder}/consumers/subproject/CMakeLists.txt" "${scriptFolder}/consumers/vulkan/main.cpp"
     DESTINATION "${engine}")
file(COPY "${scriptFolder}/consumers/consumer.cmake" DESTINATION "${engine}/consumers")
file(COPY "${sourceFolder}/CMakeLists.txt" "${sourceFolder}/cmake" "${sourceFolder}/engine" "${sourceFolder}/shaders"
     DESTINATION "${engine}/third_party/dermis")
file(GLOB_RECURSE before "${engine}/*")

# Nothing from this build is linked. The flags are the engine's; Dermis must detect NaN in spite of them.
set(consumerFlags "-ffast-math -fno-signed-zeros")
set(kernels)
if(COMPILER STREQUAL ownCompiler)
  set(kernels "-DDERMIS_EMBEDDED_SHADERS=${buildFolder}/shaders/dermis_kernels")
endif()
# Without the kernels for comparison, which are left out unless one asks.
build_consumer("${engine}" ${kernels} -DCMAKE_DISABLE_FIND_PACKAGE_glm=TRUE "-DGLM_FOLDERS=${glmFolders}")
file(STRINGS "${BUILD}/CMakeCache.txt" compares REGEX "^DERMIS_COMPARISON_METHODS:BOOL=OFF$")
if(NOT compares)
  wrong("a subproject has the kernels that are for comparison")
endif()
if(NOT CONFIGURE_ONLY)
  run(printed "Run engine" "${BUILD}/engine")
  say("${printed}")

  # DERMIS_RUNTIME_COMPILER is OFF.
  list_compiler_symbols(compiler "${BUILD}/engine")
  if(compiler)
    wrong("the engine has a shader compiler: ${compiler}")
  endif()

  if(NOT kernels)
    file(GLOB_RECURSE modules "${BUILD}/*.spv")
    list(FILTER modules EXCLUDE REGEX "unchecked")
    set(bytes 0)
    foreach(module IN LISTS modules)
      file(SIZE "${module}" size)
      math(EXPR bytes "${bytes} + ${size}")
    endforeach()
    say("${bytes} bytes of SPIR-V: ${modules}")
    if(bytes EQUAL 0 OR bytes GREATER 1000000)
      wrong("the kernels for every day are ${bytes} bytes of SPIR-V")
    endif()
  endif()
endif()

file(GLOB_RECURSE after "${engine}/*")
if(NOT after STREQUAL before)
  list(REMOVE_ITEM after ${before})
  wrong("it wrote into the source: ${after}")
endif()
file(GLOB programs "${BUILD}/bin/*" "${BUILD}/lib/*")
if(programs)
  wrong("it set output folders: ${programs}")
endif()
