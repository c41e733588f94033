//! Joints and morph targets of a primitive.

use gltf::json::mesh::Semantic;
use gltf::json::validation::Checked;

use super::{PrimitiveData, PrimitiveImport};
use crate::{Mesh, MorphTarget, SceneError, VertexJoints};

impl PrimitiveImport<'_, '_> {
    /// `JOINTS_n` and `WEIGHTS_n` for n of 0 and 1: of up to eight influences the four largest, made to sum to 1.
    pub(super) fn joints(&mut self, count: usize) -> Result<Option<Vec<VertexJoints>>, SceneError> {
        let mut all: Vec<Vec<(u16, f32)>> = Vec::new();
        for set in [0, 1] {
            let joints = self.attribute::<4>(&Semantic::Joints(set), Some(count))?;
            let weights = self.attribute::<4>(&Semantic::Weights(set), Some(count))?;
            let (joints, weights) = match (joints, weights) {
                (Some(joints), Some(weights)) => (joints, weights),
                (None, None) => break,
                _ => {
                    return Err(self.fault(&format!(
                        "JOINTS_{set} and WEIGHTS_{set} go together, but one of them is missing"
                    )));
                }
            };
            all.resize(count, Vec::new());
            for (vertex, (joints, weights)) in joints.iter().zip(&weights).enumerate() {
                if let Some(bad) = joints.iter().find(|joint| {
                    !(0.0..=f32::from(u16::MAX)).contains(*joint) || joint.fract() != 0.0
                }) {
                    return Err(self.fault(&format!(
                        "JOINTS_{set} of vertex {vertex}: {bad} is no joint's number"
                    )));
                }
                if weights.iter().any(|weight| *weight < 0.0) {
                    return Err(self.fault(&format!(
                        "WEIGHTS_{set} of vertex {vertex} is negative: {weights:?}"
                    )));
                }
                all[vertex].extend(joints.iter().map(|joint| *joint as u16).zip(*weights));
            }
        }
        if self
            .primitive
            .attributes
            .contains_key(&Checked::Valid(Semantic::Joints(2)))
        {
            self.notes.warn(format_args!(
                "{}: joints beyond the eighth of a vertex are ignored",
                self.place
            ));
        }
        if all.is_empty() {
            return Ok(None);
        }
        let mut unbound = 0;
        let joints = all
            .into_iter()
            .map(|mut influences| {
                // Stable, so that equal weights keep the file's order.
                influences.sort_by(|a, b| b.1.total_cmp(&a.1));
                influences.truncate(4);
                let sum: f64 = influences
                    .iter()
                    .map(|(_, weight)| f64::from(*weight))
                    .sum();
                if sum <= 0.0 || !sum.is_finite() {
                    unbound += 1;
                    return VertexJoints {
                        joints: [influences.first().map_or(0, |(joint, _)| *joint), 0, 0, 0],
                        weights: [1.0, 0.0, 0.0, 0.0],
                    };
                }
                let mut vertex = VertexJoints::default();
                for (slot, (joint, weight)) in influences.into_iter().enumerate() {
                    vertex.joints[slot] = joint;
                    vertex.weights[slot] = (f64::from(weight) / sum) as f32;
                }
                vertex
            })
            .collect();
        if unbound > 0 {
            self.notes.warn(format_args!(
                "{}: {unbound} vertices have no joint's weight and follow their first joint",
                self.place
            ));
        }
        Ok(Some(joints))
    }

    pub(super) fn targets(&mut self, count: usize) -> Result<Vec<MorphTarget>, SceneError> {
        let primitive = self.primitive;
        let mut targets = Vec::new();
        for (at, target) in primitive.targets.iter().flatten().enumerate() {
            let deltas = |accessor: Option<usize>, semantic: &Semantic| {
                let Some(accessor) = accessor else {
                    return Ok(vec![[0.0; 3]; count]);
                };
                self.check_count(accessor, semantic, Some(count))?;
                let place = format!("{}.targets[{at}].{}", self.place, semantic.to_string());
                let (_, values) = self.reader.read_floats(accessor, &[3], &place)?;
                let (elements, _) = values.as_chunks::<3>();
                self.check(elements, semantic)?;
                Ok(elements.to_vec())
            };
            targets.push(MorphTarget {
                positions: deltas(
                    target.positions.map(|accessor| accessor.value()),
                    &Semantic::Positions,
                )?,
                normals: deltas(
                    target.normals.map(|accessor| accessor.value()),
                    &Semantic::Normals,
                )?,
            });
        }
        Ok(targets)
    }

    pub(super) fn append_motion(
        &mut self,
        data: &PrimitiveData,
        sources: &[u32],
        mesh: &mut Mesh,
    ) -> Result<(), SceneError> {
        let base = mesh.positions.len();
        if data.normals.is_none() {
            mesh.flat.push(base as u32..(base + sources.len()) as u32);
        }
        // Vertices of other primitives that have none follow the first joint.
        let lone = VertexJoints {
            joints: [0; 4],
            weights: [1.0, 0.0, 0.0, 0.0],
        };
        if data.joints.is_some() || !mesh.joints.is_empty() {
            mesh.joints.resize(base, lone);
            mesh.joints.extend(sources.iter().map(|source| {
                data.joints
                    .as_ref()
                    .map_or(lone, |joints| joints[*source as usize])
            }));
        }
        if mesh.targets.len() != data.targets.len() {
            return Err(self.fault(&format!(
                "has {} morph targets, the first one has {}; all need the same number",
                data.targets.len(),
                mesh.targets.len()
            )));
        }
        for (target, source) in mesh.targets.iter_mut().zip(&data.targets) {
            let pick = |deltas: &Vec<[f32; 3]>| -> Vec<[f32; 3]> {
                sources.iter().map(|at| deltas[*at as usize]).collect()
            };
            target.positions.extend(pick(&source.positions));
            target.normals.extend(pick(&source.normals));
        }
        Ok(())
    }
}
