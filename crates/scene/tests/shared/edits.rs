//! What tests of edits share.

use stereolux_scene::{LightKind, PunctualLight, Scene};

pub fn node(scene: &Scene, name: &str) -> usize {
    let found = scene.nodes.iter().position(|node| node.name == name);
    found.unwrap_or_else(|| panic!("no node {name}"))
}

pub fn lamp(kind: LightKind) -> PunctualLight {
    PunctualLight {
        name: "new lamp".to_owned(),
        kind,
        intensity: [3.0, 2.0, 0.3],
    }
}
