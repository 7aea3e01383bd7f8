# cmake --install: installs the libraries that were built, their headers, the kernels' sources, the CMake package `dermis`, files
# for pkg-config, and the command. The build folder is a CMake package too, for an engine that uses Dermis from there.
#
# Each library is a component of the package with its own export file, dermis_NAME_targets.cmake, so that a consumer of dermis::core
# needs none of the dependencies of the other libraries.

include(GNUInstallDirs)
include(CMakePackageConfigHelpers)

set(dermisPackageDir ${CMAKE_INSTALL_LIBDIR}/cmake/dermis)
set(dermisShaderDir ${CMAKE_INSTALL_DATADIR}/dermis/shaders)
# The headers that belong to one component. All others belong to core.
set(dermisHeaders_cpu cpu.h)
set(dermisHeaders_verify verify.h)
set(dermisHeaders_vulkan vulkan)
set(dermisHeaders_shader_compiler compilers.h)
set(dermisHeaders_gltf gltf.h)
set(dermisHeaders_c dermis.h)

get_property(dermisLibraries GLOBAL PROPERTY DERMIS_LIBRARIES)
set(dermisComponents)
foreach(library IN LISTS dermisLibraries)
  get_target_property(component ${library} EXPORT_NAME)
  list(APPEND dermisComponents ${component})
  install(TARGETS ${library} EXPORT dermis_${component}
          ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR} COMPONENT dermis
          LIBRARY DESTINATION ${CMAKE_INSTALL_LIBDIR} COMPONENT dermis_shared NAMELINK_COMPONENT dermis
          RUNTIME DESTINATION ${CMAKE_INSTALL_BINDIR} COMPONENT dermis
          INCLUDES DESTINATION ${CMAKE_INSTALL_INCLUDEDIR})
  install(EXPORT dermis_${component} NAMESPACE dermis:: DESTINATION ${dermisPackageDir}
          FILE dermis_${component}_targets.cmake COMPONENT dermis)
  export(EXPORT dermis_${component} NAMESPACE dermis:: FILE ${PROJECT_BINARY_DIR}/dermis_${component}_targets.cmake)
endforeach()

set(excluded)
foreach(component IN ITEMS cpu verify vulkan shader_compiler gltf c)
  if(NOT component IN_LIST dermisComponents)
    foreach(header IN LISTS dermisHeaders_${component})
      list(APPEND excluded PATTERN dermis/${header} EXCLUDE)
    endforeach()
  endif()
endforeach()
install(DIRECTORY ${PROJECT_SOURCE_DIR}/engine/include/dermis DESTINATION ${CMAKE_INSTALL_INCLUDEDIR} COMPONENT dermis
        FILES_MATCHING PATTERN "*.h" ${excluded})

# For engines with their own RHI, which compile the kernels themselves and read the records of abi.h. dermis_decode.glsl is for an
# engine's own shaders.
install(DIRECTORY ${PROJECT_SOURCE_DIR}/shaders/ DESTINATION ${dermisShaderDir} COMPONENT dermis
        FILES_MATCHING PATTERN "*.h" PATTERN "*.glsl" PATTERN "*.comp")
set(dermisDocDir ${CMAKE_INSTALL_DATADIR}/doc/dermis)
install(FILES ${PROJECT_SOURCE_DIR}/LICENSE ${PROJECT_SOURCE_DIR}/README.md ${PROJECT_SOURCE_DIR}/CHANGELOG.md ${PROJECT_SOURCE_DIR}/SECURITY.md
        DESTINATION ${dermisDocDir} COMPONENT dermis)
install(FILES ${PROJECT_SOURCE_DIR}/engine/README.md DESTINATION ${dermisDocDir}/engine COMPONENT dermis)
install(DIRECTORY ${PROJECT_SOURCE_DIR}/docs DESTINATION ${dermisDocDir} COMPONENT dermis)
foreach(sample IN ITEMS minimal allocator gpu_poses c python)
  install(DIRECTORY ${PROJECT_SOURCE_DIR}/samples/${sample} DESTINATION ${dermisDocDir}/samples COMPONENT dermis)
endforeach()

# Declarations for Python's cffi and LuaJIT's ffi.
get_property(declarations GLOBAL PROPERTY DERMIS_CDEF)
if(declarations)
  install(FILES ${declarations} DESTINATION ${CMAKE_INSTALL_DATADIR}/dermis COMPONENT dermis)
endif()

# What a program links besides a static dermis::gltf.
set(dermisLinkedDecoders)
if(NOT BUILD_SHARED_LIBS)
  set(dermisLinkedDecoders ${dermisDecoders})
endif()
list(TRANSFORM dermisLinkedDecoders REPLACE "(.+)" "\\1=\\1::\\1" OUTPUT_VARIABLE dermisDecoderTargets)

# The libraries that those of the C interface are made of. Shared ones contain static ones.
set(dermisBuiltOn_c_static core cpu vulkan)
if(DERMIS_BUILD_GLTF)
  list(APPEND dermisBuiltOn_c_static gltf)
endif()
set(dermisBuiltOn_c)
set(dermisBuiltOn_c_compare)
if(BUILD_SHARED_LIBS)
  set(dermisBuiltOn_c ${dermisBuiltOn_c_static})
  set(dermisBuiltOn_c_compare core verify)
endif()

# Once for the installed package, and once for the build folder.
file(RELATIVE_PATH shaderDirFromPackage /${dermisPackageDir} /${dermisShaderDir})
configure_file(${PROJECT_SOURCE_DIR}/cmake/dermisConfig.cmake.in ${PROJECT_BINARY_DIR}/install/dermisConfig.cmake @ONLY)
file(RELATIVE_PATH shaderDirFromPackage ${PROJECT_BINARY_DIR} ${PROJECT_SOURCE_DIR}/shaders)
configure_file(${PROJECT_SOURCE_DIR}/cmake/dermisConfig.cmake.in ${PROJECT_BINARY_DIR}/dermisConfig.cmake @ONLY)
# While the version is 0.x, a minor version may change the interface.
write_basic_package_version_file(${PROJECT_BINARY_DIR}/dermisConfigVersion.cmake
  VERSION ${PROJECT_VERSION} COMPATIBILITY SameMinorVersion)
install(FILES ${PROJECT_BINARY_DIR}/install/dermisConfig.cmake ${PROJECT_BINARY_DIR}/dermisConfigVersion.cmake
        DESTINATION ${dermisPackageDir} COMPONENT dermis)

# pkg-config: `dermis` is core and vulkan; `dermis_NAME` is one of the libraries, except the two compilers; `dermis-c` and
# `dermis-c-compare` are the C interface. Paths are relative to the file.
file(RELATIVE_PATH pkgConfigPrefix /${CMAKE_INSTALL_LIBDIR}/pkgconfig /)
set(pkgConfigFlags)
if(BUILD_SHARED_LIBS)
  set(pkgConfigFlags " -DDERMIS_SHARED")
endif()
set(pkgConfigRequires_cpu "dermis_core libhwy")
set(pkgConfigRequires_verify dermis_core)
set(pkgConfigRequires_vulkan dermis_core)
set(pkgConfigRequires_gltf dermis_core)
list(TRANSFORM dermisLinkedDecoders PREPEND " -l" OUTPUT_VARIABLE pkgConfigLibraries_gltf)
list(JOIN pkgConfigLibraries_gltf "" pkgConfigLibraries_gltf)
# dermis_pkg_config(NAME REQUIRES LIBRARY): LIBRARY may be empty.
function(dermis_pkg_config name requires library)
  configure_file(${PROJECT_SOURCE_DIR}/cmake/dermis.pc.in ${PROJECT_BINARY_DIR}/install/${name}.pc @ONLY)
  install(FILES ${PROJECT_BINARY_DIR}/install/${name}.pc DESTINATION ${CMAKE_INSTALL_LIBDIR}/pkgconfig COMPONENT dermis)
endfunction()
set(required)
foreach(component IN LISTS dermisComponents)
  if(component STREQUAL "c")
    dermis_pkg_config(dermis-c "" "-L\${libdir} -ldermis")
  elseif(component STREQUAL "c_compare")
    dermis_pkg_config(dermis-c-compare dermis-c "-L\${libdir} -ldermis_compare")
  elseif(NOT component MATCHES "_compiler$|_static$")
    dermis_pkg_config(dermis_${component} "${pkgConfigRequires_${component}}" "-L\${libdir} -ldermis_${component}${pkgConfigLibraries_${component}}")
  endif()
  if(component MATCHES "^(core|vulkan)$")
    string(APPEND required "dermis_${component} ")
  endif()
endforeach()
string(STRIP "${required}" required)
dermis_pkg_config(dermis "${required}" "")

if(TARGET dermis_cli AND NOT BUILD_SHARED_LIBS)
  install(TARGETS dermis_cli RUNTIME DESTINATION ${CMAKE_INSTALL_BINDIR} COMPONENT dermis_command)
endif()

find_program(DERMIS_DPKG_DEB dpkg-deb DOC "Makes Debian packages")
mark_as_advanced(DERMIS_DPKG_DEB)
if(PROJECT_IS_TOP_LEVEL AND DERMIS_DPKG_DEB AND NOT BUILD_SHARED_LIBS AND NOT CMAKE_CROSSCOMPILING)
  include(DermisPackage)
endif()
