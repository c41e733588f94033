//! `builtin:terrain`: mountains of 1.7 million triangles.

use glam::{DVec2, DVec3};

use super::super::SceneError;
use super::glb::{Glb, lambert};
use super::noise::{fractal, ridged, smooth};
use super::surface::Surface;

/// Squares along each edge: 924^2 x 2 = 1,707,552 triangles.
const CELLS: u32 = 924;
const EDGE_M: f64 = 1400.0;

/// Height over the valley's ground.
fn height_m(at: DVec2) -> f64 {
    // Bends what follows, so that ridges run as water would have cut them.
    let bend = DVec2::new(
        fractal(at / 420.0, 3, 0.5, 11),
        fractal(at / 420.0, 3, 0.5, 12),
    );
    let bent = at + 90.0 * bend;
    let crests = ridged(bent / 520.0, 9, 0.48, 1);
    let hills = fractal(bent / 240.0, 8, 0.5, 2);
    // A valley from the viewer into the distance, and mountains behind its end.
    let aside = (bent.x - 60.0 * (at.y / 260.0).sin()).abs();
    let valley = 0.12 + 0.88 * smooth(20.0, 330.0, aside).max(smooth(150.0, 620.0, -at.y));
    valley * (300.0 * crests.powf(1.5) + 34.0 * hills) + 9.0 * fractal(at / 90.0, 7, 0.5, 3)
}

/// Grass where it is flat and low, scree, rock where it is steep, snow above.
fn color(at: DVec3, normal: DVec3) -> DVec3 {
    const GRASS: DVec3 = DVec3::new(0.05, 0.075, 0.024);
    const MEADOW: DVec3 = DVec3::new(0.115, 0.108, 0.045);
    const SCREE: DVec3 = DVec3::new(0.27, 0.24, 0.2);
    const ROCK: DVec3 = DVec3::new(0.19, 0.175, 0.165);
    const SNOW: DVec3 = DVec3::new(0.86, 0.88, 0.92);
    let place = DVec2::new(at.x, at.z);
    let patches = fractal(place / 55.0, 6, 0.55, 5);
    let height = at.y + 22.0 * patches;
    let meadow = GRASS.lerp(MEADOW, smooth(-0.4, 0.4, fractal(place / 17.0, 5, 0.6, 6)));
    let ground = meadow.lerp(SCREE, smooth(55.0, 95.0, height));
    let rock =
        ROCK * (1.0 + 0.5 * fractal(DVec2::new(at.y / 6.0, (at.x + at.z) / 60.0), 5, 0.6, 7));
    let steep = smooth(0.84, 0.7, normal.y + 0.06 * patches);
    let bare = ground.lerp(rock, steep);
    bare.lerp(
        SNOW,
        smooth(105.0, 135.0, height) * smooth(0.5, 0.68, normal.y + 0.05 * patches),
    )
}

/// The binary glTF.
///
/// # Errors
/// As [`Glb::finish`].
pub fn terrain() -> Result<Vec<u8>, SceneError> {
    let mut glb = Glb::default();
    let ground = Surface::height_field(CELLS, EDGE_M, height_m).colored(color);
    glb.add("terrain", &ground, lambert([1.0; 3]));
    let stand = DVec2::new(30.0, 560.0);
    let eye = DVec3::new(stand.x, height_m(stand) + 30.0, stand.y);
    glb.camera(eye, DVec3::new(0.0, eye.y - 12.0, 0.0), 55.0);
    glb.finish()
}
