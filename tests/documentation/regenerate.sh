#!/bin/sh
# Writes into the documents what they show of samples, tests and programs: code, --help texts, tables.
#
#   tests/documentation/regenerate.sh [BUILD]     a build folder with tests; build/ci if it is left out
set -eu
cd "$(dirname "$0")/../.."
build=${1:-build/ci}
cmake --build "$build" --target documentation_test
DERMIS_UPDATE_DOCUMENTS=1 "$build/tests/documentation_test" --gtest_filter='DocumentationTest.WhatIsShownIsWhatItsSourceSays'
git status --short -- '*.md'
