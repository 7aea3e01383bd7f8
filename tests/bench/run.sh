#!/bin/sh
# Builds the benchmarks for release and prints relative costs. Arguments go to Google Benchmark. DERMIS_DEVICE in the environment
# names a Vulkan device other than the best one.
set -eu
cd "$(dirname "$0")/../.."
./cmake/install-deps.sh
cmake --preset release
cmake --build build/release --target dermis_benchmarks
exec ./build/release/tests/bench/dermis_benchmarks --benchmark_repetitions=21 --benchmark_min_time=0.03 \
  --benchmark_enable_random_interleaving=true "$@"
