# Every option of Dermis. The defaults suit both a checkout of Dermis itself and an engine's add_subdirectory.

# The source package contains the compiled kernels, in shaders/embedded.
set(embeddedShaders)
if(EXISTS ${PROJECT_SOURCE_DIR}/shaders/embedded/dermis_kernels.cpp)
  set(embeddedShaders ${PROJECT_SOURCE_DIR}/shaders/embedded)
endif()
set(DERMIS_EMBEDDED_SHADERS "${embeddedShaders}" CACHE PATH
    "Folder of dermis_kernels.h and dermis_kernels.cpp, the compiled kernels; empty: the build compiles them, with glslang")
set(dermisIsDeveloped ${PROJECT_IS_TOP_LEVEL})
if(DERMIS_EMBEDDED_SHADERS)
  set(dermisIsDeveloped OFF)
endif()

option(DERMIS_BUILD_VULKAN "Build dermis::vulkan, the Vulkan compute back end" ON)
option(DERMIS_RUNTIME_COMPILER "Build dermis::runtime_compiler: the kernels compiled from GLSL at run time, and compiled again when a file changes" OFF)
set(shaderCompilerByDefault ${dermisIsDeveloped})
if(DERMIS_RUNTIME_COMPILER)
  set(shaderCompilerByDefault ON)
endif()
option(DERMIS_BUILD_SHADER_COMPILER "Build dermis::shader_compiler, GLSL to SPIR-V at run time; needs glslang and SPIRV-Tools"
       ${shaderCompilerByDefault})
option(DERMIS_BUILD_CPU "Build dermis::cpu, skinning by SIMD instructions of the CPU; needs Highway" ${PROJECT_IS_TOP_LEVEL})
option(DERMIS_BUILD_VERIFY "Build dermis::verify, the reference and the accuracy contract" ${PROJECT_IS_TOP_LEVEL})
option(DERMIS_BUILD_GLTF "Build dermis::gltf, the glTF 2.0 importer" ${PROJECT_IS_TOP_LEVEL})
option(DERMIS_BUILD_SAMPLES "Build the dermis command and the samples" ${dermisIsDeveloped})
option(DERMIS_BUILD_SHOWCASE "Build the viewer, which needs SDL 2 and Dear ImGui, and the film of a crowd" OFF)
# The tests use internal functions, which a shared library hides.
set(dermisTestsByDefault ${dermisIsDeveloped})
if(BUILD_SHARED_LIBS)
  set(dermisTestsByDefault OFF)
endif()
option(DERMIS_BUILD_TESTS "Build the tests; without DERMIS_BUILD_SAMPLES only those that need no device" ${dermisTestsByDefault})
option(DERMIS_BUILD_FUZZERS "Build the libFuzzer programs; needs Clang, and instruments everything" OFF)
# An engine that needs a small library leaves these kernels out. Using them then fails with missingFeature.
option(DERMIS_COMPARISON_METHODS "Kernels of the methods that are there for comparison: iterative, log_matrix, spherical_blend, quaternion_translation" ON)
option(DERMIS_SUBWORD_STORES "Kernels that store attributes at multiples of 2 bytes or of 1" ON)
option(DERMIS_INSTALL "Add rules that install the libraries and a CMake package" ${PROJECT_IS_TOP_LEVEL})
option(DERMIS_WARNINGS_AS_ERRORS "Stop at the first compiler warning" OFF)
set(DERMIS_SANITIZE "" CACHE STRING "Sanitizers to build Dermis with: address, thread, or empty for none")
set_property(CACHE DERMIS_SANITIZE PROPERTY STRINGS "" address thread)
# The tests' own code takes half of the time of a build with the address sanitizer.
option(DERMIS_SANITIZE_TESTS "With DERMIS_SANITIZE=address: sanitize the tests' own code too" ON)

if(DERMIS_RUNTIME_COMPILER AND NOT (DERMIS_BUILD_VULKAN AND DERMIS_BUILD_SHADER_COMPILER))
  message(FATAL_ERROR "DERMIS_RUNTIME_COMPILER needs DERMIS_BUILD_VULKAN and DERMIS_BUILD_SHADER_COMPILER")
endif()
if(DERMIS_BUILD_SAMPLES AND NOT (DERMIS_BUILD_VERIFY AND DERMIS_BUILD_VULKAN AND DERMIS_BUILD_GLTF))
  message(FATAL_ERROR "DERMIS_BUILD_SAMPLES needs DERMIS_BUILD_VERIFY, DERMIS_BUILD_VULKAN and DERMIS_BUILD_GLTF")
endif()
if(DERMIS_BUILD_SAMPLES AND NOT (DERMIS_COMPARISON_METHODS AND DERMIS_SUBWORD_STORES))
  message(FATAL_ERROR "DERMIS_BUILD_SAMPLES needs DERMIS_COMPARISON_METHODS and DERMIS_SUBWORD_STORES")
endif()
if(DERMIS_BUILD_TESTS AND BUILD_SHARED_LIBS)
  message(FATAL_ERROR "DERMIS_BUILD_TESTS needs static libraries: BUILD_SHARED_LIBS=OFF")
endif()
if(DERMIS_BUILD_TESTS AND NOT (DERMIS_BUILD_CPU AND DERMIS_BUILD_SHADER_COMPILER))
  message(FATAL_ERROR "DERMIS_BUILD_TESTS needs DERMIS_BUILD_CPU and DERMIS_BUILD_SHADER_COMPILER")
endif()
if(DERMIS_BUILD_TESTS AND NOT (DERMIS_BUILD_VERIFY AND DERMIS_BUILD_VULKAN AND DERMIS_BUILD_GLTF))
  message(FATAL_ERROR "DERMIS_BUILD_TESTS needs DERMIS_BUILD_VERIFY, DERMIS_BUILD_VULKAN and DERMIS_BUILD_GLTF")
endif()

if(DERMIS_BUILD_SHOWCASE AND NOT DERMIS_BUILD_SAMPLES)
  message(FATAL_ERROR "DERMIS_BUILD_SHOWCASE needs DERMIS_BUILD_SAMPLES")
endif()
if(DERMIS_BUILD_FUZZERS AND NOT (DERMIS_BUILD_VERIFY AND DERMIS_BUILD_GLTF AND CMAKE_CXX_COMPILER_ID MATCHES "Clang"))
  message(FATAL_ERROR "DERMIS_BUILD_FUZZERS needs Clang, DERMIS_BUILD_VERIFY and DERMIS_BUILD_GLTF")
endif()

if(PROJECT_IS_TOP_LEVEL AND NOT CMAKE_BUILD_TYPE AND NOT CMAKE_CONFIGURATION_TYPES)
  set(CMAKE_BUILD_TYPE Release CACHE STRING "Build type" FORCE)
endif()

# An engine may already have added glslang and SPIRV-Tools. Debian's packages would define some of these targets again.
set(DERMIS_ENGINE_HAS_GLSLANG OFF)
foreach(target IN ITEMS glslang glslang::glslang SPIRV glslang::SPIRV OSDependent glslang::OSDependent MachineIndependent
    GenericCodeGen OGLCompiler glslang-default-resource-limits glslang::glslang-default-resource-limits
    SPIRV-Tools SPIRV-Tools-static SPIRV-Tools-opt SPIRV-Tools-link)
  if(TARGET ${target})
    set(DERMIS_ENGINE_HAS_GLSLANG ON)
  endif()
endforeach()
