# The target dermis_reference generates the reference of the public headers: HTML in BUILD/reference/html. The test
# reference.doxygen does the same in another folder, and fails on any warning. Both need doxygen.
find_program(DERMIS_DOXYGEN doxygen DOC "doxygen, for the reference")
mark_as_advanced(DERMIS_DOXYGEN)
set(doxygen)
if(DERMIS_DOXYGEN)
  set(doxygen ${DERMIS_DOXYGEN})
endif()
set(makeReference ${CMAKE_COMMAND} -D DOXYGEN=${doxygen} -D SOURCE=${PROJECT_SOURCE_DIR} -D VERSION=${PROJECT_VERSION})
set(script ${CMAKE_CURRENT_LIST_DIR}/reference/make.cmake)

if(DERMIS_DOXYGEN)
  add_custom_target(dermis_reference
    COMMAND ${makeReference} -D OUTPUT=${PROJECT_BINARY_DIR}/reference -P ${script}
    COMMENT "Making the reference in ${PROJECT_BINARY_DIR}/reference/html"
    VERBATIM)
endif()
if(DERMIS_BUILD_TESTS)
  add_test(NAME reference.doxygen COMMAND ${makeReference} -D OUTPUT=${PROJECT_BINARY_DIR}/tests/reference -P ${script})
  set_tests_properties(reference.doxygen PROPERTIES TIMEOUT 300 SKIP_REGULAR_EXPRESSION "SKIPPED: ")
endif()
