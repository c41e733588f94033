//! Joints of a simulated hand: a plain hand in closed form. Its palm is at the grip, its fingers point ahead (-Z), the back
//! of the hand is up (+Y). The squeeze curls the fingers; the trigger has thumb and index for itself and brings their tips
//! together.

use glam::{DMat3, DQuat, DVec3};

use super::input::{JOINTS, Joint, Side};
use stereolux_base::pose::Pose;

/// A finger of the right hand that is no thumb: where its metacarpal begins (right, up and back from the palm, metres), and
/// its bones from there to the tip, metres.
struct Finger {
    root_m: DVec3,
    bones_m: [f64; 4],
}

/// Index to little finger.
const FINGERS: [Finger; 4] = [
    Finger {
        root_m: DVec3::new(-0.025, 0.0, 0.04),
        bones_m: [0.065, 0.04, 0.023, 0.02],
    },
    Finger {
        // Its metacarpal's middle is the palm.
        root_m: DVec3::new(0.0, 0.0, 0.032),
        bones_m: [0.064, 0.045, 0.027, 0.021],
    },
    Finger {
        root_m: DVec3::new(0.02, 0.0, 0.032),
        bones_m: [0.06, 0.041, 0.026, 0.021],
    },
    Finger {
        root_m: DVec3::new(0.04, 0.0, 0.032),
        bones_m: [0.052, 0.033, 0.019, 0.019],
    },
];
/// How far the three knuckles of a finger bend in a fist, radians.
const FIST_RAD: [f64; 3] = [1.2, 1.6, 1.0];
/// How much of a fist the index makes to meet the thumb.
const PINCH: f64 = 0.6;

/// The thumb's metacarpal, its first knuckle, and its tip while nothing is pulled; as [`Finger::root_m`].
const THUMB_ROOT_M: DVec3 = DVec3::new(-0.025, -0.012, 0.045);
const THUMB_KNUCKLE_M: DVec3 = DVec3::new(-0.045, -0.028, 0.005);
const OPEN_THUMB_M: DVec3 = DVec3::new(-0.07, -0.035, -0.05);
/// The two bones after the knuckle, metres. Together they reach both tips, 0.061 m away, and all between them.
const THUMB_BONES_M: [f64; 2] = [0.038, 0.03];
/// Where the thumb's knuckles point, and its nail roughly: away from the palm.
const THUMB_OUT: DVec3 = DVec3::NEG_X;

const WRIST_M: DVec3 = DVec3::new(0.0, 0.0, 0.07);
/// From joint to skin: palm, wrist, then a finger from its root to its tip; metres.
const PALM_RADIUS_M: f64 = 0.015;
const WRIST_RADIUS_M: f64 = 0.025;
const RADII_M: [f64; 5] = [0.012, 0.01, 0.009, 0.008, 0.007];

/// A hand's joints in the world, in the order of `XrHandJointEXT`. `trigger` and `squeeze` are 0 to 1.
pub(super) fn joints_of(
    side: Side,
    world_from_grip: &Pose,
    trigger: f64,
    squeeze: f64,
) -> Box<[Joint; JOINTS]> {
    // Where the index's tip is once the trigger is pulled.
    let [.., meeting] = FINGERS[0].poses(PINCH);
    let thumb = thumb_poses(OPEN_THUMB_M.lerp(meeting.position, trigger));
    let for_pinch = squeeze + (PINCH - squeeze) * trigger;
    let fingers = FINGERS.iter().zip([for_pinch, squeeze, squeeze, squeeze]);
    let wrist = Pose::new(WRIST_M, DQuat::IDENTITY);
    let in_grip = [(Pose::IDENTITY, PALM_RADIUS_M), (wrist, WRIST_RADIUS_M)]
        .into_iter()
        // A thumb lacks a bone, so its first joint is as thick as the others' second.
        .chain(thumb.into_iter().zip(RADII_M.into_iter().skip(1)))
        .chain(fingers.flat_map(|(finger, curl)| finger.poses(curl).into_iter().zip(RADII_M)));
    let mut joints = Box::new(
        [Joint {
            pose: Pose::IDENTITY,
            radius_m: 0.0,
        }; JOINTS],
    );
    for (joint, (pose, radius_m)) in joints.iter_mut().zip(in_grip) {
        let pose = match side {
            Side::Left => mirrored(&pose),
            Side::Right => pose,
        };
        let Pose {
            position,
            orientation,
        } = world_from_grip.then(&pose);
        // Unit length to the last bits, as a recording reads it back.
        let pose = Pose::new(position, orientation.normalize());
        *joint = Joint { pose, radius_m };
    }
    joints
}

impl Finger {
    /// From the metacarpal to the tip; `curl` 1 is a fist.
    fn poses(&self, curl: f64) -> [Pose; 5] {
        let [first, second, third] = FIST_RAD;
        let bends_rad = [0.0, first, first + second, first + second + third];
        let mut place = Pose::new(self.root_m, DQuat::IDENTITY);
        let mut poses = [place; 5];
        for ((pose, bone_m), bend_rad) in poses.iter_mut().zip(self.bones_m).zip(bends_rad) {
            place.orientation = DQuat::from_rotation_x(-curl * bend_rad);
            *pose = place;
            place.position += place.orientation * (DVec3::NEG_Z * bone_m);
        }
        // The tip turns with the last bone.
        poses[4] = place;
        poses
    }
}

/// From the metacarpal to the tip, which is at `tip`: two bones over a knuckle, by the law of cosines.
fn thumb_poses(tip: DVec3) -> [Pose; 4] {
    let [near_m, far_m] = THUMB_BONES_M;
    let way = tip - THUMB_KNUCKLE_M;
    let length_m = way.length();
    let ahead = way / length_m;
    let outwards = THUMB_OUT.reject_from_normalized(ahead).normalize();
    let cosine = (near_m.powi(2) + length_m.powi(2) - far_m.powi(2)) / (2.0 * near_m * length_m);
    let sine = (1.0 - cosine.powi(2)).max(0.0).sqrt();
    let bend = THUMB_KNUCKLE_M + near_m * (cosine * ahead + sine * outwards);
    let last = along(tip - bend);
    [
        Pose::new(THUMB_ROOT_M, along(THUMB_KNUCKLE_M - THUMB_ROOT_M)),
        Pose::new(THUMB_KNUCKLE_M, along(bend - THUMB_KNUCKLE_M)),
        Pose::new(bend, last),
        Pose::new(tip, last),
    ]
}

/// The turn of a bone of the thumb: -Z along it, +Y outwards.
fn along(bone: DVec3) -> DQuat {
    let back = -bone.normalize();
    let up = THUMB_OUT.reject_from_normalized(back).normalize();
    DQuat::from_mat3(&DMat3::from_cols(up.cross(back), up, back))
}

/// The left hand's, from the right hand's: x the other way.
fn mirrored(pose: &Pose) -> Pose {
    let DQuat { x, y, z, w } = pose.orientation;
    Pose::new(
        pose.position * DVec3::new(-1.0, 1.0, 1.0),
        DQuat::from_xyzw(x, -y, -z, w),
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    /// First joint and last of each finger.
    const THUMB: [usize; 2] = [2, 5];
    const INDEX: [usize; 2] = [6, 10];
    const OTHERS: [[usize; 2]; 3] = [[11, 15], [16, 20], [21, 25]];

    fn grip() -> Pose {
        Pose::new(
            DVec3::new(1.0, 2.0, 3.0),
            DQuat::from_euler(glam::EulerRot::YXZ, 0.8, -0.5, 0.3),
        )
    }

    /// Joints in the grip's frame.
    fn local(side: Side, trigger: f64, squeeze: f64) -> Vec<Pose> {
        let grip = grip();
        let back = grip.orientation.conjugate();
        let in_grip = Pose::new(-(back * grip.position), back);
        let joints = joints_of(side, &grip, trigger, squeeze);
        joints
            .iter()
            .map(|joint| in_grip.then(&joint.pose))
            .collect()
    }

    fn distance(joints: &[Pose], a: usize, b: usize) -> f64 {
        (joints[a].position - joints[b].position).length()
    }

    /// In any pose bones keep their length, and each bone lies along its joint's -Z. Positions under 4 m and their products
    /// round by some 1e-15 m.
    #[test]
    fn bones_are_rigid_and_joints_look_along_them() {
        let open = local(Side::Right, 0.0, 0.0);
        for (side, step) in Side::BOTH
            .into_iter()
            .flat_map(|side| (0..121).map(move |s| (side, s)))
        {
            let (trigger, squeeze) = (f64::from(step / 11) / 10.0, f64::from(step % 11) / 10.0);
            let joints = local(side, trigger, squeeze);
            for [first, last] in [THUMB, INDEX].into_iter().chain(OTHERS) {
                for at in first..last {
                    let [bone, was] = [&joints, &open].map(|all| distance(all, at, at + 1));
                    assert!(
                        (bone - was).abs() < 1e-12,
                        "{trigger} {squeeze}: bone {at}: {bone}"
                    );
                    let ahead =
                        joints[at].position + joints[at].orientation * (DVec3::NEG_Z * bone);
                    let off = (ahead - joints[at + 1].position).length();
                    assert!(off < 1e-12, "{trigger} {squeeze}: joint {at}: {off}");
                }
                assert_eq!(joints[last].orientation, joints[last - 1].orientation);
            }
        }
    }

    #[test]
    fn squeezing_curls_fingers_and_the_trigger_brings_thumb_and_index_together() {
        for side in Side::BOTH {
            let [open, fist] = [0.0, 1.0].map(|squeeze| local(side, 0.0, squeeze));
            let middle = (open[11].position + open[12].position) / 2.0;
            assert!(open[0].position.length() < 1e-12 && middle.length() < 1e-12);
            for [_, tip] in OTHERS.into_iter().chain([INDEX]) {
                // Stretched out ahead; in a fist below the palm, nearer than half of the way.
                assert!(open[tip].position.z < -0.08 && fist[tip].position.y < -0.02);
                assert!(distance(&fist, 0, tip) < 0.6 * distance(&open, 0, tip));
            }
            for squeeze in [0.0, 0.5, 1.0] {
                let [apart, pinch] = [0.0, 1.0].map(|trigger| local(side, trigger, squeeze));
                assert!(distance(&apart, THUMB[1], INDEX[1]) > 0.04);
                assert!(distance(&pinch, THUMB[1], INDEX[1]) < 1e-12);
                for [first, last] in OTHERS {
                    assert_eq!(apart[first..=last], pinch[first..=last]);
                }
            }
        }
        // The thumbs of two hands beside each other, palms down, are between them.
        let [left, right] = Side::BOTH.map(|side| local(side, 0.0, 0.0)[THUMB[1]].position);
        assert!(left.x > 0.0 && right.x < 0.0);
    }
}
