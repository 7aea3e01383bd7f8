#!/bin/sh
# Prints the sizes of Dermis' libraries and of a program, as in the table in docs/building.md.
#
#   tests/package/sizes.sh KERNELS FOLDER
#
# KERNELS is the folder of dermis_kernels.cpp: BUILD/shaders/dermis_kernels. FOLDER receives the builds. $CXX is the compiler; the
# default is c++. "Lean" means without DERMIS_COMPARISON_METHODS. Everything is built with CMake's Release
# flags and stripped.
set -eu
source=$(cd "$(dirname "$0")/../.." && pwd)
kernels=$(cd "$1" && pwd)
mkdir -p "$2"
folder=$(cd "$2" && pwd)
compiler=${CXX:-c++}
log=$folder/log
: >"$log"

quietly() {
  "$@" >>"$log" 2>&1 || { tail -n 40 "$log"; exit 1; }
}

stripped() { # FILE OPTION: its size in KiB
  strip "$2" -o "$folder/stripped" "$1"
  echo $((($(stat -L -c %s "$folder/stripped") + 512) / 1024))
}

program() { # BUILD LINKER-FLAGS: samples/minimal
  quietly cmake -S "$source/samples/minimal" -B "$folder/minimal" -G Ninja -DCMAKE_CXX_COMPILER="$compiler" -DCMAKE_BUILD_TYPE=Release \
    "-Ddermis_DIR=$1" "-DCMAKE_EXE_LINKER_FLAGS=$2"
  quietly cmake --build "$folder/minimal" --clean-first
  stripped "$folder/minimal/dermis_minimal" -s
}

measure() { # ON|OFF: the lines of the table, NAME|SIZE
  for shared in OFF ON; do
    build=$folder/shared-$shared
    quietly cmake -S "$source" -B "$build" -G Ninja -DCMAKE_CXX_COMPILER="$compiler" -DCMAKE_BUILD_TYPE=Release "-DDERMIS_EMBEDDED_SHADERS=$kernels" \
      "-DBUILD_SHARED_LIBS=$shared" "-DDERMIS_COMPARISON_METHODS=$1" -DDERMIS_BUILD_CPU=OFF \
      -DDERMIS_BUILD_GLTF=OFF -DDERMIS_BUILD_SAMPLES=OFF -DDERMIS_BUILD_TESTS=OFF -DDERMIS_BUILD_SHADER_COMPILER=OFF
    quietly cmake --build "$build"
    for library in core vulkan; do
      path=$build/engine/src/$library/libdermis_$library
      if [ "$shared" = OFF ]; then
        echo "\`libdermis_$library.a\`|$(stripped "$path.a" --strip-unneeded)"
      else
        echo "\`libdermis_$library.so\`|$(stripped "$path.so" --strip-unneeded)"
      fi
    done
    if [ "$shared" = OFF ]; then
      object=$(find "$build/shaders" -name 'dermis_kernels.cpp.o')
      echo "of that, SPIR-V|$(size -A "$object" | awk '$1 ~ /^\.rodata/ { bytes += $2 } END { print int(bytes / 1024 + 0.5) }')"
      echo "\`samples/minimal\`, static libraries|$(program "$build" "")"
      echo "\`samples/minimal\`, static libraries, \`--gc-sections\`|$(program "$build" -Wl,--gc-sections)"
    else
      echo "\`samples/minimal\`, shared libraries|$(program "$build" "")"
    fi
  done
}

measure ON >"$folder/complete"
measure OFF >"$folder/lean"
"$compiler" --version | head -n 1
echo
echo "| KiB | complete | lean |"
echo "| --- | ---: | ---: |"
paste -d '|' "$folder/complete" "$folder/lean" | awk -F '|' '{ print "| " $1 " | " $2 " | " $4 " |" }'
