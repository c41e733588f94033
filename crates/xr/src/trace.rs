//! The native trace: one JSON object per line, first a header, then the views of one frame per line.
//!
//! ```text
//! {"format":"stereolux-trace","version":1,"headset":"quest3","refresh_hz":90.0}
//! {"t_ns":0,"views":[{"position":[x,y,z],"orientation":[x,y,z,w],"fov":{"left":-0.9,"right":0.8,"up":0.9,"down":-0.9}},{...}],"flags":{"position_valid":true,"orientation_valid":true}}
//! ```
//!
//! Positions are metres in the world, orientations world from eye, angles radians. Numbers are written in
//! the shortest decimal form that reads back as the same f64, so what is read and written again gives the
//! same bytes. Version 2 adds what else a frame depended on: `hidden` in the header, the area that each eye's lens hides
//! as triangles of tangents (x right, y up), `"switch_reuse":true` in a frame from which on stereo reuse was switched,
//! `located` in a frame whose eyes were located once more before they were rendered: the views that all but the eyes went by,
//! `quality` in a frame from which on another one was set, `controller_model` in one from which on a controller's model is
//! known, and `input`, what the wearer did (`docs/recordings.md` has the keys of all three). Unknown keys are errors. A last
//! line that was cut short (the run that wrote it was killed) is dropped with a warning.

use super::controller_model;
use super::hidden_area::HiddenArea;
use super::input::Input;
use super::text_lines::{self, Line, TextLines};
use super::validation::{self, Fault, within};
use super::view::{Fov, View};
use super::{InputError, LocatedViews, Quality, ViewFlags};
use glam::DVec3;
use serde::Serialize;
use serde_json::{Map, Value};
use std::fs::File;
use std::io::{BufRead, Read as _};
use std::path::Path;
use stereolux_base::printable::json_fault;

/// The header's `format`.
pub const FORMAT: &str = "stereolux-trace";
/// The versions that are read. Version 1 holds views; version 2 adds `input`, `quality`, `located`, `controller_model` and
/// changes of headset, and is what a file with `hidden` or `switch_reuse` states (both are read in version 1 as well).
pub const VERSIONS: [u64; 2] = [1, 2];
/// How every native trace begins.
const BEGINNING: &str = r#"{"format":"stereolux-trace","version":"#;
/// Where the header's version stands in a file that [`header_line`] began, bytes.
pub(super) const VERSION_AT: usize = BEGINNING.len();

/// First line of a native trace.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct TraceHeader {
    /// The headset that the views came from.
    pub headset: String,
    /// Its refresh rate, hertz.
    pub refresh_hz: f64,
    /// What each eye's lens hides, left and right.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub hidden: Option<[HiddenArea; 2]>,
}

/// One frame of a native trace.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct TraceFrame {
    /// Display time, nanoseconds; strictly increasing through a trace.
    pub t_ns: i64,
    /// Both eyes, as they were rendered.
    #[serde(flatten)]
    pub views: LocatedViews,
    /// Both eyes as they were located first, where that is another place: what the application saw.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub located: Option<[View; 2]>,
    /// Stereo reuse is switched from this frame on.
    #[serde(skip_serializing_if = "is_default")]
    pub switch_reuse: bool,
    /// The quality that was set, for this frame and those after it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub quality: Option<Quality>,
    /// The headset's refresh rate from this frame on, hertz, where it has changed.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub refresh_hz: Option<f64>,
    /// What the lenses hide from this frame on, where it has changed.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub hidden: Option<[HiddenArea; 2]>,
    /// Files beside the trace with the controllers' models, left and right, in the frame in which they became known.
    #[serde(
        skip_serializing_if = "is_default",
        serialize_with = "controller_model::write_names"
    )]
    pub controller_model: [Option<String>; 2],
    /// What the wearer did.
    #[serde(skip_serializing_if = "is_default")]
    pub input: Input,
}

impl TraceHeader {
    /// The lowest version that can hold it.
    #[must_use]
    pub fn version(&self) -> u64 {
        VERSIONS[usize::from(self.hidden.is_some())]
    }
}

impl TraceFrame {
    /// The lowest version that can hold it.
    #[must_use]
    pub fn version(&self) -> u64 {
        let is_plain = !self.switch_reuse
            && self.refresh_hz.is_none()
            && self.hidden.is_none()
            && self.located.is_none()
            && self.quality.is_none()
            && is_default(&self.controller_model)
            && is_default(&self.input);
        VERSIONS[usize::from(!is_plain)]
    }
}

/// A native trace, read and checked in full; at least one frame.
#[derive(Clone, Debug, PartialEq)]
pub struct Trace {
    /// What was recorded.
    pub header: TraceHeader,
    /// The frames in order.
    pub frames: Vec<TraceFrame>,
    /// Lines, from 1, of the frames that name controllers' models.
    pub model_lines: Vec<usize>,
    /// What the user should know about the file (a last line that was cut short).
    pub warnings: Vec<String>,
}

impl Trace {
    /// Reads and checks a native trace.
    ///
    /// # Errors
    /// The first fault, with file, line and field.
    pub fn read(path: &Path) -> Result<Self, InputError> {
        Self::from_lines(&mut text_lines::open(path)?)
    }

    /// As [`Trace::read`], from any text; `file` names it in errors.
    ///
    /// # Errors
    /// The first fault, with file, line and field.
    pub fn from_reader(file: &str, reader: impl BufRead) -> Result<Self, InputError> {
        Self::from_lines(&mut TextLines::new(file.to_owned(), reader))
    }

    pub(super) fn from_lines<R: BufRead>(lines: &mut TextLines<R>) -> Result<Self, InputError> {
        let file = lines.file.clone();
        let Some(first) = lines.next_line()? else {
            return Err(InputError::file(
                &file,
                "is empty; a trace begins with its header line",
            ));
        };
        let (header, version) = object(&file, &first)
            .map_err(|broken| broken.error)
            .and_then(|header| at(&file, first.number, read_header(&header)))?;
        let mut frames: Vec<TraceFrame> = Vec::new();
        let (mut model_lines, mut warnings) = (Vec::new(), Vec::new());
        while let Some(line) = lines.next_line()? {
            let value = match object(&file, &line) {
                Ok(value) => value,
                Err(broken) => {
                    if broken.cut_short && lines.next_line()?.is_none() {
                        warnings.push(format!(
                            "{file}, line {}: the last line is truncated and ignored",
                            line.number
                        ));
                        break;
                    }
                    return Err(broken.error);
                }
            };
            let frame = at(&file, line.number, read_frame(&value, version))?;
            if let Some(last) = frames.last()
                && frame.t_ns <= last.t_ns
            {
                let what = format!(
                    "{} does not come after the frame before ({}); times must increase",
                    frame.t_ns, last.t_ns
                );
                return Err(InputError::field(&file, line.number, "t_ns", what));
            }
            if !is_default(&frame.controller_model) {
                model_lines.push(line.number);
            }
            frames.push(frame);
        }
        if frames.is_empty() {
            return Err(InputError::file(
                &file,
                "holds a header and no complete frame",
            ));
        }
        Ok(Self {
            header,
            frames,
            model_lines,
            warnings,
        })
    }
}

fn at<T>(file: &str, line: usize, result: Result<T, Fault>) -> Result<T, InputError> {
    result.map_err(|fault| InputError::field(file, line, &fault.field, fault.what))
}

/// A line that is no JSON object.
struct Broken {
    error: InputError,
    /// The text ends before the object does.
    cut_short: bool,
}

fn object(file: &str, line: &Line) -> Result<Map<String, Value>, Broken> {
    match serde_json::from_str::<Value>(&line.text) {
        Ok(Value::Object(map)) => Ok(map),
        Ok(_) => Err(Broken {
            error: InputError::line(file, line.number, "is not a JSON object"),
            cut_short: false,
        }),
        Err(error) => {
            let what = format!("is not JSON: {}", json_fault(&error, error.column()));
            // A number that cannot be belongs to what stands before the last colon, as in `"gaze":[0,NaN`.
            let is_value = ["expected value", "number out of range"]
                .iter()
                .any(|of| what.contains(of));
            let read = line
                .text
                .get(..error.column())
                .filter(|_| is_value)
                .unwrap_or_default();
            let keys = read
                .rsplit_once("\":")
                .and_then(|(keys, _)| keys.rsplit_once('"'));
            Err(Broken {
                error: InputError {
                    field: keys.map(|(_, key)| key.to_owned()),
                    ..InputError::line(file, line.number, what)
                },
                cut_short: error.is_eof(),
            })
        }
    }
}

/// One JSON object and the path that leads to it, for messages.
pub(super) struct Fields<'a> {
    path: &'a str,
    map: &'a Map<String, Value>,
}

impl<'a> Fields<'a> {
    /// `known`: every key that may appear.
    fn new(path: &'a str, map: &'a Map<String, Value>, known: &[&str]) -> Result<Self, Fault> {
        let fields = Self { path, map };
        match map.keys().find(|key| !known.contains(&key.as_str())) {
            Some(key) => {
                let what = format!("unknown; known here: {}", known.join(", "));
                Err(fields.fault(key, what))
            }
            None => Ok(fields),
        }
    }

    pub(super) fn of(path: &'a str, value: &'a Value, known: &[&str]) -> Result<Self, Fault> {
        match value {
            Value::Object(map) => Self::new(path, map, known),
            other => Err(wrong_kind(path, other, "an object")),
        }
    }

    fn name(&self, key: &str) -> String {
        if self.path.is_empty() {
            key.to_owned()
        } else {
            format!("{}.{key}", self.path)
        }
    }

    fn fault(&self, key: &str, what: impl Into<String>) -> Fault {
        Fault::new(self.name(key), what)
    }

    fn value(&self, key: &str) -> Result<&'a Value, Fault> {
        self.map.get(key).ok_or_else(|| self.fault(key, "missing"))
    }

    pub(super) fn number(&self, key: &str) -> Result<f64, Fault> {
        number(&self.name(key), self.value(key)?)
    }

    pub(super) fn numbers<const N: usize>(&self, key: &str) -> Result<[f64; N], Fault> {
        let value = self.value(key)?;
        let Value::Array(items) = value else {
            return Err(wrong_kind(&self.name(key), value, "an array of numbers"));
        };
        if items.len() != N {
            return Err(self.fault(key, format!("holds {} numbers, not {N}", items.len())));
        }
        let mut numbers = [0.0; N];
        for (index, (slot, item)) in numbers.iter_mut().zip(items).enumerate() {
            *slot = number(&format!("{}[{index}]", self.name(key)), item)?;
        }
        Ok(numbers)
    }

    /// What `read` makes of a field, with the path that leads to it; `None` if it is not there.
    pub(super) fn optional<T>(
        &self,
        key: &str,
        read: impl FnOnce(&str, &'a Value) -> Result<T, Fault>,
    ) -> Result<Option<T>, Fault> {
        let value = self.map.get(key);
        value.map(|value| read(&self.name(key), value)).transpose()
    }

    fn count(&self, key: &str) -> Result<u32, Fault> {
        let value = self.value(key)?;
        let count = value.as_u64().and_then(|count| u32::try_from(count).ok());
        let wanted = "a whole number from 0 to 4294967295";
        count.ok_or_else(|| wrong_kind(&self.name(key), value, wanted))
    }

    fn boolean(&self, key: &str) -> Result<bool, Fault> {
        match self.value(key)? {
            Value::Bool(flag) => Ok(*flag),
            other => Err(wrong_kind(&self.name(key), other, "true or false")),
        }
    }
}

pub(super) fn number(field: &str, value: &Value) -> Result<f64, Fault> {
    match value.as_f64() {
        Some(number) if number.is_finite() => Ok(number),
        _ => Err(wrong_kind(field, value, "a finite number")),
    }
}

fn wrong_kind(field: &str, found: &Value, wanted: &str) -> Fault {
    let mut shown = found.to_string();
    if shown.len() > 40 {
        let end = (0..=40).rev().find(|i| shown.is_char_boundary(*i));
        shown.truncate(end.unwrap_or(0));
        shown.push_str("...");
    }
    Fault::new(field, format!("{shown} is not {wanted}"))
}

fn read_header(map: &Map<String, Value>) -> Result<(TraceHeader, u64), Fault> {
    if map.get("format").and_then(Value::as_str) != Some(FORMAT) {
        let what = format!("a trace begins with a header line whose format is \"{FORMAT}\"");
        return Err(Fault::new("format", what));
    }
    let fields = Fields::new(
        "",
        map,
        &["format", "version", "headset", "refresh_hz", "hidden"],
    )?;
    let version = fields.value("version")?;
    let Some(version) = version.as_u64().filter(|number| VERSIONS.contains(number)) else {
        let [first, second] = VERSIONS;
        let what = format!(
            "{version} is neither {first} nor {second}, the versions that this program reads"
        );
        return Err(fields.fault("version", what));
    };
    let headset = match fields.value("headset")? {
        Value::String(name) => name.clone(),
        other => return Err(wrong_kind("headset", other, "a string")),
    };
    let header = TraceHeader {
        headset,
        refresh_hz: read_rate("refresh_hz", fields.value("refresh_hz")?)?,
        hidden: fields.optional("hidden", read_both_hidden)?,
    };
    Ok((header, version))
}

fn read_rate(path: &str, value: &Value) -> Result<f64, Fault> {
    let range = super::headset::REFRESH_RANGE_HZ;
    within(number(path, value)?, range, " Hz").map_err(|what| Fault::new(path, what))
}

/// What each eye has.
fn read_both<T>(
    path: &str,
    value: &Value,
    wanted: &str,
    read: fn(&str, &Value) -> Result<T, Fault>,
) -> Result<[T; 2], Fault> {
    let Some([left, right]) = value.as_array().map(Vec::as_slice) else {
        return Err(wrong_kind(path, value, wanted));
    };
    Ok([
        read(&format!("{path}[0]"), left)?,
        read(&format!("{path}[1]"), right)?,
    ])
}

fn read_both_hidden(path: &str, value: &Value) -> Result<[HiddenArea; 2], Fault> {
    read_both(path, value, "an array for two eyes", read_hidden)
}

fn read_hidden(path: &str, value: &Value) -> Result<HiddenArea, Fault> {
    let wrong =
        |found: &Value| wrong_kind(path, found, "an array of triangles [[x,y],[x,y],[x,y]]");
    let pair = |value: &Value| match value.as_array().map(Vec::as_slice) {
        Some([x, y]) => Ok([number(path, x)?, number(path, y)?]),
        _ => Err(wrong(value)),
    };
    let Value::Array(triangles) = value else {
        return Err(wrong(value));
    };
    triangles
        .iter()
        .map(|triangle| match triangle.as_array().map(Vec::as_slice) {
            Some([a, b, c]) => Ok([pair(a)?, pair(b)?, pair(c)?]),
            _ => Err(wrong(triangle)),
        })
        .collect::<Result<Vec<_>, _>>()
        .map(HiddenArea::from_triangles)
}

fn read_frame(map: &Map<String, Value>, version: u64) -> Result<TraceFrame, Fault> {
    let known = [
        "t_ns",
        "views",
        "flags",
        "switch_reuse",
        "input",
        "quality",
        "located",
        "refresh_hz",
        "hidden",
        "controller_model",
    ];
    // Those from `input` on came with version 2.
    let known = if version == 1 { &known[..4] } else { &known };
    let fields = Fields::new("", map, known)?;
    let t_ns = fields.value("t_ns")?;
    let Some(t_ns) = t_ns.as_i64() else {
        return Err(wrong_kind("t_ns", t_ns, "a whole number of nanoseconds"));
    };
    let views = read_views("views", fields.value("views")?)?;
    let flags = Fields::of(
        "flags",
        fields.value("flags")?,
        &["position_valid", "orientation_valid"],
    )?;
    let located = LocatedViews {
        views,
        flags: ViewFlags {
            position_valid: flags.boolean("position_valid")?,
            orientation_valid: flags.boolean("orientation_valid")?,
        },
        repeated: false,
    };
    Ok(TraceFrame {
        t_ns,
        views: validation::check_views(&located)?,
        switch_reuse: map.contains_key("switch_reuse") && fields.boolean("switch_reuse")?,
        located: fields.optional("located", |path, value| {
            let views = read_views(path, value)?;
            let checked = validation::check_views(&LocatedViews { views, ..located });
            let at = |fault: Fault| Fault {
                field: fault.field.replacen("views", path, 1),
                ..fault
            };
            Ok(checked.map_err(at)?.views)
        })?,
        quality: fields.optional("quality", read_quality)?,
        refresh_hz: fields.optional("refresh_hz", read_rate)?,
        hidden: fields.optional("hidden", read_both_hidden)?,
        controller_model: fields
            .optional("controller_model", controller_model::read_names)?
            .unwrap_or_default(),
        input: fields
            .optional("input", |_, value| Input::read(value))?
            .unwrap_or_default(),
    })
}

/// Whether the renderer was made for it is the renderer's to say.
fn read_quality(path: &str, value: &Value) -> Result<Quality, Fault> {
    let known = [
        "resolution_scale",
        "photons_per_frame",
        "photon_shares",
        "max_depth",
        "light_candidates",
        "half_rate",
        "filter_passes",
        "reuse",
    ];
    let fields = Fields::of(path, value, &known)?;
    let quality = Quality {
        resolution_scale: fields.number("resolution_scale")? as f32,
        photons_per_frame: fields.count("photons_per_frame")?,
        photon_shares: fields.count("photon_shares")?,
        max_depth: fields.count("max_depth")?,
        light_candidates: fields.count("light_candidates")?,
        half_rate: fields.boolean("half_rate")?,
        filter_passes: fields.count("filter_passes")?,
        reuse: fields.boolean("reuse")?,
    };
    match quality.out_of_range() {
        Some((key, what)) => Err(fields.fault(key, what)),
        None => Ok(quality),
    }
}

fn read_views(path: &str, value: &Value) -> Result<[View; 2], Fault> {
    let wanted = "an array of two views, left and right";
    read_both(path, value, wanted, read_view)
}

fn read_view(path: &str, value: &Value) -> Result<View, Fault> {
    let fields = Fields::of(path, value, &["position", "orientation", "fov"])?;
    let position = fields.numbers::<3>("position")?;
    let [x, y, z, w] = fields.numbers::<4>("orientation")?;
    let orientation = validation::unit_quaternion(x, y, z, w)
        .map_err(|what| fields.fault("orientation", what))?;
    let fov_path = fields.name("fov");
    let edges = ["left", "right", "up", "down"];
    let fov = Fields::of(&fov_path, fields.value("fov")?, &edges)?;
    Ok(View {
        position_in_world: DVec3::from_array(position),
        orientation,
        fov: Fov {
            angle_left: fov.number("left")?,
            angle_right: fov.number("right")?,
            angle_up: fov.number("up")?,
            angle_down: fov.number("down")?,
        },
    })
}

/// Whether what a field holds goes without saying.
pub(super) fn is_default<T: Default + PartialEq>(value: &T) -> bool {
    *value == T::default()
}

/// The header's line, with its line feed. `version`: one that can hold it and all frames ([`TraceHeader::version`],
/// [`TraceFrame::version`]).
///
/// # Errors
/// None that is known: serde_json's own.
pub fn header_line(header: &TraceHeader, version: u64) -> Result<String, serde_json::Error> {
    #[derive(Serialize)]
    struct Line<'a> {
        format: &'static str,
        version: u64,
        #[serde(flatten)]
        header: &'a TraceHeader,
    }
    let format = FORMAT;
    Ok(serde_json::to_string(&Line {
        format,
        version,
        header,
    })? + "\n")
}

/// Whether a file, as far as it goes, begins as [`header_line`] does: a recording, or one that was just begun.
///
/// # Errors
/// That of reading it.
pub fn begins_as_recording(path: &Path) -> std::io::Result<bool> {
    let mut found = Vec::new();
    let most = BEGINNING.len() as u64;
    File::open(path)?.take(most).read_to_end(&mut found)?;
    Ok(BEGINNING.as_bytes().starts_with(&found))
}

/// A frame's line, with its line feed. The views must have passed [`validation::check_views`], the input
/// [`Input::checked`].
///
/// # Errors
/// None that is known: serde_json's own.
pub fn frame_line(frame: &TraceFrame) -> Result<String, serde_json::Error> {
    Ok(serde_json::to_string(frame)? + "\n")
}
