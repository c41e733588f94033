//! Editing: changes to a scene that can be undone.
//!
//! An [`Edit`] says what changes. [`Edit::apply`] carries it out and returns its inverse, which restores the scene exactly,
//! down to the last bit. [`Document`] keeps a scene with the history of its edits.
//!
//! Nodes keep their numbers. A node that is deleted is only taken off its parent, so that animations, skins and extensions
//! that name nodes by number stay right; new nodes are appended. Meshes, textures, images and skins are never changed,
//! with one exception: [`Edit::OwnMaterial`] gives triangles of a mesh another material.
//!
//! Where an animation drives a node, the clip's pose wins while it plays: an edit then changes what the clip leaves alone
//! (a rotation clip leaves the position), and the pose in which the node stands without a clip.

mod apply;
mod document;
mod presets;

use glam::DAffine3;
use thiserror::Error;

use super::{Material, Node, PunctualLight, Scene, Trs};
use stereolux_base::printable::line;

pub(crate) use apply::checked;
pub use document::{Document, HISTORY_LIMIT, Original};
pub use presets::MaterialPreset;

/// One change of a scene. Numbers of nodes, meshes, materials and lights are indices into the scene's lists.
#[derive(Clone, Debug, PartialEq)]
pub enum Edit {
    /// Places a node in its parent. See [`Edit::place`] for a matrix of which it is not known whether it has shear.
    Transform {
        /// Which node.
        node: usize,
        /// Its new local transform.
        to: Placement,
    },
    /// Shows or hides a node and everything below it.
    Visibility {
        /// Which node.
        node: usize,
        /// Hidden from now on.
        is_hidden: bool,
    },
    /// Gives a node a name.
    Rename {
        /// Which node.
        node: usize,
        /// The name.
        name: String,
    },
    /// Replaces a material, wherever it is used. Its textures must be among those of the scene.
    Material {
        /// Which material.
        material: usize,
        /// The new one, name included.
        to: Box<Material>,
    },
    /// Gives those triangles of a mesh that have a material a copy of it, so that it can be changed for them alone. The copy
    /// is the scene's last material.
    OwnMaterial {
        /// Which mesh, with all of its instances.
        mesh: usize,
        /// Which of its materials.
        material: usize,
    },
    /// Replaces a punctual light, at all nodes that have it.
    Light {
        /// Which light.
        light: usize,
        /// The new one: name, kind with cones, intensity.
        to: PunctualLight,
    },
    /// Adds a node as the last child of a parent. It is the scene's last node.
    Add {
        /// Parent; none for a root.
        parent: Option<usize>,
        /// What it is.
        node: NewNode,
    },
    /// Takes a node with everything below it out of the scene.
    Delete {
        /// Which node.
        node: usize,
    },
    /// Adds a copy of a node with everything below it, beside it. The copies are the scene's last nodes, the copy of the
    /// node itself comes first of them. Lights are copied too, meshes and cameras are shared, and no clip moves a copy.
    Duplicate {
        /// Which node.
        node: usize,
    },
    /// Several, in order, as one step: all or none.
    Several(Vec<Self>),
    /// Only as an inverse: puts the nodes and lights back that `Truncate` removed.
    Append(Box<Tail>),
    /// Only as an inverse: removes the last nodes, which are one subtree, and the last lights.
    Truncate {
        /// How many nodes.
        nodes: usize,
        /// How many lights.
        lights: usize,
    },
    /// Only as an inverse: puts a deleted node back.
    Attach {
        /// Which node.
        node: usize,
        /// Its parent; none for a root.
        parent: Option<usize>,
        /// Its place among the parent's children, or the roots.
        position: usize,
    },
    /// Only as an inverse: undoes the last [`Edit::OwnMaterial`].
    SharedMaterial {
        /// Which mesh.
        mesh: usize,
    },
}

/// A local transform.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Placement {
    /// As position, rotation and scale.
    Parts(Trs),
    /// As a matrix, shear and all.
    Matrix(DAffine3),
}

impl Placement {
    /// The parts, if it is given as such.
    pub(super) fn parts(self) -> Option<Trs> {
        match self {
            Self::Parts(parts) => Some(parts),
            Self::Matrix(_) => None,
        }
    }
}

/// A node that is added.
#[derive(Clone, Debug, PartialEq)]
pub struct NewNode {
    /// Name.
    pub name: String,
    /// Local transform.
    pub to: Placement,
    /// What hangs on it.
    pub content: NewContent,
}

/// What hangs on a node that is added.
#[derive(Clone, Debug, PartialEq)]
pub enum NewContent {
    /// Nothing: it groups others.
    Empty,
    /// A light of its own.
    Light(PunctualLight),
    /// Another instance of a mesh of the scene.
    Mesh(usize),
}

/// The end of a scene's lists: a subtree, root first, and the lights that came with it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Tail {
    /// Parent of the subtree's root; none for a root of the scene.
    pub parent: Option<usize>,
    /// Place of its root among the parent's children, or the scene's roots.
    pub position: usize,
    /// Nodes with the numbers that they have in the scene, `parent` of the first included.
    pub nodes: Vec<Node>,
    /// Lights.
    pub lights: Vec<PunctualLight>,
}

/// Why an edit cannot be carried out; the scene is then as it was. One line each.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum EditError {
    /// A number beyond its list.
    #[error("there is no {what} {index}: the scene has {count}")]
    Missing {
        /// `node`, `mesh`, `material`, `light`, `texture`.
        what: &'static str,
        /// What was asked for.
        index: usize,
        /// How many there are.
        count: usize,
    },
    /// A transform or another value that no scene can have.
    #[error("{}", line(&format!("{name}: {reason}")))]
    Value {
        /// What the value is for.
        name: String,
        /// What is wrong with it.
        reason: String,
    },
    /// The node is not in the scene, because it or what it hangs on has been deleted.
    #[error("{}", line(&format!("{name}: is not in the scene")))]
    Gone {
        /// The node's name.
        name: String,
    },
    /// Deleting or duplicating would take a skinned mesh and its joints apart.
    #[error("{}", line(&format!("{name}: {reason}")))]
    Skinned {
        /// The node's name.
        name: String,
        /// What stands in the way, and what to do.
        reason: String,
    },
    /// A mesh has no triangle with the material.
    #[error("{}", line(&format!("mesh '{mesh}' has no triangle of material '{material}'")))]
    NotPainted {
        /// The mesh's name.
        mesh: String,
        /// The material's name.
        material: String,
    },
    /// An inverse that does not belong to the scene as it stands.
    #[error("cannot undo: the scene has changed since that step")]
    Stale,
}

impl Edit {
    /// Places a node by a matrix, in parts where it has no shear.
    #[must_use]
    pub fn place(node: usize, parent_from_node: DAffine3) -> Self {
        Self::Transform {
            node,
            to: Placement::of(parent_from_node),
        }
    }

    /// Whether it has left all as it was: `undo` is what [`Edit::apply`] gave for it. Several are undone in the opposite order.
    #[must_use]
    pub fn left_all(&self, undo: &Self) -> bool {
        match (self, undo) {
            (Self::Several(edits), Self::Several(undo)) => undo.iter().rev().eq(edits),
            _ => self == undo,
        }
    }

    /// What a menu calls the step on `scene`, before it is applied: "Move Lamp".
    #[must_use]
    pub fn label(&self, scene: &Scene) -> String {
        let node = |index: &usize| name_of(scene.nodes.get(*index).map(|node| &node.name));
        let material = |index: &usize| name_of(scene.materials.get(*index).map(|m| &m.name));
        match self {
            Self::Transform { node: index, to } => {
                let from = scene.nodes.get(*index).map(Node::trs).unwrap_or_default();
                format!("{} {}", to.verb(&from), node(index))
            }
            Self::Visibility {
                node: index,
                is_hidden,
            } => {
                let verb = if *is_hidden { "Hide" } else { "Show" };
                format!("{verb} {}", node(index))
            }
            Self::Rename { node: index, .. } => format!("Rename {}", node(index)),
            Self::Material {
                material: index, ..
            } => format!("Change material {}", material(index)),
            Self::OwnMaterial { mesh, .. } => format!(
                "Give {} its own material",
                name_of(scene.meshes.get(*mesh).map(|mesh| &mesh.name))
            ),
            Self::Light { light, .. } => format!(
                "Change light {}",
                name_of(scene.lights.get(*light).map(|light| &light.name))
            ),
            Self::Add { node, .. } => format!("Add {}", node.name),
            Self::Delete { node: index } => format!("Delete {}", node(index)),
            Self::Duplicate { node: index } => format!("Duplicate {}", node(index)),
            Self::Several(edits) => match edits.as_slice() {
                [] => "Nothing".to_owned(),
                [first, more @ ..] => {
                    let kind = std::mem::discriminant(first);
                    let alike = more
                        .iter()
                        .filter(|edit| std::mem::discriminant(*edit) == kind);
                    match alike.count() {
                        0 => first.label(scene),
                        more => format!("{} and {more} more", first.label(scene)),
                    }
                }
            },
            Self::Append(tail) => format!("Add {}", name_of(tail.nodes.first().map(|n| &n.name))),
            Self::Truncate { .. } => "Remove".to_owned(),
            Self::Attach { node: index, .. } => format!("Restore {}", node(index)),
            Self::SharedMaterial { .. } => "Share material".to_owned(),
        }
    }

    /// Whether a later edit of a drag takes this one's place: same kind, same target, and a value that replaces.
    #[must_use]
    pub fn is_replaced_by(&self, later: &Self) -> bool {
        match (self, later) {
            (Self::Transform { node: a, .. }, Self::Transform { node: b, .. })
            | (Self::Visibility { node: a, .. }, Self::Visibility { node: b, .. })
            | (Self::Rename { node: a, .. }, Self::Rename { node: b, .. })
            | (Self::Material { material: a, .. }, Self::Material { material: b, .. })
            | (Self::Light { light: a, .. }, Self::Light { light: b, .. }) => a == b,
            (Self::Several(a), Self::Several(b)) => {
                a.len() == b.len() && a.iter().zip(b).all(|(a, b)| a.is_replaced_by(b))
            }
            _ => false,
        }
    }
}

fn name_of(name: Option<&String>) -> &str {
    name.map_or("?", String::as_str)
}

impl Placement {
    /// A matrix in parts, if it has no shear: put together again they differ from it by rounding alone.
    #[must_use]
    pub fn of(parent_from_node: DAffine3) -> Self {
        /// Rounding of a product of three matrices, with room: shear worth the name is far above.
        const SAME: f64 = 1e-12;
        let parts = Trs::of(&parent_from_node);
        let again = parts.parent_from_node().matrix3;
        let columns = parent_from_node.matrix3.to_cols_array();
        let largest = columns.iter().fold(0.0, |most: f64, x| most.max(x.abs()));
        let off = (again - parent_from_node.matrix3).to_cols_array();
        if off.iter().all(|off| off.abs() <= SAME * largest) {
            Self::Parts(parts)
        } else {
            Self::Matrix(parent_from_node)
        }
    }

    /// As a matrix.
    #[must_use]
    pub fn parent_from_node(&self) -> DAffine3 {
        match self {
            Self::Parts(parts) => parts.parent_from_node(),
            Self::Matrix(matrix) => *matrix,
        }
    }

    fn verb(&self, from: &Trs) -> &'static str {
        let to = match self {
            Self::Parts(parts) => *parts,
            Self::Matrix(matrix) => Trs::of(matrix),
        };
        // What a gizmo leaves alone may still change by rounding.
        let turns = 1.0 - to.rotation.dot(from.rotation).abs() > 1e-9;
        let scales = (to.scale - from.scale).abs().max_element() > 1e-9;
        match (turns, scales) {
            (false, false) => "Move",
            (true, false) => "Turn",
            (false, true) => "Scale",
            (true, true) => "Transform",
        }
    }
}
