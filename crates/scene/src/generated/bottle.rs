//! `builtin:bottle`: a glass bottle on a table. Its wall is thin, so that its caustic is a pattern of light within its shadow.

use glam::{DVec2, DVec3};
use serde_json::json;

use super::super::SceneError;
use super::glb::{Glb, body, lambert};
use super::noise::fractal;
use super::surface::Surface;

const SEGMENTS: u32 = 96;
/// The outside from the middle of the bottom over the rim, then down the inside to the middle again: (radius, height), metres.
#[rustfmt::skip]
const PROFILE: [[f64; 2]; 43] = [
    [0.0, 0.012], [0.012, 0.0115], [0.022, 0.008], [0.0275, 0.0025], [0.031, 0.0005], [0.034, 0.0001], [0.0365, 0.0012],
    [0.0375, 0.005], [0.0378, 0.02], [0.0378, 0.06], [0.0378, 0.12], [0.0378, 0.165], [0.0372, 0.178], [0.0345, 0.19],
    [0.0285, 0.202], [0.021, 0.214], [0.0162, 0.226], [0.0145, 0.24], [0.014, 0.27], [0.014, 0.288], [0.0158, 0.2895],
    [0.0162, 0.295], [0.0158, 0.3], [0.0145, 0.3012], [0.012, 0.3008], [0.0105, 0.297], [0.0105, 0.27], [0.011, 0.24],
    [0.013, 0.225], [0.0178, 0.212], [0.025, 0.2], [0.031, 0.188], [0.0337, 0.1765], [0.0343, 0.165], [0.0343, 0.12],
    [0.0343, 0.06], [0.0343, 0.012], [0.0335, 0.0062], [0.0315, 0.0046], [0.027, 0.0062], [0.0215, 0.0115], [0.012, 0.015],
    [0.0, 0.0155],
];

/// The glass: one closed surface.
fn glass() -> Surface {
    Surface::lathe(&PROFILE.map(DVec2::from), SEGMENTS)
}

fn wood(at: DVec3) -> DVec3 {
    let board = (at.x / 0.14).floor();
    let grain = fractal(
        DVec2::new(
            at.x * 55.0 + 9.0 * fractal(DVec2::new(at.x * 5.0, at.z * 2.0), 3, 0.5, 81),
            at.z * 2.2 + 31.0 * board,
        ),
        5,
        0.55,
        82,
    );
    let tone = 1.0 + 0.28 * grain + 0.12 * fractal(DVec2::new(board * 3.7, 0.5), 1, 0.5, 83);
    let gap = 1.0 - 0.75 * f64::from(u8::from((at.x / 0.14 - board - 0.5).abs() > 0.49));
    DVec3::new(0.36, 0.22, 0.12) * tone * gap
}

/// The binary glTF.
///
/// # Errors
/// As [`Glb::finish`].
pub fn bottle() -> Result<Vec<u8>, SceneError> {
    let mut glb = Glb::default();
    let table = Surface::height_field(400, 1.6, |_| 0.0).colored(|at, _| wood(at));
    glb.add("table", &table, lambert([1.0; 3]));
    let wall = Surface::rectangle(DVec3::new(-1.6, -0.4, -0.8), DVec3::X * 3.2, DVec3::Y * 2.0);
    glb.add("wall", &wall, lambert([0.55, 0.56, 0.58]));
    glb.add(
        "bottle",
        &glass(),
        body(1.52, 0.0, 0.02, [0.62, 0.86, 0.66]),
    );
    let lemon = Surface::sphere(5).displaced(|p| {
        let tip = 1.0 + 0.22 * p.x.abs().powi(8);
        let skin = 1.0 + 0.012 * fractal(DVec2::new(p.y.atan2(p.z) * 9.0, p.x * 14.0), 3, 0.6, 84);
        DVec3::new(
            p.x * 0.042 * tip,
            p.y * 0.031 * skin + 0.0305,
            p.z * 0.031 * skin,
        )
    });
    let turned =
        lemon.displaced(|p| glam::DQuat::from_rotation_y(0.7) * p + DVec3::new(0.105, 0.0, 0.05));
    let skin = json!({ "pbrMetallicRoughness": { "baseColorFactor": [0.82, 0.6, 0.06, 1.0], "metallicFactor": 0.0, "roughnessFactor": 0.45 } });
    glb.add("lemon", &turned, skin);
    // A small lamp in front on the left, that casts the caustic, and a wide one above.
    let lamp = |emission: f64| {
        let mut lamp = lambert([0.0; 3]);
        lamp["emissiveFactor"] = json!([1.0, 0.93, 0.82]);
        lamp["extensions"]["KHR_materials_emissive_strength"] =
            json!({ "emissiveStrength": emission });
        lamp
    };
    let small = Surface::rectangle(
        DVec3::new(-0.62, 0.5, 0.3),
        DVec3::new(0.05, 0.0, 0.075),
        DVec3::new(0.04, 0.08, -0.02),
    );
    glb.add(
        "small lamp",
        &facing(small, DVec3::new(0.0, 0.1, 0.0)),
        lamp(190.0),
    );
    let wide = Surface::rectangle(DVec3::new(-0.6, 1.5, -0.2), DVec3::X * 1.2, DVec3::Z * 1.0);
    glb.add("wide lamp", &facing(wide, DVec3::ZERO), lamp(1.1));
    glb.camera(
        DVec3::new(0.04, 0.25, 0.38),
        DVec3::new(0.04, 0.12, 0.0),
        50.0,
    );
    glb.finish()
}

/// Turns a rectangle's front to a point.
fn facing(mut surface: Surface, point: DVec3) -> Surface {
    if surface.normals[0].dot(point - surface.positions[0]) < 0.0 {
        surface
            .normals
            .iter_mut()
            .for_each(|normal| *normal = -*normal);
        surface
            .triangles
            .iter_mut()
            .for_each(|corners| corners.swap(1, 2));
    }
    surface
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_glass_has_the_volume_of_its_profile() {
        let glass = glass();
        let corner = |index: u32| glass.positions[index as usize];
        let volume = glass.triangles.iter().map(|corners| {
            let [a, b, c] = corners.map(corner);
            a.dot(b.cross(c)) / 6.0
        });
        // Frusta over regular polygons, whose area is this many squares of the radius; what goes down is taken away.
        let segments = f64::from(SEGMENTS);
        let area = 0.5 * segments * (std::f64::consts::TAU / segments).sin();
        let frusta = PROFILE.windows(2).map(|ends| {
            let [[r, low], [s, high]] = [ends[0], ends[1]];
            area * (high - low) * (r * r + r * s + s * s) / 3.0
        });
        let (volume, expected): (f64, f64) = (volume.sum(), frusta.sum());
        assert!(expected > 1e-4, "{expected} m^3");
        assert!(
            (volume / expected - 1.0).abs() < 1e-9,
            "{volume} of {expected} m^3"
        );
    }
}
