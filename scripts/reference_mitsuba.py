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
leaves intersection, light sampling, path construction and most models to Mitsuba. reference_models.py beside it maps
materials to Mitsuba's plugins, and writes a second time what has no counterpart there.
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
import time
from pathlib import Path
from urllib.parse import unquote

import numpy as np
from reference_models import Material, Refused, define_plugins, rgb, tangents, texture_transform

SPOT_RAMPS = 24
RAYS_PER_LAUNCH = 1 << 20
COMPONENT_TYPES = {5120: "i1", 5121: "u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
COMPONENTS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}
SUPPORTED_EXTENSIONS = {
    "KHR_lights_punctual",
    "KHR_materials_emissive_strength",
    "KHR_materials_ior",
    "KHR_materials_specular",
    "KHR_materials_transmission",
    "KHR_materials_volume",
    "KHR_texture_transform",
}


# ---------------------------------------------------------------------------------------------------------------- glTF


class Gltf:
    """A .gltf or .glb file: the JSON tree and its binary chunks."""

    def __init__(self, path):
        self.path = Path(path)
        data = self.path.read_bytes()
        self.sha256 = hashlib.sha256(data).hexdigest()
        self.chunk, self.images = b"", {}
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
        """Decoded 8-bit pixels, (height, width, 4), values 0 to 1 as stored, row 0 first."""
        if index in self.images:
            return self.images[index]
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
            pixels = np.concatenate([np.repeat(pixels[:, :, :1], 3, axis=2), pixels[:, :, 1:]], axis=2)
        if pixels.shape[2] == 3:
            pixels = np.concatenate([pixels, np.full_like(pixels[:, :, :1], 255)], axis=2)
        self.images[index] = pixels.astype("f4") / 255.0
        return self.images[index]

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


# --------------------------------------------------------------------------------------------------------------- scene


class Builder:
    """Gathers Mitsuba dictionaries: every primitive flattened to world space, lights, environment."""

    def __init__(self, gltf):
        self.gltf, self.has_alpha, self.has_media = gltf, False, False
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
        colored = "COLOR_0" in attributes
        key = (primitive.get("material"), colored)
        if key not in self.materials:
            self.materials[key] = Material(mi, gltf, *key)
        material = self.materials[key]
        self.models[material.name] = material.model
        for uv_set in sorted(material.uv_sets):
            if f"TEXCOORD_{uv_set}" not in attributes:
                raise Refused(f"material '{material.name}': a primitive without TEXCOORD_{uv_set}")
        self.has_alpha |= material.opacity is not None
        self.has_media |= material.medium is not None
        positions = gltf.accessor(attributes["POSITION"]).astype("f8")
        linear = world_from_node[:3, :3]
        mirrored = np.linalg.det(linear) < 0.0
        in_object = positions
        positions = positions @ linear.T + world_from_node[:3, 3]
        count = len(positions)
        indices = gltf.accessor(primitive["indices"])[:, 0] if "indices" in primitive else np.arange(count)
        triangles = indices.astype("i8").reshape(-1, 3)
        if mirrored:
            triangles = triangles[:, ::-1]  # glTF: a mirroring transform turns the winding.
        corners = positions[triangles]
        area = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        solid = (area**2).sum(1) > 0
        triangles, area = triangles[solid], area[solid]
        self.triangles += len(triangles)
        # Every corner becomes a vertex of its own: what belongs to corners can then be told apart.
        across = area / np.linalg.norm(area, axis=1, keepdims=True)
        normals, has_normals = np.repeat(across[:, None], 3, axis=1), False
        if "NORMAL" in attributes:
            given = gltf.accessor(attributes["NORMAL"]).astype("f8")
            smooth = given @ np.linalg.inv(linear)
            smooth /= np.linalg.norm(smooth, axis=1, keepdims=True)
            cosines = (smooth[triangles] * across[:, None]).sum(2)
            if not (np.abs(cosines) > 1 - 1e-5).all():
                normals, has_normals = smooth[triangles], True
        corner = {"vertex_shading_normal": normals}
        for uv_set in (0, 1):
            if f"TEXCOORD_{uv_set}" in attributes:
                uv = gltf.accessor(attributes[f"TEXCOORD_{uv_set}"]).astype("f8")
                corner[f"vertex_uv{uv_set}"] = np.pad(uv, ((0, 0), (0, 1)))[triangles]
        if colored:
            colors = np.clip(gltf.accessor(attributes["COLOR_0"]).astype("f8"), 0, 1)
            alpha = colors[:, 3:] if colors.shape[1] == 4 else np.ones((count, 1))
            corner["vertex_color_rgb"] = colors[triangles][:, :, :3]
            corner["vertex_color_alpha"] = np.repeat(alpha, 3, axis=1)[triangles]
        if material.normal_map is not None:
            if "TANGENT" in attributes and "NORMAL" in attributes:
                given_tangents = gltf.accessor(attributes["TANGENT"]).astype("f8")[triangles]
                along, hand = given_tangents[:, :, :3], given_tangents[:, :, 3]
            else:
                # In object space, where the winding is the file's; without normals no corner is shared.
                uv = gltf.accessor(attributes[f"TEXCOORD_{material.normal_uv_set}"]).astype("f8")
                order = triangles[:, ::-1] if mirrored else triangles
                if "NORMAL" in attributes:
                    along, hand = tangents(in_object, given, uv, order)
                else:
                    flat = in_object[order].reshape(-1, 3)
                    faces = np.arange(len(flat)).reshape(-1, 3)
                    edges = flat[faces]
                    out = np.cross(edges[:, 1] - edges[:, 0], edges[:, 2] - edges[:, 0])
                    out = np.repeat(out / np.linalg.norm(out, axis=1, keepdims=True), 3, axis=0)
                    along, hand = tangents(flat, out, uv[order].reshape(-1, 2), faces)
                if mirrored:
                    along, hand = along[:, ::-1], hand[:, ::-1]
            # A mirrored object is the mirror image of the object, its bumps included.
            corner["vertex_tangent"] = along @ linear.T
            corner["vertex_hand"] = np.repeat((hand * (-1.0 if mirrored else 1.0))[:, :, None], 3, axis=2)
        mesh_uv = None
        if material.emitter is not None and material.emissive_info is not None:
            matrix, uv_set = texture_transform(material.emissive_info)
            uv = corner[f"vertex_uv{uv_set}"]
            mesh_uv = np.concatenate([uv[:, :, :2], np.ones_like(uv[:, :, :1])], axis=2) @ np.array(matrix).T
        entry = {"bsdf": material.surface(has_normals)}
        if material.emitter is not None:
            entry["emitter"] = material.emitter
        if material.medium is not None:
            entry["interior"] = material.medium
        corners = positions[triangles]
        self.shape(corners, corner, mesh_uv, entry)
        if material.emitter is not None and material.double_sided:
            shift = across[:, None] * (2e-5 * np.ptp(positions, axis=0).max())
            corner["vertex_shading_normal"] = -corner["vertex_shading_normal"]
            turned = {name: values[:, ::-1] for name, values in corner.items()}
            self.shape((corners - shift)[:, ::-1], turned, None if mesh_uv is None else mesh_uv[:, ::-1], entry)

    def shape(self, corners, attributes, uv, entry):
        """A mesh of separate triangles, (triangles, 3 corners, 3), flat by itself."""
        count = len(corners)
        props = mi.Properties()
        for name, value in entry.items():
            props[name] = mi.load_dict(value) if isinstance(value, dict) else value
        props["face_normals"] = True
        mesh = mi.Mesh(f"mesh {len(self.entries)}", 3 * count, count, has_vertex_texcoords=uv is not None, props=props)
        parameters = mi.traverse(mesh)
        parameters["vertex_positions"] = np.ascontiguousarray(corners, "f4").ravel()
        parameters["faces"] = np.arange(3 * count, dtype="u4")
        if uv is not None:
            parameters["vertex_texcoords"] = np.ascontiguousarray(uv, "f4").ravel()
        parameters.update()
        for name, values in attributes.items():
            mesh.add_attribute(name, 3, np.ascontiguousarray(values, "f4").ravel())
        self.add(mesh)

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
        span = max(math.cos(inner) - math.cos(outer), 1e-3)
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
        radiance, _, _ = integrator.sample(scene, sampler, ray, None, mi.Bool(True))
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
    define_plugins(mi, dr)
    size = tuple(int(v) for v in arguments.size.split("x"))
    fov = [float(v) for v in arguments.fov.split()]
    started = time.time()
    gltf = Gltf(arguments.scene)
    builder = Builder(gltf)
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
    # `path` takes alpha for opaque in shadow rays, `volpath` does not; `volpathmis` knows media.
    kind = "volpathmis" if builder.has_media else "volpath" if builder.has_alpha else "path"
    integrator = mi.load_dict({"type": kind, "max_depth": arguments.max_depth, "rr_depth": 1000000})
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
