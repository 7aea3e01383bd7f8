# An engine that uses Dermis from its build folder, without installing it.
include(${CMAKE_CURRENT_LIST_DIR}/package_test.cmake)

build_consumer(ways "-Ddermis_DIR=${buildFolder}" -DCMAKE_PREFIX_PATH= -DCMAKE_DISABLE_FIND_PACKAGE_glm=TRUE
               -DCMAKE_DISABLE_FIND_PACKAGE_glslang=TRUE)
run(printed "Run ways_consumer" "${BUILD}/ways_consumer")
say("${printed}")
