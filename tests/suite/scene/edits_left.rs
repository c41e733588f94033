//! What an edit leaves, and what one that cannot be shown in place does not touch.

use glam::{DAffine3, DQuat, DVec3};
use stereolux::gpu::ShaderLibrary;
use stereolux::renderer::{Applied, Eye, InstanceId, Renderer};
use stereolux::scene::{Material, Scene};
use stereolux::settings::Eyes;

use super::hard_support::{
    add, add_sun, constant_environment, direct_from_map, looking_ahead, quad,
};
use super::support::{radiance, renderer_by};

const SIZE: u32 = 24;

/// A floor and a tile on it.
fn scene() -> Scene {
    let mut scene = Scene::default();
    for (name, grey, half_m, y) in [("floor", 0.5, 3.0, 0.0), ("tile", 0.8, 0.5, 0.1)] {
        let corner = DVec3::new(-half_m, y, half_m);
        let square = quad(corner, 2.0 * half_m * DVec3::X, -2.0 * half_m * DVec3::Z);
        add(&mut scene, &square, Material::lambert(name, [grey; 3]));
    }
    scene
}

fn renderer(scene: &Scene) -> Renderer {
    let (library, settings) = (ShaderLibrary::embedded(), direct_from_map(1 << 12));
    renderer_by(&library, scene, &settings, Eyes::Left, [SIZE; 2]).unwrap()
}

fn picture(renderer: &mut Renderer, frame: u32) -> Vec<[f32; 3]> {
    let views = looking_ahead(DVec3::new(0.0, 1.0, 2.5), 40.0);
    renderer.render_frame(&views, frame, |_| {}).unwrap();
    radiance(renderer, Eye::Left)
}

#[test]
fn surroundings_stay_where_others_cannot_be_shown() {
    let mut scene = scene();
    scene.environment = Some(constant_environment([1.0; 3]));
    let [mut edited, mut left_alone] = [(); 2].map(|()| {
        let mut renderer = renderer(&scene);
        let place = DAffine3::from_translation(DVec3::new(1.0, 0.2, -1.0));
        renderer.add_instance(1, place).unwrap();
        picture(&mut renderer, 0);
        renderer
    });
    scene.environment = Some(constant_environment([7.0; 3]));
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
    add_sun(&mut scene, DQuat::from_rotation_x(-1.2) * DVec3::Z, 1.0);
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
