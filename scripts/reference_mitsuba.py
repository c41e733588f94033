#!/usr/bin/env python3
"""Renders a glTF scene with Mitsuba 3, as an independent judge of stereolux's path tracer.

Setting up (Debian 12):
    python3 -m venv VENV && VENV/bin/pip install mitsuba==3.9.1
    apt-get install libllvm19        # or DRJIT_LIBLLVM_PATH=/path/to/libLLVM.so

Using:
    VENV/bin/python scripts/reference_mitsuba.py --scene assets/cornell.glb --size 64x64 \\
        --fov "-19.65 19.65 19.65 -19.65" --max-depth 12 --spp 1024 --seeds 16 --out tests/reference/cornell

writes NAME_mean.exr, NAME_se.exr (standard error of the mean of each pixel and channel, from the spread of the seeds'
images) and NAME.json (the command, versions, the scene's hash, what was modelled).
tests/reference/render_all.sh holds the commands of the references that are kept.

Nothing is shared with the Rust program: this file reads glTF by itself, generates the camera's rays by itself, and
leaves intersection, light sampling, path construction and the Lambert, mirror and smooth glass models to Mitsuba. The
GGX layer of glTF has no counterpart in Mitsuba (its own BSDFs mask without height correlation, and mix otherwise), so
`GltfBsdf` below writes glTF 2.0 appendix B down a second time, to be sampled by Mitsuba's own GGX distribution.
What cannot be told truly is refused with a message, never approximated in silence.

Conventions where Mitsuba's differ and what is done about it:
- cameras: rays are made here, tangents linear in pixel position, box filter, so that angles may be asymmetric and
  pixels oblong (Mitsuba's `perspective` knows square pixels only);
- `diffuse` reflects on the front only: wrapped in `twosided`;
- `area` emits on the front only: a doubleSided emitter is given a second, turned copy a hair behind it;
- `spot` falls off linearly in angle: a sum of such ramps interpolates glTF's smooth falloff (SPOT_RAMPS pieces);
- `envmap` puts -Z at column 0 and row centres on the poles: the map is turned by half a turn, rows are added;
- KHR_materials_transmission is solid glass with or without KHR_materials_volume.
"""

import argparse
import base64
import hashlib
import json
import math
import os
import shlex
import struct
import sys
import tempfile
import time
from pathlib import Path
from urllib.parse import unquote

import numpy as np

SPOT_RAMPS = 24
RAYS_PER_LAUNCH = 1 << 20
COMPONENT_TYPES = {5120: "i1", 5121: "u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
COMPONENTS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}
WRAPS = {10497: "repeat", 33648: "mirror", 33071: "clamp"}
SUPPORTED_EXTENSIONS = {
    "KHR_lights_punctual",
    "KHR_materials_emissive_strength",
    "KHR_materials_ior",
    "KHR_materials_specular",
    "KHR_materials_transmission",
    "KHR_materials_volume",
    "KHR_texture_transform",
}


class Refused(Exception):
    """The scene holds what this script does not model truly."""


# ---------------------------------------------------------------------------------------------------------------- glTF


class Gltf:
    """A .gltf or .glb file: the JSON tree and its binary chunks."""

    def __init__(self, path):
        self.path = Path(path)
        data = self.path.read_bytes()
        self.sha256 = hashlib.sha256(data).hexdigest()
        self.chunk = b""
        if data[:4] == b"glTF":
            _, version, _ = struct.unpack_from("<4sII", data, 0)
            if version != 2:
                raise Refused(f"{path}: glTF version {version}")
            at = 12
            while at < len(data):
                size, kind = struct.unpack_from("<II", data, at)
                body = data[at + 8 : at + 8 + size]
                if kind == 0x4E4F534A:
                    text = body
                elif kind == 0x004E4942:
                    self.chunk = body
                at += 8 + size
        else:
            text = data
        self.tree = json.loads(text)
        for name in self.tree.get("extensionsUsed", []):
            if name not in SUPPORTED_EXTENSIONS:
                raise Refused(f"{path}: extension {name}")
        self.buffers = [self._buffer(entry) for entry in self.tree.get("buffers", [])]

    def _buffer(self, entry):
        return self._uri(entry["uri"]) if "uri" in entry else self.chunk

    def _uri(self, uri):
        if uri.startswith("data:"):
            return base64.b64decode(uri.partition("base64,")[2])
        return (self.path.parent / unquote(uri)).read_bytes()

    def view(self, index):
        entry = self.tree["bufferViews"][index]
        start = entry.get("byteOffset", 0)
        return self.buffers[entry["buffer"]][start : start + entry["byteLength"]]

    def accessor(self, index):
        entry = self.tree["accessors"][index]
        if "sparse" in entry:
            raise Refused(f"{self.path}: sparse accessor {index}")
        kind = np.dtype(COMPONENT_TYPES[entry["componentType"]])
        width, count = COMPONENTS[entry["type"]], entry["count"]
        stride = self.tree["bufferViews"][entry["bufferView"]].get("byteStride") or kind.itemsize * width
        raw = self.view(entry["bufferView"])[entry.get("byteOffset", 0) :]
        values = np.ndarray((count, width), kind, raw, 0, (stride, kind.itemsize)).copy()
        if entry.get("normalized"):
            values = np.maximum(values.astype("f8") / np.iinfo(kind).max, -1.0)
        return values

    def image(self, index):
        """Decoded 8-bit pixels, (height, width, 3), values 0 to 1 as stored, row 0 first. Alpha is dropped."""
        entry = self.tree["images"][index]
        data = self._uri(entry["uri"]) if "uri" in entry else self.view(entry["bufferView"])
        stream = mi.MemoryStream(len(data))
        stream.write(data)
        stream.seek(0)
        bitmap = mi.Bitmap(stream)
        pixels = np.array(bitmap, copy=True)
        if pixels.dtype != np.uint8:
            raise Refused(f"{self.path}: image {index} has {pixels.dtype} samples")
        pixels = pixels.reshape(pixels.shape[0], pixels.shape[1], -1)
        if pixels.shape[2] in (1, 2):
            pixels = np.repeat(pixels[:, :, :1], 3, axis=2)
        return pixels[:, :, :3].astype("f8") / 255.0

    def nodes(self):
        """Yields (node, world_from_node 4x4) of the default scene."""
        scene = self.tree["scenes"][self.tree.get("scene", 0)]
        stack = [(index, np.eye(4)) for index in reversed(scene.get("nodes", []))]
        while stack:
            index, world_from_parent = stack.pop()
            node = self.tree["nodes"][index]
            world_from_node = world_from_parent @ node_matrix(node)
            yield node, world_from_node
            stack += [(child, world_from_node) for child in node.get("children", [])]


def rotation_matrix(x, y, z, w):
    """Rotation of a quaternion, 3x3."""
    x, y, z, w = np.array([x, y, z, w], "f8") / math.sqrt(x * x + y * y + z * z + w * w)
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )


def node_matrix(node):
    if "matrix" in node:
        return np.array(node["matrix"], "f8").reshape(4, 4).T
    matrix = np.eye(4)
    matrix[:3, :3] = rotation_matrix(*node.get("rotation", [0, 0, 0, 1])) * np.array(node.get("scale", [1, 1, 1]))
    matrix[:3, 3] = node.get("translation", [0, 0, 0])
    return matrix


def srgb_to_linear(values):
    return np.where(values <= 0.04045, values / 12.92, ((values + 0.055) / 1.055) ** 2.4)


# ----------------------------------------------------------------------------------------------------------- materials


def texture_transform(info):
    """2x3 matrix of KHR_texture_transform: translation times rotation times scale."""
    entry = info.get("extensions", {}).get("KHR_texture_transform", {})
    c, s = math.cos(entry.get("rotation", 0.0)), math.sin(entry.get("rotation", 0.0))
    sx, sy = entry.get("scale", [1, 1])
    ox, oy = entry.get("offset", [0, 0])
    return ((c * sx, s * sy, ox), (-s * sx, c * sy, oy)), entry.get("texCoord", info.get("texCoord", 0))


class Material:
    """One glTF material as Mitsuba dictionaries. All its textures must share one coordinate set and transform."""

    def __init__(self, gltf, index):
        tree = gltf.tree["materials"][index] if index is not None else {}
        self.gltf, self.name = gltf, tree.get("name", f"material {index}")
        self.uv = None
        extensions = tree.get("extensions", {})
        pbr = tree.get("pbrMetallicRoughness", {})
        self.double_sided = tree.get("doubleSided", False)
        if tree.get("alphaMode", "OPAQUE") != "OPAQUE":
            self.refuse("alphaMode " + tree["alphaMode"])
        if "normalTexture" in tree:
            self.refuse("normalTexture")
        base = pbr.get("baseColorFactor", [1, 1, 1, 1])[:3]
        metallic, roughness = pbr.get("metallicFactor", 1.0), pbr.get("roughnessFactor", 1.0)
        specular = extensions.get("KHR_materials_specular", {})
        transmission = extensions.get("KHR_materials_transmission", {})
        volume = extensions.get("KHR_materials_volume", {})
        ior = extensions.get("KHR_materials_ior", {}).get("ior", 1.5)
        if "specularTexture" in specular or "specularColorTexture" in specular or "transmissionTexture" in transmission:
            self.refuse("a specular or transmission texture")
        weight = specular.get("specularFactor", 1.0)

        factor = transmission.get("transmissionFactor", 0.0)
        self.uses_vertex_colors = False
        self.base_factor = base
        self.base = self.texture(pbr.get("baseColorTexture"), base, srgb=True)
        if factor > 0.0:
            if factor < 1.0 or metallic > 0.0 or roughness * roughness >= 1e-3 or "baseColorTexture" in pbr:
                self.refuse("glass that is rough, partly metallic, partly opaque or textured")
            if math.isfinite(volume.get("attenuationDistance", math.inf)):
                self.refuse("a volume that absorbs")
            self.model = "smooth glass: Mitsuba dielectric"
            self.bsdf = {
                "type": "dielectric",
                "int_ior": float(ior),
                "ext_ior": 1.0,
                "specular_transmittance": self.base,
            }
        elif metallic == 0.0 and weight == 0.0:
            self.model = "Lambert: Mitsuba diffuse"
            self.bsdf = {"type": "twosided", "bsdf": {"type": "diffuse", "reflectance": self.base}}
        elif metallic == 1.0 and roughness == 0.0 and base == [1, 1, 1] and "baseColorTexture" not in pbr:
            self.model = "perfect mirror: Mitsuba conductor"
            mirror = {"type": "conductor", "material": "none", "specular_reflectance": rgb([1, 1, 1])}
            self.bsdf = {"type": "twosided", "bsdf": mirror}
        else:
            if roughness * roughness < 1e-3:
                self.refuse("a smooth metal other than a white mirror, or a smooth coat")
            self.model = "glTF appendix B: own formulas, sampled by Mitsuba"
            self.bsdf = {
                "type": "gltf",
                "base": self.base,
                "metallic_roughness": self.texture(
                    pbr.get("metallicRoughnessTexture"), [0.0, roughness, metallic], srgb=False
                ),
                "ior": float(ior),
                "specular": float(weight),
                "specular_color": mi.ScalarColor3f(specular.get("specularColorFactor", [1, 1, 1])),
            }
        strength = extensions.get("KHR_materials_emissive_strength", {}).get("emissiveStrength", 1.0)
        emission = [strength * c for c in tree.get("emissiveFactor", [0, 0, 0])]
        self.emitter = None
        if max(emission) > 0.0:
            self.emitter = {
                "type": "area",
                "radiance": self.texture(tree.get("emissiveTexture"), emission, srgb=True),
            }

    def refuse(self, what):
        raise Refused(f"material '{self.name}': {what}")

    def texture(self, info, factor, srgb):
        if info is None:
            return rgb(factor)
        uv = texture_transform(info)
        if self.uv not in (None, uv):
            self.refuse("textures with different coordinates")
        self.uv = uv
        entry = self.gltf.tree["textures"][info["index"]]
        sampler = self.gltf.tree["samplers"][entry["sampler"]] if "sampler" in entry else {}
        wraps = {WRAPS[sampler.get(key, 10497)] for key in ("wrapS", "wrapT")}
        if len(wraps) > 1:
            self.refuse("a texture that wraps differently in u and v")
        pixels = self.gltf.image(entry["source"])
        pixels = (srgb_to_linear(pixels) if srgb else pixels) * np.array(factor)
        return {
            "type": "bitmap",
            "data": mi.TensorXf(np.ascontiguousarray(pixels, "f4")),
            "raw": True,
            "filter_type": "nearest" if sampler.get("magFilter") == 9728 else "bilinear",
            "wrap_mode": wraps.pop(),
        }

    def with_vertex_colors(self):
        """The BSDF of a primitive that has COLOR_0, which multiplies the base colour."""
        if self.base["type"] != "rgb" or self.base_factor != [1, 1, 1] or "bsdf" not in self.bsdf:
            self.refuse("COLOR_0 together with a base colour, or on other than a Lambert surface")
        colors = {"type": "mesh_attribute", "name": "vertex_color"}
        return {"type": "twosided", "bsdf": {"type": "diffuse", "reflectance": colors}}


def rgb(values):
    return {"type": "rgb", "value": [float(v) for v in values]}


def define_gltf_bsdf():
    """Registers `GltfBsdf`; only here, since its base class exists once a variant is set."""

    class GltfBsdf(mi.BSDF):
        """glTF 2.0 appendix B and KHR_materials_specular: Lambert under a GGX layer, mixed by F(v.h), or a metal.

        Sampled half by the cosine, half by the visible normals of Mitsuba's GGX distribution.
        """

        def __init__(self, props):
            mi.BSDF.__init__(self, props)
            self.base = props.get_texture("base")
            self.metallic_roughness = props.get_texture("metallic_roughness")
            self.weight = props["specular"]
            tint = [float(c) for c in props["specular_color"]]
            f0 = ((props["ior"] - 1.0) / (props["ior"] + 1.0)) ** 2
            self.f0 = [min(f0 * c, 1.0) for c in tint]
            sides = mi.BSDFFlags.FrontSide | mi.BSDFFlags.BackSide
            self.m_components = [mi.BSDFFlags.DiffuseReflection | mi.BSDFFlags.GlossyReflection | sides]
            self.m_flags = self.m_components[0]

        def layer(self, si, active):
            mr = self.metallic_roughness.eval(si, active)
            alpha = dr.square(mr[1])
            return self.base.eval(si, active), mr[2], alpha, mi.MicrofacetDistribution(mi.MicrofacetType.GGX, alpha)

        def eval_pdf(self, ctx, si, wo, active=True):
            wi, wo = mi.Vector3f(si.wi), mi.Vector3f(wo)
            turn = dr.sign(wi.z)
            wi, wo = mi.Vector3f(wi.x, wi.y, wi.z * turn), mi.Vector3f(wo.x, wo.y, wo.z * turn)
            active = mi.Bool(active) & (wi.z > 0) & (wo.z > 0)
            base, metallic, alpha, normals = self.layer(si, active)
            h = dr.normalize(wi + wo)
            cos_i, cos_o, a2 = wi.z, wo.z, dr.square(alpha)
            # D and V of appendix B.3.2.
            d = a2 / (dr.pi * dr.square(dr.square(h.z) * (a2 - 1) + 1))
            v = 0.5 / (
                cos_o * dr.sqrt(a2 + (1 - a2) * dr.square(cos_i)) + cos_i * dr.sqrt(a2 + (1 - a2) * dr.square(cos_o))
            )
            s5 = (1 - dr.abs(dr.dot(wi, h))) ** 5
            f0 = mi.Color3f(self.f0)
            fresnel = f0 + (1 - f0) * s5
            dielectric = (1 - self.weight * dr.max(fresnel)) * base * dr.inv_pi + self.weight * fresnel * (d * v)
            metal = (base + (1 - base) * s5) * (d * v)
            value = dr.lerp(dielectric, metal, metallic) * cos_o
            pdf_layer = normals.pdf(wi, h) / (4 * dr.dot(wo, h))
            pdf = 0.5 * cos_o * dr.inv_pi + 0.5 * pdf_layer
            return dr.select(active, value, 0), dr.select(active, pdf, 0)

        def eval(self, ctx, si, wo, active=True):
            return self.eval_pdf(ctx, si, wo, active)[0]

        def pdf(self, ctx, si, wo, active=True):
            return self.eval_pdf(ctx, si, wo, active)[1]

        def sample(self, ctx, si, sample1, sample2, active=True):
            turn = dr.sign(si.wi.z)
            wi = mi.Vector3f(si.wi.x, si.wi.y, si.wi.z * turn)
            _, _, _, normals = self.layer(si, active)
            h, _ = normals.sample(wi, sample2)
            wo = dr.select(sample1 < 0.5, mi.warp.square_to_cosine_hemisphere(sample2), mi.reflect(wi, h))
            wo = mi.Vector3f(wo.x, wo.y, wo.z * turn)
            value, pdf = self.eval_pdf(ctx, si, wo, active)
            bs = dr.zeros(mi.BSDFSample3f)
            bs.wo, bs.pdf, bs.eta = wo, pdf, 1.0
            bs.sampled_type = mi.UInt32(+self.m_components[0])
            bs.sampled_component = mi.UInt32(0)
            ok = mi.Bool(active) & (pdf > 0)
            return bs, dr.select(ok, value / pdf, 0)

        def traverse(self, callback):
            pass

        def to_string(self):
            return "GltfBsdf[]"

    mi.register_bsdf("gltf", GltfBsdf)


# --------------------------------------------------------------------------------------------------------------- scene


def write_ply(path, positions, triangles, normals=None, uv=None, colors=None):
    columns = [(name, positions[:, k]) for k, name in enumerate("xyz")]
    if normals is not None:
        columns += [("n" + name, normals[:, k]) for k, name in enumerate("xyz")]
    if uv is not None:
        columns += [("u", uv[:, 0]), ("v", uv[:, 1])]
    if colors is not None:
        columns += [(name, colors[:, k]) for k, name in enumerate("rgb")]
    header = ["ply", "format binary_little_endian 1.0", f"element vertex {len(positions)}"]
    header += [f"property float {name}" for name, _ in columns]
    header += [f"element face {len(triangles)}", "property list uchar int vertex_indices", "end_header", ""]
    faces = np.empty(len(triangles), np.dtype([("n", "u1"), ("v", "<i4", 3)]))
    faces["n"], faces["v"] = 3, triangles
    vertices = np.stack([column for _, column in columns], axis=1).astype("<f4")
    Path(path).write_bytes("\n".join(header).encode() + vertices.tobytes() + faces.tobytes())


class Builder:
    """Gathers Mitsuba dictionaries: every primitive flattened to world space, lights, environment."""

    def __init__(self, gltf, folder):
        self.gltf, self.folder = gltf, Path(folder)
        self.entries, self.models, self.materials = {}, {}, {}
        self.camera = None
        self.triangles = 0
        for node, world_from_node in gltf.nodes():
            if "skin" in node:
                raise Refused("skins")
            if "mesh" in node:
                for primitive in gltf.tree["meshes"][node["mesh"]]["primitives"]:
                    self.primitive(primitive, world_from_node)
            light = node.get("extensions", {}).get("KHR_lights_punctual", {}).get("light")
            if light is not None:
                lights = gltf.tree["extensions"]["KHR_lights_punctual"]["lights"]
                self.light(lights[light], world_from_node)
            if "camera" in node and self.camera is None:
                self.camera = world_from_node

    def add(self, entry):
        self.entries[f"entry_{len(self.entries):05}"] = entry

    def primitive(self, primitive, world_from_node):
        gltf, attributes = self.gltf, primitive["attributes"]
        if primitive.get("mode", 4) != 4 or primitive.get("targets"):
            raise Refused("primitives other than plain triangles")
        key = primitive.get("material")
        if key not in self.materials:
            self.materials[key] = Material(gltf, key)
        material = self.materials[key]
        positions = gltf.accessor(attributes["POSITION"]).astype("f8")
        linear = world_from_node[:3, :3]
        positions = positions @ linear.T + world_from_node[:3, 3]
        count = len(positions)
        indices = gltf.accessor(primitive["indices"])[:, 0] if "indices" in primitive else np.arange(count)
        triangles = indices.astype("i8").reshape(-1, 3)
        if np.linalg.det(linear) < 0.0:
            triangles = triangles[:, ::-1]  # glTF: a mirroring transform turns the winding.
        corners = positions[triangles]
        area = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        triangles, area = triangles[(area**2).sum(1) > 0], area[(area**2).sum(1) > 0]
        normals = None
        if "NORMAL" in attributes:
            normals = gltf.accessor(attributes["NORMAL"]).astype("f8") @ np.linalg.inv(linear)
            normals /= np.linalg.norm(normals, axis=1, keepdims=True)
            across = area / np.linalg.norm(area, axis=1, keepdims=True)
            cosines = (normals[triangles] * across[:, None]).sum(2)
            if (np.abs(cosines) > 1 - 1e-5).all():
                normals = None
        uv = None
        if material.uv is not None:
            matrix, uv_set = material.uv
            uv = gltf.accessor(attributes[f"TEXCOORD_{uv_set}"]).astype("f8")
            uv = np.concatenate([uv, np.ones((len(uv), 1))], axis=1) @ np.array(matrix).T
        bsdf, colors = material.bsdf, None
        if "COLOR_0" in attributes:
            colors, bsdf = gltf.accessor(attributes["COLOR_0"]), material.with_vertex_colors()
        self.models[material.name] = material.model
        self.triangles += len(triangles)
        self.shape(positions, triangles, normals, uv, colors, bsdf, material.emitter)
        if material.emitter is not None and material.double_sided:
            size = np.ptp(positions, axis=0).max()
            shift = area.sum(0) / np.linalg.norm(area.sum(0)) * (2e-5 * size)
            turned = None if normals is None else -normals
            self.shape(positions - shift, triangles[:, ::-1], turned, uv, colors, bsdf, material.emitter)

    def shape(self, positions, triangles, normals, uv, colors, bsdf, emitter):
        path = self.folder / f"{len(self.entries)}.ply"
        write_ply(path, positions, triangles, normals, uv, colors)
        flat = normals is None or emitter is not None
        entry = {"type": "ply", "filename": str(path), "face_normals": flat, "bsdf": bsdf}
        if emitter is not None:
            entry["emitter"] = emitter
        self.add(entry)

    def light(self, light, world_from_node):
        position = world_from_node[:3, 3]
        forward = -world_from_node[:3, 2] / np.linalg.norm(world_from_node[:3, 2])
        value = np.array(light.get("color", [1, 1, 1])) * light.get("intensity", 1.0)
        if light["type"] == "point":
            self.add({"type": "point", "position": position.tolist(), "intensity": rgb(value)})
        elif light["type"] == "directional":
            self.add({"type": "directional", "direction": forward.tolist(), "irradiance": rgb(value)})
        else:
            self.spot(light.get("spot", {}), position, forward, value)
        self.models[light.get("name", "light")] = "light: Mitsuba " + light["type"]

    def spot(self, cone, position, forward, value):
        """glTF's falloff, clamp((cos t - cos outer) / (cos inner - cos outer))^2, as a sum of linear ramps."""
        inner, outer = cone.get("innerConeAngle", 0.0), cone.get("outerConeAngle", math.pi / 4)
        edges = np.linspace(inner, outer, SPOT_RAMPS + 1)
        span = max(math.cos(inner) - math.cos(outer), 1e-6)
        falloff = np.clip((np.cos(edges) - math.cos(outer)) / span, 0, 1) ** 2
        up = [0, 1, 0] if abs(forward[1]) < 0.9 else [1, 0, 0]
        target = position + forward
        for k in range(SPOT_RAMPS):
            self.add(
                {
                    "type": "spot",
                    "to_world": mi.ScalarTransform4f().look_at(position.tolist(), target.tolist(), up),
                    "beam_width": math.degrees(edges[k]),
                    "cutoff_angle": math.degrees(edges[k + 1]),
                    "intensity": rgb(value * (falloff[k] - falloff[k + 1])),
                }
            )

    def environment(self, path, strength):
        source = np.array(mi.Bitmap(str(path)).convert(mi.Bitmap.PixelFormat.RGB, mi.Struct.Type.Float32, False))
        fine = resample_environment(source.astype("f8") * strength)
        # Mitsuba's map looks along -Z at column 0; half a turn about Y brings -Z to the centre column.
        turn = mi.ScalarTransform4f().rotate([0, 1, 0], 180)
        bitmap = mi.Bitmap(np.ascontiguousarray(fine, "f4"), mi.Bitmap.PixelFormat.RGB)
        self.add({"type": "envmap", "bitmap": bitmap, "to_world": turn})


def resample_environment(source):
    """The same bilinear function on Mitsuba's nodes. Columns have their centres where ours have them. Mitsuba's rows go
    from pole to pole, ours have centres: 2 height + 1 rows hold every centre and every edge, so nothing is lost."""
    height = len(source)
    y = np.clip(np.arange(2 * height + 1) / 2 - 0.5, 0, height - 1)
    above = np.floor(y).astype(int)
    below = np.minimum(above + 1, height - 1)
    blend = (y - above)[:, None, None]
    return source[above] * (1 - blend) + source[below] * blend


# ----------------------------------------------------------------------------------------------------------- rendering


def render(scene, integrator, pose, fov, size, spp, seed):
    """One image, (height, width, 3) in f64. pose: (position, rotation 3x3 world_from_head); fov in degrees."""
    width, height = size
    tan_left, tan_right, tan_up, tan_down = (math.tan(math.radians(angle)) for angle in fov)
    position, rotation = pose
    pixels = width * height
    total, done, launch = np.zeros((pixels, 3)), 0, 0
    while done < spp:
        samples = min(spp - done, max(1, RAYS_PER_LAUNCH // pixels))
        sampler = mi.load_dict({"type": "independent"})
        sampler.seed((seed * 4096 + launch) & 0xFFFFFFFF, pixels * samples)
        pixel = dr.arange(mi.UInt32, pixels * samples) // samples
        jitter = sampler.next_2d()
        x = mi.Float(pixel % width) + jitter.x
        y = mi.Float(pixel // width) + jitter.y
        tx = tan_left + (tan_right - tan_left) / width * x
        ty = tan_up + (tan_down - tan_up) / height * y
        m = [[float(v) for v in row] for row in rotation]
        direction = dr.normalize(mi.Vector3f(*(row[0] * tx + row[1] * ty - row[2] for row in m)))
        ray = mi.RayDifferential3f(mi.Ray3f(mi.Point3f(*(float(v) for v in position)), direction))
        radiance, _, _ = integrator.sample(scene, sampler, ray, active=mi.Bool(True))
        sums = [dr.block_reduce(dr.ReduceOp.Add, channel, samples) for channel in (radiance.x, radiance.y, radiance.z)]
        total += np.stack([np.array(channel, dtype="f8") for channel in sums], axis=1)
        done, launch = done + samples, launch + 1
    return (total / spp).reshape(height, width, 3)


def write_exr(path, image):
    bitmap = mi.Bitmap(np.ascontiguousarray(image, "f4"), mi.Bitmap.PixelFormat.RGB)
    bitmap.write(str(path), mi.Bitmap.FileFormat.OpenEXR)


def parse_arguments():
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--scene", required=True, help="glTF file, .gltf or .glb")
    parser.add_argument("--size", required=True, metavar="WxH", help="pixels")
    parser.add_argument("--fov", required=True, metavar='"left right up down"', help="degrees, left and down negative")
    parser.add_argument("--pose", metavar='"x y z qx qy qz qw"', help="default: the scene's first camera")
    parser.add_argument("--max-depth", type=int, default=12, help="segments from eye to light; 2 is direct light")
    parser.add_argument("--spp", type=int, default=256, help="samples per pixel and seed")
    parser.add_argument("--seeds", type=int, default=16, help="independent renders")
    parser.add_argument("--first-seed", type=int, default=1)
    parser.add_argument("--environment", metavar="FILE", help="equirectangular .hdr or .exr")
    parser.add_argument("--environment-strength", type=float, default=1.0)
    parser.add_argument("--variant", default="llvm_ad_rgb", help="a vectorised RGB variant: llvm_ad_rgb or cuda_ad_rgb")
    parser.add_argument("--out", required=True, metavar="NAME", help="writes NAME_mean.exr, NAME_se.exr, NAME.json")
    # argparse takes "-40 40 ..." for an option; a leading space makes it a value.
    raw = [" " + text if text.startswith("-") and " " in text else text for text in sys.argv[1:]]
    arguments = parser.parse_args(raw)
    if arguments.seeds < 2:
        parser.error("--seeds: a spread needs at least 2")
    return arguments


def main():
    global mi, dr
    arguments = parse_arguments()
    import drjit as dr
    import mitsuba as mi

    mi.set_variant(arguments.variant)
    define_gltf_bsdf()
    size = tuple(int(v) for v in arguments.size.split("x"))
    fov = [float(v) for v in arguments.fov.split()]
    started = time.time()
    gltf = Gltf(arguments.scene)
    with tempfile.TemporaryDirectory() as folder:
        builder = Builder(gltf, folder)
        if arguments.environment:
            builder.environment(arguments.environment, arguments.environment_strength)
        if arguments.pose:
            numbers = [float(v) for v in arguments.pose.split()]
            pose = (np.array(numbers[:3]), rotation_matrix(*numbers[3:]))
        elif builder.camera is not None:
            axes = builder.camera[:3, :3]
            pose = (builder.camera[:3, 3], axes / np.linalg.norm(axes, axis=0))
        else:
            raise Refused("the scene has no camera: give --pose")
        scene = mi.load_dict({"type": "scene"} | builder.entries)
    # rr_depth beyond the last bounce: no Russian roulette. Mitsuba's max_depth counts as ours does: 1 is emission
    # seen directly, 2 adds direct light.
    integrator = mi.load_dict({"type": "path", "max_depth": arguments.max_depth, "rr_depth": 1000000})
    renders = []
    for k in range(arguments.seeds):
        renders.append(render(scene, integrator, pose, fov, size, arguments.spp, arguments.first_seed + k))
        if sys.stderr.isatty():
            print(f"\r{k + 1}/{arguments.seeds}", end="", file=sys.stderr)
    renders = np.array(renders)
    mean = renders.mean(axis=0)
    error = renders.std(axis=0, ddof=1) / math.sqrt(len(renders))
    if not np.isfinite(renders).all():
        raise Refused("Mitsuba returned values that are not finite")
    out = Path(arguments.out)
    out.parent.mkdir(parents=True, exist_ok=True)
    write_exr(f"{out}_mean.exr", mean)
    write_exr(f"{out}_se.exr", error)
    path = Path(arguments.environment) if arguments.environment else None
    record = {
        "command": "scripts/reference_mitsuba.py " + shlex.join(sys.argv[1:]),
        "scene": arguments.scene,
        "scene_sha256": gltf.sha256,
        "environment": arguments.environment,
        "environment_strength": arguments.environment_strength,
        "environment_sha256": hashlib.sha256(path.read_bytes()).hexdigest() if path else None,
        "size": list(size),
        "fov_deg": fov,
        "position": [float(v) for v in pose[0]],
        "rotation_world_from_head": [[float(v) for v in row] for row in pose[1]],
        "pose": arguments.pose,
        "max_depth": arguments.max_depth,
        "spp_per_seed": arguments.spp,
        "seeds": arguments.seeds,
        "first_seed": arguments.first_seed,
        "mitsuba": mi.__version__,
        "drjit": dr.__version__,
        "variant": arguments.variant,
        "triangles": builder.triangles,
        "models": builder.models,
        "mean_rgb": mean.mean(axis=(0, 1)).tolist(),
        "mean_standard_error_rgb": (np.sqrt((error**2).sum(axis=(0, 1))) / (size[0] * size[1])).tolist(),
    }
    Path(f"{out}.json").write_text(json.dumps(record, indent=1) + "\n")
    print(f"{out}: mean {record['mean_rgb']}, {time.time() - started:.1f} s", file=sys.stderr)


if __name__ == "__main__":
    try:
        main()
    except (Refused, OSError) as error:
        sys.exit(f"reference_mitsuba.py: {error}")
