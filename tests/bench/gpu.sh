#!/bin/sh
# Makes a folder of programs that measure and verify Dermis on another Linux machine, which needs only a Vulkan driver.
#
#   tests/bench/gpu.sh FOLDER [BUILD]
#
# BUILD is an existing build folder; without it, build/release is configured. Take FOLDER to the machine and run FOLDER/measure.sh
# there (docs/gpus.md). The folder contains all libraries except those of the driver and glibc, which must be at least the version
# in FOLDER/glibc.
set -eu
cd "$(dirname "$0")/../.."
folder=${1:?usage: tests/bench/gpu.sh FOLDER [BUILD]}
build=${2:-build/release}
if [ ! -f "$build/CMakeCache.txt" ]; then
  ./cmake/install-deps.sh
  cmake --preset release
fi
cmake --build "$build" --target dermis_cli dermis_gpu_benchmark dermis_system_benchmark cpu_test

rm -rf "$folder"
mkdir -p "$folder/lib" "$folder/loader" "$folder/runtime"
cp "$build/samples/cli/dermis" "$build/tests/bench/dermis_gpu_benchmark" "$build/tests/bench/dermis_system_benchmark" \
  "$build/tests/cpu_test" "$folder"
cp tests/bench/gpu_measure.sh "$folder/measure.sh"
programs="$folder/dermis $folder/dermis_gpu_benchmark $folder/dermis_system_benchmark $folder/cpu_test"
# shellcheck disable=SC2086 # a list of words, as below
strip $programs
git describe --always --dirty --abbrev=12 >"$folder/commit"

# In a separate folder: if the machine has a compiler's run-time libraries, its driver needs those, which may be newer or older.
# shellcheck disable=SC2086
ldd $programs | awk '$2 == "=>" { print $3 }' | sort -u |
  while read -r library; do
    case $(basename "$library") in
      libc.so.* | libm.so.* | libdl.so.* | libpthread.so.* | ld-linux*) ;;
      libstdc++.so.* | libgcc_s.so.*) cp -L "$library" "$folder/runtime" ;;
      *) cp -L "$library" "$folder/lib" ;;
    esac
  done
# Programs open it at run time. For a machine with a driver but without a loader.
loader=$(ldconfig -p | awk '/libvulkan\.so\.1 .*x86-64|libvulkan\.so\.1 .*AArch64/ { print $NF; exit }')
cp -L "$loader" "$folder/loader/libvulkan.so.1"

# shellcheck disable=SC2086
objdump -T $programs "$folder"/lib/* | grep -o 'GLIBC_[0-9][0-9.]*' | sort -uV | tail -n 1 | cut -d _ -f 2 >"$folder/glibc"
size=$(du -sk "$folder" | cut -f 1)
[ "$size" -le 65536 ] || { echo "gpu.sh: $folder has $size KiB, more than 64 MiB" >&2; exit 1; }
echo "$folder: $((size / 1024)) MiB, needs glibc $(cat "$folder/glibc")"
