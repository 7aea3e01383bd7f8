#!/bin/sh
# Updates the parts of the documents that are copied from samples, tests and programs: code, --help texts, tables.
#
#   tests/documentation/regenerate.sh [BUILD]     BUILD: a build folder with tests; the default is build/ci
set -eu
cd "$(dirname "$0")/../.."
build=${1:-build/ci}
cmake --build "$build" --target documentation_test
DERMIS_UPDATE_DOCUMENTS=1 "$build/tests/documentation_test" --gtest_filter='DocumentationTest.WhatIsShownIsWhatItsSourceSays'
git status --short -- '*.md'
