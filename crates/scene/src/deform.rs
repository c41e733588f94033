//! Skins and morph targets in f64: what the device computes in f32, for bounds, rebuilt hierarchies and tests.

use glam::{DAffine3, DMat3, DVec3};

use super::{Mesh, Scene, ScenePose, as_dvec3};

/// The joints of a skinned mesh.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Skin {
    /// Name in the file, or `skin N`.
    pub name: String,
    /// Indices into [`Scene::nodes`]; at least one.
    pub joints: Vec<usize>,
    /// From the mesh's space to each joint's.
    pub joint_from_mesh: Vec<DAffine3>,
}

/// Which joints move a vertex.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct VertexJoints {
    /// Indices into [`Skin::joints`].
    pub joints: [u16; 4],
    /// They sum to 1; 0 where a joint is not used.
    pub weights: [f32; 4],
}

/// Differences from a mesh's vertices, weighted and added.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct MorphTarget {
    /// One per vertex, metres.
    pub positions: Vec<[f32; 3]>,
    /// One per vertex.
    pub normals: Vec<[f32; 3]>,
}

/// What deforms one instance at one time.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Deformation {
    /// Placement of the space that deformed vertices are in. It stands at the skin's first joint with the world's axes,
    /// so that the numbers stay small; without a skin it is the node's own.
    pub world_from_object: DAffine3,
    /// For each joint the matrix from the mesh's space to that one; empty without a skin.
    pub object_from_mesh: Vec<DAffine3>,
    /// One per morph target.
    pub weights: Vec<f64>,
}

impl Scene {
    /// Whether the mesh of a node changes its shape: by a skin, or by morph targets.
    pub fn deforms(&self, node: usize) -> bool {
        self.skin_of(node).is_some() || self.has_targets(node)
    }

    /// The skin of a node whose mesh has joints; others have no use of one.
    pub(crate) fn skin_of(&self, node: usize) -> Option<&Skin> {
        let node = self.nodes.get(node)?;
        let mesh = self.meshes.get(node.mesh?)?;
        let skin = self.skins.get(node.skin?)?;
        (!mesh.joints.is_empty()).then_some(skin)
    }

    fn has_targets(&self, node: usize) -> bool {
        let mesh = self.nodes.get(node).and_then(|node| node.mesh);
        mesh.and_then(|mesh| self.meshes.get(mesh))
            .is_some_and(|mesh| !mesh.targets.is_empty())
    }

    /// What deforms the mesh of a node in a pose.
    pub fn deformation(&self, node: usize, pose: &ScenePose) -> Deformation {
        let world_from = |node: usize| pose.world_from_node.get(node).copied().unwrap_or_default();
        let weights = match pose.morph_weights.get(node) {
            Some(weights) => weights.clone(),
            None => self
                .nodes
                .get(node)
                .map(|node| node.morph_weights.clone())
                .unwrap_or_default(),
        };
        let Some(skin) = self.skin_of(node) else {
            return Deformation {
                world_from_object: world_from(node),
                object_from_mesh: Vec::new(),
                weights,
            };
        };
        // Section 3.7.3.3: the node's own transform does not count, only the joints' do.
        let stand = skin
            .joints
            .first()
            .map_or(DVec3::ZERO, |joint| world_from(*joint).translation);
        let mut world_from_object = DAffine3::from_translation(stand);
        // It does count for which side is the front (section 3.7.4).
        if world_from(node).matrix3.determinant() < 0.0 {
            world_from_object.matrix3 = DMat3::from_diagonal(DVec3::new(-1.0, 1.0, 1.0));
        }
        let object_from_world = world_from_object.inverse();
        let joints = skin.joints.iter().zip(&skin.joint_from_mesh);
        let object_from_mesh = joints
            .map(|(joint, joint_from_mesh)| {
                object_from_world * world_from(*joint) * *joint_from_mesh
            })
            .collect();
        Deformation {
            world_from_object,
            object_from_mesh,
            weights,
        }
    }

    /// Positions of an instance's vertices in the world, in a pose.
    pub fn positions_in_world(&self, node: usize, mesh: &Mesh, pose: &ScenePose) -> Vec<DVec3> {
        let deformation = self.deformation(node, pose);
        deformation
            .positions(mesh)
            .into_iter()
            .map(|position| deformation.world_from_object.transform_point3(position))
            .collect()
    }
}

impl Deformation {
    /// Positions of the mesh's vertices in the deformed object space.
    pub fn positions(&self, mesh: &Mesh) -> Vec<DVec3> {
        (0..mesh.positions.len())
            .map(|vertex| self.position(mesh, vertex))
            .collect()
    }

    /// Position of one of them.
    pub fn position(&self, mesh: &Mesh, vertex: usize) -> DVec3 {
        let morphed = self.morphed(&mesh.positions, vertex, |target| &target.positions, mesh);
        match self.blend(mesh, vertex) {
            Some(object_from_mesh) => object_from_mesh.transform_point3(morphed),
            None => morphed,
        }
    }

    /// Unit normals of the mesh's vertices in the deformed object space.
    pub fn normals(&self, mesh: &Mesh) -> Vec<DVec3> {
        (0..mesh.normals.len())
            .map(|vertex| {
                let morphed = self.morphed(&mesh.normals, vertex, |target| &target.normals, mesh);
                let turned = match self.blend(mesh, vertex) {
                    Some(object_from_mesh) => cofactor(&object_from_mesh.matrix3) * morphed,
                    None => morphed,
                };
                turned.normalize_or_zero()
            })
            .collect()
    }

    fn morphed(
        &self,
        base: &[[f32; 3]],
        vertex: usize,
        deltas: impl Fn(&MorphTarget) -> &Vec<[f32; 3]>,
        mesh: &Mesh,
    ) -> DVec3 {
        let base = as_dvec3(base.get(vertex).copied().unwrap_or_default());
        mesh.targets
            .iter()
            .zip(&self.weights)
            .fold(base, |sum, (target, weight)| {
                let delta = deltas(target).get(vertex).copied().unwrap_or_default();
                sum + *weight * as_dvec3(delta)
            })
    }

    fn blend(&self, mesh: &Mesh, vertex: usize) -> Option<DAffine3> {
        if self.object_from_mesh.is_empty() {
            return None;
        }
        let influences = mesh.joints.get(vertex).copied().unwrap_or_default();
        let mut sum = DAffine3 {
            matrix3: DMat3::ZERO,
            translation: DVec3::ZERO,
        };
        for (joint, weight) in influences.joints.into_iter().zip(influences.weights) {
            let weight = f64::from(weight);
            if let Some(matrix) = self.object_from_mesh.get(usize::from(joint)) {
                sum.matrix3 += matrix.matrix3 * weight;
                sum.translation += matrix.translation * weight;
            }
        }
        Some(sum)
    }
}

/// Carries normals: the inverse transpose times the determinant, which exists also without an inverse.
pub fn cofactor(matrix: &DMat3) -> DMat3 {
    let [x, y, z] = [matrix.x_axis, matrix.y_axis, matrix.z_axis];
    DMat3::from_cols(y.cross(z), z.cross(x), x.cross(y))
}
