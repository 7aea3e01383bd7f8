#!/bin/sh
# Builds Dermis with every warning an error and runs all of its tests; installs what is missing first.
#
#   tests/run.sh [PRESET]     ci (the default), dev, release, asan or tsan
#
# Tests that need the models and poses of this project's machines look for them in $DERMIS_TEST_DATA, else in ../shared, and
# skip where they are absent. With CI set in the environment, a missing Vulkan device or validation layer is a failure.
#
# Prints what failed or was skipped; all the rest is in build/PRESET/tests.log. A test that failed is run three times more, with
# nothing beside it, to tell whether it always fails; the run has failed either way.
set -eu
cd "$(dirname "$0")/.."
preset=${1:-ci}

./cmake/install-deps.sh

cmake --preset "$preset"
cmake --build "build/$preset"

# LLVM, inside lavapipe, keeps memory until the process ends.
export ASAN_OPTIONS="${ASAN_OPTIONS:-detect_leaks=0}"
log=build/$preset/tests.log
echo "Running the tests; the log is $log ..."
failed=0
ctest --test-dir "build/$preset" --output-on-failure --timeout 900 -j "$(nproc)" >"$log" 2>&1 || failed=$?
grep -v -E '^ +Start +[0-9]+: | Passed +[0-9.]+ sec$' "$log"
# ctest names the suite only.
awk '/: Skipped$/ { getline reason } /^\[  SKIPPED \] .* ms\)$/ { print "Skipped: " $4 ": " reason }' \
  "build/$preset/Testing/Temporary/LastTest.log" | sort -u
[ "$failed" -eq 0 ] && exit 0
[ -s "build/$preset/Testing/Temporary/LastTestsFailed.log" ] || exit "$failed" # no test, but ctest itself

echo
echo "Running what failed again, three times, one after the other ..."
if ctest --test-dir "build/$preset" --rerun-failed --repeat until-fail:3 --output-on-failure --timeout 900; then
  echo "Each test that failed above passed three times when it ran alone: it is unstable, which is a failure too."
fi
exit "$failed"
