#!/bin/sh
# Builds Dermis with all warnings as errors and runs its tests. Installs missing packages first.
#
#   tests/run.sh [PRESET]          ci (the default), dev, release, asan or tsan: builds all, runs all tests
#   tests/run.sh sanitized         Dermis and the samples with address and undefined-behavior sanitizers: tests of what works on the
#                                  CPU, and a small suite on a device
#   tests/run.sh nightly [PART...] what takes longer, in parts; without PART: all. tests/nightly/run.sh lists them
#
# Tests that need the models and poses of this project's machines look for them in $DERMIS_TEST_DATA, or else in ../shared, and are
# skipped if they are absent. If CI is set in the environment, a missing Vulkan device or validation layer is a failure. So is
# missing data in the folder that $DERMIS_TEST_DATA names, and incomplete data in an existing ../shared.
#
# Prints which tests failed or were skipped, and how long each step took. Everything else is in build/PRESET/tests.log. Failed tests
# are run three more times, alone, to tell whether they always fail; the run has failed in either case.
set -eu
cd "$(dirname "$0")/.."
run=${1:-ci}
if [ "$run" = nightly ]; then
  shift
  exec ./tests/nightly/run.sh "$@"
fi
preset=$run
build_target=all
tests="-LE nightly"
options=
if [ "$run" = sanitized ]; then
  preset=asan
  build_target=sanitized_tests
  tests="-L sanitized"
  options=-DDERMIS_SANITIZE_TESTS=OFF
fi

# step NAME COMMAND...: runs it, and prints how long it took.
step() {
  name=$1
  shift
  begin=$(date +%s)
  status=0
  "$@" || status=$?
  seconds=$(($(date +%s) - begin))
  echo "$run: $name took $((seconds / 60)) min $((seconds % 60)) s"
  return "$status"
}

step install ./cmake/install-deps.sh
# shellcheck disable=SC2086 # none or one
step configure cmake --preset "$preset" $options
step build cmake --build "build/$preset" --target "$build_target"

# LLVM, which lavapipe uses, keeps memory until the process ends.
export ASAN_OPTIONS="${ASAN_OPTIONS:-detect_leaks=0}"
log=build/$preset/tests.log
echo "Running the tests; the log is $log ..."
failed=0
run_tests() {
  # shellcheck disable=SC2086 # two words
  ctest --test-dir "build/$preset" $tests --output-on-failure --no-tests=error --timeout 900 -j "$(nproc)" >"$log" 2>&1
}
step tests run_tests || failed=$?
grep -v -E '^ +Start +[0-9]+: | Passed +[0-9.]+ sec$' "$log"
# ctest names only the suite.
awk '/: Skipped$/ { getline reason } /^\[  SKIPPED \] .* ms\)$/ { print "Skipped: " $4 ": " reason }' \
  "build/$preset/Testing/Temporary/LastTest.log" | sort -u
[ "$failed" -eq 0 ] && exit 0
[ -s "build/$preset/Testing/Temporary/LastTestsFailed.log" ] || exit "$failed" # ctest itself failed, and no test

echo
echo "Running what failed again, three times, one after the other ..."
if ctest --test-dir "build/$preset" --rerun-failed --repeat until-fail:3 --output-on-failure --timeout 900; then
  echo "Each test that failed above passed three times when it ran alone: it is unstable, which is a failure too."
fi
exit "$failed"
