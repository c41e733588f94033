//! Flag values made of several numbers: sizes, angles, poses, quaternions.

use glam::{DQuat, DVec3};

/// Farthest that a FOV angle may lie from straight ahead, in degrees; the tangent of 90 is infinite.
pub const MAX_FOV_DEGREES: f64 = 89.0;
/// How far a quaternion's length may be from 1 before it is refused.
pub const QUATERNION_TOLERANCE: f64 = 1e-3;
/// Largest coordinate of a head position in metres.
const MAX_COORDINATE_M: f64 = 1e9;

/// FOV angles in radians, signed as OpenXR signs them: left and down negative.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct FovAngles {
    /// Left edge.
    pub left_rad: f64,
    /// Right edge.
    pub right_rad: f64,
    /// Upper edge.
    pub up_rad: f64,
    /// Lower edge.
    pub down_rad: f64,
}

/// A head pose: `world_from_head`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HeadPose {
    /// Head position in the world, metres.
    pub position: DVec3,
    /// Rotation that takes head directions (-Z forward) to the world; unit length.
    pub orientation: DQuat,
}

/// Exactly `N` finite numbers, separated by blanks or commas.
///
/// # Errors
/// What is wrong, to follow the flag and its value.
pub fn numbers<const N: usize>(text: &str, names: &str) -> Result<[f64; N], String> {
    let mut values = [0.0; N];
    let mut count = 0;
    for word in text
        .split(|c: char| c.is_whitespace() || c == ',')
        .filter(|word| !word.is_empty())
    {
        let value: f64 = word
            .parse()
            .map_err(|_| format!("{} is not a number; give \"{names}\"", super::quoted(word)))?;
        if !value.is_finite() {
            return Err(format!("{word} is not finite; give \"{names}\""));
        }
        if let Some(slot) = values.get_mut(count) {
            *slot = value;
        }
        count += 1;
    }
    if count != N {
        return Err(format!("{count} numbers where {N} are needed: \"{names}\""));
    }
    Ok(values)
}

/// Width and height in pixels from `WxH`; the range is not checked.
#[must_use]
pub fn size(text: &str) -> Option<[u64; 2]> {
    let (width, height) = text.trim().split_once(['x', 'X'])?;
    Some([width.trim().parse().ok()?, height.trim().parse().ok()?])
}

/// A rotation from `qx qy qz qw`, normalised.
///
/// # Errors
/// What is wrong, to follow the flag and its value.
pub fn quaternion(values: [f64; 4]) -> Result<DQuat, String> {
    let rotation = DQuat::from_array(values);
    let length = rotation.length();
    if (length - 1.0).abs() > QUATERNION_TOLERANCE || !length.is_finite() {
        return Err(format!(
            "the quaternion's length is {length:.6}; it must be 1 within {QUATERNION_TOLERANCE}, in the order qx qy qz qw"
        ));
    }
    Ok(rotation.normalize())
}

/// A head pose from `x y z qx qy qz qw`.
///
/// # Errors
/// What is wrong, to follow the flag and its value.
pub fn pose(text: &str) -> Result<HeadPose, String> {
    let [x, y, z, qx, qy, qz, qw] = numbers::<7>(text, "x y z qx qy qz qw")?;
    let position = DVec3::new(x, y, z);
    if position.abs().max_element() > MAX_COORDINATE_M {
        return Err(format!(
            "a position is farther than {MAX_COORDINATE_M:e} m from the origin"
        ));
    }
    Ok(HeadPose {
        position,
        orientation: quaternion([qx, qy, qz, qw])?,
    })
}

/// FOV angles from `left right up down` in degrees.
///
/// # Errors
/// What is wrong, to follow the flag and its value.
pub fn fov(text: &str) -> Result<FovAngles, String> {
    let names = "left right up down";
    let angles = numbers::<4>(text, names)?;
    if let Some(angle) = angles.iter().find(|angle| angle.abs() > MAX_FOV_DEGREES) {
        return Err(format!(
            "{angle} degrees is beyond +-{MAX_FOV_DEGREES}; give \"{names}\" in degrees"
        ));
    }
    let [left, right, up, down] = angles;
    if left >= right {
        return Err(format!(
            "left ({left}) must be less than right ({right}); give \"{names}\" with left negative"
        ));
    }
    if down >= up {
        return Err(format!(
            "down ({down}) must be less than up ({up}); give \"{names}\" with down negative"
        ));
    }
    Ok(FovAngles {
        left_rad: left.to_radians(),
        right_rad: right.to_radians(),
        up_rad: up.to_radians(),
        down_rad: down.to_radians(),
    })
}
