//! Scenes made in code: what does not hold together is said, with its list and number.

use stereolux_scene::{
    Environment, Image, LightKind, Material, PunctualLight, Scene, Texture, TextureRef,
};

#[test]
fn scenes_of_all_kinds_hold_together() {
    for name in ["cornell", "caustic", "gallery", "parade", "bottle"] {
        Scene::builtin(name).unwrap().check().unwrap();
    }
    let mut scene = Scene::builtin("cornell").unwrap();
    let sphere = Scene::builtin("sphere").unwrap();
    let at = stereolux_scene::edit::Placement::of(glam::DAffine3::IDENTITY);
    let parts = [(); 2].map(|()| scene.add_part(sphere.clone(), "sphere", None, at).unwrap());
    scene.check().unwrap();
    // Its entries stay, empty.
    scene.remove_part(&parts[0]).unwrap();
    scene.check().unwrap();
}

#[test]
fn every_fault_names_its_list_and_number() {
    type Fault = fn(&mut Scene);
    let faults: [(&str, Fault); 16] = [
        ("roots name node 99", |s| s.roots.push(99)),
        ("roots name node 1, which has a parent", |s| {
            s.nodes[1].parent = Some(0)
        }),
        ("nodes[2] names mesh 99", |s| s.nodes[2].mesh = Some(99)),
        ("nodes[2] names light 99", |s| s.nodes[2].light = Some(99)),
        ("nodes[2] names node 99", |s| s.nodes[2].children.push(99)),
        ("nodes[2] names child 2, whose parent it is not", |s| {
            s.nodes[2].children.push(2)
        }),
        ("meshes[1] names vertex 9999 in triangle 0", |s| {
            s.meshes[1].triangles[0].vertices[2] = 9999
        }),
        ("meshes[1] names material 99 in triangle 1", |s| {
            s.meshes[1].triangles[1].material = 99
        }),
        ("meshes[0] has vertex 2 at [", |s| {
            s.meshes[0].positions[2][1] = f32::NAN
        }),
        ("meshes[0] has 4 positions and 3 normals", |s| {
            s.meshes[0].positions.truncate(4);
            s.meshes[0].tangents.clear();
            s.meshes[0].uv0.clear();
            s.meshes[0].uv1.clear();
            s.meshes[0].colors.clear();
            s.meshes[0].normals.truncate(3);
        }),
        ("materials[1] names texture 7", |s| {
            s.materials[1].base_color_texture = Some(TextureRef::plain(7));
        }),
        ("materials[0] emits [-1.0", |s| {
            s.materials[0] = Material {
                emission: [-1.0, 0.0, 0.0],
                ..Material::default()
            };
        }),
        ("textures[0] names image 5", |s| {
            s.textures.push(Texture {
                image: 5,
                ..Texture::default()
            });
        }),
        ("images[0] is 2x2 and has 3 bytes", |s| {
            s.images.push(Image {
                name: "cut".to_owned(),
                width: 2,
                height: 2,
                rgba8: vec![0; 3],
            });
        }),
        ("lights[0] has an intensity of [NaN", |s| {
            s.lights.push(PunctualLight {
                name: "odd".to_owned(),
                kind: LightKind::Point,
                intensity: [f32::NAN, 0.0, 0.0],
            });
        }),
        ("cut sky: 3 texels are not 2 x 2", |s| {
            s.environment = Some(Environment {
                name: "cut sky".to_owned(),
                width: 2,
                height: 2,
                radiance: vec![[1.0; 3]; 3],
            });
        }),
    ];
    for (fault, break_it) in faults {
        let mut scene = Scene::builtin("cornell").unwrap();
        break_it(&mut scene);
        let message = scene.check().unwrap_err().to_string();
        let expected = format!("scene 'builtin:cornell': {fault}");
        assert!(message.starts_with(&expected), "{message}\n{expected}");
    }
}
