# Debian packages: `cmake --build BUILD --target package`, or cpack, or all steps by `cmake --workflow --preset debian`.
#
#   libdermis-dev      the libraries, their headers, the CMake package, pkg-config's files, the shaders, the documents
#   libdermis0.1       the shared libraries of the C interface
#   dermis             the command, if the samples are built
#
# The C++ libraries are static, so the package is for the release of Debian that it was built on. -DCPACK_PACKAGE_CONTACT sets another
# maintainer.

set(notes ${PROJECT_BINARY_DIR}/install/debian)

# copyright: LICENSE, in the format that Debian's tools read.
file(READ ${PROJECT_SOURCE_DIR}/LICENSE license)
string(REGEX MATCH "Copyright [(]c[)] ([^\n]*)\n+(.*)" ignored "${license}")
set(holders "${CMAKE_MATCH_1}")
string(STRIP "${CMAKE_MATCH_2}" license)
string(REPLACE "\n\n" "\n.\n" license "${license}")
string(REPLACE "\n" "\n " license "${license}")
file(WRITE ${notes}/copyright "Format: https://www.debian.org/doc/packaging-manuals/copyright-format/1.0/
Upstream-Name: ${PROJECT_NAME}

Files: *
Copyright: ${holders}
License: Expat
 ${license}
")

# changelog.Debian.gz describes the package. The changes of Dermis are in CHANGELOG.md.
if(NOT CPACK_PACKAGE_CONTACT)
  set(CPACK_PACKAGE_CONTACT "The Dermis authors <dermis@packages.invalid>")
endif()
string(TIMESTAMP date "%a, %d %b %Y %H:%M:%S +0000" UTC)
file(WRITE ${notes}/changelog "dermis (${PROJECT_VERSION}-1) unstable; urgency=medium

  * Built by CPack. What changed is in CHANGELOG.md.

 -- ${CPACK_PACKAGE_CONTACT}  ${date}
")
execute_process(COMMAND gzip -9 -n -c changelog WORKING_DIRECTORY ${notes} OUTPUT_FILE ${notes}/changelog.Debian.gz
                COMMAND_ERROR_IS_FATAL ANY)

# dermis_debian_package(COMPONENT PACKAGE SECTION DESCRIPTION FIELD=VALUE...). The first line of the description is the project's.
function(dermis_debian_package component package section description)
  string(TOUPPER ${component} upper)
  set(CPACK_COMPONENTS_ALL ${CPACK_COMPONENTS_ALL} ${component} PARENT_SCOPE)
  set(CPACK_DEBIAN_${upper}_PACKAGE_NAME ${package} PARENT_SCOPE)
  set(CPACK_DEBIAN_${upper}_PACKAGE_SECTION ${section} PARENT_SCOPE)
  set(CPACK_COMPONENT_${upper}_DESCRIPTION "${description}" PARENT_SCOPE)
  foreach(field IN LISTS ARGN)
    string(REGEX MATCH "^([A-Z_]+)=(.*)$" ignored "${field}")
    string(REPLACE "|/" ";/" value "${CMAKE_MATCH_2}")
    set(CPACK_DEBIAN_${upper}_${CMAKE_MATCH_1} "${value}" PARENT_SCOPE)
  endforeach()
  install(FILES ${notes}/copyright ${notes}/changelog.Debian.gz DESTINATION ${CMAKE_INSTALL_DATADIR}/doc/${package}
          COMPONENT ${component} EXCLUDE_FROM_ALL)
endfunction()

set(CPACK_COMPONENTS_ALL)
set(depends)
set(suggests)
if(vulkan IN_LIST dermisComponents)
  list(APPEND depends libvulkan-dev)
endif()
if(cpu IN_LIST dermisComponents)
  list(APPEND depends libhwy-dev)
endif()
list(TRANSFORM dermisDecoders REPLACE "(.+)" "lib\\1-dev" OUTPUT_VARIABLE decoderPackages)
list(APPEND depends ${decoderPackages})
if(shader_compiler IN_LIST dermisComponents)
  list(APPEND suggests glslang-dev glslang-tools spirv-tools)
endif()
if(c IN_LIST dermisComponents)
  list(APPEND depends "libdermis${DERMIS_SOVERSION} (= ${PROJECT_VERSION}-1)")
  # The dynamic linker finds new libraries once its cache has been made again.
  file(WRITE ${notes}/triggers "activate-noawait ldconfig\n")
  set(libraries "libdermis ${DERMIS_SOVERSION} libdermis${DERMIS_SOVERSION} (>= ${PROJECT_VERSION})\n")
  if(c_compare IN_LIST dermisComponents)
    string(APPEND libraries "libdermis_compare ${DERMIS_SOVERSION} libdermis${DERMIS_SOVERSION} (>= ${PROJECT_VERSION})\n")
  endif()
  file(WRITE ${notes}/shlibs "${libraries}")
  dermis_debian_package(dermis_shared libdermis${DERMIS_SOVERSION} libs "Dermis skins characters on the GPU that an engine lends it. This
package has the shared libraries of its C interface."
    PACKAGE_SHLIBDEPS=ON PACKAGE_CONTROL_EXTRA=${notes}/triggers|${notes}/shlibs)
endif()
list(JOIN depends ", " depends)
list(JOIN suggests ", " suggests)
dermis_debian_package(dermis libdermis-dev libdevel "Dermis skins characters on the GPU that an engine lends it. This package
has its static libraries, headers, shaders and documents."
  PACKAGE_DEPENDS=${depends} PACKAGE_SUGGESTS=${suggests})
if(TARGET dermis_cli)
  dermis_debian_package(dermis_command dermis graphics "The command dermis skins and renders glTF models, compares skinning
methods, and checks and times them on a Vulkan device."
    PACKAGE_SHLIBDEPS=ON PACKAGE_DEPENDS=libvulkan1 "PACKAGE_RECOMMENDS=mesa-vulkan-drivers | vulkan-icd")
endif()

set(CPACK_GENERATOR DEB)
set(CPACK_DEB_COMPONENT_INSTALL ON)
set(CPACK_COMPONENTS_GROUPING IGNORE)
set(CPACK_PACKAGE_NAME dermis)
set(CPACK_PACKAGE_VERSION ${PROJECT_VERSION})
set(CPACK_DEBIAN_PACKAGE_RELEASE 1)
set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
set(CPACK_PACKAGING_INSTALL_PREFIX /usr)
set(CPACK_STRIP_FILES ON)
# CPack would add a target package_source, which is not the source package.
set(CPACK_SOURCE_OUTPUT_CONFIG_FILE ${PROJECT_BINARY_DIR}/install/CPackSourceConfig.cmake)
include(CPack)
