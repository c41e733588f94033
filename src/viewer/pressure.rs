//! What was asked for while a frame is computed, by which its passes are given up.

use std::sync::atomic::{AtomicBool, AtomicU8, Ordering};
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

/// A frame that ends within this time is let to its end, or a hand that never rests would see none.
const LET_BE: Duration = Duration::from_millis(150);

/// How pressing it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[repr(u8)]
pub enum Asked {
    /// Nothing.
    Nothing,
    /// Another view of the same scene: photons stay of use.
    View,
    /// Another scene or other settings: nothing stays of use.
    Scene,
    /// To stop, at once.
    Stop,
}

/// Shared by who asks and who computes.
pub struct Pressure {
    asked: AtomicU8,
    gave_up: AtomicBool,
    lost_photons: AtomicBool,
    began: Mutex<Began>,
}

/// When the parts of a frame began.
struct Began {
    frame: Instant,
    /// If the frame traces any.
    photons: Option<Instant>,
    /// After the photons.
    eyes: Option<Instant>,
}

impl Began {
    fn now() -> Self {
        Self {
            frame: Instant::now(),
            photons: None,
            eyes: None,
        }
    }

    /// How long the eyes are let be if another view of the scene is asked for: as long as the photons took, or a frame that
    /// has to trace them whenever something moves would never be shown.
    fn patience(&self) -> Duration {
        let traced = self.photons.zip(self.eyes);
        traced.map_or(LET_BE, |(photons, eyes)| {
            LET_BE.max(eyes.saturating_duration_since(photons))
        })
    }
}

impl Default for Pressure {
    fn default() -> Self {
        Self {
            asked: AtomicU8::new(Asked::Nothing as u8),
            gave_up: AtomicBool::new(false),
            lost_photons: AtomicBool::new(false),
            began: Mutex::new(Began::now()),
        }
    }
}

impl Pressure {
    /// Asks for something.
    pub fn ask(&self, asked: Asked) {
        self.asked.fetch_max(asked as u8, Ordering::Relaxed);
    }

    /// Whether something was asked for that is not known yet.
    pub fn is_asked(&self) -> bool {
        self.asked.load(Ordering::Relaxed) != Asked::Nothing as u8
    }

    /// Whether it was to stop.
    pub fn is_to_stop(&self) -> bool {
        self.asked.load(Ordering::Relaxed) == Asked::Stop as u8
    }

    /// What is asked for is known from here on, and served next.
    pub fn serve(&self) {
        self.asked.store(Asked::Nothing as u8, Ordering::Relaxed);
    }

    /// A frame begins.
    pub fn begin(&self) {
        self.gave_up.store(false, Ordering::Relaxed);
        self.lost_photons.store(false, Ordering::Relaxed);
        *self.began.lock().unwrap_or_else(PoisonError::into_inner) = Began::now();
    }

    /// Whether a pass of the frame is still wanted. Once one is not, none of the frame is.
    pub fn admits(&self, pass: &str) -> bool {
        let is_photons = pass.starts_with("photons.");
        if !self.gave_up.load(Ordering::Relaxed) {
            let asked = self.asked.load(Ordering::Relaxed);
            let is_pressing =
                asked >= Asked::Scene as u8 || (asked == Asked::View as u8 && !is_photons);
            let mut began = self.began.lock().unwrap_or_else(PoisonError::into_inner);
            // Photons may have taken long, and poses come before them: the eyes are let be as long as without them.
            let is_of_eyes = pass.starts_with("left.") || pass.starts_with("right.");
            if is_of_eyes {
                began.eyes.get_or_insert_with(Instant::now);
            } else if is_photons {
                began.photons.get_or_insert_with(Instant::now);
            }
            let (since, patience) = if is_photons {
                (Some(began.frame), LET_BE)
            } else if asked == Asked::View as u8 {
                (began.eyes, began.patience())
            } else {
                (began.eyes, LET_BE)
            };
            let is_late =
                asked == Asked::Stop as u8 || since.is_some_and(|since| since.elapsed() > patience);
            if !(is_pressing && is_late) {
                return true;
            }
            self.gave_up.store(true, Ordering::Relaxed);
        }
        if is_photons {
            self.lost_photons.store(true, Ordering::Relaxed);
        }
        false
    }

    /// Whether the frame was given up, and if so, whether photons were.
    pub fn gave_up(&self) -> Option<bool> {
        let gave_up = self.gave_up.load(Ordering::Relaxed);
        gave_up.then(|| self.lost_photons.load(Ordering::Relaxed))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_frame_is_given_up_whole_and_photons_only_for_another_scene() {
        let pressure = Pressure::default();
        pressure.begin();
        assert!(pressure.admits("left.gather"));
        // Young frames are let be, but when it is to stop.
        pressure.ask(Asked::Scene);
        assert!(pressure.admits("left.gather"));
        pressure.ask(Asked::Stop);
        assert!(!pressure.admits("left.gather"));
        assert_eq!(pressure.gave_up(), Some(false));
        pressure.serve();
        assert!(!pressure.admits("right.gather"), "no half frames");
        pressure.begin();
        assert!(pressure.admits("right.gather"));
        assert_eq!(pressure.gave_up(), None);
        std::thread::sleep(LET_BE + Duration::from_millis(10));
        pressure.ask(Asked::View);
        assert!(
            pressure.admits("photons.trace"),
            "another view needs them too"
        );
        assert!(!pressure.admits("left.primary"));
        pressure.serve();
        // A pose is deformed before photons are traced, and frames of what moves are shown all the same.
        pressure.begin();
        assert!(pressure.admits("pose.deform"));
        std::thread::sleep(LET_BE + Duration::from_millis(10));
        pressure.ask(Asked::View);
        assert!(pressure.admits("photons.trace"));
        assert!(pressure.admits("left.primary"));
        pressure.serve();
        pressure.begin();
        pressure.ask(Asked::Stop);
        assert!(!pressure.admits("photons.trace"));
        assert_eq!(pressure.gave_up(), Some(true));
    }

    #[test]
    fn eyes_are_let_be_as_long_as_the_photons_before_them_took_while_the_scene_is_the_same() {
        let admits = |asked, elapsed: u32, photons: Option<u32>| {
            let pressure = Pressure::default();
            let eyes = Instant::now() - elapsed * LET_BE;
            let photons = photons.map(|took| eyes - took * LET_BE);
            *pressure.began.lock().unwrap() = Began {
                frame: photons.unwrap_or(eyes),
                photons,
                eyes: Some(eyes),
            };
            pressure.ask(asked);
            pressure.admits("left.gather")
        };
        assert!(admits(Asked::View, 2, Some(60)));
        assert!(
            !admits(Asked::View, 61, Some(60)),
            "longer than the photons"
        );
        assert!(!admits(Asked::View, 2, None), "nothing was traced");
        assert!(!admits(Asked::Scene, 2, Some(60)), "of another scene");
    }
}
