//! What is worth remembering of a scene's triangles and texels, so that an edit need not look at them again.

use std::collections::HashMap;
use std::sync::OnceLock;

use glam::{DMat3, DVec3};

use super::deform::cofactor;
use super::{Bounds, Image, Mesh, Scene, ScenePart, as_dvec3};

/// Statistics of all meshes and images of a scene. Edits change them only where [`Mesh::repainted`] does.
#[derive(Clone, Debug, Default)]
pub struct SceneStatistics {
    /// One per mesh.
    pub meshes: Vec<MeshStatistics>,
    least_alpha: Vec<OnceLock<u8>>,
}

/// Statistics of one mesh.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct MeshStatistics {
    /// Number of triangles.
    pub triangles: usize,
    /// Materials of its triangles, each once, by index.
    pub uses: Vec<MaterialUse>,
    /// Vertex colours other than white.
    pub has_tints: bool,
    /// Object space; none without vertices.
    pub bounds: Option<Bounds>,
    area: AreaSketch,
}

/// What a mesh has of one material.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MaterialUse {
    /// Index into [`Scene::materials`].
    pub material: usize,
    /// Triangles that have it.
    pub triangles: usize,
    /// A vertex of them has a colour that lets light through.
    pub is_translucent: bool,
}

impl SceneStatistics {
    /// Looks at every triangle once. Images are looked at when they are asked for.
    pub fn of(scene: &Scene) -> Self {
        Self {
            meshes: scene.meshes.iter().map(MeshStatistics::of).collect(),
            least_alpha: scene.images.iter().map(|_| OnceLock::new()).collect(),
        }
    }

    /// Appends those of a part of `scene` whose lists end with it, made over the part alone.
    pub fn add_part(&mut self, own: &Self, part: &ScenePart) {
        let first = part.materials.start;
        self.meshes
            .extend(own.meshes.iter().cloned().map(|mut mesh| {
                for part in &mut mesh.uses {
                    part.material += first;
                }
                mesh
            }));
        self.least_alpha.extend(own.least_alpha.iter().cloned());
    }

    /// Forgets a part that was taken out; `scene` is what is left.
    pub fn remove_part(&mut self, scene: &Scene, part: &ScenePart) {
        self.meshes[part.meshes.clone()].fill(MeshStatistics::default());
        self.meshes.truncate(scene.meshes.len());
        self.least_alpha[part.images.clone()].fill(OnceLock::new());
        self.least_alpha.truncate(scene.images.len());
    }

    /// Looks at all images, so that nobody has to wait for that later.
    pub fn look_at_images(&self, scene: &Scene) {
        for (index, image) in scene.images.iter().enumerate() {
            self.least_alpha(index, Some(image));
        }
    }

    /// The least alpha of an image's texels; 255 if there is none of that number.
    pub fn least_alpha(&self, index: usize, image: Option<&Image>) -> u8 {
        let look = || {
            let texels = image.map_or(&[][..], |image| &image.rgba8);
            let alphas = texels.chunks_exact(4).map(|texel| texel[3]);
            alphas.min().unwrap_or(255)
        };
        match self.least_alpha.get(index) {
            Some(known) => *known.get_or_init(look),
            None => look(),
        }
    }

    /// Area of all instances in the world, m^2, front sides only, from each mesh's `AreaSketch`: as
    /// [`Scene::surface_area_m2`] where scaling is uniform or faces look along few directions. Meshes that deform count as
    /// their first joint moves them.
    pub fn area_m2(&self, scene: &Scene) -> f64 {
        let rest = scene.rest_pose();
        let area = |instance: &super::Instance| {
            let mut axes = instance.world_from_object.matrix3;
            if scene.deforms(instance.node) {
                let deformation = scene.deformation(instance.node, &rest);
                if let Some(joint) = deformation.object_from_mesh.first() {
                    axes = joint.matrix3;
                }
            }
            let mesh = self.meshes.get(instance.mesh);
            mesh.map_or(0.0, |mesh| mesh.area.under(&axes))
        };
        scene.instances().iter().map(area).sum()
    }

    /// A box around the scene, from the corners of meshes' boxes; meshes that deform count by their vertices.
    pub fn bounds_in_world(&self, scene: &Scene) -> Option<Bounds> {
        loose_bounds(scene, |mesh| self.meshes.get(mesh)?.bounds)
    }
}

/// A box around the scene, from the corners of the boxes that `bounds_of` gives of meshes. It holds everything, is tight
/// where nothing is turned, and needs no vertex of meshes that keep their shape.
pub fn loose_bounds(scene: &Scene, bounds_of: impl Fn(usize) -> Option<Bounds>) -> Option<Bounds> {
    let mut rest = None;
    let boxes = scene.instances().into_iter().filter_map(|instance| {
        if scene.deforms(instance.node) {
            let rest = rest.get_or_insert_with(|| scene.rest_pose());
            let mesh = &scene.meshes[instance.mesh];
            return Bounds::of_points(scene.positions_in_world(instance.node, mesh, rest));
        }
        Some(bounds_of(instance.mesh)?.transformed(&instance.world_from_object))
    });
    Bounds::around(boxes)
}

impl MeshStatistics {
    /// Looks at every triangle of a mesh.
    pub fn of(mesh: &Mesh) -> Self {
        let mut statistics = Self {
            triangles: mesh.triangles.len(),
            has_tints: mesh.has_colors && mesh.colors.iter().any(|color| *color != [1.0; 4]),
            bounds: Bounds::of_points(mesh.positions.iter().copied().map(as_dvec3)),
            ..Self::default()
        };
        let mut place_of = HashMap::new();
        // Neighbours have the same material, mostly.
        let mut last = 0;
        for triangle in &mesh.triangles {
            let material = triangle.material as usize;
            let uses = &mut statistics.uses;
            if uses.get(last).map(|known| known.material) != Some(material) {
                last = *place_of.entry(material).or_insert_with(|| {
                    uses.push(MaterialUse {
                        material,
                        triangles: 0,
                        is_translucent: false,
                    });
                    uses.len() - 1
                });
            }
            let entry = &mut uses[last];
            entry.triangles += 1;
            entry.is_translucent |= mesh.has_colors
                && triangle
                    .vertices
                    .iter()
                    .any(|vertex| mesh.colors[*vertex as usize][3] < 1.0);
            let [a, b, c] = mesh.corners(triangle);
            statistics.area.add(0.5 * (b - a).cross(c - a));
        }
        statistics.uses.sort_by_key(|known| known.material);
        statistics
    }

    /// Whether any triangle has the material.
    pub fn has(&self, material: usize) -> bool {
        self.uses.iter().any(|known| known.material == material)
    }
}

/// Areas of a mesh's triangles by direction, so that its area under any matrix is known without looking at triangles
/// again: exactly (up to rounding) where scaling is uniform, or where each bin's triangles look one way, as a box's do; a
/// sphere that is flattened to a hundredth is 8 % short, and a radius goes with the root of that.
#[derive(Clone, Debug, Default, PartialEq)]
struct AreaSketch {
    /// Sum of area vectors, and of areas, by the signs of the normal's larger components; opposite directions share a bin.
    bins: [(DVec3, f64); 13],
}

impl AreaSketch {
    /// A component counts as 0 below this: tan(pi / 8), between an axis and a diagonal.
    const NARROW: f64 = 0.414_213_562_373_095_05;

    fn add(&mut self, area_vector: DVec3) {
        let area = area_vector.length();
        if !(area > 0.0 && area.is_finite()) {
            return;
        }
        let largest = area_vector.abs().max_element();
        let sign = |x: f64| {
            if x.abs() < Self::NARROW * largest {
                0
            } else if x > 0.0 {
                1
            } else {
                -1_i32
            }
        };
        let code = sign(area_vector.x) + 3 * sign(area_vector.y) + 9 * sign(area_vector.z);
        let (bin, facing) = if code > 0 {
            (code - 1, area_vector)
        } else {
            (-code - 1, -area_vector)
        };
        if let Some((sum, total)) = self.bins.get_mut(bin as usize) {
            *sum += facing;
            *total += area;
        }
    }

    /// Area of the mesh's triangles under `axes`: an area vector goes with the cofactor matrix.
    fn under(&self, axes: &DMat3) -> f64 {
        let carry = cofactor(axes);
        self.bins
            .iter()
            .map(|(sum, area)| area * (carry * sum.normalize_or_zero()).length())
            .sum()
    }
}

#[cfg(test)]
mod tests {
    use glam::DAffine3;

    use super::*;

    fn exact(scene: &Scene) -> f64 {
        scene.surface_area_m2()
    }

    #[test]
    fn areas_are_those_of_the_triangles() {
        for name in ["cornell", "gallery", "sphere", "parade"] {
            let scene = Scene::builtin(name).unwrap();
            let statistics = SceneStatistics::of(&scene);
            // Uniform scaling or faces along the axes: rounding. Parade's meshes bend: a tenth is enough for a radius.
            let most = if name == "parade" { 0.1 } else { 1e-9 };
            let ratio = statistics.area_m2(&scene) / exact(&scene);
            assert!((ratio - 1.0).abs() < most, "{name}: {ratio}");
        }
        // What is left of a flattened sphere is the integral of |cos| to its axis. Of that the band within 22.5 degrees of
        // the equator holds sin^2 = 15 %, and counts for nothing, because its two sides share their bins.
        let mut scene = Scene::builtin("sphere").unwrap();
        let statistics = SceneStatistics::of(&scene);
        for scale in [DVec3::new(1.0, 0.01, 1.0), DVec3::new(3.0, 0.2, 1.0)] {
            for root in scene.roots.clone() {
                scene.nodes[root].parent_from_node = DAffine3::from_scale(scale);
            }
            let ratio = statistics.area_m2(&scene) / exact(&scene);
            assert!((ratio - 1.0).abs() < 0.15, "{scale}: {ratio}");
        }
    }

    #[test]
    fn loose_boxes_hold_the_tight_ones() {
        for name in ["cornell", "gallery", "parade"] {
            let scene = Scene::builtin(name).unwrap();
            let loose = SceneStatistics::of(&scene).bounds_in_world(&scene).unwrap();
            let tight = scene.bounds_in_world().unwrap();
            assert!((loose.min - tight.min).max_element() < 1e-9, "{name}");
            assert!((tight.max - loose.max).max_element() < 1e-9, "{name}");
            let grown = loose.size().length() / tight.size().length();
            assert!(grown < 1.5, "{name}: {grown}");
        }
    }
}
