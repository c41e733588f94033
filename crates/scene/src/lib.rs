//! Scenes: glTF 2.0 import, embedded scenes, environments, and what a scene needs from the renderer.
//!
//! [`Scene::load`] reads `.gltf` and `.glb`; [`Scene::builtin`] makes an embedded scene, which passes through the same
//! importer. Both give one flat [`Scene`]: nodes with f64 transforms, meshes with every vertex array filled in,
//! materials in glTF's terms. Nothing here touches the GPU.
//!
//! - [`Scene`], [`Node`], [`Mesh`], [`Material`] and their parts are the types that the renderer uploads from.
//! - `import` turns glTF into them; every fault in the file is one line of [`SceneError`], never a panic.
//! - [`builtin`] holds the embedded scenes.
//! - [`environment`] reads equirectangular maps.
//! - [`edit`] changes a scene step by step, with undo and redo; `save` writes it back. `part` adds whole scenes.
//! - [`needs`] says which features a scene really uses, and what is left out.

pub mod animation;
pub mod builtin;
mod check;
pub mod deform;
mod demand;
pub mod edit;
pub mod environment;
mod error;
mod generated;
pub mod gltf_writer;
mod import;
mod material;
mod mesh;
pub mod mesh_statistics;
pub mod needs;
mod panes;
mod part;
mod player;
mod pose;
mod save;
mod subtree;
pub mod surroundings;

use std::path::Path;

use glam::{BVec3, DAffine3, DMat3, DQuat, DVec3};
use stereolux_base::limits::LoadBudget;

pub use animation::{Animation, Trs};
pub use deform::{Deformation, MorphTarget, Skin, VertexJoints};
pub use environment::{Environment, load_environment, load_environment_within};
pub use error::SceneError;
pub use material::{AlphaMode, Filter, Image, Material, Texture, TextureRef, Wrap};
pub use mesh::{Mesh, MeshTriangle};
pub use mesh_statistics::SceneStatistics;
pub use needs::{LeftOut, Motion, Needs};
pub use part::ScenePart;
pub use player::Player;
pub use pose::ScenePose;

use stereolux_base::pose::Pose;

/// A scene in memory. Indices between the lists are always in range, transforms are finite; those in the world,
/// too, and within f32. What a transform that cannot be inverted flattens is out of sight.
///
/// Fields may be added: make one with `Scene { ..., ..Scene::default() }`.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Scene {
    /// File stem, or `builtin:NAME`.
    pub name: String,
    /// All nodes of the file; those that the chosen glTF scene does not reach have no path from `roots`.
    pub nodes: Vec<Node>,
    /// Root nodes of the chosen glTF scene.
    pub roots: Vec<usize>,
    /// Meshes, shared by instances.
    pub meshes: Vec<Mesh>,
    /// Materials; `MeshTriangle::material` indexes them.
    pub materials: Vec<Material>,
    /// Textures that materials refer to.
    pub textures: Vec<Texture>,
    /// Images that textures refer to.
    pub images: Vec<Image>,
    /// Lights of KHR_lights_punctual.
    pub lights: Vec<PunctualLight>,
    /// Cameras.
    pub cameras: Vec<Camera>,
    /// Skins that nodes refer to.
    pub skins: Vec<Skin>,
    /// Animations of the file.
    pub animations: Vec<Animation>,
    /// Parts that were added and are there ([`Scene::add_part`]).
    pub parts: Vec<u64>,
    /// Parts that were taken out ([`Scene::remove_part`]) and whose empty entries still hold the numbers behind them.
    pub vacant: Vec<ScenePart>,
    /// What rays see that leave the scene; black without one.
    pub environment: Option<Environment>,
    /// One line each: things in the file that are repaired, ignored or approximated.
    pub warnings: Vec<String>,
    /// Facts about the file that the renderer does not model but reports.
    pub source: SourceFacts,
}

/// What the importer saw in the file and did not turn into scene data.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SourceFacts {
    /// Kinds of motion that the file describes.
    pub motion: Motion,
    /// Features of the file that are not modelled.
    pub left_out: Vec<LeftOut>,
    /// Files outside the scene's own folder that were read, because `limits.allow_outside` says so; the first hundred.
    pub outside_files: Vec<String>,
    /// Lights, or glowing meshes, of more power than the renderer can count.
    pub too_bright_lights: usize,
}

/// A node of the transform tree.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Node {
    /// Name in the file, or `node N`.
    pub name: String,
    /// Parent index; none for roots.
    pub parent: Option<usize>,
    /// Child indices.
    pub children: Vec<usize>,
    /// Local transform.
    pub parent_from_node: DAffine3,
    /// The same in parts, where the file or an edit gave them and not a matrix: [`Node::trs`] reads them.
    pub parts: Option<Trs>,
    /// Index into [`Scene::meshes`].
    pub mesh: Option<usize>,
    /// Index into [`Scene::lights`].
    pub light: Option<usize>,
    /// Index into [`Scene::cameras`].
    pub camera: Option<usize>,
    /// Index into [`Scene::skins`].
    pub skin: Option<usize>,
    /// Weights of its mesh's morph targets, where no animation says otherwise.
    pub morph_weights: Vec<f64>,
    /// Neither the node nor anything below it is shown, meshes and lights alike (KHR_node_visibility); cameras stay.
    pub is_hidden: bool,
}

impl Node {
    /// A node without a name that shows a mesh where its parent is.
    #[must_use]
    pub fn of_mesh(mesh: usize) -> Self {
        Self {
            mesh: Some(mesh),
            ..Self::default()
        }
    }

    /// The local transform in parts: as given, else the matrix taken apart, which loses shear.
    pub fn trs(&self) -> Trs {
        self.exact_parts()
            .unwrap_or_else(|| Trs::of(&self.parent_from_node))
    }

    /// The parts as given, if they make exactly the local transform.
    pub fn exact_parts(&self) -> Option<Trs> {
        self.parts
            .filter(|parts| parts.parent_from_node() == self.parent_from_node)
    }
}

/// A mesh placed in the world.
#[derive(Clone, Copy, Debug)]
pub struct Instance {
    /// Index into [`Scene::nodes`].
    pub node: usize,
    /// Index into [`Scene::meshes`].
    pub mesh: usize,
    /// Placement.
    pub world_from_object: DAffine3,
}

/// A punctual light placed in the world. It shines along its local -Z.
#[derive(Clone, Copy, Debug)]
pub struct LightInstance {
    /// Index into [`Scene::nodes`].
    pub node: usize,
    /// Index into [`Scene::lights`].
    pub light: usize,
    /// Placement. glTF leaves intensity alone under scaling, so only rotation and translation count.
    pub world_from_light: DAffine3,
}

/// A light of KHR_lights_punctual. `range` is a culling hint there and is ignored.
#[derive(Clone, Debug, PartialEq)]
pub struct PunctualLight {
    /// Name in the file, or `light N`.
    pub name: String,
    /// Kind and cone.
    pub kind: LightKind,
    /// Colour times intensity, linear RGB: W/sr for point and spot, W/m^2 at normal incidence for directional.
    pub intensity: [f32; 3],
}

/// Kind of punctual light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum LightKind {
    /// Shines equally in every direction.
    Point,
    /// A point light in a cone around local -Z.
    Spot {
        /// Half angle of full intensity, 0 to `outer_cone_rad`.
        inner_cone_rad: f32,
        /// Half angle where the intensity has fallen to 0, up to pi / 2.
        outer_cone_rad: f32,
    },
    /// Parallel light along local -Z from infinitely far.
    Directional,
}

/// A glTF camera. Only its placement and vertical opening are used.
#[derive(Clone, Debug, PartialEq)]
pub struct Camera {
    /// Name in the file, or `camera N`.
    pub name: String,
    /// Full vertical angle of view; none for orthographic cameras.
    pub yfov_rad: Option<f32>,
}

/// Axis-aligned box, metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bounds {
    /// Least corner.
    pub min: DVec3,
    /// Greatest corner.
    pub max: DVec3,
}

impl Bounds {
    /// Middle of the box.
    pub fn center(&self) -> DVec3 {
        self.min * 0.5 + self.max * 0.5
    }

    /// Edge lengths.
    pub fn size(&self) -> DVec3 {
        self.max - self.min
    }

    /// The box around this one's corners where an affine map takes them: larger than what it holds needs, where it turns.
    pub fn transformed(&self, outer_from_own: &DAffine3) -> Self {
        let corners = (0..8).map(|corner| {
            let is_upper = [0, 1, 2].map(|axis| corner >> axis & 1 == 1);
            let corner = DVec3::select(BVec3::from_array(is_upper), self.max, self.min);
            outer_from_own.transform_point3(corner)
        });
        Self::of_points(corners).unwrap_or(*self)
    }

    /// The smallest box that holds `boxes`; none if there are none.
    pub fn around(boxes: impl IntoIterator<Item = Self>) -> Option<Self> {
        let corners = boxes.into_iter().flat_map(|one| [one.min, one.max]);
        Self::of_points(corners)
    }

    /// The smallest box that holds `points`; none if there are none.
    pub fn of_points(points: impl IntoIterator<Item = DVec3>) -> Option<Self> {
        points
            .into_iter()
            .fold(None, |bounds: Option<Self>, point| {
                Some(match bounds {
                    None => Self {
                        min: point,
                        max: point,
                    },
                    Some(b) => Self {
                        min: b.min.min(point),
                        max: b.max.max(point),
                    },
                })
            })
    }
}

impl Scene {
    /// Reads a `.gltf` or `.glb` file with everything it refers to, which must lie below the file's own folder. Takes as much
    /// memory as a load may by default.
    ///
    /// # Errors
    /// One line that names the file, the part at fault and how to mend it: unreadable file, broken container or JSON,
    /// index out of range, data that does not fit its buffer, vertices that are not finite, a node graph that is not a
    /// tree, a transform that is not finite, an extension that is required and not supported, a file outside the folder, more than
    /// the memory allows.
    pub fn load(path: impl AsRef<Path>) -> Result<Self, SceneError> {
        Self::load_within(path, &LoadBudget::default())
    }

    /// As [`Scene::load`], taking and reaching what `budget` allows.
    ///
    /// # Errors
    /// As [`Scene::load`].
    pub fn load_within(path: impl AsRef<Path>, budget: &LoadBudget) -> Result<Self, SceneError> {
        let path = path.as_ref();
        let bytes = import::read_file(path, budget)?;
        import::from_bytes(path, &bytes, budget)
    }

    /// Imports a `.glb` or self-contained `.gltf` held in memory. Files that it names must lie below the working directory.
    ///
    /// # Errors
    /// As [`Scene::load`]; `name` stands where the path would.
    pub fn from_bytes(name: &str, bytes: &[u8]) -> Result<Self, SceneError> {
        import::from_bytes(Path::new(name), bytes, &LoadBudget::default())
    }

    /// As [`Scene::from_bytes`], of what names no files at all.
    ///
    /// # Errors
    /// As [`Scene::from_bytes`]; a file that it names.
    pub fn self_contained(name: &str, bytes: &[u8]) -> Result<Self, SceneError> {
        import::self_contained(Path::new(name), bytes)
    }

    /// Makes an embedded scene, by name with or without the prefix `builtin:`.
    ///
    /// # Errors
    /// An unknown name; the message lists those there are.
    pub fn builtin(name: &str) -> Result<Self, SceneError> {
        Self::builtin_within(name, &LoadBudget::default())
    }

    /// As [`Scene::builtin`], taking what `budget` allows.
    ///
    /// # Errors
    /// As [`Scene::builtin`]; more than that.
    pub fn builtin_within(name: &str, budget: &LoadBudget) -> Result<Self, SceneError> {
        builtin::load(name, budget)
    }

    /// Gives all triangles of the meshes named `mesh` a material of their own, wherever they are placed. Returns how many
    /// triangles that were; for 0 no such mesh exists and the scene is as it was.
    pub fn paint(&mut self, mesh: &str, material: Material) -> usize {
        let added = self.materials.len() as u32;
        let mut painted = 0;
        for mesh in self.meshes.iter_mut().filter(|found| found.name == mesh) {
            painted += mesh.triangles.len();
            for triangle in &mut mesh.triangles {
                let before = std::mem::replace(&mut triangle.material, added);
                if before != added && !mesh.repainted.contains(&[before, added]) {
                    mesh.repainted.push([before, added]);
                }
            }
        }
        if painted > 0 {
            self.materials.push(material);
        }
        painted
    }

    /// World placement of every node that the scene reaches, depth first: `(node, world_from_node)`. Hidden ones too.
    pub fn placed_nodes(&self) -> Vec<(usize, DAffine3)> {
        self.placed(|_| true)
    }

    /// As [`Scene::placed_nodes`], without the nodes that are hidden and those below them.
    pub fn shown_nodes(&self) -> Vec<(usize, DAffine3)> {
        self.placed(|node| !node.is_hidden)
    }

    fn placed(&self, admits: impl Fn(&Node) -> bool) -> Vec<(usize, DAffine3)> {
        self.below(&self.roots, DAffine3::IDENTITY, admits)
    }

    /// Placements of nodes that hang side by side in `world_from_parent`, and of all below them, depth first; not of those that
    /// are not admitted, and what is below them.
    pub(crate) fn below(
        &self,
        nodes: &[usize],
        world_from_parent: DAffine3,
        admits: impl Fn(&Node) -> bool,
    ) -> Vec<(usize, DAffine3)> {
        let mut placed = Vec::with_capacity(self.nodes.len());
        let roots = nodes.iter().rev().map(|node| (*node, world_from_parent));
        let mut pending: Vec<_> = roots.collect();
        while let Some((index, world_from_parent)) = pending.pop() {
            let Some(node) = self.nodes.get(index).filter(|node| admits(node)) else {
                continue;
            };
            let world_from_node = world_from_parent * node.parent_from_node;
            placed.push((index, world_from_node));
            let children = node.children.iter().rev();
            pending.extend(children.map(|child| (*child, world_from_node)));
        }
        placed
    }

    /// Every mesh that is placed, not hidden and holds at least one triangle, as the file has it. A skinned one's space is
    /// that of [`Scene::deformation`].
    pub fn instances(&self) -> Vec<Instance> {
        let rest = (!self.skins.is_empty()).then(|| self.rest_pose());
        self.shown_nodes()
            .into_iter()
            .filter_map(|(node, world_from_node)| {
                let mesh = self.nodes.get(node)?.mesh?;
                let holds_triangles = !self.meshes.get(mesh)?.triangles.is_empty();
                let world_from_object = match &rest {
                    Some(rest) if self.nodes.get(node)?.skin.is_some() => {
                        self.deformation(node, rest).world_from_object
                    }
                    _ => world_from_node,
                };
                holds_triangles.then_some(Instance {
                    node,
                    mesh,
                    world_from_object,
                })
            })
            .collect()
    }

    /// Every punctual light that is placed and not hidden.
    pub fn light_instances(&self) -> Vec<LightInstance> {
        self.shown_nodes()
            .into_iter()
            .filter_map(|(node, world_from_light)| {
                let light = self.nodes.get(node)?.light?;
                Some(LightInstance {
                    node,
                    light,
                    world_from_light,
                })
            })
            .collect()
    }

    /// Triangles over all instances.
    pub fn triangle_count(&self) -> usize {
        self.instances()
            .iter()
            .map(|instance| self.meshes[instance.mesh].triangles.len())
            .sum()
    }

    /// Box around every triangle in the world; none for a scene without triangles.
    pub fn bounds_in_world(&self) -> Option<Bounds> {
        let rest = self.rest_pose();
        let boxes = self.instances().into_iter().filter_map(|instance| {
            let mesh = &self.meshes[instance.mesh];
            Bounds::of_points(self.positions_in_world(instance.node, mesh, &rest))
        });
        Bounds::around(boxes)
    }

    /// Middle of the box around the triangles that hang on a node and below it, in their rest pose; the node's origin if
    /// there are none. Metres in the world, in which `world_from_node` places the node.
    pub fn center_of_node(&self, node: usize, world_from_node: &DAffine3) -> DVec3 {
        let children = self.nodes.get(node).map_or(&[][..], |node| &node.children);
        let below = self.below(children, *world_from_node, |_| true);
        let placed = std::iter::once((node, *world_from_node)).chain(below);
        let rest = self.rest_pose();
        let boxes = placed.filter_map(|(index, world_from_node)| {
            let mesh = self.meshes.get(self.nodes.get(index)?.mesh?)?;
            let deformation = self.deformation(index, &rest);
            let world_from_object = match self.skin_of(index) {
                // Its joints place it.
                Some(_) => deformation.world_from_object,
                None => world_from_node,
            };
            let positions = deformation.positions(mesh).into_iter();
            Bounds::of_points(
                positions.map(|position| world_from_object.transform_point3(position)),
            )
        });
        Bounds::around(boxes).map_or(world_from_node.translation, |bounds| bounds.center())
    }

    /// Area of all triangles in the world, m^2, front sides only.
    pub fn surface_area_m2(&self) -> f64 {
        let rest = self.rest_pose();
        let area_m2 = |instance: &Instance| {
            let mesh = &self.meshes[instance.mesh];
            let positions = self.positions_in_world(instance.node, mesh, &rest);
            let triangles = mesh.triangles.iter().map(|triangle| {
                let [a, b, c] = triangle.vertices.map(|vertex| positions[vertex as usize]);
                0.5 * (b - a).cross(c - a).length()
            });
            triangles.sum::<f64>()
        };
        self.instances().iter().map(area_m2).sum()
    }

    /// Where the head starts, `world_from_head`: the pose of the first glTF camera as it stands, else a level pose outside the scene,
    /// slightly above its middle and looking along -Z, from which it fits into +-45 degrees.
    pub fn start_pose(&self) -> Pose {
        self.camera_pose().unwrap_or_else(|| self.framing_pose())
    }

    /// The placed camera with the least index, if there is one: its number and its transform.
    fn placed_camera(&self) -> Option<(usize, DAffine3)> {
        self.placed_nodes()
            .into_iter()
            .filter_map(|(node, world_from_node)| Some((self.nodes[node].camera?, world_from_node)))
            .min_by_key(|(camera, _)| *camera)
    }

    /// The camera whose pose [`Scene::start_pose`] is; `None` if the scene has none.
    pub fn start_camera(&self) -> Option<&Camera> {
        self.cameras.get(self.placed_camera()?.0)
    }

    /// Pose of that camera (scaling taken out).
    fn camera_pose(&self) -> Option<Pose> {
        let (_, world_from_camera) = self.placed_camera()?;
        Some(Pose {
            position: world_from_camera.translation,
            orientation: rotation_of(world_from_camera.matrix3),
        })
    }

    /// Takes the file's unit of length for `metres_per_unit` metres: everything is placed below one more node that scales
    /// it. Intensities of lights stay as they are.
    pub fn scale(&mut self, metres_per_unit: f64) {
        if metres_per_unit == 1.0 {
            return;
        }
        let root = self.nodes.len();
        for child in &self.roots {
            self.nodes[*child].parent = Some(root);
        }
        self.nodes.push(Node {
            name: "scene scale".to_owned(),
            children: std::mem::replace(&mut self.roots, vec![root]),
            parent_from_node: DAffine3::from_scale(DVec3::splat(metres_per_unit)),
            ..Node::default()
        });
        for material in &mut self.materials {
            material.attenuation_distance_m *= metres_per_unit as f32;
        }
    }

    /// What is wrong with the scene's size for a pair of eyes, with a factor that mends it; one line. `None` if nothing is,
    /// or if the head starts inside.
    pub fn size_warning(&self) -> Option<String> {
        // At 20 m the eyes, 63 mm apart, see a point 0.2 degrees apart: 3 to 4 pixels of a headset, and less beyond.
        const FAR_M: f64 = 20.0;
        // Eyes cannot turn towards what is nearer.
        const NEAR_M: f64 = 0.07;
        let bounds = self.bounds_in_world()?;
        let head = self.start_pose().position;
        let nearest = head.clamp(bounds.min, bounds.max);
        let distance_m = nearest
            .distance(head)
            .max(nearest.distance(bounds.center()));
        let size_m = bounds.size().max_element();
        let is_inside = nearest == head;
        if is_inside || size_m <= 0.0 || (NEAR_M..=FAR_M).contains(&distance_m) {
            return None;
        }
        // What the setting takes.
        let factor = 10_f64.powf((1.0 / size_m).log10().round()).min(1e8);
        if factor == 1.0 {
            // A camera that looks on from afar.
            return None;
        }
        let why = match distance_m > FAR_M {
            true => "from where it fits the view both eyes see the same",
            false => "it fits the view only nearer than eyes can look",
        };
        let size = if size_m < 0.001 {
            format!("{size_m:.1e}")
        } else {
            format!("{size_m:.3}")
        };
        Some(format!(
            "the scene is {size} m large, so that {why}; if its unit is no metre, give --scene-scale {factor}"
        ))
    }

    fn framing_pose(&self) -> Pose {
        /// How far above the middle the eye stands, as a share of the height, or of the width or depth of what has next to none.
        const LIFT: f64 = 0.1;
        const FLAT: f64 = 0.01;
        /// Room between the picture's border and the scene.
        const MARGIN: f64 = 1.05;
        let Some(bounds) = self.bounds_in_world() else {
            return Pose::IDENTITY;
        };
        let size = bounds.size();
        // The nearest face fills most of the view; tan(45 deg) = 1, so the distance is the half extent seen.
        let half_extent = (0.5 * size.x).max((0.5 + LIFT) * size.y).max(1e-3 * size.z);
        let distance = if half_extent > 0.0 {
            MARGIN * half_extent
        } else {
            1.0
        };
        let center = bounds.center();
        let broad = size.max_element();
        let lift = LIFT * if size.y < FLAT * broad { broad } else { size.y };
        Pose {
            position: DVec3::new(center.x, center.y + lift, bounds.max.z + distance),
            orientation: DQuat::IDENTITY,
        }
    }
}

/// The rotation nearest to a camera's axes: -Z kept, +Y made perpendicular to it.
fn rotation_of(world_from_camera: DMat3) -> DQuat {
    let backward = world_from_camera.z_axis.normalize_or(DVec3::Z);
    let right = world_from_camera
        .y_axis
        .cross(backward)
        .normalize_or(backward.any_orthonormal_vector());
    let up = backward.cross(right);
    DQuat::from_mat3(&DMat3::from_cols(right, up, backward)).normalize()
}

/// Widens a vector.
pub fn as_dvec3(v: [f32; 3]) -> DVec3 {
    DVec3::new(f64::from(v[0]), f64::from(v[1]), f64::from(v[2]))
}
