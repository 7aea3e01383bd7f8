#!/bin/sh
# Builds the benchmarks for release and prints what things cost relative to each other. Arguments go to Google Benchmark;
# DERMIS_DEVICE in the environment names another Vulkan device than the best.
set -eu
cd "$(dirname "$0")/../.."
./cmake/install-deps.sh
cmake --preset release
cmake --build build/release --target dermis_benchmarks
exec ./build/release/tests/bench/dermis_benchmarks --benchmark_repetitions=21 --benchmark_min_time=0.03 \
  --benchmark_enable_random_interleaving=true "$@"
