#!/bin/sh
# Tests Dermis on clean Debian systems, which contain only what docs/building.md tells a reader to install: from the Debian
# packages, and from the source package without glslang. Builds programs there, and runs them on lavapipe.
#
#   tests/nightly/debian.sh FOLDER SOURCE-PACKAGE RELEASE [PACKAGE.deb...]
#
# Makes a system of that release in FOLDER, by debootstrap from the mirror that apt on this machine uses; needs root. The packages
# must have been built on the same release. Debian packages are also built there from the source package. Removes FOLDER if
# everything passed.
set -eu
[ "$(id -u)" -eq 0 ] || { echo "debian: debootstrap needs root" >&2; exit 1; }
mkdir -p "$1"
root=$(cd "$1" && pwd)/$3
source_package=$2
release=$3
shift 3
consumers=$(cd "$(dirname "$0")/../package/consumers" && pwd)
tools="ca-certificates g++ cmake ninja-build pkg-config mesa-vulkan-drivers"
build_needs="dpkg-dev file libvulkan-dev libhwy-dev libglm-dev libtinygltf-dev nlohmann-json3-dev libmeshoptimizer-dev libdraco-dev"
version=$(basename "$source_package" .tar.gz)
version=${version#dermis-}

say() { echo "debian: $release: $*"; }

inside() { # COMMAND...: runs it in the clean system; prints its output only if it fails
  chroot "$root" /usr/bin/env -i PATH=/sbin:/bin:/usr/sbin:/usr/bin HOME=/root LC_ALL=C.UTF-8 DEBIAN_FRONTEND=noninteractive \
    "$@" >"$root/log" 2>&1 || { cat "$root/log"; say "failed: $*"; exit 1; }
}

apt() { inside apt-get -q -y --no-install-recommends "$@"; }

expect() { # TEXT: must be in the output of the last command
  grep -q -e "$1" "$root/log" || { cat "$root/log"; say "it does not say '$1'"; exit 1; }
}

has_no_glslang() {
  inside sh -c "dpkg-query -W -f '\${Package}\n' | grep -E 'glslang|spirv-tools|libdermis' || echo none"
  grep -q none "$root/log" || { cat "$root/log"; say "the system is not clean"; exit 1; }
}

check() { # PREFIX: checks that programs find Dermis there, and skin
  say "building programs against $1"
  rm -rf "$root/root/try"
  mkdir -p "$root/root/try"
  cp -r "$consumers" "$root/root/try"
  cp -r "$root$1/share/doc/dermis/samples" "$root/root/try"
  search=
  [ "$1" = /usr ] || search=-DCMAKE_PREFIX_PATH=$1
  for project in samples/minimal samples/allocator samples/c consumers/ways; do
    inside cmake -S "/root/try/$project" -B "/root/try/$project/build" -G Ninja "-DDERMIS_VERSION=$version" $search
    inside cmake --build "/root/try/$project/build"
  done
  inside /root/try/consumers/ways/build/ways_consumer
  for sample in minimal/build/dermis_minimal allocator/build/dermis_allocator c/build/dermis_c_minimal; do
    inside "/root/try/samples/$sample"
    expect "every vertex is right"
  done

  paths=$(find "$root$1/lib" -name dermis.pc -printf '%h' | sed "s|^$root||")
  [ "$1" != /usr ] || paths=
  inside sh -c "PKG_CONFIG_PATH=$paths; export PKG_CONFIG_PATH; g++ -std=c++20 /root/try/samples/minimal/main.cpp \
    \$(pkg-config --cflags --libs dermis dermis_verify vulkan) -o /root/try/by_pkg_config"
  inside /root/try/by_pkg_config
  expect "every vertex is right"
  if [ "$release" != bookworm ]; then # which has no Vulkan Memory Allocator
    inside sh -c "PKG_CONFIG_PATH=$paths; export PKG_CONFIG_PATH; printf '#include <%s>\n' vk_mem_alloc.h dermis/vulkan/vma.h |
      g++ -std=c++20 -fsyntax-only \$(pkg-config --cflags dermis) -x c++ -"
  fi
}

check_packages() { # PACKAGE...: installs them with their dependencies, checks and removes them
  say "installing $*"
  apt install "$@"
  check /usr
  if [ -e "$root/usr/bin/dermis" ]; then
    inside dermis devices
    expect llvmpipe
  fi
  names=
  for package in "$@"; do names="$names $(dpkg-deb -f "$root$package" Package)"; done
  # shellcheck disable=SC2086 # a list of words
  apt purge --autoremove $names
  left=$(find "$root/usr" -iname '*dermis*')
  [ -z "$left" ] || { say "removing the packages left $left"; exit 1; }
}

site=$(apt-get indextargets --format '$(SITE) $(COMPONENT)' 'Created-By: Packages' | awk '$2 == "main" { print $1; exit }')
[ -n "$site" ] || { say "apt on this machine names no mirror" >&2; exit 1; }
say "making a clean system"
rm -rf "$root"
mkdir -p "$root"
debootstrap --variant=minbase "$release" "$root" "$site" >"$root.log" 2>&1 || { tail -n 20 "$root.log"; exit 1; }
[ "$release" = bookworm ] || tools="$tools libvulkan-memory-allocator-dev"
# shellcheck disable=SC2086 # a list of words
apt install $tools

if [ $# -ne 0 ]; then
  has_no_glslang
  mkdir -p "$root/root/packages"
  names=
  for package in "$@"; do
    cp "$package" "$root/root/packages"
    names="$names /root/packages/$(basename "$package")"
  done
  # shellcheck disable=SC2086 # a list of words
  check_packages $names
fi

say "building the source package"
# shellcheck disable=SC2086 # a list of words
apt install $build_needs
has_no_glslang
tar -C "$root/root" -xzf "$source_package"
inside cmake -S "/root/dermis-$version" -B /root/build -G Ninja -DCMAKE_INSTALL_PREFIX=/usr
inside cmake --build /root/build
inside cmake --install /root/build --prefix /opt/dermis
check /opt/dermis
inside cmake --build /root/build --target package
rm -rf "$root/opt/dermis"
# shellcheck disable=SC2086 # a list of words
apt purge --autoremove $build_needs
architecture=$(dpkg --print-architecture)
shared=$(cd "$root" && echo root/build/libdermis[0-9]*_"$version-1_$architecture".deb)
check_packages "/root/build/libdermis-dev_$version-1_$architecture.deb" "/$shared"

rm -rf "$root" "$root.log"
say "all is right"
