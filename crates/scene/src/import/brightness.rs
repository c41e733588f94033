//! Light that is brighter than the renderer can count: it works in f32.

use std::f64::consts::PI;

use super::super::{LightKind, Scene};
use super::Notes;

/// The greatest power that is rendered right, W. A photon or a sample of a light carries its power over the chance that it is
/// picked, over a distance squared; this leaves room for a chance of 1e-4 and a centimetre.
const MOST_POWER_W: f64 = 1e30;

/// Warns of lights whose power, alone or together, is more than f32 can carry.
pub fn check(scene: &Scene, notes: &mut Notes) {
    let mut total = 0.0;
    let mut beyond = 0_usize;
    let mut add = |power: f64| {
        beyond += usize::from(power > MOST_POWER_W);
        total += power;
    };
    for placed in scene.light_instances() {
        let light = &scene.lights[placed.light];
        let most = light.intensity.into_iter().fold(0.0, f32::max);
        let solid_angle = match light.kind {
            LightKind::Directional => PI,
            LightKind::Point | LightKind::Spot { .. } => 4.0 * PI,
        };
        add(f64::from(most) * solid_angle);
    }
    let emission: Vec<f64> = scene
        .materials
        .iter()
        .map(|material| f64::from(material.emission.into_iter().fold(0.0, f32::max)))
        .collect();
    let glow: Vec<f64> = scene
        .meshes
        .iter()
        .map(|mesh| glow_of(&emission, mesh))
        .collect();
    for placed in scene.instances() {
        if glow[placed.mesh] > 0.0 {
            let growth = placed
                .world_from_object
                .matrix3
                .determinant()
                .abs()
                .powf(2.0 / 3.0);
            add(glow[placed.mesh] * growth);
        }
    }
    notes.source.too_bright_lights = beyond;
    if total > MOST_POWER_W {
        notes.warn(format_args!(
            "the lights shine with {total:.1e} W ({beyond} of them with more than {MOST_POWER_W:e} W each), more than can be \
             rendered: pixels may be black or wrong; scale emission and intensities down"
        ));
    }
}

/// Power of a mesh's emissive triangles in object space, W, by the materials' emission.
fn glow_of(emission: &[f64], mesh: &super::super::Mesh) -> f64 {
    let triangles = mesh.triangles.iter();
    triangles
        .map(|triangle| {
            let most = emission
                .get(triangle.material as usize)
                .copied()
                .unwrap_or_default();
            if most == 0.0 {
                return 0.0;
            }
            let [a, b, c] = mesh.corners(triangle);
            most * PI * 0.5 * (b - a).cross(c - a).length()
        })
        .sum()
}
