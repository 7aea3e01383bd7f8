# ctest includes this file, with `program`, `cost` and `label` set. Adds one test for each suite of a GoogleTest
# program.
#
# A process opens a device and compiles kernels, which takes longer than most of its tests. A suite with a skipped test exits with
# 77, unless another test failed; tests/run.sh lists the skipped tests.
execute_process(COMMAND ${program} --gtest_list_tests OUTPUT_VARIABLE suites RESULT_VARIABLE status)
if(NOT status EQUAL 0)
  cmake_path(GET program FILENAME name)
  add_test(${name}_NOT_BUILT ${program})
  if(label)
    set_tests_properties(${name}_NOT_BUILT PROPERTIES LABELS ${label})
  endif()
  return()
endif()
# Suites begin at the start of a line; their tests are indented.
string(REGEX MATCHALL "(^|\n)[A-Za-z0-9_/]+\\." suites "${suites}")
foreach(suite IN LISTS suites)
  string(STRIP "${suite}" suite)
  add_test("${suite}*" ${program} "--gtest_filter=${suite}*")
  set_tests_properties("${suite}*" PROPERTIES TIMEOUT 900 COST ${cost} SKIP_RETURN_CODE 77)
  if(label)
    set_tests_properties("${suite}*" PROPERTIES LABELS ${label})
  endif()
  if(label STREQUAL "nightly")
    set_tests_properties("${suite}*" PROPERTIES TIMEOUT 1700)
  endif()
endforeach()
