//! glTF import: what is read from well-formed files.

use base64::prelude::{BASE64_STANDARD, Engine as _};
use serde_json::{Value, json};
use stereolux_scene::edit::{Edit, MaterialPreset};
use stereolux_scene::{AlphaMode, Filter, LightKind, Material, Needs, Scene, Wrap};

use crate::folders::Folder;

fn bytes_of(values: &[f32]) -> Vec<u8> {
    values
        .iter()
        .flat_map(|value| value.to_le_bytes())
        .collect()
}

/// A document under construction: typed data goes into buffer 0.
#[derive(Clone)]
pub struct Doc {
    pub json: Value,
    pub bin: Vec<u8>,
}

impl Doc {
    fn new() -> Self {
        let json = json!({
            "asset": { "version": "2.0" },
            "scene": 0,
            "scenes": [{ "nodes": [0] }],
            "nodes": [{ "name": "thing", "mesh": 0 }],
            "meshes": [{ "primitives": [{ "attributes": {} }] }],
            "accessors": [], "bufferViews": [],
        });
        Self {
            json,
            bin: Vec::new(),
        }
    }

    /// A square in the plane z = 0 from (0, 0) to (1, 1), front towards +Z, two triangles with 16-bit indices.
    /// Accessor 0 is POSITION, accessor 1 the indices.
    pub fn square() -> Self {
        let mut doc = Self::new();
        let corners = [0., 0., 0., 1., 0., 0., 1., 1., 0., 0., 1., 0.];
        let positions = doc.floats(&corners, "VEC3");
        let indices = [0_u16, 1, 2, 0, 2, 3].map(u16::to_le_bytes);
        let indices = doc.accessor(indices.as_flattened(), 5123, "SCALAR", 6);
        *doc.primitive() = json!({ "attributes": { "POSITION": positions }, "indices": indices });
        doc
    }

    pub fn primitive(&mut self) -> &mut Value {
        &mut self.json["meshes"][0]["primitives"][0]
    }

    pub fn view(&mut self, bytes: &[u8]) -> usize {
        self.bin.resize(self.bin.len().next_multiple_of(4), 0);
        let views = self.json["bufferViews"].as_array_mut().unwrap();
        views.push(json!({ "buffer": 0, "byteOffset": self.bin.len(), "byteLength": bytes.len() }));
        self.bin.extend_from_slice(bytes);
        views.len() - 1
    }

    fn accessor(&mut self, bytes: &[u8], component: u32, kind: &str, count: usize) -> usize {
        let view = self.view(bytes);
        let accessors = self.json["accessors"].as_array_mut().unwrap();
        accessors.push(
            json!({ "bufferView": view, "componentType": component, "type": kind, "count": count }),
        );
        accessors.len() - 1
    }

    /// An accessor of as many vectors as there are numbers for.
    fn floats(&mut self, values: &[f32], kind: &str) -> usize {
        let size = kind.trim_start_matches("VEC").parse::<usize>().unwrap();
        self.accessor(&bytes_of(values), 5126, kind, values.len() / size)
    }

    pub fn load(&self) -> Result<Scene, String> {
        Scene::from_bytes("test.gltf", self.text().as_bytes()).map_err(|error| error.to_string())
    }

    /// The file, its buffer in it.
    fn text(&self) -> String {
        let mut json = self.json.clone();
        if json.get("buffers").is_none() {
            let data = BASE64_STANDARD.encode(&self.bin);
            let uri = format!("data:application/octet-stream;base64,{data}");
            json["buffers"] = json!([{ "byteLength": self.bin.len(), "uri": uri }]);
        }
        json.to_string()
    }
}

/// The square with a change.
pub fn with(change: impl FnOnce(&mut Doc)) -> Doc {
    let mut doc = Doc::square();
    change(&mut doc);
    doc
}

/// Puts a value at a JSON pointer; its last part may be new.
pub fn set(json: &mut Value, at: &str, value: Value) {
    if let Some(place) = json.pointer_mut(at) {
        *place = value;
    } else {
        let (parent, key) = at.rsplit_once('/').unwrap();
        json.pointer_mut(parent).unwrap()[key] = value;
    }
}

#[track_caller]
pub fn assert_fault(result: Result<Scene, String>, expected: &str) {
    match result {
        Ok(_) => panic!("accepted, expected an error with '{expected}'"),
        Err(message) => {
            assert!(
                message.contains(expected),
                "'{message}' does not contain '{expected}'"
            );
            assert!(!message.contains('\n'), "more than one line: {message}");
        }
    }
}

#[test]
fn open_glass_without_a_thickness_is_a_thin_wall() {
    let glass = |volume: Value| {
        with(|doc| {
            let mut extensions =
                json!({ "KHR_materials_transmission": { "transmissionFactor": 1 } });
            if !volume.is_null() {
                extensions["KHR_materials_volume"] = volume;
            }
            doc.json["materials"] = json!([{ "pbrMetallicRoughness": { "metallicFactor": 0 }, "extensions": extensions }]);
            doc.json["meshes"][0]["primitives"][0]["material"] = json!(0);
        })
    };
    for volume in [Value::Null, json!({ "attenuationDistance": 2 })] {
        let mut scene = glass(volume).load().unwrap();
        assert!(scene.materials[0].is_thin_wall() && scene.warnings.is_empty());
        // An edit that makes another material glass looks, too.
        let pane = scene.materials[0].clone();
        scene.materials[0] = Material::lambert("wall", [0.5; 3]);
        let to = Box::new(Material {
            is_open: false,
            ..pane
        });
        let undo = Edit::Material { material: 0, to }
            .apply(&mut scene)
            .unwrap();
        assert!(scene.materials[0].is_thin_wall());
        // Nor does it hang on who says what glass is.
        let to = Box::new(MaterialPreset::Glass.applied_to(&scene.materials[0]));
        let other = Edit::Material { material: 0, to };
        let pane = scene.materials[0].clone();
        let back = other.apply(&mut scene).unwrap();
        assert!(scene.materials[0] != pane && scene.materials[0].is_thin_wall());
        back.apply(&mut scene).unwrap();
        assert_eq!(scene.materials[0], pane);
        undo.apply(&mut scene).unwrap();
        assert_eq!(scene.materials[0], Material::lambert("wall", [0.5; 3]));
    }
    let thick = glass(json!({ "thicknessFactor": 0.1 })).load().unwrap();
    assert!(!thick.materials[0].is_thin_wall());
    // What has no surface is nothing to warn of.
    let mut unused = glass(Value::Null);
    let primitive = &mut unused.json["meshes"][0]["primitives"][0];
    primitive.as_object_mut().unwrap().remove("material");
    assert_eq!(unused.load().unwrap().warnings, [""; 0]);
}

/// Byte order marks before JSON and zeros behind it, and whole numbers with a fraction or an exponent.
#[test]
fn harmless_oddities_of_json_are_read() {
    let text = Doc::square().text();
    for odd in [format!("\u{feff}{text}"), format!("{text}\0\0")] {
        let scene = Scene::from_bytes("odd.gltf", odd.as_bytes()).unwrap();
        assert_eq!(scene.triangle_count(), 2);
    }
    let mut doc = Doc::square();
    doc.json["scene"] = json!(0.0);
    assert!(doc.text().contains(r#""scene":0.0"#));
    assert_eq!(doc.load().unwrap().triangle_count(), 2);
    doc.json["scene"] = json!(0.5);
    assert!(doc.load().is_err());
}

/// A mesh whose vertices are split has the tangents of one whose vertices are shared.
#[test]
fn tangents_do_not_depend_on_how_vertices_are_split() {
    // A square bent along its diagonal: both triangles share two corners with one normal.
    let bent = |split: bool| {
        let corners = [[0., 0., 0.], [1., 0., 0.3], [1., 1., 0.], [0., 1., 0.3]];
        let uv = [[0., 1.], [1., 1.], [1., 0.2], [0., 0.]];
        let order: &[usize] = if split {
            &[0, 1, 2, 0, 2, 3]
        } else {
            &[0, 1, 2, 3]
        };
        let mut doc = with_normal_texture(uv);
        let of = |values: &[f32], size: usize| -> Vec<f32> {
            order
                .iter()
                .flat_map(|at| values[size * at..size * (at + 1)].to_vec())
                .collect()
        };
        let accessors = [
            doc.floats(&of(corners.as_flattened(), 3), "VEC3"),
            doc.floats(&of(&[0., 0., 1.].repeat(4), 3), "VEC3"),
            doc.floats(&of(uv.as_flattened(), 2), "VEC2"),
        ];
        let primitive = &mut doc.json["meshes"][0]["primitives"][0];
        for (name, accessor) in ["POSITION", "NORMAL", "TEXCOORD_0"]
            .into_iter()
            .zip(accessors)
        {
            primitive["attributes"][name] = json!(accessor);
        }
        if split {
            primitive.as_object_mut().unwrap().remove("indices");
        }
        let scene = doc.load().unwrap();
        let mesh = scene.meshes[0].clone();
        let corners = mesh.triangles.iter().flat_map(|triangle| triangle.vertices);
        let tangents: Vec<_> = corners
            .map(|vertex| mesh.tangents[vertex as usize])
            .collect();
        (mesh.positions.len(), tangents)
    };
    let ((shared, expected), (split, found)) = (bent(false), bent(true));
    assert_eq!((shared, split), (4, 6));
    assert_eq!(found, expected);
    // Negative control: the triangles' own tangents differ.
    assert_ne!(found[1], found[5]);
}

/// Files of UniGLTF list the child of a node that no scene shows.
#[test]
fn a_listed_child_of_a_node_that_is_not_shown_is_a_root() {
    let mut doc = Doc::square();
    let above = json!({ "name": "above", "translation": [9, 0, 0], "children": [0, 2] });
    doc.json["nodes"] =
        json!([{ "name": "thing", "mesh": 0, "translation": [1, 2, 3] }, above, {}]);
    let scene = doc.load().unwrap();
    let told = "scenes[0]: nodes[0] 'thing' is not a root, it is a child of nodes[1] 'above', which the scene does not show";
    assert_eq!(scene.warnings.len(), 1, "{:?}", scene.warnings);
    assert!(scene.warnings[0].starts_with(told), "{:?}", scene.warnings);
    assert_eq!(scene.roots, [0]);
    assert_eq!(
        (scene.nodes[0].parent, &scene.nodes[1].children),
        (None, &vec![2])
    );
    assert_eq!(
        scene.bounds_in_world().unwrap().min,
        glam::DVec3::new(1.0, 2.0, 3.0)
    );
    // A fault where the parent is shown, too, at any depth.
    doc.json["nodes"][2] = json!({ "name": "top", "children": [1] });
    doc.json["nodes"][1]["children"] = json!([0]);
    doc.json["scenes"][0]["nodes"] = json!([0, 2]);
    assert_fault(
        doc.load(),
        "nodes[0] 'thing' is not a root, it is a child of nodes[1] 'above', and would be shown twice",
    );
}

#[test]
fn a_plain_square() {
    let scene = Doc::square().load().unwrap();
    assert_eq!(scene.name, "test");
    assert!(scene.warnings.is_empty(), "{:?}", scene.warnings);
    let mesh = &scene.meshes[0];
    assert_eq!(scene.triangle_count(), 2);
    // Without normals every triangle has corners of its own, with the geometric normal.
    assert_eq!(mesh.positions.len(), 6);
    assert!(mesh.normals.iter().all(|normal| *normal == [0.0, 0.0, 1.0]));
    assert!(mesh.colors.iter().all(|color| *color == [1.0; 4]));
    assert_eq!(mesh.uv0.len(), 6);
    assert_eq!(mesh.tangents.len(), 6);
    assert!(!mesh.has_tangents && !mesh.has_uv1 && !mesh.has_colors);
    // glTF's default material stands in.
    assert_eq!(scene.materials.len(), 1);
    assert_eq!(
        (scene.materials[0].metallic, scene.materials[0].roughness),
        (1.0, 1.0)
    );
    assert!((scene.surface_area_m2() - 1.0).abs() < 1e-12);
    let bounds = scene.bounds_in_world().unwrap();
    assert_eq!(
        (bounds.min.to_array(), bounds.max.to_array()),
        ([0.0; 3], [1.0, 1.0, 0.0])
    );
}

#[test]
fn index_types_and_modes_give_the_same_square() {
    let area = |doc: Doc| doc.load().unwrap().surface_area_m2();
    let long = [0_u32, 1, 2, 0, 2, 3].map(u32::to_le_bytes);
    for (component, bytes) in [
        (5121, vec![0_u8, 1, 2, 0, 2, 3]),
        (5125, long.as_flattened().to_vec()),
    ] {
        let doc = with(|doc| {
            let indices = doc.accessor(&bytes, component, "SCALAR", 6);
            doc.primitive()["indices"] = json!(indices);
        });
        assert!((area(doc) - 1.0).abs() < 1e-12, "{component}");
    }
    let strip = with(|doc| {
        let indices = doc.accessor(&[0_u8, 1, 3, 2], 5121, "SCALAR", 4);
        doc.primitive()["indices"] = json!(indices);
        doc.primitive()["mode"] = json!(5);
    });
    let fan = with(|doc| {
        doc.primitive().as_object_mut().unwrap().remove("indices");
        doc.primitive()["mode"] = json!(6);
    });
    for doc in [strip, fan] {
        let scene = doc.load().unwrap();
        assert!((scene.surface_area_m2() - 1.0).abs() < 1e-12);
        assert!(
            scene.meshes[0]
                .normals
                .iter()
                .all(|normal| *normal == [0.0, 0.0, 1.0]),
            "winding"
        );
    }
    let lines = with(|doc| doc.primitive()["mode"] = json!(1));
    let scene = lines.load().unwrap();
    assert_eq!(scene.triangle_count(), 0);
    assert!(
        scene.warnings[0].contains("points and lines"),
        "{:?}",
        scene.warnings
    );
}

/// As most exporters write them: a vertex after the other, somewhere in a view.
#[test]
fn interleaved_attributes_are_those_that_lie_packed() {
    let corners = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
    let normals = [
        [0.0, 0.6, 0.8],
        [0.6, 0.0, 0.8],
        [0.8, 0.0, 0.6],
        [0.0, 0.8, 0.6],
    ];
    let packed = with(|doc| {
        let normals = doc.floats(normals.as_flattened(), "VEC3");
        doc.primitive()["attributes"]["NORMAL"] = json!(normals);
    });
    let interleaved = with(|doc| {
        let vertices = corners.iter().zip(&normals);
        let vertices = vertices.flat_map(|([x, y], [a, b, c])| [*x, *y, 0.0, *a, *b, *c]);
        // Four bytes before them are nobody's.
        let values: Vec<f32> = std::iter::once(7.0).chain(vertices).collect();
        let view = doc.view(&bytes_of(&values));
        doc.json["bufferViews"][view]["byteStride"] = json!(24);
        for (name, offset) in [("POSITION", 4), ("NORMAL", 16)] {
            let accessors = doc.json["accessors"].as_array_mut().unwrap();
            accessors.push(json!({
                "bufferView": view, "byteOffset": offset, "componentType": 5126, "type": "VEC3", "count": 4,
            }));
            let number = accessors.len() - 1;
            doc.primitive()["attributes"][name] = json!(number);
        }
    });
    assert_eq!(
        interleaved.load().unwrap().meshes,
        packed.load().unwrap().meshes
    );
}

#[test]
fn sparse_accessors_replace_elements() {
    // Vertex 2 moves to (3, 3, 0): the triangles (0,0) (1,0) (3,3) and (0,0) (3,3) (0,1) have the areas 1.5 each.
    let mut doc = Doc::square();
    let indices = doc.view(&2_u16.to_le_bytes());
    let values = doc.view(&bytes_of(&[3.0, 3.0, 0.0]));
    doc.json["accessors"][0]["sparse"] = json!({
        "count": 1, "indices": { "bufferView": indices, "componentType": 5123 }, "values": { "bufferView": values },
    });
    assert!((doc.load().unwrap().surface_area_m2() - 3.0).abs() < 1e-12);

    // Both in one view, behind what is nobody's.
    let mut behind = Doc::square();
    let mut bytes = vec![9, 9, 2, 0];
    bytes.extend(bytes_of(&[7.0, 3.0, 3.0, 0.0]));
    let view = behind.view(&bytes);
    behind.json["accessors"][0]["sparse"] = json!({
        "count": 1,
        "indices": { "bufferView": view, "byteOffset": 2, "componentType": 5123 },
        "values": { "bufferView": view, "byteOffset": 8 },
    });
    assert!((behind.load().unwrap().surface_area_m2() - 3.0).abs() < 1e-12);

    // The same over zeros: without a buffer view only the replaced vertex is away from the origin.
    doc.json["accessors"][0]
        .as_object_mut()
        .unwrap()
        .remove("bufferView");
    let bounds = doc.load().unwrap().bounds_in_world().unwrap();
    assert_eq!((bounds.min.x, bounds.max.x), (0.0, 3.0));

    doc.json["accessors"][0]["sparse"]["count"] = json!(1_000_000_000_u64);
    assert_fault(doc.load(), "accessors[0].sparse.indices");
    doc.json["accessors"][0]["sparse"]["count"] = json!(1);
    let outside = doc.view(&9_u16.to_le_bytes());
    doc.json["accessors"][0]["sparse"]["indices"]["bufferView"] = json!(outside);
    assert_fault(doc.load(), "element 9 is out of range");
}

#[test]
fn normalised_integers_are_scaled() {
    let doc = with(|doc| {
        let uv = doc.accessor(&[0, 0, 255, 0, 255, 255, 0, 255], 5121, "VEC2", 4);
        doc.json["accessors"][uv]["normalized"] = json!(true);
        let normals = [[0_i16, 0, 32767].map(i16::to_le_bytes); 4];
        let normal = doc.accessor(normals.as_flattened().as_flattened(), 5122, "VEC3", 4);
        doc.json["accessors"][normal]["normalized"] = json!(true);
        let colors = doc.floats([[0.5, 0.25, 1.0]; 4].as_flattened(), "VEC3");
        doc.primitive()["attributes"]["TEXCOORD_0"] = json!(uv);
        doc.primitive()["attributes"]["NORMAL"] = json!(normal);
        doc.primitive()["attributes"]["COLOR_0"] = json!(colors);
    });
    let scene = doc.load().unwrap();
    let mesh = &scene.meshes[0];
    assert_eq!(mesh.positions.len(), 4, "shared vertices stay shared");
    assert_eq!(mesh.uv0, [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]);
    assert!(mesh.normals.iter().all(|normal| *normal == [0.0, 0.0, 1.0]));
    assert!(
        mesh.has_colors
            && mesh
                .colors
                .iter()
                .all(|color| *color == [0.5, 0.25, 1.0, 1.0])
    );
    assert!(Needs::of(&scene).vertex_colors);
}

/// A document whose square has normals, upright uvs and a material with the given normal texture slot.
fn with_normal_texture(uvs: [[f32; 2]; 4]) -> Doc {
    with(|doc| {
        let normals = [0., 0., 2., 0., 0., 2., 0., 0., 0., 0., 0., 2.];
        let normal = doc.floats(&normals, "VEC3");
        let uv = doc.floats(uvs.as_flattened(), "VEC2");
        doc.primitive()["attributes"]["NORMAL"] = json!(normal);
        doc.primitive()["attributes"]["TEXCOORD_0"] = json!(uv);
        doc.primitive()["material"] = json!(0);
        let png = doc.view(&png_1x1());
        doc.json["images"] = json!([{ "bufferView": png, "mimeType": "image/png" }]);
        doc.json["textures"] = json!([{ "source": 0 }]);
        doc.json["materials"] = json!([{ "normalTexture": { "index": 0, "scale": 0.5 } }]);
    })
}

/// The smallest picture: one texel (128, 128, 255).
pub fn png_1x1() -> Vec<u8> {
    let mut bytes = std::io::Cursor::new(Vec::new());
    image::RgbImage::from_raw(1, 1, vec![128, 128, 255])
        .unwrap()
        .write_to(&mut bytes, image::ImageFormat::Png)
        .unwrap();
    bytes.into_inner()
}

#[test]
fn tangents_follow_u_and_normals_are_repaired() {
    // The picture stands upright on the square: u to the right, v down. Green in a normal texture then points up, so
    // the bitangent cross(n, t) * w must be +Y.
    let upright = with_normal_texture([[0., 1.], [1., 1.], [1., 0.], [0., 0.]])
        .load()
        .unwrap();
    let mesh = &upright.meshes[0];
    assert!(mesh.has_tangents);
    assert_eq!(upright.materials[0].normal_scale, 0.5);
    assert!(
        mesh.tangents
            .iter()
            .all(|tangent| *tangent == [1.0, 0.0, 0.0, 1.0]),
        "{:?}",
        mesh.tangents
    );
    assert!(
        mesh.normals.iter().all(|normal| *normal == [0.0, 0.0, 1.0]),
        "{:?}",
        mesh.normals
    );
    assert!(
        upright
            .warnings
            .iter()
            .any(|line| line.contains("1 normals have no length")),
        "{:?}",
        upright.warnings
    );
    // Mirrored left to right: the tangent turns around, and so does the handedness, which leaves up where it was.
    let mirrored = with_normal_texture([[1., 1.], [0., 1.], [0., 0.], [1., 0.]])
        .load()
        .unwrap();
    assert!(
        mirrored.meshes[0]
            .tangents
            .iter()
            .all(|tangent| *tangent == [-1.0, 0.0, 0.0, -1.0])
    );
    // One triangle each way: the two shared vertices are split.
    let halves = with_normal_texture([[0., 1.], [1., 1.], [1., 0.], [2., 1.]])
        .load()
        .unwrap();
    assert_eq!(halves.meshes[0].positions.len(), 6);
}

#[test]
fn materials_are_read_in_full() {
    let doc = with(|doc| {
        let png = BASE64_STANDARD.encode(png_1x1());
        doc.json["images"] =
            json!([{ "uri": format!("data:image/png;base64,{png}"), "name": "dot" }]);
        doc.json["samplers"] = json!([{ "magFilter": 9728, "wrapS": 33071, "wrapT": 33648 }]);
        doc.json["textures"] = json!([{ "source": 0, "sampler": 0 }]);
        let uv = doc.floats(&[0., 0., 1., 0., 1., 1., 0., 1.], "VEC2");
        doc.primitive()["attributes"]["TEXCOORD_0"] = json!(uv);
        doc.primitive()["attributes"]["TEXCOORD_1"] = json!(uv);
        doc.primitive()["material"] = json!(0);
        doc.json["materials"] = json!([{
            "name": "everything",
            "pbrMetallicRoughness": {
                "baseColorFactor": [0.1, 0.2, 0.3, 0.4], "metallicFactor": 0.25, "roughnessFactor": 0.75,
                "baseColorTexture": { "index": 0, "texCoord": 0, "extensions": { "KHR_texture_transform": { "offset": [0.5, 0.25], "scale": [2, 4], "texCoord": 1 } } },
            },
            "emissiveFactor": [1, 0.5, 0.25], "alphaMode": "MASK", "alphaCutoff": 0.6, "doubleSided": true,
            "extensions": {
                "KHR_materials_emissive_strength": { "emissiveStrength": 8 },
                "KHR_materials_ior": { "ior": 1.33 },
                "KHR_materials_specular": { "specularFactor": 0.5, "specularColorFactor": [2, 1, 0.5] },
                "KHR_materials_transmission": { "transmissionFactor": 0.875 },
                "KHR_materials_volume": { "thicknessFactor": 0.125, "attenuationDistance": 3, "attenuationColor": [0.5, 0.6, 0.7] },
            },
        }]);
    });
    let scene = doc.load().unwrap();
    let material = &scene.materials[0];
    assert_eq!(material.base_color, [0.1, 0.2, 0.3, 0.4]);
    assert_eq!((material.metallic, material.roughness), (0.25, 0.75));
    assert_eq!(material.emission, [8.0, 4.0, 2.0]);
    assert_eq!(
        (material.ior, material.specular, material.specular_color),
        (1.33, 0.5, [2.0, 1.0, 0.5])
    );
    assert_eq!(
        (
            material.transmission,
            material.thickness,
            material.attenuation_distance_m
        ),
        (0.875, 0.125, 3.0)
    );
    assert_eq!(material.attenuation_color, [0.5, 0.6, 0.7]);
    assert_eq!(material.alpha_mode, AlphaMode::Mask { cutoff: 0.6 });
    assert!(material.double_sided);
    let slot = material.base_color_texture.unwrap();
    assert_eq!(
        (slot.uv_set, slot.texcoord_from_uv),
        (1, [2.0, 0.0, 0.5, 0.0, 4.0, 0.25])
    );
    let texture = scene.textures[0];
    assert_eq!(
        (texture.wrap_u, texture.wrap_v, texture.filter),
        (Wrap::Clamp, Wrap::Mirror, Filter::Nearest)
    );
    assert_eq!(
        (
            scene.images[0].name.as_str(),
            scene.images[0].rgba8.as_slice()
        ),
        ("dot", [128, 128, 255, 255].as_slice())
    );
    let needs = Needs::of(&scene);
    // Alpha 0.4 stays under the cutoff; the triangles emit.
    assert!(needs.alpha && needs.uv1 && needs.dielectric && needs.glossy);
    assert_eq!(needs.lights.emissive_triangles, 2);
    assert_eq!(needs.not_lambert, ["everything"]);
}

#[test]
fn lights_cameras_and_the_start_pose() {
    let doc = with(|doc| {
        doc.json["cameras"] =
            json!([{ "type": "perspective", "perspective": { "yfov": 1.0, "znear": 0.1 } }]);
        doc.json["extensions"] = json!({ "KHR_lights_punctual": { "lights": [
            { "type": "spot", "intensity": 4, "color": [1, 0.5, 0.25], "spot": { "innerConeAngle": 0.1, "outerConeAngle": 0.5 } },
            { "type": "directional" },
            { "type": "spot", "spot": { "innerConeAngle": 0.5, "outerConeAngle": 0.5 } },
        ] } });
        let half = std::f64::consts::FRAC_1_SQRT_2;
        doc.json["nodes"] = json!([
            { "mesh": 0, "children": [1] },
            // Scaled and turned a quarter about +Y: the pose must come out rigid.
            { "camera": 0, "translation": [1, 2, 3], "rotation": [0, half, 0, half], "scale": [2, 2, 2] },
            { "extensions": { "KHR_lights_punctual": { "light": 0 } } },
        ]);
        doc.json["scenes"] = json!([{ "nodes": [0, 2] }]);
    });
    let scene = doc.load().unwrap();
    let pose = scene.start_pose();
    assert_eq!(pose.position.to_array(), [1.0, 2.0, 3.0]);
    // f32 quaternion components: 1e-7.
    assert!(
        (pose.orientation * glam::DVec3::NEG_Z).distance(glam::DVec3::NEG_X) < 1e-6,
        "{pose:?}"
    );
    assert_eq!(scene.cameras[0].yfov_rad, Some(1.0));
    assert_eq!(
        scene.lights[0].kind,
        LightKind::Spot {
            inner_cone_rad: 0.1,
            outer_cone_rad: 0.5
        }
    );
    assert_eq!(scene.lights[0].intensity, [4.0, 2.0, 1.0]);
    let hard_edge = LightKind::Spot {
        inner_cone_rad: 0.5,
        outer_cone_rad: 0.5,
    };
    assert_eq!(scene.lights[2].kind, hard_edge);
    // What a file may hold may be edited.
    let (mut edited, to) = (scene.clone(), scene.lights[2].clone());
    Edit::Light { light: 2, to }.apply(&mut edited).unwrap();
    let lights = Needs::of(&scene).lights;
    assert_eq!(
        (lights.spot, lights.directional),
        (1, 0),
        "only placed lights count"
    );
    // Without a camera: outside, level, and the whole square within 45 degrees.
    let pose = Doc::square().load().unwrap().start_pose();
    assert_eq!(pose.orientation, glam::DQuat::IDENTITY);
    assert!(pose.position.z > 0.5 && pose.position.x == 0.5, "{pose:?}");
    assert!(
        (1.0 - pose.position.y).max(pose.position.y) <= pose.position.z,
        "{pose:?}"
    );
    // What lies flat is not seen edge-on.
    let flat = with(|doc| {
        doc.json["nodes"][0]["rotation"] = json!([-0.5_f64.sqrt(), 0, 0, 0.5_f64.sqrt()]);
    });
    let pose = flat.load().unwrap().start_pose();
    assert!((pose.position.y - 0.1).abs() < 1e-6, "{pose:?}");
}

#[test]
fn what_has_no_room_is_loaded_and_told_once() {
    for (key, flat) in [
        ("scale", json!([0, 0, 0])),
        ("scale", json!([1, 0, 1])),
        (
            "matrix",
            json!([1, 2, 0, 0, 2, 4, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]),
        ),
    ] {
        let doc = with(|doc| {
            doc.json["nodes"] = json!([{ "name": "gone", "children": [1] }, { "mesh": 0 }]);
            doc.json["nodes"][0][key] = flat;
        });
        let scene = doc.load().unwrap();
        assert_eq!(scene.warnings.len(), 1, "{:?}", scene.warnings);
        let says = "nodes[0] 'gone': its transform flattens space";
        assert!(scene.warnings[0].starts_with(says), "{:?}", scene.warnings);
        assert_eq!(scene.instances().len(), 1);
    }
}

#[test]
fn external_files_resolve_beside_the_document() {
    let folder = Folder::new("external");
    let mut doc = Doc::square();
    doc.json["buffers"] = json!([{ "byteLength": doc.bin.len(), "uri": "my%20data.bin" }]);
    std::fs::write(folder.join("my data.bin"), &doc.bin).unwrap();
    std::fs::write(folder.join("square.gltf"), doc.json.to_string()).unwrap();
    let scene = Scene::load(folder.join("square.gltf")).unwrap();
    assert_eq!((scene.name.as_str(), scene.triangle_count()), ("square", 2));
}

#[test]
fn what_must_hold_all_itself_names_no_file() {
    let mut doc = Doc::square();
    let text = |doc: &Doc| doc.json.to_string().into_bytes();
    let load = |doc: &Doc| Scene::self_contained("model", &text(doc));
    doc.json["buffers"] = json!([{ "byteLength": doc.bin.len(), "uri": format!("data:;base64,{}", BASE64_STANDARD.encode(&doc.bin)) }]);
    assert_eq!(load(&doc).unwrap().triangle_count(), 2);
    // A file that is there.
    doc.json["images"] = json!([{ "uri": "Cargo.toml" }]);
    let refused = load(&doc).unwrap_err().to_string();
    assert!(refused.contains("names the file 'Cargo.toml'"), "{refused}");
    doc.json["images"] = json!([]);
    doc.json["buffers"][0]["uri"] = json!("Cargo.toml");
    assert!(load(&doc).is_err());
    assert!(Scene::self_contained("model", b"not a model").is_err());
}
