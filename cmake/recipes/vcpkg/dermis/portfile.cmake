# An overlay port. It builds the source package (cmake --build BUILD --target source_package), which contains the compiled kernels and
# needs no glslang. Copy dermis-VERSION.tar.gz beside this file, then:
#
#   vcpkg install dermis[core,cpu,gltf] --overlay-ports=cmake/recipes/vcpkg
vcpkg_extract_source_archive(SOURCE_PATH ARCHIVE "${CMAKE_CURRENT_LIST_DIR}/dermis-${VERSION}.tar.gz")

vcpkg_check_features(OUT_FEATURE_OPTIONS options
  FEATURES
    cpu DERMIS_BUILD_CPU
    verify DERMIS_BUILD_VERIFY
    gltf DERMIS_BUILD_GLTF
    gltf DERMIS_MESHOPTIMIZER
    gltf DERMIS_DRACO
    c DERMIS_BUILD_C)

vcpkg_cmake_configure(
  SOURCE_PATH "${SOURCE_PATH}"
  OPTIONS ${options} -DDERMIS_BUILD_SAMPLES=OFF -DDERMIS_BUILD_TESTS=OFF -DDERMIS_INSTALL=ON)
vcpkg_cmake_install()
vcpkg_cmake_config_fixup(PACKAGE_NAME dermis CONFIG_PATH lib/cmake/dermis)
vcpkg_fixup_pkgconfig()
file(REMOVE_RECURSE "${CURRENT_PACKAGES_DIR}/debug/include" "${CURRENT_PACKAGES_DIR}/debug/share")
vcpkg_install_copyright(FILE_LIST "${SOURCE_PATH}/LICENSE")
