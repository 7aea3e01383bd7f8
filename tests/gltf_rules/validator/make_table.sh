#!/bin/sh
# Makes errors.tsv, the verdicts of the glTF validator, which the test GltfValidator compares with
# what `dermis info` lists and `--strict` refuses. Needs npm and a build.
#   make_table.sh BUILD TEST_DATA
set -eu
here=$(cd "$(dirname "$0")" && pwd)
build=$(cd "$1" && pwd)
models=$(cd "$2/models" && pwd)
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
npm install --silent --no-audit --no-fund gltf-validator@2.0.0-dev.3.10
DERMIS_WRITE_RULES="$work/rules" "$build/tests/gltf_test" --gtest_brief=1 \
  --gtest_filter=GltfRules.WhatIsClearIsUsedWithANote
node "$here/validator.mjs" rules rules models "$models" >errors.tsv
mv errors.tsv "$here/errors.tsv"
