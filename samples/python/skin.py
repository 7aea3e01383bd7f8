#!/usr/bin/env python3
"""Skins a crowd on the CPU, on all cores, checks every vertex against the reference, and draws it.

    skin.py MODEL.glb [--figures N] [--frames N] [-o CROWD.png | CROWD.ply]

Needs libdermis and libdermis_compare, and the packages python3-cffi and python3-numpy; for a picture python3-matplotlib, too.
There is no binding code: cffi reads dermis.cdef.h, which is installed with the libraries. pkg-config finds both, or --libraries and
--declarations name them.

Exit status: 0 success, 1 a vertex is wrong, 2 wrong usage, 3 the model cannot be used.
"""
import argparse
import math
import os
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor

import cffi
import numpy as np


def pkg_config(variable):
    return subprocess.run(["pkg-config", f"--variable={variable}", "dermis-c"], check=True, text=True, capture_output=True).stdout.strip()


parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
parser.add_argument("model")
parser.add_argument("--figures", type=int, default=9)
parser.add_argument("--frames", type=int, default=1, help="the last one is checked and drawn")
parser.add_argument("-o", "--output", help="a picture (.png) or a mesh (.ply)")
parser.add_argument("--libraries", help="the folder of libdermis")
parser.add_argument("--declarations", help="the file dermis.cdef.h")
arguments = parser.parse_args()

# [load]
ffi = cffi.FFI()
with open(arguments.declarations or pkg_config("cdef"), encoding="utf-8") as file:
    ffi.cdef(file.read())
folder = arguments.libraries or pkg_config("libdir")
dermis = ffi.dlopen(os.path.join(folder, "libdermis.so"))
reference = ffi.dlopen(os.path.join(folder, "libdermis_compare.so"))
error = ffi.new("dermis_error *")


def must(code):
    if code != dermis.DERMIS_OK:
        sys.exit((print(ffi.string(error.message).decode(), file=sys.stderr), 3)[1])


def new(kind, **members):
    """A structure with its size. Keep what its pointers point to."""
    return ffi.new(f"{kind} *", {"size": ffi.sizeof(kind), **members})


def create(function, *parameters):
    """Calls a function that returns an object or a handle to its last parameter but one."""
    made = ffi.new(ffi.typeof(function).args[-2].item.cname + " *")
    must(function(*parameters, made, error))
    return made[0]
# [/load]


# [scene]
path = ffi.new("char[]", os.fsencode(arguments.model))
model = create(dermis.dermis_model_load, new("dermis_model_source", path=path, missing_normals=dermis.DERMIS_NORMALS_SMOOTH))
contents = new("dermis_model_info")
must(dermis.dermis_model_contents(model, contents, error))
runner = create(dermis.dermis_runner_create, ffi.NULL)
scene = dermis.dermis_runner_scene(runner)

layout = {"normals": dermis.DERMIS_FORMAT_FLOAT32X3}
parts = []  # skinned primitives, each with its mesh in the scene
for index in range(contents.primitive_count):
    part = new("dermis_primitive")
    must(dermis.dermis_model_primitive(model, index, part, error))
    if part.mesh.influence_set_count > 0:
        packed = create(dermis.dermis_pack, part.mesh, part.joint_count)
        parts.append((index, part, create(dermis.dermis_add_mesh, scene, packed)))
        dermis.dermis_destroy(packed)
if not parts:
    sys.exit((print(f"{arguments.model} has nothing skinned", file=sys.stderr), 3)[1])

figures = []  # for each figure a list of (part, pose, instance)
for _ in range(arguments.figures):
    figure, poses = [], {}
    for part in parts:
        if part[1].skin not in poses:
            poses[part[1].skin] = create(dermis.dermis_add_poses, scene, new("dermis_pose_desc", joint_count=part[1].joint_count), 1)
        description = new("dermis_instance_desc", mesh=part[2], pose=poses[part[1].skin], layout=layout)
        figure.append((part, poses[part[1].skin], create(dermis.dermis_add_instance, scene, description)))
    figures.append(figure)
# [/scene]


def joints_of(part, figure, frame):
    """The pose of a figure, which plays the first clip with an offset of its own, as an array (joints, 3, 4)."""
    joints = np.empty((part[1].joint_count, 3, 4), np.float32)
    clip = 0 if contents.clip_count > 0 else dermis.DERMIS_REST_POSE
    duration = contents.clips[0].duration if contents.clip_count > 0 else 0
    moment = (frame / 30 + duration * figure / len(figures)) % duration if duration > 0 else 0
    must(dermis.dermis_model_pose(model, part[0], clip, moment, ffi.from_buffer("dermis_joint[]", joints), len(joints), ffi.NULL, 0, error))
    return joints


# [frame]
frame_jobs = new("dermis_runner_frame")
moved = [(number, part, pose) for number, figure in enumerate(figures) for part, pose, _ in figure]
poses = ffi.new("dermis_pose[]", [pose for _, _, pose in moved])
memory = ffi.new("dermis_joint *[]", len(poses))
seconds = math.inf
with ThreadPoolExecutor(os.cpu_count()) as threads:
    for frame in range(1, arguments.frames + 1):
        matrices = [ffi.from_buffer(joints_of(part, number, frame)) for number, part, _ in moved]
        begin = time.perf_counter()
        must(dermis.dermis_begin_frame(scene, frame, frame - 1, error))
        must(dermis.dermis_write_poses(scene, poses, len(poses), memory, ffi.NULL, error))
        for target, joints in zip(memory, matrices):
            ffi.memmove(target, joints, len(joints))
        must(dermis.dermis_runner_jobs(runner, 0, frame_jobs, error))
        # cffi releases the interpreter's lock during a call, so the jobs run at the same time. Each thread takes the next one.
        jobs = iter(range(frame_jobs.job_count))
        if any(threads.map(lambda _: any(dermis.dermis_run_job(runner, job, ffi.NULL) for job in jobs), range(os.cpu_count()))):
            sys.exit("a job failed")
        seconds = min(seconds, time.perf_counter() - begin)
# [/frame]

# The output as an array of 4-byte floats. Where an instance is in it, and with which stride, Dermis says.
output = np.frombuffer(ffi.buffer(frame_jobs.output, frame_jobs.output_byte_count), np.float32)
skinned = []  # (part, positions, normals) of the last frame
worst, wrong, vertices = 0.0, 0, 0
for number, figure in enumerate(figures):
    for part, _, instance in figure:
        place = new("dermis_instance_info")
        must(dermis.dermis_instance_contents(scene, instance, place, error))
        count, stride = part[1].mesh.vertex_count, place.places.streams[0].stride
        first = place.offset // 4
        both = output[first:first + count * stride // 4].reshape(count, stride // 4)
        skinned.append((part, both[:, 0:3], both[:, 3:6]))
        # [compare]
        joints = ffi.from_buffer("dermis_joint[]", joints_of(part, number, arguments.frames))
        posed = new("dermis_posed_mesh", mesh=part[1].mesh, joints=joints, joint_count=len(joints))
        start = ffi.cast("char *", frame_jobs.output)
        attributes = {name: {"data": start + place.places.streams[stream].offset, "stride": stride, "format": dermis.DERMIS_FORMAT_FLOAT32X3}
                      for stream, name in enumerate(("positions", "normals"))}
        comparison = new("dermis_comparison")
        must(reference.dermis_compare(posed, new("dermis_skinned_view", vertex_count=count, **attributes), comparison, error))
        # [/compare]
        worst, wrong, vertices = max(worst, comparison.worst_position), wrong + comparison.failures, vertices + count
print(f"{vertices} vertices of {len(figures)} figures, {vertices / seconds / 1e6:.0f} million a second: "
      f"{'every one is right' if wrong == 0 else f'{wrong} are WRONG'}, worst position error {100 * worst:.0f} % of its bound")

# The figures in rows and columns, as one mesh.
size = max(np.ptp(positions, axis=0).max() for _, positions, _ in skinned) * 1.1
columns = math.ceil(math.sqrt(len(figures)))
points, normals, triangles, total = [], [], [], 0
for number, (part, positions, directions) in enumerate(skinned):
    row, column = divmod(number // len(parts), columns)
    points.append(positions + np.array([column * size, 0, -row * size], np.float32))
    normals.append(directions)
    triangles.append(np.frombuffer(ffi.buffer(part[1].triangles, part[1].index_count * 4), np.uint32).reshape(-1, 3) + total)
    total += len(positions)
points, normals, triangles = np.concatenate(points), np.concatenate(normals), np.concatenate(triangles)

if arguments.output and arguments.output.endswith(".ply"):
    with open(arguments.output, "wb") as file:
        file.write(f"ply\nformat binary_little_endian 1.0\nelement vertex {len(points)}\n".encode())
        file.write("".join(f"property float {name}\n" for name in ("x", "y", "z", "nx", "ny", "nz")).encode())
        file.write(f"element face {len(triangles)}\nproperty list uchar uint vertex_indices\nend_header\n".encode())
        file.write(np.hstack([points, normals]).astype("<f4").tobytes())
        faces = np.empty(len(triangles), [("count", "u1"), ("indices", "<u4", 3)])
        faces["count"], faces["indices"] = 3, triangles
        file.write(faces.tobytes())
elif arguments.output:
    import matplotlib
    matplotlib.use("Agg")
    from matplotlib import collections, pyplot
    # Seen from above the front: the far triangles first, each as bright as its normal faces the light.
    tilt = math.radians(25)
    flat = np.stack([points[:, 0], points[:, 1] * math.cos(tilt) - points[:, 2] * math.sin(tilt)], axis=1)
    depth = points[:, 1] * math.sin(tilt) + points[:, 2] * math.cos(tilt)
    order = np.argsort(depth[triangles].mean(axis=1))
    light = np.clip(normals[triangles].mean(axis=1) @ np.array([0.3, 0.6, 0.74]), 0, 1)[order]
    colors = np.stack([0.25 + 0.7 * light, 0.2 + 0.6 * light, 0.2 + 0.5 * light], axis=1)
    _, axes = pyplot.subplots(figsize=(9, 7))
    axes.add_collection(collections.PolyCollection(flat[triangles[order]], facecolors=colors, edgecolors="none", antialiaseds=False))
    axes.autoscale_view()
    axes.set_aspect("equal")
    axes.set_axis_off()
    pyplot.savefig(arguments.output, dpi=120, bbox_inches="tight")

dermis.dermis_destroy(runner)
dermis.dermis_destroy(model)
sys.exit(0 if wrong == 0 else 1)
