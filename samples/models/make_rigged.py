#!/usr/bin/env python3
"""Makes the models of docs/rigs.md: rigged_arm.glb from figure.glb, and tentacle.glb.

    samples/models/make_rigged.py

The arm is the left one of the figure with half of its shirt. It gets twist joints along the forearm, a morph target for the bent elbow
and one for the raised arm, three clips, and a rig in the extras of its skin. The rig of the tentacle is tentacle.json.
"""
import json
import math
import pathlib
import struct

FOLDER = pathlib.Path(__file__).resolve().parent
FORMATS = {5126: "f", 5121: "B", 5123: "H"}
WIDTHS = {"SCALAR": 1, "VEC3": 3, "VEC4": 4, "MAT4": 16}


def dot(a, b): return sum(x * y for x, y in zip(a, b))
def add(a, b): return [x + y for x, y in zip(a, b)]
def sub(a, b): return [x - y for x, y in zip(a, b)]
def scale(a, s): return [x * s for x in a]
def cross(a, b): return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
def unit(a): return scale(a, 1 / max(math.sqrt(dot(a, a)), 1e-12))


def turn(axis, degrees):
    """A quaternion (x, y, z, w)."""
    half = math.radians(degrees) / 2
    return [*scale(unit(axis), math.sin(half)), math.cos(half)]


def times(a, b):
    xyz = add(add(scale(b[:3], a[3]), scale(a[:3], b[3])), cross(a[:3], b[:3]))
    return [*xyz, a[3] * b[3] - dot(a[:3], b[:3])]


def inverse(q): return [-q[0], -q[1], -q[2], q[3]]
def turned(q, v): return times(times(q, [*v, 0]), inverse(q))[:3]


class Joint:
    def __init__(self, name, parent, translation, rotation=(0, 0, 0, 1)):
        self.name, self.parent, self.translation, self.rotation = name, parent, list(translation), list(rotation)
        self.turn, self.place = self.rotation, self.translation  # in the scene
        if parent:
            self.turn = times(parent.turn, self.rotation)
            self.place = add(parent.place, turned(parent.turn, self.translation))

    def local(self, point): return turned(inverse(self.turn), sub(point, self.place))

    def after(self, axis, degrees):
        """Its rotation relative to its parent after it turned about an axis of the scene."""
        return times(inverse(self.parent.turn), times(turn(axis, degrees), self.turn))


class Output:
    """A glTF file with one skinned mesh."""

    def __init__(self):
        self.bytes = bytearray()
        self.json = {"asset": {"version": "2.0", "generator": "dermis make_rigged.py"}, "scene": 0, "bufferViews": [], "accessors": []}

    def view(self, kind, values):
        self.bytes += b"\0" * (-len(self.bytes) % 4)
        flat = [x for value in values for x in (value if isinstance(value, (list, tuple)) else [value])]
        data = struct.pack("<%d%s" % (len(flat), FORMATS[kind]), *flat)
        self.json["bufferViews"].append({"buffer": 0, "byteOffset": len(self.bytes), "byteLength": len(data)})
        self.bytes += data
        return len(self.json["bufferViews"]) - 1

    def add(self, kind, shape, values, limits=False, **more):
        accessor = {"bufferView": self.view(kind, values), "componentType": kind, "count": len(values), "type": shape, **more}
        if limits:
            columns = list(zip(*values)) if shape != "SCALAR" else [values]
            accessor["min"], accessor["max"] = [min(c) for c in columns], [max(c) for c in columns]
        self.json["accessors"].append(accessor)
        return len(self.json["accessors"]) - 1

    def add_sparse(self, values, limits=False):
        used = [i for i, v in enumerate(values) if dot(v, v) > 1e-10]
        sparse = {"count": len(used), "indices": {"bufferView": self.view(5123, used), "componentType": 5123},
                  "values": {"bufferView": self.view(5126, [values[i] for i in used])}}
        accessor = {"componentType": 5126, "count": len(values), "type": "VEC3", "sparse": sparse}
        if limits:
            columns = list(zip(*values))
            accessor["min"], accessor["max"] = [min(c) for c in columns], [max(c) for c in columns]
        self.json["accessors"].append(accessor)
        return len(self.json["accessors"]) - 1

    def write(self, name, joints, mesh, clips, rig=None):
        """`clips`: name to {joint: list of rotations, one a half second}."""
        number = {joint.name: i + 1 for i, joint in enumerate(joints)}
        nodes = [{"name": name, "mesh": 0, "skin": 0}]
        for joint in joints:
            node = {"name": joint.name, "translation": joint.translation, "rotation": joint.rotation}
            children = [number[other.name] for other in joints if other.parent is joint]
            nodes.append({**node, "children": children} if children else node)
        matrices = []
        for joint in joints:
            back = inverse(joint.turn)
            columns = [[*turned(back, axis), 0] for axis in ([1, 0, 0], [0, 1, 0], [0, 0, 1])]
            matrices.append([*columns[0], *columns[1], *columns[2], *turned(back, scale(joint.place, -1)), 1])
        skin = {"joints": list(range(1, len(nodes))), "inverseBindMatrices": self.add(5126, "MAT4", matrices)}
        if rig:
            skin["extras"] = {"dermis_rig": rig}
        animations = []
        for clip, channels in clips.items():
            animation = {"name": clip, "channels": [], "samplers": []}
            for joint, keys in channels.items():
                time = self.add(5126, "SCALAR", [i / 2 for i in range(len(keys))], True)
                animation["channels"].append({"sampler": len(animation["samplers"]), "target": {"node": number[joint], "path": "rotation"}})
                animation["samplers"].append({"input": time, "output": self.add(5126, "VEC4", keys)})
            animations.append(animation)
        material = {"pbrMetallicRoughness": {"metallicFactor": 0, "roughnessFactor": 0.75}, "doubleSided": True}
        self.json.update({"scenes": [{"nodes": [0, 1]}], "nodes": nodes, "meshes": [mesh], "skins": [skin], "materials": [material],
                          "animations": animations, "buffers": [{"byteLength": len(self.bytes)}]})
        text = json.dumps(self.json, separators=(",", ":")).encode()
        text += b" " * (-len(text) % 4)
        self.bytes += b"\0" * (-len(self.bytes) % 4)
        chunks = struct.pack("<II", len(text), 0x4e4f534a) + text + struct.pack("<II", len(self.bytes), 0x004e4942) + self.bytes
        (FOLDER / (name + ".glb")).write_bytes(struct.pack("<III", 0x46546c67, 2, 12 + len(chunks)) + chunks)


class Input:
    """The figure."""

    def __init__(self, path):
        data = path.read_bytes()
        length = struct.unpack_from("<I", data, 12)[0]
        self.json, self.bytes = json.loads(data[20:20 + length]), data[28 + length:]

    def values(self, index):
        accessor = self.json["accessors"][index]
        width = WIDTHS[accessor["type"]]
        layout = struct.Struct("<%d%s" % (width, FORMATS[accessor["componentType"]]))
        first = self.json["bufferViews"][accessor["bufferView"]].get("byteOffset", 0)
        rows = [layout.unpack_from(self.bytes, first + i * layout.size) for i in range(accessor["count"])]
        return [row[0] for row in rows] if width == 1 else [list(row) for row in rows]


def bytes_of(weights):
    """Four at most, as bytes that sum to 255."""
    weights = sorted(((w, j) for j, w in weights.items() if w > 0), reverse=True)[:4]
    total = sum(w for w, _ in weights)
    parts = [round(255 * w / total) for w, _ in weights]
    parts[0] += 255 - sum(parts)
    padding = [0] * (4 - len(parts))
    return [j for _, j in weights] + padding, parts + padding


def normals_of(points, triangles):
    normals = [[0, 0, 0] for _ in points]
    for a, b, c in zip(*[iter(triangles)] * 3):
        normal = cross(sub(points[b], points[a]), sub(points[c], points[a]))
        for i in (a, b, c):
            normals[i] = add(normals[i], normal)
    return [unit(n) for n in normals]


# In meters. Of the bent elbow: its tip, the swollen upper arm, the forearm, the crease. Of the raised arm: its top, the armpit.
ELBOW = (0.02, 0.02, 0.012, -0.01)
SHOULDER = (0.03, 0.015)


def hill(x, middle, width): return math.exp(-((x - middle) / width) ** 2)


def make_arm():
    figure = Input(FOLDER / "figure.glb")
    skin = figure.json["skins"][0]
    nodes = [figure.json["nodes"][i] for i in skin["joints"]]
    names = [node["name"] for node in nodes]
    joints, by_name = [], {}

    def add_joint(name, parent, translation, rotation=(0, 0, 0, 1)):
        by_name[name] = Joint(name, by_name.get(parent), translation, rotation)
        joints.append(by_name[name])

    chest = figure.values(skin["inverseBindMatrices"])[names.index("upperChest")]
    tilt = math.degrees(math.atan2(chest[6], chest[5]))
    add_joint("upperChest", None, [0, 0, 0], turn([1, 0, 0], -tilt))
    chest_place = scale(turned(by_name["upperChest"].turn, chest[12:15]), -1)
    by_name["upperChest"].translation = by_name["upperChest"].place = chest_place
    for name, parent in [("leftClavicle", "upperChest"), ("leftUpperArm", "leftClavicle"), ("leftForearm", "leftUpperArm"),
                         ("leftHand", "leftForearm"), ("leftFingers", "leftHand"), ("leftThumb", "leftHand")]:
        node = nodes[names.index(name)]
        add_joint(name, parent, node["translation"], node["rotation"])
    forearm_length = by_name["leftHand"].translation[1]
    twists = ["leftForearmTwist%d" % i for i in (1, 2, 3)]
    for i, twist in enumerate(twists):
        add_joint(twist, "leftForearm", [0, forearm_length * (i + 1) / 3, 0])
    index = {joint.name: i for i, joint in enumerate(joints)}

    # The surface.
    points, normals, colors, weights, triangles = [], [], [], [], []
    for primitive in figure.json["meshes"][0]["primitives"]:
        isShirt = figure.json["materials"][primitive["material"]]["name"] == "shirt"
        read = {key: figure.values(value) for key, value in primitive["attributes"].items()}
        kept = {}
        for i, point in enumerate(read["POSITION"]):
            of = {names[j]: w for j, w in zip(read["JOINTS_0"][i], read["WEIGHTS_0"][i]) if w > 0}
            isArm = any(name in index for name in of) and point[0] > 0.2
            if isArm or (isShirt and point[0] > -1e-4):
                kept[i] = len(points)
                points.append(point)
                normals.append(read["NORMAL"][i])
                colors.append(read["COLOR_0"][i])
                weights.append({})
                for name, weight in of.items():
                    joint = index.get(name, 0)  # the rest of the body does not move
                    weights[-1][joint] = weights[-1].get(joint, 0) + weight
        for corners in zip(*[iter(figure.values(primitive["indices"]))] * 3):
            if all(corner in kept for corner in corners):
                triangles += [kept[corner] for corner in corners]

    # Twist joints: between them, weights are linear along the forearm.
    forearm, hand = by_name["leftForearm"], index["leftHand"]
    stations = [index["leftForearm"], *[index[twist] for twist in twists]]
    for point, of in zip(points, weights):
        along = min(max(forearm.local(point)[1] / forearm_length * 3, 0), 3)
        weight = of.pop(stations[0], 0)
        piece = min(int(along), 2)
        for station, share in ((piece, piece + 1 - along), (piece + 1, along - piece)):
            of[stations[station]] = of.get(stations[station], 0) + weight * share

    # The elbow and the shoulder, bent: what is missing there, and muscles that swell.
    upper, elbow_axis = by_name["leftUpperArm"], turned(by_name["leftForearm"].turn, [1, 0, 0])
    bone = turned(upper.turn, [0, 1, 0])
    flexor = cross(elbow_axis, bone)
    front = [0, 0, 1]
    elbow_degrees, shoulder_degrees, twist_degrees = 125, 95, 150
    elbow, shoulder = [], []
    for point, of in zip(points, weights):
        at = upper.local(point)
        s = at[1] - by_name["leftForearm"].translation[1]
        if s > 0:
            s = forearm.local(point)[1]
        middle = add(upper.place, scale(bone, at[1]))
        if s > 0:
            middle = add(forearm.place, scale(turned(forearm.turn, [0, 1, 0]), s))
        c = dot(unit(sub(point, middle)), flexor)
        outer, inner = max(-c, 0), max(c, 0)
        move = outer ** 2 * ELBOW[0] * hill(s, 0, 0.035)
        push = inner * (ELBOW[1] * hill(s, -0.12, 0.055) + ELBOW[2] * hill(s, 0.075, 0.04) + ELBOW[3] * hill(s, 0, 0.03))
        elbow.append(scale(flexor, push - move) if -0.25 < s < 0.2 else [0, 0, 0])
        away = sub(point, upper.place)
        near = math.sqrt(dot(away, away))
        top = max(dot(unit(away), unit([0.5, 1, 0])), 0)
        under = max(-dot(unit(away), [-0.3, 0.95, 0]), 0)
        wanted = add(scale(unit([0.6, 1, 0]), SHOULDER[0] * top * hill(near, 0.03, 0.07)),
                     scale(unit([0.6, -0.5, 0]), SHOULDER[1] * under * hill(near, 0.07, 0.05)))
        # What turns with the arm turns its displacement, too.
        turns = 1 - sum(of.get(index[name], 0) for name in ("upperChest", "leftClavicle"))
        shoulder.append(turned(turn(front, -shoulder_degrees * turns), wanted))
    before = normals_of(points, triangles)
    moved = [[add(p, d) for p, d in zip(points, target)] for target in (elbow, shoulder)]
    changes = [[sub(after, old) for after, old in zip(normals_of(points_of, triangles), before)] for points_of in moved]

    output = Output()
    both = [bytes_of(of) for of in weights]
    primitive = {
        "attributes": {"POSITION": output.add(5126, "VEC3", points, True), "NORMAL": output.add(5126, "VEC3", normals),
                       "COLOR_0": output.add(5121, "VEC4", colors, normalized=True), "JOINTS_0": output.add(5121, "VEC4", [j for j, _ in both]),
                       "WEIGHTS_0": output.add(5121, "VEC4", [w for _, w in both], normalized=True)},
        "indices": output.add(5123, "SCALAR", triangles), "material": 0,
        "targets": [{"POSITION": output.add_sparse(target, True), "NORMAL": output.add_sparse(change)}
                    for target, change in zip((elbow, shoulder), changes)]}
    mesh = {"name": "arm", "primitives": [primitive], "weights": [0, 0], "extras": {"targetNames": ["elbow_bent", "arm_raised"]}}

    def keys(joint, axis, degrees):
        return [joint.after(axis, degrees * share) for share in (0, 0.5, 1, 0.5, 0)]
    hand_joint = by_name["leftHand"]
    hand_axis = turned(hand_joint.turn, [0, 1, 0])
    clips = {"elbow": {"leftForearm": keys(forearm, elbow_axis, elbow_degrees)},
             "shoulder": {"leftUpperArm": keys(upper, front, shoulder_degrees)},
             "twist": {"leftHand": keys(hand_joint, hand_axis, twist_degrees)}}

    def relative(joint, axis, degrees):
        return [round(x, 4) for x in times(inverse(joint.rotation), joint.after(axis, degrees))]
    rig = {"drivers": [
        *[{"twist": twist, "source": "leftHand", "axis": [0, 1, 0], "share": round((i + 1) / 3, 3)} for i, twist in enumerate(twists)],
        {"corrective": ["leftForearm"], "radius": 1, "examples": [
            {"rotations": [[0, 0, 0, 1]]},
            {"rotations": [relative(forearm, elbow_axis, elbow_degrees)], "weights": {"elbow_bent": 1}}]},
        {"corrective": ["leftUpperArm"], "radius": 1, "examples": [
            {"rotations": [[0, 0, 0, 1]]},
            {"rotations": [relative(upper, front, shoulder_degrees)], "weights": {"arm_raised": 1}}]}]}
    output.write("rigged_arm", joints, mesh, clips, rig)


def make_tentacle():
    segments, around, length, count = 120, 28, 1.0, 5
    joints = []
    for i in range(count):
        joints.append(Joint("tentacle%d" % i, joints[-1] if joints else None, [0, length / (count - 1) if joints else 0, 0]))
    points, colors, weights, triangles = [], [], [], []
    for ring in range(segments + 1):
        t = ring / segments
        radius = 0.09 * (1 - 0.8 * t) * math.sqrt(1 - max(0, (t - 0.97) / 0.031) ** 2)
        for i in range(around):
            angle = 2 * math.pi * i / around
            points.append([radius * math.cos(angle), t * length * 1.03, radius * math.sin(angle)])
            isPale = math.cos(angle - 0.2) < -0.55
            isBand = ring // 4 % 2 == 0
            colors.append([232, 190, 170, 255] if isPale else [178, 84, 78, 255] if isBand else [150, 62, 66, 255])
            s = min(t * 1.03 * (count - 1), count - 1)
            of = {j: max(0, 1 - abs(max(s - 0.5, 0) - j)) for j in range(count)}
            weights.append(of)
    for ring in range(segments):
        for i in range(around):
            a, b = ring * around + i, ring * around + (i + 1) % around
            triangles += [a, a + around, b, b, a + around, b + around]
    output = Output()
    both = [bytes_of(of) for of in weights]
    primitive = {
        "attributes": {"POSITION": output.add(5126, "VEC3", points, True), "NORMAL": output.add(5126, "VEC3", normals_of(points, triangles)),
                       "COLOR_0": output.add(5121, "VEC4", colors, normalized=True), "JOINTS_0": output.add(5121, "VEC4", [j for j, _ in both]),
                       "WEIGHTS_0": output.add(5121, "VEC4", [w for _, w in both], normalized=True)},
        "indices": output.add(5123, "SCALAR", triangles), "material": 0}
    clips = {"curl": {"tentacle%d" % i: [turn([0, 0, 1], degrees * share) for share in (0, 0.5, 1, 0.5, 0)]
                      for i, degrees in ((1, 80), (2, 95), (3, 100))}}
    output.write("tentacle", joints, {"name": "tentacle", "primitives": [primitive]}, clips)


make_arm()
make_tentacle()
