//! Lights: records, powers, and the table that picks them in proportion to power.
//!
//! Order of the records: the environment (if any), directional, point and spot lights, then the emissive triangles of
//! each instance in the mesh's own order. So the leading records are those that move with the origin of render space,
//! and an emissive triangle's light is `first_emitter` of its instance plus its ordinal in the mesh.
//!
//! Powers weigh the pick only. Whatever they are, sampling stays unbiased as long as no light that shines has power 0.

use std::f64::consts::PI;

use glam::{DAffine3, DVec3, Vec3};

use crate::renderer::records::light::{
    LIGHT_DIRECTIONAL, LIGHT_ENVIRONMENT, LIGHT_POINT, LIGHT_SPOT, LIGHT_TRIANGLE, Light,
    LightAlias,
};
use crate::scene::mesh_statistics::loose_bounds;
use crate::scene::{Bounds, Instance, LightKind, Mesh, Scene};

use super::environment::PackedEnvironment;

mod alias;
mod glow;
mod motion;
mod tree;

use alias::{alias_table, chances};
pub use glow::mean_glow;
use glow::mesh_glows;
pub use motion::LightUploads;
use motion::{Emitter, Placed, is_afar};
use tree::{Cluster, HEADER_WORDS, LightTree, MOST_REGROUPED};

/// [`emitter_ordinals`]: the triangle does not emit.
const NO_EMITTER: u32 = u32::MAX;
/// The scene's box is grown by this share of half its diagonal: photons come in by its faces.
const BOX_MARGIN: f64 = 1.0e-4;
/// Least cosine range of a spot's ramp (KHR_lights_punctual's own guard).
const LEAST_RAMP: f64 = 1.0e-3;

/// Which kinds of light take part: those whose shader features are on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LightKinds {
    /// Emissive triangles.
    pub emitters: bool,
    /// Point lights.
    pub points: bool,
    /// Spot lights.
    pub spots: bool,
    /// Directional lights.
    pub directionals: bool,
    /// The environment map.
    pub environment: bool,
}

impl Default for LightKinds {
    /// All of them.
    fn default() -> Self {
        Self {
            emitters: true,
            points: true,
            spots: true,
            directionals: true,
            environment: true,
        }
    }
}

/// What lights are packed from.
#[derive(Clone, Copy)]
pub struct LightSources<'a> {
    /// The scene.
    pub scene: &'a Scene,
    /// Its environment, packed.
    pub environment: Option<&'a PackedEnvironment>,
    /// Of each mesh, where its triangles lie in the `triangles` array.
    pub leaf_of_triangle: &'a [Vec<u32>],
    /// Kinds that take part.
    pub kinds: LightKinds,
}

/// Where there are lamps and light from afar, photons begin at either at least this often.
const LEAST_CHANCE_OF_KIND: f64 = 0.1;

/// All lights of a scene.
#[derive(Clone, Debug, Default)]
pub struct PackedLights {
    /// One per light. Empty without lights.
    pub records: Vec<Light>,
    /// Header and alias table; never empty.
    pub alias: Vec<LightAlias>,
    /// Per instance ([`Scene::instances`] order): index of its first emissive triangle's record, or `0xffffffff`.
    pub first_emitter: Vec<u32>,
    /// How many leading records depend on the origin of render space and are uploaded again when it moves.
    pub origin_dependent: usize,
    /// Total power, W: what the mean photon carries. Within rounding for untextured lights; a textured emitter's and
    /// an environment's are by quadrature, and alpha coverage is not counted.
    pub total_power: [f64; 3],
    /// Positions of the leading records in the world.
    positions_in_world: Vec<DVec3>,
    /// Scene nodes of the leading records; `usize::MAX` for the environment.
    nodes: Vec<usize>,
    /// Power of each record, W, and its weight in the pick.
    powers: Vec<[f64; 3]>,
    weights: Vec<f64>,
    /// Where each record is and how it shines, and what lights are picked by for a point.
    shapes: Vec<LightShape>,
    tree: LightTree,
    origin_in_world: DVec3,
    words: Vec<[u32; 4]>,
    /// The box that lights at infinity shine through: as packed, and in use.
    packed_box: SceneBox,
    scene_box: SceneBox,
    /// Emissive triangles by mesh, and where the records of placed ones lie.
    emitters: Vec<Vec<Emitter>>,
    placed: Vec<Option<Placed>>,
    /// Records that no instance uses: first and count.
    holes: Vec<(usize, usize)>,
    uploads: LightUploads,
    kinds: LightKinds,
    /// [`PackedEnvironment::through_planes`] of the surroundings.
    environment: Option<[[f64; 3]; 3]>,
}

/// What the tree knows of a light besides its weight.
#[derive(Clone, Copy, Debug)]
struct LightShape {
    /// Where it is, world space; none for light from afar.
    bounds: Option<Bounds>,
    /// Power over the mean of its intensity over all directions, sr; from afar over its irradiance, m^2.
    spread: f64,
}

impl LightShape {
    fn near(bounds: Bounds) -> Self {
        Self {
            bounds: Some(bounds),
            spread: 4.0 * PI,
        }
    }

    fn at(position_in_world: DVec3) -> Self {
        Self::near(Bounds {
            min: position_in_world,
            max: position_in_world,
        })
    }

    fn afar(area_m2: f64) -> Self {
        Self {
            bounds: None,
            spread: area_m2,
        }
    }

    /// `share` of all lights' power.
    fn cluster(&self, share: f64) -> Cluster {
        let intensity = if share > 0.0 {
            share / self.spread
        } else {
            0.0
        };
        Cluster {
            bounds: self.bounds,
            intensity,
        }
    }
}

/// For each triangle of a mesh its ordinal among those whose material emits, in the mesh's own order, or `0xffffffff`.
pub fn emitter_ordinals(scene: &Scene, mesh: &Mesh) -> Vec<u32> {
    let mut next = 0;
    mesh.triangles
        .iter()
        .map(|triangle| {
            let emits = scene
                .materials
                .get(triangle.material as usize)
                .is_some_and(|material| material.is_emissive());
            if !emits {
                return NO_EMITTER;
            }
            next += 1;
            next - 1
        })
        .collect()
}

/// Packs the lights that `sources.kinds` admits. `origin_in_world` is the origin of render space, the head.
pub fn pack_lights(sources: &LightSources<'_>, origin_in_world: DVec3) -> PackedLights {
    let scene = sources.scene;
    let boxes: Vec<Option<Bounds>> = scene
        .meshes
        .iter()
        .map(|mesh| {
            let positions = mesh.positions.iter().copied();
            Bounds::of_points(positions.map(crate::scene::as_dvec3))
        })
        .collect();
    let bounds = loose_bounds(scene, |mesh| boxes.get(mesh).copied().flatten());
    let mut packed = PackedLights {
        kinds: sources.kinds,
        environment: sources
            .environment
            .filter(|_| sources.kinds.environment)
            .map(|packed| packed.through_planes),
        emitters: (0..scene.meshes.len())
            .map(|mesh| {
                let leaf_of = sources.leaf_of_triangle.get(mesh);
                sources.emitters_of(mesh, leaf_of.map_or(&[], Vec::as_slice))
            })
            .collect(),
        ..PackedLights::default()
    };
    packed.place_all(
        scene,
        &scene.instances(),
        SceneBox::around(bounds, origin_in_world),
    );
    packed.set_origin(origin_in_world);
    packed.finish();
    packed
}

impl LightSources<'_> {
    fn emitters_of(&self, mesh: usize, leaf_of: &[u32]) -> Vec<Emitter> {
        if !self.kinds.emitters {
            return Vec::new();
        }
        mesh_emitters(self.scene, &self.scene.meshes[mesh], leaf_of)
    }
}

/// The emissive triangles of a mesh in its own order; `leaf_of` gives a triangle's index in leaf order.
fn mesh_emitters(scene: &Scene, mesh: &Mesh, leaf_of: &[u32]) -> Vec<Emitter> {
    mesh_glows(scene, mesh)
        .into_iter()
        .map(|glow| {
            let leaf = leaf_of.get(glow.triangle).copied().unwrap_or_default();
            Emitter::new(mesh, glow, leaf)
        })
        .collect()
}

impl PackedLights {
    /// Another map is around the scene, as there was one before. For [`PackedLights::repack`].
    pub fn set_environment(&mut self, environment: &PackedEnvironment) {
        self.environment = Some(environment.through_planes);
    }

    /// Makes all records from the scene's lights and `instances`, whose numbers are their places in the list, and weighs
    /// them. Nothing but the emissive triangles of meshes, at rest, is kept of what was there.
    fn place_all(&mut self, scene: &Scene, instances: &[Instance], scene_box: SceneBox) {
        *self = Self {
            packed_box: scene_box,
            scene_box,
            kinds: self.kinds,
            environment: self.environment,
            emitters: std::mem::take(&mut self.emitters),
            ..Self::default()
        };
        self.emitters
            .iter_mut()
            .flatten()
            .for_each(Emitter::lie_at_rest);
        if self.environment.is_some() {
            let record = scene_box.shone_through(Light {
                kind: LIGHT_ENVIRONMENT,
                direction: [0.0, 0.0, 1.0],
                ..Light::default()
            });
            self.positions_in_world.push(scene_box.center);
            self.nodes.push(usize::MAX);
            let shape = self.shape_of(&record, scene_box.center);
            self.push(self.power_from_afar(&record), 1.0, record, shape);
        }
        self.push_punctual(scene);
        self.origin_dependent = self.records.len();
        for (index, instance) in instances.iter().enumerate() {
            let first =
                self.push_emitters(index as u32, instance.mesh, &instance.world_from_object);
            self.first_emitter.push(first);
        }
        self.pick_anew();
    }

    fn push(&mut self, power: [f64; 3], boost: f64, record: Light, shape: LightShape) {
        self.records.push(record);
        self.shapes.push(shape);
        self.powers.push([0.0; 3]);
        self.weights.push(0.0);
        self.set_power(self.records.len() - 1, power, boost);
    }

    /// Power of directional light or of the surroundings through the scene's box, W.
    fn power_from_afar(&self, record: &Light) -> [f64; 3] {
        let through_planes = match self.environment {
            Some(through_planes) if record.kind == LIGHT_ENVIRONMENT => through_planes,
            _ => record.direction.map(|component| {
                let cosine = f64::from(component.abs());
                record
                    .radiance
                    .map(|irradiance| f64::from(irradiance) * cosine)
            }),
        };
        let mut power = [0.0; 3];
        for (area, through) in self.scene_box.faces().into_iter().zip(through_planes) {
            for channel in 0..3 {
                power[channel] += area * through[channel];
            }
        }
        power
    }

    /// The shape of any light but a triangle.
    fn shape_of(&self, record: &Light, position_in_world: DVec3) -> LightShape {
        let faces = DVec3::from(self.scene_box.faces());
        match record.kind {
            LIGHT_DIRECTIONAL => {
                let direction = Vec3::from(record.direction).as_dvec3();
                LightShape::afar(faces.dot(direction.abs()))
            }
            // In by both faces across an axis.
            LIGHT_ENVIRONMENT => LightShape::afar(2.0 * faces.element_sum()),
            _ => LightShape::at(position_in_world),
        }
    }

    fn set_power(&mut self, record: usize, power: [f64; 3], boost: f64) {
        let power = power.map(|channel| {
            if channel.is_finite() {
                channel.max(0.0)
            } else {
                0.0
            }
        });
        self.powers[record] = power;
        self.weights[record] = power.iter().sum::<f64>() / 3.0 * boost;
    }

    /// Sums the powers up and makes the table of picks from them: time in proportion to all lights.
    fn pick_anew(&mut self) {
        self.total_power = [0.0; 3];
        for power in &self.powers {
            for (total, channel) in self.total_power.iter_mut().zip(power) {
                *total += channel;
            }
        }
        let (alias, chances) = alias_table(&self.chances());
        for (record, chance) in self.records.iter_mut().zip(chances) {
            record.pick_pdf = chance as f32;
        }
        self.alias = alias;
    }

    /// How likely each light is to be picked: by its weight, but that lamps in a house have a chance beside the sun over a landscape.
    fn chances(&self) -> Vec<f64> {
        let mut chances = chances(&self.weights);
        let lights = || self.records.iter().map(|record| is_afar(record.kind));
        let afar: f64 = lights()
            .zip(&chances)
            .filter_map(|(is_afar, chance)| is_afar.then_some(chance))
            .sum();
        if afar > 0.0 && afar < 1.0 {
            let wanted = afar.clamp(LEAST_CHANCE_OF_KIND, 1.0 - LEAST_CHANCE_OF_KIND);
            let [from_afar, near] = [wanted / afar, (1.0 - wanted) / (1.0 - afar)];
            for (is_afar, chance) in lights().zip(&mut chances) {
                *chance *= if is_afar { from_afar } else { near };
            }
        }
        chances
    }
}

/// A box around the scene, along the axes of the world.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SceneBox {
    /// Its middle, world space.
    pub center: DVec3,
    /// Half its edges, m.
    pub half_size: DVec3,
}

impl SceneBox {
    /// Around `bounds` (world space), with a margin; of nothing it is a point.
    fn around(bounds: Option<Bounds>, origin_in_world: DVec3) -> Self {
        bounds.map_or(
            Self {
                center: origin_in_world,
                half_size: DVec3::ZERO,
            },
            |bounds| {
                let half_size = 0.5 * bounds.size();
                Self {
                    center: bounds.center(),
                    half_size: half_size + BOX_MARGIN * half_size.length(),
                }
            },
        )
    }

    /// Areas of its faces across x, y and z, m^2.
    fn faces(&self) -> [f64; 3] {
        let DVec3 { x, y, z } = 2.0 * self.half_size;
        [y * z, z * x, x * y]
    }

    /// The record of a light from afar that shines through it.
    fn shone_through(&self, record: Light) -> Light {
        let [x, y, z] = self.half_size.as_vec3().to_array();
        Light {
            half_box_x: x,
            spot_scale: y,
            spot_offset: z,
            ..record
        }
    }
}

impl PackedLights {
    fn push_punctual(&mut self, scene: &Scene) {
        for placed in scene.light_instances() {
            let Some(light) = scene.lights.get(placed.light) else {
                continue;
            };
            let intensity = light.intensity.map(f64::from);
            let mut record = Light {
                direction: direction_of(&placed.world_from_light),
                radiance: light.intensity,
                ..Light::default()
            };
            let mut position = placed.world_from_light.translation;
            let power = match light.kind {
                LightKind::Point if self.kinds.points => {
                    record.kind = LIGHT_POINT;
                    intensity.map(|intensity| 4.0 * PI * intensity)
                }
                LightKind::Spot {
                    inner_cone_rad,
                    outer_cone_rad,
                } if self.kinds.spots => {
                    let (scale, offset) = spot_falloff(inner_cone_rad, outer_cone_rad);
                    record.kind = LIGHT_SPOT;
                    record.spot_scale = scale as f32;
                    record.spot_offset = offset as f32;
                    intensity.map(|intensity| intensity * spot_solid_angle(scale, offset))
                }
                LightKind::Directional if self.kinds.directionals => {
                    record = self.scene_box.shone_through(Light {
                        kind: LIGHT_DIRECTIONAL,
                        ..record
                    });
                    position = self.scene_box.center;
                    self.power_from_afar(&record)
                }
                _ => continue,
            };
            self.positions_in_world.push(position);
            self.nodes.push(placed.node);
            let shape = self.shape_of(&record, position);
            self.push(power, 1.0, record, shape);
        }
    }
}

/// A punctual light shines along its node's -Z.
fn direction_of(world_from_light: &DAffine3) -> [f32; 3] {
    let along = world_from_light.matrix3 * DVec3::NEG_Z;
    along.normalize_or(DVec3::NEG_Z).as_vec3().to_array()
}

/// Scale and offset of a spot's falloff, clamp(cos theta * scale + offset, 0, 1)^2, as KHR_lights_punctual recommends.
pub fn spot_falloff(inner_cone_rad: f32, outer_cone_rad: f32) -> (f64, f64) {
    let cos_outer = f64::from(outer_cone_rad).cos();
    let scale = 1.0 / (f64::from(inner_cone_rad).cos() - cos_outer).max(LEAST_RAMP);
    (scale, -cos_outer * scale)
}

/// Integral of a spot's falloff over the sphere, sr: power per intensity.
pub fn spot_solid_angle(scale: f64, offset: f64) -> f64 {
    let width = 1.0 / scale;
    let cos_outer = -offset * width;
    let ramp_end = ((1.0 - cos_outer) * scale).min(1.0);
    2.0 * PI * (ramp_end.powi(3) * width / 3.0 + (1.0 - cos_outer - width).max(0.0))
}

#[cfg(test)]
mod tests;
