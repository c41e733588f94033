//! Carrying edits out, and their inverses.

use std::collections::{HashMap, HashSet};

use glam::DAffine3;

use super::super::import::{NOT_FINITE, fits_f32, transform_fault};
use super::super::panes;
use super::super::{LightKind, Material, Node, PunctualLight, Scene, Trs};
use super::{Edit, EditError, NewContent, NewNode, Placement, Tail};

impl Edit {
    /// Carries the edit out and returns its inverse: applied in turn it makes the scene equal to what it was.
    ///
    /// # Errors
    /// [`EditError`]; the scene is then unchanged.
    pub fn apply(self, scene: &mut Scene) -> Result<Self, EditError> {
        match self {
            Self::Transform { node, to } => transform(scene, node, to),
            Self::Visibility { node, is_hidden } => {
                let node_data = node_mut(scene, node)?;
                let before = std::mem::replace(&mut node_data.is_hidden, is_hidden);
                Ok(Self::Visibility {
                    node,
                    is_hidden: before,
                })
            }
            Self::Rename { node, name } => {
                let before = std::mem::replace(&mut node_mut(scene, node)?.name, name);
                Ok(Self::Rename { node, name: before })
            }
            Self::Material { material, to } => {
                check_material(scene, &to)?;
                let slot = entry(&mut scene.materials, "material", material)?;
                let before = std::mem::replace(slot, *to);
                // The shapes say it, not who edits. Most edits change a number of what is glass anyway.
                slot.is_open = slot.may_be_thin() && before.is_open;
                if slot.may_be_thin() != before.may_be_thin() {
                    panes::find_open(&mut scene.materials, &scene.meshes);
                }
                Ok(Self::Material {
                    material,
                    to: Box::new(before),
                })
            }
            Self::OwnMaterial { mesh, material } => own_material(scene, mesh, material),
            Self::SharedMaterial { mesh } => shared_material(scene, mesh),
            Self::Light { light, to } => {
                check_light(&to)?;
                let slot = entry(&mut scene.lights, "light", light)?;
                let before = std::mem::replace(slot, to);
                Ok(Self::Light { light, to: before })
            }
            Self::Add { parent, node } => {
                let tail = new_tail(scene, parent, node)?;
                append(scene, tail)
            }
            Self::Duplicate { node } => {
                let tail = copied_tail(scene, node)?;
                append(scene, tail)
            }
            Self::Delete { node } => delete(scene, node),
            Self::Attach {
                node,
                parent,
                position,
            } => attach(scene, node, parent, position),
            Self::Append(tail) => append(scene, *tail),
            Self::Truncate { nodes, lights } => truncate(scene, nodes, lights),
            Self::Several(edits) => several(scene, edits),
        }
    }
}

fn missing(what: &'static str, index: usize, count: usize) -> EditError {
    EditError::Missing { what, index, count }
}

fn value(name: &str, reason: impl Into<String>) -> EditError {
    EditError::Value {
        name: name.to_owned(),
        reason: reason.into(),
    }
}

fn node_mut(scene: &mut Scene, node: usize) -> Result<&mut Node, EditError> {
    entry(&mut scene.nodes, "node", node)
}

fn entry<'a, T>(
    list: &'a mut [T],
    what: &'static str,
    index: usize,
) -> Result<&'a mut T, EditError> {
    let count = list.len();
    list.get_mut(index).ok_or(missing(what, index, count))
}

fn several(scene: &mut Scene, edits: Vec<Edit>) -> Result<Edit, EditError> {
    let mut inverses = Vec::with_capacity(edits.len());
    for edit in edits {
        match edit.apply(scene) {
            Ok(inverse) => inverses.push(inverse),
            Err(error) => {
                for inverse in inverses.into_iter().rev() {
                    inverse.apply(scene)?;
                }
                return Err(error);
            }
        }
    }
    inverses.reverse();
    Ok(Edit::Several(inverses))
}

/// The placement with its rotation brought to unit length, if it can be used.
pub fn checked(name: &str, to: Placement) -> Result<Placement, EditError> {
    let to = finite(name, to)?;
    match transform_fault(&to.parent_from_node()) {
        Some(reason) => Err(value(name, reason)),
        None => Ok(to),
    }
}

/// The same of one that may flatten space, as files have it of what is out of sight.
fn finite(name: &str, to: Placement) -> Result<Placement, EditError> {
    let to = match to {
        Placement::Parts(parts) => Placement::Parts(Trs {
            rotation: Trs::unit(parts.rotation)
                .ok_or_else(|| value(name, "the rotation quaternion has no length"))?,
            ..parts
        }),
        Placement::Matrix(_) => to,
    };
    if to.parent_from_node().is_finite() {
        Ok(to)
    } else {
        Err(value(name, NOT_FINITE))
    }
}

impl Edit {
    /// Refuses transforms that flatten what has not been flat, which hardly anybody means.
    pub(super) fn check_by_hand(&self, scene: &Scene) -> Result<(), EditError> {
        match self {
            Self::Transform { node: index, to } => {
                let Some(node) = scene.nodes.get(*index) else {
                    return Ok(());
                };
                if transform_fault(&node.parent_from_node).is_none() {
                    checked(&node.name, *to)?;
                }
                check_reach(scene, *index, *to)
            }
            Self::Several(edits) => edits.iter().try_for_each(|edit| edit.check_by_hand(scene)),
            _ => Ok(()),
        }
    }
}

/// Refuses what no file can hold: places beyond 32-bit floats, of a node or of what hangs on it.
fn check_reach(scene: &Scene, index: usize, to: Placement) -> Result<(), EditError> {
    let node = &scene.nodes[index];
    let above = node.parent.map(|parent| scene.world_from_node(parent));
    let placed = above.unwrap_or_default() * to.parent_from_node();
    let below = scene.below(&node.children, placed, |_| true);
    if !fits_f32(&placed) || below.iter().any(|(_, placed)| !fits_f32(placed)) {
        return Err(value(&node.name, "its place would be beyond 32-bit floats"));
    }
    Ok(())
}

fn transform(scene: &mut Scene, node: usize, to: Placement) -> Result<Edit, EditError> {
    let data = node_mut(scene, node)?;
    let mut to = finite(&data.name, to)?;
    let before = data
        .exact_parts()
        .map_or(Placement::Matrix(data.parent_from_node), Placement::Parts);
    // A clip sets parts, so its node has no matrix (glTF 2.0, section 3.11): shear is dropped.
    if let (Placement::Parts(_), Placement::Matrix(matrix)) = (before, to)
        && is_animated(scene, node)
    {
        to = finite("", Placement::Parts(Trs::of(&matrix)))?;
    }
    let data = node_mut(scene, node)?;
    data.parent_from_node = to.parent_from_node();
    data.parts = to.parts();
    Ok(Edit::Transform { node, to: before })
}

fn is_animated(scene: &Scene, node: usize) -> bool {
    let mut tracks = scene.animations.iter().flat_map(|clip| &clip.nodes);
    tracks.any(|tracks| tracks.node == node)
}

/// Of numbers without a bound of their own: files hold colours as one of up to 1 and a power of two.
const GREATEST: f32 = 1e38;

fn check_material(scene: &Scene, material: &Material) -> Result<(), EditError> {
    let name = &material.name;
    let unit = [
        ("base colour", &material.base_color[..]),
        ("metallic", &[material.metallic]),
        ("roughness", &[material.roughness]),
        ("specular", &[material.specular]),
        ("transmission", &[material.transmission]),
        ("attenuation colour", &material.attenuation_color),
    ];
    for (what, values) in unit {
        if !values.iter().all(|value| (0.0..=1.0).contains(value)) {
            return Err(value(name, format!("{what} must be 0 to 1")));
        }
    }
    let positive = [
        ("emission", &material.emission[..]),
        ("specular colour", &material.specular_color),
        ("thickness", &[material.thickness]),
    ];
    for (what, values) in positive {
        if !values.iter().all(|value| (0.0..=GREATEST).contains(value)) {
            return Err(value(name, format!("{what} must be 0 to {GREATEST:e}")));
        }
    }
    if !(material.ior == 0.0 || (material.ior >= 1.0 && material.ior.is_finite())) {
        return Err(value(
            name,
            "the index of refraction must be 1 or more, or 0",
        ));
    }
    if material.attenuation_distance_m.is_nan() || material.attenuation_distance_m <= 0.0 {
        return Err(value(name, "the attenuation distance must be above 0"));
    }
    if !material.normal_scale.is_finite() {
        return Err(value(
            name,
            "the scale of the normal texture must be finite",
        ));
    }
    if let super::super::AlphaMode::Mask { cutoff } = material.alpha_mode
        && !(cutoff >= 0.0 && cutoff.is_finite())
    {
        return Err(value(name, "the alpha cutoff must be 0 or more"));
    }
    let count = scene.textures.len();
    for (_, slot) in material.texture_slots() {
        let Some(slot) = slot else { continue };
        if slot.texture as usize >= count {
            return Err(missing("texture", slot.texture as usize, count));
        }
    }
    Ok(())
}

fn check_light(light: &PunctualLight) -> Result<(), EditError> {
    let is_usable = |value: &f32| (0.0..=GREATEST).contains(value);
    if !light.intensity.iter().all(is_usable) {
        return Err(value(
            &light.name,
            format!("the intensity must be 0 to {GREATEST:e}"),
        ));
    }
    if let LightKind::Spot {
        inner_cone_rad,
        outer_cone_rad,
    } = light.kind
    {
        let in_order = 0.0 <= inner_cone_rad
            && inner_cone_rad <= outer_cone_rad
            && 0.0 < outer_cone_rad
            && outer_cone_rad <= std::f32::consts::FRAC_PI_2;
        if !in_order {
            return Err(value(
                &light.name,
                "cone angles must be 0 <= inner <= outer <= pi/2, and outer above 0",
            ));
        }
    }
    Ok(())
}

fn own_material(scene: &mut Scene, mesh: usize, material: usize) -> Result<Edit, EditError> {
    let copy = entry(&mut scene.materials, "material", material)?.clone();
    let data = entry(&mut scene.meshes, "mesh", mesh)?;
    let (from, to) = (material as u32, scene.materials.len() as u32);
    let mut painted = 0;
    for triangle in &mut data.triangles {
        if triangle.material == from {
            triangle.material = to;
            painted += 1;
        }
    }
    if painted == 0 {
        return Err(EditError::NotPainted {
            mesh: data.name.clone(),
            material: copy.name,
        });
    }
    data.repainted.push([from, to]);
    scene.materials.push(copy);
    panes::find_open(&mut scene.materials, &scene.meshes);
    Ok(Edit::SharedMaterial { mesh })
}

fn shared_material(scene: &mut Scene, mesh: usize) -> Result<Edit, EditError> {
    let materials = scene.materials.len();
    let data = entry(&mut scene.meshes, "mesh", mesh)?;
    let Some(&[from, to]) = data.repainted.last() else {
        return Err(EditError::Stale);
    };
    // The copy must still be one, or the inverse would not bring it back.
    let [original, copy] = [from, to].map(|index| scene.materials.get(index as usize));
    let is_copy = to as usize + 1 == materials
        && original.zip(copy).is_some_and(|(original, copy)| {
            let is_open = copy.is_open;
            *copy
                == Material {
                    is_open,
                    ..original.clone()
                }
        });
    if !is_copy {
        return Err(EditError::Stale);
    }
    data.repainted.pop();
    for triangle in &mut data.triangles {
        if triangle.material == to {
            triangle.material = from;
        }
    }
    scene.materials.pop();
    panes::find_open(&mut scene.materials, &scene.meshes);
    Ok(Edit::OwnMaterial {
        mesh,
        material: from as usize,
    })
}

/// The list in which a parent's children stand, or the roots.
fn siblings(scene: &mut Scene, parent: Option<usize>) -> Result<&mut Vec<usize>, EditError> {
    match parent {
        None => Ok(&mut scene.roots),
        Some(parent) => Ok(&mut node_mut(scene, parent)?.children),
    }
}

/// Takes a node out of the list in which it stands, and says where it stood.
fn unlink(scene: &mut Scene, parent: Option<usize>, node: usize) -> Result<usize, EditError> {
    let siblings = siblings(scene, parent)?;
    let position = siblings.iter().position(|sibling| *sibling == node);
    let position = position.ok_or(EditError::Stale)?;
    siblings.remove(position);
    Ok(position)
}

fn new_tail(scene: &Scene, parent: Option<usize>, node: NewNode) -> Result<Tail, EditError> {
    if let Some(parent) = parent {
        check_placed(scene, parent)?;
    }
    let to = checked(&node.name, node.to)?;
    let mut lights = Vec::new();
    let mut added = Node {
        name: node.name,
        parent,
        parent_from_node: to.parent_from_node(),
        parts: to.parts(),
        ..Node::default()
    };
    match node.content {
        NewContent::Empty => {}
        NewContent::Light(light) => {
            check_light(&light)?;
            added.light = Some(scene.lights.len());
            lights.push(light);
        }
        NewContent::Mesh(mesh) => {
            let count = scene.meshes.len();
            let data = scene.meshes.get(mesh).ok_or(missing("mesh", mesh, count))?;
            added.mesh = Some(mesh);
            added.morph_weights = vec![0.0; data.targets.len()];
        }
    }
    Ok(Tail {
        parent,
        position: match parent {
            None => scene.roots.len(),
            Some(parent) => scene.nodes[parent].children.len(),
        },
        nodes: vec![added],
        lights,
    })
}

/// Fails unless the node hangs below a root of the scene.
fn check_placed(scene: &Scene, node: usize) -> Result<(), EditError> {
    let count = scene.nodes.len();
    let named = scene.nodes.get(node).ok_or(missing("node", node, count))?;
    if scene.reaches(node) {
        Ok(())
    } else {
        Err(EditError::Gone {
            name: named.name.clone(),
        })
    }
}

fn copied_tail(scene: &Scene, node: usize) -> Result<Tail, EditError> {
    check_placed(scene, node)?;
    let below = scene.below(&[node], DAffine3::IDENTITY, |_| true);
    let sources: Vec<usize> = below.into_iter().map(|(node, _)| node).collect();
    let copies: HashMap<usize, usize> = sources.iter().copied().zip(scene.nodes.len()..).collect();
    let new_of = |old: usize| copies.get(&old).copied();
    let mut lights = Vec::new();
    let mut nodes = Vec::with_capacity(sources.len());
    for source in &sources {
        let mut copy = scene.nodes[*source].clone();
        if copy.skin.is_some() {
            return Err(EditError::Skinned {
                name: copy.name,
                reason: "a skinned mesh stands where its joints are, so a copy would lie in it; it cannot be duplicated".to_owned(),
            });
        }
        copy.parent = copy.parent.and_then(new_of);
        copy.children = copy
            .children
            .iter()
            .filter_map(|child| new_of(*child))
            .collect();
        if let Some(light) = copy.light.and_then(|light| scene.lights.get(light)) {
            copy.light = Some(scene.lights.len() + lights.len());
            lights.push(light.clone());
        }
        nodes.push(copy);
    }
    let parent = scene.nodes[node].parent;
    nodes[0].parent = parent;
    nodes[0].name = copy_name(scene, &scene.nodes[node].name);
    let among = match parent {
        None => &scene.roots,
        Some(parent) => &scene.nodes[parent].children,
    };
    let position = among
        .iter()
        .position(|sibling| *sibling == node)
        .map_or(among.len(), |at| at + 1);
    Ok(Tail {
        parent,
        position,
        nodes,
        lights,
    })
}

/// "Lamp" becomes "Lamp 2", "Lamp 2" becomes "Lamp 3": the first that is free.
fn copy_name(scene: &Scene, name: &str) -> String {
    let (stem, number) = match name.rsplit_once(' ') {
        Some((stem, number)) => match number.parse::<u32>() {
            Ok(number) => (stem, number),
            Err(_) => (name, 1),
        },
        None => (name, 1),
    };
    let taken: HashSet<&str> = scene.nodes.iter().map(|node| node.name.as_str()).collect();
    let mut next = number;
    loop {
        next = next.saturating_add(1);
        let candidate = format!("{stem} {next}");
        if !taken.contains(candidate.as_str()) || next == u32::MAX {
            return candidate;
        }
    }
}

fn append(scene: &mut Scene, tail: Tail) -> Result<Edit, EditError> {
    let first = scene.nodes.len();
    let inverse = Edit::Truncate {
        nodes: tail.nodes.len(),
        lights: tail.lights.len(),
    };
    let siblings = siblings(scene, tail.parent)?;
    if tail.position > siblings.len() || tail.nodes.is_empty() {
        return Err(EditError::Stale);
    }
    siblings.insert(tail.position, first);
    scene.nodes.extend(tail.nodes);
    scene.lights.extend(tail.lights);
    Ok(inverse)
}

fn truncate(scene: &mut Scene, nodes: usize, lights: usize) -> Result<Edit, EditError> {
    let (Some(first), Some(first_light)) = (
        scene.nodes.len().checked_sub(nodes).filter(|_| nodes > 0),
        scene.lights.len().checked_sub(lights),
    ) else {
        return Err(EditError::Stale);
    };
    if !is_tail(scene, first, first_light) {
        return Err(EditError::Stale);
    }
    let parent = scene.nodes[first].parent;
    let position = unlink(scene, parent, first)?;
    Ok(Edit::Append(Box::new(Tail {
        parent,
        position,
        nodes: scene.nodes.split_off(first),
        lights: scene.lights.split_off(first_light),
    })))
}

/// Whether the nodes from `first` on are one subtree with `first` on top, and nothing else refers to them or to the lights
/// from `first_light` on.
fn is_tail(scene: &Scene, first: usize, first_light: usize) -> bool {
    let (before, tail) = scene.nodes.split_at(first);
    let parent = tail[0].parent;
    // A node is a child once, so that `first` itself hangs where its parent says.
    let is_known = |child: &usize| *child <= first;
    let is_whole = parent.is_none_or(|parent| parent < first)
        && tail[1..]
            .iter()
            .all(|node| node.parent.is_some_and(|parent| parent >= first));
    let is_free = before.iter().all(|node| {
        node.children.iter().all(is_known) && node.light.is_none_or(|light| light < first_light)
    }) && scene.roots.iter().all(is_known);
    let joints = scene.skins.iter().flat_map(|skin| skin.joints.iter());
    let clips = scene.animations.iter().flat_map(|clip| &clip.nodes);
    is_whole
        && is_free
        && joints
            .chain(clips.map(|tracks| &tracks.node))
            .all(|node| *node < first)
}

fn delete(scene: &mut Scene, node: usize) -> Result<Edit, EditError> {
    check_placed(scene, node)?;
    let gone = scene.subtree(node);
    // A skinned mesh whose joints stop following what they hung on would be torn out of shape.
    for (index, user) in scene.nodes.iter().enumerate() {
        let Some(skin) = user.skin.and_then(|skin| scene.skins.get(skin)) else {
            continue;
        };
        if gone[index] || check_placed(scene, index).is_err() {
            continue;
        }
        if skin
            .joints
            .iter()
            .any(|joint| gone.get(*joint) == Some(&true))
        {
            return Err(EditError::Skinned {
                name: scene.nodes[node].name.clone(),
                reason: format!(
                    "holds joints of '{}', which is skinned: delete that first",
                    user.name
                ),
            });
        }
    }
    let parent = scene.nodes[node].parent;
    let position = unlink(scene, parent, node)?;
    scene.nodes[node].parent = None;
    Ok(Edit::Attach {
        node,
        parent,
        position,
    })
}

fn attach(
    scene: &mut Scene,
    node: usize,
    parent: Option<usize>,
    position: usize,
) -> Result<Edit, EditError> {
    let is_loose = node_mut(scene, node)?.parent.is_none() && !scene.roots.contains(&node);
    let below = parent.is_some_and(|parent| scene.subtree(node).get(parent) == Some(&true));
    // On a parent that is not shown it could not be deleted again.
    let is_lost = parent.is_some_and(|parent| check_placed(scene, parent).is_err());
    if !is_loose || below || is_lost {
        return Err(EditError::Stale);
    }
    let siblings = siblings(scene, parent)?;
    if position > siblings.len() {
        return Err(EditError::Stale);
    }
    siblings.insert(position, node);
    scene.nodes[node].parent = parent;
    Ok(Edit::Delete { node })
}
