#!/usr/bin/env python3
"""Shows that a test catches each of many small mistakes in the engine.

tests/mutants/run.py [NUMBER...]       plants all mistakes, builds once, and demands a failed test for each
tests/mutants/run.py find [NUMBER...]  tells which tests catch each, the fastest first

The mistakes are in the *.txt files beside this one:

    engine/src/core/text.cpp           the file, for all that follow

    17 What goes wrong                 a number that no other has
    core_test TextTest.Quotes          the program and the gtest filter that must fail
    - the text as it is
    + the same, with MISTAKE where a condition decides

The old text must occur exactly once. It need not be whole lines. Builds in build/nightly/mutants.
"""
import concurrent.futures
import fnmatch
import json
import os
import re
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

here = Path(__file__).resolve().parent
root = here.parent.parent
tree = root / "build/nightly/mutants"
tests = tree / "build/ci/tests"
if (root.parent / "shared").is_dir():  # which tests of the copy would not find
    os.environ.setdefault("DERMIS_TEST_DATA", str(root.parent / "shared"))
time_limit = 60  # seconds of one test; a mistake may cause an endless loop
memory_limit = 16 << 30
jobs = os.cpu_count() or 2
# Programs in which `find` looks for a test. Those without a device come first.
candidates = ["core_test", "math_test", "reference_test", "cpu_test", "gltf_test", "mock_test", "vulkan_test", "system_test"]


class Mutant:
    def __init__(self, file, number, title):
        self.file, self.number, self.title = file, number, title
        self.program = self.filter = None
        self.old, self.new = [], []

    def __str__(self):
        return f"mutant {self.number} ({self.title})"


def read_mutants():
    mutants = {}
    for data in sorted(here.glob("*.txt")):
        file = mutant = None
        for line_number, line in enumerate(data.read_text().splitlines(), 1):
            if match := re.fullmatch(r"(\d+) (.+)", line):
                mutant = Mutant(file, int(match[1]), match[2])
                if file is None or mutant.number in mutants or not 0 < mutant.number < 1000:
                    sys.exit(f"{data.name}:{line_number}: {mutant} needs a file and a number of its own below 1000")
                mutants[mutant.number] = mutant
            elif line.startswith("- ") and mutant:
                mutant.old.append(line[2:])
            elif line.startswith("+ ") and mutant:
                mutant.new.append(line[2:])
            elif mutant and not mutant.program and (match := re.fullmatch(r"(\S+) (\S+)", line)):
                mutant.program, mutant.filter = match.groups()
            elif re.fullmatch(r"[\w/]+\.\w+", line):
                file, mutant = line, None
            elif line:
                sys.exit(f"{data.name}:{line_number}: not a file, a mutant, its test or its text: {line}")
    for mutant in mutants.values():
        if not mutant.program or not mutant.old or "MISTAKE" not in "\n".join(mutant.new):
            sys.exit(f"{mutant} lacks a test, an old text or MISTAKE in the new one")
    return mutants


def planted(text, mutants, complaints):
    for mutant in mutants:
        old, new = "\n".join(mutant.old), "\n".join(mutant.new)
        if text.count(old) != 1:
            complaints.append(f"{mutant}: its old text occurs {text.count(old)} times in {mutant.file}, not once: {old}")
        text = text.replace(old, re.sub(r"\bMISTAKE\b", f"::mutants::isChosen({mutant.number})", new))
    return f'#include "{here}/mutants.h"\n' + text if mutants else text


def copy_tree(mutants):
    """Leaves unchanged files alone, so that a second build is short."""
    names = subprocess.run(["git", "ls-files", "-z"], cwd=root, check=True, capture_output=True, text=True).stdout
    names = [name for name in names.split("\0") if name and (root / name).is_file()]
    if unknown := {mutant.file for mutant in mutants.values()} - set(names):
        sys.exit(f"There is no {unknown.pop()} to plant a mistake in")
    contents, complaints = {}, []
    for name in names:
        contents[name] = (root / name).read_bytes()
        in_file = [mutant for mutant in mutants.values() if mutant.file == name]
        if in_file:
            contents[name] = planted(contents[name].decode(), in_file, complaints).encode()
    if complaints:
        sys.exit("\n".join(complaints))
    for name, content in contents.items():
        copy = tree / name
        if copy.is_file() and copy.read_bytes() == content:
            continue
        copy.parent.mkdir(parents=True, exist_ok=True)
        copy.write_bytes(content)
        copy.chmod((root / name).stat().st_mode)
    names = set(names)
    for folder in tree.iterdir():
        for path in folder.rglob("*") if folder.name != "build" else ():
            if path.is_file() and str(path.relative_to(tree)) not in names:
                path.unlink()


def build(programs):
    log = tree / "build/build.log"
    log.parent.mkdir(parents=True, exist_ok=True)
    with open(log, "w") as output:
        for command in (["cmake", "--preset", "ci"], ["cmake", "--build", "build/ci", "--target", *programs]):
            if subprocess.run(command, cwd=tree, stdout=output, stderr=subprocess.STDOUT).returncode != 0:
                print("".join(open(log).readlines()[-60:]))
                sys.exit("mutants: the build failed")


def run(program, test_filter, number=0, limit=time_limit, arguments=(), environment=()):
    """Returns the exit status, or 'timeout', and what the program wrote."""
    with tempfile.TemporaryDirectory() as folder:
        settings = dict(os.environ, DERMIS_MUTANT=str(number), TMPDIR=folder, TEST_TMPDIR=folder, **dict(environment))
        command = [tests / program, f"--gtest_filter={test_filter}", *arguments]
        try:
            done = subprocess.run(command, cwd=folder, env=settings, timeout=limit, stdin=subprocess.DEVNULL,
                                  stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, errors="replace")
        except subprocess.TimeoutExpired as expired:
            return "timeout", (expired.stdout or b"").decode(errors="replace")
        return done.returncode, done.stdout


def in_parallel(function, items):
    with concurrent.futures.ThreadPoolExecutor(jobs) as pool:
        return list(pool.map(function, items))


def check_without_mistake(mutants):
    """All named tests must pass, and each filter must select one that is not skipped."""
    def passes(program):
        filters = sorted({mutant.filter for mutant in mutants if mutant.program == program})
        status, output = run(program, ":".join(filters), limit=1200)
        if status not in (0, 77):
            sys.exit(f"{output[-4000:]}\nmutants: {program} fails without a mistake")
        return program, re.findall(r"\[       OK \] ([\w/.]+)", output)
    passed = dict(in_parallel(passes, sorted({mutant.program for mutant in mutants})))
    for mutant in mutants:
        if not any(fnmatch.fnmatchcase(test, one) for test in passed[mutant.program] for one in mutant.filter.split(":")):
            sys.exit(f"{mutant}: no test of {mutant.program} that matches {mutant.filter} runs and passes without it")


def is_caught(mutant):
    return run(mutant.program, mutant.filter, mutant.number, arguments=["--gtest_fail_fast"])[0] not in (0, 77)


def check(mutants):
    check_without_mistake(mutants)
    living = [mutant for mutant, caught in zip(mutants, in_parallel(is_caught, mutants)) if not caught]
    for mutant in living:
        print(f"{mutant} in {mutant.file}: {mutant.program} {mutant.filter} does not catch it")
    figures = f"{len(mutants)} planted, {len(mutants) - len(living)} caught"
    (tree / "figures").write_text(figures + "\n")
    print(f"mutants: {figures}")
    return 1 if living else 0


def reached_by(program):
    """[(test, seconds, numbers)] of a program, the fastest first. Kept for as long as the program is the same."""
    kept = tests / f"{program}.reached.json"
    if kept.is_file() and kept.stat().st_mtime > (tests / program).stat().st_mtime:
        return json.loads(kept.read_text())
    names, suite = [], ""
    for line in run(program, "*", arguments=["--gtest_list_tests"])[1].splitlines():
        line = line.split("#")[0].rstrip()
        if re.fullmatch(r"\S+\.", line):
            suite = line
        elif re.fullmatch(r"  \S+", line):
            names.append(suite + line.strip())

    def one(name):
        with tempfile.NamedTemporaryFile("r") as file:
            begin = time.time()
            status = run(program, name, environment=[("DERMIS_MUTANTS_REACHED", file.name)])[0]
            return name, time.time() - begin, sorted({int(line) for line in file}) if status == 0 else []
    found = sorted(in_parallel(one, names), key=lambda entry: entry[1])
    kept.write_text(json.dumps(found))
    return found


def find(mutants):
    """Prints for each mistake which tests catch it, of the first program that has one."""
    reaching = dict.fromkeys((mutant.number for mutant in mutants), 0)
    for program in candidates:
        reached = reached_by(program)

        def search(mutant):
            names = [name for name, _, numbers in reached if mutant.number in numbers]
            reaching[mutant.number] += len(names)
            for some in (names[:8], names[8:40], names[40:]):
                status, output = run(program, ":".join(some), mutant.number, 300) if some else (0, "")
                if status not in (0, 77):
                    failed = set(re.findall(r"\[  FAILED  \] ([\w/.]+)", output))
                    begun = re.findall(r"\[ RUN      \] (\S+)", output)  # the last one crashed, or takes too long
                    print(mutant.number, program, *[name for name in names if name in failed][:6] or begun[-1:], flush=True)
                    return None
            return mutant
        mutants = [mutant for mutant in in_parallel(search, mutants) if mutant]
    for mutant in mutants:
        print(f"{mutant}: none of the {reaching[mutant.number]} tests that come across it fails")


def main():
    arguments = sys.argv[1:]
    finds = arguments[:1] == ["find"]
    everything = read_mutants()
    numbers = [int(argument) for argument in arguments[finds:]] or sorted(everything)
    mutants = [everything[number] for number in numbers]
    for limit, value in ((resource.RLIMIT_CORE, 0), (resource.RLIMIT_AS, memory_limit)):
        resource.setrlimit(limit, (value, value))
    copy_tree(everything)
    build(candidates if finds else sorted({mutant.program for mutant in mutants}))
    return find(mutants) if finds else check(mutants)


if __name__ == "__main__":
    sys.exit(main())
