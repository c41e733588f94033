"""Surfaces for reference_mitsuba.py: glTF materials as Mitsuba dictionaries, and the models that Mitsuba lacks.

Mitsuba's own plugins serve wherever one says what glTF says: diffuse, dielectric, conductor, blendbsdf, mask, bitmap,
homogeneous. `define_plugins` adds, written here from the specifications alone:
- `slot`: one texture slot (coordinate set, KHR_texture_transform, factor, COLOR_0, alpha cutoff) around a bitmap;
- `gltf`: appendix B's layer and metal, rough or smooth; `gltf_glass`: Walter's rough dielectric with correlated Smith;
- `shaded`: interpolated normals and normal maps around any BSDF. Mitsuba meshes stay flat, so that a direction's side
  of the geometric surface is known: what the shading normal turns to the other side carries no light.
"""

import math

import numpy as np

WRAPS = {10497: "repeat", 33648: "mirror", 33071: "clamp"}
LEAST_ALPHA = 1e-3  # GGX alpha below it is smooth.


class Refused(Exception):
    """The scene holds what this script does not model truly."""


def srgb_to_linear(values):
    return np.where(values <= 0.04045, values / 12.92, ((values + 0.055) / 1.055) ** 2.4)


def rgb(values):
    return {"type": "rgb", "value": [float(v) for v in values]}


def texture_transform(info):
    """2x3 matrix of KHR_texture_transform: translation times rotation times scale; and the coordinate set."""
    entry = info.get("extensions", {}).get("KHR_texture_transform", {})
    c, s = math.cos(entry.get("rotation", 0.0)), math.sin(entry.get("rotation", 0.0))
    sx, sy = entry.get("scale", [1, 1])
    ox, oy = entry.get("offset", [0, 0])
    return ((c * sx, s * sy, ox), (-s * sx, c * sy, oy)), entry.get("texCoord", info.get("texCoord", 0))


# ----------------------------------------------------------------------------------------------------------- materials


class Material:
    """One glTF material as Mitsuba dictionaries. `colored`: the primitive has COLOR_0, which multiplies the base."""

    def __init__(self, mi, gltf, index, colored=False):
        tree = gltf.tree["materials"][index] if index is not None else {}
        self.uv_sets = set()
        self.mi, self.gltf, self.name = mi, gltf, tree.get("name", f"material {index}")
        extensions = tree.get("extensions", {})
        pbr = tree.get("pbrMetallicRoughness", {})
        self.double_sided = tree.get("doubleSided", False)
        specular = extensions.get("KHR_materials_specular", {})
        transmission = extensions.get("KHR_materials_transmission", {})
        volume = extensions.get("KHR_materials_volume", {})
        ior = float(extensions.get("KHR_materials_ior", {}).get("ior", 1.5))
        factors = pbr.get("baseColorFactor", [1, 1, 1, 1])
        base_map, rough_map = pbr.get("baseColorTexture"), pbr.get("metallicRoughnessTexture")
        metallic, roughness = pbr.get("metallicFactor", 1.0), pbr.get("roughnessFactor", 1.0)
        weight, transmitted = specular.get("specularFactor", 1.0), transmission.get("transmissionFactor", 0.0)
        smooth = roughness * roughness < LEAST_ALPHA
        base = self.slot(base_map, factors[:3], srgb=True, colored=colored)
        metallic_roughness = self.slot(rough_map, [0.0, roughness, metallic])
        if rough_map is not None and not smooth:
            least = (gltf.image(gltf.tree["textures"][rough_map["index"]]["source"])[:, :, 1].min() * roughness) ** 2
            if least < LEAST_ALPHA:
                raise Refused(f"material '{self.name}': a texture that is smooth in places")

        if metallic == 0.0 and weight == 0.0:
            self.model = "Lambert: Mitsuba diffuse"
            opaque = {"type": "twosided", "bsdf": {"type": "diffuse", "reflectance": base}}
        elif metallic == 1.0 and smooth and factors[:3] == [1, 1, 1] and not (base_map or colored or rough_map):
            self.model = "perfect mirror: Mitsuba conductor"
            mirror = {"type": "conductor", "material": "none", "specular_reflectance": rgb([1, 1, 1])}
            opaque = {"type": "twosided", "bsdf": mirror}
        else:
            self.model = "glTF appendix B: own formulas, sampled by Mitsuba"
            opaque = {
                "type": "gltf",
                "smooth": smooth,
                "metal_only": metallic == 1.0 and rough_map is None,
                "base": base,
                "metallic_roughness": metallic_roughness,
                "ior": ior,
                "specular": self.slot(specular.get("specularTexture"), [weight] * 3, channel=3),
                "specular_color": self.slot(
                    specular.get("specularColorTexture"), specular.get("specularColorFactor", [1, 1, 1]), srgb=True
                ),
            }
        self.bsdf, self.medium = opaque, None
        if transmitted > 0.0:
            if metallic > 0.0:
                raise Refused(f"material '{self.name}': glass that is partly metal")
            if smooth:
                glass = {"type": "dielectric", "int_ior": ior, "ext_ior": 1.0, "specular_transmittance": base}
            else:
                glass = {"type": "gltf_glass", "metallic_roughness": metallic_roughness, "ior": ior, "tint": base}
            self.model = "smooth glass: Mitsuba dielectric" if smooth else "rough glass: own formulas"
            if transmitted < 1.0 or "transmissionTexture" in transmission:
                self.model += ", over an opaque part"
                share = self.slot(transmission.get("transmissionTexture"), [transmitted] * 3, channel=0)
                glass = {"type": "blendbsdf", "weight": share, "first": opaque, "second": glass}
            self.bsdf = glass
            distance = volume.get("attenuationDistance", math.inf)
            if math.isfinite(distance):
                left = np.clip(volume.get("attenuationColor", [1, 1, 1]), 1e-30, 1.0)
                sigma = -np.log(left) / distance
                if sigma.max() > 0.0:
                    self.model += ", absorbing: Mitsuba homogeneous"
                    shares = rgb(sigma / sigma.max())
                    self.medium = {"type": "homogeneous", "albedo": 0.0, "sigma_t": shares, "scale": float(sigma.max())}

        self.normal_map = None
        if "normalTexture" in tree:
            info = tree["normalTexture"]
            self.normal_map, self.normal_scale = self.slot(info, [1, 1, 1]), info.get("scale", 1.0)
            self.normal_uv_set = texture_transform(info)[1]
        mode, self.opacity = tree.get("alphaMode", "OPAQUE"), None
        if mode != "OPAQUE":
            cutoff = tree.get("alphaCutoff", 0.5) if mode == "MASK" else -1.0
            self.opacity = self.slot(base_map, factors[3:] * 3, colored=colored, channel=3, cutoff=cutoff)
            self.model += f", alpha {mode.lower()}: Mitsuba mask"

        strength = extensions.get("KHR_materials_emissive_strength", {}).get("emissiveStrength", 1.0)
        emission = [strength * c for c in tree.get("emissiveFactor", [0, 0, 0])]
        self.emitter = None
        if max(emission) > 0.0:
            if self.opacity is not None:
                raise Refused(f"material '{self.name}': a lamp with alpha")
            self.emissive_info = tree.get("emissiveTexture")
            radiance = self.slot(self.emissive_info, emission, srgb=True, place="mesh")
            self.emitter = {"type": "area", "radiance": radiance}

    def slot(self, info, factor, srgb=False, colored=False, channel=None, cutoff=-1.0, place=None):
        """A texture slot, or a plain colour without a texture. channel: the one to repeat; place "mesh": read the
        mesh's own coordinates, which `Builder` has transformed already."""
        if info is None and not colored and cutoff < 0.0:
            return rgb(factor)
        entry = {"type": "slot", "factor": self.mi.ScalarColor3f(*factor), "cutoff": float(cutoff)}
        if colored:
            entry["color"] = "vertex_color_alpha" if channel == 3 else "vertex_color_rgb"
        if info is None:
            return entry
        matrix, uv_set = texture_transform(info)
        self.uv_sets.add(uv_set)
        entry["uv"] = place or f"vertex_uv{uv_set}"
        if place is None:
            entry |= {f"m{row}{column}": matrix[row][column] for row in range(2) for column in range(3)}
        texture = self.gltf.tree["textures"][info["index"]]
        sampler = self.gltf.tree["samplers"][texture["sampler"]] if "sampler" in texture else {}
        wraps = [WRAPS[sampler.get(key, 10497)] for key in ("wrapS", "wrapT")]
        pixels = self.gltf.image(texture["source"])
        if channel is not None:
            pixels = np.repeat(pixels[:, :, channel : channel + 1], 3, axis=2)
        pixels = pixels[:, :, :3]
        if srgb:
            pixels = srgb_to_linear(pixels)
        if wraps[0] != wraps[1]:
            # Mitsuba wraps both axes alike: mirroring is repeating a doubled image, and clamping is staying inside one
            # that has its border pixels twice.
            for axis, name in enumerate(wraps):
                along = 1 - axis
                size = pixels.shape[along]
                if name == "mirror":
                    pixels = np.concatenate([pixels, np.flip(pixels, along)], axis=along)
                    entry[f"scale{axis}"] = 0.5
                elif name == "clamp":
                    pixels = np.pad(pixels, [(1, 1) if k == along else (0, 0) for k in range(3)], "edge")
                    entry[f"scale{axis}"] = size / (size + 2)
                    entry[f"shift{axis}"] = 1 / (size + 2)
                    entry[f"inside{axis}"] = 0.5 / (size + 2)
            wraps[0] = "repeat"
        bitmap = {
            "type": "bitmap",
            "data": self.mi.TensorXf(np.ascontiguousarray(pixels, "f4")),
            "raw": True,
            "filter_type": "nearest" if sampler.get("magFilter") == 9728 else "bilinear",
            "wrap_mode": wraps[0],
        }
        entry["bitmap"] = self.mi.load_dict(bitmap)  # An object: a dictionary's data serve once only.
        return entry

    def surface(self, has_normals):
        """The BSDF of a primitive; `has_normals`: its normals are other than the triangles' own."""
        bsdf = self.bsdf
        if has_normals or self.normal_map is not None:
            bsdf = {"type": "shaded", "nested": bsdf}
            if self.normal_map is not None:
                bsdf |= {"map": self.normal_map, "scale": float(self.normal_scale)}
        if self.opacity is not None:
            bsdf = {"type": "mask", "opacity": self.opacity, "nested": bsdf}
        return bsdf


def tangents(positions, normals, uv, triangles):
    """One tangent per triangle corner, (triangles, 3, 3), and its handedness, (triangles, 3): dP/du in the corner's
    tangent plane, the mean by angle over the corners that share vertex and orientation of the chart (MikkTSpace)."""
    p, n, t = positions[triangles], normals[triangles], uv[triangles]
    e1, e2 = p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]
    d1, d2 = t[:, 1] - t[:, 0], t[:, 2] - t[:, 0]
    area = d1[:, 0] * d2[:, 1] - d1[:, 1] * d2[:, 0]
    along = (d2[:, 1:] * e1 - d1[:, 1:] * e2) * np.sign(area)[:, None]
    # glTF's v points down the image, so that the bitangent of an unmirrored chart is -dP/dv.
    hand = np.where(area > 0, -1.0, 1.0)
    flat = along[:, None] - n * (n * along[:, None]).sum(2, keepdims=True)
    flat /= np.maximum(np.linalg.norm(flat, axis=2, keepdims=True), 1e-30)
    a, b = np.roll(p, -1, axis=1) - p, np.roll(p, -2, axis=1) - p
    angle = np.arctan2(np.linalg.norm(np.cross(a, b), axis=2), (a * b).sum(2))
    key = triangles * 2 + (hand[:, None] > 0)
    sums = np.zeros((2 * len(positions), 3))
    np.add.at(sums, key.ravel(), (flat * angle[:, :, None]).reshape(-1, 3))
    sums /= np.maximum(np.linalg.norm(sums, axis=1, keepdims=True), 1e-30)
    return sums[key], np.repeat(hand[:, None], 3, axis=1)


# ------------------------------------------------------------------------------------------------------------- plugins


def define_plugins(mi, dr):
    """Registers `slot`, `gltf`, `gltf_glass` and `shaded`: here, since their bases exist once a variant is set."""
    flags = mi.BSDFFlags
    sides = flags.FrontSide | flags.BackSide

    class Slot(mi.Texture):
        def __init__(self, props):
            mi.Texture.__init__(self, props)
            get = lambda key, default: props[key] if props.has_property(key) else default
            self.factor = mi.Color3f(props["factor"])
            self.cutoff = get("cutoff", -1.0)
            self.bitmap = get("bitmap", None)
            self.uv, self.color = get("uv", ""), get("color", "")
            self.matrix = [[get(f"m{r}{c}", float(r == c)) for c in range(3)] for r in range(2)]
            folds = (("scale", 1.0), ("shift", 0.0), ("inside", 0.0))
            self.fold = [[get(f"{key}{axis}", default) for key, default in folds] for axis in range(2)]

        def value(self, si, active):
            value = mi.Color3f(self.factor)
            if self.color:
                value *= si.shape.eval_attribute_3(self.color, si, active)
            if self.bitmap is not None:
                place = mi.Vector3f(si.uv.x, si.uv.y, 0)
                if self.uv != "mesh":
                    place = si.shape.eval_attribute_3(self.uv, si, active)
                at = [row[0] * place[0] + row[1] * place[1] + row[2] for row in self.matrix]
                for axis, (scale, shift, inside) in enumerate(self.fold):
                    at[axis] = at[axis] * scale + shift
                    if inside > 0.0:
                        at[axis] = dr.clip(at[axis], inside, 1.0 - inside)
                moved = mi.SurfaceInteraction3f(si)
                moved.uv = mi.Point2f(at[0], at[1])
                value *= mi.Color3f(self.bitmap.eval_3(moved, active))
            if self.cutoff >= 0.0:
                value = dr.select(value >= self.cutoff, mi.Color3f(1), mi.Color3f(0))
            return value & active

        def eval(self, si, active=True):
            return self.value(si, mi.Bool(active))

        def eval_3(self, si, active=True):
            return self.value(si, mi.Bool(active))

        def eval_1(self, si, active=True):
            return self.value(si, mi.Bool(active)).x

        def mean(self):
            return mi.Float(0.5)

        # So `area` samples its surface evenly: sampling by texture wants charts that cover the unit square once.
        def is_spatially_varying(self):
            return False

        def traverse(self, callback):
            pass

        def to_string(self):
            return "Slot[]"

    class Model(mi.BSDF):
        """Two-sided by turning local frames; `evaluate(si, wi, wo, active)` knows wi.z > 0."""

        def eval(self, ctx, si, wo, active=True):
            return self.eval_pdf(ctx, si, wo, active)[0]

        def pdf(self, ctx, si, wo, active=True):
            return self.eval_pdf(ctx, si, wo, active)[1]

        def eval_pdf(self, ctx, si, wo, active=True):
            turn = dr.sign(si.wi.z)
            wi, wo = mi.Vector3f(si.wi.x, si.wi.y, si.wi.z * turn), mi.Vector3f(wo.x, wo.y, wo.z * turn)
            return self.evaluate(si, wi, wo, turn, mi.Bool(active) & (wi.z > 0))

        def eval_null_transmission(self, si, active=True):
            return mi.Color3f(0)

        def traverse(self, callback):
            pass

        def to_string(self):
            return type(self).__name__ + "[]"

    def ggx(z, alpha):
        """D of appendix B.3.2 at the half vector's cosine."""
        return dr.square(alpha) / (dr.pi * dr.square(dr.square(z) * (dr.square(alpha) - 1) + 1))

    def visibility(cos_i, cos_o, alpha):
        """V of appendix B.3.2: height-correlated Smith over 4 cos cos."""
        a2 = dr.square(alpha)
        root = lambda z: dr.sqrt(a2 + (1 - a2) * dr.square(z))
        return 0.5 / (cos_o * root(cos_i) + cos_i * root(cos_o))

    def finish(wo, pdf, value, kind, active, eta=1.0):
        bs = dr.zeros(mi.BSDFSample3f)
        bs.wo, bs.pdf, bs.eta = wo, pdf, eta
        bs.sampled_type, bs.sampled_component = mi.UInt32(kind), mi.UInt32(0)
        ok = active & (pdf > 0)
        return bs, dr.select(ok, value / pdf, 0)

    class Gltf(Model):
        """Lambert under a GGX layer, mixed by F(v.h) (KHR_materials_specular), or a metal, or a mix of the two.

        Sampled half by the cosine, half by visible normals of Mitsuba's GGX distribution, or by mirroring if smooth.
        """

        def __init__(self, props):
            mi.BSDF.__init__(self, props)
            self.base = props.get_texture("base")
            self.metallic_roughness = props.get_texture("metallic_roughness")
            self.weight, self.tint = props.get_texture("specular"), props.get_texture("specular_color")
            self.ior, self.smooth, self.metal_only = props["ior"], props["smooth"], props["metal_only"]
            kinds = flags.DiffuseReflection | flags.GlossyReflection
            if self.smooth:
                kinds = flags.DeltaReflection if self.metal_only else flags.DiffuseReflection | flags.DeltaReflection
            self.m_components = [kinds | sides]
            self.m_flags = self.m_components[0]

        def parts(self, si, cosine, active):
            """Base under the layer / pi, and reflectance of layer and metal, for the cosine of v.h."""
            base, metallic = self.base.eval(si, active), self.metallic_roughness.eval(si, active)[2]
            weight = self.weight.eval(si, active)[0]
            f0 = dr.minimum(((self.ior - 1.0) / (self.ior + 1.0)) ** 2 * self.tint.eval(si, active), 1.0)
            s5 = (1 - dr.clip(dr.abs(cosine), 0, 1)) ** 5
            fresnel = f0 + (1 - f0) * s5
            under = (1 - weight * dr.max(fresnel)) * base * dr.inv_pi * (1 - metallic)
            return under, dr.lerp(weight * fresnel, base + (1 - base) * s5, metallic)

        def alpha(self, si, active):
            return dr.square(self.metallic_roughness.eval(si, active)[1])

        def evaluate(self, si, wi, wo, turn, active):
            active = active & (wo.z > 0)
            h = dr.normalize(wi + wo)
            under, over = self.parts(si, dr.dot(wi, h), active)
            value, pdf = under, 0.5 * wo.z * dr.inv_pi
            if not self.smooth:
                alpha = self.alpha(si, active)
                value = value + over * ggx(h.z, alpha) * visibility(wi.z, wo.z, alpha)
                normals = mi.MicrofacetDistribution(mi.MicrofacetType.GGX, alpha)
                pdf = pdf + 0.5 * normals.pdf(wi, h) / (4 * dr.dot(wo, h))
            if self.smooth and self.metal_only:
                active = mi.Bool(False)
            return dr.select(active, value * wo.z, 0), dr.select(active, pdf, 0)

        def sample(self, ctx, si, sample1, sample2, active=True):
            active, turn = mi.Bool(active), dr.sign(si.wi.z)
            wi = mi.Vector3f(si.wi.x, si.wi.y, si.wi.z * turn)
            active &= wi.z > 0
            by_cosine = (sample1 < 0.5) & (not (self.smooth and self.metal_only))
            if self.smooth:
                mirrored = mi.reflect(wi)
            else:
                h, _ = mi.MicrofacetDistribution(mi.MicrofacetType.GGX, self.alpha(si, active)).sample(wi, sample2)
                mirrored = mi.reflect(wi, h)
            wo = dr.select(by_cosine, mi.warp.square_to_cosine_hemisphere(sample2), mirrored)
            value, pdf = self.evaluate(si, wi, wo, turn, active)
            kind = mi.UInt32(+(flags.DiffuseReflection if self.smooth else flags.GlossyReflection))
            if self.smooth:
                _, over = self.parts(si, wi.z, active)
                value = dr.select(by_cosine, value, over)
                pdf = dr.select(by_cosine, pdf, 1.0 if self.metal_only else 0.5)
                kind = dr.select(by_cosine, kind, +flags.DeltaReflection)
            return finish(mi.Vector3f(wo.x, wo.y, wo.z * turn), pdf, value, kind, active)

    class GltfGlass(Model):
        """Walter et al. 2007 with GGX, exact Fresnel (Mitsuba's `fresnel`) and height-correlated Smith."""

        def __init__(self, props):
            mi.BSDF.__init__(self, props)
            self.metallic_roughness, self.tint = props.get_texture("metallic_roughness"), props.get_texture("tint")
            self.ior = props["ior"]
            self.m_components = [
                flags.GlossyReflection | sides,
                flags.GlossyTransmission | sides | flags.NonSymmetric,
            ]
            self.m_flags = self.m_components[0] | self.m_components[1]

        def evaluate(self, si, wi, wo, turn, active):
            eta = dr.select(turn > 0, self.ior, 1 / self.ior)  # beyond over this side
            reflected = wo.z > 0
            h = dr.normalize(wi + wo * dr.select(reflected, 1.0, eta))
            h = dr.mulsign(h, h.z)
            ih, oh = dr.dot(wi, h), dr.dot(wo, h)
            active = active & (ih > 0) & ((oh > 0) == reflected)
            f = mi.fresnel(ih, eta)[0]
            alpha = dr.square(self.metallic_roughness.eval(si, active)[1])
            dv = ggx(h.z, alpha) * visibility(wi.z, dr.abs(wo.z), alpha)
            # Equation 21, (ih oh) / (ci co) eta_o^2 (1 - F) G D / (eta_i ih + eta_o oh)^2; radiance scales by 1 / eta^2.
            jacobian = dr.square(eta) / dr.square(ih + eta * oh)
            through = (1 - f) * 4 * dv * ih * dr.abs(oh) * jacobian / dr.square(eta)
            value = dr.select(reflected, mi.Color3f(f * dv), through * self.tint.eval(si, active)) * dr.abs(wo.z)
            normals = mi.MicrofacetDistribution(mi.MicrofacetType.GGX, alpha)
            density = normals.pdf(wi, h)
            pdf = density * dr.select(reflected, f / (4 * dr.abs(oh)), (1 - f) * dr.abs(oh) * jacobian)
            return dr.select(active, value, 0), dr.select(active, pdf, 0)

        def sample(self, ctx, si, sample1, sample2, active=True):
            active, turn = mi.Bool(active), dr.sign(si.wi.z)
            wi = mi.Vector3f(si.wi.x, si.wi.y, si.wi.z * turn)
            active &= wi.z > 0
            eta = dr.select(turn > 0, self.ior, 1 / self.ior)
            alpha = dr.square(self.metallic_roughness.eval(si, active)[1])
            h, _ = mi.MicrofacetDistribution(mi.MicrofacetType.GGX, alpha).sample(wi, sample2)
            f, cos_t, _, eta_ti = mi.fresnel(dr.dot(wi, h), eta)
            reflects = sample1 < f
            wo = dr.select(reflects, mi.reflect(wi, h), mi.refract(wi, h, cos_t, eta_ti))
            active &= (wo.z > 0) == reflects
            value, pdf = self.evaluate(si, wi, wo, turn, active)
            kind = dr.select(reflects, mi.UInt32(+flags.GlossyReflection), mi.UInt32(+flags.GlossyTransmission))
            wo = mi.Vector3f(wo.x, wo.y, wo.z * turn)
            return finish(wo, pdf, value, kind, active, dr.select(reflects, 1.0, eta))

    class Shaded(Model):
        def __init__(self, props):
            mi.BSDF.__init__(self, props)
            self.nested = props["nested"]
            self.map = props.get_texture("map") if props.has_property("map") else None
            self.scale = props["scale"] if props.has_property("scale") else 1.0
            self.m_components = [self.nested.flags(k) for k in range(self.nested.component_count())]
            self.m_flags = self.nested.flags()

        def turned(self, si, active):
            """The interaction in the shading frame, and where wi lies on one side of both surfaces."""
            outward = mi.Vector3f(si.n)
            normal = dr.normalize(mi.Vector3f(si.shape.eval_attribute_3("vertex_shading_normal", si, active)))
            normal = dr.mulsign(normal, dr.dot(normal, outward))
            if self.map is not None:
                tangent = mi.Vector3f(si.shape.eval_attribute_3("vertex_tangent", si, active))
                tangent = dr.normalize(tangent - normal * dr.dot(normal, tangent))
                hand = dr.sign(si.shape.eval_attribute_3("vertex_hand", si, active)[0])
                texel = 2 * mi.Vector3f(self.map.eval_3(si, active)) - 1
                normal = dr.normalize(
                    texel.x * self.scale * tangent
                    + texel.y * self.scale * hand * dr.cross(normal, tangent)
                    + texel.z * normal
                )
            turned = mi.SurfaceInteraction3f(si)
            turned.sh_frame = mi.Frame3f(normal)
            turned.wi = turned.to_local(si.to_world(si.wi))
            return turned, active & (turned.wi.z * si.wi.z > 0)

        def eval_pdf(self, ctx, si, wo, active=True):
            turned, active = self.turned(si, mi.Bool(active))
            inner = turned.to_local(si.to_world(wo))
            active &= inner.z * wo.z > 0
            value, pdf = self.nested.eval_pdf(ctx, turned, inner, active)
            return value & active, pdf & active

        def sample(self, ctx, si, sample1, sample2, active=True):
            turned, active = self.turned(si, mi.Bool(active))
            bs, weight = self.nested.sample(ctx, turned, sample1, sample2, active)
            inner = mi.Vector3f(bs.wo)
            bs.wo = si.to_local(turned.to_world(inner))
            active &= inner.z * bs.wo.z > 0
            return bs, weight & active

    mi.register_texture("slot", Slot)
    mi.register_bsdf("gltf", Gltf)
    mi.register_bsdf("gltf_glass", GltfGlass)
    mi.register_bsdf("shaded", Shaded)
