# How a target of Dermis is compiled. What is set here stays inside: nothing reaches a target that links Dermis.

add_library(dermis_build_flags INTERFACE)
target_compile_options(dermis_build_flags INTERFACE
  -Wall -Wextra -Wpedantic -Wshadow -Wconversion -Wsign-conversion -Wnon-virtual-dtor -Wold-style-cast
  -Wimplicit-fallthrough -Wundef
  # One rounding an operation, on every machine: the reference and the packing must not depend on fused operations.
  -ffp-contract=off
  # Position-independent code may be inlined too: nobody replaces a function of Dermis while a program is loaded.
  -fno-semantic-interposition)
if(DERMIS_WARNINGS_AS_ERRORS)
  target_compile_options(dermis_build_flags INTERFACE -Werror)
endif()
if(DERMIS_BUILD_FUZZERS)
  target_compile_options(dermis_build_flags INTERFACE -fsanitize=fuzzer-no-link)
endif()
if(DERMIS_SANITIZE STREQUAL "address")
  target_compile_options(dermis_build_flags INTERFACE
    -fsanitize=address,undefined -fno-sanitize-recover=all -fno-omit-frame-pointer)
  target_link_options(dermis_build_flags INTERFACE -fsanitize=address,undefined)
elseif(DERMIS_SANITIZE STREQUAL "thread")
  target_compile_options(dermis_build_flags INTERFACE -fsanitize=thread -fno-omit-frame-pointer)
  target_link_options(dermis_build_flags INTERFACE -fsanitize=thread)
elseif(DERMIS_SANITIZE)
  message(FATAL_ERROR "DERMIS_SANITIZE is '${DERMIS_SANITIZE}': it may be address, thread or empty")
endif()

# dermis_configure_target(TARGET): the language level and the private flags of every target.
function(dermis_configure_target target)
  target_compile_features(${target} PUBLIC cxx_std_20)
  set_target_properties(${target} PROPERTIES CXX_EXTENSIONS OFF POSITION_INDEPENDENT_CODE ON)
  target_link_libraries(${target} PRIVATE $<BUILD_INTERFACE:dermis_build_flags>)
endfunction()

# dermis_add_library(NAME SOURCES...): a static library dermis_NAME with the alias dermis::NAME, public headers from
# engine/include, installed with the package.
function(dermis_add_library name)
  add_library(dermis_${name} STATIC ${ARGN})
  add_library(dermis::${name} ALIAS dermis_${name})
  set_target_properties(dermis_${name} PROPERTIES EXPORT_NAME ${name})
  target_include_directories(dermis_${name}
    PUBLIC $<BUILD_INTERFACE:${PROJECT_SOURCE_DIR}/engine/include>
    PRIVATE ${PROJECT_SOURCE_DIR}/engine/src)
  dermis_configure_target(dermis_${name})
  set_property(GLOBAL APPEND PROPERTY DERMIS_LIBRARIES dermis_${name})
endfunction()

# Code on the engine's side of the interface: no exception leaves it, so none is compiled in.
function(dermis_without_exceptions target)
  target_compile_options(${target} PRIVATE -fno-exceptions -fno-rtti)
endfunction()
