//! What filters take for one surface from frame to frame: images in mirrors and glass (`shaders/shared/image.wesl`), against
//! geometrical optics in f64, and what is thinner than a pixel.

use glam::{DAffine3, DQuat, DVec3};
use stereolux::renderer::{Eye, InstanceId, Renderer};
use stereolux::scene::{Material, Mesh, Node, Scene};
use stereolux::settings::Reuse;
use stereolux::xr::View;

use super::hard_support::{add_point_light, mesh, quad};
use super::reconstruction::{MOTION_TOLERANCE_PX, SIZE, filtered, project, sample_at};
use super::support::{self, radiance, square_fov};

/// Distance from a mirror, or from glass, to what it shows, and to the eye.
const SHOWN_M: f64 = 3.0;
const EYE_M: f64 = 1.0;
/// What is shown, and what shows it.
const SHOWN: InstanceId = InstanceId(1);
/// Instance in a record of what a pixel sees; above it are flags, of which this one is an image's.
const INSTANCE: u32 = 0x0003_ffff;
const IMAGE: u32 = 0x2000_0000;

fn mirror() -> Material {
    Material {
        roughness: 0.0,
        ..Material::default()
    }
}

/// A square at z = `z_m` whose front looks along z times `facing`.
fn square(z_m: f64, facing: f64, half_m: f64, material: u32) -> Mesh {
    let [across, up] = [facing * half_m * DVec3::X, half_m * DVec3::Y];
    let corner = DVec3::Z * z_m - across - up;
    mesh(&quad(corner, 2.0 * across, 2.0 * up), material)
}

/// The cap of a ball of `radius_m` whose top is the origin and looks along z; with a negative radius a bowl.
fn cap(radius_m: f64, material: u32) -> Mesh {
    const SIDE: u32 = 24;
    let point = |index: u32| {
        let along = |i: u32| (f64::from(i) / f64::from(SIDE) * 2.0 - 1.0) * 0.7;
        let [x, y] = [along(index % (SIDE + 1)), along(index / (SIDE + 1))];
        let normal = DVec3::new(x, y, (1.0 - x * x - y * y).sqrt());
        [(normal - DVec3::Z) * radius_m, normal].map(|v| v.as_vec3().to_array())
    };
    let points = (0..(SIDE + 1).pow(2)).map(point);
    let (positions, normals) = points.map(<(_, _)>::from).unzip();
    let cells = (0..SIDE * SIDE).map(|cell| cell / SIDE * (SIDE + 1) + cell % SIDE);
    let halves = cells.flat_map(|a| [[a, a + 1, a + SIDE + 2], [a, a + SIDE + 2, a + SIDE + 1]]);
    Mesh::plain(positions, normals, halves, material)
}

fn scene(first: Material, meshes: [Mesh; 2]) -> Scene {
    let mut scene = Scene {
        materials: vec![first, Material::lambert("wall", [0.5; 3])],
        meshes: meshes.into(),
        nodes: [0, 1].map(Node::of_mesh).into(),
        roots: vec![0, 1],
        ..Scene::default()
    };
    add_point_light(&mut scene, DVec3::new(0.0, 2.5, EYE_M), 1.0);
    scene
}

/// Of filtered frames.
fn renderer(scene: &Scene) -> Renderer {
    let settings = filtered(Reuse::Off, |s| {
        s.reconstruct.taa = true.into();
        s.reconstruct.still = false.into();
    });
    support::renderer(scene, &settings, [SIZE; 2])
}

/// Of an eye before the first surface, `aside` from the axis.
fn view(aside: DVec3, turned: DQuat) -> View {
    View {
        position_in_world: DVec3::Z * EYE_M + aside,
        orientation: turned,
        fov: square_fov(20.0),
    }
}

/// Distance to what a record's pixel sees.
fn seen_m(record: &[u32; 4]) -> f64 {
    f64::from(f32::from_bits(record[0]))
}

#[test]
fn a_plane_mirror_shows_what_lies_as_far_behind_it_and_moves_as_that_does() {
    let meshes = [square(0.0, 1.0, 4.0, 0), square(SHOWN_M, -1.0, 30.0, 1)];
    let mut renderer = renderer(&scene(mirror(), meshes));
    let step = |frame: u32| {
        let turned = DQuat::from_rotation_y(0.02 * f64::from(frame));
        view(DVec3::new(0.05, -0.02, 0.03) * f64::from(frame), turned)
    };
    // The wall moves, too: sideways, which the mirror shows as it is, and away, which it shows the other way round.
    let wall_at = |frame: u32| DVec3::new(0.1, 0.0, 0.2) * f64::from(frame);
    for frame in 0..2 {
        let place = DAffine3::from_translation(wall_at(frame));
        renderer.set_instance_transform(SHOWN, place);
        renderer
            .render_frame(&[step(frame); 2], frame, |_| {})
            .unwrap();
    }
    let mirrored = |v: DVec3| v * DVec3::new(1.0, 1.0, -1.0);
    let (records, motion) = renderer.read_motion(Eye::Left).unwrap().unwrap();
    let mut furthest: f64 = 0.0;
    for (pixel, (record, moved)) in records.iter().zip(&motion).enumerate() {
        assert_eq!(
            record[2] & (INSTANCE | IMAGE),
            SHOWN.0 | IMAGE,
            "pixel {pixel}"
        );
        let at = sample_at(pixel, record);
        let ray = step(1).ray_through_pixel(at[0], at[1], SIZE, SIZE);
        let image_z_m = -(SHOWN_M + wall_at(1).z);
        let expected_m = (image_z_m - ray.origin.z) / ray.direction.z;
        // The place in the pixel is known to a 65,000th, which at 20 degrees is less than 1e-6 of the distance; f32 adds as much.
        assert!(
            (seen_m(record) / expected_m - 1.0).abs() < 1e-5,
            "pixel {pixel}"
        );
        let point = ray.origin + ray.direction * expected_m;
        let then = point - mirrored(wall_at(1) - wall_at(0));
        let found = [0, 1].map(|axis| at[axis] + f64::from(moved[axis]));
        let off = |expected: Option<[f64; 2]>| {
            let expected = expected.unwrap();
            let [x, y] = [0, 1].map(|axis| (found[axis] - expected[axis]).abs());
            x.max(y)
        };
        assert_eq!(moved[3], 1.0, "pixel {pixel} has no history");
        assert!(
            off(project(&step(0), then)) < MOTION_TOLERANCE_PX,
            "pixel {pixel}"
        );
        // Comparators that must fail: the mirror's own point, and the image of a wall at rest.
        let on_mirror = ray.origin - ray.direction * (ray.origin.z / ray.direction.z);
        furthest = furthest.max(off(project(&step(0), on_mirror)));
        assert!(
            off(project(&step(0), point)) > MOTION_TOLERANCE_PX,
            "pixel {pixel}"
        );
    }
    assert!(furthest > 1.0, "images move by {furthest} pixels less");
}

/// Distance to what the pixel in the middle sees.
fn middle_m(first: Material, first_mesh: Mesh, shown_z_m: f64) -> f64 {
    let shown = square(shown_z_m, if shown_z_m > 0.0 { -1.0 } else { 1.0 }, 30.0, 1);
    let mut renderer = renderer(&scene(first, [first_mesh, shown]));
    let still = view(DVec3::ZERO, DQuat::IDENTITY);
    renderer.render_frame(&[still; 2], 0, |_| {}).unwrap();
    let (records, _) = renderer.read_motion(Eye::Left).unwrap().unwrap();
    let middle = (SIZE / 2 * SIZE + SIZE / 2) as usize;
    assert_eq!(records[middle][2] & (INSTANCE | IMAGE), SHOWN.0 | IMAGE);
    seen_m(&records[middle])
}

/// A sample within a pixel of the axis looks up to 1.4 pixels of 0.6 degrees off it, where distances are greater by
/// 1 - cos = 1e-4; the mirror's equation errs by as much, and so do flat triangles, which lie inside the ball.
const OFF_AXIS: f64 = 5e-3;

#[test]
fn round_mirrors_show_images_where_the_mirror_equation_says() {
    // Convex, and concave with the eye and what is shown within the focus.
    for radius_m in [2.0, 20.0, -10.0] {
        let found_m = middle_m(mirror(), cap(radius_m, 0), SHOWN_M);
        let expected_m = EYE_M + 1.0 / (1.0 / SHOWN_M + 2.0 / radius_m);
        assert!(
            (found_m / expected_m - 1.0).abs() < OFF_AXIS,
            "{found_m} m, not {expected_m}"
        );
        // A plane mirror's is another.
        assert!((found_m / (EYE_M + SHOWN_M) - 1.0).abs() > 10.0 * OFF_AXIS);
    }
}

#[test]
fn what_lies_under_water_looks_shallower() {
    let water = Material {
        metallic: 0.0,
        roughness: 0.0,
        transmission: 1.0,
        ior: 1.33,
        ..Material::default()
    };
    let found_m = middle_m(water, square(0.0, 1.0, 4.0, 0), -SHOWN_M);
    let expected_m = EYE_M + SHOWN_M / 1.33;
    assert!(
        (found_m / expected_m - 1.0).abs() < OFF_AXIS,
        "{found_m} m, not {expected_m}"
    );
}

#[test]
fn filters_leave_what_a_mirror_shows_dark_beside_what_it_shows_lit() {
    // The wall, of which the mirror shows the right half alone, beside nothing.
    let mut wall = square(SHOWN_M, -1.0, 30.0, 1);
    for position in &mut wall.positions {
        position[0] = position[0].max(0.0);
    }
    let meshes = [square(0.0, 1.0, 4.0, 0), wall];
    let mut renderer = renderer(&scene(mirror(), meshes));
    let still = view(DVec3::ZERO, DQuat::IDENTITY);
    for frame in 0..8 {
        renderer.render_frame(&[still; 2], frame, |_| {}).unwrap();
    }
    let shown = radiance(&renderer, Eye::Left);
    let mean = |columns: std::ops::Range<u32>| {
        let lit = |(pixel, _): &(usize, &[f32; 3])| columns.contains(&(*pixel as u32 % SIZE));
        let light: Vec<f32> = shown
            .iter()
            .enumerate()
            .filter(lit)
            .map(|(_, p)| p[1])
            .collect();
        f64::from(light.iter().sum::<f32>()) / light.len() as f64
    };
    // Left of the edge nothing is met; one column may hold it.
    let (dark, lit) = (mean(0..SIZE / 2 - 1), mean(SIZE / 2 + 1..SIZE));
    assert!(lit > 0.0);
    assert_eq!(dark, 0.0, "beside {lit}");
}

#[test]
fn bars_thinner_than_a_pixel_keep_their_share_as_the_head_moves() {
    const COVERED_PX: f64 = 0.3;
    const FRAMES: u32 = 64;
    const FIRST: u32 = 16;
    let bright = Material {
        emission: [1.0; 3],
        ..Material::lambert("bright", [0.0; 3])
    };
    // Width of a pixel where the bar is, 2 m from the eye.
    let pixel_m = 2.0 * 2.0 * 20_f64.to_radians().tan() / f64::from(SIZE);
    let mut bar = square(-1.0, 1.0, 30.0, 1);
    for position in &mut bar.positions {
        position[0] = position[0].signum() * (0.5 * COVERED_PX * pixel_m) as f32;
    }
    let scene = scene(bright, [square(-SHOWN_M, 1.0, 30.0, 0), bar]);
    let mut renderer = renderer(&scene);
    // What the bar takes of a row, in pixels: what is shown, and the frame's own samples.
    let mut covered = [Vec::new(), Vec::new()];
    for frame in 0..FRAMES {
        // A tenth of a pixel per frame.
        let steps = f64::from(frame) - 0.5 * f64::from(FRAMES);
        let now = view(DVec3::X * (0.1 * pixel_m * steps), DQuat::IDENTITY);
        renderer.render_frame(&[now; 2], frame, |_| {}).unwrap();
        let shown = radiance(&renderer, Eye::Left);
        let samples = renderer.read_samples(Eye::Left).unwrap().unwrap();
        let row = (SIZE / 2 * SIZE) as usize..((SIZE / 2 + 1) * SIZE) as usize;
        for (covered, image) in covered.iter_mut().zip([shown, samples]) {
            let dark = image[row.clone()].iter().map(|p| 1.0 - f64::from(p[1]));
            covered.push(dark.sum::<f64>());
        }
    }
    let [shown, samples] = covered.map(|covered| {
        let covered = &covered[FIRST as usize..];
        let mean = covered.iter().sum::<f64>() / covered.len() as f64;
        let squares: f64 = covered.iter().map(|c| (c - mean).powi(2)).sum();
        (mean, (squares / covered.len() as f64).sqrt())
    });
    // The bar shines by 0.01 or so, and an offset sequence of 48 frames meets it 0.3 times each to within a few of them.
    assert!((shown.0 - COVERED_PX).abs() < 0.1, "{} pixels", shown.0);
    // Samples meet it or not, which spreads by sqrt(0.3 * 0.7) = 0.46 and would so be seen where each began anew. A mean with a
    // least share of 0.2 spreads by sqrt(0.2 / 1.8) = 0.33 of that, if samples are independent.
    assert!(samples.1 > 0.4, "samples spread by {}", samples.1);
    assert!(shown.1 < 0.5 * samples.1, "{} of {}", shown.1, samples.1);
}
