use super::glow::glow_of;
use super::*;
use crate::scene::{
    AlphaMode, Filter, Image, Material, MeshTriangle, Node, PunctualLight, Texture, TextureRef,
    Wrap,
};

fn node(mesh: Option<usize>, light: Option<usize>, parent_from_node: DAffine3) -> Node {
    Node {
        parent_from_node,
        mesh,
        light,
        ..Node::default()
    }
}

/// One mesh of a dark and three glowing unit right triangles, placed twice (the second twice as large), and a lamp.
fn scene() -> Scene {
    let triangle = |material| MeshTriangle {
        vertices: [0, 1, 2],
        material,
    };
    Scene {
        nodes: vec![
            node(Some(0), None, DAffine3::IDENTITY),
            node(
                None,
                Some(0),
                DAffine3::from_translation(DVec3::new(0.0, 7.0, 0.0)),
            ),
            node(Some(0), None, DAffine3::from_scale(DVec3::splat(2.0))),
        ],
        roots: vec![0, 1, 2],
        meshes: vec![Mesh {
            positions: vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]],
            uv0: vec![[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]],
            triangles: vec![triangle(1), triangle(0), triangle(1), triangle(2)],
            ..Mesh::default()
        }],
        materials: vec![
            Material::lambert("dark", [0.5; 3]),
            Material {
                emission: [2.0, 1.0, 0.0],
                ..Material::lambert("glow", [0.0; 3])
            },
            Material {
                emission: [4.0; 3],
                double_sided: true,
                ..Material::lambert("both", [0.0; 3])
            },
        ],
        lights: vec![PunctualLight {
            name: String::new(),
            kind: LightKind::Point,
            intensity: [1.0; 3],
        }],
        ..Scene::default()
    }
}

fn packed(scene: &Scene) -> PackedLights {
    let sources = LightSources {
        scene,
        environment: None,
        leaf_of_triangle: &[vec![3, 2, 1, 0]],
        kinds: LightKinds::default(),
    };
    pack_lights(&sources, DVec3::new(0.0, 5.0, 0.0))
}

#[test]
fn ordinals_count_emissive_triangles_in_the_meshs_order() {
    let scene = scene();
    assert_eq!(
        emitter_ordinals(&scene, &scene.meshes[0]),
        [0, NO_EMITTER, 1, 2]
    );
}

#[test]
fn records_lie_where_instances_and_ordinals_say() {
    let scene = scene();
    let lights = packed(&scene);
    assert_eq!(lights.first_emitter, [1, 4]);
    assert_eq!(lights.origin_dependent, 1);
    assert_eq!(lights.records.len(), 7);
    assert_eq!(lights.records[0].kind, LIGHT_POINT);
    assert_eq!(lights.records[0].position, [0.0, 2.0, 0.0]);
    let second = &lights.records[4 + 2];
    assert_eq!(
        (second.kind, second.instance, second.triangle),
        (LIGHT_TRIANGLE, 1, 0)
    );
}

#[test]
fn powers_are_pi_area_radiance_and_twice_that_for_two_sides() {
    let scene = scene();
    let lights = packed(&scene);
    // Areas 0.5 and 2: two single-sided triangles and a double-sided one each.
    let red = 4.0 * PI + (0.5 + 2.0) * PI * (2.0 * 2.0 + 2.0 * 4.0);
    assert!((lights.total_power[0] - red).abs() < 1e-9);
    let sum: f32 = lights.records.iter().map(|record| record.pick_pdf).sum();
    assert!((sum - 1.0).abs() < 1e-5);
    assert!((lights.records[6].pick_pdf / lights.records[3].pick_pdf - 4.0).abs() < 1e-5);
    // What is blended shines by its alpha; the point light of 4 pi stays.
    let mut blended = scene;
    for material in &mut blended.materials {
        material.alpha_mode = AlphaMode::Blend;
        material.base_color[3] = 0.25;
    }
    let red = 4.0 * PI + 0.25 * (red - 4.0 * PI);
    assert!((packed(&blended).total_power[0] - red).abs() < 1e-9);
}

#[test]
fn a_lamp_that_grows_out_of_nothing_has_the_power_of_its_shape() {
    let grown = scene();
    let mut folded = grown.clone();
    folded.meshes[0].positions = vec![[0.0; 3]; 3];
    let mut lights = packed(&folded);
    assert_eq!(lights.records[1].pick_pdf, 0.0);
    let mesh = &grown.meshes[0];
    lights.reshape_mesh(0, |triangle| mesh.corners(&mesh.triangles[triangle]));
    for placed in grown.instances() {
        lights.place_instance(placed.node as u32 / 2, &placed.world_from_object);
    }
    assert!(lights.finish().alias);
    assert_eq!(lights.total_power, packed(&grown).total_power);
    assert!(lights.records[1].pick_pdf > 0.0);
}

#[test]
fn only_leading_records_move_with_the_origin() {
    let scene = scene();
    let mut lights = packed(&scene);
    let before = lights.records.clone();
    lights.set_origin(DVec3::new(1e6, 0.0, 0.0));
    assert_eq!(lights.records[0].position, [-1e6, 7.0, 0.0]);
    assert_eq!(lights.records[1..], before[1..]);
}

#[test]
fn kinds_that_are_off_have_no_record() {
    let scene = scene();
    let by_kinds = |kinds| {
        let sources = LightSources {
            scene: &scene,
            environment: None,
            leaf_of_triangle: &[],
            kinds,
        };
        pack_lights(&sources, DVec3::ZERO)
    };
    let mut kinds = LightKinds {
        emitters: false,
        ..LightKinds::default()
    };
    let lights = by_kinds(kinds);
    assert_eq!(lights.records.len(), 1);
    assert_eq!(lights.first_emitter, [NO_EMITTER; 2]);
    kinds.points = false;
    let lights = by_kinds(kinds);
    assert!(lights.records.is_empty());
    assert_eq!(lights.alias, [LightAlias::default()]);
}

/// Probability of each light that a table gives.
fn table_probabilities(table: &[LightAlias]) -> Vec<f64> {
    let count = table[0].alias_index as usize;
    let mut probabilities = vec![0.0; count];
    for (index, entry) in table[1..].iter().enumerate() {
        probabilities[index] += f64::from(entry.threshold) / count as f64;
        probabilities[entry.alias_index as usize] +=
            (1.0 - f64::from(entry.threshold)) / count as f64;
    }
    probabilities
}

#[test]
fn the_alias_table_gives_every_light_its_share() {
    for weights in [
        vec![1.0],
        vec![0.0, 1.0],
        vec![1.0, 2.0, 3.0, 0.0],
        (0..10_000).map(|i| f64::from(i * i)).collect(),
    ] {
        let wanted = chances(&weights);
        let (table, stated) = alias_table(&wanted);
        assert_eq!(table.len(), weights.len() + 1);
        // A threshold is rounded up by less than a step of what is left of 24 bits behind the slot.
        let count = weights.len() as f64;
        let step = count.log2().ceil().exp2() / 2f64.powi(24) / count;
        let mut slots = vec![1.0; weights.len()];
        for entry in &table[1..] {
            slots[entry.alias_index as usize] += 1.0;
        }
        for (index, given) in table_probabilities(&table).into_iter().enumerate() {
            assert!((given - stated[index]).abs() < 1e-12, "light {index}");
            // And f32 rounds it before, by 2^-25 of a slot.
            let bound = slots[index] * (step + 3e-8 / count) + 1e-12;
            assert!(
                (given - wanted[index]).abs() <= bound,
                "light {index}: {given} for {}",
                wanted[index]
            );
            let shines = weights[index] > 0.0;
            assert_eq!(shines, given > 0.0, "light {index}");
            assert!(!shines || given >= step, "light {index}");
        }
    }
    assert_eq!(alias_table(&chances(&[0.0, 0.0])).0[0].alias_index, 0);
    assert_eq!(alias_table(&[]).0[0].alias_index, 0);
}

#[test]
fn faint_lights_have_a_chance_that_random_numbers_can_meet() {
    let weights = [1.0, 1e-12, 0.0];
    let (table, stated) = alias_table(&chances(&weights));
    assert!(stated[1] > 1e-4 && stated[1] < 1e-3, "{stated:?}");
    assert_eq!(stated[2], 0.0);
    // As the shader picks, by all numbers that lie evenly on 24 bits.
    let mut picked = [0u32; 3];
    for number in 0..1u32 << 24 {
        let scaled = number as f32 / 16_777_216.0 * 3.0;
        let slot = (scaled as usize).min(2);
        let entry = table[slot + 1];
        let is_own = scaled - (slot as f32) < entry.threshold;
        picked[if is_own {
            slot
        } else {
            entry.alias_index as usize
        }] += 1;
    }
    for (picked, stated) in picked.iter().zip(&stated) {
        // The product is rounded: by half a step at most, at both ends of each slot's two parts.
        let given = f64::from(*picked) / 2f64.powi(24);
        assert!(
            (given - stated).abs() <= 4.0 * 2f64.powi(-24),
            "{given} {stated}"
        );
    }
}

#[test]
fn a_lamp_has_its_chance_beside_the_sun() {
    let mut scene = scene();
    scene.lights.push(PunctualLight {
        kind: LightKind::Directional,
        intensity: [1e9; 3],
        ..scene.lights[0].clone()
    });
    scene.nodes.push(node(None, Some(1), DAffine3::IDENTITY));
    scene.roots.push(scene.nodes.len() - 1);
    let lights = packed(&scene);
    let chances: f64 = lights
        .records
        .iter()
        .filter(|record| record.kind != LIGHT_DIRECTIONAL)
        .map(|record| f64::from(record.pick_pdf))
        .sum();
    assert!((chances - LEAST_CHANCE_OF_KIND).abs() < 1e-6, "{chances}");
    assert!(lights.tree_depth() > 0);
}

#[test]
fn spot_falloff_is_one_inside_zero_outside_and_integrates() {
    for (inner, outer) in [
        (0.2f32, 0.6f32),
        (0.0, 1.5),
        (1.2, 1.5),
        (0.5, 0.5),
        (0.0, 0.01),
    ] {
        let (scale, offset) = spot_falloff(inner, outer);
        let falloff = |cosine: f64| (cosine * scale + offset).clamp(0.0, 1.0).powi(2);
        let [inside, outside] = [inner, outer].map(|angle| f64::from(angle).cos());
        // The ramp over the cosine, of which LEAST_RAMP is always left: 0 at the outer cone, a square up to 1.
        let ramp = (inside - outside).max(LEAST_RAMP);
        for (share, due) in [(-0.1, 0.0), (0.0, 0.0), (0.5, 0.25), (1.0, 1.0), (1.1, 1.0)] {
            let found = falloff(outside + share * ramp);
            // Two roundings of up to 1 / LEAST_RAMP, squared.
            assert!(
                (found - due).abs() < 1e-11,
                "{inner} {outer}: {found} at {share}"
            );
        }
        // Its integral over the cosine from the outer cone to the axis: a third of the ramp, and all beyond. A ramp that the axis
        // cuts short ends at a share of it.
        let end = ((1.0 - outside) / ramp).min(1.0);
        let due = 2.0 * PI * (ramp * end.powi(3) / 3.0 + (1.0 - outside - ramp).max(0.0));
        let found = spot_solid_angle(scale, offset);
        assert!(
            (found / due - 1.0).abs() < 1e-9,
            "{inner} {outer}: {found}, {due} is due"
        );
    }
    // 2 pi (1 - cos i + (cos i - cos o) / 3), in figures.
    let (scale, offset) = spot_falloff(0.2, 0.6);
    assert!((spot_solid_angle(scale, offset) - 0.449_313_2).abs() < 1e-6);
}

/// An emissive texture of 4 x 4 texels, white in one corner.
fn textured(white: usize, uv_scale: f32) -> Scene {
    let mut scene = scene();
    let mut rgba8 = vec![0; 64];
    rgba8[4 * white..4 * white + 4].fill(255);
    scene.images.push(Image {
        name: String::new(),
        width: 4,
        height: 4,
        rgba8,
    });
    scene.textures.push(Texture {
        image: 0,
        wrap_u: Wrap::Clamp,
        wrap_v: Wrap::Clamp,
        filter: Filter::Nearest,
    });
    scene.materials[1].emissive_texture = Some(TextureRef {
        texcoord_from_uv: [uv_scale, 0.0, 0.0, 0.0, uv_scale, 0.0],
        ..TextureRef::plain(0)
    });
    scene
}

#[test]
fn textured_emission_is_averaged_over_the_triangle() {
    let scene = textured(0, 1.0);
    let glow = glow_of(&scene, &scene.meshes[0], 0);
    // The corner texel covers 1/16 of the square, so 1/8 of the triangle.
    assert!((glow.mean[0] - 2.0 / 8.0).abs() < 0.03, "{:?}", glow.mean);
    assert_eq!(glow.boost, 1.0);
}

#[test]
fn triangles_that_see_only_black_texels_have_no_power() {
    let scene = textured(15, 1.0);
    let glow = glow_of(&scene, &scene.meshes[0], 0);
    assert_eq!(glow.mean, [0.0; 3]);
}

#[test]
fn a_glow_too_small_for_the_grid_keeps_a_chance() {
    // 4000 repetitions of the image per edge: far finer than the grid.
    let mut scene = textured(5, 1e3);
    scene.textures[0].wrap_u = Wrap::Repeat;
    scene.textures[0].wrap_v = Wrap::Repeat;
    let glow = glow_of(&scene, &scene.meshes[0], 0);
    let level = glow.mean.iter().sum::<f64>() / 3.0 * glow.boost;
    assert!(level > 0.0);
}

/// Records and table of `lights` after what has changed is finished, as of one origin.
fn finished(mut lights: PackedLights) -> (Vec<Light>, Vec<LightAlias>, [f64; 3]) {
    lights.finish();
    lights.set_origin(DVec3::new(0.0, 5.0, 0.0));
    (lights.records, lights.alias, lights.total_power)
}

#[test]
fn lights_that_moved_are_those_of_the_moved_scene() {
    let mut scene = scene();
    scene.nodes[1].light = Some(0);
    let mut lights = packed(&scene);
    let still = finished(lights.clone());
    let squashed = DAffine3::from_scale_rotation_translation(
        DVec3::new(3.0, 0.5, 1.0),
        glam::DQuat::from_rotation_y(1.0),
        DVec3::new(4.0, 5.0, 6.0),
    );
    let lamp = DAffine3::from_translation(DVec3::new(-1.0, 6.0, 2.0));
    scene.nodes[0].parent_from_node = squashed;
    scene.nodes[1].parent_from_node = lamp;
    lights.place_instance(0, &squashed);
    assert!(lights.move_nodes(|node| (node == 1).then_some(lamp)));
    assert!(!lights.move_nodes(|node| (node == 1).then_some(lamp)));
    let moved = finished(lights);
    assert_ne!(moved, still);
    assert_eq!(moved, finished(packed(&scene)));
}

#[test]
fn turning_a_lamp_asks_for_no_new_table() {
    let mut lights = packed(&scene());
    lights.finish();
    let turned = DAffine3::from_rotation_translation(
        glam::DQuat::from_rotation_z(0.7),
        DVec3::new(9.0, 0.0, 1.0),
    );
    lights.place_instance(0, &turned);
    let of_tree = LightUploads {
        tree: true,
        ..LightUploads::default()
    };
    assert_eq!(lights.finish(), of_tree);
    lights.place_instance(0, &(turned * DAffine3::from_scale(DVec3::splat(1.001))));
    assert!(lights.finish().alias);
}

#[test]
fn instances_come_and_go_with_their_light() {
    let scene = scene();
    let lights = packed(&scene);
    let (_, _, power) = finished(lights.clone());
    let mut fewer = lights.clone();
    fewer.remove_instance(1);
    let (records, alias, less) = finished(fewer.clone());
    // Instance 1 is twice as large: four fifths of the triangles' power.
    let triangles = power[0] - 4.0 * PI;
    assert!((less[0] - (power[0] - 0.8 * triangles)).abs() < 1e-9);
    let share = table_probabilities(&alias);
    for record in 4..7 {
        assert!(records[record].pick_pdf == 0.0 && share[record] < 1e-6);
    }
    // A new one takes the room and brings the power back; a second one more needs new room.
    let twice = DAffine3::from_scale(DVec3::splat(2.0));
    assert_eq!(fewer.add_instance(1, 0, &twice), 4);
    assert_eq!(finished(fewer.clone()), finished(lights));
    assert_eq!(fewer.add_instance(2, 0, &twice), 7);
    assert!((finished(fewer).2[0] - (power[0] + 0.8 * triangles)).abs() < 1e-9);
}

#[test]
fn a_larger_box_carries_more_of_the_light_from_afar() {
    let mut scene = scene();
    scene.lights[0].kind = LightKind::Directional;
    let mut lights = packed(&scene);
    assert!(lights.has_infinite_lights());
    let packed = lights.packed_box();
    let before = lights.total_power[0];
    // The sun shines along -Z.
    let sun = 4.0 * packed.half_size.x * packed.half_size.y;
    lights.set_box(SceneBox {
        center: packed.center + DVec3::X,
        half_size: packed.half_size * DVec3::new(2.0, 2.0, 7.0),
    });
    lights.finish();
    assert!((lights.total_power[0] - before - 3.0 * sun).abs() < 1e-5 * sun);
    lights.set_box(packed);
    lights.finish();
    assert!((lights.total_power[0] - before).abs() < 1e-5 * sun);
}

/// Middles and radii of the tree's clusters, world space.
fn clusters(lights: &PackedLights, origin: DVec3) -> Vec<(DVec3, f32)> {
    let tree = &lights.words()[4 * lights.records.len()..];
    let number = |bits: &u32| f32::from_bits(*bits);
    let place =
        |words: &[u32; 4]| Vec3::new(number(&words[0]), number(&words[1]), number(&words[2]));
    let middle = place(&tree[0]).as_dvec3() + origin;
    let pairs = tree[1..][..3 * tree[0][3] as usize].chunks(3);
    pairs
        .flat_map(|pair| &pair[..2])
        .map(|words| (place(words).as_dvec3() + middle, number(&words[3])))
        .collect()
}

#[test]
fn clusters_lie_where_lights_are_whatever_moves() {
    let mut lights = packed(&scene());
    let origin = DVec3::new(0.0, 5.0, 0.0);
    // Two placements of a mesh from (0, 0) to (1, 1) and (2, 2), and a lamp at y = 7.
    let has = |lights: &PackedLights, origin, at: DVec3, radius: f32| {
        let near =
            |(middle, r): (DVec3, f32)| middle.distance(at) < 1e-5 && (r - radius).abs() < 1e-5;
        clusters(lights, origin).into_iter().any(near)
    };
    let lamp = DVec3::new(0.0, 7.0, 0.0);
    let half = 0.5f32.sqrt();
    assert!(has(&lights, origin, lamp, 0.0));
    assert!(has(&lights, origin, DVec3::new(0.5, 0.5, 0.0), half));
    assert!(has(&lights, origin, DVec3::new(1.0, 1.0, 0.0), 2.0 * half));
    // The head goes, a mesh too; another one changes its shape.
    let head = DVec3::new(-3.0, 2.0, 8.0);
    lights.set_origin(head);
    lights.place_instance(0, &DAffine3::from_translation(DVec3::new(0.0, 0.0, -9.0)));
    let finished = lights.finish();
    assert!(finished.tree && finished.records == (0..lights.origin_dependent));
    assert!(has(&lights, head, lamp, 0.0));
    assert!(has(&lights, head, DVec3::new(0.5, 0.5, -9.0), half));
    let [x, y, z] = [DVec3::X, DVec3::Y, DVec3::Z];
    lights.reshape_mesh(0, |_| [DVec3::splat(4.0), 4.0 + x + y, 4.0 + x + z]);
    lights.place_instance(1, &DAffine3::from_scale(DVec3::splat(2.0)));
    lights.finish();
    assert!(has(&lights, head, DVec3::splat(9.0), 3f32.sqrt()));
    // Lamps in one place are all as near.
    let mut lamps = scene();
    lamps.nodes = vec![node(None, Some(0), DAffine3::IDENTITY); 9];
    lamps.roots = (0..9).collect();
    assert_eq!(clusters(&packed(&lamps), origin), []);
    // Where there are few, no tree.
    let mut few = scene();
    few.nodes.truncate(2);
    few.roots.truncate(2);
    assert_eq!(clusters(&packed(&few), origin), []);
}
