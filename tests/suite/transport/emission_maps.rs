//! Photons from triangles with a map of emission (`emission_place` in `shaders/shared/lights.wesl`).

use glam::DVec3;
use stereolux::frame::MapKind;
use stereolux::gpu::ShaderLibrary;
use stereolux::scene::{Image, Material, Scene, Texture, TextureRef};
use stereolux::settings::Eyes;

use super::hard_support::{add, direct_from_map, glowing, looking_ahead, quad};
use super::support::{frame, renderer_by};
use crate::suite::frame::layout::changed;

const PATHS: u32 = 1 << 15;
const EMISSION: f32 = 3.0;
/// Columns of the map, of which one shines.
const COLUMNS: u32 = 8;

/// A lamp of one square metre, close above a plate that catches all its light but a ten-thousandth.
fn scene() -> Scene {
    let square = |half_m: f64, z: f64, y: DVec3| {
        let corner = DVec3::new(-half_m, 0.0, z) - half_m * y;
        quad(corner, 2.0 * half_m * DVec3::X, 2.0 * half_m * y)
    };
    let mut shining = glowing([EMISSION; 3]);
    shining.emissive_texture = Some(TextureRef::plain(0));
    let texel = |i| if i == 3 { [255; 4] } else { [0, 0, 0, 255] };
    let mut scene = Scene {
        images: vec![Image {
            name: "map".to_owned(),
            width: COLUMNS,
            height: 1,
            rgba8: (0..COLUMNS).flat_map(texel).collect(),
        }],
        textures: vec![Texture::default()],
        ..Scene::default()
    };
    let plate = Material::lambert("plate", [0.5; 3]);
    add(&mut scene, &square(5.0, -0.05, DVec3::Y), plate);
    add(&mut scene, &square(0.5, 0.0, DVec3::NEG_Y), shining);
    let [a, b, c, d] = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
    scene.meshes[1].uv0 = vec![a, b, c, a, c, d];
    scene
}

/// Power of each photon that lands.
fn landed(library: &ShaderLibrary) -> Vec<f64> {
    let mut settings = direct_from_map(PATHS);
    settings.photon.edge_correction = false;
    let mut renderer = renderer_by(library, &scene(), &settings, Eyes::Left, [8; 2]).unwrap();
    frame(&mut renderer, &looking_ahead(DVec3::Z, 45.0));
    let photons = renderer.read_photons(MapKind::Photons).unwrap().unwrap();
    photons.iter().map(|p| f64::from(p.flux[0])).collect()
}

/// Mean power of a path over the lamp's, which is pi times its radiance and area, and the standard error.
fn power(landed: &[f64]) -> (f64, f64) {
    let expected = std::f64::consts::PI * f64::from(EMISSION) / f64::from(COLUMNS);
    let paths = f64::from(PATHS);
    let mean = landed.iter().sum::<f64>() / paths;
    let square = landed.iter().map(|flux| flux * flux).sum::<f64>() / paths;
    (
        mean / expected,
        ((square - mean * mean) / paths).sqrt() / expected,
    )
}

#[test]
fn maps_emit_photons_where_they_shine_and_as_much_light() {
    let found = landed(&ShaderLibrary::embedded());
    // Of eight places one at least shines: for independent ones 1 - (7 / 8)^8 = 0.66, one place alone 0.125.
    let share = found.len() as f64 / f64::from(PATHS);
    assert!(share > 0.66, "{share} of the paths carry light");
    let (mean, error) = power(&found);
    let what = format!("{mean} +- {error} of the lamp's power");
    println!("{share}, {what}");
    assert!((mean - 1.0).abs() < 5.0 * error + 1e-4, "{what}");
    assert!(error < 0.01, "{what}");
    // Photons that carry what their own place shines are too bright.
    let weight = "mean / shines[chosen]";
    let unweighed = changed("shared/lights", weight, "1.0");
    let (wrong, error) = power(&landed(&unweighed));
    assert!(wrong - 1.0 > 10.0 * error, "{wrong} +- {error}");
}
