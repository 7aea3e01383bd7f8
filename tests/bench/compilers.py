#!/usr/bin/env python3
"""Asks the compilers of AMD's GPUs in Mesa's RADV what they make of the kernels, without a GPU.

    tests/bench/compilers.py PROGRAM            compares with compilers.tsv
    tests/bench/compilers.py PROGRAM --update   writes compilers.tsv
    tests/bench/compilers.py PROGRAM --goals    counts vector instructions by loop; better with the Mesa of unpack_mesa.sh
    tests/bench/compilers.py PROGRAM --intel SHIM   counts the kernels that Intel's compiler makes at full SIMD width

PROGRAM is dermis_compiler_table. RADV_FORCE_FAMILY makes RADV a device without hardware, which compiles and executes nothing.
Fails if a kernel cannot be compiled, spills registers or uses scratch memory; and, if Mesa is the version of the table, if a kernel
has fewer waves or over 3 % more instructions than in the table. Ends with 77 if there is no RADV.

The driver is that of VK_DRIVER_FILES, otherwise Debian's. For Intel it must name ANV, and SHIM is Mesa's
libintel_noop_drm_shim.so, the device without hardware; no package has it (docs/gpus.md says how to build it)."""

import collections
import os
import re
import subprocess
import sys
import tempfile
from pathlib import Path

table = Path(__file__).with_name("compilers.tsv")
debian = "/usr/share/vulkan/icd.d/radeon_icd.x86_64.json"
# GCN 4 at a quarter of the rate; GCN 5, the last with a multiplication and addition that rounds twice; RDNA 2; RDNA 3.
chips = ["polaris10", "vega10", "navi21", "gfx1100"]


def compiled(program, chip, *arguments, **settings):
    """The lines of PROGRAM for a chip: the kernel, and its statistics by name, which are empty where something failed."""
    driver = os.environ.get("VK_DRIVER_FILES", debian)
    environment = dict(os.environ, RADV_FORCE_FAMILY=chip, VK_DRIVER_FILES=driver, VK_ICD_FILENAMES=driver,
                       MESA_SHADER_CACHE_DISABLE="true", **settings)
    done = subprocess.run([program, *arguments], env=environment, stdout=subprocess.PIPE, text=True)
    if done.returncode != 0:
        yield f"exit status {done.returncode}", {}
    for line in done.stdout.splitlines():
        layout, stores, kernel, *values = line.split("\t")
        yield f"{layout}; {stores}; {kernel}", dict(value.split("=", 1) for value in values if "=" in value)


def version():
    driver = os.environ.get("VK_DRIVER_FILES", debian)
    if driver != debian:
        return driver
    return subprocess.check_output(["dpkg-query", "-W", "-f", "${Version}", "mesa-vulkan-drivers"], text=True)


def row(values):
    number = lambda name: int(values[name])
    return [number("Instructions"), number("VGPRs"), number("Subgroups per SIMD"),
            number("Spilled SGPRs") + number("Spilled VGPRs"), number("Scratch size"), number("LDS size")]


def check(program, isUpdate):
    now = {(chip, kernel): row(values) if values else None
           for chip in chips for kernel, values in compiled(program, chip)}
    bad = not now
    for key, values in now.items():
        if values is None or values[3] or values[4]:
            print("fails or spills: ", *key)
            bad = True
    if isUpdate:
        lines = [f"Mesa\t{version()}", "chip\tkernel\tinstructions\tVGPRs\twaves\tspills\tscratch\tLDS"]
        lines += ["\t".join(map(str, [*key, *values])) for key, values in sorted(now.items()) if values]
        table.write_text("\n".join(lines) + "\n")
        return bad
    first, _, *lines = table.read_text().splitlines()
    before = {(chip, kernel): list(map(int, values))
              for chip, kernel, *values in (line.split("\t") for line in lines)}
    same = first == f"Mesa\t{version()}"
    if not same:
        print("another Mesa than that of compilers.tsv: only failures and spills count")
    for key in sorted(set(before) | set(now)):
        if key not in now or key not in before:
            print("gone: " if key in before else "new: ", *key)
            bad |= same
            continue
        old, new = before[key], now[key]
        if new is None:
            continue
        if new[2] < old[2] or new[0] > 1.03 * old[0]:
            print("worse: ", *key, f"{old[0]} -> {new[0]} instructions, {old[2]} -> {new[2]} waves")
            bad |= same
    print(f"{len(now)} kernels on {len(chips)} chips" + ("; if this is meant: --update" if bad else ""))
    return bad


def vectorInstructions(path):
    """Of a kernel's machine code: in its innermost loop that stores, and outside all loops. Scalar instructions, loads, stores,
    integer multiplications and transcendental functions do not count."""
    blocks = []
    for line in open(path):
        if start := re.match(r"BB(\d+):", line):
            blocks.append((int(start[1]), []))
        elif blocks and (instruction := line.split(";")[0].strip()):
            blocks[-1][1].append(instruction)
    place = {number: index for index, (number, _) in enumerate(blocks)}
    loops = {}
    for index, (_, instructions) in enumerate(blocks):
        for instruction in instructions:
            to = re.match(r"s_c?branch\S*\s+BB(\d+)", instruction)
            if to and place[int(to[1])] <= index:
                loops[place[int(to[1])]] = max(loops.get(place[int(to[1])], 0), index)

    def count(indices):
        names = collections.Counter(i.split()[0] for index in indices for i in blocks[index][1])
        return sum(n for name, n in names.items() if name.startswith("v_") and
                   not name.startswith(("v_rcp", "v_rsq", "v_sqrt", "v_exp", "v_log", "v_sin", "v_cos", "v_mul_lo_", "v_mul_hi_")))

    stores = [(end - begin, begin, end) for begin, end in loops.items()
              if any("store" in i for index in range(begin, end + 1) for i in blocks[index][1])]
    if not stores:
        return None
    _, begin, end = min(stores)
    outside = [index for index in range(len(blocks)) if not any(b <= index <= e for b, e in loops.items())]
    return count(range(begin, end + 1)), count(outside)


GOALS = {"dual quaternions": "at most 123, 134", "dual quaternions with scale": "at most 278; 32 waves on navi31",
         "linear": "at most 113", "encoding": "at most 60"}


def goals(program):
    f32 = "with positions as float32x3, normals as float32x3"
    f16 = "with positions as float16x4, normals as octahedral16x2"
    four = "for exactly 4 influences"
    kernels = [("dual quaternions", f"skin float32x3 x2 skin kernel for dual_quaternion {f32}, {four}"),
               ("dual quaternions with scale",
                f"skin float32x3 x2 skin kernel for dual_quaternion {f32}, for 4 influences and joints that scale"),
               ("linear", f"skin float32x3 x2 skin kernel for linear {f32}, {four}"),
               ("dual quaternions, float16x4 + octahedral16x2",
                f"skin float16x4, octahedral16x2 skin kernel for dual_quaternion {f16}, {four}"),
               ("linear, float16x4 + octahedral16x2",
                f"skin float16x4, octahedral16x2 skin kernel for linear {f16}, {four}")]
    for chip in sys.argv[3:] or ["navi21"]:
        with tempfile.TemporaryDirectory() as folder:
            waves = {kernel: values.get("Subgroups per SIMD") for kernel, values in compiled(program, chip, folder)}
            print(f"{chip}: vector instructions in the loop over instances; with the rest for 4 instances; waves; goals for navi21")
            loops = {}
            for title, name in kernels:
                path = Path(folder) / (re.sub("[ ,/]", "_", name) + ".s")
                found = vectorInstructions(path) if path.exists() else None
                if found is None:
                    print(f"  {title:46} not found")
                    continue
                layout = name[5:name.index(" skin kernel")]
                kernel = name[name.index("skin kernel"):]
                loops[title] = found[0]
                print(f"  {title:46} {found[0]:4} {found[0] + found[1] / 4:6.0f} {waves[f'{layout}; words; {kernel}']:>4}"
                      f"   {GOALS.get(title, '')}")
            for method in ("dual quaternions", "linear"):
                compact = method + ", float16x4 + octahedral16x2"
                if method in loops and compact in loops:
                    print(f"  {compact + ', encoding alone':46} {loops[compact] - loops[method]:4} {'':11}   {GOALS['encoding']}")


def intel(program, shim):
    total = full = 0
    bad = False
    for platform, width in {"skl": 16, "tgl": 16, "dg2": 16, "mtl": 16, "lnl": 32, "bmg": 32}.items():
        halves = collections.Counter()
        now = list(compiled(program, platform, LD_PRELOAD=shim, INTEL_STUB_GPU_PLATFORM=platform))
        for kernel, values in now:
            if not values or int(values["Spill Count"]) or int(values["Scratch Memory Size"]):
                print("fails or spills: ", platform, kernel)
                bad = True
            elif int(values["subgroup"]) < width:
                skin = re.search(r"kernel for (\w+)", kernel)
                morphs = ", morph targets" if "morph targets" in kernel else ""
                halves[skin[1] + morphs if skin else kernel.rpartition("; ")[2]] += 1
        bad |= not now
        wide = len(now) - halves.total()
        total += len(now)
        full += wide
        print(f"{platform}: {wide} of {len(now)} kernels at full width; at half: " +
              "; ".join(f"{name} {count}" for name, count in sorted(halves.items())))
    print(f"{full} of {total}")
    return bad


def main():
    if len(sys.argv) < 2:
        sys.exit(__doc__)
    if not Path(os.environ.get("VK_DRIVER_FILES", debian)).exists():
        print("compilers.py: no RADV on this machine")
        return 77
    if "--intel" in sys.argv:
        return intel(sys.argv[1], sys.argv[3])
    if "--goals" in sys.argv:
        return goals(sys.argv[1])
    return check(sys.argv[1], "--update" in sys.argv)


sys.exit(main())
