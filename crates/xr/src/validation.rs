//! What may pass from outside into the frame loop: tracking flags, finite numbers, quaternion length,
//! field-of-view order and limits.
//!
//! A file with a bad pose is an error that names file, line and field (the readers build it from the
//! [`Fault`]s here). A runtime with a bad pose is no error, because tracking comes and goes: [`Validated`]
//! repeats the last good views.

use super::view::{Fov, Pose, View};
use super::{
    ControllerModel, FrameState, FrameSubmission, Input, LocatedViews, Pulse, RenderTargets,
    SessionInfo, XrError, XrSession,
};
use glam::{DQuat, DVec3};
use std::fmt;
use std::ops::RangeInclusive;

/// Every edge of a field of view lies within this angle of straight ahead, degrees. Tangents reach 57
/// there; a flat image has no use for more.
pub const MAX_FOV_ANGLE_DEG: f64 = 89.0;

/// Quaternions off unit length by no more than this are normalised, others refused.
pub const QUATERNION_LENGTH_TOLERANCE: f64 = 1e-3;

/// Squared lengths this near 1 are left bit for bit as they are. Normalising leaves a squared length
/// within about 6e-16 of 1 and measuring it adds about 4e-16, so whatever was normalised once is never
/// changed again: that is what lets a recording replay exactly.
const UNIT_LENGTH_SQUARED_SLACK: f64 = 4e-15;

/// What is wrong with a value, and which one.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Fault {
    /// Path of the field inside the value that was checked, such as `views[1].fov.left`.
    pub field: String,
    /// What is wrong and what would do.
    pub what: String,
}

impl Fault {
    pub(super) fn new(field: impl Into<String>, what: impl Into<String>) -> Self {
        Self {
            field: field.into(),
            what: what.into(),
        }
    }

    /// The same fault seen from a level further out.
    #[must_use]
    pub fn under(self, outer: &str) -> Self {
        Self {
            field: format!("{outer}.{}", self.field),
            what: self.what,
        }
    }
}

impl fmt::Display for Fault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}", self.field, self.what)
    }
}

/// A unit quaternion from x, y, z, w: normalised if its length is within
/// [`QUATERNION_LENGTH_TOLERANCE`] of 1, left untouched if it is 1 already.
///
/// # Errors
/// What is wrong: not finite, or too far from unit length.
pub fn unit_quaternion(x: f64, y: f64, z: f64, w: f64) -> Result<DQuat, String> {
    let q = DQuat::from_xyzw(x, y, z, w);
    if !q.is_finite() {
        return Err(format!("({x}, {y}, {z}, {w}) is not finite"));
    }
    let length_squared = q.length_squared();
    if (length_squared - 1.0).abs() <= UNIT_LENGTH_SQUARED_SLACK {
        return Ok(q);
    }
    let length = length_squared.sqrt();
    if (length - 1.0).abs() > QUATERNION_LENGTH_TOLERANCE {
        return Err(format!(
            "a quaternion of length {length}; a rotation needs length 1 (within {QUATERNION_LENGTH_TOLERANCE})"
        ));
    }
    Ok(q.normalize())
}

/// Finite, left < right, down < up, and all within +-[`MAX_FOV_ANGLE_DEG`].
///
/// # Errors
/// The first fault; its field is `left`, `right`, `up` or `down`.
pub fn check_fov(fov: &Fov) -> Result<(), Fault> {
    let edges = [
        ("left", fov.angle_left),
        ("right", fov.angle_right),
        ("up", fov.angle_up),
        ("down", fov.angle_down),
    ];
    for (name, angle) in edges {
        let degrees = angle.to_degrees();
        if !angle.is_finite() {
            return Err(Fault::new(name, format!("{angle} is not a finite angle")));
        }
        // A hair over: 89 degrees written in radians may come back as 89.00000000000001.
        if degrees.abs() > MAX_FOV_ANGLE_DEG + 1e-9 {
            return Err(Fault::new(
                name,
                format!(
                    "{angle} rad ({degrees:.2} degrees) lies beyond +-{MAX_FOV_ANGLE_DEG} degrees"
                ),
            ));
        }
    }
    let order = |low: (&str, f64), high: (&str, f64)| {
        if low.1 < high.1 {
            return Ok(());
        }
        Err(Fault::new(
            low.0,
            format!(
                "{} rad is not less than {} ({} rad); left and down are the smaller angles, usually negative",
                low.1, high.0, high.1
            ),
        ))
    };
    order(edges[0], edges[1])?;
    order(edges[3], edges[2])
}

/// A number of a range, or what is wrong with it; NaN lies in none. `unit` follows a number, such as ` m`.
pub(super) fn within(value: f64, range: RangeInclusive<f64>, unit: &str) -> Result<f64, String> {
    if range.contains(&value) {
        return Ok(value);
    }
    let (least, most) = range.into_inner();
    Err(format!(
        "{value}{unit} is not between {least} and {most}{unit}"
    ))
}

/// A finite position with a unit orientation.
pub(super) fn check_pose(pose: &Pose) -> Result<Pose, Fault> {
    if !pose.position.is_finite() {
        let shown = format!("{} is not finite", pose.position);
        return Err(Fault::new("position", shown));
    }
    let q = pose.orientation;
    let orientation = unit_quaternion(q.x, q.y, q.z, q.w);
    let orientation = orientation.map_err(|what| Fault::new("orientation", what))?;
    Ok(Pose::new(pose.position, orientation))
}

fn check_view(view: &View) -> Result<View, Fault> {
    let pose = check_pose(&Pose::new(view.position_in_world, view.orientation))?;
    check_fov(&view.fov).map_err(|fault| fault.under("fov"))?;
    Ok(View {
        orientation: pose.orientation,
        ..*view
    })
}

/// Checks flags and numbers, and returns the views with their quaternions normalised.
///
/// # Errors
/// The first fault, its field named as in the native trace (`flags.position_valid`,
/// `views[0].orientation`, `views[1].fov.left`).
pub fn check_views(located: &LocatedViews) -> Result<LocatedViews, Fault> {
    let flags = [
        ("flags.position_valid", located.flags.position_valid),
        ("flags.orientation_valid", located.flags.orientation_valid),
    ];
    for (name, valid) in flags {
        if !valid {
            return Err(Fault::new(name, "the tracker does not vouch for this pose"));
        }
    }
    let [left, right] = &located.views;
    let left = check_view(left).map_err(|fault| fault.under("views[0]"))?;
    let right = check_view(right).map_err(|fault| fault.under("views[1]"))?;
    Ok(LocatedViews {
        views: [left, right],
        ..*located
    })
}

/// Any session, with its poses checked: an invalid pose becomes the last good one again, marked as
/// `repeated`; before the first good one there are no views. Invalid input counts as none. A [`super::Recorder`] belongs outside of this,
/// so that it writes what was really used.
#[derive(Debug)]
pub struct Validated<S> {
    inner: S,
    last_good: Option<LocatedViews>,
    last_fault: Option<Fault>,
    /// The last pose was invalid.
    is_astray: bool,
    last_input_fault: Option<Fault>,
}

impl<S: XrSession> Validated<S> {
    /// Wraps `inner`.
    pub fn new(inner: S) -> Self {
        Self {
            inner,
            last_good: None,
            last_fault: None,
            is_astray: false,
            last_input_fault: None,
        }
    }

    /// What was wrong with the latest invalid pose.
    pub fn last_fault(&self) -> Option<&Fault> {
        self.last_fault.as_ref()
    }

    /// `located` if it is valid, else the last good views.
    fn good(&mut self, located: Option<LocatedViews>) -> Option<LocatedViews> {
        let checked = match located {
            Some(located) => check_views(&located),
            None => Err(Fault::new("views", "no pose of both eyes is known")),
        };
        match checked {
            Ok(good) => {
                self.is_astray = false;
                self.last_good = Some(good);
                Some(good)
            }
            Err(fault) => {
                // Once per spell, not per frame: a lost tracker would flood the log at 90 Hz.
                let was_astray = std::mem::replace(&mut self.is_astray, true);
                if !was_astray || self.last_fault.as_ref() != Some(&fault) {
                    log::warn!("invalid pose from {}: {fault}", self.inner.info().source);
                }
                self.last_fault = Some(fault);
                self.last_good.map(|good| LocatedViews {
                    repeated: true,
                    ..good
                })
            }
        }
    }
}

impl<S: XrSession> XrSession for Validated<S> {
    fn info(&self) -> &SessionInfo {
        self.inner.info()
    }

    fn wait_frame(&mut self) -> Result<Option<FrameState>, XrError> {
        self.inner.wait_frame()
    }

    fn begin_frame(&mut self) -> Result<(), XrError> {
        self.inner.begin_frame()
    }

    fn locate_views(&mut self, display_time_ns: i64) -> Result<Option<LocatedViews>, XrError> {
        let located = self.inner.locate_views(display_time_ns)?;
        Ok(self.good(located))
    }

    fn relocate_views(&mut self, display_time_ns: i64) -> Result<Option<LocatedViews>, XrError> {
        let located = self.inner.relocate_views(display_time_ns)?;
        Ok(self.good(located))
    }

    fn locate_input(&mut self, display_time_ns: i64) -> Result<Input, XrError> {
        match self.inner.locate_input(display_time_ns)?.checked() {
            Ok(input) => {
                self.last_input_fault = None;
                Ok(input)
            }
            Err(fault) => {
                // A hand that is nowhere does nothing. Once per spell, as above.
                if self.last_input_fault.as_ref() != Some(&fault) {
                    log::warn!("invalid input from {}: {fault}", self.inner.info().source);
                }
                self.last_input_fault = Some(fault);
                Ok(Input::default())
            }
        }
    }

    fn controller_model(&mut self) -> Result<Option<ControllerModel>, XrError> {
        self.inner.controller_model()
    }

    fn acquire_targets(&mut self) -> Result<RenderTargets, XrError> {
        self.inner.acquire_targets()
    }

    fn end_frame(&mut self, submission: FrameSubmission<'_>) -> Result<(), XrError> {
        self.inner.end_frame(submission)
    }

    fn vibrate(&mut self, pulse: &Pulse) -> Result<(), XrError> {
        self.inner.vibrate(pulse)
    }

    fn move_wearer(&mut self, by_m: DVec3) {
        // The last good views move along, should they have to be shown again.
        let views = self.last_good.iter_mut().flat_map(|good| &mut good.views);
        for view in views {
            view.position_in_world += by_m;
        }
        self.inner.move_wearer(by_m);
    }
}
