use super::*;
use crate::scene::{Image, Mesh, MeshTriangle, Node, TextureRef};

fn reference(texture: u32) -> Option<TextureRef> {
    Some(TextureRef::plain(texture))
}

fn image(name: &str, width: u32, height: u32) -> Image {
    Image {
        name: name.to_owned(),
        width,
        height,
        rgba8: (0..width * height * 4).map(|byte| byte as u8).collect(),
    }
}

/// Two textures of one image, a second image that only an unused material reads, and one placed triangle.
fn textured_scene() -> Scene {
    let texture = |image| Texture {
        image,
        wrap_u: Wrap::Clamp,
        wrap_v: Wrap::Mirror,
        filter: Filter::Linear,
    };
    Scene {
        nodes: vec![Node::of_mesh(0)],
        roots: vec![0],
        meshes: vec![Mesh {
            positions: vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]],
            triangles: vec![MeshTriangle {
                vertices: [0, 1, 2],
                material: 1,
            }],
            ..Mesh::default()
        }],
        materials: vec![
            Material {
                base_color_texture: reference(0),
                ..Material::default()
            },
            Material {
                base_color_texture: reference(1),
                normal_texture: reference(2),
                ..Material::default()
            },
        ],
        textures: vec![
            texture(0),
            texture(1),
            Texture {
                filter: Filter::Nearest,
                ..texture(1)
            },
        ],
        images: vec![image("unused", 64, 64), image("used", 3, 2)],
        ..Scene::default()
    }
}

#[test]
fn only_images_in_use_are_packed_and_shared_images_once() {
    let packed = pack_textures(&textured_scene(), 1 << 20, false).unwrap();
    assert_eq!(packed.texels.len(), 6);
    assert_eq!(packed.texels[1], u32::from_le_bytes([4, 5, 6, 7]));
    let known: Vec<_> = packed.info_of_texture.into_iter().collect();
    let plain = Averaging::None;
    assert_eq!(known, [((1, plain), 0), ((2, plain), 1)]);
    assert_eq!(packed.infos[0].offset, packed.infos[1].offset);
    assert_eq!(
        packed.infos[0].flags,
        TEXTURE_WRAP_CLAMP | (TEXTURE_WRAP_MIRROR << 2)
    );
    assert_eq!(
        packed.infos[1].flags,
        packed.infos[0].flags | TEXTURE_NEAREST_BIT
    );
}

#[test]
fn too_large_a_pool_is_an_error_that_names_the_size() {
    let error = pack_textures(&textured_scene(), 23, false).unwrap_err();
    let text = error.to_string();
    assert!(
        text.contains("24 bytes") && text.contains("used, 3x2"),
        "{text}"
    );
    assert!(pack_textures(&textured_scene(), 24, false).is_ok());
}

#[test]
fn wraps_follow_gltf() {
    let row = |wrap| {
        (-4..8)
            .map(|index| wrap_texel(index, 3, wrap))
            .collect::<Vec<_>>()
    };
    assert_eq!(row(Wrap::Repeat), [2, 0, 1, 2, 0, 1, 2, 0, 1, 2, 0, 1]);
    assert_eq!(row(Wrap::Clamp), [0, 0, 0, 0, 0, 1, 2, 2, 2, 2, 2, 2]);
    assert_eq!(row(Wrap::Mirror), [2, 2, 1, 0, 0, 1, 2, 2, 1, 0, 0, 1]);
}

#[test]
fn texel_centres_are_exact_and_between_them_is_linear() {
    let scene = textured_scene();
    let at = |u: f64, v: f64| sample_image(&scene, 1, [u, v], false)[0] * 255.0;
    assert!((at(0.5 / 3.0, 0.25) - 0.0).abs() < 1e-9);
    assert!((at(1.5 / 3.0, 0.25) - 4.0).abs() < 1e-9);
    assert!((at(1.0 / 3.0, 0.25) - 2.0).abs() < 1e-9);
    assert!((at(0.5 / 3.0, 0.5) - 6.0).abs() < 1e-9);
    // Clamped along u: nothing of the right edge leaks in.
    assert!((at(0.0, 0.25) - 0.0).abs() < 1e-9);
}
