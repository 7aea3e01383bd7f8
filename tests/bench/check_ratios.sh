#!/bin/sh
# Checks that rows of `dermis bench --json FILE` are fast enough relative to other rows of the same run.
#
#   tests/bench/check_ratios.sh FILE ROW BASELINE LEAST [ROW BASELINE LEAST]...
#
# LEAST: minimum of the million vertices per second of ROW, divided by those of BASELINE.
set -eu
file=${1:?usage: tests/bench/check_ratios.sh FILE ROW BASELINE LEAST...}
shift
rate() { # ROW
  awk -v wanted="$1" '
    { gsub(/[",]/, "") }
    $1 == "name:" { name = $2 }
    $1 == "million_vertices_per_second:" && name == wanted { print $2; found = 1 }
    END { exit !found }' "$file" || { echo "$file has no row $1" >&2; exit 1; }
}
outcome=0
while [ $# -ge 3 ]; do
  row=$(rate "$1")
  baseline=$(rate "$2")
  awk -v row="$row" -v baseline="$baseline" -v least="$3" -v name="$1 / $2" 'BEGIN {
    ratio = row / baseline
    printf "%-88s %6.2f, at least %s%s\n", name, ratio, least, ratio < least ? ": too slow" : ""
    exit ratio < least }' || outcome=1
  shift 3
done
exit $outcome
