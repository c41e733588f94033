//! A recording that the window plays: views come from it in place of the head that is moved by hand.

use std::sync::Arc;

use crate::xr::{View, XrError, XrSession, all_frames};

/// All frames of a session that ends, to be played, stepped and scrubbed.
#[derive(Clone, Debug)]
pub struct Recording {
    /// What it is, for people.
    pub name: String,
    /// Display time in nanoseconds and both eyes' views.
    frames: Vec<(i64, [View; 2])>,
}

impl Recording {
    /// Takes the frames out of `session`, an hour of them at most.
    ///
    /// # Errors
    /// Those of the session.
    pub fn of(session: &mut dyn XrSession) -> Result<Self, XrError> {
        let most = (3600.0 * session.info().refresh_hz) as usize;
        Ok(Self {
            name: session.info().source.clone(),
            frames: all_frames(session, most)?,
        })
    }

    /// Frames.
    pub fn len(&self) -> usize {
        self.frames.len()
    }

    /// True if there is nothing to play.
    pub fn is_empty(&self) -> bool {
        self.frames.is_empty()
    }

    /// Seconds from the first frame to frame `index`.
    pub fn seconds_at(&self, index: usize) -> f64 {
        let first = self.frames.first().map_or(0, |frame| frame.0);
        let at = self.frames.get(index).map_or(first, |frame| frame.0);
        (at - first) as f64 * 1e-9
    }

    /// The last frame that is due `seconds` after the first.
    pub fn frame_at(&self, seconds: f64) -> usize {
        let first = self.frames.first().map_or(0, |frame| frame.0);
        let due = self
            .frames
            .partition_point(|frame| (frame.0 - first) as f64 * 1e-9 <= seconds);
        due.saturating_sub(1)
    }

    /// Views of a frame; beyond the end those of the last.
    pub fn views(&self, index: usize) -> Option<[View; 2]> {
        let index = index.min(self.frames.len().saturating_sub(1));
        self.frames.get(index).map(|frame| frame.1)
    }
}

/// What plays a recording.
#[derive(Clone, Debug)]
pub struct Player {
    /// What is played.
    pub recording: Arc<Recording>,
    /// Runs with the clock.
    pub is_playing: bool,
    /// The head is elsewhere until it plays on.
    is_left: bool,
    seconds: f64,
}

impl Player {
    /// Stands at the first frame.
    pub fn new(recording: Recording) -> Self {
        Self {
            recording: Arc::new(recording),
            is_playing: false,
            is_left: false,
            seconds: 0.0,
        }
    }

    /// Frame that is shown.
    pub fn frame(&self) -> usize {
        self.recording.frame_at(self.seconds)
    }

    /// Goes to a frame.
    pub fn seek(&mut self, frame: usize) {
        self.is_left = false;
        let last = self.recording.len().saturating_sub(1);
        self.seconds = self.recording.seconds_at(frame.min(last));
    }

    /// Pauses, and lets the head go elsewhere until it plays on.
    pub fn leave(&mut self) {
        self.is_playing = false;
        self.is_left = true;
    }

    /// Whether the head is elsewhere.
    pub fn is_left(&self) -> bool {
        self.is_left
    }

    /// One frame on (or back), and pauses.
    pub fn step(&mut self, frames: i64) {
        self.is_playing = false;
        let frame = self.frame() as i64 + frames;
        self.seek(usize::try_from(frame).unwrap_or(0));
    }

    /// Lets the clock run; at the end it pauses there, from where it begins anew.
    pub fn advance(&mut self, seconds: f64) {
        if !self.is_playing {
            return;
        }
        self.is_left = false;
        let end = self
            .recording
            .seconds_at(self.recording.len().saturating_sub(1));
        if self.seconds >= end {
            self.seconds = 0.0;
        }
        self.seconds += seconds;
        if self.seconds >= end {
            self.seconds = end;
            self.is_playing = false;
        }
    }

    /// What is seen now; `None` while the head is elsewhere.
    pub fn views(&self) -> Option<[View; 2]> {
        self.recording.views(self.frame()).filter(|_| !self.is_left)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::xr::{Headset, Motion, Pose, SimulatedSession};

    fn recording(frames: u64) -> Recording {
        let headset = Headset::load("symmetric").unwrap();
        let mut session = SimulatedSession::new(headset, Motion::Yaw, Pose::IDENTITY, Some(frames));
        Recording::of(&mut session).unwrap()
    }

    #[test]
    fn every_frame_is_found_at_its_own_time() {
        let recording = recording(50);
        assert_eq!(recording.len(), 50);
        for index in 0..50 {
            assert_eq!(recording.frame_at(recording.seconds_at(index)), index);
        }
        assert_eq!(recording.frame_at(-1.0), 0);
        assert_eq!(recording.frame_at(1e9), 49);
    }

    #[test]
    fn play_steps_and_pauses_at_the_end() {
        let mut player = Player::new(recording(10));
        player.step(3);
        assert_eq!(player.frame(), 3);
        player.step(-5);
        assert_eq!(player.frame(), 0);
        player.advance(1.0);
        assert_eq!(player.frame(), 0, "paused");
        player.is_playing = true;
        let period = player.recording.seconds_at(1);
        player.advance(2.5 * period);
        assert_eq!(player.frame(), 2);
        player.advance(60.0);
        assert_eq!(player.frame(), 9);
        assert!(!player.is_playing);
        assert_eq!(player.views(), player.recording.views(9));
        player.is_playing = true;
        player.advance(1.5 * period);
        assert_eq!(player.frame(), 1, "played again");
        player.advance(60.0);
        player.leave();
        assert_eq!(player.views(), None);
        player.step(-2);
        assert_eq!(player.views(), player.recording.views(7));
    }
}
