#!/bin/sh
# Runs the device tests on a clean Debian 13, whose compiler and validation layer are newer than Debian 12's: under its own layer, then
# under that of Debian's unstable release.
#
#   tests/nightly/layers.sh FOLDER
#
# Makes the system in FOLDER, by debootstrap from the mirror that apt on this machine uses; needs root. Removes FOLDER if everything
# passed.
set -eu
[ "$(id -u)" -eq 0 ] || { echo "layers: debootstrap needs root" >&2; exit 1; }
mkdir -p "$1"
root=$(cd "$1" && pwd)/trixie
source=$(cd "$(dirname "$0")/../.." && pwd)

inside() { # COMMAND...: runs it in the clean system, in a copy of the source
  chroot "$root" /usr/bin/env -i PATH=/sbin:/bin:/usr/sbin:/usr/bin HOME=/root LC_ALL=C.UTF-8 DEBIAN_FRONTEND=noninteractive \
    CI="${CI:-true}" ${data:+DERMIS_TEST_DATA=/root/shared} sh -euc "cd /root/dermis && $1"
}

quietly() { # COMMAND: prints its output only if it fails
  inside "$1" >"$root.log" 2>&1 || { cat "$root.log"; exit 1; }
}

run_tests() { # [SETTINGS]
  inside "${1:-:}; ctest --test-dir build/ci --output-on-failure --no-tests=error --timeout 1700 -j $(nproc) -L device \
    >tests.log 2>&1 || { grep -v -E '^ +Start +[0-9]+: | Passed +[0-9.]+ sec$' tests.log; exit 1; }; tail -n 12 tests.log"
}

site=$(apt-get indextargets --format '$(SITE) $(COMPONENT)' 'Created-By: Packages' | awk '$2 == "main" { print $1; exit }')
[ -n "$site" ] || { echo "layers: apt on this machine names no mirror" >&2; exit 1; }
! mountpoint -q "$root/proc" || umount "$root/proc"
rm -rf "$root"
mkdir -p "$root"
debootstrap --variant=minbase trixie "$root" "$site" >"$root.log" 2>&1 || { tail -n 20 "$root.log"; exit 1; }
mount -t proc proc "$root/proc"
trap 'umount "$root/proc"' EXIT
mkdir -p "$root/root/dermis"
git -C "$source" ls-files -z | tar -C "$source" --null -T - -cf - | tar -C "$root/root/dermis" -xf -
data=${DERMIS_TEST_DATA:-$source/../shared}
if [ -d "$data/models" ]; then
  mkdir -p "$root/root/shared"
  cp -r "$data/models" "$data/golden" "$root/root/shared"
else
  data=
fi
quietly "./cmake/install-deps.sh"
quietly "cmake --preset ci && cmake --build build/ci --target gpu_test system_test"

echo "layers: under Debian 13's own layer"
inside "dpkg-query -W vulkan-validationlayers"
run_tests

apt="apt-get -q -o Dir::Etc::sourcelist=/root/unstable.list -o Dir::Etc::sourceparts=- -o Dir::State::lists=/root/lists -o APT::Sandbox::User=root"
echo "deb [check-valid-until=no] $site sid main" >"$root/root/unstable.list"
mkdir -p "$root/root/lists/partial" "$root/root/layer"
quietly "cd /root/layer && $apt update && $apt download vulkan-validationlayers && dpkg -x ./*.deb . && rm ./*.deb"
echo "layers: under the newest"
layer=$(find "$root/root/layer" -name 'libVkLayer_khronos_validation.so' -printf '%h')
manifests=$(find "$root/root/layer" -name 'VkLayer_khronos_validation.json' -printf '%h')
inside "grep -m 1 api_version ${manifests#"$root"}/VkLayer_khronos_validation.json"
run_tests "export VK_LAYER_PATH=${manifests#"$root"} LD_LIBRARY_PATH=${layer#"$root"}"

umount "$root/proc"
trap - EXIT
rm -rf "$root" "$root.log"
