//! What tests of edits share.

use glam::{DAffine3, DMat3, DQuat, DVec3};
use stereolux_scene::edit::{Document, Edit, NewContent, NewNode, Placement};
use stereolux_scene::{AlphaMode, LightKind, PunctualLight, Scene, Trs};

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

/// One of every kind of edit, with numbers that no f32 holds.
pub fn edit_everything(document: &mut Document, nodes: [&str; 3]) {
    let [first, second, third] = nodes.map(|name| node(document.scene(), name));
    let parts = Trs {
        translation: DVec3::new(0.1, -1.0 / 3.0, 2e-7),
        rotation: DQuat::from_axis_angle(DVec3::new(1.0, 2.0, 3.0).normalize(), 0.7),
        scale: DVec3::new(1.1, 0.9, 1.0 / 7.0),
    };
    let sheared = DMat3::from_cols(
        DVec3::new(1.0, 0.2, 0.0),
        DVec3::new(0.1, 1.0, 0.3),
        DVec3::new(0.0, 0.0, 0.7),
    );
    let mesh = document.scene().nodes[first].mesh.unwrap();
    let material = document.scene().meshes[mesh].triangles[0].material as usize;
    let own = document.scene().materials.len();
    let mut painted = document.scene().materials[material].clone();
    painted.name = "painted".to_owned();
    painted.base_color = [0.1, 0.2, 0.7, 0.5];
    painted.emission = [17.3, 0.1, 0.0];
    painted.specular_color = [0.3, 1.7, 1.0];
    painted.alpha_mode = AlphaMode::Mask { cutoff: 0.3 };
    painted.double_sided = !painted.double_sided;
    painted.thickness = 0.1;
    painted.attenuation_distance_m = 0.3;
    painted.attenuation_color = [0.9, 0.1, 0.4];
    painted.ior = 1.45;
    let added = document.scene().nodes.len();
    let new = |name: &str, content| NewNode {
        name: name.to_owned(),
        to: Placement::Parts(parts),
        content,
    };
    let spot = lamp(LightKind::Spot {
        inner_cone_rad: 0.1,
        outer_cone_rad: 0.7,
    });
    for edit in [
        Edit::Transform {
            node: first,
            to: Placement::Parts(parts),
        },
        Edit::Transform {
            node: second,
            to: Placement::Matrix(DAffine3::from_mat3_translation(sheared, DVec3::Y * 0.1)),
        },
        Edit::Rename {
            node: second,
            name: "renamed \"ü\"".to_owned(),
        },
        Edit::Visibility {
            node: third,
            is_hidden: true,
        },
        Edit::OwnMaterial { mesh, material },
        Edit::Material {
            material: own,
            to: Box::new(painted),
        },
        Edit::Add {
            parent: None,
            node: new("group", NewContent::Empty),
        },
        Edit::Add {
            parent: Some(added),
            node: new("torch", NewContent::Light(spot)),
        },
        Edit::Add {
            parent: Some(added),
            node: new("again", NewContent::Mesh(mesh)),
        },
        Edit::Duplicate { node: added },
        Edit::Light {
            light: document.scene().lights.len(),
            to: lamp(LightKind::Directional),
        },
        Edit::Delete { node: added + 1 },
    ] {
        document.edit(edit).unwrap();
    }
}
