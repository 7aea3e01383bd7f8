#!/bin/sh
# Builds Dermis with every warning an error and runs all of its tests; installs what is missing first.
#
#   tests/run.sh [PRESET]     ci (the default), dev, release, asan or tsan
#
# Tests that need the models and poses of this project's machines look for them in $DERMIS_TEST_DATA, else in ../shared, and
# skip where they are absent. With CI set in the environment, a missing Vulkan device or validation layer is a failure.
set -eu
cd "$(dirname "$0")/.."
preset=${1:-ci}

./cmake/install-deps.sh

cmake --preset "$preset"
cmake --build "build/$preset"
# LLVM, inside lavapipe, keeps memory until the process ends.
ASAN_OPTIONS=${ASAN_OPTIONS:-detect_leaks=0} ctest --test-dir "build/$preset" --output-on-failure --timeout 900 -j "$(nproc)"
