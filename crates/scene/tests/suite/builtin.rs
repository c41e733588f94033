//! The embedded scenes: measurements, closed forms, and that the files under assets/ are what the code generates.

use std::collections::BTreeMap;

use glam::DVec3;
use stereolux_base::features::ShaderFeatures;
use stereolux_scene::{LightKind, Mesh, Needs, Scene, builtin};

use crate::embedded_scenes::SCENES;
use crate::embedded_scenes::{cornell, plane, sphere};

#[test]
fn assets_are_what_the_generator_writes() {
    let names = SCENES.map(|(name, _)| name);
    assert_eq!(names, builtin::NAMES[..names.len()]);
    for (name, make) in SCENES {
        let embedded = builtin::glb(name).unwrap();
        assert!(
            *embedded == *make().unwrap(),
            "assets/{name}.glb is not what the generator makes: cargo run -p stereolux-scene --example make_assets writes it again"
        );
        let scene = Scene::builtin(&format!("builtin:{name}")).unwrap();
        assert!(scene.warnings.is_empty(), "{:?}", scene.warnings);
    }
}

#[test]
fn unknown_names_list_the_known_ones() {
    let message = Scene::builtin("builtin:kitchen").unwrap_err().to_string();
    assert_eq!(
        message,
        "no embedded scene is called 'kitchen': the names are cornell, plane, sphere, caustic, gallery, parade, terrain, water, bottle"
    );
}

/// Front normal and centre of every triangle of the mesh with this name, in the world.
fn facets(scene: &Scene, name: &str) -> Vec<(DVec3, DVec3)> {
    let instance = scene
        .instances()
        .into_iter()
        .find(|instance| scene.nodes[instance.node].name == name)
        .unwrap();
    let mesh = &scene.meshes[instance.mesh];
    mesh.triangles
        .iter()
        .map(|triangle| {
            let [a, b, c] = mesh
                .corners(triangle)
                .map(|corner| instance.world_from_object.transform_point3(corner));
            ((b - a).cross(c - a).normalize(), (a + b + c) / 3.0)
        })
        .collect()
}

#[test]
fn cornell_has_the_published_measures() {
    let scene = Scene::builtin("cornell").unwrap();
    assert_eq!(scene.triangle_count(), 32);
    let bounds = scene.bounds_in_world().unwrap();
    // f32 rounding of half a metre: 3e-8.
    assert!(
        (bounds.size() - DVec3::new(0.556, 0.5488, 0.5592)).length() < 1e-6,
        "{bounds:?}"
    );
    let pose = scene.start_pose();
    assert!(
        (pose.position - DVec3::new(-0.278, 0.273, 0.8)).length() < 1e-6,
        "{pose:?}"
    );
    assert_eq!(pose.orientation, glam::DQuat::IDENTITY);
    assert!((scene.cameras[0].yfov_rad.unwrap() - 2.0 * (12.5_f32 / 35.0).atan()).abs() < 1e-6);
    // Seen from the camera, red is on the left; every wall looks into the room and the lamp looks down.
    let middle = DVec3::new(-0.278, 0.2744, -0.2796);
    for name in [
        "floor",
        "ceiling",
        "back wall",
        "left wall",
        "right wall",
        "lamp",
    ] {
        for (normal, center) in facets(&scene, name) {
            assert!(normal.dot(middle - center) > 0.0, "{name}");
        }
    }
    assert!(
        facets(&scene, "left wall")
            .iter()
            .all(|(_, center)| center.x < -0.54)
    );
    assert!(
        facets(&scene, "right wall")
            .iter()
            .all(|(_, center)| center.x == 0.0)
    );
    assert!(
        facets(&scene, "lamp")
            .iter()
            .all(|(normal, center)| normal.y == -1.0 && center.y < 0.5488)
    );
    for (name, area, point) in [
        ("short block", 5, DVec3::new(-0.1855, 0.0825, -0.169)),
        ("tall block", 5, DVec3::new(-0.3685, 0.165, -0.35125)),
    ] {
        let facets = facets(&scene, name);
        assert_eq!(facets.len(), 2 * area);
        assert!(
            facets
                .iter()
                .all(|(normal, center)| normal.dot(*center - point) > 0.0),
            "{name}"
        );
    }
    let lamp = scene
        .materials
        .iter()
        .find(|material| material.name == "lamp")
        .unwrap();
    for channel in 0..3 {
        // Written as factor times strength: two roundings of f32.
        assert!((lamp.emission[channel] / cornell::LAMP_RADIANCE[channel] - 1.0).abs() < 1e-6);
    }
    let needs = Needs::of(&scene);
    assert_eq!(needs.bsdfs, ["lambert"]);
    assert!(needs.not_lambert.is_empty());
    let only_emitters = ShaderFeatures {
        emitters: true,
        ..ShaderFeatures::default()
    };
    assert_eq!(needs.shader_features(), only_emitters);
    assert!(
        needs
            .left_out
            .iter()
            .any(|left_out| left_out.feature == "caustics")
    );
}

#[test]
fn plane_fills_the_view_and_its_closed_form_holds() {
    let scene = Scene::builtin("plane").unwrap();
    let bounds = scene.bounds_in_world().unwrap();
    assert_eq!(
        (bounds.min.z, bounds.max.z),
        (-plane::DISTANCE_M, -plane::DISTANCE_M)
    );
    assert!(bounds.max.x >= 3.0 * plane::DISTANCE_M && bounds.min.y <= -3.0 * plane::DISTANCE_M);
    assert!(
        facets(&scene, "plane")
            .iter()
            .all(|(normal, _)| *normal == DVec3::Z)
    );
    let light = &scene.light_instances()[0];
    assert_eq!(
        light.world_from_light.translation.to_array(),
        plane::LIGHT_POSITION
    );
    // Right under the light: albedo / pi * I / h^2 = 0.5 / pi * 10 / 2.25.
    let below = plane::radiance_at(0.0, 0.75);
    assert!(
        (below - 0.5 / std::f64::consts::PI * 10.0 / 2.25).abs() < 1e-12,
        "{below}"
    );
    // At 45 degrees the distance is sqrt(2) h and the cosine 1 / sqrt(2): 2^-1.5 of it.
    assert!((plane::radiance_at(1.5, 0.75) / below - 2.0_f64.powf(-1.5)).abs() < 1e-12);
    assert_eq!(scene.start_pose().position, DVec3::ZERO);
}

#[test]
fn sphere_has_the_area_of_the_ball_and_faces_inward() {
    let scene = Scene::builtin("sphere").unwrap();
    assert_eq!(scene.triangle_count(), 5120);
    let area = 4.0 * std::f64::consts::PI * sphere::RADIUS_M * sphere::RADIUS_M;
    // 5120 triangles with coordinates rounded to 1e-7.
    assert!(
        (scene.surface_area_m2() / area - 1.0).abs() < 1e-6,
        "{}",
        scene.surface_area_m2()
    );
    for (normal, center) in facets(&scene, "wall") {
        assert!(normal.dot(center) < 0.0);
        // Facets of an icosphere at level 4 are 2.5 degrees wide: their middles lie within 2e-3 of the radius.
        assert!((center.length() - sphere::RADIUS_M).abs() < 2e-3);
    }
    let mesh = &scene.meshes[0];
    for (position, normal) in mesh.positions.iter().zip(&mesh.normals) {
        let (position, normal) = (
            DVec3::from(position.map(f64::from)),
            DVec3::from(normal.map(f64::from)),
        );
        assert!(
            position.normalize().dot(normal) < -0.999_999,
            "smooth and inward"
        );
    }
    let irradiance = f64::from(sphere::LIGHT_INTENSITY) / (sphere::RADIUS_M * sphere::RADIUS_M);
    let albedo = f64::from(sphere::ALBEDO);
    // The intensity is pi as f32: 3e-8.
    assert!(
        (albedo / std::f64::consts::PI * irradiance / (1.0 - albedo) - sphere::RADIANCE).abs()
            < 1e-7
    );
    assert_eq!(scene.lights[0].kind, LightKind::Point);
}

#[test]
fn gallery_is_furnished_and_lit() {
    let scene = Scene::builtin("gallery").unwrap();
    let needs = Needs::of(&scene);
    assert!(
        (5_000..=50_000).contains(&needs.triangles),
        "{}",
        needs.triangles
    );
    assert!(
        needs.stored_triangles < needs.triangles,
        "columns share one mesh"
    );
    assert_eq!(
        scene
            .instances()
            .iter()
            .filter(|instance| scene.meshes[instance.mesh].name == "column")
            .count(),
        8
    );
    for kind in ["lambert", "glossy", "metal", "dielectric"] {
        assert!(needs.bsdfs.contains(&kind), "{kind}");
    }
    assert!(needs.caustics && needs.lights.spot == 3 && needs.textures_by_use["base_color"] >= 4);
    let pose = scene.start_pose();
    assert!((pose.position.y - 1.6).abs() < 1e-6);
    assert!(
        (pose.orientation * DVec3::Y).distance(DVec3::Y) < 1e-6,
        "upright"
    );
    // Every emissive triangle looks into the hall.
    let bounds = scene.bounds_in_world().unwrap();
    for instance in scene.instances() {
        let mesh = &scene.meshes[instance.mesh];
        for triangle in mesh
            .triangles
            .iter()
            .filter(|triangle| scene.materials[triangle.material as usize].is_emissive())
        {
            let [a, b, c] = mesh
                .corners(triangle)
                .map(|corner| instance.world_from_object.transform_point3(corner));
            assert!(
                (b - a)
                    .cross(c - a)
                    .dot(bounds.center() - (a + b + c) / 3.0)
                    > 0.0
            );
        }
    }
    let (glass, mirror) = (
        scene.materials.iter().find(|m| m.name == "glass").unwrap(),
        scene.materials.iter().find(|m| m.name == "mirror").unwrap(),
    );
    assert_eq!(
        (glass.transmission, glass.ior, glass.roughness),
        (1.0, 1.5, 0.0)
    );
    assert_eq!((mirror.metallic, mirror.roughness), (1.0, 0.05));
}

/// How often each edge of a mesh is passed in one direction and in the other.
fn edges(mesh: &Mesh) -> BTreeMap<[u32; 2], [u32; 2]> {
    let mut edges = BTreeMap::new();
    for triangle in &mesh.triangles {
        let [a, b, c] = triangle.vertices;
        for [from, to] in [[a, b], [b, c], [c, a]] {
            let counts: &mut [u32; 2] = edges.entry([from.min(to), from.max(to)]).or_default();
            counts[usize::from(from > to)] += 1;
        }
    }
    edges
}

#[test]
fn generated_scenes_are_whole_and_the_same_each_time() {
    for (name, meshes) in [("terrain", 1), ("water", 4), ("bottle", 6)] {
        let scene = Scene::builtin(name).unwrap();
        assert!(scene.warnings.is_empty(), "{:?}", scene.warnings);
        assert_eq!(scene.meshes.len(), meshes, "{name}");
        assert!(scene.start_camera().is_some());
        for mesh in &scene.meshes {
            let mut turned = 0;
            for triangle in &mesh.triangles {
                let [a, b, c] = mesh.corners(triangle);
                let front = (b - a).cross(c - a);
                for vertex in triangle.vertices {
                    let normal = DVec3::from(mesh.normals[vertex as usize].map(f64::from));
                    turned += u32::from(front.dot(normal) <= 0.0);
                }
            }
            // Where both sides of a crest are steeper than 45 degrees, the mean of its triangles may face away from one.
            let most = if name == "terrain" {
                3 * mesh.triangles.len() as u32 / 1000
            } else {
                0
            };
            assert!(turned <= most, "{name}, {}: {turned}", mesh.name);
        }
        assert!(builtin::glb(name).unwrap() == builtin::glb(name).unwrap());
    }
}

#[test]
fn the_terrain_has_no_cracks_and_the_bottle_encloses_its_glass() {
    let terrain = Scene::builtin("terrain").unwrap();
    assert_eq!(terrain.triangle_count(), 2 * 924 * 924);
    assert!(terrain.environment.is_some());
    let edges_of_terrain = edges(&terrain.meshes[0]);
    let border = edges_of_terrain
        .values()
        .filter(|counts| **counts != [1, 1]);
    assert!(border.clone().all(|counts| counts.iter().sum::<u32>() == 1));
    assert_eq!(border.count(), 4 * 924);

    let bottle = Scene::builtin("bottle").unwrap();
    let needs = Needs::of(&bottle);
    assert!(needs.bsdfs.contains(&"dielectric"), "{:?}", needs.bsdfs);
    let glass = bottle
        .meshes
        .iter()
        .find(|mesh| mesh.name == "bottle")
        .unwrap();
    assert!(edges(glass).values().all(|counts| *counts == [1, 1]));
}

#[test]
fn the_water_has_the_thesis_index_and_covers_its_ground() {
    let water = Scene::builtin("water").unwrap();
    let surface = water
        .materials
        .iter()
        .find(|material| material.name == "water")
        .unwrap();
    assert_eq!(
        (surface.ior, surface.roughness, surface.transmission),
        (1.2, 0.01, 1.0)
    );
    assert!(water.environment.is_some());
    // Where the sheet ends the ground is above it: nothing looks below its edge.
    let named = |name: &str| water.meshes.iter().find(|mesh| mesh.name == name).unwrap();
    let (sheet, ground) = (named("water"), named("ground"));
    let half_m = sheet
        .positions
        .iter()
        .fold(0.0_f32, |most, p| most.max(p[0]));
    let rim = ground
        .positions
        .iter()
        .filter(|p| (p[0].abs().max(p[2].abs()) - half_m).abs() < 0.1);
    assert!(rim.clone().count() > 400);
    assert!(
        rim.clone().all(|p| p[1] > 0.1),
        "{:?}",
        rim.map(|p| p[1]).fold(9.0, f32::min)
    );
}
