//! What stands and hangs in the gallery: paintings, the end wall with its curtains, the exhibits and their spotlights.

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use glam::{DAffine3, DQuat, DVec2, DVec3};
use stereolux_scene::{LightKind, PunctualLight};

use super::super::glb_writer::{GlbWriter, Payload};
use super::super::shapes::{ArchedPanel, Shape};
use super::{BAY_Z, HALF_LENGTH, HALF_WIDTH, HEIGHT, Palette, place, place_parts};

/// Three paintings in gilt frames on the right wall.
pub(super) fn paintings(glb: &mut GlbWriter, palette: &Palette) {
    for ((z, (width, height)), (material, name)) in BAY_Z
        .into_iter()
        .zip([(1.7, 1.275), (1.7, 1.275), (1.4, 1.4)])
        .zip(
            palette
                .paintings
                .into_iter()
                .zip(["hills", "dusk", "circles"]),
        )
    {
        let canvas = Shape::quad(
            [-width / 2.0, -height / 2.0, 0.03],
            DVec3::X * width,
            DVec3::Y * height,
        );
        let mesh = glb.mesh(
            name,
            &[
                canvas.part(material),
                frame(width, height).plain_part(palette.gilt),
            ],
        );
        // The front looks along -X, into the hall.
        place(glb, name, mesh, [HALF_WIDTH, 1.75, z], -FRAC_PI_2);
    }
}

/// A mitred frame around a canvas in the plane z = 0: a moulding of five slopes, swept along the four sides.
fn frame(width: f64, height: f64) -> Shape {
    // (distance outward from the canvas' edge, height over the wall)
    let profile = [
        (-0.02, 0.032),
        (0.0, 0.05),
        (0.03, 0.045),
        (0.06, 0.085),
        (0.10, 0.09),
        (0.125, 0.06),
        (0.13, 0.0),
    ];
    let corner = |index: usize, outward: f64| {
        let (sx, sy) = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)][index % 4];
        DVec2::new(sx * (width / 2.0 + outward), sy * (height / 2.0 + outward))
    };
    let mut frame = Shape::default();
    for side in 0..4 {
        for pair in profile.windows(2) {
            let [inner, outer] = [pair[0], pair[1]];
            let at =
                |index: usize, (outward, rise): (f64, f64)| corner(index, outward).extend(rise);
            let corners = [
                at(side, inner),
                at(side, outer),
                at(side + 1, outer),
                at(side + 1, inner),
            ];
            let center = corners.iter().sum::<DVec3>() / 4.0;
            // Away from the middle of the moulding's own cross-section.
            let core = (corner(side, 0.055) + corner(side + 1, 0.055)) / 2.0;
            frame.append(Shape::quadrangle_facing(
                corners,
                2.0 * center - core.extend(0.02),
            ));
        }
    }
    frame
}

/// The far wall, blue, with a niche for the great vase and curtains on either side.
pub(super) fn end_wall(glb: &mut GlbWriter, palette: &Palette) {
    let panel = ArchedPanel {
        half_width: HALF_WIDTH,
        height: HEIGHT,
        opening_half_width: 0.85,
        sill: Some(0.0),
        spring: 2.2,
        depth: 0.7,
        segments: 32,
    };
    let z = DVec3::Z * -HALF_LENGTH;
    let wall = Shape::arched_panel(&panel).transformed(DAffine3::from_translation(z));
    let niche = Shape::quad(
        DVec3::new(-0.9, 0.0, -0.7) + z,
        DVec3::X * 1.8,
        DVec3::Y * 3.2,
    );
    let step = Shape::quad(
        DVec3::new(-0.9, 0.0, 0.0) + z,
        DVec3::X * 1.8,
        DVec3::Z * -0.7,
    );
    place_parts(
        glb,
        "end wall",
        &[
            wall.plain_part(palette.end_wall),
            niche.plain_part(palette.plaster),
            step.plain_part(palette.stone),
        ],
    );
    // A gilt band around the niche.
    let band = Shape::parametric(32, 8, |u, v| {
        let (angle, around) = (PI * (1.0 - u), PI * v);
        let radius = 0.93 - 0.07 * around.cos();
        DVec3::new(
            radius * angle.cos(),
            2.2 + radius * angle.sin(),
            0.04 * around.sin(),
        ) + z
    });
    let mut trim = band;
    for side in [-1.0, 1.0] {
        let x = side * 0.93;
        trim.append(Shape::beveled_box(
            DVec3::new(x - 0.07, 0.0, -0.02) + z,
            DVec3::new(x + 0.07, 2.2, 0.04) + z,
            0.02,
        ));
    }
    place_parts(glb, "niche band", &[trim.plain_part(palette.gilt)]);

    // Curtains: folds that gather towards the top, hung from a rod.
    let curtain = Shape::parametric(72, 10, |u, v| {
        let fold = (TAU * 6.0 * u + 0.6 * (3.0 * PI * v).sin()).sin();
        let depth = 0.055 + 0.045 * (1.0 - v);
        let flare = 1.0 + 0.10 * (1.0 - v) * (1.0 - v);
        DVec3::new((u - 0.5) * 0.95 * flare, 0.03 + 3.17 * v, depth * fold)
    });
    let curtain = glb.mesh("curtain", &[curtain.plain_part(palette.velvet)]);
    let rod_profile = [
        DVec2::new(0.0, -0.7),
        DVec2::new(0.035, -0.68),
        DVec2::new(0.02, -0.64),
        DVec2::new(0.02, 0.64),
        DVec2::new(0.035, 0.68),
        DVec2::new(0.0, 0.7),
    ];
    let rod = glb.mesh(
        "rod",
        &[Shape::lathe(&rod_profile, 16, |_| 1.0).plain_part(palette.gilt)],
    );
    for side in [-1.0, 1.0] {
        let x = side * 1.62;
        place(glb, "curtain", curtain, [x, 0.0, -HALF_LENGTH + 0.2], 0.0);
        let pose = DAffine3::from_rotation_translation(
            DQuat::from_rotation_z(FRAC_PI_2),
            DVec3::new(x, 3.23, -HALF_LENGTH + 0.2),
        );
        glb.node("rod", pose, Payload::Mesh(rod));
    }
}

/// Plinths with the spheres, the vase in the niche, benches and the carpet.
pub(super) fn exhibits(glb: &mut GlbWriter, palette: &Palette) {
    spheres(glb, palette);
    vase(glb, palette);
    benches(glb, palette);
    carpet(glb, palette)
}

fn spheres(glb: &mut GlbWriter, palette: &Palette) {
    let mut plinth = Shape::beveled_box([-0.34, 0.0, -0.34], [0.34, 0.12, 0.34], 0.02);
    plinth.append(Shape::beveled_box(
        [-0.28, 0.12, -0.28],
        [0.28, 0.86, 0.28],
        0.015,
    ));
    plinth.append(Shape::beveled_box(
        [-0.33, 0.86, -0.33],
        [0.33, 0.94, 0.33],
        0.02,
    ));
    let plinth = glb.mesh("plinth", &[plinth.plain_part(palette.trim)]);
    let radius = 0.3;
    for (name, material, x, z) in [
        ("mirror sphere", palette.mirror, -1.05, 0.1),
        ("glass sphere", palette.glass, 1.05, 0.9),
    ] {
        place(glb, "plinth", plinth, [x, 0.0, z], 0.0);
        let sphere = glb.mesh(name, &[Shape::icosphere(radius, 4).plain_part(material)]);
        // A hair above the plinth: touching surfaces would leave light between them.
        place(glb, name, sphere, [x, 0.945 + radius, z], 0.0);
    }
}

fn vase(glb: &mut GlbWriter, palette: &Palette) {
    let vase: Vec<DVec2> = [
        (0.0, 0.0),
        (0.20, 0.0),
        (0.21, 0.03),
        (0.15, 0.08),
        (0.13, 0.14),
        (0.20, 0.26),
        (0.29, 0.42),
        (0.335, 0.60),
        (0.335, 0.76),
        (0.29, 0.92),
        (0.20, 1.04),
        (0.135, 1.12),
        (0.12, 1.20),
        (0.145, 1.28),
        (0.20, 1.33),
        (0.205, 1.35),
        (0.19, 1.35),
        (0.12, 1.26),
        (0.0, 1.2),
    ]
    .map(|(radius, height)| DVec2::new(radius, height))
    .to_vec();
    let vase = glb.mesh(
        "vase",
        &[Shape::lathe(&vase, 48, |_| 1.0).plain_part(palette.clay)],
    );
    let drum = Shape::lathe(
        &[
            DVec2::new(0.42, 0.0),
            DVec2::new(0.42, 0.1),
            DVec2::new(0.36, 0.14),
            DVec2::new(0.36, 0.62),
            DVec2::new(0.42, 0.66),
            DVec2::new(0.42, 0.74),
            DVec2::new(0.0, 0.74),
        ],
        48,
        |_| 1.0,
    );
    let drum = glb.mesh("drum", &[drum.plain_part(palette.stone)]);
    place(glb, "drum", drum, [0.0, 0.0, -5.75], 0.0);
    place(glb, "vase", vase, [0.0, 0.742, -5.75], 0.0);
}

fn benches(glb: &mut GlbWriter, palette: &Palette) {
    let mut bench = Shape::beveled_box([-0.22, 0.40, -0.8], [0.22, 0.46, 0.8], 0.02);
    for (x, z) in [(-0.16, -0.68), (0.16, -0.68), (-0.16, 0.68), (0.16, 0.68)] {
        bench.append(Shape::beveled_box(
            [x - 0.035, 0.0, z - 0.035],
            [x + 0.035, 0.401, z + 0.035],
            0.008,
        ));
    }
    bench.append(Shape::beveled_box(
        [-0.15, 0.30, -0.66],
        [0.15, 0.36, 0.66],
        0.01,
    ));
    let cushion = Shape::beveled_box([-0.2, 0.461, -0.76], [0.2, 0.53, 0.76], 0.03);
    let bench = glb.mesh(
        "bench",
        &[
            bench.plain_part(palette.wood),
            cushion.plain_part(palette.velvet),
        ],
    );
    place(glb, "bench", bench, [3.2, 0.0, 0.0], 0.0);
    place(glb, "bench", bench, [-3.2, 0.0, -3.0], 0.0);
}

fn carpet(glb: &mut GlbWriter, palette: &Palette) {
    let (half_x, half_z, thickness) = (0.62, 4.9, 0.012);
    let mut top = Shape::quad(
        [-half_x, thickness, half_z],
        DVec3::X * 2.0 * half_x,
        DVec3::Z * -2.0 * half_z,
    );
    // v repeats so that the pattern keeps its proportions.
    top.uvs
        .iter_mut()
        .for_each(|uv| uv.y *= (half_z / half_x).round());
    let mut edges = Shape::default();
    for (corner, edge) in [
        (DVec3::new(-half_x, 0.0, half_z), DVec3::X * 2.0 * half_x),
        (DVec3::new(half_x, 0.0, half_z), DVec3::Z * -2.0 * half_z),
        (DVec3::new(half_x, 0.0, -half_z), DVec3::X * -2.0 * half_x),
        (DVec3::new(-half_x, 0.0, -half_z), DVec3::Z * 2.0 * half_z),
    ] {
        edges.append(Shape::quad(corner, edge, DVec3::Y * thickness));
    }
    place_parts(
        glb,
        "carpet",
        &[top.part(palette.carpet), edges.plain_part(palette.velvet)],
    )
}

/// Two spotlights from the cornices onto the spheres, and one into the niche.
pub(super) fn lights(glb: &mut GlbWriter) {
    let spots = [
        (
            "spot on the glass",
            [-1.9, 3.75, 1.4],
            [1.05, 1.25, 0.9],
            [60.0, 54.0, 44.0],
        ),
        (
            "spot on the mirror",
            [1.9, 3.75, -0.6],
            [-1.05, 1.25, 0.1],
            [26.0, 23.0, 18.0],
        ),
        (
            "spot on the vase",
            [0.0, 3.8, -3.6],
            [0.0, 1.3, -5.75],
            [36.0, 29.0, 19.0],
        ),
    ];
    for (name, from, to, intensity) in spots {
        let (from, to) = (DVec3::from_array(from), DVec3::from_array(to));
        let kind = LightKind::Spot {
            inner_cone_rad: 0.14,
            outer_cone_rad: 0.24,
        };
        let light = glb.light(&PunctualLight {
            name: name.to_owned(),
            kind,
            intensity,
        });
        // Lights shine along their -Z.
        let rotation = DQuat::from_rotation_arc(DVec3::NEG_Z, (to - from).normalize());
        glb.node(
            name,
            DAffine3::from_rotation_translation(rotation, from),
            Payload::Light(light),
        );
    }
}
