#!/bin/sh
# Runs the samples in other languages on the C interface: Python with cffi and numpy, Rust with bindgen. Each skins a crowd on the CPU and
# checks every vertex. bindgen's own tests check the layout of all structures. At the end, Python's speed is printed beside that of C++.
#
#   tests/nightly/languages.sh BUILD FOLDER
set -eu
source=$(cd "$(dirname "$0")/../.." && pwd)
build=$(cd "$1" && pwd)
mkdir -p "$2"
cd "$2"
libraries=$build/engine/src/c
models=$source/samples/models

python() { # MODEL...: Debian's, which has the packages
  /usr/bin/python3 "$source/samples/python/skin.py" --libraries "$libraries" --declarations "$build/engine/dermis.cdef.h" "$@"
}
expect() { # TEXT FILE
  grep -q -e "$1" "$2" || { cat "$2"; echo "languages: it does not say '$1'"; exit 1; }
}

for model in figure arm bar; do
  python "$models/$model.glb" --frames 2 -o "$model.ply" >python.log
  expect "every one is right" python.log
done
python "$models/figure.glb" -o crowd.png >python.log
[ -s crowd.png ] && [ -s figure.ply ] || { echo "languages: Python drew nothing"; exit 1; }
if python does-not-exist.glb 2>python.log; then exit 1; fi
expect "there is no file" python.log

bindgen --no-prepend-enum-name --no-rustfmt-bindings --allowlist-function 'dermis.*' --allowlist-var 'DERMIS.*' \
  "$source/engine/include/dermis/dermis.h" -o dermis.rs
cp "$source/samples/rust/skin.rs" .
link="-L $libraries -l dermis_compare -l dermis -C link-arg=-Wl,-rpath,$libraries"
# shellcheck disable=SC2086 # words
/usr/bin/rustc -O -D warnings skin.rs $link
for model in figure arm bar; do
  ./skin "$models/$model.glb" 7 >rust.log
  expect "every one is right" rust.log
done
printf '#![allow(warnings)]\ninclude!("dermis.rs");\n' >layout.rs
# shellcheck disable=SC2086 # words
/usr/bin/rustc --test layout.rs -o layout $link
./layout >layout.log
expect "[5-9][0-9] passed; 0 failed" layout.log

# The best of five rounds each, in turn.
for round in 1 2 3 4 5; do
  "$build/tests/bench/dermis_languages_benchmark" "$models/figure.glb" 300 20 >>cpp.log.$$
  python "$models/figure.glb" --figures 300 --frames 20 | sed 's/.*figures, \([0-9.]*\) million.*/\1/' >>python.log.$$
done
paste cpp.log.$$ python.log.$$ | awk '{ if ($1 > cpp) cpp = $1; if ($2 > python) python = $2 }
  END { printf "millions of vertices a second: C++ %.0f, Python %.0f: %.2f of it\n", cpp, python, python / cpp }'
rm -f cpp.log.$$ python.log.$$
