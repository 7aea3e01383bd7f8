# The sample that embeds Dermis, with the validation layer if it is installed.
include(${CMAKE_CURRENT_LIST_DIR}/package_test.cmake)

set(ENV{VK_INSTANCE_LAYERS} VK_LAYER_KHRONOS_validation)
set(ENV{VK_LAYER_ENABLES} VK_VALIDATION_FEATURE_ENABLE_SYNCHRONIZATION_VALIDATION_EXT)
say("Run ${PROGRAM}")
execute_process(COMMAND "${PROGRAM}" $ENV{DERMIS_TEST_DEVICE} RESULT_VARIABLE status OUTPUT_VARIABLE printed
                ERROR_VARIABLE printed)
say("${printed}")
if(status EQUAL 4 AND NOT DEFINED ENV{CI})
  say("SKIPPED: there is no Vulkan device")
elseif(NOT status EQUAL 0)
  wrong("it ended with ${status}")
elseif(printed MATCHES "VUID-|SYNC-HAZARD")
  wrong("the validation layer complains")
elseif(NOT printed MATCHES "every vertex is right")
  wrong("it does not say that every vertex is right")
endif()
