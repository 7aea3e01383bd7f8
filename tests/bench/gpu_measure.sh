#!/bin/sh
# Verifies and measures Dermis on this machine's GPU in less than 8 minutes, with the programs that tests/bench/gpu.sh put next to
# this script. Writes gpu.json, and a table in gpu.txt, to the folder OUT.
#
#   measure.sh OUT [SECONDS [INSTANCES]]
#
# SECONDS: for the search; the default is 120. DERMIS_DEVICE: a part of the name of a device other than the best one.
set -eu
here=$(cd "$(dirname "$0")" && pwd)
out=${1:?usage: measure.sh OUT [SECONDS [INSTANCES]]}
seconds=${2:-120}
instances=${3:-1000}
device=${DERMIS_DEVICE:-auto}
commit=$(cat "$here/commit")
mkdir -p "$out"

# The machine's own libraries come first; those of the compiler and the loader in this folder are only used if the machine has none.
export LD_LIBRARY_PATH="$here/lib${LD_LIBRARY_PATH:+:$LD_LIBRARY_PATH}"
"$here/dermis" --version >/dev/null 2>&1 || LD_LIBRARY_PATH="$LD_LIBRARY_PATH:$here/runtime"
"$here/dermis" --version >/dev/null || { echo "measure.sh: the programs need glibc $(cat "$here/glibc")" >&2; exit 1; }
case $("$here/dermis" devices 2>&1) in
  *"no Vulkan loader"*) LD_LIBRARY_PATH="$LD_LIBRARY_PATH:$here/loader" ;;
esac

status=0
run() { # NAME COMMAND...: runs it, and adds its outcome to the table
  name=$1
  shift
  begin=$(date +%s)
  result=0
  { echo "== $name"; "$@" || result=$?; echo; } >>"$out/gpu.txt" 2>&1
  echo "$name: status $result, $(($(date +%s) - begin)) s"
  [ "$result" -eq 0 ] || status=1
}

: >"$out/gpu.txt"
{ echo "commit $commit"; date -u +"%Y-%m-%d"; } >>"$out/gpu.txt"
run devices "$here/dermis" devices
run verify "$here/dermis" verify --quick --device "$device" --json "$out/verify.json"
run verify_cpu "$here/dermis" verify --quick --device cpu
run cpu_test env -u CI -u DERMIS_TEST_DATA "$here/cpu_test" --gtest_brief=1
run search "$here/dermis_gpu_benchmark" "$out/search.json" "$seconds" "$instances" "$commit"
run bench "$here/dermis" bench --device "$device" --instances "$instances" --json "$out/bench.json"
run scene timeout 120 "$here/dermis_system_benchmark" 3 "$instances"
{
  printf '{"commit": "%s", "passed": %s' "$commit" "$([ "$status" -eq 0 ] && echo true || echo false)"
  for part in verify search bench; do
    [ -s "$out/$part.json" ] || continue
    printf ',\n"%s": ' "$part"
    cat "$out/$part.json"
    rm "$out/$part.json"
  done
  echo '}'
} >"$out/gpu.json"
cat "$out/gpu.txt"
exit "$status"
