//! Whether a scene holds together. What a file says is checked as it is read; a scene made in code may name what is not there.

use super::{Mesh, Scene, SceneError};

impl Scene {
    /// Fails where a list names what another does not hold, vertices lack data, or a value is none that light can have. Looks at
    /// every vertex and triangle once.
    ///
    /// # Errors
    /// [`SceneError::Broken`]: the first fault, its list and number.
    pub fn check(&self) -> Result<(), SceneError> {
        self.fault().map_or(Ok(()), |fault| {
            Err(SceneError::Broken {
                scene: self.name.clone(),
                fault,
            })
        })
    }

    fn fault(&self) -> Option<String> {
        let counted = |what: &str, index: usize, count: usize| {
            (index >= count).then(|| format!("{what} {index}, and there are {count}"))
        };
        let nodes = self.nodes.len();
        if let Some(beyond) = self
            .roots
            .iter()
            .find_map(|root| counted("node", *root, nodes))
        {
            return Some(format!("roots name {beyond}"));
        }
        for (index, node) in self.nodes.iter().enumerate() {
            let named = [
                ("node", node.parent, nodes),
                ("mesh", node.mesh, self.meshes.len()),
                ("light", node.light, self.lights.len()),
                ("camera", node.camera, self.cameras.len()),
                ("skin", node.skin, self.skins.len()),
            ];
            let mut beyond = named
                .into_iter()
                .find_map(|(what, number, count)| counted(what, number?, count));
            for child in &node.children {
                beyond = beyond.or_else(|| counted("node", *child, nodes));
                // Else its place is another's, or nobody's: a ring has none.
                let is_own = |child: &super::Node| child.parent == Some(index);
                if !self.nodes.get(*child).is_none_or(is_own) {
                    beyond =
                        beyond.or_else(|| Some(format!("child {child}, whose parent it is not")));
                }
            }
            if let Some(beyond) = beyond {
                return Some(format!("nodes[{index}] names {beyond}"));
            }
        }
        if let Some(root) = self
            .roots
            .iter()
            .find(|root| self.nodes[**root].parent.is_some())
        {
            return Some(format!("roots name node {root}, which has a parent"));
        }
        for (index, skin) in self.skins.iter().enumerate() {
            if let Some(beyond) = skin
                .joints
                .iter()
                .find_map(|joint| counted("node", *joint, nodes))
            {
                return Some(format!("skins[{index}] names {beyond}"));
            }
            if skin.joints.len() != skin.joint_from_mesh.len() {
                let [joints, matrices] = [skin.joints.len(), skin.joint_from_mesh.len()];
                return Some(format!(
                    "skins[{index}] has {joints} joints and {matrices} matrices"
                ));
            }
        }
        for (index, mesh) in self.meshes.iter().enumerate() {
            if let Some(fault) = fault_of_mesh(mesh, self.materials.len()) {
                return Some(format!("meshes[{index}] {fault}"));
            }
        }
        let is_light = |channels: &[f32; 3]| channels.iter().all(|c| c.is_finite() && *c >= 0.0);
        for (index, material) in self.materials.iter().enumerate() {
            let mut slots = material
                .texture_slots()
                .into_iter()
                .filter_map(|(_, slot)| slot);
            let beyond = slots
                .find_map(|used| counted("texture", used.texture as usize, self.textures.len()));
            if let Some(beyond) = beyond {
                return Some(format!("materials[{index}] names {beyond}"));
            }
            if !is_light(&material.emission) {
                return Some(format!("materials[{index}] emits {:?}", material.emission));
            }
        }
        for (index, texture) in self.textures.iter().enumerate() {
            if let Some(beyond) = counted("image", texture.image as usize, self.images.len()) {
                return Some(format!("textures[{index}] names {beyond}"));
            }
        }
        for (index, image) in self.images.iter().enumerate() {
            let bytes = u64::from(image.width) * u64::from(image.height) * 4;
            if image.rgba8.len() as u64 != bytes {
                let (width, height, held) = (image.width, image.height, image.rgba8.len());
                return Some(format!(
                    "images[{index}] is {width}x{height} and has {held} bytes"
                ));
            }
        }
        let mut lights = self.lights.iter().enumerate();
        let dark = lights.find(|(_, light)| !is_light(&light.intensity));
        dark.map(|(index, light)| {
            format!("lights[{index}] has an intensity of {:?}", light.intensity)
        })
    }
}

fn fault_of_mesh(mesh: &Mesh, materials: usize) -> Option<String> {
    let vertices = mesh.positions.len();
    // Without one of the others there are defaults.
    let optional = [
        ("tangents", mesh.tangents.len()),
        ("uv0", mesh.uv0.len()),
        ("uv1", mesh.uv1.len()),
        ("colors", mesh.colors.len()),
        ("joints", mesh.joints.len()),
    ];
    let shapes = mesh.targets.iter().flat_map(|target| {
        [
            ("target positions", target.positions.len()),
            ("target normals", target.normals.len()),
        ]
    });
    let given = optional.into_iter().chain(shapes);
    let mut lists = given
        .filter(|(_, length)| *length > 0)
        .chain([("normals", mesh.normals.len())]);
    if let Some((list, length)) = lists.find(|(_, length)| *length != vertices) {
        return Some(format!("has {vertices} positions and {length} {list}"));
    }
    let is_finite = |position: &[f32; 3]| position.iter().all(|c| c.is_finite());
    if let Some(vertex) = mesh
        .positions
        .iter()
        .position(|position| !is_finite(position))
    {
        return Some(format!(
            "has vertex {vertex} at {:?}",
            mesh.positions[vertex]
        ));
    }
    for (index, triangle) in mesh.triangles.iter().enumerate() {
        if let Some(vertex) = triangle
            .vertices
            .iter()
            .find(|vertex| **vertex as usize >= vertices)
        {
            return Some(format!(
                "names vertex {vertex} in triangle {index}, and there are {vertices}"
            ));
        }
        if triangle.material as usize >= materials {
            let material = triangle.material;
            return Some(format!(
                "names material {material} in triangle {index}, and there are {materials}"
            ));
        }
    }
    None
}
