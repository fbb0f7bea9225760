# An overlay port, which builds the sources that it lies in with cargo:
#
#   vcpkg install vrtm --overlay-ports=bindings/vcpkg --no-binarycaching
#
# vcpkg knows its own files alone, so that a cached build could be one of older sources.

vcpkg_check_linkage(ONLY_DYNAMIC_LIBRARY)
# One library, optimised, serves both configurations.
set(VCPKG_BUILD_TYPE release)
set(VCPKG_POLICY_MISMATCHED_NUMBER_OF_BINARIES enabled)
get_filename_component(source "${CURRENT_PORT_DIR}/../../.." ABSOLUTE)
vcpkg_check_features(OUT_FEATURE_OPTIONS features FEATURES gpu VRTM_GPU)
vcpkg_cmake_configure(SOURCE_PATH "${source}" OPTIONS ${features})
vcpkg_cmake_install()
vcpkg_fixup_pkgconfig()
vcpkg_cmake_config_fixup(CONFIG_PATH lib/cmake/vrtm)
# It lies one folder less deep now.
vcpkg_replace_string("${CURRENT_PACKAGES_DIR}/share/vrtm/vrtmConfig.cmake" "/../../.." "/../..")
vcpkg_install_copyright(FILE_LIST "${source}/LICENSE-MIT" "${source}/LICENSE-APACHE" "${source}/bindings/THIRD-PARTY.txt")
