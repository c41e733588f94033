//! Whether a scene holds together. What a file says is checked as it is read; a scene made in code may name what is not there.

use super::{Environment, Image, Material, Mesh, Node, Scene, SceneError, Skin};

/// What is wrong, in words that follow what it is wrong with.
type Checked = Result<(), String>;

impl Scene {
    /// Fails where a list names what another does not hold, vertices lack data, or a value is none that light can have. Looks at
    /// every vertex and triangle once.
    ///
    /// # Errors
    /// [`SceneError::Broken`]: the first fault, its list and number.
    pub fn check(&self) -> Result<(), SceneError> {
        self.check_lists().map_err(|fault| SceneError::Broken {
            scene: self.name.clone(),
            fault,
        })
    }

    fn check_lists(&self) -> Checked {
        let (materials, images) = (self.materials.len(), self.images.len());
        self.check_graph()?;
        each("skins", &self.skins, |_, skin| self.check_skin(skin))?;
        each("meshes", &self.meshes, |_, mesh| {
            check_mesh(mesh, materials)
        })?;
        each("materials", &self.materials, |_, of| {
            self.check_material(of)
        })?;
        each("textures", &self.textures, |_, texture| {
            names("image", texture.image as usize, images)
        })?;
        each("images", &self.images, |_, image| check_image(image))?;
        each("lights", &self.lights, |_, light| {
            check_light("has an intensity of", light.intensity)
        })?;
        let environment = self.environment.as_ref();
        environment.map_or(Ok(()), Environment::check)
    }

    fn check_graph(&self) -> Checked {
        let nodes = self.nodes.len();
        if let Some(root) = self.roots.iter().find(|root| **root >= nodes) {
            return Err(format!("roots name node {root}, and there are {nodes}"));
        }
        each("nodes", &self.nodes, |index, node| {
            self.check_node(index, node)
        })?;
        let is_below = |root: &&usize| self.nodes[**root].parent.is_some();
        match self.roots.iter().find(is_below) {
            Some(root) => Err(format!("roots name node {root}, which has a parent")),
            None => Ok(()),
        }
    }

    fn check_node(&self, index: usize, node: &Node) -> Checked {
        let nodes = self.nodes.len();
        for (what, number, count) in [
            ("node", node.parent, nodes),
            ("mesh", node.mesh, self.meshes.len()),
            ("light", node.light, self.lights.len()),
            ("camera", node.camera, self.cameras.len()),
            ("skin", node.skin, self.skins.len()),
        ] {
            number.map_or(Ok(()), |number| names(what, number, count))?;
        }
        for child in &node.children {
            names("node", *child, nodes)?;
            // Else its place is another's, or nobody's: a ring has none.
            if self.nodes[*child].parent != Some(index) {
                return Err(format!("names child {child}, whose parent it is not"));
            }
        }
        Ok(())
    }

    fn check_skin(&self, skin: &Skin) -> Checked {
        for joint in &skin.joints {
            names("node", *joint, self.nodes.len())?;
        }
        match [skin.joints.len(), skin.joint_from_mesh.len()] {
            [joints, matrices] if joints == matrices => Ok(()),
            [joints, matrices] => Err(format!("has {joints} joints and {matrices} matrices")),
        }
    }

    fn check_material(&self, material: &Material) -> Checked {
        for used in material.texture_slots().iter().filter_map(|slot| slot.1) {
            names("texture", used.texture as usize, self.textures.len())?;
        }
        check_light("emits", material.emission)
    }
}

/// Whether these are numbers that light can have.
pub(super) fn is_light(channels: &[f32]) -> bool {
    let mut channels = channels.iter();
    channels.all(|channel| channel.is_finite() && *channel >= 0.0)
}

fn check_light(what: &str, channels: [f32; 3]) -> Checked {
    if is_light(&channels) {
        return Ok(());
    }
    Err(format!("{what} {channels:?}"))
}

/// Checks the entries of a list, with their numbers.
fn each<T>(list: &str, entries: &[T], check: impl Fn(usize, &T) -> Checked) -> Checked {
    for (index, entry) in entries.iter().enumerate() {
        check(index, entry).map_err(|fault| format!("{list}[{index}] {fault}"))?;
    }
    Ok(())
}

/// Whether a list of so many entries has the one that is named.
fn names(what: &str, index: usize, count: usize) -> Checked {
    if index < count {
        return Ok(());
    }
    Err(format!("names {what} {index}, and there are {count}"))
}

fn check_image(image: &Image) -> Checked {
    let (width, height, held) = (image.width, image.height, image.rgba8.len());
    if held as u64 == u64::from(width) * u64::from(height) * 4 {
        return Ok(());
    }
    Err(format!("is {width}x{height} and has {held} bytes"))
}

fn check_mesh(mesh: &Mesh, materials: usize) -> Checked {
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
        return Err(format!("has {vertices} positions and {length} {list}"));
    }
    let is_finite = |position: &[f32; 3]| position.iter().all(|c| c.is_finite());
    let mut positions = mesh.positions.iter();
    if let Some(vertex) = positions.position(|position| !is_finite(position)) {
        let position = mesh.positions[vertex];
        return Err(format!("has vertex {vertex} at {position:?}"));
    }
    for (index, triangle) in mesh.triangles.iter().enumerate() {
        let used = triangle.vertices.map(|vertex| ("vertex", vertex, vertices));
        let material = ("material", triangle.material, materials);
        for (what, number, count) in used.into_iter().chain([material]) {
            if number as usize >= count {
                return Err(format!(
                    "names {what} {number} in triangle {index}, and there are {count}"
                ));
            }
        }
    }
    Ok(())
}
