//! Animations: keyframes of nodes and morph weights, sampled at any time (glTF 2.0, section 3.11 and appendix C).

use glam::{DAffine3, DQuat, DVec3};

use super::{Scene, SceneError, ScenePose};
use stereolux_base::printable::did_you_mean;

/// How values between two keys are found.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Interpolation {
    /// The last key's value.
    Step,
    /// Along the line, or the shorter great arc for rotations.
    Linear,
    /// Cubic Hermite splines; three values per key: in-tangent, value, out-tangent.
    CubicSpline,
}

/// Values over time.
#[derive(Clone, Debug, PartialEq)]
pub struct Track {
    /// Seconds, strictly ascending, at least one.
    pub times_s: Vec<f64>,
    /// `width` numbers per value, one value per key, or three with [`Interpolation::CubicSpline`].
    pub values: Vec<f64>,
    /// Numbers per value.
    pub width: usize,
    /// Between keys.
    pub interpolation: Interpolation,
}

/// Local transform in parts, as animations change it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Trs {
    /// Metres.
    pub translation: DVec3,
    /// Unit quaternion.
    pub rotation: DQuat,
    /// Along the rotated axes.
    pub scale: DVec3,
}

impl Default for Trs {
    /// At the parent's place.
    fn default() -> Self {
        Self {
            translation: DVec3::ZERO,
            rotation: DQuat::IDENTITY,
            scale: DVec3::ONE,
        }
    }
}

/// By how much a quaternion's length may differ from 1 to be taken as it is. Dividing by the length leaves a few times
/// 2^-53, so that what was divided once is never divided again and numbers survive writing and reading.
const UNIT_LENGTH: f64 = 1e-15;

impl Trs {
    /// A matrix taken apart; shear is lost.
    pub fn of(parent_from_node: &DAffine3) -> Self {
        let (scale, rotation, translation) = parent_from_node.to_scale_rotation_translation();
        Self {
            translation,
            rotation: Self::unit(rotation).unwrap_or(DQuat::IDENTITY),
            scale,
        }
    }

    /// A quaternion brought to unit length; `None` if it has none.
    pub fn unit(rotation: DQuat) -> Option<DQuat> {
        let length = rotation.length();
        if !(length > 1e-6 && length.is_finite()) {
            return None;
        }
        Some(if (length - 1.0).abs() <= UNIT_LENGTH {
            rotation
        } else {
            rotation / length
        })
    }

    /// As one matrix.
    pub fn parent_from_node(&self) -> DAffine3 {
        DAffine3::from_scale_rotation_translation(self.scale, self.rotation, self.translation)
    }
}

/// What a clip does to one node.
#[derive(Clone, Debug, PartialEq)]
pub struct NodeTracks {
    /// Index into [`Scene::nodes`].
    pub node: usize,
    /// Three numbers per key.
    pub translation: Option<Track>,
    /// Four numbers per key: x, y, z, w.
    pub rotation: Option<Track>,
    /// Three numbers per key.
    pub scale: Option<Track>,
    /// One number per morph target of the node's mesh.
    pub weights: Option<Track>,
}

/// One animation of a file.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Animation {
    /// Name in the file, or `animation N`.
    pub name: String,
    /// Its place among the file's animations, from 0; those that move nothing are left out.
    pub number: usize,
    /// One entry per node that moves.
    pub nodes: Vec<NodeTracks>,
    /// Time of the last key, s: the clip begins anew there.
    pub length_s: f64,
}

impl Track {
    /// Writes the value at `time_s`: the first key's before it, the last key's behind it.
    pub fn sample_into(&self, time_s: f64, value: &mut [f64]) {
        let (key, share, gap_s) = self.locate(time_s);
        let is_spline = self.interpolation == Interpolation::CubicSpline;
        let at = |key: usize, part: usize, component: usize| -> f64 {
            let index = if is_spline { 3 * key + part } else { key };
            let index = index * self.width + component;
            self.values.get(index).copied().unwrap_or_default()
        };
        for (component, value) in value.iter_mut().enumerate().take(self.width) {
            *value = match self.interpolation {
                _ if gap_s == 0.0 => at(key, 1, component),
                Interpolation::Step => at(key, 1, component),
                Interpolation::Linear => {
                    let (from, to) = (at(key, 1, component), at(key + 1, 1, component));
                    from + share * (to - from)
                }
                // Appendix C.5.
                Interpolation::CubicSpline => {
                    let (t, t2, t3) = (share, share * share, share * share * share);
                    (2.0 * t3 - 3.0 * t2 + 1.0) * at(key, 1, component)
                        + gap_s * (t3 - 2.0 * t2 + t) * at(key, 2, component)
                        + (-2.0 * t3 + 3.0 * t2) * at(key + 1, 1, component)
                        + gap_s * (t3 - t2) * at(key + 1, 0, component)
                }
            };
        }
    }

    /// The value at `time_s`.
    pub fn sample(&self, time_s: f64) -> Vec<f64> {
        let mut value = vec![0.0; self.width];
        self.sample_into(time_s, &mut value);
        value
    }

    fn vector(&self, time_s: f64) -> DVec3 {
        let mut value = [0.0; 3];
        self.sample_into(time_s, &mut value);
        DVec3::from_array(value)
    }

    /// A unit quaternion. Appendix C.3 and C.4: rotations are interpolated spherically, splines are normalised.
    fn rotation(&self, time_s: f64) -> DQuat {
        let (key, share, gap_s) = self.locate(time_s);
        if self.interpolation == Interpolation::Linear && gap_s > 0.0 {
            let [from, to] = [key, key + 1].map(|key| {
                let value = |component| self.values.get(key * self.width + component);
                unit([0, 1, 2, 3].map(|component| value(component).copied().unwrap_or_default()))
            });
            // The shorter way round.
            return from.slerp(to, share).normalize();
        }
        let mut value = [0.0; 4];
        self.sample_into(time_s, &mut value);
        unit(value)
    }

    /// The key at or before `time_s`, how far on to the next one (0 to 1), and their distance in seconds; 0 where one
    /// key alone counts.
    fn locate(&self, time_s: f64) -> (usize, f64, f64) {
        let after = self.times_s.partition_point(|key| *key <= time_s);
        let last = self.times_s.len().saturating_sub(1);
        if after == 0 {
            return (0, 0.0, 0.0);
        }
        let key = after - 1;
        if key >= last {
            return (last, 0.0, 0.0);
        }
        let gap_s = self.times_s[key + 1] - self.times_s[key];
        (key, (time_s - self.times_s[key]) / gap_s, gap_s)
    }
}

fn unit(value: [f64; 4]) -> DQuat {
    Trs::unit(DQuat::from_array(value)).unwrap_or(DQuat::IDENTITY)
}

impl NodeTracks {
    /// Local transform at a time within the clip of a node that stands at `rest` without it.
    pub fn local(&self, rest: Trs, time_s: f64) -> DAffine3 {
        let vector =
            |track: &Option<Track>, rest| track.as_ref().map_or(rest, |track| track.vector(time_s));
        Trs {
            translation: vector(&self.translation, rest.translation),
            rotation: self
                .rotation
                .as_ref()
                .map_or(rest.rotation, |track| track.rotation(time_s)),
            scale: vector(&self.scale, rest.scale),
        }
        .parent_from_node()
    }
}

impl Animation {
    /// A time within the clip: it begins anew after its last key, and runs backwards before its first. Files have the times of
    /// keys in f32, so the last one is shown where a time rounds to it.
    pub fn looped(&self, time_s: f64) -> f64 {
        if self.length_s <= 0.0 {
            0.0
        } else if time_s as f32 == self.length_s as f32 {
            self.length_s
        } else {
            time_s.rem_euclid(self.length_s)
        }
    }
}

impl Scene {
    /// The pose of a clip at a time, looped. Nodes that it leaves alone stay as the file has them.
    pub fn pose_at(&self, clip: &Animation, time_s: f64) -> ScenePose {
        let time_s = clip.looped(time_s);
        let mut locals: Vec<DAffine3> = self
            .nodes
            .iter()
            .map(|node| node.parent_from_node)
            .collect();
        let mut morph_weights: Vec<Vec<f64>> = self
            .nodes
            .iter()
            .map(|node| node.morph_weights.clone())
            .collect();
        for tracks in &clip.nodes {
            let moves =
                tracks.translation.is_some() || tracks.rotation.is_some() || tracks.scale.is_some();
            if let (Some(node), true) = (self.nodes.get(tracks.node), moves) {
                locals[tracks.node] = tracks.local(node.trs(), time_s);
            }
            if let (Some(weights), Some(track)) =
                (morph_weights.get_mut(tracks.node), &tracks.weights)
            {
                *weights = track.sample(time_s);
            }
        }
        ScenePose {
            world_from_node: self.world_from_nodes(&locals),
            morph_weights,
        }
    }

    /// The clip that a setting names: by name, by number from 0, `none`, or empty for the first one.
    ///
    /// # Errors
    /// A name or number that the scene does not have; the message lists those that it has.
    pub fn clip(&self, wanted: &str) -> Result<Option<&Animation>, SceneError> {
        if wanted.is_empty() {
            return Ok(self.animations.first());
        }
        if wanted == "none" {
            return Ok(None);
        }
        let named = self.animations.iter().find(|clip| clip.name == wanted);
        let numbered = || {
            let number: usize = wanted.parse().ok()?;
            self.animations.iter().find(|clip| clip.number == number)
        };
        named.or_else(numbered).map(Some).ok_or_else(|| {
            let known: Vec<String> = self
                .animations
                .iter()
                .map(|clip| format!("{} '{}'", clip.number, clip.name))
                .collect();
            SceneError::UnknownClip {
                scene: self.name.clone(),
                wanted: wanted.to_owned(),
                known: if known.is_empty() {
                    "it has no animations".to_owned()
                } else {
                    let names = self.animations.iter().map(|clip| clip.name.as_str());
                    let hint = did_you_mean(wanted, names);
                    format!("it has {}{hint}", known.join(", "))
                },
            }
        })
    }
}

#[cfg(test)]
mod tests;
