//! What an edit leaves, and what one that cannot be shown in place does not touch.

use glam::{DAffine3, DVec3};

use crate::gpu::ShaderLibrary;
use crate::renderer::instance_table::InstanceId;
use crate::renderer::test_support::{
    add_light, context, direct_from_map, looking_ahead, scene_of, walls,
};
use crate::renderer::{Applied, Eye, Renderer};
use crate::scene::{Environment, LightKind, Material, Scene};
use crate::settings::Eyes;

const SIZE: u32 = 24;

/// A floor and a tile on it.
fn scene() -> Scene {
    let square = |half_m: f64, y: f64, material| {
        let corner = DVec3::new(-half_m, y, half_m);
        let sides = [2.0 * half_m * DVec3::X, -2.0 * half_m * DVec3::Z];
        walls(&[[corner, sides[0], sides[1]]], material)
    };
    let meshes = vec![square(3.0, 0.0, 0), square(0.5, 0.1, 1)];
    let materials = [("floor", 0.5), ("tile", 0.8)];
    let materials = materials.map(|(name, grey)| Material::lambert(name, [grey; 3]));
    scene_of(materials.into(), meshes)
}

fn surroundings(radiance: f32) -> Option<Environment> {
    Some(Environment {
        width: 4,
        height: 2,
        radiance: vec![[radiance; 3]; 8],
        name: "even".to_owned(),
    })
}

fn renderer(scene: &Scene) -> Renderer {
    let (library, settings) = (ShaderLibrary::embedded(), direct_from_map(1 << 12));
    Renderer::new(context(), &library, scene, &settings, Eyes::Left, [SIZE; 2]).unwrap()
}

fn picture(renderer: &mut Renderer, frame: u32) -> Vec<[f32; 3]> {
    let view = looking_ahead(DVec3::new(0.0, 1.0, 2.5), 40.0);
    renderer.render_frame(&[view; 2], frame, |_| {}).unwrap();
    renderer.read_radiance(Eye::Left).unwrap().unwrap()
}

#[test]
fn surroundings_stay_where_others_cannot_be_shown() {
    let mut scene = scene();
    scene.environment = surroundings(1.0);
    let [mut edited, mut left_alone] = [(); 2].map(|()| {
        let mut renderer = renderer(&scene);
        let place = DAffine3::from_translation(DVec3::new(1.0, 0.2, -1.0));
        renderer.add_instance(1, place).unwrap();
        picture(&mut renderer, 0);
        renderer
    });
    scene.environment = surroundings(7.0);
    let applied = edited.replace_surroundings(&scene).unwrap();
    assert!(
        matches!(applied, Applied::NeedsRebuild { .. }),
        "{applied:?}"
    );
    assert_eq!(picture(&mut edited, 1), picture(&mut left_alone, 1));
}

#[test]
fn after_an_edit_the_sun_shines_by_the_scenes_box_again() {
    let mut scene = scene();
    let turned = DAffine3::from_rotation_x(-1.2);
    add_light(&mut scene, LightKind::Directional, 1.0, turned);
    let mut edited = renderer(&scene);
    // Photons come in over a square kilometre as long as the tile is so far away.
    let far = DAffine3::from_translation(DVec3::new(1e3, 0.0, 0.0));
    assert!(edited.set_instance_transform(InstanceId(1), far));
    let sparse = picture(&mut edited, 0);
    scene.materials[0].base_color[0] = 0.4;
    let applied = edited.apply_scene(&scene).unwrap();
    assert!(matches!(applied, Applied::InPlace(_)), "{applied:?}");
    let after = picture(&mut edited, 1);
    assert_ne!(after, sparse);
    assert_eq!(after, picture(&mut renderer(&scene), 1));
}
