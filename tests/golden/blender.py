# Writes blender.tsv: poses of the sample models skinned by Blender's armature modifier, with
# "preserve volume" off (linear blending) and on (dual quaternions). Blender imports the files,
# plays the clips and evaluates the modifier. It computes in float, so about six digits are
# accurate.
#
#   blender -b --factory-startup --python blender.py -- FOLDER OUT

import sys

import bpy
import numpy

numpy.bool = bool  # the importer of Blender 3.4 needs it, but numpy 1.24 has removed it

FOLDER, OUT = sys.argv[sys.argv.index("--") + 1:]
# Model, clip, time in seconds. The times are those of keys, because Blender's curves rotate
# differently from glTF's between them. The clips move every joint, because Blender does not reset
# the others.
POSES = [("figure", "walk", 0.375), ("figure", "walk", 0.75), ("arm", "bend", 0.75),
         ("arm", "bend", 1), ("bar", "twist", 0.75), ("bar", "twist", 1.125)]
VERTICES = {"figure": 240, "arm": 200, "bar": 200}


def load(model):
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.import_scene.gltf(filepath=f"{FOLDER}/{model}.glb")
    armature = next(o for o in bpy.data.objects if o.type == "ARMATURE")
    skinned = next(o for o in bpy.data.objects if o.find_armature() == armature)
    return armature, skinned


def pose(armature, clip, time):
    # The importer makes an action of each clip. Only the requested one may play.
    data = armature.animation_data
    for track in data.nla_tracks:
        track.mute = True
    data.action = next(a for a in bpy.data.actions if a.name.split("_")[0] == clip)
    render = bpy.context.scene.render
    frame = time * render.fps / render.fps_base
    bpy.context.scene.frame_set(int(frame), subframe=frame - int(frame))


def skin(skinned, preserves_volume):
    modifier = next(m for m in skinned.modifiers if m.type == "ARMATURE")
    modifier.use_deform_preserve_volume = preserves_volume
    evaluated = skinned.evaluated_get(bpy.context.evaluated_depsgraph_get())
    return [evaluated.matrix_world @ v.co for v in evaluated.to_mesh().vertices]


def gltf(v):
    # Blender's z axis points upwards; in glTF it is the y axis.
    return v.x, v.z, -v.y


with open(OUT, "w") as out:
    print(f"# Blender {bpy.app.version_string}, by blender.py: its armature modifier", file=out)
    print("# model clip seconds vertex, its bind pose x y z, linear x y z, preserve volume x y z", file=out)
    for model, clip, time in POSES:
        armature, skinned = load(model)
        pose(armature, clip, time)
        bind = [v.co for v in skinned.data.vertices]
        linear, volume = skin(skinned, False), skin(skinned, True)
        for i in range(VERTICES[model]):
            vertex = int((i + 0.5) * len(bind) / VERTICES[model])
            numbers = [f"{n:.8g}" for v in (bind, linear, volume) for n in gltf(v[vertex])]
            print(model, clip, time, vertex, *numbers, sep="\t", file=out)
