//! Headset profiles: what an eye sees, where the eyes sit in the head, how often the display refreshes.
//!
//! Profiles are TOML files in `config/headsets/`, embedded in the binary; a user's own file works the
//! same way. Angles are degrees in the file and radians here.

use super::validation::{self, within};
use super::view::{Fov, Pose, View};
use super::{InputError, XrError, toml_files};
use glam::{DQuat, DVec3, EulerRot};
use serde::Deserialize;
use std::ops::Range;
use std::path::Path;
use stereolux_settings::registry::MAX_SIZE;
use toml::Spanned;

/// The embedded profiles: name and text.
const PROFILES: [(&str, &str); 4] = [
    (
        "quest3",
        include_str!("../../../config/headsets/quest3.toml"),
    ),
    ("index", include_str!("../../../config/headsets/index.toml")),
    ("vive", include_str!("../../../config/headsets/vive.toml")),
    (
        "symmetric",
        include_str!("../../../config/headsets/symmetric.toml"),
    ),
];

/// One eye of a headset.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HeadsetEye {
    /// Eye in head: position in metres (left eye at negative x) and cant.
    pub head_from_eye: Pose,
    /// What it sees.
    pub fov: Fov,
}

/// A headset: everything that turns a head pose into two views.
#[derive(Clone, Debug, PartialEq)]
pub struct Headset {
    /// Short name, as `--headset` takes it.
    pub name: String,
    /// Where the figures come from.
    pub source: String,
    /// Pixels per eye: width, height.
    pub size: [u32; 2],
    /// Refresh rate in use, hertz.
    pub refresh_hz: f64,
    /// All refresh rates that the headset offers, hertz.
    pub refresh_rates_hz: Vec<f64>,
    /// Distance between the eyes, metres.
    pub ipd_m: f64,
    /// Left eye, right eye.
    pub eyes: [HeadsetEye; 2],
}

impl Headset {
    /// Names of the embedded profiles.
    #[must_use]
    pub fn names() -> Vec<&'static str> {
        PROFILES.iter().map(|(name, _)| *name).collect()
    }

    /// Whether a headset is named by the path of a file.
    #[must_use]
    pub fn is_path(name_or_path: &str) -> bool {
        name_or_path.ends_with(".toml") || name_or_path.contains(['/', std::path::MAIN_SEPARATOR])
    }

    /// A profile by name, or from a file if the argument ends in `.toml` or holds a path separator.
    ///
    /// # Errors
    /// An unknown name (the message lists the known ones), an unreadable file, or a fault in it, with
    /// file, line and field.
    pub fn load(name_or_path: &str) -> Result<Self, XrError> {
        if Self::is_path(name_or_path) {
            let (file, text) = toml_files::read(Path::new(name_or_path), "headset profile")?;
            return Ok(Self::from_toml(&file, &text)?);
        }
        for (name, text) in PROFILES {
            if name == name_or_path {
                return Ok(Self::from_toml(
                    &format!("config/headsets/{name}.toml"),
                    text,
                )?);
            }
        }
        Err(super::ArgumentError(format!(
            "unknown headset {name_or_path:?}{}; known: {}; or the path of a .toml profile",
            stereolux_base::printable::did_you_mean(name_or_path, Self::names()),
            Self::names().join(", ")
        ))
        .into())
    }

    /// A profile from TOML text; `file` names it in errors.
    ///
    /// # Errors
    /// Syntax, unknown or missing keys, or values out of range, with line and field.
    pub fn from_toml(file: &str, text: &str) -> Result<Self, InputError> {
        toml_files::parsed::<ProfileToml>(file, text)?.check(file, text)
    }

    /// Both eyes of a head at `world_from_head`.
    #[must_use]
    pub fn views_from_head(&self, world_from_head: &Pose) -> [View; 2] {
        self.eyes.map(|eye| {
            let world_from_eye = world_from_head.then(&eye.head_from_eye);
            View {
                position_in_world: world_from_eye.position,
                // The product of unit quaternions drifts by rounding; see validation::unit_quaternion.
                orientation: world_from_eye.orientation.normalize(),
                fov: eye.fov,
            }
        })
    }

    /// Parallel eyes `ipd_m` metres apart, at (-ipd/2, 0, 0) and (+ipd/2, 0, 0): replaces the profile's
    /// eye offsets and cant. The angles stay.
    ///
    /// # Errors
    /// `ipd_m` is negative, over 1 m, or not finite.
    pub fn with_ipd(mut self, ipd_m: f64) -> Result<Self, XrError> {
        self.ipd_m = within(ipd_m, 0.0..=MAX_IPD_M, " m")
            .map_err(|what| super::ArgumentError(format!("interpupillary distance {what}")))?;
        self.make_parallel();
        Ok(self)
    }

    /// The same field of view for both eyes, with parallel eyes: replaces the profile's angles, eye offsets and cant. The
    /// distance between the eyes stays.
    ///
    /// # Errors
    /// Angles out of order or beyond +-89 degrees.
    pub fn with_fov(mut self, fov: Fov) -> Result<Self, XrError> {
        validation::check_fov(&fov)
            .map_err(|fault| super::ArgumentError(format!("field of view, {fault}")))?;
        for eye in &mut self.eyes {
            eye.fov = fov;
        }
        self.make_parallel();
        Ok(self)
    }

    /// Another refresh rate; any rate, not only those that the real display offers.
    ///
    /// # Errors
    /// Not between 1 and 1000 Hz.
    pub fn with_refresh_hz(mut self, refresh_hz: f64) -> Result<Self, XrError> {
        self.refresh_hz = within(refresh_hz, REFRESH_RANGE_HZ, " Hz")
            .map_err(|what| super::ArgumentError(format!("refresh rate {what}")))?;
        Ok(self)
    }

    fn make_parallel(&mut self) {
        let half = 0.5 * self.ipd_m;
        // 0 - half and not -half: at IPD 0 both eyes sit at +0.
        for (eye, x) in self.eyes.iter_mut().zip([0.0 - half, half]) {
            eye.head_from_eye = Pose::new(DVec3::new(x, 0.0, 0.0), DQuat::IDENTITY);
        }
    }
}

/// Largest distance between the eyes, metres. Human IPDs end at 80 mm (Dodgson 2004); experiments may go far beyond, a metre is a mistaken unit.
pub const MAX_IPD_M: f64 = 1.0;

/// Refresh rates that make sense, hertz; written by hand or not, they divide a second.
pub(super) const REFRESH_RANGE_HZ: std::ops::RangeInclusive<f64> = 1.0..=1000.0;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct ProfileToml {
    name: Spanned<String>,
    source: String,
    size: Spanned<[u32; 2]>,
    refresh_hz: Spanned<f64>,
    refresh_rates_hz: Option<Spanned<Vec<f64>>>,
    ipd_m: Spanned<f64>,
    left: EyeToml,
    right: EyeToml,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct EyeToml {
    fov_deg: Spanned<FovToml>,
    cant_deg: Option<Spanned<CantToml>>,
    offset_m: Option<Spanned<[f64; 3]>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct FovToml {
    left: f64,
    right: f64,
    up: f64,
    down: f64,
}

#[derive(Default, Deserialize)]
#[serde(default, deny_unknown_fields)]
struct CantToml {
    yaw: f64,
    pitch: f64,
    roll: f64,
}

impl ProfileToml {
    fn check(self, file: &str, text: &str) -> Result<Headset, InputError> {
        let fault = |span: Range<usize>, field: &str, what: String| {
            InputError::field(file, toml_files::line_at(text, span.start), field, what)
        };
        if self.name.get_ref().trim().is_empty() {
            return Err(fault(self.name.span(), "name", "is empty".into()));
        }
        let size = *self.size.get_ref();
        if size.iter().any(|side| !(1..=MAX_SIZE).contains(side)) {
            let what = format!("each side must be between 1 and {MAX_SIZE} pixels");
            return Err(fault(self.size.span(), "size", what));
        }
        let ipd_m = within(*self.ipd_m.get_ref(), 0.0..=MAX_IPD_M, " m")
            .map_err(|what| fault(self.ipd_m.span(), "ipd_m", what))?;
        let refresh_hz = within(*self.refresh_hz.get_ref(), REFRESH_RANGE_HZ, " Hz")
            .map_err(|what| fault(self.refresh_hz.span(), "refresh_hz", what))?;
        let refresh_rates_hz = match self.refresh_rates_hz {
            None => vec![refresh_hz],
            Some(rates) => {
                let ok = rates
                    .get_ref()
                    .iter()
                    .all(|hz| REFRESH_RANGE_HZ.contains(hz))
                    && rates.get_ref().contains(&refresh_hz);
                if !ok {
                    let what = format!(
                        "must hold rates between 1 and 1000 Hz, and refresh_hz ({refresh_hz}) among them"
                    );
                    return Err(fault(rates.span(), "refresh_rates_hz", what));
                }
                rates.into_inner()
            }
        };
        let eye = |name: &str, toml: EyeToml, x: f64| -> Result<HeadsetEye, InputError> {
            let span = toml.fov_deg.span();
            let fov = toml.fov_deg.into_inner();
            let fov = Fov::from_degrees(fov.left, fov.right, fov.up, fov.down);
            validation::check_fov(&fov)
                .map_err(|f| fault(span, &format!("{name}.fov_deg.{}", f.field), f.what))?;
            let mut orientation = DQuat::IDENTITY;
            if let Some(cant) = toml.cant_deg {
                let span = cant.span();
                let CantToml { yaw, pitch, roll } = cant.into_inner();
                if [yaw, pitch, roll]
                    .iter()
                    .any(|a| a.is_nan() || a.abs() > 90.0)
                {
                    let what = "each angle must be within +-90 degrees".into();
                    return Err(fault(span, &format!("{name}.cant_deg"), what));
                }
                orientation = DQuat::from_euler(
                    EulerRot::YXZ,
                    yaw.to_radians(),
                    pitch.to_radians(),
                    roll.to_radians(),
                )
                .normalize();
            }
            let mut offset = DVec3::ZERO;
            if let Some(spanned) = toml.offset_m {
                offset = DVec3::from_array(*spanned.get_ref());
                if !offset.is_finite() || offset.abs().max_element() > MAX_IPD_M {
                    let what = format!("each coordinate must be within +-{MAX_IPD_M} m");
                    return Err(fault(spanned.span(), &format!("{name}.offset_m"), what));
                }
            }
            Ok(HeadsetEye {
                head_from_eye: Pose::new(DVec3::new(x, 0.0, 0.0) + offset, orientation),
                fov,
            })
        };
        let eyes = [
            eye("left", self.left, -0.5 * ipd_m)?,
            eye("right", self.right, 0.5 * ipd_m)?,
        ];
        Ok(Headset {
            name: self.name.into_inner(),
            source: self.source,
            size,
            refresh_hz,
            refresh_rates_hz,
            ipd_m,
            eyes,
        })
    }
}
