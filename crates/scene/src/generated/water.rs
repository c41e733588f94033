//! `builtin:water`: a pond between banks, whose ground and posts are seen through its surface.

use glam::{DVec2, DVec3, IVec2};

use super::super::SceneError;
use super::glb::{Glb, body, lambert};
use super::noise::{fractal, hash, smooth};
use super::surface::Surface;

/// Index of refraction and roughness of the 2024 thesis' water.
const IOR: f64 = 1.2;
const ROUGHNESS: f64 = 0.01;
/// Where the water meets its bank, on average, from the middle.
const SHORE_M: f64 = 5.5;
const WAVES: i32 = 28;

/// Height of the ground over the water's level.
fn ground_m(at: DVec2) -> f64 {
    let from_middle = at.length() + 1.1 * fractal(at / 7.0, 4, 0.5, 31);
    let bank = smooth(SHORE_M - 4.0, SHORE_M, from_middle);
    let rise = 0.45 * smooth(SHORE_M, SHORE_M + 2.5, from_middle)
        + 2.2 * smooth(SHORE_M + 3.5, SHORE_M + 8.0, from_middle);
    let uneven = 0.12 * fractal(at / 2.4, 5, 0.5, 32) + rise * 0.5 * fractal(at / 9.0, 5, 0.5, 33);
    -1.1 + 1.1 * bank + rise + uneven
}

/// Height of the water over its level: waves of 0.25 to 2 m in directions that spread around the wind's.
fn wave_m(at: DVec2) -> f64 {
    let wave = |index: i32| {
        let random = |seed| hash(IVec2::new(index, 7), seed);
        let length_m = 0.25 * 8_f64.powf(random(1));
        let along = DVec2::from_angle(0.6 + 2.2 * (random(2) - 0.5));
        let phase = std::f64::consts::TAU * (along.dot(at) / length_m + random(3));
        0.0012 * length_m * phase.sin()
    };
    (0..WAVES).map(wave).sum()
}

fn ground_color(at: DVec3, normal: DVec3) -> DVec3 {
    const SAND: DVec3 = DVec3::new(0.42, 0.34, 0.22);
    const MUD: DVec3 = DVec3::new(0.2, 0.16, 0.1);
    const GRASS: DVec3 = DVec3::new(0.06, 0.085, 0.028);
    let place = DVec2::new(at.x, at.z);
    let patches = fractal(place / 1.3, 6, 0.6, 34);
    let shore = MUD.lerp(
        SAND,
        smooth(-0.5, 0.4, patches + 0.3 * fractal(place / 0.16, 3, 0.6, 35)),
    );
    let grass = GRASS * (1.0 + 0.6 * fractal(place / 0.4, 5, 0.7, 36));
    shore.lerp(
        grass,
        smooth(0.16, 0.4, at.y + 0.14 * patches) * smooth(0.5, 0.8, normal.y),
    )
}

/// A stone of a radius, half buried at a place.
fn stone(index: i32, at: DVec2, radius_m: f64, levels: u32) -> Surface {
    let random = |seed| hash(IVec2::new(index, 13), seed);
    let shape = DVec3::new(
        0.8 + 0.5 * random(4),
        0.55 + 0.3 * random(5),
        0.8 + 0.5 * random(6),
    );
    let center = DVec3::new(at.x, ground_m(at) + 0.15 * radius_m, at.y);
    let seed = 100 + index as u32;
    let stone = Surface::sphere(levels).displaced(|p| {
        let rough = fractal(
            DVec2::new(p.x + 0.7 * p.y, p.z - 0.6 * p.y) * 1.3,
            4,
            0.5,
            seed,
        );
        center + p * shape * radius_m * (1.0 + 0.35 * rough)
    });
    let tone = 0.1 + 0.45 * random(8);
    let warm = DVec3::new(1.0, 0.93 - 0.1 * random(9), 0.85 - 0.2 * random(9));
    stone.colored(|at, _| {
        warm * tone
            * (1.0
                + 0.35
                    * fractal(
                        DVec2::new(at.x + at.y, at.z - at.y) / (0.2 * radius_m),
                        3,
                        0.6,
                        seed,
                    ))
    })
}

fn stones() -> Surface {
    let pebbles = (0..420).map(|index| {
        let random = |seed| hash(IVec2::new(index, 17), seed);
        let at = DVec2::from_angle(std::f64::consts::TAU * random(1))
            * (SHORE_M + 1.0)
            * random(2).sqrt();
        stone(index, at, 0.05 + 0.16 * random(3).powi(3), 3)
    });
    let boulders = [
        [-1.9, 1.6, 0.5],
        [-2.6, 0.8, 0.33],
        [2.4, -1.2, 0.6],
        [3.1, -1.9, 0.4],
        [0.3, 3.4, 0.24],
    ];
    let boulders = (1000..)
        .zip(boulders)
        .map(|(index, [x, z, radius_m])| stone(index, DVec2::new(x, z), radius_m, 5));
    pebbles
        .chain(boulders)
        .fold(Surface::default(), Surface::joined)
}

/// Posts of an old landing stage, a little aslant: refraction breaks them at the surface.
fn posts() -> Surface {
    let post = |index: i32| {
        let random = |seed| hash(IVec2::new(index, 23), seed);
        let pair = f64::from(index / 2);
        let foot = DVec2::new(
            1.0 + 0.6 * pair,
            1.6 - 1.2 * pair + 0.8 * f64::from(index % 2),
        );
        let lean = DVec2::new(random(1) - 0.5, random(2) - 0.5) * 0.16;
        let top_m = 0.75 + 0.3 * random(3);
        let profile = [(0.085, -2.0), (0.085, top_m), (0.0, top_m + 0.012)]
            .map(|(radius, height)| DVec2::new(radius, height));
        let rings: Vec<DVec2> = (0..=40)
            .map(|ring| {
                let share = f64::from(ring) / 40.0;
                profile[0].lerp(profile[1], share)
            })
            .chain([
                profile[1] * DVec2::new(0.96, 1.0) + DVec2::Y * 0.01,
                profile[2],
            ])
            .collect();
        Surface::lathe(&rings, 36).displaced(|p| {
            let grain = 1.0
                + 0.06
                    * fractal(
                        DVec2::new(p.z.atan2(p.x) * 3.0, p.y * 0.8),
                        4,
                        0.6,
                        60 + index as u32,
                    );
            DVec3::new(
                p.x * grain + foot.x + lean.x * p.y,
                p.y,
                p.z * grain + foot.y + lean.y * p.y,
            )
        })
    };
    let posts = (0..6).map(post).fold(Surface::default(), Surface::joined);
    posts.colored(|at, _| {
        let grain = fractal(DVec2::new((at.x + at.z) * 30.0, at.y * 2.0), 4, 0.6, 70);
        let dry = DVec3::new(0.26, 0.19, 0.13) * (1.0 + 0.45 * grain);
        dry.lerp(DVec3::new(0.07, 0.075, 0.04), smooth(0.12, -0.05, at.y))
    })
}

/// The binary glTF.
///
/// # Errors
/// As [`Glb::finish`].
pub fn water() -> Result<Vec<u8>, SceneError> {
    let mut glb = Glb::default();
    let ground = Surface::height_field(320, 30.0, ground_m).colored(ground_color);
    glb.add("ground", &ground, lambert([1.0; 3]));
    glb.add("stones", &stones(), lambert([1.0; 3]));
    glb.add("posts", &posts(), lambert([1.0; 3]));
    let water = Surface::height_field(440, 2.0 * SHORE_M + 4.0, wave_m);
    glb.add(
        "water",
        &water,
        body(IOR, ROUGHNESS, 3.0, [0.6, 0.84, 0.78]),
    );
    glb.camera(DVec3::new(0.2, 1.6, 4.9), DVec3::new(0.35, 0.0, 1.9), 60.0);
    glb.finish()
}
