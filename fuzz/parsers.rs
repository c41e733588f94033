//! Everything that reads what others made, fed one input at a time.

use std::path::{Path, PathBuf};

use glam::{DAffine3, DQuat, DVec3};
use image::ImageFormat;
use serde_json::Value;
use stereolux::bvh::{MaterialMarks, MeshHierarchies};
use stereolux::images::read_image;
use stereolux::options::layers::Layers;
use stereolux::scene::edit::{Document, Edit, NewContent, NewNode, Original, Placement};
use stereolux::scene::gltf_writer::assemble;
use stereolux::scene::{LightKind, Needs, PunctualLight, Scene, Trs, load_environment};
use stereolux::viewer::window_state::WindowState;
use stereolux::xr::validation::check_views;
use stereolux::xr::{
    Actions, Fov, Headset, HiddenArea, LocatedViews, Pose, ReplayOptions, ReplaySession, View,
    XrSession as _,
};
use stereolux_report::journal::Journal;

use super::mutate::{self, Random};
use super::seeds;

stereolux_base::words! {
    /// One of the formats, or of the sources of answers.
    pub enum Parser: name {
        /// `.gltf`, its JSON changed as a tree.
        GltfTree = "GltfTree",
        /// `.gltf`, its text changed.
        GltfText = "GltfText",
        /// `.glb`, its bytes changed, or the JSON in it.
        Glb = "Glb",
        /// Pictures in a scene.
        Textures = "Textures",
        /// Environment maps.
        Environment = "Environment",
        /// Pictures that are compared.
        Pictures = "Pictures",
        /// Recordings.
        Trace = "Trace",
        /// Headset profiles.
        Headset = "Headset",
        /// Actions of an application.
        Actions = "Actions",
        /// Files of settings.
        Settings = "Settings",
        /// `--set`.
        Set = "Set",
        /// Journals of a bench.
        Journal = "Journal",
        /// Layouts of the viewer.
        Layout = "Layout",
        /// Edits of a scene.
        Edits = "Edits",
        /// Poses, angles and masks of an XR runtime.
        Runtime = "Runtime",
    }
}

/// Feeds inputs to one parser.
pub struct Feeder {
    parser: Parser,
    seeds: Vec<Vec<u8>>,
    trees: Vec<Value>,
    scenes: Vec<Scene>,
    file: PathBuf,
}

impl Feeder {
    /// Keeps its file in `folder`, which exists.
    pub fn new(parser: Parser, folder: &Path) -> Self {
        let seeds = match parser {
            Parser::GltfTree | Parser::Edits | Parser::Runtime | Parser::Set => Vec::new(),
            Parser::GltfText => seeds::documents()
                .iter()
                .map(|tree| tree.to_string().into_bytes())
                .collect(),
            Parser::Glb => seeds::glbs(),
            Parser::Textures => [ImageFormat::Png, ImageFormat::Jpeg]
                .map(seeds::pictures)
                .concat(),
            Parser::Environment => [ImageFormat::Hdr, ImageFormat::OpenExr]
                .map(seeds::pictures)
                .concat(),
            Parser::Pictures => [
                ImageFormat::OpenExr,
                ImageFormat::Png,
                ImageFormat::Jpeg,
                ImageFormat::Hdr,
            ]
            .map(seeds::pictures)
            .concat(),
            Parser::Trace => seeds::traces(),
            Parser::Headset => seeds::profiles(),
            Parser::Actions => seeds::actions(),
            Parser::Settings => seeds::settings(),
            Parser::Journal => seeds::journals(),
            Parser::Layout => seeds::layouts(),
        };
        let scenes = match parser {
            Parser::Edits => ["cornell", "parade", "caustic"]
                .into_iter()
                .filter_map(|name| Scene::builtin(name).ok())
                .collect(),
            _ => Vec::new(),
        };
        Self {
            parser,
            seeds,
            trees: seeds::documents(),
            scenes,
            file: folder.join(parser.name()),
        }
    }

    /// One input, told by its seed. True if it was accepted. Panics where an invariant is broken.
    pub fn feed(&self, seed: u64) -> bool {
        let mut random = Random::new(seed ^ (self.parser as u64) << 56);
        match self.parser {
            Parser::GltfTree => {
                let mut tree = random.pick(&self.trees).clone();
                mutate::json(&mut tree, &mut random);
                scene(tree.to_string().as_bytes(), &mut random)
            }
            Parser::GltfText => scene(&self.mutated(&mut random), &mut random),
            Parser::Glb => {
                let glb = if random.below(2) == 0 {
                    self.mutated(&mut random)
                } else {
                    with_other_json(random.pick(&self.seeds).clone(), &mut random)
                };
                scene(&glb, &mut random)
            }
            Parser::Textures => {
                let picture = self.mutated(&mut random);
                scene(&textured(&picture), &mut random)
            }
            Parser::Environment => {
                self.write(&mut random)
                    && load_environment(&self.file, 1.0).is_ok_and(|(map, _)| {
                        assert_eq!(map.radiance.len(), map.width as usize * map.height as usize);
                        assert!(
                            map.radiance
                                .as_flattened()
                                .iter()
                                .all(|x| x.is_finite() && *x >= 0.0)
                        );
                        true
                    })
            }
            Parser::Pictures => {
                self.write(&mut random)
                    && read_image(&self.file).is_ok_and(|picture| {
                        assert_eq!(
                            picture.pixels.len(),
                            picture.width as usize * picture.height as usize
                        );
                        true
                    })
            }
            Parser::Trace => self.write(&mut random) && replay(&self.file),
            Parser::Headset => text(&self.mutated(&mut random))
                .is_some_and(|text| one_line(Headset::from_toml("profile", &text)).is_some()),
            Parser::Actions => text(&self.mutated(&mut random))
                .is_some_and(|text| one_line(Actions::parse("actions", &text)).is_some()),
            Parser::Settings => text(&self.mutated(&mut random)).is_some_and(|text| {
                let mut layers = Layers::default();
                one_line(layers.add_toml(&text, "settings")).is_some() && layers.finish().is_ok()
            }),
            Parser::Set => {
                let settings: Vec<_> = stereolux::settings::registry::all().collect();
                let mut argument = format!("{}=1", random.pick(&settings).key).into_bytes();
                mutate::bytes(&mut argument, b"", &mut random);
                text(&argument).is_some_and(|text| {
                    let mut layers = Layers::default();
                    one_line(layers.add_set(&text)).is_some() && layers.finish().is_ok()
                })
            }
            Parser::Journal => {
                self.write(&mut random)
                    && one_line(Journal::open(&self.file)).is_some_and(|rows| !rows.is_empty())
            }
            Parser::Layout => {
                let is_written = self.write(&mut random);
                let state = WindowState::load(&self.file);
                assert!(state.size.iter().all(|side| side.is_finite()));
                assert!((0.0..=1.0).contains(&state.divider));
                is_written
            }
            Parser::Edits => edits(random.pick(&self.scenes), &mut random),
            Parser::Runtime => answers(&mut random),
        }
    }

    fn mutated(&self, random: &mut Random) -> Vec<u8> {
        let mut bytes = random.pick(&self.seeds).clone();
        let other = random.pick(&self.seeds);
        mutate::bytes(&mut bytes, other, random);
        bytes
    }

    fn write(&self, random: &mut Random) -> bool {
        std::fs::write(&self.file, self.mutated(random)).is_ok()
    }
}

fn text(bytes: &[u8]) -> Option<String> {
    String::from_utf8(bytes.to_vec()).ok()
}

/// The result; what stands in its way must be one line.
fn one_line<T, E: std::fmt::Display>(result: Result<T, E>) -> Option<T> {
    match result {
        Ok(value) => Some(value),
        Err(error) => {
            let line = error.to_string();
            assert!(!line.chars().any(char::is_control), "{line:?}");
            None
        }
    }
}

/// Reads a scene and does with it what the commands do, short of rendering.
fn scene(bytes: &[u8], random: &mut Random) -> bool {
    let Some(scene) = one_line(Scene::from_bytes("fuzzed", bytes)) else {
        return false;
    };
    assert!(
        scene
            .warnings
            .iter()
            .all(|line| !line.chars().any(char::is_control) && line.chars().count() <= 300)
    );
    let _ = Needs::of(&scene);
    assert!(scene.surface_area_m2().is_finite());
    let _ = (scene.bounds_in_world(), scene.start_pose());
    for (_, world_from_node) in scene.placed_nodes() {
        assert!(world_from_node.is_finite());
    }
    for mesh in &scene.meshes {
        let (vertices, materials) = (mesh.positions.len(), scene.materials.len());
        for triangle in &mesh.triangles {
            assert!(
                triangle
                    .vertices
                    .iter()
                    .all(|vertex| (*vertex as usize) < vertices)
            );
            assert!((triangle.material as usize) < materials);
        }
        assert!(mesh.positions.as_flattened().iter().all(|x| x.is_finite()));
        assert!(mesh.normals.as_flattened().iter().all(|x| x.is_finite()));
    }
    if scene
        .meshes
        .iter()
        .map(|mesh| mesh.triangles.len())
        .sum::<usize>()
        < 100_000
    {
        let marks: Vec<MaterialMarks> = scene.materials.iter().map(MaterialMarks::from).collect();
        let _ = one_line(MeshHierarchies::build(&scene.meshes, &marks));
    }
    if random.below(4) == 0 {
        let original = Original::new("fuzzed", bytes.to_vec(), &scene);
        let document = Document::new(scene, original);
        if let Some(saved) = one_line(document.to_glb()) {
            let again = Scene::from_bytes("saved", &saved);
            assert!(again.is_ok(), "{:?}", again.map(|_| ()));
        }
    }
    true
}

/// A GLB with its JSON changed as a tree.
fn with_other_json(glb: Vec<u8>, random: &mut Random) -> Vec<u8> {
    let length = glb
        .get(12..16)
        .and_then(|word| Some(u32::from_le_bytes(word.try_into().ok()?) as usize));
    let parts =
        length.and_then(|length| Some((glb.get(20..20 + length)?, glb.get(20 + length..)?)));
    let Some((json, rest)) = parts else {
        return glb;
    };
    let Ok(mut tree) = serde_json::from_slice::<Value>(json) else {
        return glb;
    };
    mutate::json(&mut tree, random);
    // What follows is a chunk, behind its length and its kind.
    let bin = rest.get(8..).unwrap_or_default().to_vec();
    assemble(tree.to_string().into_bytes(), bin).unwrap_or_default()
}

/// A GLB whose one material shows a picture.
fn textured(picture: &[u8]) -> Vec<u8> {
    let json = format!(
        r#"{{"asset":{{"version":"2.0"}},"scenes":[{{"nodes":[0]}}],"nodes":[{{"mesh":0}}],"meshes":[{{"primitives":[{{"attributes":{{"POSITION":0}},"material":0}}]}}],"accessors":[{{"componentType":5126,"count":3,"type":"VEC3"}}],"materials":[{{"pbrMetallicRoughness":{{"baseColorTexture":{{"index":0}}}}}}],"textures":[{{"source":0}}],"images":[{{"bufferView":0}}],"bufferViews":[{{"buffer":0,"byteLength":{length}}}],"buffers":[{{"byteLength":{length}}}]}}"#,
        length = picture.len()
    );
    assemble(json.into_bytes(), picture.to_vec()).unwrap_or_default()
}

fn replay(path: &Path) -> bool {
    let Ok(headset) = Headset::load("symmetric") else {
        return false;
    };
    let mut options = ReplayOptions::new(headset, Pose::IDENTITY);
    options.frame_limit = Some(20);
    let Some(mut session) = one_line(ReplaySession::open(path, options)) else {
        return false;
    };
    while let Some(Some(state)) = one_line(session.wait_frame()) {
        let time = state.predicted_display_time_ns;
        let _ = session.begin_frame();
        if let Some(Some(views)) = one_line(session.locate_views(time)) {
            assert!(check_views(&views).is_ok());
        }
        let _ = session.end_frame(stereolux::xr::FrameSubmission::new(time, None));
    }
    true
}

fn wild(random: &mut Random) -> f64 {
    const NUMBERS: [f64; 16] = [
        0.0,
        1.0,
        -1.0,
        0.5,
        2.0,
        1e-30,
        1e30,
        -1e30,
        1e300,
        1e-300,
        3.5e38,
        f64::NAN,
        f64::INFINITY,
        f64::NEG_INFINITY,
        0.1,
        100.0,
    ];
    *random.pick(&NUMBERS)
}

fn triple(random: &mut Random) -> DVec3 {
    DVec3::new(wild(random), wild(random), wild(random))
}

fn placement(random: &mut Random) -> Placement {
    if random.below(2) == 0 {
        return Placement::Matrix(DAffine3::from_cols(
            triple(random),
            triple(random),
            triple(random),
            triple(random),
        ));
    }
    Placement::Parts(Trs {
        translation: triple(random),
        rotation: DQuat::from_xyzw(wild(random), wild(random), wild(random), wild(random)),
        scale: triple(random),
    })
}

fn light(random: &mut Random) -> PunctualLight {
    let kinds = [
        LightKind::Point,
        LightKind::Directional,
        LightKind::Spot {
            inner_cone_rad: wild(random) as f32,
            outer_cone_rad: wild(random) as f32,
        },
    ];
    PunctualLight {
        name: "light".to_owned(),
        kind: *random.pick(&kinds),
        intensity: triple(random).as_vec3().to_array(),
    }
}

fn edit(scene: &Scene, random: &mut Random) -> Edit {
    // Now and then one beyond the end.
    let node = random.below(scene.nodes.len() + 2);
    let material = random.below(scene.materials.len() + 1);
    let mesh = random.below(scene.meshes.len() + 1);
    match random.below(12) {
        0 => Edit::Transform {
            node,
            to: placement(random),
        },
        1 => Edit::Visibility {
            node,
            is_hidden: random.below(2) == 0,
        },
        2 => Edit::Rename {
            node,
            name: "\u{1b}[2J".repeat(random.below(4)),
        },
        3 => {
            let mut to = scene.materials.first().cloned().unwrap_or_default();
            to.roughness = wild(random) as f32;
            to.emission = triple(random).as_vec3().to_array();
            to.ior = wild(random) as f32;
            Edit::Material {
                material,
                to: Box::new(to),
            }
        }
        4 => Edit::OwnMaterial { mesh, material },
        5 => Edit::Light {
            light: random.below(3),
            to: light(random),
        },
        6 => {
            let content = match random.below(3) {
                0 => NewContent::Empty,
                1 => NewContent::Light(light(random)),
                _ => NewContent::Mesh(mesh),
            };
            let parent = (random.below(2) == 0).then_some(node);
            Edit::Add {
                parent,
                node: NewNode {
                    name: String::new(),
                    to: placement(random),
                    content,
                },
            }
        }
        7 => Edit::Delete { node },
        8 => Edit::Duplicate { node },
        9 => Edit::Truncate {
            nodes: random.below(4),
            lights: random.below(3),
        },
        10 => Edit::Attach {
            node,
            parent: (random.below(2) == 0).then_some(random.below(8)),
            position: random.below(4),
        },
        _ => Edit::SharedMaterial { mesh },
    }
}

/// Edits, undone and done again; what was refused leaves the scene as it was.
fn edits(scene: &Scene, random: &mut Random) -> bool {
    let mut document = Document::new(scene.clone(), Original::default());
    let mut accepted = 0;
    for _ in 0..=random.below(12) {
        let next = edit(document.scene(), random);
        let before = document.scene().nodes.len();
        match document.edit(next) {
            Ok(()) => accepted += 1,
            Err(_) => assert_eq!(document.scene().nodes.len(), before),
        }
        if random.below(5) == 0 {
            let _ = document.undo();
            let _ = document.redo();
        }
        if document.scene().nodes.len() > 500 {
            break;
        }
    }
    for (_, world_from_node) in document.scene().placed_nodes() {
        assert!(!world_from_node.is_nan());
    }
    while matches!(document.undo(), Ok(true)) {}
    assert!(
        document.scene() == scene,
        "undone edits leave the scene as it was"
    );
    accepted > 0
}

/// What a runtime may say of eyes and lenses.
fn answers(random: &mut Random) -> bool {
    // Something that is right, with a few numbers in it that are not.
    let mut or_wild = |right: f64| {
        if random.below(24) == 0 {
            wild(random)
        } else {
            right
        }
    };
    let mut view = || View {
        position_in_world: DVec3::new(or_wild(0.1), or_wild(1.6), or_wild(0.0)),
        orientation: DQuat::from_xyzw(or_wild(0.0), or_wild(0.0), or_wild(0.0), or_wild(1.0)),
        fov: Fov {
            angle_left: or_wild(-0.7),
            angle_right: or_wild(0.7),
            angle_up: or_wild(0.8),
            angle_down: or_wild(-0.8),
        },
    };
    let located = LocatedViews::valid([view(), view()]);
    let is_valid = check_views(&located).is_ok_and(|good| {
        assert!(
            good.views
                .iter()
                .all(|view| view.position_in_world.is_finite())
        );
        true
    });
    let corners: Vec<[f64; 2]> = (0..random.below(12))
        .map(|_| [wild(random), wild(random)])
        .collect();
    let indices: Vec<u32> = (0..random.below(60))
        .map(|_| random.below(corners.len() + 2) as u32)
        .collect();
    let area = HiddenArea::from_mesh(&corners, &indices);
    let fov = Fov::from_degrees(-40.0, 40.0, 40.0, -40.0);
    let bits = area.pixels(&fov.tangents(), [33, 17]);
    assert_eq!(bits.len(), (33 * 17_usize).div_ceil(32));
    is_valid
}
