//! The desktop as a headset: the mirror's window is looked at, mouse and keyboard are head and hands. An application runs on it as
//! on any other session, and what was done is recorded like that of a headset.

use std::collections::HashSet;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use glam::{DQuat, DVec2, DVec3};
use winit::event::{ElementState, MouseButton, MouseScrollDelta, WindowEvent};
use winit::keyboard::{KeyCode, PhysicalKey};

use crate::renderer::mirror::{Rectangle, rectangles};
use crate::viewer::fly_camera::{FlyCamera, Thrust};
use crate::xr::{
    ActionValues, Actions, Button, Buttons, FrameState, FrameSubmission, Hand, Headset, Input,
    LocatedViews, Pose, QualityFrom, RenderTargets, SessionInfo, Side, Tracked, View, XrError,
    XrSession,
};

/// Keys that are buttons; with Shift, those of the left hand.
const BUTTONS: [(KeyCode, Button); 5] = [
    (KeyCode::KeyF, Button::Squeeze),
    (KeyCode::KeyC, Button::Stick),
    (KeyCode::KeyZ, Button::Primary),
    (KeyCode::KeyX, Button::Secondary),
    (KeyCode::KeyM, Button::Menu),
];
/// What mouse and keyboard do, in a line.
pub fn controls() -> String {
    let buttons = BUTTONS.map(|(key, button)| {
        let key = format!("{key:?}");
        format!("{} {}", key.trim_start_matches("Key"), button.word())
    });
    format!(
        "right button looks, W A S D Q E walk, left button trigger, {}, arrows turn the stick, Shift is for the left hand",
        buttons.join(", ")
    )
}
/// How far before the eye the hand is that points through the mouse, metres.
const REACH_M: f64 = 0.4;
/// Where the other hand rests, in the head's frame; right for the right one.
const REST_M: DVec3 = DVec3::new(0.2, -0.3, -0.35);
/// Pixels of a wheel that scrolls in pixels, to the notch.
const PIXELS_PER_NOTCH: f64 = 50.0;

/// What is held and where the mouse is: the window writes it, the session reads it.
#[derive(Default)]
pub struct Desk {
    keys: HashSet<KeyCode>,
    /// Went down since the session last looked, also if they are up again.
    tapped: HashSet<KeyCode>,
    was_clicked: bool,
    mouse: Option<DVec2>,
    window: [u32; 2],
    clicks: bool,
    looks: bool,
    looked: DVec2,
    notches: f64,
    is_closed: bool,
}

/// Shared by the window and the session.
pub type SharedDesk = Arc<Mutex<Desk>>;

impl Desk {
    /// Takes an event of the window.
    pub fn take(&mut self, event: &WindowEvent) {
        match event {
            WindowEvent::CloseRequested | WindowEvent::Destroyed => self.is_closed = true,
            WindowEvent::Resized(size) => self.window = (*size).into(),
            // Whose release would be told to others.
            WindowEvent::Focused(false) => {
                self.keys.clear();
                (self.clicks, self.looks) = (false, false);
            }
            WindowEvent::KeyboardInput { event, .. } => {
                if let PhysicalKey::Code(key) = event.physical_key {
                    self.key(key, event.state == ElementState::Pressed);
                }
            }
            WindowEvent::MouseInput { state, button, .. } => {
                let is_down = *state == ElementState::Pressed;
                match button {
                    MouseButton::Left => {
                        self.clicks = is_down;
                        self.was_clicked |= is_down;
                    }
                    MouseButton::Right => self.looks = is_down,
                    _ => {}
                }
            }
            WindowEvent::CursorMoved { position, .. } => {
                self.point(DVec2::new(position.x, position.y));
            }
            WindowEvent::MouseWheel { delta, .. } => {
                self.notches += match delta {
                    MouseScrollDelta::LineDelta(_, lines) => f64::from(*lines),
                    MouseScrollDelta::PixelDelta(pixels) => pixels.y / PIXELS_PER_NOTCH,
                };
            }
            _ => {}
        }
    }

    fn key(&mut self, key: KeyCode, is_down: bool) {
        if is_down {
            self.keys.insert(key);
            self.tapped.insert(key);
        } else {
            self.keys.remove(&key);
        }
    }

    fn point(&mut self, at: DVec2) {
        if let Some(before) = self.mouse.replace(at).filter(|_| self.looks) {
            self.looked += at - before;
        }
    }

    fn axis(&self, more: KeyCode, less: KeyCode) -> f64 {
        let held = |key| f64::from(u8::from(self.keys.contains(&key)));
        held(more) - held(less)
    }

    /// The hand that keys and clicks are of.
    fn side(&self) -> Side {
        let shift = [KeyCode::ShiftLeft, KeyCode::ShiftRight];
        if shift.iter().any(|key| self.keys.contains(key)) {
            Side::Left
        } else {
            Side::Right
        }
    }

    /// What is held in a frame. A tap that is shorter than a frame is held for one.
    fn take_buttons(&mut self) -> Buttons {
        let is_down = |key| self.keys.contains(key) || self.tapped.contains(key);
        let held = BUTTONS.iter().filter(|(key, _)| is_down(key));
        let held: Buttons = held.map(|(_, button)| *button).collect();
        let held = held.with(Button::Trigger, self.clicks || self.was_clicked);
        self.tapped.clear();
        self.was_clicked = false;
        held
    }
}

/// Where a hand points that points through a pixel of the window; `None` beside the pictures.
fn aim_through(views: &[View; 2], mouse: DVec2, places: [Rectangle; 2]) -> Option<Pose> {
    let within = |place: &Rectangle| {
        let corner = DVec2::new(f64::from(place.x), f64::from(place.y));
        let size = DVec2::new(f64::from(place.width), f64::from(place.height));
        let share = (mouse - corner) / size;
        (share.cmpge(DVec2::ZERO) & share.cmplt(DVec2::ONE))
            .all()
            .then_some(share)
    };
    let mut eyes = views.iter().zip(&places);
    let (view, share) = eyes.find_map(|(view, place)| Some((view, within(place)?)))?;
    let ray = view.ray_through_pixel(share.x, share.y, 1, 1);
    let ahead = view.orientation * DVec3::NEG_Z;
    let turn = DQuat::from_rotation_arc(ahead, ray.direction) * view.orientation;
    let place = ray.origin + REACH_M * ray.direction;
    Some(Pose::new(place, turn.normalize()))
}

/// A session of the desktop. It ends with its window.
pub struct DesktopSession {
    info: SessionInfo,
    headset: Headset,
    desk: SharedDesk,
    head: FlyCamera,
    actions: Actions,
    /// Pixels of an eye's image.
    size: [u32; 2],
    frame_limit: Option<u64>,
    frames: u64,
    began: Option<Instant>,
    time_ns: i64,
    period_ns: i64,
}

impl DesktopSession {
    /// A head that starts at `start` in a scene so large, longest edge in metres.
    pub fn new(
        headset: Headset,
        start: Pose,
        scene_size_m: f64,
        size: [u32; 2],
        actions: Actions,
        frame_limit: Option<u64>,
    ) -> Self {
        Self {
            info: SessionInfo::of_profile("desktop".to_owned(), &headset),
            period_ns: (1e9 / headset.refresh_hz).round() as i64,
            headset,
            desk: SharedDesk::default(),
            head: FlyCamera::new(start, scene_size_m),
            actions,
            size,
            frame_limit,
            frames: 0,
            began: None,
            time_ns: 0,
        }
    }

    /// What the window is to write to.
    pub fn desk(&self) -> SharedDesk {
        Arc::clone(&self.desk)
    }

    fn views(&self) -> [View; 2] {
        self.headset.views_from_head(&self.head.pose())
    }

    /// Moves the head for the time since the last frame.
    fn advance(&mut self, seconds: f64) {
        let mut desk = self.desk.lock().unwrap_or_else(PoisonError::into_inner);
        self.head.look(std::mem::take(&mut desk.looked).to_array());
        self.head.dolly(std::mem::take(&mut desk.notches));
        let thrust = Thrust {
            right: desk.axis(KeyCode::KeyD, KeyCode::KeyA),
            up: desk.axis(KeyCode::KeyE, KeyCode::KeyQ),
            ahead: desk.axis(KeyCode::KeyW, KeyCode::KeyS),
            runs: false,
            is_slow: false,
        };
        self.head.advance(thrust, seconds);
    }
}

impl XrSession for DesktopSession {
    fn info(&self) -> &SessionInfo {
        &self.info
    }

    fn wait_frame(&mut self) -> Result<Option<FrameState>, XrError> {
        let desk = self.desk.lock();
        let is_closed = desk.unwrap_or_else(PoisonError::into_inner).is_closed;
        if is_closed || self.frame_limit.is_some_and(|most| self.frames >= most) {
            return Ok(None);
        }
        let began = *self.began.get_or_insert_with(Instant::now);
        // At the display's pace at most; a slower frame is shown when it is there.
        let due_ns = if self.frames == 0 {
            0
        } else {
            self.time_ns + self.period_ns
        };
        let due = Duration::from_nanos(u64::try_from(due_ns).unwrap_or(0));
        std::thread::sleep(due.saturating_sub(began.elapsed()));
        let now_ns = i64::try_from(began.elapsed().as_nanos()).unwrap_or(i64::MAX);
        let before_ns = std::mem::replace(&mut self.time_ns, now_ns.max(due_ns));
        self.frames += 1;
        self.advance((self.time_ns - before_ns) as f64 * 1e-9);
        Ok(Some(FrameState {
            predicted_display_time_ns: self.time_ns,
            period_ns: self.period_ns,
            should_render: true,
            switch_reuse: false,
            quality: QualityFrom::Application,
        }))
    }

    fn begin_frame(&mut self) -> Result<(), XrError> {
        Ok(())
    }

    fn locate_views(&mut self, _: i64) -> Result<Option<LocatedViews>, XrError> {
        Ok(Some(LocatedViews::valid(self.views())))
    }

    fn locate_input(&mut self, _: i64) -> Result<Input, XrError> {
        let mut desk = self.desk.lock().unwrap_or_else(PoisonError::into_inner);
        let head = self.head.pose();
        let rest = |side: Side| {
            let mirror = DVec3::new(if side == Side::Left { -1.0 } else { 1.0 }, 1.0, 1.0);
            head.then(&Pose::new(mirror * REST_M, DQuat::IDENTITY))
        };
        let places = rectangles(desk.window, self.size);
        let through = desk.mouse.zip(places);
        let through = through.and_then(|(at, places)| aim_through(&self.views(), at, places));
        let mut input = Input::default();
        for side in Side::BOTH {
            let is_active = side == desk.side();
            let pose = through.filter(|_| is_active).unwrap_or_else(|| rest(side));
            let hand = Hand {
                grip: Some(Tracked::still(pose)),
                aim: Some(Tracked::still(pose)),
                ..Hand::default()
            };
            input.hands[side as usize] = hand;
            if is_active {
                let hand = &mut input.hands[side as usize];
                hand.pressed = desk.take_buttons();
                hand.trigger = f64::from(u8::from(hand.pressed.has(Button::Trigger)));
                hand.squeeze = f64::from(u8::from(hand.pressed.has(Button::Squeeze)));
                hand.stick = DVec2::new(
                    desk.axis(KeyCode::ArrowRight, KeyCode::ArrowLeft),
                    desk.axis(KeyCode::ArrowUp, KeyCode::ArrowDown),
                );
            }
        }
        input.actions = ActionValues::of_touch(&self.actions, &input.hands);
        Ok(input)
    }

    fn move_wearer(&mut self, by_m: DVec3) {
        let pose = self.head.pose();
        self.head
            .set_pose(Pose::new(pose.position + by_m, pose.orientation));
    }

    fn acquire_targets(&mut self) -> Result<RenderTargets, XrError> {
        Ok(RenderTargets::FrameLoopOwned)
    }

    fn end_frame(&mut self, _: FrameSubmission<'_>) -> Result<(), XrError> {
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn session() -> DesktopSession {
        let headset = Headset::load("symmetric").unwrap();
        DesktopSession::new(
            headset,
            Pose::IDENTITY,
            5.0,
            [100, 100],
            Actions::default(),
            Some(3),
        )
    }

    /// In a window of 400 x 200 each eye's picture has 200 x 200 pixels; a point seen by an eye at a pixel is on the ray that
    /// goes through that pixel of the window, to the rounding of a few products.
    #[test]
    fn a_hand_points_through_the_mouse() {
        let mut session = session();
        let desk = session.desk();
        desk.lock().unwrap().window = [400, 200];
        let views = session.views();
        for (eye, corner) in views.iter().zip([0.0, 200.0]) {
            let point = DVec3::new(0.3, -0.2, -2.0);
            let seen = point - eye.position_in_world;
            let tangents = eye.fov.tangents();
            let across = (seen.x / -seen.z - tangents.left) / (tangents.right - tangents.left);
            let down = (tangents.up - seen.y / -seen.z) / (tangents.up - tangents.down);
            desk.lock()
                .unwrap()
                .point(DVec2::new(corner + 200.0 * across, 200.0 * down));
            let input = session.locate_input(0).unwrap();
            let aim = input.hand(Side::Right).aim.unwrap();
            let to_point = (point - aim.pose.position).normalize();
            assert!((aim.direction() - to_point).length() < 1e-12);
        }
        // Beside the window it points ahead.
        desk.lock().unwrap().point(DVec2::new(-1.0, 0.0));
        let input = session.locate_input(0).unwrap();
        assert!((input.hand(Side::Right).aim.unwrap().direction() - DVec3::NEG_Z).length() < 1e-12);
    }

    #[test]
    fn keys_and_clicks_are_buttons_of_the_hand_that_shift_chooses() {
        let mut session = session();
        let desk = session.desk();
        desk.lock().unwrap().clicks = true;
        desk.lock().unwrap().key(KeyCode::KeyZ, true);
        // Tapped between two frames.
        desk.lock().unwrap().key(KeyCode::KeyX, true);
        desk.lock().unwrap().key(KeyCode::KeyX, false);
        let input = session.locate_input(0).unwrap();
        assert!(input.hand(Side::Right).pressed.has(Button::Trigger));
        assert!(input.hand(Side::Right).pressed.has(Button::Primary));
        assert!(input.hand(Side::Right).pressed.has(Button::Secondary));
        assert_eq!(input.hand(Side::Right).trigger, 1.0);
        let next = session.locate_input(0).unwrap();
        assert!(next.hand(Side::Right).pressed.has(Button::Primary));
        assert!(!next.hand(Side::Right).pressed.has(Button::Secondary));
        assert_eq!(input.hand(Side::Left).pressed, Buttons::default());
        desk.lock().unwrap().key(KeyCode::ShiftLeft, true);
        let input = session.locate_input(0).unwrap();
        assert!(input.hand(Side::Left).pressed.has(Button::Trigger));
        assert_eq!(input.hand(Side::Right).pressed, Buttons::default());
        desk.lock().unwrap().take(&WindowEvent::Focused(false));
        let input = session.locate_input(0).unwrap();
        assert_eq!(input.hand(Side::Left).pressed, Buttons::default());
    }

    #[test]
    fn frames_go_on_in_time_until_the_window_is_closed() {
        let mut session = session();
        session.desk().lock().unwrap().key(KeyCode::KeyW, true);
        let first = session.wait_frame().unwrap().unwrap();
        let second = session.wait_frame().unwrap().unwrap();
        let passed_ns = second.predicted_display_time_ns - first.predicted_display_time_ns;
        assert!(passed_ns >= session.period_ns);
        // Ahead by its speed and that time.
        assert!(session.views()[0].position_in_world.z < 0.0);
        session
            .desk()
            .lock()
            .unwrap()
            .take(&WindowEvent::CloseRequested);
        assert!(session.wait_frame().unwrap().is_none());
    }
}
