#!/bin/sh
# The tests that take too long for every change, in parts of at most 30 minutes on two cores.
#
#   tests/run.sh nightly [PART...]      without PART: all, in this order
#
#   asan         the device tests of the engine, under the address and undefined-behavior sanitizers
#   asan-rest    all other tests under them
#   tsan         the thread sanitizer on the tests with threads and on the bookkeeping of scenes
#   clang        all of Dermis built by Clang, with the tests of the CPU's side and of the packages
#   debian       the Debian packages and the source package on clean systems, Debian 12 and 13, programs built and run there
#   layers       the device tests on a clean Debian 13, under its validation layer and under the newest one
#   windows      the engine and the command built by MinGW-w64; tests and the command run by Wine
#   x86          the same for 32-bit x86, run by this machine
#   arm64        the same for arm64, run by qemu
#   libcxx       the same by Clang with libc++
#   fuzz         each fuzzer for a minute, calls of the C interface for four
#   mutants      over two hundred mistakes planted in the engine, one at a time; a test must catch each (tests/mutants)
#   mesa         the device tests, ray tracing among them, and `dermis verify` on the lavapipe of Debian's backports
#   speed        `dermis bench` on both lavapipes: ratios within one run, with much room for a noisy machine
#   compilers    what the compilers of AMD's GPUs make of the kernels, without a GPU: more instructions than before, spills; HLSL, MSL
#   gpu          the device tests with the limits of other kinds of devices, and what measures a GPU, on lavapipe
#   exhaustive   every combination of methods and formats, and every real model, on the device
#   packages     ways to use Dermis that compile it again: as a subproject, from its source package, with another compiler
#   golden       the poses of three.js and Blender made again; they must be those in tests/golden
#   showcase     the viewer in a window, and the film of a crowd
#   languages    Python and Rust on the C interface: built, checked against the reference, and the speed of Python beside C++
#   programs     the quick start in a fresh clone, and films by a real ffmpeg
#
# Installs what it needs with cmake/install-deps.sh nightly. A part that passes is written to tests/nightly/passed.tsv with the
# date, the commit, the minutes that it took and the processor: the tests of the CPU path run its 512-bit code only where the processor
# has AVX-512; and with what the part counted, for docs/trust.md. Commit that file, after tests/documentation/regenerate.sh. A part
# that fails does not stop those after it.
set -eu
cd "$(dirname "$0")/../.."
export CI="${CI:-true}"
export ASAN_OPTIONS="${ASAN_OPTIONS:-detect_leaks=0}" # LLVM, inside lavapipe, keeps memory until the process ends
parts="asan asan-rest tsan clang debian layers windows x86 arm64 libcxx fuzz mutants mesa speed compilers gpu exhaustive packages golden showcase languages programs"
passed=tests/nightly/passed.tsv
figures=build/nightly/figures # what a part counted

build() { # PRESET [TARGET...]: configures and builds
  preset=$1
  shift
  cmake --preset "$preset"
  if [ $# -eq 0 ]; then set -- all; fi
  cmake --build "build/$preset" --target "$@"
}

tests() { # PRESET CTEST-ARGUMENTS...
  preset=$1
  shift
  log=build/$preset/nightly-tests.log
  outcome=0
  ctest --test-dir "build/$preset" --output-on-failure --no-tests=error --timeout 1700 -j "$(nproc)" "$@" >"$log" 2>&1 ||
    outcome=$?
  grep -v -E '^ +Start +[0-9]+: | Passed +[0-9.]+ sec$' "$log"
  return "$outcome"
}

part_asan() {
  build asan
  tests asan -L device
}

part_asan_rest() {
  build asan
  tests asan -LE 'nightly|device'
}

part_tsan() {
  # Races between lavapipe and the validation layer are ignored: neither was built with the sanitizer.
  export TSAN_OPTIONS="suppressions=$PWD/tests/nightly/tsan.supp halt_on_error=1 ${TSAN_OPTIONS:-}"
  build tsan gpu_test system_test
  tests tsan -R 'ThreadsTest|ModelTest'
  build tsan cpu_test
  tests tsan -R 'Cpu(Skin|Scene|Model)Test'
}

part_clang() {
  # Without precompiled headers, to find files that include too little.
  cmake --preset clang -DCMAKE_DISABLE_PRECOMPILE_HEADERS=ON -DDERMIS_BUILD_SHOWCASE=ON
  build clang all showcase_tests nightly_tests
  tests clang -L sanitized
  tests clang -R '^package\.'
}

part_debian() {
  rm -f build/debian/*.deb build/debian/*.tar.gz
  cmake --workflow --preset debian
  cmake --build build/debian --target source_package
  own=$(. /etc/os-release && echo "$VERSION_CODENAME")
  for release in bookworm trixie; do
    set --
    [ "$release" != "$own" ] || set -- build/debian/*.deb
    ./tests/nightly/debian.sh build/nightly/debian build/debian/dermis-*.tar.gz "$release" "$@"
  done
  lintian --fail-on error build/debian/*.deb
}

part_layers() {
  ./tests/nightly/layers.sh build/nightly/layers
}

# tests/cross: runs the tests that need no device. The command skins and verifies models; the vertices must have the same
# bits as those that it skins on this machine. Kernels are taken from build/ci, except for arm64, whose build compiles them with the
# host's compiler.
cross() { # SYSTEM [EMULATOR]: a toolchain file of tests/cross
  system=$1
  emulator=${2:-}
  folder=build/cross/$system
  kernels=
  ./cmake/install-deps.sh "$system"
  ./tests/cross/unpack_highway.sh build/cross/highway
  build ci dermis_cli dermis_gpu_poses_shaders
  if [ "$system" != arm64 ]; then
    kernels=$PWD/build/cross/kernels
    mkdir -p "$kernels"
    for made in shaders/dermis_kernels samples/kit/bench/plain_kernels samples/kit/render/dermis_render_shaders \
      samples/gpu_poses/dermis_gpu_poses_shaders; do
      cp "build/ci/$made/"*.h "build/ci/$made/"*.cpp "$kernels"
    done
  fi
  cmake -S tests/cross -B "$folder" -G Ninja -DCMAKE_TOOLCHAIN_FILE="$PWD/tests/cross/$system.cmake" \
    -DDERMIS_HIGHWAY_SOURCES="$PWD/build/cross/highway" -DDERMIS_EMBEDDED_SHADERS="$kernels"
  cmake --build "$folder" --target cross_tests
  outcome=0
  ctest --test-dir "$folder" --output-on-failure --no-tests=error --timeout 900 -j "$(nproc)" >"$folder/tests.log" 2>&1 || outcome=$?
  tail -n 20 "$folder/tests.log"
  awk '/: Skipped$/ { getline reason } /^\[  SKIPPED \] .* ms\)$/ { print "Skipped: " $4 ": " reason }' \
    "$folder/Testing/Temporary/LastTest.log" | sort -u
  [ "$outcome" -eq 0 ] || { cat "$folder/tests.log"; return "$outcome"; }

  figure=samples/models/figure.glb
  build/ci/samples/cli/dermis skin "$figure" --device cpu -o "$folder/here.ply"
  $emulator "$(dermis_of "$system")" skin "$figure" --device cpu -o "$folder/there.ply"
  cmp "$folder/here.ply" "$folder/there.ply"
  $emulator "$(dermis_of "$system")" verify samples/models/bar.glb --device cpu
}

dermis_of() { # SYSTEM: the command
  program=build/cross/$1/dermis/samples/cli/dermis
  if [ "$1" = windows ]; then program=$program.exe; fi
  echo "$program"
}

# Wine requires a screen before it provides Vulkan, here this system's lavapipe.
part_windows() {
  export WINEDEBUG=-all WINEPREFIX="$PWD/build/cross/wine"
  ./cmake/install-deps.sh windows
  wine=$(PATH=/usr/lib/wine:$PATH command -v wine64 || command -v wine)
  cross windows "$wine"
  PATH=/usr/lib/wine:$PATH wineserver -k || true # the one that began without a screen
  xvfb-run -a "$wine" "$(dermis_of windows)" devices
  xvfb-run -a "$wine" "$(dermis_of windows)" verify samples/models/bar.glb
  # File names are in UTF-8.
  name=$(printf 'build/cross/windows/gr\303\274n \346\227\245')
  cp samples/models/bar.glb "$name.glb"
  "$wine" "$(dermis_of windows)" skin "$name.glb" --device cpu -o "$name.ply"
  [ -s "$name.ply" ]
}

part_x86() {
  cross x86
}

part_arm64() {
  cross arm64 qemu-aarch64
}

part_libcxx() {
  cross libcxx
  "$(dermis_of libcxx)" verify samples/models/bar.glb
}

part_fuzz() {
  fuzzers="clips_fuzz gltf_fuzz mesh_fuzz packed_mesh_fuzz rig_fuzz c_calls_fuzz"
  # shellcheck disable=SC2086 # several targets
  build fuzz $fuzzers
  for fuzzer in $fuzzers; do
    corpus=build/fuzz/corpus/$fuzzer
    mkdir -p "$corpus"
    echo "$fuzzer ..."
    seconds=60
    [ "$fuzzer" != c_calls_fuzz ] || seconds=240 # over a million calls
    "build/fuzz/tests/fuzz/$fuzzer" -rss_limit_mb=2048 -timeout=10 -max_total_time="$seconds" -print_final_stats=1 \
      -artifact_prefix=build/fuzz/ "$corpus" tests/fuzz/seeds >"build/fuzz/$fuzzer.log" 2>&1 ||
      { tail -n 40 "build/fuzz/$fuzzer.log"; return 1; }
    awk '/number_of_executed_units/ { print $2 }' "build/fuzz/$fuzzer.log" >>"$figures"
  done
  awk '{ sum += $1 } END { printf "%.0f\n", sum }' "$figures" >"$figures.sum"
  mv "$figures.sum" "$figures"
}

part_mesa() {
  build ci
  settings=$(./tests/nightly/unpack_mesa.sh build/nightly/mesa)
  # shellcheck disable=SC2086 # NAME=VALUE words
  export $settings
  export DERMIS_REQUIRE_RAY_TRACING=1
  build/ci/samples/cli/dermis devices
  tests ci -L device
  tests ci -LE 'nightly|device' -R 'Render|Crowd|Comparison'
  build/ci/samples/cli/dermis verify samples/models/*.glb
}

part_mutants() {
  ./tests/mutants/run.py
  cp build/nightly/mutants/figures "$figures"
}

# Minimum ratios: about two thirds of the lowest measured on a quiet machine (docs/performance.md).
check_speed() { # JSON PLAIN LINEAR COMPACT
  gpu=gpu/dual_quaternion/float32x3
  ./tests/bench/check_ratios.sh "$1" $gpu gpu/plain/dual_quaternion "$2" gpu/linear/float32x3 gpu/plain/linear "$3" \
    gpu/dual_quaternion/float16x4+octahedral16x2 $gpu "$4" $gpu/bounds $gpu 0.35 $gpu/previous_positions $gpu 0.35 \
    $gpu/10_instances $gpu 0.5 cpu/dual_quaternion/1 gpu/plain/dual_quaternion 2.5 cpu/linear/1 gpu/plain/linear 2.5 \
    cpu/dual_quaternion/1/tangents cpu/dual_quaternion/1 0.3 cpu/dual_quaternion/1/scales cpu/dual_quaternion/1 0.3 \
    cpu/dual_quaternion/1/float16x4+octahedral16x2 cpu/dual_quaternion/1 0.4 $gpu/clips $gpu 0.5 \
    cpu/dual_quaternion/1/clips cpu/dual_quaternion/1 0.5
}

part_speed() {
  build ci dermis_cli benchmarks
  tests ci -R '^bench\.'
  build/ci/samples/cli/dermis bench --json build/nightly/bench.json
  check_speed build/nightly/bench.json 1.4 1.4 0.5
  settings=$(./tests/nightly/unpack_mesa.sh build/nightly/mesa)
  # shellcheck disable=SC2086 # NAME=VALUE words
  export $settings
  build/ci/samples/cli/dermis bench --json build/nightly/bench-mesa.json
  check_speed build/nightly/bench-mesa.json 1.2 1.4 0.5
}

part_compilers() {
  table=build/ci/tests/bench/dermis_compiler_table
  build ci dermis_compiler_table
  tests/bench/compilers.py "$table"
  for module in palette clear visibility sample compose morph_lists rig skin skin_one_output skin_staged skin_extras skin_bulge skin_bulge_one_output skin_bulge_extras; do
    for language in "hlsl --shader-model 60" "msl --msl-version 20300"; do
      # shellcheck disable=SC2086 # an option and its argument
      spirv-cross --$language "build/ci/shaders/dermis_kernels/$module.spv" >/dev/null
    done
  done
  settings=$(./tests/nightly/unpack_mesa.sh build/nightly/mesa)
  # shellcheck disable=SC2086 # NAME=VALUE words
  env $settings VK_DRIVER_FILES="$PWD/build/nightly/mesa/radeon.json" tests/bench/compilers.py "$table" --goals navi21 navi31
}

part_gpu() {
  build ci gpu_test system_test dermis_gpu_benchmark
  tests ci -R '^profile\.'
  ./tests/bench/gpu.sh build/nightly/gpu build/ci
  # Without the environment variables of this build.
  (cd build/nightly && env -i PATH="$PATH" HOME="$HOME" gpu/measure.sh gpu/out 10 50)
  grep -q '"passed": true' build/nightly/gpu/out/gpu.json
}

part_exhaustive() {
  build ci exhaustive_test real_models_test exhaustive_diagnose_test exhaustive_clips_test
  tests ci -R '^(exhaustive_test|real_models_test|exhaustive_diagnose_test|exhaustive_clips_test)/'
}

part_packages() {
  build ci
  tests ci -L nightly -R '^package\.'
}

# Whether two tables of numbers are equal except for rounding.
same_numbers() { # EXPECTED MADE
  [ "$(wc -l <"$1")" -eq "$(wc -l <"$2")" ] || { echo "$2 has another number of lines than $1"; return 1; }
  paste -d '\n' "$1" "$2" | awk -F '\t' -v name="$2" '
    NR % 2 { for (i = 1; i <= NF; ++i) expected[i] = $i; fields = NF; next }
    /^#/ { next }
    { bad = NF != fields
      for (i = 1; i <= NF; ++i) {
        difference = $i - expected[i]
        if (i <= 2 ? $i != expected[i] : difference > 1e-6 || difference < -1e-6) bad = 1
      }
      if (bad) { print name ", line " NR / 2 ": " $0; exit 1 } }'
}

part_golden() {
  models=$PWD/samples/models
  golden=$PWD/tests/golden
  made=build/nightly/golden
  rm -rf "$made"
  mkdir -p "$made"
  cp "$golden/three.mjs" "$made"
  (cd "$made" && npm install --silent --no-audit --no-fund three@0.170.0 && node three.mjs "$models" >three.tsv)
  blender -b --factory-startup --python "$golden/blender.py" -- "$models" "$PWD/$made/blender.tsv" >"$made/blender.log" 2>&1 ||
    { tail -n 20 "$made/blender.log"; return 1; }
  same_numbers "$golden/three.tsv" "$made/three.tsv"
  same_numbers "$golden/blender.tsv" "$made/blender.tsv"
}

part_showcase() {
  cmake --preset ci -B build/showcase -DDERMIS_BUILD_SHOWCASE=ON
  cmake --build build/showcase --target showcase_tests
  ctest --test-dir build/showcase -L showcase --output-on-failure --no-tests=error --timeout 900
}

part_languages() {
  build ci dermis_c dermis_c_compare dermis_cdef dermis_languages_benchmark
  ./tests/nightly/languages.sh build/ci build/nightly/languages
}

part_programs() {
  folder=build/nightly/quickstart
  rm -rf "$folder"
  git clone -q . "$folder"
  "$folder/samples/quickstart.sh"
  for file in compare.png crowd.png figure-00.ply figure-07.ply verify.json verify.xml crowd.json; do
    [ -s "$folder/build/quickstart/$file" ] || { echo "the quick start wrote no $file"; return 1; }
  done
  # One property a line, as it is written.
  awk '/"variant":/ { ++cases } /"vertices":/ { gsub(/[^0-9]/, ""); vertices += $0 }
    END { printf "%.0f, %.0f vertices\n", cases, vertices }' "$folder/build/quickstart/verify.json" >"$figures"
  rm -rf "$folder"
  build ci real_film_test
  tests ci -R RealFilmTest
}

if [ "${1:-}" = --alone ]; then # this script calls itself so: each part runs in its own process, in which `set -e` is effective
  "part_$(echo "$2" | tr - _)"
  exit
fi

if [ $# -eq 0 ]; then
  # shellcheck disable=SC2086 # a list of words
  set -- $parts
fi
for part in "$@"; do
  case " $parts " in
    *" $part "*) ;;
    *) echo "tests/run.sh nightly: there is no part '$part'; there are $parts" >&2; exit 2 ;;
  esac
done

processor=$(awk -F ': *' '
  /^(vendor_id|cpu family|model)[ \t]*:/ { name = name $2 " " }
  /^flags/ { print name (/ avx512bw/ ? "with" : "without") " AVX-512"; exit }' /proc/cpuinfo)

./cmake/install-deps.sh nightly
mkdir -p build/nightly
failed=
for part in "$@"; do
  echo "nightly: $part ..."
  begin=$(date +%s)
  status=0
  rm -f "$figures"
  ./tests/nightly/run.sh --alone "$part" || status=$?
  minutes=$((($(date +%s) - begin + 30) / 60))
  if [ "$status" -ne 0 ]; then
    echo "nightly: $part FAILED after $minutes min"
    failed="$failed $part"
    continue
  fi
  echo "nightly: $part passed in $minutes min"
  commit=$(git rev-parse --short HEAD)
  [ -z "$(git status --porcelain --untracked-files=no -- . ":!$passed")" ] || commit=$commit+changes
  { grep -v "^$part	" "$passed" 2>/dev/null || printf 'part\tlast passed\tcommit\tminutes\tprocessor\tcounted\n'
    printf '%s\t%s\t%s\t%s\t%s\t%s\n' "$part" "$(date -u +%Y-%m-%d)" "$commit" "$minutes" "${processor:-$(uname -m)}" \
      "$(cat "$figures" 2>/dev/null || true)"; } >"$passed.new"
  mv "$passed.new" "$passed"
done
[ -z "$failed" ] || { echo "nightly: failed:$failed"; exit 1; }
