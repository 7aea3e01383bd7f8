# Every option of Dermis, with defaults that suit both a checkout of its own and an engine's add_subdirectory.

option(DERMIS_BUILD_VULKAN "Build dermis::vulkan, the Vulkan compute back end" ON)
option(DERMIS_BUILD_VERIFY "Build dermis::verify, the reference and the accuracy contract" ${PROJECT_IS_TOP_LEVEL})
option(DERMIS_BUILD_GLTF "Build dermis::gltf, the glTF 2.0 importer" ${PROJECT_IS_TOP_LEVEL})
option(DERMIS_BUILD_SAMPLES "Build the dermis command, the sample models and the samples" ${PROJECT_IS_TOP_LEVEL})
option(DERMIS_BUILD_VIEWER "Build the viewer, one of the samples; needs SDL 2 and Dear ImGui" ON)
option(DERMIS_BUILD_TESTS "Build the tests" ${PROJECT_IS_TOP_LEVEL})
option(DERMIS_BUILD_FUZZERS "Build the libFuzzer programs; needs Clang, and instruments everything" OFF)
# An engine that wants a small library leaves these kernels out; what needs them fails with missingFeature.
option(DERMIS_COMPARISON_METHODS "Kernels of the methods that are there for comparison: iterative, log_matrix, spherical_blend, quaternion_translation" ON)
option(DERMIS_SUBWORD_STORES "Kernels that store attributes at multiples of 2 bytes or of 1" ON)
option(DERMIS_INSTALL "Add rules that install the libraries and a CMake package" ${PROJECT_IS_TOP_LEVEL})
option(DERMIS_WARNINGS_AS_ERRORS "Stop at the first compiler warning" OFF)
set(DERMIS_SANITIZE "" CACHE STRING "Sanitizers to build Dermis with: address, thread, or empty for none")
set_property(CACHE DERMIS_SANITIZE PROPERTY STRINGS "" address thread)
# Half of what a build with the address sanitizer takes is for the tests' own code.
option(DERMIS_SANITIZE_TESTS "With DERMIS_SANITIZE=address: sanitize the tests' own code too" ON)

if(DERMIS_BUILD_SAMPLES AND NOT (DERMIS_BUILD_VERIFY AND DERMIS_BUILD_VULKAN AND DERMIS_BUILD_GLTF))
  message(FATAL_ERROR "DERMIS_BUILD_SAMPLES needs DERMIS_BUILD_VERIFY, DERMIS_BUILD_VULKAN and DERMIS_BUILD_GLTF")
endif()
if(DERMIS_BUILD_SAMPLES AND NOT (DERMIS_COMPARISON_METHODS AND DERMIS_SUBWORD_STORES))
  message(FATAL_ERROR "DERMIS_BUILD_SAMPLES needs DERMIS_COMPARISON_METHODS and DERMIS_SUBWORD_STORES")
endif()
if(DERMIS_BUILD_TESTS AND NOT DERMIS_BUILD_SAMPLES)
  message(FATAL_ERROR "DERMIS_BUILD_TESTS needs DERMIS_BUILD_SAMPLES: the tests use its device and its models")
endif()

if(DERMIS_BUILD_FUZZERS AND NOT (DERMIS_BUILD_VERIFY AND DERMIS_BUILD_GLTF AND CMAKE_CXX_COMPILER_ID MATCHES "Clang"))
  message(FATAL_ERROR "DERMIS_BUILD_FUZZERS needs Clang, DERMIS_BUILD_VERIFY and DERMIS_BUILD_GLTF")
endif()

if(PROJECT_IS_TOP_LEVEL AND NOT CMAKE_BUILD_TYPE AND NOT CMAKE_CONFIGURATION_TYPES)
  set(CMAKE_BUILD_TYPE Release CACHE STRING "Build type" FORCE)
endif()
