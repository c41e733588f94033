//! What the suites render: scenes by name, and scenes generated to a size.
//!
//! The generated ones ([`Generated`]) are one room, seen from one place: a floor that is a height field of as many
//! triangles as asked for, a wall behind it, boxes on it in as many instances as asked for, lights above it in any number
//! with the same power together. [`INDIRECT_SCENE`] is a room whose lamp lights the ceiling alone. So a figure can be followed over one size while the view stays as it is.

use glam::{DAffine3, DVec3};
use serde::Serialize;
use stereolux_report::fingerprint::Fingerprint;
use stereolux_report::records::GENERATED;

use super::BenchError;
use crate::limits::LoadBudget;
use crate::scene::{Camera, LightKind, Material, Mesh, Node, PunctualLight, Scene, SceneError};
use crate::scene_loading::Loaded;
use crate::settings::Settings;

/// A scene to measure.
#[derive(Clone, Debug, PartialEq)]
pub enum SceneSource {
    /// As `--scene` takes it.
    Named(String),
    /// Made to a size.
    Generated(Generated),
}

/// Sizes of a generated room.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct Generated {
    /// Triangles of the floor: the next number of the form 2 n^2, n even, not below this.
    pub floor_triangles: u32,
    /// Boxes on the floor, each an instance of one mesh of 12 triangles.
    pub boxes: u32,
    /// Point lights.
    pub lights: u32,
}

impl Default for Generated {
    fn default() -> Self {
        Self {
            floor_triangles: 1000,
            boxes: 9,
            lights: 1,
        }
    }
}

impl SceneSource {
    /// Name for reports.
    #[must_use]
    pub fn name(&self) -> String {
        match self {
            Self::Named(name) => name.clone(),
            Self::Generated(made) => format!(
                "{GENERATED}{}-triangle floor, {} boxes, {} lights",
                made.floor_triangles, made.boxes, made.lights
            ),
        }
    }

    /// Loads or makes it, with the environment that the settings name.
    ///
    /// # Errors
    /// [`BenchError::Scene`].
    pub fn load(&self, settings: &Settings) -> Result<Scene, BenchError> {
        match self {
            Self::Named(name) => Ok(open(name, settings)?),
            Self::Generated(made) => Ok(surrounded(made, settings)?),
        }
    }

    /// Reads a named scene, to find out early whether that works.
    ///
    /// # Errors
    /// [`BenchError::Scene`].
    pub fn check(&self, settings: &Settings) -> Result<(), BenchError> {
        match self {
            Self::Named(name) => Ok(open(name, settings).map(|_| ())?),
            // Whichever room it is.
            Self::Generated(_) => Ok(surrounded(&Generated::default(), settings).map(|_| ())?),
        }
    }

    /// What the scene is, for keys. A named file is read for it; the generator is part of the code's own fingerprint.
    ///
    /// # Errors
    /// [`BenchError::Scene`].
    pub fn fingerprint(&self, settings: &Settings) -> Result<String, BenchError> {
        Ok(match self {
            Self::Named(name) => {
                let scene = open(name, settings)?;
                // Where the head starts is no part of the picture's contents, but of what a plan looks at.
                of_scene(&scene)
                    .with_text(&format!("{:?} {:?}", scene.start_pose(), scene.cameras))
                    .to_string()
            }
            Self::Generated(made) => {
                // For the surroundings, whichever room is in them.
                of_scene(&surrounded(&Generated::default(), settings)?)
                    .with_value(made)
                    .to_string()
            }
        })
    }
}

fn open(name: &str, settings: &Settings) -> Result<Scene, SceneError> {
    match name {
        INDIRECT_SCENE => lit(indirect(), settings),
        LIGHTS_SCENE => lit(MANY_LIGHTS.scene(), settings),
        _ => {
            let settings = Settings {
                scene: name.to_owned(),
                ..settings.clone()
            };
            Ok(Loaded::open(&settings)?.scene)
        }
    }
}

/// A scene that was made here, as the settings scale and light it.
fn lit(made: Scene, settings: &Settings) -> Result<Scene, SceneError> {
    let budget = LoadBudget::new(settings.limits.load());
    Ok(Loaded::of(made, settings, &budget)?.scene)
}

/// A generated room in the surroundings that the settings name. Its views are made for its own size, and it has no clips.
fn surrounded(made: &Generated, settings: &Settings) -> Result<Scene, SceneError> {
    let mut settings = settings.clone();
    settings.scene_scale = 1.0;
    settings.render.animation.clip.clear();
    lit(made.scene(), &settings)
}

/// Fingerprint of everything in a scene that can change a picture. The pattern names every field, so that a new one cannot
/// be forgotten here.
#[must_use]
pub fn of_scene(scene: &Scene) -> Fingerprint {
    let Scene {
        name: _,
        nodes,
        roots: _,
        meshes,
        materials,
        textures,
        images,
        lights,
        // The head's pose is part of the view, and so of the key beside this one.
        cameras: _,
        skins,
        animations,
        environment,
        warnings: _,
        source: _,
        parts: _,
        vacant: _,
    } = scene;
    // The graph counts by what it places.
    let mut hash = Fingerprint::default()
        .with_text(&format!("{:?}", scene.instances()))
        .with_text(&format!("{:?}", scene.light_instances()))
        .with_text(&format!("{materials:?}{textures:?}{lights:?}"));
    if !(skins.is_empty() && animations.is_empty()) {
        hash = hash.with_text(&format!("{nodes:?}{skins:?}{animations:?}"));
    }
    for image in images {
        hash = hash
            .with_text(&format!("{}x{}", image.width, image.height))
            .with(&image.rgba8);
    }
    for mesh in meshes {
        let Mesh {
            name: _,
            positions,
            normals,
            tangents,
            uv0,
            uv1,
            colors,
            joints,
            targets,
            flat: _,
            triangles,
            has_tangents,
            has_uv1,
            has_colors,
            repainted: _,
        } = mesh;
        let indices: Vec<[u32; 4]> = triangles
            .iter()
            .map(|triangle| {
                let [a, b, c] = triangle.vertices;
                [a, b, c, triangle.material]
            })
            .collect();
        hash = hash
            .with(bytemuck::cast_slice(positions))
            .with(bytemuck::cast_slice(normals))
            .with(bytemuck::cast_slice(tangents))
            .with(bytemuck::cast_slice(uv0))
            .with(bytemuck::cast_slice(uv1))
            .with(bytemuck::cast_slice(colors))
            .with(bytemuck::cast_slice(&indices))
            .with(&[*has_tangents, *has_uv1, *has_colors].map(u8::from));
        if !(joints.is_empty() && targets.is_empty()) {
            hash = hash.with_text(&format!("{joints:?}{targets:?}"));
        }
    }
    match environment {
        None => hash.with_text("no environment"),
        Some(map) => hash
            .with_text(&format!("{}x{}", map.width, map.height))
            .with(bytemuck::cast_slice(&map.radiance)),
    }
}

/// Half the edge of the room's floor, metres.
const HALF_FLOOR_M: f64 = 2.0;
/// Height of the floor's waves, metres.
const WAVE_M: f64 = 0.05;
/// Height of the room, metres.
const HEIGHT_M: f64 = 3.0;
/// Radiant intensity of all lights together, W/sr.
const INTENSITY: f32 = 12.0;
/// Height of the lights, metres.
const LIGHT_HEIGHT_M: f64 = 2.6;

/// Name of the generated room with as many lights as `scaling` has at most.
pub const LIGHTS_SCENE: &str = "bench:lights";
const MANY_LIGHTS: Generated = Generated {
    floor_triangles: 1000,
    boxes: 9,
    lights: 10_000,
};
/// Name of a room that only the suites know: closed, with a lamp that stands in a shade and lights the ceiling above it.
/// Nearly all that one sees is lit by that spot of light: no ray from a surface finds the lamp.
pub const INDIRECT_SCENE: &str = "bench:indirect";

/// Radiance of the lamp in the shade, W sr^-1 m^-2.
const SHADED_RADIANCE: f32 = 400.0;

fn indirect() -> Scene {
    let mut lamp = Material::lambert("lamp", [0.0; 3]);
    lamp.emission = [
        SHADED_RADIANCE,
        0.9 * SHADED_RADIANCE,
        0.7 * SHADED_RADIANCE,
    ];
    let mut scene = Scene {
        name: "indirect".to_owned(),
        materials: vec![
            Material::lambert("white", [0.75, 0.73, 0.7]),
            Material::lambert("red", [0.6, 0.15, 0.1]),
            Material::lambert("blue", [0.15, 0.25, 0.6]),
            Material::lambert("shade", [0.3; 3]),
            lamp,
        ],
        ..Scene::default()
    };
    // Inner sides of the room: 4 m wide and deep, 2.6 m high.
    let (h, top) = (HALF_FLOOR_M, 2.6);
    let corner = DVec3::new(-h, 0.0, -h);
    let [x, y, z] = [DVec3::X * 2.0 * h, DVec3::Y * top, DVec3::Z * 2.0 * h];
    scene.meshes.push(quads(
        "floor, ceiling, back and front",
        0,
        &[
            [corner, z, x],
            [corner + y, x, z],
            [corner, x, y],
            [corner + z, y, x],
        ],
    ));
    scene.meshes.push(quads("left", 1, &[[corner, y, z]]));
    scene.meshes.push(quads("right", 2, &[[corner + x, z, y]]));
    // The shade: four sides around the lamp, seen from within and without, open above.
    let (edge, low, high) = (0.15, 1.9, 2.25);
    let foot = DVec3::new(0.9 - edge, low, -1.3 - edge);
    let [u, v, w] = [
        DVec3::X * 2.0 * edge,
        DVec3::Y * (high - low),
        DVec3::Z * 2.0 * edge,
    ];
    scene.meshes.push(quads(
        "shade",
        3,
        &[
            [foot, u, v],
            [foot, v, w],
            [foot + u, w, v],
            [foot + w, v, u],
            [foot, w, u],
        ],
    ));
    let glow = foot + DVec3::new(0.05, 0.02, 0.05);
    scene.meshes.push(quads(
        "lamp",
        4,
        &[[glow, w - DVec3::Z * 0.1, u - DVec3::X * 0.1]],
    ));
    scene.meshes.push(cube());
    scene.meshes[5]
        .triangles
        .iter_mut()
        .for_each(|t| t.material = 0);
    let block = DAffine3::from_translation(DVec3::new(-0.7, 0.0, -0.8))
        * DAffine3::from_rotation_y(0.4)
        * DAffine3::from_scale(DVec3::new(0.8, 1.1, 0.8));
    let eye =
        DAffine3::from_translation(DVec3::new(0.0, 1.3, 1.85)) * DAffine3::from_rotation_x(-0.05);
    scene.cameras.push(Camera {
        name: "viewpoint".to_owned(),
        yfov_rad: Some(1.1),
    });
    for index in 0..5 {
        place(&mut scene, "room", DAffine3::IDENTITY, Node::of_mesh(index));
    }
    place(&mut scene, "block", block, Node::of_mesh(5));
    place(&mut scene, "viewpoint", eye, camera_node());
    scene
}

/// Hangs `node` into the scene's root.
fn place(scene: &mut Scene, name: &str, world_from_node: DAffine3, node: Node) {
    scene.roots.push(scene.nodes.len());
    scene.nodes.push(Node {
        name: name.to_owned(),
        parent_from_node: world_from_node,
        ..node
    });
}

/// With the scene's first camera.
fn camera_node() -> Node {
    Node {
        camera: Some(0),
        ..Node::default()
    }
}

impl Generated {
    /// Quads along the floor's edge.
    fn floor_quads(&self) -> u32 {
        let quads = (f64::from(self.floor_triangles.max(8)) / 2.0).sqrt().ceil() as u32;
        quads + quads % 2
    }

    /// Makes the scene. The head starts at its camera.
    #[must_use]
    pub fn scene(&self) -> Scene {
        let mut scene = Scene {
            name: "generated".to_owned(),
            materials: vec![
                Material::lambert("floor", [0.6, 0.55, 0.5]),
                Material::lambert("wall", [0.5, 0.6, 0.7]),
                Material::lambert("box", [0.7, 0.4, 0.3]),
            ],
            ..Scene::default()
        };
        scene.meshes.push(floor(self.floor_quads()));
        scene.meshes.push(walls());
        scene.meshes.push(cube());
        place(&mut scene, "floor", DAffine3::IDENTITY, Node::of_mesh(0));
        place(&mut scene, "walls", DAffine3::IDENTITY, Node::of_mesh(1));
        // A square grid of boxes over the middle of the floor; together they cover the same share of it, whatever their number.
        let side = f64::from(self.boxes).sqrt().ceil().max(1.0);
        let step = 2.4 / side;
        for index in 0..self.boxes {
            let column = f64::from(index) % side;
            let row = (f64::from(index) / side).floor();
            let at = DVec3::new(
                (column + 0.5) * step - 1.2,
                WAVE_M,
                (row + 0.5) * step - 1.6,
            );
            let edge = 0.5 * step;
            let from = DAffine3::from_translation(at) * DAffine3::from_scale(DVec3::splat(edge));
            place(&mut scene, "box", from, Node::of_mesh(2));
        }
        let columns = f64::from(self.lights).sqrt().ceil().max(1.0);
        for index in 0..self.lights {
            let column = (f64::from(index) % columns + 0.5) / columns - 0.5;
            let row = ((f64::from(index) / columns).floor() + 0.5) / columns - 0.5;
            let at = DVec3::new(2.0 * column, LIGHT_HEIGHT_M, 2.0 * row);
            scene.lights.push(PunctualLight {
                name: format!("light {index}"),
                kind: LightKind::Point,
                intensity: [INTENSITY / self.lights as f32; 3],
            });
            let from = DAffine3::from_translation(at);
            let node = Node {
                light: Some(index as usize),
                ..Node::default()
            };
            place(&mut scene, "light", from, node);
        }
        scene.cameras.push(Camera {
            name: "viewpoint".to_owned(),
            yfov_rad: Some(1.2),
        });
        let eye = DVec3::new(0.0, 1.5, 1.9);
        let from = DAffine3::from_translation(eye) * DAffine3::from_rotation_x(-0.45);
        place(&mut scene, "viewpoint", from, camera_node());
        scene
    }
}

/// A mesh from corners and quads (two triangles each), all of one material, with one normal per vertex.
fn mesh(
    name: &str,
    vertices: Vec<([f32; 3], [f32; 3])>,
    triangles: Vec<[u32; 3]>,
    material: u32,
) -> Mesh {
    let (positions, normals): (_, Vec<[f32; 3]>) = vertices.into_iter().unzip();
    let tangent = |normal: &[f32; 3]| {
        let across = glam::Vec3::from_array(*normal).any_orthonormal_vector();
        across.extend(1.0).to_array()
    };
    Mesh {
        name: name.to_owned(),
        // As they always were, to the bit: the scene's fingerprint has them.
        tangents: normals.iter().map(tangent).collect(),
        ..Mesh::plain(positions, normals, triangles, material)
    }
}

/// A height field of `quads` x `quads` cells over the whole floor.
fn floor(quads: u32) -> Mesh {
    let across = quads + 1;
    let point = |column: u32, row: u32| {
        let along = |index: u32| HALF_FLOOR_M * (2.0 * f64::from(index) / f64::from(quads) - 1.0);
        let (x, z) = (along(column), along(row));
        let (a, b) = (3.0 * x + z, 2.0 * z - x);
        let height = 0.5 * WAVE_M * (a.sin() + b.sin());
        let slope_x = 0.5 * WAVE_M * (3.0 * a.cos() - b.cos());
        let slope_z = 0.5 * WAVE_M * (a.cos() + 2.0 * b.cos());
        let normal = DVec3::new(-slope_x, 1.0, -slope_z).normalize();
        (
            DVec3::new(x, height, z).as_vec3().to_array(),
            normal.as_vec3().to_array(),
        )
    };
    let vertices = (0..across * across)
        .map(|index| point(index % across, index / across))
        .collect();
    let triangles = (0..quads * quads)
        .flat_map(|index| {
            let a = index / quads * across + index % quads;
            let (b, c, d) = (a + 1, a + across, a + across + 1);
            // Counter-clockwise seen from above, where z grows towards the viewer.
            [[a, c, b], [b, c, d]]
        })
        .collect();
    mesh("floor", vertices, triangles, 0)
}

/// A mesh of quads: a corner and the edges from it, the faces to where they turn against the clock.
fn quads(name: &str, material: u32, sides: &[[DVec3; 3]]) -> Mesh {
    let (mut vertices, mut triangles) = (Vec::new(), Vec::new());
    for &[corner, u, v] in sides {
        let normal = u.cross(v).normalize().as_vec3().to_array();
        let first = vertices.len() as u32;
        for point in [corner, corner + u, corner + u + v, corner + v] {
            vertices.push((point.as_vec3().to_array(), normal));
        }
        triangles.push([first, first + 1, first + 2]);
        triangles.push([first, first + 2, first + 3]);
    }
    mesh(name, vertices, triangles, material)
}

/// Back wall and both side walls.
fn walls() -> Mesh {
    let (h, low, up) = (HALF_FLOOR_M, -1.0, DVec3::Y * (HEIGHT_M + 1.0));
    let sides = [
        [DVec3::new(-h, low, -h), DVec3::X * 2.0 * h, up],
        [DVec3::new(-h, low, h), DVec3::NEG_Z * 2.0 * h, up],
        [DVec3::new(h, low, -h), DVec3::Z * 2.0 * h, up],
    ];
    quads("walls", 1, &sides)
}

/// The cube from (-1/2, 0, -1/2) to (1/2, 1, 1/2).
fn cube() -> Mesh {
    let sides = [
        (DVec3::X, DVec3::Y),
        (DVec3::NEG_X, DVec3::Y),
        (DVec3::Y, DVec3::Z),
        (DVec3::NEG_Y, DVec3::Z),
        (DVec3::Z, DVec3::X),
        (DVec3::NEG_Z, DVec3::X),
    ];
    let side = |(normal, u): (DVec3, DVec3)| {
        let v = normal.cross(u);
        [DVec3::new(0.0, 0.5, 0.0) + 0.5 * (normal - u - v), u, v]
    };
    quads("box", 2, &sides.map(side))
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;
    use crate::folders::Folder;

    #[test]
    fn generated_scenes_have_the_sizes_asked_for() {
        for (triangles, boxes, lights) in [(1000, 1, 1), (2000, 10, 7), (50_000, 100, 100)] {
            let made = Generated {
                floor_triangles: triangles,
                boxes,
                lights,
            };
            let scene = made.scene();
            let floor = scene.meshes[0].triangles.len() as u32;
            assert!(
                floor >= triangles && floor < triangles + triangles / 5,
                "{floor}"
            );
            let placed = scene.instances();
            let placed = placed.iter().filter(|instance| instance.mesh == 2);
            assert_eq!(placed.count() as u32, boxes);
            assert_eq!(scene.light_instances().len() as u32, lights);
            let power: f32 = scene.lights.iter().map(|light| light.intensity[0]).sum();
            assert!((power / INTENSITY - 1.0).abs() < 1e-4);
            assert_eq!(
                scene.start_pose().position,
                Generated::default().scene().start_pose().position
            );
        }
    }

    #[test]
    fn generated_rooms_lie_in_the_surroundings_that_are_asked_for() {
        let source = SceneSource::Generated(Generated::default());
        let mut settings = Settings::default();
        let bare = source.fingerprint(&settings).unwrap();
        assert!(source.load(&settings).unwrap().environment.is_none());
        settings.environment.path = "builtin:sky".to_owned();
        assert!(source.load(&settings).unwrap().environment.is_some());
        assert_ne!(source.fingerprint(&settings).unwrap(), bare);
        settings.environment.path = "nowhere.hdr".to_owned();
        assert!(source.check(&settings).is_err());
    }

    fn assert_faces_look_where_normals_point(scene: &Scene) {
        for mesh in &scene.meshes {
            for triangle in &mesh.triangles {
                let [a, b, c] = mesh.corners(triangle);
                let shading = mesh.normals[triangle.vertices[0] as usize].map(f64::from);
                let cosine = (b - a).cross(c - a).dot(DVec3::from_array(shading));
                assert!(cosine > 0.0, "{}", mesh.name);
            }
        }
    }

    #[test]
    fn the_shaded_lamp_is_hidden_from_the_room() {
        let scene = open(INDIRECT_SCENE, &Settings::default()).unwrap();
        let emitter = &scene.meshes[4];
        assert!(
            emitter
                .triangles
                .iter()
                .all(|t| scene.materials[t.material as usize].emission[0] > 0.0)
        );
        // The shade's rim rises over the line from the lamp's edge to all that lies under the ceiling's spot: the widest
        // slope out of the shade meets the walls above their upper tenth.
        let rim = scene.meshes[3]
            .positions
            .iter()
            .map(|p| p[1])
            .fold(0.0, f32::max);
        let lamp = emitter.positions[0][1];
        let across = 2.0 * 0.15 - 0.05;
        let rise_per_metre = (rim - lamp) / across;
        let ceiling = 2.6;
        assert!((ceiling - rim) / rise_per_metre < 0.35, "{rise_per_metre}");
        assert_faces_look_where_normals_point(&scene);
        // The lamp looks up.
        assert!(emitter.normals[0][1] > 0.99);
        assert!(
            SceneSource::Named(INDIRECT_SCENE.to_owned())
                .check(&Settings::default())
                .is_ok()
        );
    }

    #[test]
    fn faces_look_where_their_normals_point() {
        let scene = Generated::default().scene();
        assert_faces_look_where_normals_point(&scene);
        // The boxes stand inside of the room.
        let bounds = scene.bounds_in_world().unwrap();
        assert!(bounds.size().x <= 2.0 * HALF_FLOOR_M + 1e-9);
    }

    #[test]
    fn whatever_changes_the_picture_changes_the_fingerprint() {
        let made = Generated::default();
        let scene = made.scene();
        let hash = of_scene(&scene);
        assert_eq!(hash, of_scene(&made.scene()));
        let changed = |change: &dyn Fn(&mut Scene)| {
            let mut other = scene.clone();
            change(&mut other);
            of_scene(&other) != hash
        };
        assert!(changed(&|s| s.meshes[0].positions[3][1] += 1e-6));
        assert!(changed(&|s| s.meshes[1].normals[0][0] += 1e-6));
        assert!(changed(&|s| s.materials[0].roughness = 0.5));
        assert!(changed(&|s| s.lights[0].intensity[2] += 1e-6));
        assert!(changed(
            &|s| s.nodes[2].parent_from_node.translation.x += 1e-9
        ));
        assert!(changed(&|s| s.meshes[0].triangles[5].material = 1));
        // Names do not show, and cameras are part of the view.
        assert!(!changed(&|s| s.name = "other".to_owned()));
        assert!(!changed(&|s| s.cameras.clear()));
        // A plan looks from the camera of its scene: the same file with another camera is another source.
        let folder = Folder::new("cameras");
        let keys = [0.5, 0.6].map(|yfov| {
            let camera =
                json!({"type": "perspective", "perspective": {"yfov": yfov, "znear": 0.1}});
            let gltf = json!({
                "asset": {"version": "2.0"},
                "scene": 0,
                "scenes": [{"nodes": [0]}],
                "nodes": [{"camera": 0}],
                "cameras": [camera],
            });
            let path = folder.write("scene.gltf", gltf.to_string());
            SceneSource::Named(path.display().to_string())
                .fingerprint(&Settings::default())
                .unwrap()
        });
        assert_ne!(keys[0], keys[1]);
    }
}
