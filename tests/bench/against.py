#!/usr/bin/env python3
"""Compares the speed of this tree with that of another commit: builds both for release, and runs their benchmarks in turn.

    tests/bench/against.py COMMIT [FILTER]     FILTER: a regular expression of benchmark names

For each row prints the time of COMMIT divided by the time of this tree (above 1: this tree is faster). Each time is the best of nine
rounds: CPU time, or what the row itself measures (the time of the device, or of all threads). A row below 0.95 is measured twice more.
It fails if it is below 0.95 each time, or below 0.90 once; all rows together fail if their geometric mean is below 0.98. Rows that one
of the two trees lacks, though rows.txt lists them, are named.

DERMIS_DEVICE names a device other than the best one. ROUNDS sets another number of rounds. Leave the machine idle."""

import json
import math
import os
import subprocess
import sys
from pathlib import Path

root = Path(__file__).resolve().parents[2]
folder = root / "build/against"
rounds = int(os.environ.get("ROUNDS", 9))


def build(tree):
    log = folder / "build.log"
    for command in (["cmake", "--preset", "release"],
                    ["cmake", "--build", "build/release", "--target", "dermis_benchmarks"]):
        with open(log, "w") as to:
            if subprocess.run(command, cwd=tree, stdout=to, stderr=to).returncode != 0:
                sys.exit("".join(open(log).readlines()[-20:]))
    return tree / "build/release/tests/bench/dermis_benchmarks"


def run(program, pattern, best):
    """Lowers the times in `best`, by the names of rows."""
    out = folder / "out.json"
    subprocess.run([program, f"--benchmark_filter={pattern}", "--benchmark_min_time=0.03", f"--benchmark_out={out}",
                    "--benchmark_out_format=json"], check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    for row in json.load(open(out))["benchmarks"]:
        if row["run_type"] != "iteration":
            continue
        parts = row["name"].split("/")
        time = row["real_time" if {"manual_time", "real_time"} & set(parts) else "cpu_time"]
        name = "/".join(part for part in parts if part not in ("manual_time", "real_time", "iterations:1"))
        best[name] = min(best.get(name, math.inf), time)


def compare(before, after, pattern, isSwapped=False):
    """Ratios by name, of rows that both have, and the names of the others."""
    times = {before: {}, after: {}}
    for number in range(rounds):
        for program in (before, after) if (number % 2 == 0) != isSwapped else (after, before):
            run(program, pattern, times[program])
    shared = [name for name in times[before] if name in times[after]]
    return ({name: times[before][name] / times[after][name] for name in shared},
            set(times[before]) ^ set(times[after]))


def main():
    if len(sys.argv) < 2:
        sys.exit(__doc__)
    commit = subprocess.check_output(["git", "rev-parse", "--short", sys.argv[1] + "^{commit}"], cwd=root, text=True).strip()
    pattern = sys.argv[2] if len(sys.argv) > 2 else "."
    folder.mkdir(parents=True, exist_ok=True)
    tree = folder / commit
    if not (tree / "CMakeLists.txt").exists():
        subprocess.run(["git", "worktree", "add", "--detach", "--force", tree, commit], cwd=root, check=True)
    before, after = build(tree), build(root)
    ratios, others = compare(before, after, pattern)
    bad = False
    for name, ratio in ratios.items():
        seen = [ratio]
        while seen[0] < 0.95 and len(seen) < 3:
            again, _ = compare(before, after, f"^{name}(/|$)", isSwapped=len(seen) % 2 == 1)
            seen.append(again[name])
        fails = min(seen) < 0.90 or max(seen) < 0.95
        bad |= fails
        print(f"{name:44}" + "".join(f"{one:8.3f}" for one in seen) + ("  too slow" if fails else ""))
    mean = math.exp(sum(map(math.log, ratios.values())) / len(ratios)) if ratios else 1
    bad |= mean < 0.98
    print(f"{'geometric mean of ' + str(len(ratios)):44}{mean:8.3f}" + ("  too slow" if mean < 0.98 else ""))
    listed = set((root / "tests/bench/rows.txt").read_text().split())
    for name in sorted(others & listed):
        print(f"{name:44} in one of the two only")
    return bad


sys.exit(main())
