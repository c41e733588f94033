//! What placing a scene's meshes takes: products of lists, which a short file can make as large as it likes.

use super::{Mesh, Scene};
use stereolux_base::limits::{LoadBudget, OverBudget, product};

/// A placed mesh, bytes: its record here and on the device, and its part of the hierarchy.
const INSTANCE_BYTES: u64 = 1024;
/// A triangle of a placed mesh. It takes no memory of its own, but bounds, areas and powers look at each: this keeps their
/// number, and so the time, in proportion.
const PLACED_TRIANGLE_BYTES: u64 = 8;
/// An emissive triangle of a placed mesh, bytes: its light, power, weight and pick, here and on the device.
const LIGHT_BYTES: u64 = 256;
/// A vertex and a triangle of a mesh that changes its shape: every instance has a copy of its own, bytes.
const SHAPE_BYTES: u64 = 512;
/// One morph target of one vertex, bytes, in the copies that a deforming instance has.
const DELTA_BYTES: u64 = 64;
/// A joint of a skinned instance, bytes: matrices here and on the device.
const JOINT_BYTES: u64 = 256;

/// Asks for what the scene's instances, lights and deforming meshes take once they are rendered.
///
/// # Errors
/// [`OverBudget`]: it is more than there is.
pub(super) fn take(scene: &Scene, budget: &LoadBudget) -> Result<(), OverBudget> {
    let emitters: Vec<u64> = scene
        .meshes
        .iter()
        .map(|mesh| emitter_count(scene, mesh))
        .collect();
    let (mut triangles, mut lights, mut shapes) = (0_u64, 0_u64, 0_u64);
    let instances = scene.instances();
    for placed in &instances {
        let mesh = &scene.meshes[placed.mesh];
        triangles = triangles.saturating_add(mesh.triangles.len() as u64);
        lights = lights.saturating_add(emitters[placed.mesh]);
        if scene.deforms(placed.node) {
            let skin = scene.nodes[placed.node]
                .skin
                .and_then(|skin| scene.skins.get(skin));
            shapes = shapes.saturating_add(shape_bytes(mesh, skin.map_or(0, |s| s.joints.len())));
        }
    }
    let count = instances.len() as u64;
    let placed = product(&[count, INSTANCE_BYTES])
        .saturating_add(product(&[triangles, PLACED_TRIANGLE_BYTES]));
    budget.take(
        placed,
        format_args!("{count} placed meshes with {triangles} triangles"),
    )?;
    budget.take(
        product(&[lights, LIGHT_BYTES]),
        format_args!("{lights} emissive triangles of placed meshes"),
    )?;
    budget.take(shapes, "placed meshes that change their shape")
}

fn emitter_count(scene: &Scene, mesh: &Mesh) -> u64 {
    let emits = |material: u32| {
        let material = scene.materials.get(material as usize);
        material.is_some_and(super::Material::is_emissive)
    };
    let triangles = mesh.triangles.iter();
    triangles
        .filter(|triangle| emits(triangle.material))
        .count() as u64
}

fn shape_bytes(mesh: &Mesh, joints: usize) -> u64 {
    let vertices = mesh.positions.len() as u64;
    let parts = vertices.saturating_add(mesh.triangles.len() as u64);
    [
        product(&[parts, SHAPE_BYTES]),
        product(&[vertices, mesh.targets.len() as u64, DELTA_BYTES]),
        product(&[joints as u64, JOINT_BYTES]),
    ]
    .into_iter()
    .fold(0, u64::saturating_add)
}
