#!/usr/bin/env python3
"""Writes the small scenes of this folder (pure Python and numpy): each pins a few conventions against Mitsuba.

    python3 tests/reference/make_scenes.py

lights.gltf       point, spot and directional light, emitters one- and two-sided, seen also from behind; textures that
                  repeat, mirror and clamp, moved by KHR_texture_transform; COLOR_0; a mirrored node; nested nodes
environment.gltf  a Lambert ball on a Lambert disc under environment.hdr, which has another colour in every direction
glass.gltf        a smooth faceted glass ball that tints, over a Lambert floor under a quad light
mirror.gltf       a perfect mirror ball and mirror wall in a coloured room
glossy.gltf       rough metal, plastic, half metal, a roughness texture
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


def png(pixels):
    """PNG of (height, width, 3) bytes."""
    height, width, _ = pixels.shape
    rows = b"".join(b"\0" + pixels[y].astype("u1").tobytes() for y in range(height))
    chunk = lambda kind, body: struct.pack(">I", len(body)) + kind + body + struct.pack(">I", zlib.crc32(kind + body))
    head = struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)
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
        pbr = {"baseColorFactor": [*base, 1.0], "metallicFactor": metallic, "roughnessFactor": roughness}
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

    def texture(self, pixels, wrap):
        image = self.append("images", {"uri": "data:image/png;base64," + base64.b64encode(png(pixels)).decode()})
        sampler = self.append("samplers", {"magFilter": 9729, "minFilter": 9729, "wrapS": wrap, "wrapT": wrap})
        return self.append("textures", {"source": image, "sampler": sampler})

    def mesh(self, name, material, positions, triangles, uv=None, colors=None):
        attributes = {"POSITION": self.accessor(positions, 5126)}
        if uv is not None:
            attributes["TEXCOORD_0"] = self.accessor(uv, 5126)
        if colors is not None:
            attributes["COLOR_0"] = self.accessor(colors, 5126)
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


if __name__ == "__main__":
    for make in (lights, environment, glass, mirror, glossy):
        make()
