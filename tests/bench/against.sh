#!/bin/sh
# Compares the speed of this tree with that of another commit. Builds both for release, and runs their benchmarks alternately.
#
#   tests/bench/against.sh COMMIT [FILTER]   FILTER: a regular expression of benchmark names, "." for all (the default)
#
# For each benchmark that both trees have, prints the time of COMMIT divided by the time of this tree (above 1: this tree is
# faster). Each time is the best of ROUNDS rounds; printed are the median, lowest and highest ratio of RUNS runs. If FILTER includes
# output/float32, also prints the times of COMMIT and of this tree divided by COMMIT's time of output/float32, as medians too.
# DERMIS_DEVICE names a device other than the best one. Leave the machine idle. For a shorter run: RUNS=1 ROUNDS=1.
set -eu
commit=${1:?usage: tests/bench/against.sh COMMIT [FILTER]}
filter=${2:-.}
RUNS=${RUNS:-5}
ROUNDS=${ROUNDS:-3}
cd "$(dirname "$0")/../.."
commit=$(git rev-parse --short "$commit^{commit}")
./cmake/install-deps.sh

folder=$PWD/build/against
tree=$folder/$commit
mkdir -p "$folder"
[ -e "$tree/CMakeLists.txt" ] || git worktree add --detach --force "$tree" "$commit" >/dev/null
build() { # TREE
  echo "building $1" >&2
  (cd "$1" && cmake --preset release && cmake --build build/release --target dermis_benchmarks) >"$folder/build.log" 2>&1 ||
    { tail -n 20 "$folder/build.log"; exit 1; }
}
build "$tree"
build "$PWD"

times=$folder/times.csv # run, side, benchmark, time
: >"$times"
measure() { # RUN SIDE TREE
  out=$folder/out.json
  "$3/build/release/tests/bench/dermis_benchmarks" --benchmark_filter="$filter" --benchmark_repetitions=3 \
    --benchmark_min_time=0.03 --benchmark_enable_random_interleaving=true --benchmark_out="$out" \
    --benchmark_out_format=json >"$folder/console.log"
  # Each member is on its own line: "name": "…", … "run_type": "iteration", … "real_time": …,
  awk -v run="$1" -v side="$2" '
    { gsub(/[",]/, "") }
    $1 == "name:" { name = $2; sub(/\/manual_time/, "", name) }
    $1 == "run_type:" { one = $2 == "iteration" }
    $1 == "real_time:" && one { print run "," side "," name "," $2 }' "$out" >>"$times"
}
run=1
while [ "$run" -le "$RUNS" ]; do
  round=1
  while [ "$round" -le "$ROUNDS" ]; do
    measure "$run" before "$tree"
    measure "$run" after "$PWD"
    round=$((round + 1))
  done
  echo "run $run of $RUNS done" >&2
  run=$((run + 1))
done

awk -F, -v runs="$RUNS" -v commit="$commit" '
  { key = $1 "," $2 "," $3
    if (!(key in best) || $4 + 0 < best[key]) best[key] = $4 + 0
    if (!($3 in seen)) { seen[$3] = 1; names[++count] = $3 } }
  function median(values, count,    i, j, value) { # sorts them
    for (i = 1; i < count; ++i) {
      value = values[i]
      for (j = i; j > 0 && values[j - 1] > value; --j) values[j] = values[j - 1]
      values[j] = value
    }
    return count % 2 ? values[(count - 1) / 2] : (values[count / 2 - 1] + values[count / 2]) / 2
  }
  END {
    printf "%-44s %8s %8s %8s %8s %8s\n", commit " / this tree", "median", "lowest", "highest", commit, "now"
    for (n = 1; n <= count; ++n) {
      name = names[n]
      m = units = 0
      for (run = 1; run <= runs; ++run) {
        before = best[run ",before," name]; after = best[run ",after," name]
        if (before == 0 || after == 0) continue
        ratios[m++] = before / after
        unit = best[run ",before,output/float32"]
        if (unit == 0) continue
        befores[units] = before / unit
        afters[units++] = after / unit
      }
      if (m == 0) continue
      middle = median(ratios, m)
      printf "%-44s %8.3f %8.3f %8.3f", name, middle, ratios[0], ratios[m - 1]
      if (units > 0) printf " %8.2f %8.2f", median(befores, units), median(afters, units)
      print ""
      logs += log(middle); ++compared
    }
    if (compared == 0) { print "no benchmark is in both"; exit 1 }
    printf "%-44s %8.3f\n", "geometric mean of " compared, exp(logs / compared)
  }' "$times"
