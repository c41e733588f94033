//! Motion vectors of what bends: where the surface point of each pixel was a frame ago, against an exhaustive search over
//! the scene's triangles, skinned, morphed and placed in f64.

use glam::{DQuat, DVec3};
use stereolux::renderer::Eye;
use stereolux::scene::{Instance, Scene, ScenePose};
use stereolux::settings::Reuse;
use stereolux::xr::{Pose, View};

use super::reconstruction::{IPD_M, MOTION_TOLERANCE_PX, SIZE, filtered, project, sample_at};
use super::support::{builtin, meet, parallel_views, play, renderer, square_fov};

/// Corners in the world of every triangle of a placed mesh.
struct Placed {
    deforms: bool,
    triangles: Vec<[DVec3; 3]>,
}

fn placed(scene: &Scene, pose: &ScenePose) -> Vec<Placed> {
    let place = |instance: &Instance| {
        let mesh = &scene.meshes[instance.mesh];
        let positions = scene.positions_in_world(instance.node, mesh, pose);
        let corner = |vertex: u32| positions[vertex as usize];
        let triangles = mesh.triangles.iter().map(|t| t.vertices.map(corner));
        Placed {
            deforms: scene.deforms(instance.node),
            triangles: triangles.collect(),
        }
    };
    scene.instances().iter().map(place).collect()
}

/// Where a ray meets a scene: instance, triangle and the weights of its second and third corner.
type Hit = (usize, usize, [f64; 2]);

/// The nearest hit from either side.
fn nearest(scene: &[Placed], origin: DVec3, direction: DVec3) -> Option<Hit> {
    let mut found: Option<(f64, Hit)> = None;
    for (instance, placed) in scene.iter().enumerate() {
        for (triangle, corners) in placed.triangles.iter().enumerate() {
            if let Some((distance, weights)) = meet(origin, direction, *corners)
                && distance > 1e-6
                && found.is_none_or(|(nearest, _)| distance < nearest)
            {
                found = Some((distance, (instance, triangle, weights)));
            }
        }
    }
    found.map(|(_, hit)| hit)
}

/// What the eye sees at a place of its image.
fn seen(scene: &[Placed], view: &View, at: [f64; 2]) -> Option<Hit> {
    let ray = view.ray_through_pixel(at[0], at[1], SIZE, SIZE);
    nearest(scene, ray.origin, ray.direction)
}

#[test]
fn motion_of_skinned_and_morphed_surfaces_leads_to_their_points_of_the_frame_before() {
    let scene = builtin("parade");
    let clip = scene.clip("parade").unwrap().unwrap();
    let mut renderer = renderer(&scene, &filtered(Reuse::Off, |_| {}), [SIZE, SIZE]);
    let head = scene.start_pose();
    let views = |frame: usize| {
        let step = frame as f64;
        let turn = DQuat::from_euler(glam::EulerRot::YXZ, 0.01 * step, 0.005 * step, 0.0);
        let moved = head.position + DVec3::new(0.02, -0.01, 0.015) * step;
        let head = Pose::new(moved, head.orientation * turn);
        parallel_views(head, IPD_M, square_fov(25.0))
    };
    let times_s = [0.3, 0.42, 1.1];
    let poses = times_s.map(|time_s| scene.pose_at(clip, time_s));
    for frame in 0..times_s.len() {
        renderer.set_pose(&poses[frame]);
        play(&mut renderer, &views(frame), frame as u32..frame as u32 + 1);
        if frame == 0 {
            continue;
        }
        let [now, then] = [frame, frame - 1].map(|at| placed(&scene, &poses[at]));
        for (eye, index) in [(Eye::Left, 0), (Eye::Right, 1)] {
            let (view, before) = (views(frame)[index], views(frame - 1)[index]);
            let (mut checked, mut bent) = (0, 0);
            let (records, motion) = renderer.read_motion(eye).unwrap().unwrap();
            for (pixel, moved) in motion.iter().enumerate() {
                if records[pixel][0] == 0 {
                    continue;
                }
                // The sample's own place.
                let center = sample_at(pixel, &records[pixel]);
                let Some((instance, triangle, [v, w])) = seen(&now, &view, center) else {
                    continue;
                };
                if !now[instance].deforms {
                    continue;
                }
                let point = |scene: &[Placed]| {
                    let [a, b, c] = scene[instance].triangles[triangle];
                    a + v * (b - a) + w * (c - a)
                };
                let Some(expected) = project(&before, point(&then)) else {
                    continue;
                };
                let found = [0, 1].map(|axis| center[axis] + f64::from(moved[axis]));
                let off = |place: [f64; 2]| {
                    let [x, y] = [0, 1].map(|axis| (found[axis] - place[axis]).abs());
                    x.max(y)
                };
                if off(expected) > MOTION_TOLERANCE_PX || moved[3] != 1.0 {
                    // On a silhouette f32 may meet what lies behind.
                    let step = 0.01;
                    let around = [[-step, 0.0], [step, 0.0], [0.0, -step], [0.0, step]];
                    let is_silhouette = around.iter().any(|[x, y]| {
                        let near = seen(&now, &view, [center[0] + x, center[1] + y]);
                        near.is_none_or(|(other, ..)| other != instance)
                    });
                    let what = format!("frame {frame}, {eye:?}, pixel {pixel}");
                    assert!(is_silhouette, "{what}: {found:?}, not {expected:?}");
                    continue;
                }
                checked += 1;
                // Negative control: a point that only the eye's motion moves would be found out.
                let still = project(&before, point(&now));
                bent += usize::from(still.is_none_or(|still| off(still) > MOTION_TOLERANCE_PX));
            }
            let what = format!("frame {frame}, {eye:?}: {bent} of {checked}");
            assert!(checked > 300 && bent > checked / 2, "{what}");
        }
    }
}
