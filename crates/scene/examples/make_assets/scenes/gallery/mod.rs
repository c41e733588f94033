//! `builtin:gallery`: an interior worth looking at.
//!
//! A hall of 8 x 4.2 x 12 m, axes x (left to right), y (up) and z (towards the viewer), centred on the origin. Two
//! arcades of fluted columns part the nave from its aisles; skylights hang in the nave's ceiling between beams, arched
//! windows shine from the left, paintings in gilt frames hang on the right, curtains close the end wall around a vase. A
//! mirror sphere and a glass sphere stand on plinths in the nave; a spotlight draws the glass sphere's caustic.
//!
//! Columns, arches, windows, capitals and frames are instances of shared meshes. The head starts at 1.6 m.

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use glam::{DAffine3, DQuat, DVec2, DVec3};
use image::RgbImage;
use stereolux_scene::{Material, SceneError, TextureRef, Wrap};

use super::glb_writer::{GlbWriter, Part, Payload};
use super::paint;
use super::shapes::{ArchedPanel, Shape};

mod furnishings;

/// Half the width of the hall.
const HALF_WIDTH: f64 = 4.0;
/// Half the length of the hall.
const HALF_LENGTH: f64 = 6.0;
/// Height of the ceiling.
const HEIGHT: f64 = 4.2;
/// x of the columns' axes, on either side.
const COLUMN_X: f64 = 2.3;
/// z of the columns' axes.
const COLUMN_Z: [f64; 4] = [-4.5, -1.5, 1.5, 4.5];
/// Springing line of the arcades: top of the capitals.
const SPRING: f64 = 2.3;
/// z of the middle of each bay.
const BAY_Z: [f64; 3] = [-3.0, 0.0, 3.0];
/// Opening of the windows.
const WINDOW_HALF_WIDTH: f64 = 0.62;
const WINDOW_SILL: f64 = 0.95;
const WINDOW_SPRING: f64 = 2.35;
const WALL_DEPTH: f64 = 0.28;
/// Eye height and place of the camera.
const CAMERA: [f64; 3] = [0.55, 1.6, 5.35];

/// Materials by use.
struct Palette {
    plaster: u32,
    stone: u32,
    trim: u32,
    floor: u32,
    ceiling: u32,
    end_wall: u32,
    velvet: u32,
    gilt: u32,
    bronze: u32,
    wood: u32,
    mirror: u32,
    glass: u32,
    clay: u32,
    carpet: u32,
    paintings: [u32; 3],
    window_light: u32,
    sky_light: u32,
}

/// The binary glTF of the hall.
pub fn write() -> Result<Vec<u8>, SceneError> {
    let mut glb = GlbWriter::new();
    let palette = palette(&mut glb)?;
    hall(&mut glb, &palette);
    arcades(&mut glb, &palette);
    windows(&mut glb, &palette);
    furnishings::paintings(&mut glb, &palette);
    furnishings::end_wall(&mut glb, &palette);
    furnishings::exhibits(&mut glb, &palette);
    furnishings::lights(&mut glb);
    let camera = glb.camera("visitor", 1.2);
    let look = DQuat::from_rotation_y(0.07);
    glb.node(
        "visitor",
        DAffine3::from_rotation_translation(look, DVec3::from_array(CAMERA)),
        Payload::Camera(camera),
    );
    glb.finish("gallery")
}

fn palette(glb: &mut GlbWriter) -> Result<Palette, SceneError> {
    let mut texture = |name: &str, picture: RgbImage, wrap: Wrap| {
        let texture = glb.texture(name, &picture, wrap)?;
        Ok::<_, SceneError>(Some(TextureRef::plain(texture)))
    };
    let floor = texture("marble floor", paint::marble_floor(512), Wrap::Repeat)?;
    let carpet = texture("carpet", paint::carpet(256), Wrap::Repeat)?;
    let pictures = [
        texture("hills", paint::painting_hills(320, 240), Wrap::Clamp)?,
        texture("dusk", paint::painting_dusk(320, 240), Wrap::Clamp)?,
        texture("circles", paint::painting_circles(240, 240), Wrap::Clamp)?,
    ];
    let matte = |name: &str, color: [f32; 3]| Material::lambert(name, color);
    let coated = |name: &str, color: [f32; 3], roughness: f32| Material {
        roughness,
        specular: 1.0,
        ..Material::lambert(name, color)
    };
    let metal = |name: &str, color: [f32; 3], roughness: f32| Material {
        name: name.to_owned(),
        base_color: [color[0], color[1], color[2], 1.0],
        roughness,
        ..Material::default()
    };
    let textured = |material: Material, base_color_texture| Material {
        base_color: [1.0; 4],
        base_color_texture,
        ..material
    };
    let lamp = |name: &str, emission: [f32; 3]| Material {
        emission,
        ..Material::lambert(name, [0.8; 3])
    };
    let painting = |name: &str, picture| textured(coated(name, [1.0; 3], 0.55), picture);
    Ok(Palette {
        plaster: glb.material(&matte("plaster", [0.78, 0.72, 0.60])),
        stone: glb.material(&matte("stone", [0.80, 0.77, 0.70])),
        trim: glb.material(&matte("trim", [0.84, 0.82, 0.77])),
        floor: glb.material(&textured(coated("marble floor", [1.0; 3], 0.3), floor)),
        ceiling: glb.material(&matte("ceiling", [0.82, 0.80, 0.75])),
        end_wall: glb.material(&matte("lapis wall", [0.10, 0.20, 0.34])),
        velvet: glb.material(&Material {
            double_sided: true,
            ..matte("velvet", [0.52, 0.05, 0.06])
        }),
        gilt: glb.material(&metal("gilt", [1.0, 0.76, 0.34], 0.35)),
        bronze: glb.material(&metal("bronze", [0.72, 0.48, 0.30], 0.4)),
        wood: glb.material(&coated("walnut", [0.22, 0.11, 0.055], 0.45)),
        mirror: glb.material(&metal("mirror", [0.95, 0.94, 0.92], 0.05)),
        glass: glb.material(&Material {
            transmission: 1.0,
            thickness: 0.6,
            roughness: 0.0,
            ior: 1.5,
            ..coated("glass", [1.0; 3], 0.0)
        }),
        clay: glb.material(&coated("glazed clay", [0.08, 0.32, 0.34], 0.25)),
        carpet: glb.material(&textured(matte("carpet", [1.0; 3]), carpet)),
        paintings: [
            glb.material(&painting("painting of hills", pictures[0])),
            glb.material(&painting("painting of dusk", pictures[1])),
            glb.material(&painting("painting of circles", pictures[2])),
        ],
        window_light: glb.material(&lamp("window light", [5.2, 7.0, 9.6])),
        sky_light: glb.material(&lamp("skylight", [6.6, 6.2, 5.4])),
    })
}

fn place(glb: &mut GlbWriter, name: &str, mesh: u32, at: impl Into<DVec3>, yaw_rad: f64) {
    glb.node(
        name,
        DAffine3::from_rotation_translation(DQuat::from_rotation_y(yaw_rad), at.into()),
        Payload::Mesh(mesh),
    );
}

fn place_parts(glb: &mut GlbWriter, name: &str, parts: &[Part]) {
    let mesh = glb.mesh(name, parts);
    glb.node(name, DAffine3::IDENTITY, Payload::Mesh(mesh));
}

/// Floor, ceiling with beams and skylight shafts, the right wall and the wall behind the viewer.
fn hall(glb: &mut GlbWriter, palette: &Palette) {
    let (w, l) = (HALF_WIDTH, HALF_LENGTH);
    let mut floor = Shape::quad([-w, 0.0, l], DVec3::X * 2.0 * w, DVec3::Z * -2.0 * l);
    // One picture covers 2x2 slabs of half a metre.
    floor.uvs = floor
        .positions
        .iter()
        .map(|p| DVec2::new(p.x, p.z))
        .collect();
    place_parts(glb, "floor", &[floor.part(palette.floor)]);

    let mut walls = Shape::quad([w, 0.0, -l], DVec3::Z * 2.0 * l, DVec3::Y * HEIGHT);
    walls.append(Shape::quad(
        [w, 0.0, l],
        DVec3::X * -2.0 * w,
        DVec3::Y * HEIGHT,
    ));
    place_parts(glb, "walls", &[walls.plain_part(palette.plaster)]);

    // The ceiling is laid around three openings, one per bay.
    let (half_x, half_z, shaft) = (0.75, 1.0, 0.3);
    let down = |x0: f64, x1: f64, z0: f64, z1: f64, y: f64| {
        Shape::quad([x0, y, z0], DVec3::X * (x1 - x0), DVec3::Z * (z1 - z0))
    };
    let mut ceiling = down(-w, -half_x, -l, l, HEIGHT);
    ceiling.append(down(half_x, w, -l, l, HEIGHT));
    let mut lights = Shape::default();
    let mut from = -l;
    for z in BAY_Z {
        ceiling.append(down(-half_x, half_x, from, z - half_z, HEIGHT));
        from = z + half_z;
        let (near, far) = (z + half_z, z - half_z);
        let rise = DVec3::Y * shaft;
        ceiling.append(Shape::quad(
            [-half_x, HEIGHT, near],
            DVec3::Z * (far - near),
            rise,
        ));
        ceiling.append(Shape::quad(
            [half_x, HEIGHT, far],
            DVec3::Z * (near - far),
            rise,
        ));
        ceiling.append(Shape::quad(
            [-half_x, HEIGHT, far],
            DVec3::X * 2.0 * half_x,
            rise,
        ));
        ceiling.append(Shape::quad(
            [half_x, HEIGHT, near],
            DVec3::X * -2.0 * half_x,
            rise,
        ));
        lights.append(down(-half_x, half_x, far, near, HEIGHT + shaft));
    }
    ceiling.append(down(-half_x, half_x, from, l, HEIGHT));
    place_parts(glb, "ceiling", &[ceiling.plain_part(palette.ceiling)]);
    place_parts(glb, "skylights", &[lights.plain_part(palette.sky_light)]);

    // Beams across the nave at every pair of columns, and glazing bars under the skylights.
    let beam = Shape::beveled_box(
        [-COLUMN_X, HEIGHT - 0.3, -0.14],
        [COLUMN_X, HEIGHT, 0.14],
        0.03,
    );
    let beam = glb.mesh("beam", &[beam.plain_part(palette.trim)]);
    for z in COLUMN_Z {
        place(glb, "beam", beam, [0.0, 0.0, z], 0.0);
    }
    let mut bars = Shape::beveled_box([-0.02, 0.0, -half_z], [0.02, 0.05, half_z], 0.006);
    for z in [-half_z / 3.0, half_z / 3.0] {
        bars.append(Shape::beveled_box(
            [-half_x, 0.0, z - 0.02],
            [half_x, 0.05, z + 0.02],
            0.006,
        ));
    }
    let bars = glb.mesh("skylight bars", &[bars.plain_part(palette.bronze)]);
    for z in BAY_Z {
        place(glb, "skylight bars", bars, [0.0, HEIGHT + 0.16, z], 0.0);
    }
    // Skirting along the side walls.
    let skirting = Shape::beveled_box([-l, 0.0, -0.03], [l, 0.22, 0.03], 0.015);
    let skirting = glb.mesh("skirting", &[skirting.plain_part(palette.trim)]);
    place(glb, "skirting left", skirting, [-w, 0.0, 0.0], FRAC_PI_2);
    place(glb, "skirting right", skirting, [w, 0.0, 0.0], FRAC_PI_2);
}

/// Columns with base, fluted shaft and capital, the arches that they carry and the cornice above.
fn arcades(glb: &mut GlbWriter, palette: &Palette) {
    let column = column();
    let column = glb.mesh("column", &[column.plain_part(palette.stone)]);
    let half_depth = 0.17;
    let panel = ArchedPanel {
        half_width: 1.5,
        height: HEIGHT - SPRING,
        opening_half_width: 1.24,
        sill: None,
        spring: 0.0,
        depth: 2.0 * half_depth,
        segments: 32,
    };
    let front =
        Shape::arched_panel(&panel).transformed(DAffine3::from_translation(DVec3::Z * half_depth));
    let mut arch = front;
    // The far face has no reveal of its own: the soffit belongs to both.
    let back = Shape::arched_panel(&ArchedPanel {
        depth: 1e-3,
        ..panel
    });
    arch.append(back.transformed(DAffine3::from_rotation_translation(
        DQuat::from_rotation_y(PI),
        DVec3::Z * -half_depth,
    )));
    // A raised band follows the arch on both faces, with a keystone.
    let band = |side: f64| {
        Shape::parametric(32, 4, |u, v| {
            let (angle, around) = (PI * (1.0 - u), PI * v);
            let radius = 1.30 - 0.05 * around.cos();
            let z = side * (half_depth + 0.03 * around.sin());
            DVec3::new(radius * angle.cos() * side, radius * angle.sin(), z)
        })
    };
    arch.append(band(1.0));
    arch.append(band(-1.0));
    arch.append(Shape::beveled_box(
        [-0.1, 1.18, -half_depth - 0.07],
        [0.1, 1.5, half_depth + 0.07],
        0.02,
    ));
    let arch = glb.mesh("arch", &[arch.plain_part(palette.plaster)]);
    let cornice = Shape::beveled_box(
        [-HALF_LENGTH, -0.09, -0.26],
        [HALF_LENGTH, 0.09, 0.26],
        0.05,
    );
    let cornice = glb.mesh("cornice", &[cornice.plain_part(palette.trim)]);
    // The arcade ends in half bays against the end walls.
    let pier = Shape::beveled_box(
        [-0.75, 0.0, -half_depth],
        [0.75, HEIGHT - SPRING, half_depth],
        0.0,
    );
    let pier = glb.mesh("lintel", &[pier.plain_part(palette.plaster)]);
    for side in [-1.0, 1.0] {
        for z in COLUMN_Z {
            place(glb, "column", column, [side * COLUMN_X, 0.0, z], 0.0);
        }
        for z in BAY_Z {
            place(glb, "arch", arch, [side * COLUMN_X, SPRING, z], FRAC_PI_2);
        }
        for z in [-HALF_LENGTH + 0.75, HALF_LENGTH - 0.75] {
            place(glb, "lintel", pier, [side * COLUMN_X, SPRING, z], FRAC_PI_2);
        }
        place(
            glb,
            "cornice",
            cornice,
            [side * COLUMN_X, HEIGHT - 0.09, 0.0],
            FRAC_PI_2,
        );
    }
}

/// A column of the height of the springing line: square foot, two torus mouldings, a shaft with twenty flutes that
/// swells a little (entasis), a round capital and a square top.
fn column() -> Shape {
    let mut column = Shape::beveled_box([-0.26, 0.0, -0.26], [0.26, 0.12, 0.26], 0.015);
    let arc = |center: DVec2, radius: f64, from: f64, to: f64, steps: u32| {
        (0..=steps).map(move |step| {
            let angle = from + (to - from) * f64::from(step) / f64::from(steps);
            center + radius * DVec2::new(angle.cos(), angle.sin())
        })
    };
    let mut base: Vec<DVec2> =
        arc(DVec2::new(0.205, 0.165), 0.045, -FRAC_PI_2, FRAC_PI_2, 8).collect();
    base.extend(arc(
        DVec2::new(0.225, 0.236),
        0.026,
        1.25 * PI,
        0.75 * PI,
        4,
    ));
    base.extend(arc(
        DVec2::new(0.195, 0.282),
        0.028,
        -FRAC_PI_2,
        FRAC_PI_2,
        6,
    ));
    base.push(DVec2::new(0.178, 0.32));
    column.append(Shape::lathe(&base, 32, |_| 1.0));

    let flutes = |angle: f64| {
        let phase = (angle / TAU * 20.0).rem_euclid(1.0);
        let inside = ((phase - 0.5) / 0.42).abs().min(1.0);
        1.0 - 0.075 * (1.0 - inside * inside)
    };
    let shaft: Vec<DVec2> = (0..=3)
        .map(|step| {
            let t = f64::from(step) / 3.0;
            DVec2::new(0.176 - 0.028 * t * t, 0.32 + 1.66 * t)
        })
        .collect();
    column.append(Shape::lathe(&shaft, 100, flutes));

    let mut capital: Vec<DVec2> =
        arc(DVec2::new(0.150, 2.0), 0.018, -FRAC_PI_2, FRAC_PI_2, 5).collect();
    capital.push(DVec2::new(0.146, 2.03));
    capital.push(DVec2::new(0.148, 2.07));
    // The bell: an ovolo that opens to the square top.
    capital.extend(
        arc(DVec2::new(0.148, 2.185), 0.1, -FRAC_PI_2, 0.0, 8)
            .map(|p| DVec2::new(p.x, p.y - 0.012)),
    );
    capital.push(DVec2::new(0.248, 2.2));
    column.append(Shape::lathe(&capital, 32, |_| 1.0));
    column.append(Shape::beveled_box(
        [-0.26, 2.2, -0.26],
        [0.26, SPRING, 0.26],
        0.02,
    ));
    column
}

/// The left wall: three arched windows with glazing bars in front of a shining pane.
fn windows(glb: &mut GlbWriter, palette: &Palette) {
    let panel = ArchedPanel {
        half_width: 1.5,
        height: HEIGHT,
        opening_half_width: WINDOW_HALF_WIDTH,
        sill: Some(WINDOW_SILL),
        spring: WINDOW_SPRING,
        depth: WALL_DEPTH,
        segments: 24,
    };
    // The panel's front looks along its +Z, which a quarter turn brings to +X.
    let r = WINDOW_HALF_WIDTH;
    let mut pane = Shape::quad(
        [-r, WINDOW_SILL, -WALL_DEPTH],
        DVec3::X * 2.0 * r,
        DVec3::Y * (WINDOW_SPRING - WINDOW_SILL),
    );
    let rim = |at: u32| {
        let angle = PI * f64::from(at) / 24.0;
        DVec3::new(
            r * angle.cos(),
            WINDOW_SPRING + r * angle.sin(),
            -WALL_DEPTH,
        )
    };
    let mut fan = Shape {
        positions: vec![DVec3::new(0.0, WINDOW_SPRING, -WALL_DEPTH)],
        ..Shape::default()
    };
    fan.positions.extend((0..=24).map(rim));
    fan.normals = vec![DVec3::Z; fan.positions.len()];
    fan.triangles = (1..=24).map(|at| [0, at, at + 1]).collect();
    pane.append(fan);

    let bar = |x0: f64, x1: f64, y0: f64, y1: f64| {
        Shape::beveled_box(
            [x0, y0, -WALL_DEPTH + 0.05],
            [x1, y1, -WALL_DEPTH + 0.10],
            0.008,
        )
    };
    let mut bars = bar(-0.022, 0.022, WINDOW_SILL, WINDOW_SPRING + r - 0.01);
    for x in [-r / 2.0, r / 2.0] {
        bars.append(bar(x - 0.016, x + 0.016, WINDOW_SILL, WINDOW_SPRING));
    }
    for y in [WINDOW_SILL + 0.02, 1.42, 1.88, WINDOW_SPRING] {
        bars.append(bar(-r, r, y - 0.018, y + 0.018));
    }
    for tilt in [-PI / 4.0, PI / 4.0] {
        let spoke =
            bar(-0.016, 0.016, 0.0, r - 0.01).transformed(DAffine3::from_rotation_translation(
                DQuat::from_rotation_z(tilt),
                DVec3::Y * WINDOW_SPRING,
            ));
        bars.append(spoke);
    }
    let sill = Shape::beveled_box(
        [-r - 0.1, WINDOW_SILL - 0.08, -WALL_DEPTH],
        [r + 0.1, WINDOW_SILL, 0.1],
        0.02,
    );
    let window = glb.mesh(
        "window",
        &[
            Shape::arched_panel(&panel).plain_part(palette.plaster),
            pane.plain_part(palette.window_light),
            bars.plain_part(palette.bronze),
            sill.plain_part(palette.trim),
        ],
    );
    for z in BAY_Z {
        place(glb, "window", window, [-HALF_WIDTH, 0.0, z], FRAC_PI_2);
    }
    let blank = Shape::quad([-0.75, 0.0, 0.0], DVec3::X * 1.5, DVec3::Y * HEIGHT);
    let blank = glb.mesh("blank wall", &[blank.plain_part(palette.plaster)]);
    for z in [-HALF_LENGTH + 0.75, HALF_LENGTH - 0.75] {
        place(glb, "blank wall", blank, [-HALF_WIDTH, 0.0, z], FRAC_PI_2);
    }
}
