# The installed command compares the methods on the models that it contains, from a folder without any file.
include(${CMAKE_CURRENT_LIST_DIR}/package_test.cmake)

set(empty "${testFolder}/empty")
file(REMOVE_RECURSE "${empty}")
file(MAKE_DIRECTORY "${empty}")
say("Compare in ${empty}")
execute_process(COMMAND "${prefix}/bin/dermis" compare -o compare.png --methods linear,dual_quaternion --width 480 --repetitions 1
                        --instances 1 WORKING_DIRECTORY "${empty}"
                RESULT_VARIABLE status OUTPUT_VARIABLE printed ERROR_VARIABLE printed)
if(status EQUAL 4 AND NOT DEFINED ENV{CI})
  say("SKIPPED: there is no Vulkan device")
elseif(NOT status EQUAL 0)
  wrong("it ended with ${status}:\n${printed}")
elseif(NOT EXISTS "${empty}/compare.png")
  wrong("it drew no picture:\n${printed}")
endif()
