#!/bin/sh
# Installs what Dermis needs to build and to run its tests, from Debian's packages (12 or 13). If everything is installed, it does
# nothing and needs no privileges. On another system it lists the packages and ends with an error.
#
#   cmake/install-deps.sh [sanitized|showcase|nightly|windows|x86|arm64|libcxx]
#
# sanitized: also what the sanitized half of tests/run.sh needs. showcase: also what DERMIS_BUILD_SHOWCASE needs. nightly: also what
# tests/run.sh nightly needs. The others: also what its part of that name needs.
set -eu

packages="
cmake ninja-build g++
libvulkan-dev mesa-vulkan-drivers vulkan-validationlayers
glslang-dev glslang-tools spirv-tools
libhwy-dev
libglm-dev libtinygltf-dev nlohmann-json3-dev libmeshoptimizer-dev libdraco-dev
libcli11-dev libfmt-dev
pkg-config libvulkan-volk-dev dpkg-dev file
libstb-dev fonts-dejavu-core
libgtest-dev libbenchmark-dev libx11-dev
doxygen
"
if [ "${1:-}" = nightly ]; then
  packages="$packages
ffmpeg blender python3-numpy python3-cffi python3-matplotlib bindgen rustc spirv-cross
debootstrap lintian
"
  command -v npm >/dev/null 2>&1 || packages="$packages nodejs npm" # from wherever they are
fi

case ${1:-} in
  sanitized|nightly) packages="$packages clang libclang-rt-dev" ;; # the latter: sanitizers and libFuzzer
esac
case ${1:-} in
  showcase|nightly) packages="$packages libsdl2-dev libimgui-dev xvfb xdotool" ;;
  windows) packages="$packages googletest g++-mingw-w64-x86-64-posix wine wine64" ;;
  x86) packages="$packages googletest g++-i686-linux-gnu" ;;
  arm64) packages="$packages googletest g++-aarch64-linux-gnu qemu-user" ;;
  libcxx) # 16 is the first that has all that Dermis uses; Debian 12's own is 14, Debian 13's is newer
    version=
    if apt-cache show clang-16 >/dev/null 2>&1; then version=-16; fi
    packages="$packages googletest clang$version libc++$version-dev libc++abi$version-dev"
    ;;
esac

if ! command -v dpkg-query >/dev/null 2>&1; then
  echo "install-deps: this is not Debian; Dermis needs the equivalents of these packages:" >&2
  for package in $packages; do echo "  $package" >&2; done
  exit 1
fi

missing=
for package in $packages; do
  state=$(dpkg-query -W -f='${db:Status-Abbrev}' "$package" 2>/dev/null || true)
  case $state in
    ii*) ;;
    *) missing="$missing $package" ;;
  esac
done
[ -n "$missing" ] || exit 0

if [ "$(id -u)" -eq 0 ]; then
  as_root=
elif command -v sudo >/dev/null 2>&1; then
  as_root=sudo
else
  echo "install-deps: run as root, or install sudo; these packages are missing:$missing" >&2
  exit 1
fi

echo "install-deps: installing$missing"
export DEBIAN_FRONTEND=noninteractive
$as_root apt-get update -q
# shellcheck disable=SC2086 # a list of words
$as_root apt-get install -y -q --no-install-recommends $missing
