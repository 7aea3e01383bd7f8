# Compiler flags of Dermis' targets. They are private: nothing reaches a target that links Dermis.

# GCC and Clang, including MinGW.
set(dermisGnuFlags
  -Wall -Wextra -Wpedantic -Wshadow -Wconversion -Wsign-conversion -Wnon-virtual-dtor -Wold-style-cast
  -Wimplicit-fallthrough -Wundef
  # One rounding per operation, on every machine: the reference and the packing must not depend on fused operations.
  -ffp-contract=off
  # Dermis tests for NaN and infinities, and signs of zeros matter, whatever flags an engine compiles with. -fno-fast-math does not
  # reset options of GCC that were set separately, so each is listed.
  -fno-fast-math -fno-finite-math-only -fsigned-zeros -fno-associative-math -fno-reciprocal-math -fno-unsafe-math-optimizations)
# cl. Exceptions stay on, because its standard library expects them.
set(dermisMsvcFlags /W4 /permissive- /utf-8 /Zc:__cplusplus /Zc:preprocessor /fp:precise)
# clang-cl ignores Clang's options without "/clang:", and has no /Zc:preprocessor.
set(dermisClangClFlags /W4 /permissive- /utf-8 /Zc:__cplusplus /fp:precise /clang:-ffp-contract=off /clang:-fno-fast-math
  /clang:-fno-finite-math-only /clang:-fsigned-zeros /clang:-fno-associative-math /clang:-fno-reciprocal-math)

# The flags as properties of a target. It is not linked, so that exported targets only name exported targets.
add_library(dermis_build_flags INTERFACE)
if(NOT MSVC)
  target_compile_options(dermis_build_flags INTERFACE ${dermisGnuFlags})
  if(CMAKE_UNITY_BUILD AND CMAKE_CXX_COMPILER_ID STREQUAL "GNU")
    # It takes a joined source for a header, whose classes must not use what only one file has.
    target_compile_options(dermis_build_flags INTERFACE -Wno-subobject-linkage)
    if(PROJECT_IS_TOP_LEVEL)
      # Below so many kilobytes it collects no garbage, for which these sources take a tenth of their time otherwise.
      target_compile_options(dermis_build_flags INTERFACE "SHELL:--param ggc-min-heapsize=700000")
    endif()
  endif()
  if(NOT WIN32 AND NOT APPLE)
    # Allows inlining in position-independent code: no program replaces functions of Dermis at load time.
    target_compile_options(dermis_build_flags INTERFACE -fno-semantic-interposition)
  endif()
elseif(CMAKE_CXX_COMPILER_ID STREQUAL "MSVC")
  target_compile_options(dermis_build_flags INTERFACE ${dermisMsvcFlags})
else()
  target_compile_options(dermis_build_flags INTERFACE ${dermisClangClFlags})
endif()
if(MSVC)
  target_compile_definitions(dermis_build_flags INTERFACE _CRT_SECURE_NO_WARNINGS)
elseif(CMAKE_SIZEOF_VOID_P EQUAL 4)
  # On 32-bit x86, compilers use the x87 unit, which rounds later.
  if(CMAKE_SYSTEM_PROCESSOR MATCHES "^(i[3-6]86|x86|x86_64|AMD64)$")
    target_compile_options(dermis_build_flags INTERFACE -msse2 -mfpmath=sse)
  endif()
  # Supports files of 2 GiB and more.
  target_compile_definitions(dermis_build_flags INTERFACE _FILE_OFFSET_BITS=64)
endif()
if(WIN32)
  target_compile_definitions(dermis_build_flags INTERFACE NOMINMAX)
endif()
if(DERMIS_WARNINGS_AS_ERRORS)
  target_compile_options(dermis_build_flags INTERFACE $<IF:$<BOOL:${MSVC}>,/WX,-Werror>)
endif()
if(DERMIS_BUILD_FUZZERS)
  target_compile_options(dermis_build_flags INTERFACE -fsanitize=fuzzer-no-link)
endif()
if(DERMIS_SANITIZE STREQUAL "address")
  target_compile_options(dermis_build_flags INTERFACE
    -fsanitize=address,undefined,float-cast-overflow -fno-sanitize-recover=all -fno-omit-frame-pointer
    -fno-sanitize=vptr) # it needs RTTI, which engine code does not have
  target_link_options(dermis_build_flags INTERFACE -fsanitize=address,undefined)
  if(NOT DERMIS_SANITIZE_TESTS AND CMAKE_CXX_COMPILER_ID STREQUAL "GNU")
    # With it these checks at each access cost up to a third of the compile time, and the address sanitizer finds nearly all that they
    # find.
    target_compile_options(dermis_build_flags INTERFACE -fno-sanitize=null,object-size,pointer-overflow)
  endif()
elseif(DERMIS_SANITIZE STREQUAL "thread")
  target_compile_options(dermis_build_flags INTERFACE -fsanitize=thread -fno-omit-frame-pointer)
  target_link_options(dermis_build_flags INTERFACE -fsanitize=thread)
elseif(DERMIS_SANITIZE)
  message(FATAL_ERROR "DERMIS_SANITIZE is '${DERMIS_SANITIZE}': it may be address, thread or empty")
endif()

# dermis_use_privately(TARGET USED): compiles TARGET with the interface properties of USED, but does not export this dependency. For
# header-only libraries.
function(dermis_use_privately target used)
  target_compile_options(${target} PRIVATE $<TARGET_PROPERTY:${used},INTERFACE_COMPILE_OPTIONS>)
  target_compile_definitions(${target} PRIVATE $<TARGET_PROPERTY:${used},INTERFACE_COMPILE_DEFINITIONS>)
  target_include_directories(${target} SYSTEM PRIVATE $<TARGET_PROPERTY:${used},INTERFACE_INCLUDE_DIRECTORIES>)
endfunction()

# dermis_configure_target(TARGET): sets the language level and the private flags of a target. tests/run.sh sets
# DERMIS_QUICK_OPTIMIZATION, a compiler flag for all but what tests spend their time in.
function(dermis_configure_target target)
  if(DERMIS_QUICK_OPTIMIZATION AND NOT target MATCHES "^dermis_(core|cpu|verify|kit_batches)$")
    target_compile_options(${target} PRIVATE ${DERMIS_QUICK_OPTIMIZATION})
  endif()
  target_compile_features(${target} PUBLIC cxx_std_20)
  set_target_properties(${target} PROPERTIES CXX_EXTENSIONS OFF POSITION_INDEPENDENT_CODE ON
    CXX_VISIBILITY_PRESET hidden VISIBILITY_INLINES_HIDDEN ON)
  dermis_use_privately(${target} dermis_build_flags)
  target_link_options(${target} PRIVATE $<TARGET_PROPERTY:dermis_build_flags,INTERFACE_LINK_OPTIONS>)
endfunction()

# dermis_version_library(TARGET SYMBOL): the version of a shared library. SYMBOL is defined while it is compiled.
function(dermis_version_library target symbol)
  set_target_properties(${target} PROPERTIES DEFINE_SYMBOL ${symbol} VERSION ${PROJECT_VERSION} SOVERSION ${DERMIS_SOVERSION}
    # Libraries find each other in their own folder.
    INSTALL_RPATH "$<IF:$<BOOL:${APPLE}>,@loader_path,$ORIGIN>")
  if(NOT WIN32 AND NOT APPLE AND NOT DERMIS_SANITIZE)
    target_link_options(${target} PRIVATE -Wl,--no-undefined)
  endif()
endfunction()
# While the version is 0.x, a minor version may change the interface.
set(DERMIS_SOVERSION ${PROJECT_VERSION_MAJOR})
if(DERMIS_SOVERSION EQUAL 0)
  set(DERMIS_SOVERSION 0.${PROJECT_VERSION_MINOR})
endif()

# dermis_add_library(NAME SOURCES...): adds the library dermis_NAME with the alias dermis::NAME and the public headers in
# engine/include. It is installed with the package. Static, or shared with BUILD_SHARED_LIBS.
function(dermis_add_library name)
  set(type STATIC)
  if(BUILD_SHARED_LIBS)
    set(type SHARED)
  endif()
  add_library(dermis_${name} ${type} ${ARGN})
  add_library(dermis::${name} ALIAS dermis_${name})
  set_target_properties(dermis_${name} PROPERTIES EXPORT_NAME ${name})
  target_include_directories(dermis_${name}
    PUBLIC $<BUILD_INTERFACE:${PROJECT_SOURCE_DIR}/engine/include>
    PRIVATE ${PROJECT_SOURCE_DIR}/engine/src)
  dermis_configure_target(dermis_${name})
  string(TOUPPER ${name} upperName)
  if(BUILD_SHARED_LIBS)
    target_compile_definitions(dermis_${name} PUBLIC DERMIS_SHARED)
    dermis_version_library(dermis_${name} DERMIS_BUILDS_${upperName})
  endif()
  if(name MATCHES "^(core|runtime_compiler)$" OR DERMIS_BUILD_${upperName})  # not if it is only a tool of the build
    set_property(GLOBAL APPEND PROPERTY DERMIS_LIBRARIES dermis_${name})
  endif()
endfunction()

# Code that runs in the engine. No exception may leave it, so exceptions are disabled.
function(dermis_without_exceptions target)
  target_compile_options(${target} PRIVATE $<IF:$<BOOL:${MSVC}>,/GR-,-fno-exceptions;-fno-rtti>)
endfunction()

# Dermis' own builds precompile headers, which takes a quarter of their compile time away. CI joins sources instead
# (CMAKE_UNITY_BUILD), as engines do: that takes away half, and precompiled headers then cost more than they bring. Every file still
# includes what it uses: the nightly part `clang` builds with neither.
set(DERMIS_PRECOMPILES ${PROJECT_IS_TOP_LEVEL})
if(CMAKE_UNITY_BUILD)
  set(DERMIS_PRECOMPILES OFF)
endif()

# dermis_precompile(TARGET HEADERS...): precompiles headers of the standard library and these.
function(dermis_precompile target)
  if(DERMIS_PRECOMPILES)
    target_precompile_headers(${target} PRIVATE <algorithm> <array> <cmath> <cstring> <functional> <limits> <map> <memory> <optional>
      <span> <string> <string_view> <utility> <vector> ${ARGN})
  endif()
endfunction()

# dermis_precompile_as(TARGET OTHER): uses the precompiled headers of OTHER, whose compile options must be the same.
function(dermis_precompile_as target other)
  if(DERMIS_PRECOMPILES)
    target_precompile_headers(${target} REUSE_FROM ${other})
  endif()
endfunction()
