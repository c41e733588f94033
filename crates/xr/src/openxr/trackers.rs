//! What follows fingers and eyes themselves, where the runtime offers it: joints of hands (`XR_EXT_hand_tracking`) and gaze
//! (`XR_EXT_eye_gaze_interaction`).

use openxr as xr;

use super::hands::{Asked, is_valid};
use super::pose_of;
use super::runtime::Runtime;
use crate::input::{Input, JOINTS, Joint};
use stereolux_base::pose::Pose;
use stereolux_gpu::vulkan_interop::openxr as interop;

const GAZE_PROFILE: &str = "/interaction_profiles/ext/eye_gaze_interaction";
const GAZE_SOURCE: &str = "/user/eyes_ext/input/gaze_ext/pose";

/// Trackers of a session; `None`: there is none.
pub(super) struct Trackers {
    /// Left, right.
    hands: Option<[xr::HandTracker; 2]>,
    /// With its space, once the action is attached.
    gaze: Option<(xr::Action<xr::Posef>, Option<xr::Space>)>,
}

impl Trackers {
    /// Makes them; `set` holds the gaze's action, and its binding is suggested. Where the runtime refuses what it offers,
    /// a warning says so.
    pub(super) fn new<G>(runtime: &Runtime, session: &xr::Session<G>, set: &xr::ActionSet) -> Self {
        let hands = || -> xr::Result<_> {
            let tracker = |hand| session.create_hand_tracker(hand);
            Ok([tracker(xr::Hand::LEFT)?, tracker(xr::Hand::RIGHT)?])
        };
        let gaze = || -> xr::Result<_> {
            let action = set.create_action("gaze", "Gaze", &[])?;
            let instance = &runtime.instance;
            let source = instance.string_to_path(GAZE_SOURCE)?;
            let profile = instance.string_to_path(GAZE_PROFILE)?;
            let bindings = [xr::Binding::new(&action, source)];
            instance.suggest_interaction_profile_bindings(profile, &bindings)?;
            Ok((action, None))
        };
        Self {
            hands: made(runtime.used.ext_hand_tracking, "joints of hands", hands),
            gaze: made(runtime.used.ext_eye_gaze_interaction, "gaze", gaze),
        }
    }

    /// Makes the gaze's space, when the set is attached.
    pub(super) fn attached<G>(&mut self, session: &xr::Session<G>) -> xr::Result<()> {
        if let Some((action, space)) = &mut self.gaze {
            *space = Some(action.create_space(session, xr::Path::NULL, xr::Posef::IDENTITY)?);
        }
        Ok(())
    }

    /// Adds what they see.
    pub(super) fn read(&self, input: &mut Input, at: &Asked<'_>) -> xr::Result<()> {
        let Asked {
            base,
            world_from_base,
            time,
        } = at;
        for (hand, tracker) in input.hands.iter_mut().zip(self.hands.iter().flatten()) {
            let joints = interop::locate_joints(tracker, base, *time)?;
            hand.joints = joints.and_then(|joints| in_world(world_from_base, &joints));
        }
        if let Some((_, Some(space))) = &self.gaze {
            let (location, _) = interop::relate(space, base, *time)?;
            // A gaze that is valid and not tracked is "sub-nominal" (XR_EXT_eye_gaze_interaction, "Eye gaze input"): a
            // guess that nothing should be aimed by.
            let tracked = xr::SpaceLocationFlags::POSITION_TRACKED
                | xr::SpaceLocationFlags::ORIENTATION_TRACKED;
            let flags = location.location_flags;
            let is_nominal = is_valid(flags) && flags.contains(tracked);
            input.gaze = is_nominal.then(|| world_from_base.then(&pose_of(&location.pose)));
        }
        Ok(())
    }
}

/// What `make` makes, if it is offered and the runtime keeps to that.
fn made<T>(is_offered: bool, what: &str, make: impl FnOnce() -> xr::Result<T>) -> Option<T> {
    let made = is_offered.then(make)?;
    made.map_err(|error| {
        log::warn!(
            "the runtime offers {what} and refuses to give it ({error}): all goes on without"
        );
    })
    .ok()
}

/// Joints in the world; `None` unless all of them are known.
fn in_world(
    world_from_base: &Pose,
    joints: &xr::HandJointLocations,
) -> Option<Box<[Joint; JOINTS]>> {
    let is_known = |joint: &xr::HandJointLocation| is_valid(joint.location_flags);
    joints.iter().all(is_known).then(|| {
        Box::new(joints.map(|joint| Joint {
            pose: world_from_base.then(&pose_of(&joint.pose)),
            radius_m: f64::from(joint.radius),
        }))
    })
}
