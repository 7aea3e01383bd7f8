# Dermis' dependencies, for a system for which Debian has no packages: header-only libraries are taken from this machine, and
# Highway and GoogleTest are compiled from their sources. The `find_package` calls of Dermis find these.
#
# /usr/include itself must not be an include folder, because it contains this machine's C library. So a folder of links is made.

set(headers ${CMAKE_BINARY_DIR}/include)
file(MAKE_DIRECTORY ${headers})
foreach(name IN ITEMS CLI fmt glm nlohmann stb tiny_gltf.h vk_video vulkan)
  if(NOT EXISTS /usr/include/${name})
    message(FATAL_ERROR "/usr/include/${name} is missing; cmake/install-deps.sh installs it")
  endif()
  file(CREATE_LINK /usr/include/${name} ${headers}/${name} SYMBOLIC)
endforeach()
set(DERMIS_TINYGLTF_INCLUDE_DIR ${headers} CACHE PATH "" FORCE)
set(DERMIS_STB ${headers} CACHE PATH "" FORCE)

# header_package(PACKAGE TARGET)
function(header_package package target)
  add_library(${target} INTERFACE IMPORTED GLOBAL)
  target_include_directories(${target} INTERFACE ${headers})
  file(WRITE ${CMAKE_FIND_PACKAGE_REDIRECTS_DIR}/${package}-config.cmake "")
endfunction()
header_package(cli11 CLI11::CLI11)
header_package(fmt fmt::fmt)
header_package(glm glm::glm)
header_package(nlohmann_json nlohmann_json::nlohmann_json)
header_package(vulkanheaders Vulkan::Headers)
header_package(vulkan Vulkan::Vulkan) # without a loader: samples that link it are not built
foreach(package IN ITEMS spirv-tools spirv-tools-opt) # optional, and not used: they would have to be compiled too
  file(WRITE ${CMAKE_FIND_PACKAGE_REDIRECTS_DIR}/${package}-config.cmake "")
endforeach()
target_compile_definitions(fmt::fmt INTERFACE FMT_HEADER_ONLY)

file(GLOB highwaySources ${DERMIS_HIGHWAY_SOURCES}/*/hwy/*.cc)
list(FILTER highwaySources EXCLUDE REGEX "_test\\.cc$|nanobenchmark")
if(NOT highwaySources)
  message(FATAL_ERROR "DERMIS_HIGHWAY_SOURCES has no Highway; tests/cross/unpack_highway.sh puts it there")
endif()
list(GET highwaySources 0 highwayFolder)
cmake_path(GET highwayFolder PARENT_PATH highwayFolder)
cmake_path(GET highwayFolder PARENT_PATH highwayFolder)
add_library(hwy STATIC ${highwaySources})
target_compile_features(hwy PUBLIC cxx_std_17)
target_include_directories(hwy SYSTEM PUBLIC ${highwayFolder})
set_target_properties(hwy PROPERTIES POSITION_INDEPENDENT_CODE ON)
add_library(hwy::hwy ALIAS hwy)

add_subdirectory(/usr/src/googletest/googletest googletest EXCLUDE_FROM_ALL)
if(NOT TARGET GTest::gtest)
  add_library(GTest::gtest ALIAS gtest)
endif()
