//! Stereo reuse against closed forms and f64 arithmetic: nothing here has a tolerance that hides a wrong pixel.

use glam::{DAffine3, DQuat, DVec3};
use stereolux::gpu::ShaderLibrary;
use stereolux::renderer::{Eye, Provenance, Renderer};
use stereolux::scene::{Material, Scene};
use stereolux::settings::{Eyes, Method, RenderSettings, Reuse};
use stereolux::xr::{Fov, Headset, Pose, View};

use crate::suite::embedded_scenes::plane;
use crate::suite::frame::layout::changed;
use crate::suite::support::{
    Triangles, bits, both, both_bits, builtin, frame, hit_in_world, hit_rays, method,
    parallel_views, pixel_ray, placed, radiance, rendered, renderer, renderer_by, square_fov,
    start_views,
};
use crate::suite::transport::hard_support::{add, add_point_light, quad, square_ahead};

fn winners(renderer: &Renderer) -> Vec<u32> {
    renderer.read_winners().unwrap().unwrap()
}

pub fn provenance(renderer: &Renderer) -> Vec<u32> {
    renderer.read_provenance().unwrap().unwrap()
}

/// The head rolled about its line of sight, degrees.
fn rolled(head: Pose, degrees: f64) -> Pose {
    let turn = DQuat::from_rotation_z(degrees.to_radians());
    head.then(&Pose::new(DVec3::ZERO, turn))
}

#[test]
fn equal_eyes_give_equal_images_bit_for_bit() {
    let scene = builtin("cornell");
    let head = scene.start_pose();
    let asymmetric = Fov::from_degrees(-20.0, 31.0, 25.0, -17.0);
    let with = |kind| [Reuse::Scatter, Reuse::Off, Reuse::Lookup].map(|reuse| (kind, reuse));
    for (kind, reuse) in [Method::Photon, Method::Path].into_iter().flat_map(with) {
        for spp in [1, 4] {
            let settings = RenderSettings {
                spp,
                ..method(kind, reuse)
            };
            let mut renderer = renderer(&scene, &settings, [32, 24]);
            let square = square_fov(20.0);
            for (fov, roll) in [(square, 0.0), (asymmetric, 0.0), (asymmetric, 90.0)] {
                let views = parallel_views(rolled(head, roll), 0.0, fov);
                let result = frame(&mut renderer, &views);
                let [left, right] = both(&renderer);
                let what = format!("{kind:?} {reuse:?} {spp} spp roll {roll}");
                assert!(bits(&left) == bits(&right), "{what}: eyes differ");
                assert!(left.iter().flatten().any(|&c| c > 0.0), "{what}: black");
                if reuse != Reuse::Off {
                    assert_eq!(result.stereo.reuse_fraction, 1.0, "{what}");
                    assert_eq!(result.stereo.filled, 0, "{what}");
                    assert_eq!(result.stereo.reused, result.stereo.left_hits, "{what}");
                }
            }
            // Negative control: eyes apart are not equal.
            frame(&mut renderer, &parallel_views(head, 0.02, square_fov(20.0)));
            let [left, right] = both_bits(&renderer);
            assert!(left != right);
        }
    }
}

#[test]
fn a_fronto_parallel_plane_is_shifted_by_the_closed_form_disparity() {
    let scene = builtin("plane");
    // Asymmetric horizontally, tangents -1.2 to 0.8 and 1 to -1.
    let asymmetric = Fov {
        angle_left: (-1.2_f64).atan(),
        angle_right: 0.8_f64.atan(),
        angle_up: 45.0_f64.to_radians(),
        angle_down: -45.0_f64.to_radians(),
    };
    for size in [[64, 40], [128, 16], [100, 24]] {
        let [width, height] = size;
        let mut renderer = renderer(&scene, &method(Method::Photon, Reuse::Scatter), size);
        for (fov, ipd_m) in [
            (square_fov(45.0), 0.063),
            (asymmetric, 0.063),
            (square_fov(45.0), 0.21),
        ] {
            let views = parallel_views(Pose::IDENTITY, ipd_m, fov);
            let result = frame(&mut renderer, &views);
            let tangents = fov.tangents();
            let across_m = plane::DISTANCE_M * (tangents.right - tangents.left);
            let disparity = f64::from(width) * ipd_m / across_m;
            // A left pixel's centre moves left by the disparity. Its distance from the nearest pixel border is the
            // same for the whole image; these settings keep it far above f32 rounding (1e-5 pixels).
            let landing = 0.5 - disparity;
            let is_on_border = (landing - landing.round()).abs() <= 1e-3;
            assert!(!is_on_border, "choose another size");
            let shift = -(landing.floor() as i64) as u32;
            assert!(shift >= 1, "the test must move something");
            let (winners, provenance) = (winners(&renderer), provenance(&renderer));
            let left = radiance(&renderer, Eye::Left);
            for y in 0..height {
                for x in 0..width {
                    let here = (y * width + x) as usize;
                    let from = (x + shift < width).then_some(y * width + x + shift);
                    let what = format!("{size:?} ipd {ipd_m}: right pixel ({x}, {y})");
                    assert_eq!(winners[here], from.unwrap_or(u32::MAX), "{what}");
                    let is_outside = provenance[here] == Provenance::OutOfLeftView as u32;
                    assert_eq!(is_outside, from.is_none(), "{what}");
                    let is_reused = Provenance::is_reused(provenance[here]);
                    assert_ne!(is_outside, is_reused, "{what}");
                }
            }
            let stereo = result.stereo;
            let outside = stereo.filled_because.out_of_left_view;
            assert_eq!(stereo.reused, (width - shift) * height);
            assert_eq!([outside, stereo.filled], [shift * height; 2]);
            // Direct light of one point light is the whole truth here: a plane alone scatters nothing to itself. f32
            // arithmetic of some twenty steps keeps 1e-5; 1e-4 leaves room for a driver's division.
            for (pixel, value) in left.iter().enumerate() {
                let ray = pixel_ray(&views[0], pixel, size);
                let point = ray.origin
                    + ray.direction * (-plane::DISTANCE_M - ray.origin.z) / ray.direction.z;
                let expected = plane::radiance_at(point.x, point.y);
                for channel in value {
                    let off = (f64::from(*channel) / expected - 1.0).abs();
                    assert!(off < 1e-4, "pixel {pixel}: {channel} for {expected}");
                }
            }
        }
    }
}

/// Views of a profile's eyes, or of eyes with other angles.
fn headset_views(name: &str, head: Pose) -> [View; 2] {
    Headset::load(name).unwrap().views_from_head(&head)
}

/// Right pixels whose winner's point, projected in f64, lies elsewhere; and right pixels with a winner.
fn misplaced(
    renderer: &Renderer,
    views: &[View; 2],
    judge: &View,
    size: [u32; 2],
) -> (usize, usize) {
    let rays = hit_rays(renderer, Eye::Left);
    let (mut wrong, mut all) = (0, 0);
    for (pixel, &winner) in winners(renderer).iter().enumerate() {
        if winner == u32::MAX {
            continue;
        }
        all += 1;
        let hit = hit_in_world(&views[0], rays[winner as usize]);
        let here = judge.pixel_from_point_in_world(hit, size[0], size[1]);
        let here = here.map(|(x, y)| y.floor() as usize * size[0] as usize + x.floor() as usize);
        wrong += usize::from(here != Some(pixel));
    }
    (wrong, all)
}

fn check_landing(scene: &Scene, kind: Method, far: DVec3) {
    let size = [96, 80];
    let scene = placed(scene.clone(), DAffine3::from_translation(far));
    let head = scene.start_pose();
    let mut renderer = renderer(&scene, &method(kind, Reuse::Scatter), size);
    let canted = |head: Pose| {
        let mut views = parallel_views(head, 0.063, Fov::from_degrees(-35.0, 28.0, 30.0, -24.0));
        views[0].orientation *= DQuat::from_rotation_y(0.09);
        views[1].orientation *= DQuat::from_rotation_y(-0.09) * DQuat::from_rotation_x(0.02);
        views[1].fov = Fov::from_degrees(-28.0, 35.0, 30.0, -26.0);
        views
    };
    let all = [
        ("parallel", parallel_views(head, 0.063, square_fov(25.0))),
        ("canted", canted(head)),
        ("canted, rolled 90", canted(rolled(head, 90.0))),
        ("canted, rolled 180", canted(rolled(head, 180.0))),
        ("quest3", headset_views("quest3", head)),
        ("index", headset_views("index", rolled(head, 90.0))),
        ("0.5 m apart", parallel_views(head, 0.5, square_fov(30.0))),
    ];
    for (name, views) in all {
        frame(&mut renderer, &views);
        let (wrong, reused) = misplaced(&renderer, &views, &views[1], size);
        let what = format!("{} {kind:?} {name} at {far}", scene.name);
        assert!(reused > 100, "{what}: only {reused} pixels were reused");
        assert_eq!(wrong, 0, "{what}: of {reused}");
        // Negative control: an eye that stands 5 cm elsewhere sees other pixels.
        let mut shifted = views[1];
        shifted.position_in_world += shifted.orientation * DVec3::new(0.05, 0.03, 0.0);
        let (wrong, _) = misplaced(&renderer, &views, &shifted, size);
        assert!(wrong > reused / 10, "{what}, blind: {wrong} of {reused}");
    }
}

#[test]
fn every_reused_point_lies_in_its_pixel_in_cornell() {
    let scene = builtin("cornell");
    check_landing(&scene, Method::Photon, DVec3::ZERO);
    check_landing(&scene, Method::Path, DVec3::ZERO);
}

#[test]
fn every_reused_point_lies_in_its_pixel_in_the_gallery() {
    check_landing(&builtin("gallery"), Method::Photon, DVec3::ZERO);
}

#[test]
fn every_reused_point_lies_in_its_pixel_a_thousand_kilometres_out() {
    // Not round numbers: an f32 of these is off by centimetres.
    let far = DVec3::new(1.0e6 + 0.123, -1.0e6 + 0.377, 1.0e6 + 0.711);
    check_landing(&builtin("cornell"), Method::Photon, far);
    check_landing(&builtin("gallery"), Method::Path, far);
}

#[test]
fn far_from_the_origin_as_much_is_reused_as_at_it() {
    let scene = builtin("cornell");
    let fraction = |far: DVec3| {
        let scene = placed(scene.clone(), DAffine3::from_translation(far));
        let mut renderer = renderer(&scene, &method(Method::Photon, Reuse::Scatter), [64, 64]);
        let stereo = frame(&mut renderer, &start_views(&scene, 19.0)).stereo;
        stereo.reuse_fraction
    };
    let near = fraction(DVec3::ZERO);
    // A power of two: f64 holds the moved scene to 2^-32 m, so geometry and views are the same but for that. A pixel or
    // two (of 4096) may have stood on a border.
    let far = fraction(DVec3::splat(1_048_576.0));
    let off = (near - far).abs();
    assert!(off < 4.0 / 4096.0, "{near}, far away {far}");
}

#[test]
fn the_nearest_visible_hit_wins() {
    let scene = builtin("cornell");
    let triangles = Triangles::of(&scene);
    let size = [64, 64];
    let mut renderer = renderer(&scene, &method(Method::Photon, Reuse::Scatter), size);
    let mut contested = 0;
    for ipd_m in [0.063, 0.25] {
        let views = parallel_views(scene.start_pose(), ipd_m, square_fov(19.0));
        frame(&mut renderer, &views);
        let right_eye = views[1].position_in_world;
        // Per right pixel: left hits that f64 arithmetic sees in it, with their distance. Points within a thousandth of
        // a pixel of a border may go either way by rounding: their pixels are left out.
        let mut candidates: Vec<Vec<(u32, f64)>> = vec![Vec::new(); 64 * 64];
        let mut doubtful = vec![false; 64 * 64];
        // Those that a hit reaches whose triangle covers less than 16 pixels there.
        let mut small = vec![false; 64 * 64];
        for (left_pixel, ray) in hit_rays(&renderer, Eye::Left).into_iter().enumerate() {
            if ray[3] <= 0.0 {
                continue;
            }
            let hit = hit_in_world(&views[0], ray);
            let Some((x, y)) = views[1].pixel_from_point_in_world(hit, size[0], size[1]) else {
                continue;
            };
            let pixel = y.floor() as usize * 64 + x.floor() as usize;
            let width = 2.0 * views[1].fov.tangents().right / 64.0 * hit.distance(right_eye);
            let towards = (hit - right_eye).normalize();
            let own = triangles.closest(right_eye, hit - right_eye, 1.0 - 1e-4);
            let covered = own.unwrap().1.dot(towards).abs() / 2.0 / (width * width);
            small[pixel] |= covered < 16.0;
            doubtful[pixel] |= (covered - 16.0).abs() < 1e-3;
            // Two margins: what is blocked by both or by neither is certain.
            let blocked = triangles.blocked(hit, right_eye, 1e-4);
            if [x, y].iter().any(|v| (v - v.round()).abs() < 1e-3)
                || blocked != triangles.blocked(hit, right_eye, 1e-5)
            {
                let (i, j) = (x.round() as i64, y.round() as i64);
                let around = [(i, j), (i - 1, j), (i, j - 1), (i - 1, j - 1)];
                for (i, j) in around.into_iter().chain([(x as i64, y as i64)]) {
                    if (0..64).contains(&i) && (0..64).contains(&j) {
                        doubtful[(j * 64 + i) as usize] = true;
                    }
                }
            } else if !blocked {
                candidates[pixel].push((left_pixel as u32, hit.distance(right_eye)));
            }
        }
        let winners = winners(&renderer);
        let mut checked = 0;
        for pixel in 0..64 * 64 {
            if doubtful[pixel] {
                continue;
            }
            let mut front = candidates[pixel].clone();
            let nearest = front.iter().map(|c| c.1).fold(f64::INFINITY, f64::min);
            // f32 squares tell distances apart that differ by more than 1e-6 of themselves.
            front.retain(|c| c.1 <= nearest * (1.0 + 1e-6));
            checked += 1;
            contested += usize::from(candidates[pixel].len() > front.len());
            let winner = winners[pixel];
            // Where nothing lands nobody wins, nor where rays are traced.
            let is_due = match front.is_empty() || small[pixel] {
                true => winner == u32::MAX,
                false => front.iter().any(|c| c.0 == winner),
            };
            assert!(is_due, "pixel {pixel}: {winner} won over {front:?}");
        }
        assert!(checked > 3000, "only {checked} pixels could be judged");
        assert!(small.contains(&true), "no triangle is small");
    }
    assert!(contested > 20, "{contested} pixels with several candidates");
}

#[test]
fn filled_pixels_are_those_of_a_native_rendering_and_the_sums_agree() {
    for (name, half) in [("cornell", 22.0), ("gallery", 40.0)] {
        let scene = builtin(name);
        let views = start_views(&scene, half);
        for kind in [Method::Photon, Method::Path] {
            let size = [96, 72];
            let native = rendered(&scene, &method(kind, Reuse::Off), size, &views);
            let mut reusing = renderer(&scene, &method(kind, Reuse::Scatter), size);
            let result = frame(&mut reusing, &views);
            let what = format!("{name} {kind:?}");
            let ([native_left, expected], [left, found]) =
                (both_bits(&native), both_bits(&reusing));
            // The left eye does not know about reuse.
            assert!(native_left == left, "{what}");
            let sees = hit_rays(&native, Eye::Right);
            let from = provenance(&reusing);
            let mut counts = [0_u32; 8];
            let mut reused_differ = 0;
            for pixel in 0..from.len() {
                counts[from[pixel] as usize] += 1;
                if Provenance::is_reused(from[pixel]) {
                    reused_differ += usize::from(expected[pixel] != found[pixel]);
                    continue;
                }
                let of_pixel = format!("{what}: filled pixel {pixel} ({})", from[pixel]);
                assert_eq!(expected[pixel], found[pixel], "{of_pixel}");
                let is_background = from[pixel] == Provenance::Background as u32;
                assert_eq!(is_background, sees[pixel][3] <= 0.0, "{of_pixel}");
            }
            // Negative control: carried over values are another sample's.
            let resampled = counts[Provenance::Resampled as usize];
            let reused = counts[Provenance::Reused as usize] + resampled;
            assert!(reused_differ > reused as usize / 2, "{what}: sees nothing");
            let s = result.stereo;
            let b = s.filled_because;
            assert_eq!((s.reused, s.resampled), (reused, resampled), "{what}");
            let because = [
                b.out_of_left_view,
                b.disoccluded,
                b.edge,
                b.view_dependent,
                b.gap,
            ];
            assert_eq!(because, counts[2..7], "{what}");
            assert_eq!(s.filled, counts[2..7].iter().sum::<u32>(), "{what}");
            assert_eq!(reused + s.filled + counts[0], size[0] * size[1], "{what}");
            let fraction = f64::from(s.reused) / f64::from(s.reused + s.filled);
            assert_eq!(s.reuse_fraction, fraction, "{what}");
            assert!(s.scattered <= s.left_hits, "{what}: {s:?}");
            // Surroundings leave nothing to meet without tracing; in so few pixels many surfaces lie beside others.
            let traced = s.traced - counts[Provenance::Background as usize];
            assert!(traced < 2 * (s.reused + s.filled) / 3, "{what}: {s:?}");
        }
    }
}

/// A lamp that lies a millimetre below the ceiling, far less than a pixel's width, is seen by scatter as by the eye itself, also
/// where no left hit came to the pixels that show it beside a winner on the ceiling: 64 samples a pixel leave holes in plenty.
#[test]
fn a_lamp_close_below_the_ceiling_is_whole() {
    let scene = builtin("cornell");
    let seen = |library: &ShaderLibrary, reuse, ipd_m| {
        let mut settings = method(Method::Path, reuse);
        settings.spp = 64;
        // What shines, without noise.
        settings.path.max_depth = 1;
        let views = parallel_views(scene.start_pose(), ipd_m, square_fov(19.65));
        let mut renderer = renderer_by(library, &scene, &settings, Eyes::Both, [48, 48]).unwrap();
        frame(&mut renderer, &views);
        bits(&radiance(&renderer, Eye::Right))
    };
    let embedded = ShaderLibrary::embedded();
    // The negative control: neighbours without a winner say nothing.
    let beside = "return pixel_beside(own, k);";
    let blind = changed("shared/cached_hit", beside, "return INVALID;");
    let mut lost = 0;
    for ipd_m in [0.063, 0.5] {
        let alone = seen(&embedded, Reuse::Off, ipd_m);
        assert!(alone == seen(&embedded, Reuse::Scatter, ipd_m), "{ipd_m} m");
        lost += usize::from(alone != seen(&blind, Reuse::Scatter, ipd_m));
    }
    assert!(lost > 0);
}

/// Whether all light that the surface sends to an eye comes over a lobe that eye paths follow: all glass, and metal that is
/// smoother than `photon.`.
pub fn has_sharp_lobe(material: &Material) -> bool {
    let alpha = f64::from(material.roughness).powi(2);
    let is_mirror = material.metallic == 1.0 && alpha <= 0.05;
    is_mirror || material.transmission == 1.0
}

#[test]
fn mirrors_and_glass_are_not_carried_over() {
    // What a mirror shows depends on the eye: every pixel whose first surface is view dependent must be filled, and say so
    // unless the left eye does not look there.
    let scene = builtin("gallery");
    let views = start_views(&scene, 40.0);
    let mut renderer = renderer(&scene, &method(Method::Photon, Reuse::Scatter), [96, 64]);
    let result = frame(&mut renderer, &views);
    let triangles = Triangles::of(&scene);
    let mut seen = 0;
    for (pixel, from) in provenance(&renderer).into_iter().enumerate() {
        let ray = pixel_ray(&views[1], pixel, [96, 64]);
        let Some((t, _, material)) = triangles.closest(ray.origin, ray.direction, 0.0) else {
            continue;
        };
        let material = &scene.materials[material as usize];
        if !has_sharp_lobe(material) {
            continue;
        }
        let what = format!("pixel {pixel}, {}", material.name);
        assert!(!Provenance::is_reused(from), "{what}");
        seen += 1;
        let in_left = views[0].pixel_from_point_in_world(ray.origin + ray.direction * t, 96, 64);
        match in_left {
            // Near the left image's border either may be right.
            Some((u, v)) if (1.0..95.0).contains(&u) && (1.0..63.0).contains(&v) => {
                assert_eq!(from, Provenance::ViewDependent as u32, "{what}");
            }
            _ => {}
        }
    }
    assert!(seen > 20, "only {seen} pixels show a mirror or glass");
    assert!(result.stereo.filled_because.view_dependent > 20);
}

/// A plate before a wall, both across the view, and what each right pixel must say of itself.
struct PlateBeforeWall {
    scene: Scene,
    views: [View; 2],
    /// Nothing is carried over to the plate: the right eye sees it from behind its shading normals.
    is_turned: bool,
}

impl PlateBeforeWall {
    const SIZE: u32 = 64;
    const IPD_M: f64 = 0.255;
    const PLATE_M: f64 = 1.0;
    const WALL_M: f64 = 3.0;
    /// Columns of the left image between which the plate is seen. The first lies just beyond a pixel's centre, which sees past the
    /// plate; the right eye's sample there lies 0.16 of a pixel beyond that centre, on the plate.
    const COLUMNS: [f64; 2] = [20.57, 36.3];

    /// Pixels that `metres` across the view make at a distance.
    fn pixels(metres: f64, distance_m: f64) -> f64 {
        metres * f64::from(Self::SIZE / 2) / distance_m
    }

    fn disparity(distance_m: f64) -> f64 {
        Self::pixels(Self::IPD_M, distance_m)
    }

    fn new(is_turned: bool, has_wall: bool) -> Self {
        let mut scene = Scene::default();
        let middle = f64::from(Self::SIZE / 2);
        let [left, right] = Self::COLUMNS
            .map(|column| (column - middle) / Self::pixels(1.0, Self::PLATE_M) - Self::IPD_M / 2.0);
        let corner = DVec3::new(left, -5.0, -Self::PLATE_M);
        let plate = quad(corner, DVec3::X * (right - left), DVec3::Y * 10.0);
        add(&mut scene, &plate, Material::lambert("plate", [0.5; 3]));
        if is_turned {
            // 88 degrees to the left: behind what lies more than 2 degrees to the left, as the plate does for the right eye.
            let mesh = scene.meshes.last_mut().unwrap();
            mesh.normals.fill([-0.999_4, 0.0, 0.034_9]);
        }
        if has_wall {
            let wall = Material::lambert("wall", [0.5; 3]);
            add(&mut scene, &square_ahead(10.0, Self::WALL_M), wall);
        }
        add_point_light(&mut scene, DVec3::Z, 10.0);
        Self {
            scene,
            views: parallel_views(Pose::IDENTITY, Self::IPD_M, square_fov(45.0)),
            is_turned,
        }
    }

    /// In f64, by what the left eye sees at the place of the right eye's point, and at the pixel centres beside it.
    fn due(&self, triangles: &Triangles, pixel: usize) -> Provenance {
        let size = [Self::SIZE; 2];
        let row = pixel as u32 / Self::SIZE;
        let ray = pixel_ray(&self.views[1], pixel, size);
        let Some((t, _, surface)) = triangles.closest(ray.origin, ray.direction, 0.0) else {
            return Provenance::Background;
        };
        let point = ray.origin + ray.direction * t;
        let Some((x, _)) = self.views[0].pixel_from_point_in_world(point, Self::SIZE, Self::SIZE)
        else {
            return Provenance::OutOfLeftView;
        };
        let shown = |column: f64| {
            let ray = pixel_ray(
                &self.views[0],
                (row * Self::SIZE) as usize + column as usize,
                size,
            );
            triangles
                .closest(ray.origin, ray.direction, 0.0)
                .map(|(_, _, surface)| surface)
        };
        let (corner, part) = ((x - 0.5).floor(), (x - 0.5).fract());
        let agreeing: f64 = [(corner, 1.0 - part), (corner + 1.0, part)]
            .into_iter()
            .filter(|(column, _)| (0.0..f64::from(Self::SIZE)).contains(column))
            .filter(|(column, _)| shown(*column) == Some(surface))
            .map(|(_, weight)| weight)
            .sum();
        assert!((agreeing - 0.2).abs() > 0.01, "choose other columns");
        let is_plate = surface == 0;
        // Of carried_samples.wesl: LEAST_WEIGHT.
        if agreeing > 0.2 && !(is_plate && self.is_turned) {
            Provenance::Reused
        } else if shown(x) == Some(surface) {
            Provenance::Gap
        } else if is_plate {
            // What the left eye sees there lies behind.
            Provenance::Edge
        } else {
            Provenance::Disoccluded
        }
    }
}

#[test]
fn filled_pixels_say_what_the_left_eye_sees_in_their_place() {
    let [plate, wall] =
        [PlateBeforeWall::PLATE_M, PlateBeforeWall::WALL_M].map(PlateBeforeWall::disparity);
    let [first, last] = PlateBeforeWall::COLUMNS;
    const SIDE: usize = PlateBeforeWall::SIZE as usize;
    for (is_turned, has_wall) in [(false, true), (true, true), (false, false)] {
        let scene = PlateBeforeWall::new(is_turned, has_wall);
        let triangles = Triangles::of(&scene.scene);
        for reuse in [Reuse::Scatter, Reuse::Lookup] {
            let what = format!("turned {is_turned}, wall {has_wall}, {reuse:?}");
            let size = [PlateBeforeWall::SIZE; 2];
            let settings = method(Method::Photon, reuse);
            let mut renderer = renderer(&scene.scene, &settings, size);
            frame(&mut renderer, &scene.views);
            let found = provenance(&renderer);
            for (pixel, from) in found.iter().enumerate() {
                let due = scene.due(&triangles, pixel);
                let at = format!("pixel {} of row {}", pixel % SIDE, pixel / SIDE);
                assert_eq!(*from, due as u32, "{what}, {at}: {due:?} is due");
            }
            // In closed form, columns of every row: how much further the plate moves than the wall, by how much the wall leaves the
            // left image, the plate's first column, and what is left of a plate to which nothing is carried.
            let [behind, outside] = if has_wall {
                [plate - wall, wall]
            } else {
                [0.0; 2]
            };
            let gap = if is_turned { last - first - 1.0 } else { 0.0 };
            for row in found.chunks(SIDE) {
                for (provenance, due) in [
                    (Provenance::Disoccluded, behind),
                    (Provenance::OutOfLeftView, outside),
                    (Provenance::Edge, 1.0),
                    (Provenance::Gap, gap),
                ] {
                    let columns = row
                        .iter()
                        .filter(|from| **from == provenance as u32)
                        .count();
                    let is_due =
                        (columns as f64 - due).abs() < if due.fract() == 0.0 { 0.5 } else { 1.0 };
                    assert!(
                        is_due,
                        "{what}: {columns} columns {provenance:?}, {due} due"
                    );
                }
            }
        }
    }
}
