//! Scenes that are added to another one while it is shown, and taken out again.

use std::ops::Range;
use std::sync::atomic::{AtomicU64, Ordering};

use super::edit::{EditError, Placement, checked};
use super::{Image, Material, Mesh, Node, Scene, Skin, Texture};

/// Where a scene that was added to another one lies in its lists. Nothing else moves while it is there.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct ScenePart {
    /// Its nodes; the first is the one that they hang on.
    pub nodes: Range<usize>,
    /// Its meshes.
    pub meshes: Range<usize>,
    /// Its materials.
    pub materials: Range<usize>,
    /// Its textures.
    pub textures: Range<usize>,
    /// Its images.
    pub images: Range<usize>,
    /// Its lights.
    pub lights: Range<usize>,
    /// Its cameras.
    pub cameras: Range<usize>,
    /// Its skins.
    pub skins: Range<usize>,
    /// Its animations.
    pub animations: Range<usize>,
    /// Tells it from others, which get the same numbers once it is gone.
    pub serial: u64,
}

/// Parts that were added in this process.
static ADDED: AtomicU64 = AtomicU64::new(0);

impl ScenePart {
    /// The node that all others hang on: to be moved, hidden, found.
    #[must_use]
    pub fn root(&self) -> usize {
        self.nodes.start
    }

    /// Shortens lists that end with this part; what is no longer there is no part of it. True if nothing is left of it.
    fn trim(&mut self, scene: &mut Scene) -> bool {
        fn cut<T>(list: &mut Vec<T>, own: &mut Range<usize>) -> bool {
            if own.end == list.len() {
                list.truncate(own.start);
                own.end = own.start;
                if list.capacity() > 2 * list.len() {
                    list.shrink_to_fit();
                }
            }
            own.start == own.end
        }
        // Each of them, without stopping at the first.
        [
            cut(&mut scene.nodes, &mut self.nodes),
            cut(&mut scene.meshes, &mut self.meshes),
            cut(&mut scene.materials, &mut self.materials),
            cut(&mut scene.textures, &mut self.textures),
            cut(&mut scene.images, &mut self.images),
            cut(&mut scene.lights, &mut self.lights),
            cut(&mut scene.cameras, &mut self.cameras),
            cut(&mut scene.skins, &mut self.skins),
            cut(&mut scene.animations, &mut self.animations),
        ]
        .into_iter()
        .all(|is_gone| is_gone)
    }
}

/// Takes a list's new end over and says where it begins.
fn append<T>(list: &mut Vec<T>, end: Vec<T>) -> Range<usize> {
    let first = list.len();
    list.extend(end);
    first..list.len()
}

impl Scene {
    /// Adds another scene, say a glTF file that was loaded on a thread, below a new last node `name` under `parent` (none: a
    /// root). All its lists go to the ends of this one's, so that every number stays what it is. Its surroundings and its
    /// warnings are left behind. Work in proportion to nodes, triangles alone for the numbers of their materials.
    ///
    /// # Errors
    /// [`EditError`]: no such parent, or a placement that no node can have; nothing is changed then.
    pub fn add_part(
        &mut self,
        part: Self,
        name: &str,
        parent: Option<usize>,
        to: Placement,
    ) -> Result<ScenePart, EditError> {
        if let Some(parent) = parent
            && !self.reaches(parent)
        {
            return Err(EditError::Missing {
                what: "node",
                index: parent,
                count: self.nodes.len(),
            });
        }
        let to = checked(name, to)?;
        let root = self.nodes.len();
        let first = [
            root + 1,
            self.meshes.len(),
            self.lights.len(),
            self.cameras.len(),
            self.skins.len(),
        ];
        let mut nodes = vec![Node {
            name: name.to_owned(),
            parent,
            children: part.roots.iter().map(|child| child + first[0]).collect(),
            parent_from_node: to.parent_from_node(),
            parts: to.parts(),
            ..Node::default()
        }];
        nodes.extend(part.nodes.into_iter().map(|mut node| {
            node.parent = node.parent.map(|parent| parent + first[0]);
            for child in &mut node.children {
                *child += first[0];
            }
            for (number, first) in [
                (&mut node.mesh, first[1]),
                (&mut node.light, first[2]),
                (&mut node.camera, first[3]),
                (&mut node.skin, first[4]),
            ] {
                *number = number.map(|number| number + first);
            }
            node
        }));
        for child in &part.roots {
            nodes[child + 1].parent = Some(root);
        }
        let mut meshes = part.meshes;
        for mesh in &mut meshes {
            let first = self.materials.len() as u32;
            for triangle in &mut mesh.triangles {
                triangle.material += first;
            }
            for number in mesh.repainted.iter_mut().flatten() {
                *number += first;
            }
        }
        let mut materials = part.materials;
        for material in &mut materials {
            for reference in material.texture_slots_mut().into_iter().flatten() {
                reference.texture += self.textures.len() as u32;
            }
        }
        let mut textures = part.textures;
        for texture in &mut textures {
            texture.image += self.images.len() as u32;
        }
        let mut skins = part.skins;
        for joint in skins.iter_mut().flat_map(|skin| &mut skin.joints) {
            *joint += first[0];
        }
        let mut animations = part.animations;
        for tracks in animations.iter_mut().flat_map(|clip| &mut clip.nodes) {
            tracks.node += first[0];
        }
        match parent {
            Some(parent) => self.nodes[parent].children.push(root),
            None => self.roots.push(root),
        }
        let serial = ADDED.fetch_add(1, Ordering::Relaxed);
        self.parts.push(serial);
        Ok(ScenePart {
            serial,
            nodes: append(&mut self.nodes, nodes),
            meshes: append(&mut self.meshes, meshes),
            materials: append(&mut self.materials, materials),
            textures: append(&mut self.textures, textures),
            images: append(&mut self.images, part.images),
            lights: append(&mut self.lights, part.lights),
            cameras: append(&mut self.cameras, part.cameras),
            skins: append(&mut self.skins, skins),
            animations: append(&mut self.animations, animations),
        })
    }

    /// Takes a part out and frees what it holds. Numbers of all else stay: where something was added behind it, empty entries
    /// are left until that goes too. What was hung below its nodes since goes with it, as [`super::edit::Edit::Delete`] does.
    ///
    /// # Errors
    /// [`EditError::Value`] where a node of another part still shows a mesh or a light of this one: delete that first.
    /// [`EditError::Gone`] if it was taken out already. Nothing is changed then.
    pub fn remove_part(&mut self, part: &ScenePart) -> Result<(), EditError> {
        let root = part.root();
        // One whose root was deleted still takes its memory.
        let Some(at) = self.parts.iter().position(|there| *there == part.serial) else {
            return Err(EditError::Gone {
                name: format!("the part at node {root}"),
            });
        };
        let below = self.subtree(root);
        let within =
            |number: Option<usize>, own: &Range<usize>| number.is_some_and(|n| own.contains(&n));
        let uses = |node: &Node| {
            within(node.mesh, &part.meshes)
                || within(node.light, &part.lights)
                || within(node.camera, &part.cameras)
                || within(node.skin, &part.skins)
        };
        for (index, node) in self.nodes.iter().enumerate() {
            if !below[index] && uses(node) && self.reaches(index) {
                return Err(EditError::Value {
                    name: node.name.clone(),
                    reason: format!(
                        "shows what belongs to '{}'; delete it first",
                        self.nodes[root].name
                    ),
                });
            }
        }
        let list = match self.nodes[root].parent {
            None => &mut self.roots,
            Some(parent) => &mut self.nodes[parent].children,
        };
        list.retain(|child| *child != root);
        // Nodes that were deleted, or hung below, would otherwise show what takes the numbers next.
        for (index, node) in self.nodes.iter_mut().enumerate() {
            if part.nodes.contains(&index) {
                *node = Node::default();
            } else if below[index] || uses(node) {
                (node.mesh, node.light, node.camera, node.skin) = (None, None, None, None);
                node.parent = node.parent.filter(|parent| !part.nodes.contains(parent));
            }
            if !part.nodes.contains(&index) {
                node.children.retain(|child| !part.nodes.contains(child));
            }
        }
        self.meshes[part.meshes.clone()].fill(Mesh::default());
        self.materials[part.materials.clone()].fill(Material::default());
        self.textures[part.textures.clone()].fill(Texture::default());
        self.images[part.images.clone()].fill(Image::default());
        self.skins[part.skins.clone()].fill(Skin::default());
        for clip in &mut self.animations[part.animations.clone()] {
            clip.nodes.clear();
        }
        self.parts.remove(at);
        let mut vacant = std::mem::take(&mut self.vacant);
        vacant.push(part.clone());
        vacant.sort_by_key(|part| part.nodes.start);
        let mut left = Vec::new();
        while let Some(mut last) = vacant.pop() {
            if !last.trim(self) {
                left.insert(0, last);
            }
        }
        self.vacant = left;
        Ok(())
    }
}
