#!/bin/sh
# From a fresh clone to a verified skinned figure and crowd: installs what is missing, builds, skins the figure on a Vulkan device
# (on a machine without a GPU: Mesa's lavapipe), compares every vertex with the reference, and draws two pictures.
set -eu
cd "$(dirname "$0")/.."

./cmake/install-deps.sh

echo "Building Dermis ..."
log=build/quickstart.log
mkdir -p build
# Joined sources compile in half the time.
if ! { cmake --preset release -DDERMIS_BUILD_TESTS=OFF -DCMAKE_UNITY_BUILD=ON && cmake --build build/release; } >"$log" 2>&1; then
  tail -n 40 "$log" >&2
  echo "quickstart: the build failed; its output is in $log" >&2
  exit 1
fi

dermis=build/release/samples/cli/dermis
crowd=build/release/samples/crowd/dermis_crowd
models=samples/models
out=build/quickstart
mkdir -p "$out"

echo
echo "The Vulkan devices of this machine:"
"$dermis" devices
echo
echo "Skinning the figure's walk, 8 poses with dual quaternions, on the best device ..."
"$dermis" skin "$models/figure.glb" --animation walk --frames 8 --fps 8 -o "$out/figure-%02d.ply"
echo "The methods side by side, as numbers and as a picture ..."
"$dermis" compare "$models/figure.glb" --animation wave --time 1.2 --json "$out/compare.json" \
  -o "$out/compare.png" --width 1400
echo
echo "Comparing every vertex, in every clip, by every method, with the double-precision reference ..."
"$dermis" verify "$models/figure.glb" "$models/bar.glb" "$models/arm.glb" --json "$out/verify.json" --junit "$out/verify.xml"
echo
echo "A crowd of 200 such figures that come and go, each in a clip and phase of its own, with every tenth frame compared ..."
"$crowd" --json "$out/crowd.json"
echo "Drawing a crowd of 25, straight from the buffers that it is skinned into ..."
"$dermis" render "$models/figure.glb" --instances 25 --width 960 --height 540 -o "$out/crowd.png"
echo
echo "The methods side by side, a picture:             $out/compare.png"
echo "A crowd, a picture:                              $out/crowd.png"
echo "The skinned figure (open it in any mesh viewer): $out/figure-00.ply ... figure-07.ply"
echo "What was compared, and the errors:               $out/verify.json"
echo "What the crowd cost:                             $out/crowd.json"
echo "The command to try on models of your own:        $dermis --help"
