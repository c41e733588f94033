//! Meshes: primitives read, checked, completed and merged.

mod attributes;
mod motion;

use glam::DVec3;
use gltf::json;
use gltf::json::mesh::{Mode, Semantic};
use gltf::json::validation::Checked;

use super::super::{Mesh, MeshTriangle, MorphTarget, SceneError, VertexJoints, as_dvec3};
use super::accessors::Reader;
use super::extensions;
use super::materials::Library;
use super::tangents;
use super::{Notes, named};
use stereolux_base::limits::{Held, product};

/// Most vertices, and most triangles, over all meshes: more than any supported adapter can bind.
const MAX_ELEMENTS: u64 = 1 << 25;

/// A vertex, bytes: in the scene, and packed for the device.
const VERTEX_BYTES: u64 = 256;
/// A triangle, bytes: in the scene, and in its mesh's hierarchy while that is built.
const TRIANGLE_BYTES: u64 = 512;
/// One morph target of one vertex, bytes.
const DELTA_BYTES: u64 = 24;
/// A vertex on the way, bytes: where it went, its geometric normal, and its joints while they are sorted.
const VERTEX_SCRATCH_BYTES: u64 = 160;
/// A triangle on the way, bytes: its indices, as a list, and as chosen.
const TRIANGLE_SCRATCH_BYTES: u64 = 64;

/// Imports every mesh of the document.
pub fn import_meshes(
    reader: &Reader<'_>,
    library: &mut Library,
    notes: &mut Notes,
) -> Result<Vec<Mesh>, SceneError> {
    let document = reader.document;
    let mut meshes = Vec::with_capacity(document.root.meshes.len());
    let mut total = [0; 2];
    for (mesh_index, source) in document.root.meshes.iter().enumerate() {
        let name = named(&source.name, "mesh", mesh_index);
        // Of all primitives, also of those that are left out.
        let targets = source
            .primitives
            .first()
            .and_then(|first| first.targets.as_ref());
        let mut mesh = Mesh {
            name,
            targets: vec![MorphTarget::default(); targets.map_or(0, Vec::len)],
            ..Mesh::default()
        };
        let primitives = document
            .raw_item("meshes", mesh_index)
            .and_then(|mesh| mesh.get("primitives"));
        for (primitive_index, primitive) in source.primitives.iter().enumerate() {
            let mut import = PrimitiveImport {
                reader,
                place: format!("meshes[{mesh_index}].primitives[{primitive_index}]"),
                primitive,
                raw: primitives.and_then(|list| list.get(primitive_index)),
                notes,
            };
            let Some(mode) = import.mode()? else { continue };
            let size = import.size(mode, library)?;
            total = [total[0] + size.vertices, total[1] + size.triangles];
            if total.iter().any(|count| *count > MAX_ELEMENTS) {
                return Err(document.fault(format!(
                    "meshes[{mesh_index}]: the scene has more than {MAX_ELEMENTS} vertices or triangles"
                )));
            }
            let _held = import.take(&size)?;
            let data = import.read(mode)?;
            import.append(data, library, &mut mesh)?;
        }
        meshes.push(mesh);
    }
    Ok(meshes)
}

/// How large a primitive becomes, by the counts that it declares.
struct PrimitiveSize {
    /// Vertices of the file.
    read: u64,
    /// Vertices of the mesh, at most.
    vertices: u64,
    triangles: u64,
    targets: u64,
}

/// Arrays as the file has them: one entry per vertex of the accessors, triangles as a plain list.
struct PrimitiveData {
    positions: Vec<[f32; 3]>,
    normals: Option<Vec<[f32; 3]>>,
    tangents: Option<Vec<[f32; 4]>>,
    uv0: Option<Vec<[f32; 2]>>,
    uv1: Option<Vec<[f32; 2]>>,
    colors: Option<Vec<[f32; 4]>>,
    joints: Option<Vec<VertexJoints>>,
    targets: Vec<MorphTarget>,
    triangles: Vec<[u32; 3]>,
}

struct PrimitiveImport<'a, 'd> {
    reader: &'a Reader<'d>,
    place: String,
    primitive: &'a json::mesh::Primitive,
    raw: Option<&'a serde_json::Value>,
    notes: &'a mut Notes,
}

impl<'d> PrimitiveImport<'_, 'd> {
    fn fault(&self, what: &str) -> SceneError {
        self.reader
            .document
            .fault(format!("{}: {what}", self.place))
    }

    /// Which triangles its indices make; `None` for points and lines, which have no surface.
    fn mode(&mut self) -> Result<Option<Mode>, SceneError> {
        if let Some(name) = extensions::compression_of(self.raw) {
            let attributes = self.primitive.attributes.values();
            let has_fallback = attributes.chain(&self.primitive.indices).all(|accessor| {
                self.reader
                    .document
                    .root
                    .accessors
                    .get(accessor.value())
                    .is_some_and(|accessor| accessor.buffer_view.is_some())
            });
            if !has_fallback {
                return Err(self.fault(&format!(
                    "is compressed by {name}, which is not supported: decompress the file first"
                )));
            }
        }
        let Checked::Valid(mode) = self.primitive.mode else {
            return Err(self.fault("unknown mode"));
        };
        if matches!(
            mode,
            Mode::Points | Mode::Lines | Mode::LineLoop | Mode::LineStrip
        ) {
            self.notes.warn(format_args!(
                "{}: points and lines have no surface and are left out",
                self.place
            ));
            return Ok(None);
        }
        Ok(Some(mode))
    }

    fn accessor_of(&self, semantic: Semantic) -> Option<usize> {
        let found = self.primitive.attributes.get(&Checked::Valid(semantic));
        found.map(|accessor| accessor.value())
    }

    /// How large it becomes: nothing is read for it.
    fn size(&self, mode: Mode, library: &Library) -> Result<PrimitiveSize, SceneError> {
        let Some(positions) = self.accessor_of(Semantic::Positions) else {
            return Err(self.fault("has no POSITION"));
        };
        let place = |what: &str| format!("{}.{what}", self.place);
        let read = self.reader.count_of(positions, &place("POSITION"))?;
        let corners = match self.primitive.indices {
            Some(indices) => self.reader.count_of(indices.value(), &place("indices"))?,
            None => read,
        };
        let triangles = match mode {
            Mode::TriangleStrip | Mode::TriangleFan => corners.saturating_sub(2),
            _ => corners / 3,
        };
        let corners = product(&[3, triangles]);
        let vertices = if self.accessor_of(Semantic::Normals).is_none() {
            corners
        } else if self.splits_charts(library) {
            corners.min(product(&[2, read]))
        } else {
            corners.min(read)
        };
        Ok(PrimitiveSize {
            read,
            vertices,
            triangles,
            targets: self.primitive.targets.as_ref().map_or(0, Vec::len) as u64,
        })
    }

    /// Whether vertices in which mirrored and unmirrored charts meet are doubled: where tangents have to be derived.
    fn splits_charts(&self, library: &Library) -> bool {
        let material = self.primitive.material.map(|material| material.value());
        let surface = material.and_then(|material| library.materials.get(material));
        self.accessor_of(Semantic::Tangents).is_none()
            && surface.is_some_and(|surface| surface.normal_texture.is_some())
    }

    /// Asks for the memory of what it becomes, and of what is needed until it has.
    fn take(&self, size: &PrimitiveSize) -> Result<Held<'d>, SceneError> {
        let PrimitiveSize {
            read,
            vertices,
            triangles,
            targets,
        } = *size;
        let document = self.reader.document;
        let what =
            format_args!("{vertices} vertices, {triangles} triangles, {targets} morph targets");
        let kept = [
            product(&[vertices, VERTEX_BYTES]),
            product(&[triangles, TRIANGLE_BYTES]),
            product(&[vertices, targets, DELTA_BYTES]),
        ];
        document.take(sum(kept), &self.place, what)?;
        let on_the_way = [
            product(&[read.max(vertices), VERTEX_SCRATCH_BYTES]),
            product(&[triangles, TRIANGLE_SCRATCH_BYTES]),
            product(&[read, targets, DELTA_BYTES]),
        ];
        document
            .budget
            .hold(sum(on_the_way), format_args!("{}: {what}", self.place))
            .map_err(|error| SceneError::over(document.path, &error))
    }

    /// Completes the attributes and adds the primitive to `mesh`.
    fn append(
        &mut self,
        data: PrimitiveData,
        library: &mut Library,
        mesh: &mut Mesh,
    ) -> Result<(), SceneError> {
        let material = match self.primitive.material {
            Some(material) => material.value() as u32,
            None => library.default_material(),
        };
        let Some(surface) = library.materials.get(material as usize) else {
            return Err(self.fault(&format!(
                "material {material} is out of range, there are {}",
                library.materials.len()
            )));
        };
        let normal_uv_set = surface.normal_texture.map(|texture| texture.uv_set);
        for (_, texture) in surface.texture_slots() {
            let missing = texture.is_some_and(|texture| {
                if texture.uv_set == 1 {
                    data.uv1.is_none()
                } else {
                    data.uv0.is_none()
                }
            });
            if missing {
                self.notes.warn(format_args!(
                    "{}: its material '{}' has textures, but it lacks their texture coordinates",
                    self.place, surface.name
                ));
                break;
            }
        }
        let normal_uv = match normal_uv_set {
            Some(1) => data.uv1.as_ref(),
            Some(_) => data.uv0.as_ref(),
            None => None,
        };
        let derive_tangents = normal_uv.is_some() && data.tangents.is_none();

        let (sources, triangles) =
            self.choose_vertices(&data, normal_uv.filter(|_| derive_tangents));
        let pick = |source: &u32| *source as usize;
        let positions: Vec<[f32; 3]> = sources
            .iter()
            .map(|source| data.positions[pick(source)])
            .collect();
        let geometric = tangents::normals_from_triangles(&positions, &triangles);
        let normals = match &data.normals {
            None => geometric.iter().map(to_array).collect(),
            Some(normals) => self.unit_normals(
                sources.iter().map(|source| normals[pick(source)]),
                &geometric,
            ),
        };
        let gather = |values: &Option<Vec<[f32; 2]>>| -> Vec<[f32; 2]> {
            sources
                .iter()
                .map(|source| {
                    values
                        .as_ref()
                        .map_or([0.0; 2], |values| values[pick(source)])
                })
                .collect()
        };
        let (uv0, uv1) = (gather(&data.uv0), gather(&data.uv1));
        let tangents: Vec<[f32; 4]> = match &data.tangents {
            Some(tangents) => sources
                .iter()
                .zip(&normals)
                .map(|(source, normal)| unit_tangent(tangents[pick(source)], *normal))
                .collect(),
            None if derive_tangents => {
                let uv = if normal_uv_set == Some(1) { &uv1 } else { &uv0 };
                tangents::derive(&positions, &normals, uv, &triangles)
            }
            None => normals
                .iter()
                .map(|normal| tangents::any_tangent(*normal))
                .collect(),
        };

        let base = mesh.positions.len() as u32;
        self.append_motion(&data, &sources, mesh)?;
        mesh.has_tangents |= data.tangents.is_some() || derive_tangents;
        mesh.has_uv1 |= data.uv1.is_some();
        mesh.has_colors |= data.colors.is_some();
        mesh.colors.extend(sources.iter().map(|source| {
            data.colors
                .as_ref()
                .map_or([1.0; 4], |colors| colors[pick(source)])
        }));
        mesh.positions.extend(positions);
        mesh.normals.extend(normals);
        mesh.tangents.extend(tangents);
        mesh.uv0.extend(uv0);
        mesh.uv1.extend(uv1);
        // Cannot wrap: the caller bounds the vertices per scene, and one primitive adds at most three per index.
        mesh.triangles
            .extend(triangles.iter().map(|vertices| MeshTriangle {
                vertices: vertices.map(|vertex| vertex + base),
                material,
            }));
        Ok(())
    }

    /// Which vertex of the file stands at each place of the output, and the triangles over these places.
    ///
    /// Without normals every triangle gets corners of its own (flat shading). Otherwise only vertices in use are taken,
    /// once, or twice where `split_by` shows mirrored and unmirrored charts meeting in them.
    fn choose_vertices(
        &self,
        data: &PrimitiveData,
        split_by: Option<&Vec<[f32; 2]>>,
    ) -> (Vec<u32>, Vec<[u32; 3]>) {
        const UNUSED: u32 = u32::MAX;
        let count = data.positions.len();
        if data.normals.is_none() {
            let sources = data.triangles.as_flattened().to_vec();
            let triangles = (0..data.triangles.len() as u32)
                .map(|at| [3 * at, 3 * at + 1, 3 * at + 2])
                .collect();
            return (sources, triangles);
        }
        let mut place_of = vec![[UNUSED; 2]; count];
        let mut sources = Vec::with_capacity(count);
        let mut triangles = Vec::with_capacity(data.triangles.len());
        for triangle in &data.triangles {
            let side = split_by.is_some_and(|uv| {
                tangents::is_mirrored(triangle.map(|vertex| uv[vertex as usize]))
            });
            triangles.push(triangle.map(|vertex| {
                let place = &mut place_of[vertex as usize][usize::from(side)];
                if *place == UNUSED {
                    *place = sources.len() as u32;
                    sources.push(vertex);
                }
                *place
            }));
        }
        (sources, triangles)
    }

    fn unit_normals(
        &mut self,
        normals: impl Iterator<Item = [f32; 3]>,
        fallback: &[DVec3],
    ) -> Vec<[f32; 3]> {
        let mut repaired = 0;
        let units = normals
            .zip(fallback)
            .map(|(normal, fallback)| {
                to_array(&as_dvec3(normal).try_normalize().unwrap_or_else(|| {
                    repaired += 1;
                    *fallback
                }))
            })
            .collect();
        if repaired > 0 {
            self.notes.warn(format_args!(
                "{}: {repaired} normals have no length and are replaced by the surface's",
                self.place
            ));
        }
        units
    }
}

fn sum(parts: [u64; 3]) -> u64 {
    parts.into_iter().fold(0, u64::saturating_add)
}

fn unit_tangent(tangent: [f32; 4], normal: [f32; 3]) -> [f32; 4] {
    let direction = as_dvec3([tangent[0], tangent[1], tangent[2]]);
    let normal_d = as_dvec3(normal);
    let handedness = if tangent[3] < 0.0 { -1.0 } else { 1.0 };
    match (direction - normal_d * direction.dot(normal_d)).try_normalize() {
        Some(unit) => unit.as_vec3().extend(handedness).to_array(),
        None => tangents::any_tangent(normal),
    }
}

fn to_array(v: &DVec3) -> [f32; 3] {
    v.as_vec3().to_array()
}
