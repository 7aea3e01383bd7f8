#!/bin/sh
# Prints what the last `tests/run.sh` took: each part, the slowest objects and the slowest tests. tests/run.sh runs it.
set -eu
cd "$(dirname "$0")/.."

echo
echo "wall s   CPU s   part"
awk -F '\t' '{ printf "%6d  %6d   %s\n", $2, $3, $1; wall += $2; cpu += $3 } END { printf "%6d  %6d   all\n", wall, cpu }' build/parts.tsv

folders=$(awk -F ': ' '/: build$|: build\t/ { sub(/\t.*/, "", $2); print "build/" $1 }' build/parts.tsv)
echo
echo "The slowest objects, in seconds on one of $(nproc) cores:"
for folder in $folders; do
  awk -v folder="$folder" '!/^#/ { seconds[$4] = ($2 - $1) / 1000 }
    END { for (object in seconds) printf "%6.1f   %s/%s\n", seconds[object], folder, object }' "$folder/.ninja_log"
done | sed 's#CMakeFiles/##' | sort -rn | head -n 10
echo
echo "The slowest tests, in seconds on one of $(nproc) cores:"
for folder in $folders; do
  sed -n 's#^ *[0-9]*/[0-9]* Test *\#[0-9]*: \([^ ]*\) .* \([0-9.]*\) sec.*#\2 \1#p' "$folder/tests.log" |
    awk -v folder="$folder" '{ printf "%6.1f   %s: %s\n", $1, folder, $2 }'
done | sort -rn | head -n 10
