//! Meshes that change their shape are not shared.

use std::borrow::Cow;

use crate::scene::Scene;

/// `scene` with a mesh of its own for each instance that changes its shape.
pub fn with_own_meshes(scene: &Scene) -> Cow<'_, Scene> {
    let instances = scene.instances();
    let mut taken = vec![false; scene.meshes.len()];
    for placed in &instances {
        taken[placed.mesh] |= !scene.deforms(placed.node);
    }
    let mut own = Cow::Borrowed(scene);
    for placed in &instances {
        if scene.deforms(placed.node) && std::mem::replace(&mut taken[placed.mesh], true) {
            let scene = own.to_mut();
            scene.meshes.push(scene.meshes[placed.mesh].clone());
            scene.nodes[placed.node].mesh = Some(scene.meshes.len() - 1);
        }
    }
    own
}
