#!/bin/sh
# Counts the lines of C++, GLSL, CMake and scripts that git tracks, blanks and comments included, by folder.
#
#   tests/lines.sh [COMMIT]      without COMMIT: the files as they are
set -eu
cd "$(dirname "$0")/.."

counted='(\.(cpp|h|in|glsl|comp|vert|frag|cmake|sh|sed|py|mjs)|/CMakeLists\.txt|^CMakeLists\.txt|^\.ci/run)$'
count() { # FOLDER
  if [ -n "$commit" ]; then
    git ls-tree -r --name-only "$commit" -- $1 | grep -E "$counted" | sed "s/^/$commit:/" | xargs -r -d '\n' git show | wc -l
  else
    git ls-files -- $1 | grep -E "$counted" | while read -r file; do [ ! -f "$file" ] || cat "$file"; done | wc -l
  fi
}

commit=${1:-}
for folder in engine shaders samples samples/cli samples/kit samples/showcase tests cmake .; do
  printf '%7d  %s\n' "$(count "$folder")" "$folder"
done
