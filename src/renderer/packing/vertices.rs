//! Vertex attributes that shading reads.

use crate::renderer::records::material::Vertex;
use crate::scene::Scene;

/// Two channels of 0 to 1 as WGSL's `unpack2x16unorm` reads them; what lies outside is clamped, as glTF has it.
fn unorm16x2(low: f32, high: f32) -> u32 {
    // `as` saturates and takes NaN to 0.
    let channel = |value: f32| (value.clamp(0.0, 1.0) * 65535.0).round() as u32 & 0xffff;
    channel(low) | (channel(high) << 16)
}

/// The attributes of all meshes' vertices, one mesh after the other.
pub fn pack_vertices(scene: &Scene) -> Vec<Vertex> {
    let count = scene.meshes.iter().map(|mesh| mesh.positions.len()).sum();
    let mut packed = Vec::with_capacity(count);
    for mesh in &scene.meshes {
        for index in 0..mesh.positions.len() {
            let [red, green, blue, alpha] = mesh.colors.get(index).copied().unwrap_or([1.0; 4]);
            packed.push(Vertex {
                normal: mesh.normals.get(index).copied().unwrap_or_default(),
                color_rg: unorm16x2(red, green),
                tangent: mesh
                    .tangents
                    .get(index)
                    .copied()
                    .unwrap_or([0.0, 0.0, 0.0, 1.0]),
                uv0: mesh.uv0.get(index).copied().unwrap_or_default(),
                uv1: mesh.uv1.get(index).copied().unwrap_or_default(),
                color_ba: unorm16x2(blue, alpha),
                ..Vertex::default()
            });
        }
    }
    packed
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Mesh;

    #[test]
    fn colours_are_unorm16_low_half_first() {
        assert_eq!(unorm16x2(1.0, 0.0), 0x0000_ffff);
        assert_eq!(unorm16x2(0.0, 1.0), 0xffff_0000);
        assert_eq!(unorm16x2(2.0, -1.0), 0x0000_ffff);
        assert_eq!(unorm16x2(f32::NAN, 0.5), 0x8000_0000);
    }

    #[test]
    fn meshes_follow_each_other() {
        let mesh = |count: usize| Mesh {
            positions: vec![[0.0; 3]; count],
            normals: vec![[0.0, 1.0, 0.0]; count],
            uv0: vec![[0.25, 0.75]; count],
            ..Mesh::default()
        };
        let scene = Scene {
            meshes: vec![mesh(3), mesh(0), mesh(2)],
            ..Scene::default()
        };
        let packed = pack_vertices(&scene);
        assert_eq!(packed.len(), 5);
        assert_eq!(packed[4].uv0, [0.25, 0.75]);
        assert_eq!(packed[4].color_rg, u32::MAX);
    }
}
