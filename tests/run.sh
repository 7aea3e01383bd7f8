#!/bin/sh
# Builds Dermis with all warnings as errors and runs its tests. Installs missing packages first.
#
#   tests/run.sh                   what CI runs: `ci`, then `sanitized`. What both could run, `sanitized` runs
#   tests/run.sh PRESET            ci, dev, release, asan or tsan: builds it, runs all tests of every change
#   tests/run.sh sanitized         what needs no device and handles data from outside, with Clang's address and undefined-behavior
#                                  sanitizers; fewer cases of what takes long
#   tests/run.sh nightly [PART...] what takes longer, in parts; without PART: all. tests/nightly/run.sh lists them
#
# Tests that need the models and poses of this project's machines look for them in $DERMIS_TEST_DATA, or else in ../shared, and are
# skipped if they are absent. If CI is set in the environment, a missing Vulkan device or validation layer is a failure. So is
# missing data in the folder that $DERMIS_TEST_DATA names, and incomplete data in an existing ../shared.
#
# Prints which tests failed or were skipped, and at the end what took how long. Everything else is in build/PRESET/tests.log. Failed
# tests are run three more times, alone, to tell whether they always fail; the run has failed in either case.
set -eu
cd "$(dirname "$0")/.."
run=${1:-all}
if [ "$run" = nightly ]; then
  shift
  exec ./tests/nightly/run.sh "$@"
fi
mkdir -p build
parts=build/parts.tsv # part, wall seconds, CPU seconds
: >"$parts"

# step NAME COMMAND...: runs it, and notes how long it took.
step() {
  part=$1
  shift
  begin=$(date +%s)
  times >build/times.before # of all programs so far; a subshell would have its own
  status=0
  "$@" || status=$?
  times >build/times.after
  awk -v part="$part" -v seconds="$(($(date +%s) - begin))" '
    FNR == 2 { gsub(/[ms]/, " "); cpu[FILENAME] = $1 * 60 + $2 + $3 * 60 + $4 }
    END { printf "%s\t%d\t%.0f\n", part, seconds, cpu["build/times.after"] - cpu["build/times.before"] }
  ' build/times.before build/times.after >>"$parts"
  tail -n 1 "$parts" | awk -F '\t' '{ printf "%s took %d min %d s, %d s of CPU time\n", $1, $2 / 60, $2 % 60, $3 }'
  return "$status"
}

run_tests() { # FOLDER LABELS
  # shellcheck disable=SC2086 # two words
  ctest --test-dir "$1" $2 --output-on-failure --no-tests=error --timeout 900 -j "$(nproc)" >"$1/tests.log" 2>&1
}

# build_and_test FOLDER LABELS PRESET [OPTION...]
build_and_test() {
  linker=
  if command -v ld.gold >/dev/null; then linker=-DCMAKE_EXE_LINKER_FLAGS=-fuse-ld=gold; fi # in half the time
  folder=$1
  labels=$2
  name=$(basename "$folder")
  shift 2
  step "$name: configure" cmake -B "$folder" --preset "$@" $linker >"$folder.log" || { cat "$folder.log"; return 1; }
  step "$name: build" cmake --build "$folder"
  # LLVM, which lavapipe uses, keeps memory until the process ends.
  export ASAN_OPTIONS="${ASAN_OPTIONS:-detect_leaks=0}"
  echo "Running the tests; the log is $folder/tests.log ..."
  failed=0
  step "$name: tests" run_tests "$folder" "$labels" || failed=$?
  grep -v -E '^ +Start +[0-9]+: | Passed +[0-9.]+ sec$' "$folder/tests.log"
  # ctest names only the suite.
  awk '/: Skipped$/ { getline reason } /^\[  SKIPPED \] .* ms\)$/ { print "Skipped: " $4 ": " reason }' \
    "$folder/Testing/Temporary/LastTest.log" | sort -u
  [ "$failed" -ne 0 ] || return 0
  [ -s "$folder/Testing/Temporary/LastTestsFailed.log" ] || return "$failed" # ctest itself failed, and no test

  echo
  echo "Running what failed again, three times, one after the other ..."
  if ctest --test-dir "$folder" --rerun-failed --repeat until-fail:3 --output-on-failure --timeout 900; then
    echo "Each test that failed above passed three times when it ran alone: it is unstable, which is a failure too."
  fi
  return "$failed"
}

every_change="-LE nightly|showcase"
joined=-DCMAKE_UNITY_BUILD_BATCH_SIZE=16 # sources that are compiled together: more take less time, but only while both cores have any

sanitized() {
  kernels=build/ci/shaders/dermis_kernels
  [ -f build/ci/CMakeCache.txt ] || cmake --preset ci >build/ci.log
  cmake --build build/ci --target dermis_kernels
  # Clang compiles it in two thirds of GCC's time, and checks more.
  build_and_test build/sanitized "-L sanitized" asan -DCMAKE_CXX_COMPILER=clang++ -DDERMIS_SANITIZE_TESTS=OFF \
    -DDERMIS_BUILD_SAMPLES=OFF -DDERMIS_BUILD_TESTS=ON -DDERMIS_BUILD_SHADER_COMPILER=ON -DDERMIS_RUNTIME_COMPILER=OFF \
    -DDERMIS_EMBEDDED_SHADERS="$PWD/$kernels" -DDERMIS_QUICK_OPTIMIZATION=-O0 "$joined"
}

case $run in
  all|sanitized) step "install" ./cmake/install-deps.sh sanitized ;;
  *) step "install" ./cmake/install-deps.sh ;;
esac
outcome=0
case $run in
  all)
    build_and_test build/ci "$every_change" ci -DDERMIS_SANITIZED_TESTS_ELSEWHERE=ON -DCMAKE_UNITY_BUILD=ON "$joined" \
      -DDERMIS_QUICK_OPTIMIZATION=-O1 || outcome=$?
    sanitized || outcome=$?
    ;;
  sanitized) sanitized || outcome=$? ;;
  *) build_and_test "build/$run" "$every_change" "$run" -DDERMIS_SANITIZED_TESTS_ELSEWHERE=OFF || outcome=$? ;;
esac
./tests/report.sh
exit "$outcome"
