#!/usr/bin/env python3
"""Writes the small scenes of this folder (pure Python and numpy): each pins a few conventions against Mitsuba.

    python3 tests/reference/make_scenes.py

lights.gltf       point, spot and directional light, emitters one- and two-sided, seen also from behind; textures that
                  repeat, mirror and clamp, moved by KHR_texture_transform; COLOR_0; a mirrored node; nested nodes
environment.gltf  a Lambert ball on a Lambert disc under environment.hdr, which has another colour in every direction
glass.gltf        a smooth faceted glass ball that tints, over a Lambert floor under a quad light
mirror.gltf       a perfect mirror ball and mirror wall in a coloured room
glossy.gltf       rough metal, plastic, half metal, a roughness texture
rough_glass.gltf  rough dielectrics that tint, one with a roughness texture
absorbing.gltf    smooth and rough glass whose body absorbs
coats.gltf        smooth coat, smooth gold, glass over an opaque part, textures of transmission and specular
normal_map.gltf   normal maps: derived and given tangents, mirrored charts and nodes, scales, both sides, grazing views
alpha.gltf        mask and blend, by factor, texture and COLOR_0, before lamps of all kinds
textures.gltf     each wrap and filter by axis, TEXCOORD_1, a lamp with a texture, slots with transforms of their own
many_lights.gltf  400 small lamps of unlike powers, one side or both
smooth.gltf       coarse meshes with smooth normals, uneven and mirroring nodes, a spot with inner angle 0, a near lamp
studio.gltf       glossy, clear and curved things for environment.hdr alone
"""

import base64
import json
import math
import struct
import zlib
from pathlib import Path

import numpy as np

HERE = Path(__file__).parent
LAMBERT = {"KHR_materials_specular": {"specularFactor": 0.0}}
REPEAT, MIRROR, CLAMP = 10497, 33648, 33071
NEAREST, LINEAR = 9728, 9729


def png(pixels):
    """PNG of (height, width, 3 or 4) bytes."""
    height, width, channels = pixels.shape
    rows = b"".join(b"\0" + pixels[y].astype("u1").tobytes() for y in range(height))
    chunk = lambda kind, body: struct.pack(">I", len(body)) + kind + body + struct.pack(">I", zlib.crc32(kind + body))
    head = struct.pack(">IIBBBBB", width, height, 8, {3: 2, 4: 6}[channels], 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", head) + chunk(b"IDAT", zlib.compress(rows, 9)) + chunk(b"IEND", b"")


class Scene:
    """A glTF tree in the making."""

    def __init__(self):
        self.data = b""
        self.tree = {"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": []}]}

    def append(self, key, entry):
        self.tree.setdefault(key, []).append(entry)
        return len(self.tree[key]) - 1

    def accessor(self, values, kind):
        values = np.asarray(values, {5126: "<f4", 5123: "<u2"}[kind])
        self.data += b"\0" * (-len(self.data) % 4)
        view = {"buffer": 0, "byteOffset": len(self.data), "byteLength": values.nbytes}
        self.data += values.tobytes()
        shape = {1: "SCALAR"}.get(values.ndim) or f"VEC{values.shape[1]}"
        entry = {"bufferView": self.append("bufferViews", view), "componentType": kind, "count": len(values), "type": shape}
        if kind == 5126 and shape == "VEC3":
            entry |= {"min": values.min(0).tolist(), "max": values.max(0).tolist()}
        return self.append("accessors", entry)

    def material(self, name, base, roughness=1.0, metallic=0.0, extensions=LAMBERT, **others):
        pbr = {"baseColorFactor": [*base, others.pop("alpha", 1.0)], "metallicFactor": metallic, "roughnessFactor": roughness}
        pbr |= others.pop("pbr", {})
        entry = {"name": name, "pbrMetallicRoughness": pbr} | others
        if extensions:
            entry["extensions"] = dict(extensions)
        return self.append("materials", entry)

    def lamp(self, name, radiance, **others):
        strength = max(radiance)
        strengths = {"KHR_materials_emissive_strength": {"emissiveStrength": strength}}
        factor = [c / strength for c in radiance]
        return self.material(name, [0.5, 0.5, 0.5], extensions=LAMBERT | strengths, emissiveFactor=factor, **others)

    def texture(self, pixels, wrap, wrap_v=None, filter=LINEAR):
        image = self.append("images", {"uri": "data:image/png;base64," + base64.b64encode(png(pixels)).decode()})
        sampler = self.append("samplers", {"magFilter": filter, "minFilter": filter, "wrapS": wrap, "wrapT": wrap_v or wrap})
        return self.append("textures", {"source": image, "sampler": sampler})

    def mesh(self, name, material, positions, triangles, uv=None, colors=None, uv1=None, normals=None, tangents=None):
        attributes = {"POSITION": self.accessor(positions, 5126)}
        others = {"NORMAL": normals, "TANGENT": tangents, "TEXCOORD_0": uv, "TEXCOORD_1": uv1, "COLOR_0": colors}
        attributes |= {key: self.accessor(values, 5126) for key, values in others.items() if values is not None}
        indices = self.accessor(np.asarray(triangles).ravel(), 5123)
        primitive = {"attributes": attributes, "indices": indices, "material": material}
        return self.append("meshes", {"name": name, "primitives": [primitive]})

    def node(self, parent=None, **entry):
        index = self.append("nodes", entry)
        if parent is None:
            self.tree["scenes"][0]["nodes"].append(index)
        else:
            self.tree["nodes"][parent].setdefault("children", []).append(index)
        return index

    def quad(self, name, material, corner, edge_u, edge_v, uv_scale=1.0, parent=None, **others):
        """Front towards edge_u x edge_v."""
        a, u, v = (np.array(x, float) for x in (corner, edge_u, edge_v))
        uv = np.array([[0, 0], [1, 0], [1, 1], [0, 1]]) * uv_scale
        mesh = self.mesh(name, material, [a, a + u, a + u + v, a + v], [[0, 1, 2], [0, 2, 3]], uv, **others)
        return self.node(parent, name=name, mesh=mesh)

    def light(self, kind, color, intensity, **node):
        spot = node.pop("spot", None)
        entry = {"type": kind, "name": kind, "color": color, "intensity": intensity}
        if spot:
            entry["spot"] = spot
        lights = self.tree.setdefault("extensions", {}).setdefault("KHR_lights_punctual", {"lights": []})["lights"]
        lights.append(entry)
        return self.node(name=kind, extensions={"KHR_lights_punctual": {"light": len(lights) - 1}}, **node)

    def camera(self, position, target):
        camera = {"type": "perspective", "perspective": {"aspectRatio": 1.0, "yfov": 1.0, "znear": 0.01}}
        node = {"rotation": looking(np.array(target, float) - position), "translation": list(position)}
        self.node(name="viewpoint", camera=self.append("cameras", camera), **node)

    def write(self, name):
        text = json.dumps(self.tree)
        known = ["KHR_lights_punctual", "KHR_texture_transform"] + [
            "KHR_materials_" + part for part in ("emissive_strength", "ior", "specular", "transmission", "volume")
        ]
        self.tree["extensionsUsed"] = [extension for extension in known if f'"{extension}"' in text]
        uri = "data:application/octet-stream;base64," + base64.b64encode(self.data).decode()
        self.tree["buffers"] = [{"byteLength": len(self.data), "uri": uri}]
        (HERE / name).write_text(json.dumps(self.tree) + "\n")


def looking(direction):
    """Quaternion that turns -Z to the direction without roll: yaw about +Y, then pitch about +X."""
    x, y, z = direction / np.linalg.norm(direction)
    yaw, pitch = math.atan2(-x, -z), math.asin(y)
    sy, cy, sp, cp = math.sin(yaw / 2), math.cos(yaw / 2), math.sin(pitch / 2), math.cos(pitch / 2)
    return [cy * sp, sy * cp, -sy * sp, cy * cp]


def ball(subdivisions):
    """Unit icosphere, faces turned outwards; no normals, so flat shading."""
    g = (1 + math.sqrt(5)) / 2
    points = [(-1, g, 0), (1, g, 0), (-1, -g, 0), (1, -g, 0), (0, -1, g), (0, 1, g), (0, -1, -g), (0, 1, -g)]
    points += [(g, 0, -1), (g, 0, 1), (-g, 0, -1), (-g, 0, 1)]
    points = [np.array(p) / np.linalg.norm(p) for p in points]
    text = "0 11 5 0 5 1 0 1 7 0 7 10 0 10 11 1 5 9 5 11 4 11 10 2 10 7 6 7 1 8 3 9 4 3 4 2 3 2 6 3 6 8 3 8 9 4 9 5 2 4 11 6 2 10 8 6 7 9 8 1"
    faces = np.array(text.split(), int).reshape(-1, 3).tolist()
    for _ in range(subdivisions):
        middles, finer = {}, []
        for a, b, c in faces:
            ends = []
            for p, q in ((a, b), (b, c), (c, a)):
                key = (min(p, q), max(p, q))
                if key not in middles:
                    middle = points[p] + points[q]
                    middles[key] = len(points)
                    points.append(middle / np.linalg.norm(middle))
                ends.append(middles[key])
            ab, bc, ca = ends
            finer += [(a, ab, ca), (b, bc, ab), (c, ca, bc), (ab, bc, ca)]
        faces = finer
    return np.array(points), faces


def box():
    """Cube from -1 to 1, faces turned outwards."""
    points = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], float)
    sides = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    return points, [t for a, b, c, d in sides for t in ((a, b, c), (a, c, d))]


def lights():
    s = Scene()
    # No two texels alike, so that a flip, a turn or a half-texel shift shows.
    ramp = np.arange(4)
    four = np.stack([40 + 60 * ramp[None, :] + 0 * ramp[:, None], 30 + 55 * ramp[:, None] + 0 * ramp[None, :], 60 + 40 * ((ramp[:, None] * 2 + ramp[None, :]) % 4)], axis=2)
    turned = {"KHR_texture_transform": {"offset": [0.2, -0.1], "rotation": 0.5, "scale": [1.5, 0.8]}}
    use = lambda wrap, **others: {"pbr": {"baseColorTexture": {"index": s.texture(four, wrap)} | others}}
    floor = s.material("floor", [1, 1, 1], **use(REPEAT))
    left = s.material("left", [0.9, 0.6, 0.8], **use(MIRROR, extensions=turned))
    back = s.material("back", [0.8, 0.8, 0.8], **use(CLAMP))
    white, tone = s.material("white", [1, 1, 1]), s.material("tone", [0.3, 0.6, 0.4])
    s.quad("floor", floor, [-2, 0, 2], [4, 0, 0], [0, 0, -4], 2.5)
    s.quad("left", left, [-2, 0, 2], [0, 0, -4], [0, 3, 0], 2.0)
    s.quad("back", back, [-2, 0, -2], [4, 0, 0], [0, 3, 0], 1.5)
    s.quad("right", white, [2, 0, -2], [0, 0, 4], [0, 3, 0], colors=[[0.9, 0.2, 0.1], [0.1, 0.8, 0.3], [0.2, 0.2, 0.9], [0.7, 0.7, 0.2]])
    # A thin lamp that shines down, one upright that shines to both sides, one that turns its dark back to the room.
    s.quad("ceiling lamp", s.lamp("ceiling lamp", [4.0, 3.0, 2.0]), [-0.5, 2.6, -1.5], [1, 0, 0], [0, 0, 0.8])
    s.quad("screen", s.lamp("screen", [0.5, 1.5, 2.5], doubleSided=True), [-1.2, 0.2, 0.2], [0.6, 0, 0.3], [0, 0.7, 0])
    s.quad("turned lamp", s.lamp("turned lamp", [3.0, 1.0, 0.5]), [1.3, 1.2, 0.4], [0, 0, -0.8], [0, 0.6, 0])
    # Nested nodes; the inner one mirrors, scales unevenly and turns.
    outer = s.node(name="outer", translation=[0.6, 0.0, -0.6], rotation=[0, math.sin(0.3), 0, math.cos(0.3)])
    s.node(outer, name="mirrored box", translation=[0, 0.6, 0], scale=[-0.4, 0.6, 0.3], mesh=s.mesh("box", tone, *box()))
    s.light("point", [1.0, 0.8, 0.6], 2.0, translation=[-1.0, 1.6, -0.8])
    s.light("directional", [0.6, 0.8, 1.0], 1.5, rotation=looking(np.array([0.4, -1.0, -0.5])))
    cone = {"innerConeAngle": 0.15, "outerConeAngle": 0.5}
    s.light("spot", [0.9, 1.0, 0.5], 12.0, translation=[1.0, 2.4, 1.5], rotation=looking(np.array([-0.3, -1.0, -0.9])), spot=cone)
    s.camera([0.3, 1.5, 4.2], [0, 1.1, 0])
    s.write("lights.gltf")


def environment():
    s = Scene()
    angle = np.linspace(0, 2 * math.pi, 25)[:-1]
    rim = np.stack([2.5 * np.cos(angle), 0 * angle, -2.5 * np.sin(angle)], axis=1)
    disc = np.concatenate([[[0, 0, 0]], rim])
    s.node(name="disc", mesh=s.mesh("disc", s.material("disc", [0.6, 0.6, 0.6]), disc, [[0, k + 1, (k + 1) % 24 + 1] for k in range(24)]))
    s.node(name="ball", mesh=s.mesh("ball", s.material("ball", [0.8, 0.8, 0.8]), *ball(2)), translation=[0, 1.0, 0])
    s.camera([0.8, 1.6, 3.5], [0, 0.8, 0])
    s.write("environment.gltf")
    # 16 x 8; mantissas with a common exponent, so that RGBE holds the values exactly. Block colours differ by octant,
    # with a bright one between +X and -Z above the horizon.
    height, width = 8, 16
    texels = np.zeros((height, width, 4), "u1")
    for row in range(height):
        for column in range(width):
            bright = row == 2 and column == 10
            texels[row, column] = [255, 240, 200, 133] if bright else [20 + 12 * column, 25 + 28 * row, 220 - 13 * column, 128]
    head = f"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y {height} +X {width}\n".encode()
    (HERE / "environment.hdr").write_bytes(head + texels.tobytes())


def room(s):
    s.quad("floor", s.material("floor", [0.7, 0.7, 0.7]), [-2, 0, 2], [4, 0, 0], [0, 0, -4])
    s.quad("left", s.material("red", [0.7, 0.2, 0.15]), [-2, 0, 2], [0, 0, -4], [0, 3, 0])
    s.quad("back", s.material("blue", [0.2, 0.3, 0.7]), [-2, 0, -2], [4, 0, 0], [0, 3, 0])
    s.quad("lamp", s.lamp("lamp", [6.0, 5.0, 4.0]), [-1, 2.8, -1], [2, 0, 0], [0, 0, 2])
    s.camera([0.4, 1.7, 4.4], [0, 0.9, 0])


def glass():
    s = Scene()
    room(s)
    clear = {"KHR_materials_transmission": {"transmissionFactor": 1.0}, "KHR_materials_ior": {"ior": 1.5}}
    clear["KHR_materials_volume"] = {"thicknessFactor": 1.0}
    material = s.material("glass", [0.9, 0.8, 0.6], roughness=0.0, extensions=clear)
    s.node(name="ball", mesh=s.mesh("ball", material, *ball(2)), translation=[0.2, 1.0, 0], scale=[0.8, 0.8, 0.8])
    s.write("glass.gltf")


def mirror():
    s = Scene()
    room(s)
    material = s.material("mirror", [1, 1, 1], roughness=0.0, metallic=1.0, extensions=None)
    s.node(name="ball", mesh=s.mesh("ball", material, *ball(2)), translation=[-0.5, 0.8, -0.3], scale=[0.7, 0.7, 0.7])
    s.quad("right", material, [2, 0, -2], [0, 0, 4], [0, 3, 0])
    s.write("mirror.gltf")


def glossy():
    s = Scene()
    room(s)
    gold = s.material("gold", [1.0, 0.76, 0.34], roughness=0.35, metallic=1.0, extensions=None)
    tinted = {"KHR_materials_specular": {"specularFactor": 0.8, "specularColorFactor": [1.0, 0.6, 0.9]}, "KHR_materials_ior": {"ior": 1.8}}
    plastic = s.material("plastic", [0.2, 0.5, 0.3], roughness=0.4, extensions=tinted)
    half = s.material("half metal", [0.6, 0.5, 0.8], roughness=0.6, metallic=0.5, extensions=None)
    for k, material in enumerate((gold, plastic, half)):
        s.node(name=f"ball {k}", mesh=s.mesh(f"ball {k}", material, *ball(2)), translation=[-1.2 + 1.2 * k, 0.6, 0.4 * k], scale=[0.55] * 3)
    # Roughness in green, metalness in blue.
    pixels = np.array([[[0, 110, 0], [0, 255, 255]], [[0, 180, 255], [0, 140, 128]]])
    maps = {"metallicRoughnessTexture": {"index": s.texture(pixels, REPEAT)}}
    s.quad("right", s.material("plates", [0.7, 0.7, 0.6], metallic=1.0, extensions=None, pbr=maps), [2, 0, -2], [0, 0, 4], [0, 3, 0], 2.0)
    s.write("glossy.gltf")


def open_room(s, height=3.0):
    """Floor, left and back walls; no lamp."""
    s.quad("floor", s.material("floor", [0.7, 0.7, 0.7]), [-2, 0, 2], [4, 0, 0], [0, 0, -4])
    s.quad("left", s.material("red", [0.7, 0.2, 0.15]), [-2, 0, 2], [0, 0, -4], [0, height, 0])
    s.quad("back", s.material("blue", [0.2, 0.3, 0.7]), [-2, 0, -2], [4, 0, 0], [0, height, 0])
    s.camera([0.4, 1.7, 4.4], [0, 0.9, 0])


def dielectric(ior, transmission=1.0, **volume):
    parts = {"KHR_materials_transmission": {"transmissionFactor": transmission}, "KHR_materials_ior": {"ior": ior}}
    return parts | {"KHR_materials_volume": {"thicknessFactor": 1.0} | volume}


def rough_glass():
    s = Scene()
    room(s)
    tinted = s.material("tinted", [0.9, 0.8, 0.6], roughness=0.4, extensions=dielectric(1.5))
    s.node(name="ball", mesh=s.mesh("ball", tinted, *ball(2)), translation=[-0.7, 0.9, 0.2], scale=[0.65] * 3)
    frosted = s.material("frosted", [1, 1, 1], roughness=0.25, extensions=dielectric(1.33))
    turn = [0, math.sin(0.2), 0, math.cos(0.2)]
    s.node(name="block", mesh=s.mesh("block", frosted, *box()), translation=[0.8, 0.75, 0.4], rotation=turn, scale=[0.4, 0.7, 0.3])
    grain = np.array([[[0, 255, 0], [0, 120, 0]], [[0, 90, 0], [0, 200, 0]]])
    maps = {"metallicRoughnessTexture": {"index": s.texture(grain, REPEAT)}}
    plate = s.material("plate", [0.8, 0.9, 1.0], roughness=0.7, extensions=dielectric(1.6), pbr=maps)
    points, faces = box()
    mesh = s.mesh("plate", plate, points, faces, points[:, :2] * 0.6)
    s.node(name="plate", mesh=mesh, translation=[0.1, 0.45, 1.3], scale=[0.35, 0.35, 0.05])
    s.write("rough_glass.gltf")


def absorbing():
    s = Scene()
    room(s)
    amber = dielectric(1.5, attenuationColor=[0.9, 0.5, 0.2], attenuationDistance=0.6)
    turn = [0, math.sin(0.25), 0, math.cos(0.25)]
    block = s.mesh("block", s.material("amber", [1, 1, 1], roughness=0.0, extensions=amber), *box())
    s.node(name="block", mesh=block, translation=[0.7, 0.7, 0.2], rotation=turn, scale=[0.6, 0.65, 0.3])
    # An insect in the amber: light is absorbed on its way there and back.
    s.node(name="insect", mesh=s.mesh("insect", s.material("insect", [0.9, 0.9, 0.9]), *ball(1)), translation=[0.75, 0.6, 0.25], scale=[0.2] * 3)
    wine = dielectric(1.4, attenuationColor=[0.8, 0.15, 0.3], attenuationDistance=1.5)
    rough = s.mesh("ball", s.material("wine", [0.8, 1.0, 1.0], roughness=0.3, extensions=wine), *ball(2))
    s.node(name="ball", mesh=rough, translation=[-0.8, 0.9, 0.0], scale=[0.7] * 3)
    s.write("absorbing.gltf")


def coats():
    s = Scene()
    room(s)
    lacquer = s.material("lacquer", [0.3, 0.5, 0.2], roughness=0.0, extensions={"KHR_materials_ior": {"ior": 1.7}})
    gold = s.material("gold", [1.0, 0.76, 0.34], roughness=0.0, metallic=1.0, extensions=None)
    milky = s.material("milky", [0.9, 0.7, 0.8], roughness=0.3, extensions=dielectric(1.5, 0.6))
    for k, material in enumerate((lacquer, gold, milky)):
        s.node(name=f"ball {k}", mesh=s.mesh(f"ball {k}", material, *ball(2)), translation=[-1.2 + 1.2 * k, 0.6, 0.4 * k], scale=[0.55] * 3)
    red = s.texture(np.array([[[255, 9, 9], [60, 9, 9]], [[0, 9, 9], [180, 9, 9]]]), REPEAT)
    window = dielectric(1.5)
    window["KHR_materials_transmission"] |= {"transmissionTexture": {"index": red}}
    points, faces = box()
    plate = s.mesh("window", s.material("window", [0.8, 0.9, 0.7], roughness=0.0, extensions=window), points, faces, points[:, :2])
    s.node(name="window", mesh=plate, translation=[0.0, 1.7, 0.3], scale=[0.5, 0.35, 0.1])
    weights = s.texture(np.array([[[9, 9, 9, 255], [9, 9, 9, 40]], [[9, 9, 9, 120], [9, 9, 9, 0]]]), REPEAT)
    colors = s.texture(np.array([[[255, 100, 20], [40, 255, 90]], [[90, 60, 255], [255, 255, 255]]]), MIRROR)
    layered = {"KHR_materials_specular": {"specularTexture": {"index": weights}, "specularColorTexture": {"index": colors}, "specularFactor": 0.9, "specularColorFactor": [1.0, 2.0, 1.5]}, "KHR_materials_ior": {"ior": 2.2}}
    s.quad("right", s.material("layered", [0.5, 0.4, 0.3], roughness=0.5, extensions=layered), [2, 0, -2], [0, 0, 4], [0, 3, 0], 2.0)
    s.write("coats.gltf")


def bumps(seed, tilt):
    """8 x 8 random normals whose x and y reach `tilt`."""
    xy = np.random.default_rng(seed).uniform(-tilt, tilt, (8, 8, 2))
    z = np.sqrt(1 - (xy**2).sum(2, keepdims=True))
    return np.round(127.5 * (np.concatenate([xy, z], axis=2) + 1))


def sheet(count, skew=0.0):
    """A wavy sheet over -1..1 in x and y that faces +Z: positions, triangles, normals, uv."""
    t = np.linspace(-1, 1, count)
    x, y = (a.ravel() for a in np.meshgrid(t, t))
    positions = np.stack([x, y, 0.15 * np.sin(3 * x) + 0.1 * np.cos(2 * y)], axis=1)
    normals = np.stack([-0.45 * np.cos(3 * x), 0.2 * np.sin(2 * y), np.ones_like(x)], axis=1)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    uv = np.stack([x + skew * y, -y + 0.3 * skew * x], axis=1)
    triangles = []
    for row in range(count - 1):
        for column in range(count - 1):
            a = row * count + column
            triangles += [(a, a + 1, a + count + 1), (a, a + count + 1, a + count)]
    return positions, triangles, normals, uv


def normal_map():
    s = Scene()
    transform = {"KHR_texture_transform": {"offset": [0.3, 0.1], "rotation": 0.7, "scale": [1.3, 0.9]}}
    bumpy = lambda seed, tilt, **others: {"normalTexture": {"index": s.texture(bumps(seed, tilt), REPEAT)} | others}
    s.quad("floor", s.material("floor", [0.7, 0.7, 0.7], **bumpy(1, 0.6, scale=1.5)), [-2, 0, 2], [4, 0, 0], [0, 0, -4], 3.0)
    left = s.material("left", [0.7, 0.5, 0.4], roughness=0.4, extensions=None, **bumpy(2, 0.4, extensions=transform))
    s.quad("left", left, [-2, 0, 2], [0, 0, -4], [0, 3, 0], 1.5)
    # Tangents of the file's own: along +v, handed so that the bitangent runs along +u.
    corners, uv = [[-2, 0, -2], [2, 0, -2], [2, 3, -2], [-2, 3, -2]], np.array([[0, 2], [2, 2], [2, 0], [0, 0]], float)
    back = s.material("back", [0.4, 0.5, 0.8], roughness=0.5, metallic=0.7, extensions=None, **bumpy(3, 0.5))
    mesh = s.mesh("back", back, corners, [[0, 1, 2], [0, 2, 3]], uv, normals=[[0, 0, 1]] * 4, tangents=[[0, 1, 0, -1]] * 4)
    s.node(name="back", mesh=mesh)
    positions, triangles, normals, uv = sheet(5, 0.4)
    derived = s.material("derived", [0.8, 0.8, 0.5], **bumpy(4, 0.5, scale=-0.8))
    wavy = s.mesh("wavy", derived, positions, triangles, uv, normals=normals)
    s.node(name="wavy", mesh=wavy, translation=[-1.0, 1.0, 0.0], rotation=[0, math.sin(0.3), 0, math.cos(0.3)], scale=[0.6, 0.5, 0.6])
    mirrored_uv = uv * [-1, 1]
    shiny = s.material("shiny", [0.9, 0.6, 0.5], roughness=0.45, metallic=1.0, extensions=None, **bumpy(5, 0.4))
    wavy = s.mesh("mirrored", shiny, positions, triangles, mirrored_uv, normals=normals)
    s.node(name="mirrored chart", mesh=wavy, translation=[0.3, 0.7, 0.5], scale=[0.5, 0.5, 0.5])
    s.node(name="mirrored node", mesh=wavy, translation=[1.3, 1.0, 0.2], rotation=[0, math.sin(-0.3), 0, math.cos(-0.3)], scale=[-0.5, 0.7, 0.4])
    # Seen from behind.
    s.node(name="turned", mesh=wavy, translation=[0.2, 2.1, -0.6], rotation=[0, 1, 0, 0], scale=[0.5, 0.4, 0.5])
    s.quad("lamp", s.lamp("lamp", [5.0, 4.5, 4.0]), [1.2, 2.8, 0.2], [0.8, 0, 0], [0, 0, 0.8])
    s.light("directional", [1.0, 0.9, 0.8], 1.2, rotation=looking(np.array([-1.0, -0.35, -0.2])))
    s.camera([0.4, 1.5, 4.4], [0, 1.0, 0])
    s.write("normal_map.gltf")


def alpha():
    s = Scene()
    open_room(s)
    steps = np.random.default_rng(7).integers(20, 236, (6, 6, 4))
    masked = {"alphaMode": "MASK", "alphaCutoff": 0.45, "pbr": {"baseColorTexture": {"index": s.texture(steps, MIRROR)}}}
    s.quad("fence", s.material("fence", [0.9, 0.9, 0.9], **masked), [-1.6, 0.05, 0.6], [1.4, 0, 0.3], [0, 1.3, 0], 1.3)
    nearest = {"alphaMode": "MASK", "alphaCutoff": 0.5, "pbr": {"baseColorTexture": {"index": s.texture(steps, REPEAT, filter=NEAREST)}}}
    ball_points, faces = ball(1)
    coarse = s.mesh("cage", s.material("cage", [0.5, 0.8, 0.9], alpha=0.9, **nearest), ball_points, faces, ball_points[:, :2])
    s.node(name="cage", mesh=coarse, translation=[0.9, 0.5, -0.8], scale=[0.45] * 3)
    veil = {"alphaMode": "BLEND", "pbr": {"baseColorTexture": {"index": s.texture(steps, CLAMP)}}}
    fade = [[1, 1, 1, 1], [1, 0.5, 0.5, 0.3], [0.6, 1, 1, 0.0], [1, 1, 0.2, 0.8]]
    s.quad("veil", s.material("veil", [0.9, 0.8, 0.9], alpha=0.8, **veil), [0.1, 0.1, 0.5], [1.5, 0, -0.2], [0, 1.6, 0], colors=fade)
    film = s.material("film", [0.9, 0.8, 0.6], roughness=0.4, metallic=1.0, extensions=None, alpha=0.5, alphaMode="BLEND")
    s.quad("film", film, [-1.5, 1.5, -1.6], [1.6, 0, 0.3], [0, 1.0, 0.4])
    s.quad("shade", s.material("shade", [0.8, 0.9, 0.3], alpha=0.4, alphaMode="BLEND"), [-1.0, 2.2, -0.8], [2.0, 0, 0], [0, 0, 1.8])
    s.quad("lamp", s.lamp("lamp", [6.0, 5.0, 4.0]), [-0.8, 2.8, -0.6], [1.6, 0, 0], [0, 0, 1.2])
    s.light("point", [0.7, 0.9, 1.0], 2.0, translation=[0.3, 1.2, 1.6])
    s.light("directional", [1.0, 0.8, 0.6], 0.8, rotation=looking(np.array([0.5, -1.0, -0.7])))
    s.write("alpha.gltf")


def textures():
    s = Scene()
    values = np.random.default_rng(11).integers(10, 250, (5, 3, 3))
    moved = {"KHR_texture_transform": {"offset": [0.4, -0.3], "rotation": -0.9, "scale": [0.7, 1.6]}}
    use = lambda *sampler, **others: {"pbr": {"baseColorTexture": {"index": s.texture(values, *sampler[:2], filter=sampler[2])} | others}}
    s.quad("floor", s.material("floor", [0.9, 1.0, 0.8], **use(REPEAT, CLAMP, LINEAR)), [-2, 0, 2], [4, 0, 0], [0, 0, -4], 2.0)
    s.quad("left", s.material("left", [1, 1, 1], **use(CLAMP, MIRROR, NEAREST, extensions=moved)), [-2, 0, 2], [0, 0, -4], [0, 3, 0], 2.5)
    s.quad("back", s.material("back", [1, 1, 1], **use(MIRROR, REPEAT, LINEAR)), [-2, 0, -2], [4, 0, 0], [0, 3, 0], -1.7)
    # Each slot its own coordinates: base from set 1, roughness moved, the normal map from set 1 by the extension.
    rough = np.random.default_rng(12).integers(110, 255, (3, 4, 3))
    slots = {"metallicRoughnessTexture": {"index": s.texture(rough, MIRROR, filter=NEAREST), "extensions": moved}}
    slots |= {"baseColorTexture": {"index": s.texture(values, REPEAT), "texCoord": 1}}
    by_extension = {"KHR_texture_transform": {"texCoord": 1, "scale": [0.5, 2.0]}}
    relief = {"index": s.texture(bumps(13, 0.4), MIRROR), "extensions": by_extension, "scale": 0.7}
    mixed = s.material("mixed", [0.9, 0.9, 0.9], roughness=0.8, metallic=0.9, extensions=None, pbr=slots, normalTexture=relief)
    positions, triangles, normals, uv = sheet(4)
    mesh = s.mesh("mixed", mixed, positions, triangles, uv, uv1=uv @ [[0.6, 0.8], [-0.9, 0.5]] + 0.2, normals=normals)
    s.node(name="mixed", mesh=mesh, translation=[-0.6, 1.1, 0.0], rotation=[0, math.sin(0.2), 0, math.cos(0.2)], scale=[0.9, 0.9, 0.9])
    tinted = [[0.9, 0.2, 0.1], [0.1, 0.8, 0.3], [0.2, 0.2, 0.9], [0.7, 0.7, 0.2]]
    s.quad("colored", s.material("colored", [0.9, 0.8, 1.0], roughness=0.5, extensions=None, **use(REPEAT, REPEAT, NEAREST)), [0.5, 0.2, 0.6], [1.2, 0, -0.4], [0, 1.2, 0], colors=tinted)
    glow = np.random.default_rng(14).integers(0, 255, (4, 4, 3))
    shown = {"emissiveTexture": {"index": s.texture(glow, CLAMP, MIRROR), "extensions": moved}}
    s.quad("screen", s.lamp("screen", [9.0, 8.0, 10.0], **shown), [2, 0.6, -1.5], [0, 0, 2.2], [0, 1.8, 0], 1.6)
    pixels = {"emissiveTexture": {"index": s.texture(glow, REPEAT, filter=NEAREST), "texCoord": 0}, "doubleSided": True}
    s.quad("panel", s.lamp("panel", [4.0, 6.0, 5.0], **pixels), [-0.9, 2.5, -0.9], [1.4, 0.2, 0], [0, 0.1, 1.2], 2.0)
    s.camera([0.2, 1.5, 4.3], [0, 1.1, 0])
    s.write("textures.gltf")


def many_lights():
    s = Scene()
    open_room(s)
    random = np.random.default_rng(21)
    for group in range(20):
        # Powers over three decades; a third of the lamps shines to both sides. No brighter, since lamps of less than a
        # pixel are seen by few samples.
        radiance = 10 ** random.uniform(-0.5, 1.2) * random.uniform(0.2, 1.0, 3)
        centers = random.uniform([-1.8, 0.1, -1.8], [1.8, 2.9, 1.5], (20, 3))
        corners = centers[:, None] + random.normal(0, 0.03 + 0.05 * random.random(), (20, 3, 3))
        material = s.lamp(f"lamps {group}", list(radiance), doubleSided=group % 3 == 0)
        s.node(name=f"lamps {group}", mesh=s.mesh(f"lamps {group}", material, corners.reshape(-1, 3), np.arange(60).reshape(-1, 3)))
    s.write("many_lights.gltf")


def smooth():
    s = Scene()
    open_room(s)
    points, faces = ball(1)
    chalk = s.material("chalk", [0.8, 0.8, 0.8])
    metal = s.material("metal", [0.9, 0.7, 0.5], roughness=0.4, metallic=1.0, extensions=None)
    clear = s.material("clear", [1, 1, 1], roughness=0.0, extensions=dielectric(1.5))
    frosted = s.material("frosted", [0.9, 1, 0.9], roughness=0.4, extensions=dielectric(1.4))
    turn = [math.sin(0.4) * 0.6, 0, math.sin(0.4) * 0.8, math.cos(0.4)]
    places = [(chalk, [-1.2, 0.6, 0.3], [0.5, 0.5, 0.5]), (metal, [0.0, 0.55, 0.8], [0.4, -0.5, 0.3])]
    places += [(chalk, [1.2, 0.7, -0.2], [-0.6, 0.35, 0.5]), (clear, [-0.3, 1.7, -0.5], [0.5, 0.4, 0.5]), (frosted, [1.0, 1.8, -0.4], [0.4, 0.5, -0.3])]
    for k, (material, place, scale) in enumerate(places):
        mesh = s.mesh(f"ball {k}", material, points, faces, normals=points)
        s.node(name=f"ball {k}", mesh=mesh, translation=place, rotation=turn, scale=scale)
    # The same normals against the winding: the winding decides.
    inside_out = s.mesh("inside out", chalk, points, faces, normals=-points)
    s.node(name="inside out", mesh=inside_out, translation=[0.9, 0.3, 1.4], scale=[0.25, 0.25, 0.25])
    cone = {"outerConeAngle": 0.6}
    s.light("spot", [1.0, 0.9, 0.7], 14.0, translation=[1.8, 2.6, 1.8], rotation=looking(np.array([-1.4, -1.6, -1.6])), spot=cone)
    s.light("point", [0.5, 0.8, 1.0], 0.06, translation=[-1.9, 0.9, -0.5])
    s.light("directional", [1.0, 0.7, 0.5], 0.5, rotation=looking(np.array([-1.0, -0.12, -0.3])))
    s.quad("lamp", s.lamp("lamp", [5.0, 5.0, 5.0]), [-0.5, 2.8, 0.2], [1, 0, 0], [0, 0, 1])
    # A mirroring node turns the side that shines: this one lights the left wall, not the camera's side.
    node = s.node(name="mirror", translation=[-1.4, 1.9, 0.2], scale=[-1.0, 1.3, 0.8])
    s.quad("mirrored lamp", s.lamp("mirrored lamp", [4.0, 3.0, 6.0]), [0, 0, 0], [0, 0, -0.4], [0.1, 0.3, 0], parent=node)
    s.write("smooth.gltf")


def studio():
    s = Scene()
    angle = np.linspace(0, 2 * math.pi, 25)[:-1]
    disc = np.concatenate([[[0, 0, 0]], np.stack([2.5 * np.cos(angle), 0 * angle, -2.5 * np.sin(angle)], axis=1)])
    plate = s.material("plate", [0.5, 0.5, 0.5], roughness=0.5, extensions=None)
    s.node(name="disc", mesh=s.mesh("disc", plate, disc, [[0, k + 1, (k + 1) % 24 + 1] for k in range(24)]))
    points, faces = ball(1)
    gold = s.material("gold", [1.0, 0.76, 0.34], roughness=0.3, metallic=1.0, extensions=None)
    green = s.material("green", [1, 1, 1], roughness=0.0, extensions=dielectric(1.5, attenuationColor=[0.3, 0.9, 0.5], attenuationDistance=1.0))
    film = s.material("film", [0.9, 0.5, 0.4], alpha=0.6, alphaMode="BLEND")
    for k, material in enumerate((gold, green, film)):
        mesh = s.mesh(f"ball {k}", material, points, faces, normals=points)
        s.node(name=f"ball {k}", mesh=mesh, translation=[-1.3 + 1.3 * k, 0.75, -0.2 * k], scale=[0.6, 0.7, 0.6])
    s.camera([0.8, 1.6, 3.5], [0, 0.7, 0])
    s.write("studio.gltf")


if __name__ == "__main__":
    makers = [lights, environment, glass, mirror, glossy, rough_glass, absorbing, coats, normal_map, alpha, textures]
    for make in [*makers, many_lights, smooth, studio]:
        make()
