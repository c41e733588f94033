//! What the renderer's own tests share: meshes, views, settings, shaders that are wrong on purpose.

use glam::{DAffine3, DQuat, DVec3};

use crate::gpu::{GpuContext, ShaderLibrary};
use crate::scene::{LightKind, Material, Mesh, Node, PunctualLight, Scene};
use crate::settings::{DirectLight, RenderSettings, Reuse, Settings};
use crate::xr::{Fov, View};

/// A mesh of points and their normals, without textures.
pub(super) fn mesh(points: &[(DVec3, DVec3)], triangles: Vec<[u32; 3]>, material: u32) -> Mesh {
    let arrays = |point: &(DVec3, DVec3)| [point.0, point.1].map(|v| v.as_vec3().to_array());
    let (positions, normals) = points.iter().map(arrays).map(<(_, _)>::from).unzip();
    Mesh::plain(positions, normals, triangles, material)
}

/// Rectangles, each from a corner along two sides whose product is the normal.
pub(super) fn walls(rectangles: &[[DVec3; 3]], material: u32) -> Mesh {
    let corners = |&[corner, across, up]: &[DVec3; 3]| {
        let normal = across.cross(up).normalize();
        [DVec3::ZERO, across, across + up, up].map(|side| (corner + side, normal))
    };
    let points: Vec<_> = rectangles.iter().flat_map(corners).collect();
    let firsts = (0..points.len() as u32).step_by(4);
    let triangles = firsts.flat_map(|a| [[a, a + 1, a + 2], [a, a + 2, a + 3]]);
    mesh(&points, triangles.collect(), material)
}

/// A scene of a node for each mesh, all of them roots.
pub(super) fn scene_of(materials: Vec<Material>, meshes: Vec<Mesh>) -> Scene {
    let node = |mesh| Node {
        mesh: Some(mesh),
        ..Node::default()
    };
    Scene {
        materials,
        nodes: (0..meshes.len()).map(node).collect(),
        roots: (0..meshes.len()).collect(),
        meshes,
        ..Scene::default()
    }
}

/// A white light of its own node, `place` in the world.
pub(super) fn add_light(scene: &mut Scene, kind: LightKind, intensity: f32, place: DAffine3) {
    scene.roots.push(scene.nodes.len());
    scene.nodes.push(Node {
        light: Some(scene.lights.len()),
        parent_from_node: place,
        ..Node::default()
    });
    scene.lights.push(PunctualLight {
        name: String::new(),
        kind,
        intensity: [intensity; 3],
    });
}

/// A square view along -Z.
pub(super) fn looking_ahead(position_in_world: DVec3, half_degrees: f64) -> View {
    let half = half_degrees;
    View {
        position_in_world,
        orientation: DQuat::IDENTITY,
        fov: Fov::from_degrees(-half, half, half, -half),
    }
}

/// Photons that come from the lights on their own, gathered as direct light.
pub(super) fn direct_from_map(paths: u32) -> RenderSettings {
    let mut settings = RenderSettings {
        reuse: Reuse::Off,
        ..RenderSettings::default()
    };
    settings.photon.count = paths;
    settings.photon.direct = DirectLight::Map;
    settings.photon.max_depth = 2;
    settings
}

/// The adapter that tests run on.
pub(super) fn context() -> GpuContext {
    GpuContext::open(Some(&Settings::default().adapter)).unwrap()
}

/// The library with `text` in a module replaced, once.
pub(super) fn replaced(
    library: &ShaderLibrary,
    module: &str,
    text: &str,
    by: &str,
) -> ShaderLibrary {
    let (_, source) = library.sources().find(|(name, _)| *name == module).unwrap();
    assert_eq!(source.matches(text).count(), 1, "{module}");
    let mut replaced = library.clone();
    replaced.insert(module, source.replace(text, by));
    replaced
}
