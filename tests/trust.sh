#!/bin/sh
# Prints the table of docs/trust.md: what the tests of this repository try, counted.
#
#   tests/trust.sh
#
# Models are those of $DERMIS_TEST_DATA, or else of ../shared. What only a run can tell was written to tests/nightly/passed.tsv.
set -eu
cd "$(dirname "$0")/.."
data=${DERMIS_TEST_DATA:-../shared}
[ -d "$data/models" ] || { echo "trust: no models in $data" >&2; exit 1; }

row() { echo "| $1 | $2 | $3 |"; }
lines() { wc -l | tr -d ' '; }

# The generators of glTF files, which are read from standard input: without versions, most files first.
generators() {
  while read -r file; do
    grep -a -o -m 1 '"generator" *: *"[^"]*"' "$file" | head -n 1 || true
  done | sed 's/.*: *"//; s/ [(v]*[0-9].*//; s/ (.*//; s/"$//' | grep . | sort | uniq -c | sort -k 1,1nr -k 2 |
    awk '{ count = $1; $1 = ""; printf "%s%s%s", (NR > 1 ? ", " : ""), substr($0, 2), (count > 1 ? " (" count ")" : "") }'
}

models() { find "$data/models" -name '*.gl[tb]*' "$@" | LC_ALL=C sort; }

# What the last run of a nightly part counted.
counted() { # PART
  awk -F '\t' -v part="$1" '$1 == part && $6 != "" { print $6 " (" $2 ")"; found = 1 } END { if (!found) print "not counted yet" }' \
    tests/nightly/passed.tsv
}

echo "| what is tried | how much | by |"
echo "| --- | --- | --- |"
row "glTF files that other programs wrote; generators, where the file names one" \
  "$(models ! -path '*negative*' | lines): $(models ! -path '*negative*' | generators)" '`gltf_test`, `cli_test`'
row "glTF files broken on purpose, whole ones" "$(models -path '*negative*' | lines)" '`gltf_test`'
rules=tests/gltf_rules/validator/errors.tsv
row "glTF files that the tests make, each breaking a rule" \
  "$(grep '^rules/' $rules | cut -f 1 | sort -u | lines), of $(grep '^rules/' $rules | cut -f 2 | sort -u | lines) kinds by glTF validator's codes" \
  '`gltf_test`'
row "poses of three.js and Blender, vertex by vertex" \
  "$(grep -v '^#' tests/golden/three.tsv | lines) and $(grep -v '^#' tests/golden/blender.tsv | lines) vertices" '`cli_test`'
row "cases that \`dermis verify\` compares in the quick start" "$(counted programs)" '`tests/run.sh nightly programs`'
row "inputs of the fuzzers, a minute each" "$(counted fuzz)" '`tests/run.sh nightly fuzz`'
row "mistakes planted in the engine" "$(counted mutants)" '`tests/run.sh nightly mutants`'
