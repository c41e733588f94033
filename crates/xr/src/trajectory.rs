//! Recorded head motion: TUM trajectories and EuRoC ground truth.
//!
//! Both hold poses of some body (a camera, an inertial unit) in some gravity-aligned world. With
//! W the recording's world, w this program's world, B the recorded body and e the eye's axes (x right,
//! y up, z back), a recorded rotation R(W from B) becomes
//!
//! ```text
//! R(w from head) = R(w from W) R(W from B) R(B from e)      p(w) = R(w from W) p(W)
//! ```
//!
//! - R(w from W), [`TraceUp`]: for a z-up world (x, y, z) becomes (x, z, -y), a turn by -90 degrees about x
//!   that makes the recording's +y the -Z ahead; for a y-up world nothing.
//! - R(B from e), [`TraceBody`]: for an optical frame (x right, y down, z forward) diag(1, -1, -1).
//!
//! The body is taken to be where the head is: no lever arm.

use super::text_lines::{Line, TextLines};
use super::view::Pose;
use super::{InputError, validation};
use glam::{DQuat, DVec3};
use std::f64::consts::{FRAC_1_SQRT_2, FRAC_PI_2};
use std::io::BufRead;
use stereolux_settings::choices;

choices! {
    /// The axis that points up in a recording's world.
    pub enum TraceUp {
        /// +Y, as in OpenXR and glTF
        Y = "y",
        /// +Z, as in TUM and EuRoC recordings
        Z = "z",
    }
}

/// What the axes of a recording's body are.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum TraceBody {
    /// x right, y up, z back.
    OpenXr,
    /// x right, y down, z forward.
    Optical,
    /// Eye from body, unit length: turns the body's axes into x right, y up, z back.
    Quaternion(DQuat),
}

impl TraceBody {
    /// The inertial unit of EuRoC's vehicle: x up, y right, z forward. From `T_BS` of `cam0` in the data
    /// set's `sensor.yaml` (Burri et al. 2016), rounded to whole axes: the forward camera is mounted
    /// within 1.8 degrees of them.
    pub const EUROC_IMU: Self =
        Self::Quaternion(DQuat::from_xyzw(FRAC_1_SQRT_2, FRAC_1_SQRT_2, 0.0, 0.0));

    /// Body from eye.
    #[must_use]
    pub fn body_from_eye(self) -> DQuat {
        match self {
            Self::OpenXr => DQuat::IDENTITY,
            // Half a turn about x: diag(1, -1, -1).
            Self::Optical => DQuat::from_xyzw(1.0, 0.0, 0.0, 0.0),
            Self::Quaternion(eye_from_body) => eye_from_body.conjugate(),
        }
    }
}

stereolux_base::words! {
    /// File formats of head motion.
    pub enum TrajectoryFormat: name {
        /// `timestamp tx ty tz qx qy qz qw`, seconds; `#` comments. Sturm et al. 2012, "A benchmark for the
        /// evaluation of RGB-D SLAM systems".
        Tum = "TUM",
        /// `timestamp [ns], p x y z, q w x y z, ...`, whole nanoseconds, comma separated; `#` comments.
        /// Burri et al. 2016, "The EuRoC micro aerial vehicle datasets".
        Euroc = "EuRoC",
    }
}

impl TrajectoryFormat {
    /// The body's axes unless the user says otherwise: an optical frame for TUM, whose ground truth is
    /// the colour camera's; [`TraceBody::EUROC_IMU`] for EuRoC, whose ground truth is the inertial
    /// unit's.
    #[must_use]
    pub fn default_body(self) -> TraceBody {
        match self {
            Self::Tum => TraceBody::Optical,
            Self::Euroc => TraceBody::EUROC_IMU,
        }
    }

    /// Columns in the order of the file: time, position x, y, z, then the quaternion.
    fn columns(self) -> [&'static str; 8] {
        match self {
            Self::Tum => ["timestamp", "tx", "ty", "tz", "qx", "qy", "qz", "qw"],
            Self::Euroc => ["timestamp", "p_x", "p_y", "p_z", "q_w", "q_x", "q_y", "q_z"],
        }
    }
}

/// A pose and when it was.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TimedPose {
    /// Nanoseconds from the first row.
    pub t_ns: i64,
    /// The pose.
    pub pose: Pose,
}

/// Poses as the file has them: the recording's world from the recording's body.
#[derive(Clone, Debug, PartialEq)]
pub struct RecordedTrajectory {
    /// The file's format.
    pub format: TrajectoryFormat,
    /// At least one, times strictly increasing from 0.
    pub poses: Vec<TimedPose>,
}

impl RecordedTrajectory {
    /// Reads the text of a TUM or EuRoC file, told apart by content; `file` names it in errors.
    ///
    /// # Errors
    /// The first fault, with file, line and field.
    pub fn from_reader(file: &str, reader: impl BufRead) -> Result<Self, InputError> {
        Self::from_lines(&mut TextLines::new(file.to_owned(), reader))
    }

    pub(super) fn from_lines<R: BufRead>(lines: &mut TextLines<R>) -> Result<Self, InputError> {
        let file = lines.file.clone();
        let none = || InputError::file(&file, "holds no pose");
        let first = lines.next_uncommented()?.ok_or_else(none)?;
        let mut format = sniff(&first.text);
        if format.is_none() && first.text.starts_with("timestamp") && first.text.contains(',') {
            format = Some(TrajectoryFormat::Euroc); // a header row that lost its '#'
        } else {
            lines.push_back(first.clone());
        }
        let Some(format) = format else {
            return Err(unknown_format(&file, &first));
        };
        let mut poses: Vec<TimedPose> = Vec::new();
        let (mut first_ns, mut last) = (0, None::<(i64, usize)>);
        while let Some(line) = lines.next_uncommented()? {
            let (recorded_ns, pose) = read_row(&file, &line, format)?;
            let time_fault =
                |what: String| InputError::field(&file, line.number, "timestamp", what);
            match last {
                None => first_ns = recorded_ns,
                Some((last_ns, last_line)) if recorded_ns <= last_ns => {
                    let relation = if recorded_ns == last_ns {
                        "repeats"
                    } else {
                        "lies before"
                    };
                    return Err(time_fault(format!(
                        "{relation} the time on line {last_line}; times must increase from row to row"
                    )));
                }
                Some(_) => {}
            }
            let Some(t_ns) = recorded_ns.checked_sub(first_ns) else {
                return Err(time_fault("over 292 years after the first row".into()));
            };
            last = Some((recorded_ns, line.number));
            poses.push(TimedPose { t_ns, pose });
        }
        if poses.is_empty() {
            return Err(none());
        }
        Ok(Self { format, poses })
    }

    /// Head poses in this program's world and axes; see the module's text.
    #[must_use]
    pub fn to_head_motion(&self, up: TraceUp, body: TraceBody) -> HeadMotion {
        let body_from_eye = body.body_from_eye();
        let poses = self.poses.iter().map(|timed| {
            let p = timed.pose.position;
            let (turn, position) = match up {
                TraceUp::Y => (DQuat::IDENTITY, p),
                // Exact, where the quaternion would round the position.
                TraceUp::Z => (
                    DQuat::from_rotation_x(-FRAC_PI_2),
                    DVec3::new(p.x, p.z, -p.y),
                ),
            };
            let orientation = turn * timed.pose.orientation * body_from_eye;
            TimedPose {
                t_ns: timed.t_ns,
                pose: Pose::new(position, orientation.normalize()),
            }
        });
        HeadMotion {
            poses: poses.collect(),
        }
    }
}

/// The format that a first row speaks for.
fn sniff(row: &str) -> Option<TrajectoryFormat> {
    let is_number = |word: Option<&str>| word.is_some_and(|w| w.trim().parse::<f64>().is_ok());
    if row.contains(',') {
        is_number(row.split(',').next()).then_some(TrajectoryFormat::Euroc)
    } else {
        is_number(row.split_whitespace().next()).then_some(TrajectoryFormat::Tum)
    }
}

pub(super) fn unknown_format(file: &str, line: &Line) -> InputError {
    let start: String = line.text.chars().take(40).collect();
    InputError::line(
        file,
        line.number,
        format!(
            "{start:?} begins no known trace; known: native JSON Lines, TUM (timestamp tx ty tz qx qy qz qw), EuRoC CSV (timestamp [ns],p x y z,q w x y z)"
        ),
    )
}

/// Time on the recording's own clock, nanoseconds, and the pose of one row.
fn read_row(file: &str, line: &Line, format: TrajectoryFormat) -> Result<(i64, Pose), InputError> {
    let words: Vec<&str> = match format {
        TrajectoryFormat::Tum => line.text.split_whitespace().collect(),
        TrajectoryFormat::Euroc => line.text.split(',').map(str::trim).collect(),
    };
    let columns = format.columns();
    // EuRoC rows go on with velocity and biases.
    let enough = match format {
        TrajectoryFormat::Tum => words.len() == columns.len(),
        TrajectoryFormat::Euroc => words.len() >= columns.len(),
    };
    if !enough {
        let what = format!(
            "holds {} columns; a {} row has {}: {}",
            words.len(),
            format.name(),
            columns.len(),
            columns.join(" ")
        );
        return Err(InputError::line(file, line.number, what));
    }
    let field =
        |index: usize, what: String| InputError::field(file, line.number, columns[index], what);
    let (time, kind) = match format {
        TrajectoryFormat::Tum => (nanoseconds_from_seconds(words[0]), "seconds"),
        TrajectoryFormat::Euroc => (words[0].parse().ok(), "whole nanoseconds"),
    };
    let Some(time_ns) = time else {
        return Err(field(0, format!("{:?} is not a time in {kind}", words[0])));
    };
    let mut v = [0.0; 7];
    for (index, (slot, word)) in v.iter_mut().zip(&words[1..]).enumerate() {
        *slot = word
            .parse::<f64>()
            .ok()
            .filter(|number| number.is_finite())
            .ok_or_else(|| field(index + 1, format!("{word:?} is not a finite number")))?;
    }
    let [px, py, pz, a, b, c, d] = v;
    let (x, y, z, w) = match format {
        TrajectoryFormat::Tum => (a, b, c, d),
        TrajectoryFormat::Euroc => (b, c, d, a),
    };
    let orientation = validation::unit_quaternion(x, y, z, w).map_err(|what| {
        let name = format!("{}..{}", columns[4], columns[7]);
        InputError::field(file, line.number, &name, what)
    })?;
    Ok((time_ns, Pose::new(DVec3::new(px, py, pz), orientation)))
}

/// Decimal seconds to nanoseconds, exactly: an f64 has steps of 238 ns at today's Unix times.
fn nanoseconds_from_seconds(text: &str) -> Option<i64> {
    let unsigned = text.trim_start_matches(['+', '-']);
    let (whole, fraction) = unsigned.split_once('.').unwrap_or((unsigned, ""));
    let digits = |s: &str| s.bytes().all(|b| b.is_ascii_digit());
    if !digits(whole) || !digits(fraction) || whole.len() + fraction.len() == 0 {
        // Exponents and the like.
        let ns = (text.parse::<f64>().ok()? * 1e9).round();
        // 2^63 is the first f64 that an i64 cannot hold.
        return (ns.abs() < 9_223_372_036_854_775_808.0).then_some(ns as i64);
    }
    if text.len() - unsigned.len() > 1 {
        return None;
    }
    let whole: i64 = if whole.is_empty() {
        0
    } else {
        whole.parse().ok()?
    };
    let nine = fraction.bytes().chain(std::iter::repeat(b'0')).take(9);
    let nanoseconds = nine.fold(0_i64, |sum, digit| sum * 10 + i64::from(digit - b'0'));
    let round_up = fraction
        .as_bytes()
        .get(9)
        .is_some_and(|digit| *digit >= b'5');
    let total = whole
        .checked_mul(1_000_000_000)?
        .checked_add(nanoseconds + i64::from(round_up))?;
    Some(if text.starts_with('-') { -total } else { total })
}

/// Head poses over time: world from head, times strictly increasing from 0, at least one.
#[derive(Clone, Debug, PartialEq)]
pub struct HeadMotion {
    poses: Vec<TimedPose>,
}

impl HeadMotion {
    /// The poses, in order of time.
    #[must_use]
    pub fn poses(&self) -> &[TimedPose] {
        &self.poses
    }

    /// Nanoseconds from the first pose to the last.
    #[must_use]
    pub fn duration_ns(&self) -> i64 {
        self.poses.last().map_or(0, |last| last.t_ns)
    }

    /// Moves the whole recording so that its first pose stands where `start` stands and faces where
    /// `start` faces. Only a turn about the vertical and a translation: gravity stays vertical, so pitch
    /// and roll stay as recorded.
    #[must_use]
    pub fn recentered(mut self, start: &Pose) -> Self {
        let Some(first) = self.poses.first().map(|timed| timed.pose) else {
            return self;
        };
        let turn = DQuat::from_rotation_y(start.heading_rad() - first.heading_rad());
        for TimedPose { pose, .. } in &mut self.poses {
            pose.position = start.position + turn * (pose.position - first.position);
            pose.orientation = (turn * pose.orientation).normalize();
        }
        self
    }

    /// The pose at a time: linear between the positions around it, slerp (the short way) between the
    /// orientations; the first or last pose outside of the recording.
    #[must_use]
    pub fn pose_at(&self, t_ns: i64) -> Pose {
        let after = self.poses.partition_point(|timed| timed.t_ns <= t_ns);
        let (Some(earlier), later) = (
            self.poses.get(after.saturating_sub(1)),
            self.poses.get(after),
        ) else {
            return Pose::IDENTITY;
        };
        let Some(later) = later.filter(|_| t_ns > earlier.t_ns) else {
            return earlier.pose;
        };
        let share = (t_ns - earlier.t_ns) as f64 / (later.t_ns - earlier.t_ns) as f64;
        let (a, b) = (earlier.pose, later.pose);
        Pose::new(
            a.position + share * (b.position - a.position),
            a.orientation.slerp(b.orientation, share).normalize(),
        )
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::nanoseconds_from_seconds as ns;

    #[test]
    fn decimal_seconds_become_exact_nanoseconds() {
        assert_eq!(ns("1305031098.6659"), Some(1_305_031_098_665_900_000));
        assert_eq!(ns("1305031098.665912345"), Some(1_305_031_098_665_912_345));
        assert_eq!(ns("0.0000000004"), Some(0));
        assert_eq!(ns("0.0000000005"), Some(1));
        assert_eq!(ns("0.9999999999"), Some(1_000_000_000));
        assert_eq!(ns("-1.5"), Some(-1_500_000_000));
        assert_eq!(ns("+2"), Some(2_000_000_000));
        assert_eq!(ns("7."), Some(7_000_000_000));
        assert_eq!(ns(".25"), Some(250_000_000));
        assert_eq!(ns("1.5e3"), Some(1_500_000_000_000));
        // The control: through f64, the first of these would be off.
        let through_f64 = ("1305031098.665912345".parse::<f64>().unwrap() * 1e9) as i64;
        assert_ne!(through_f64, 1_305_031_098_665_912_345);
    }

    #[test]
    fn what_is_no_time_is_refused() {
        for text in [
            "",
            ".",
            "-",
            "--1",
            "+-1",
            "1.2.3",
            "nan",
            "inf",
            "1e300",
            "1,5",
            "0x10",
            "9300000000",
            "99999999999999999999",
        ] {
            assert_eq!(ns(text), None, "{text}");
        }
    }
}
