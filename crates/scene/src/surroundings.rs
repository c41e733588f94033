//! Embedded environments: plain ones, made by a formula, for scenes that bring no light.

use std::f64::consts::{PI, TAU};
use std::path::Path;

use glam::{DVec2, DVec3};

use super::builtin::PREFIX;
use super::generated::{fractal, smooth};
use super::{Environment, SceneError};
use stereolux_base::printable::did_you_mean;

/// Names of all, for `environment.path=builtin:NAME`.
pub const NAMES: &[&str] = &["sky", "studio", "clouds"];

/// Columns; rows are half as many.
const COLUMNS: u32 = 512;

/// The embedded environment of a name, times `strength`.
///
/// # Errors
/// An unknown name; the message lists [`NAMES`].
pub(super) fn environment(name: &str, strength: f32) -> Result<Environment, SceneError> {
    let radiance: fn(DVec3) -> DVec3 = match name {
        "sky" => sky,
        "studio" => studio,
        "clouds" => clouds,
        _ => {
            let hint = did_you_mean(name, NAMES);
            let known = NAMES.join(", ");
            let reason = format!("no such embedded environment{hint}; the names are {known}");
            return Err(SceneError::invalid(
                Path::new(&format!("{PREFIX}{name}")),
                reason,
            ));
        }
    };
    let rows = COLUMNS / 2;
    let texels = (0..rows).flat_map(|row| (0..COLUMNS).map(move |column| (row, column)));
    let texels = texels.map(|(row, column)| {
        let elevation = PI * (0.5 - (f64::from(row) + 0.5) / f64::from(rows));
        let azimuth = TAU * ((f64::from(column) + 0.5) / f64::from(COLUMNS) - 0.5);
        let color = radiance(direction(azimuth, elevation)).as_vec3() * strength;
        color.to_array()
    });
    Ok(Environment {
        width: COLUMNS,
        height: rows,
        radiance: texels.collect(),
        name: format!("{PREFIX}{name}"),
    })
}

/// Azimuth from -Z towards +X, elevation towards +Y, radians.
fn direction(azimuth: f64, elevation: f64) -> DVec3 {
    let level = elevation.cos();
    DVec3::new(
        azimuth.sin() * level,
        elevation.sin(),
        -azimuth.cos() * level,
    )
}

/// Clear sky from the horizon to the zenith over grey-brown ground, and a sun a few degrees wide, from behind on the right,
/// that gives a surface facing it an irradiance of about 2.5.
fn sky(direction: DVec3) -> DVec3 {
    const HORIZON: DVec3 = DVec3::new(0.75, 0.85, 0.95);
    const ZENITH: DVec3 = DVec3::new(0.15, 0.32, 0.7);
    const GROUND: DVec3 = DVec3::new(0.2, 0.18, 0.16);
    const SUN: DVec3 = DVec3::new(1.0, 0.93, 0.8);
    const SUN_IRRADIANCE: f64 = 2.5;
    const SUN_RADIUS_DEG: f64 = 2.5;
    let above = HORIZON.lerp(ZENITH, direction.y.max(0.0).sqrt());
    let base = GROUND.lerp(above, smooth(-0.02, 0.02, direction.y));
    let to_sun = self::direction(140_f64.to_radians(), 45_f64.to_radians());
    let angle_deg = direction.angle_between(to_sun).to_degrees();
    let solid_angle_sr = TAU * (1.0 - SUN_RADIUS_DEG.to_radians().cos());
    // A soft rim, as wide to both sides.
    let disc = 1.0 - smooth(SUN_RADIUS_DEG - 0.5, SUN_RADIUS_DEG + 0.5, angle_deg);
    base + SUN * (SUN_IRRADIANCE / solid_angle_sr * disc)
}

/// The sky with clouds before it: a layer at one height, white where it faces the sun, grey below.
fn clouds(direction: DVec3) -> DVec3 {
    const SUNLIT: DVec3 = DVec3::new(1.5, 1.45, 1.4);
    const SHADED: DVec3 = DVec3::new(0.55, 0.6, 0.7);
    let clear = sky(direction);
    if direction.y <= 0.0 {
        return clear;
    }
    // Where the direction meets the layer, in its heights; the layer bends with the earth, so that it ends at the horizon.
    let at = DVec2::new(direction.x, direction.z) * (1.7 / (direction.y + 0.12));
    let thickness = fractal(at, 7, 0.55, 41) + 0.35 * fractal(at / 4.0, 2, 0.5, 42);
    let cover = smooth(0.02, 0.3, thickness) * smooth(0.0, 0.12, direction.y);
    // Thin towards the sun: it shines between them.
    let to_sun = self::direction(140_f64.to_radians(), 45_f64.to_radians());
    let away = smooth(8.0, 16.0, direction.angle_between(to_sun).to_degrees());
    let lit = SUNLIT.lerp(
        SHADED,
        smooth(0.15, 0.75, thickness + 0.25 * fractal(at * 2.0, 4, 0.6, 43)),
    );
    clear.lerp(lit, 0.95 * cover * away)
}

/// A grey room, brighter above, with three soft boxes: key on the right, fill on the left, rim opposite.
fn studio(direction: DVec3) -> DVec3 {
    // Azimuth and elevation of the middle and half of width and height, degrees; radiance.
    const BOXES: [([f64; 2], [f64; 2], f64); 3] = [
        ([140.0, 40.0], [25.0, 20.0], 4.0),
        ([-130.0, 15.0], [20.0, 30.0], 1.5),
        ([-20.0, 45.0], [30.0, 10.0], 2.5),
    ];
    const RIM_DEG: f64 = 2.0;
    let base = 0.2 + 0.15 * smooth(-0.5, 1.0, direction.y);
    let elevation_deg = direction.y.clamp(-1.0, 1.0).asin().to_degrees();
    let azimuth_deg = direction.x.atan2(-direction.z).to_degrees();
    let light = BOXES.iter().map(|([azimuth, elevation], half, radiance)| {
        let turn = (azimuth_deg - azimuth + 540.0).rem_euclid(360.0) - 180.0;
        let off = [
            turn.abs() - half[0],
            (elevation_deg - elevation).abs() - half[1],
        ];
        let inside = off.map(|off| 1.0 - smooth(-RIM_DEG, RIM_DEG, off));
        radiance * inside[0] * inside[1]
    });
    DVec3::splat(base + light.sum::<f64>())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Irradiance on a surface that faces `normal`, by the sum over texels.
    fn irradiance(map: &Environment, normal: DVec3) -> f64 {
        let (columns, rows) = (f64::from(map.width), f64::from(map.height));
        let texel = |index: usize| {
            let (row, column) = (index / map.width as usize, index % map.width as usize);
            let elevation = PI * (0.5 - (row as f64 + 0.5) / rows);
            let azimuth = TAU * ((column as f64 + 0.5) / columns - 0.5);
            let solid_angle_sr = TAU / columns * PI / rows * elevation.cos();
            let cosine = direction(azimuth, elevation).dot(normal).max(0.0);
            f64::from(map.radiance[index][1]) * cosine * solid_angle_sr
        };
        (0..map.radiance.len()).map(texel).sum()
    }

    #[test]
    fn white_surfaces_are_neither_black_nor_burnt() {
        for name in NAMES {
            let map = environment(name, 1.0).unwrap();
            assert_eq!(map.radiance.len(), (map.width * map.height) as usize);
            assert!(
                map.radiance
                    .iter()
                    .flatten()
                    .all(|c| c.is_finite() && *c > 0.0)
            );
            for normal in [DVec3::Y, DVec3::Z, DVec3::X, DVec3::NEG_X, DVec3::NEG_Y] {
                // What a white Lambert surface shows.
                let shown = irradiance(&map, normal) / PI;
                assert!((0.1..1.6).contains(&shown), "{name} {normal}: {shown}");
            }
            // Twice as strong is twice as bright.
            let twice = environment(name, 2.0).unwrap();
            assert_eq!(twice.radiance[100][2], 2.0 * map.radiance[100][2]);
        }
        assert!(
            environment("moon", 1.0)
                .unwrap_err()
                .to_string()
                .contains("sky, studio")
        );
    }

    #[test]
    fn the_columns_are_where_environments_have_them() {
        // Middle column -Z, three quarters +X, top row +Y.
        assert!((direction(0.0, 0.0) - DVec3::NEG_Z).length() < 1e-12);
        assert!((direction(PI / 2.0, 0.0) - DVec3::X).length() < 1e-12);
        assert!((direction(0.0, PI / 2.0) - DVec3::Y).length() < 1e-12);
        let map = environment("sky", 1.0).unwrap();
        let at = |column: u32, row: u32| map.radiance[(row * map.width + column) as usize];
        let (up, down) = (at(0, 0), at(0, map.height - 1));
        assert!(up[2] > up[0] && down[2] < down[0]);
        // The sun: 140 degrees right of -Z, 45 degrees up.
        let column = (map.width as f64 * (0.5 + 140.0 / 360.0)) as u32;
        assert!(at(column, map.height / 4)[0] > 100.0);
    }
}
