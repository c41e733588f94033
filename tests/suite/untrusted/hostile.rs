//! Files that ask for more than they bring, made here: each is small, and what it would expand to is not.

use std::io::Read;
use std::path::PathBuf;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use base64::prelude::{BASE64_STANDARD_NO_PAD, Engine as _};
use serde_json::{Value, json};

use crate::suite::support::{Folder, assert_begins};

/// What became of a run of the program.
#[derive(Debug)]
pub struct Outcome {
    /// Exit status; none if a signal ended it.
    pub status: Option<i32>,
    pub stdout: String,
    pub stderr: String,
    /// The most memory that was resident, MiB; 0 where the system does not tell.
    pub peak_mib: u64,
    pub seconds: f64,
}

impl Outcome {
    /// The one line of a refusal.
    pub fn refusal(&self) -> &str {
        assert_eq!(self.status, Some(2), "{self:?}");
        let line = self.stderr.trim_end_matches('\n');
        assert_begins(line, "error: ");
        assert!(line.chars().count() <= "error: ".len() + 300, "{line}");
        assert!(!line.chars().any(char::is_control), "{line:?}");
        line
    }
}

/// Long enough for a loaded machine; a run that takes so long is at fault.
const PATIENCE: Duration = Duration::from_secs(120);

/// Runs the program and watches its memory.
pub fn run(args: &[&str]) -> Outcome {
    let began = Instant::now();
    let mut child = Command::new(env!("CARGO_BIN_EXE_stereolux"))
        .args(args)
        .env_remove("RUST_LOG")
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let text = |mut pipe: Box<dyn Read + Send>| {
        std::thread::spawn(move || {
            let mut bytes = Vec::new();
            pipe.read_to_end(&mut bytes).unwrap();
            String::from_utf8_lossy(&bytes).into_owned()
        })
    };
    let stdout = text(Box::new(child.stdout.take().unwrap()));
    let stderr = text(Box::new(child.stderr.take().unwrap()));
    let mut peak_mib = 0;
    let status = loop {
        peak_mib = peak_mib.max(peak_of(child.id()));
        if let Some(status) = child.try_wait().unwrap() {
            break status;
        }
        if began.elapsed() > PATIENCE {
            child.kill().unwrap();
        }
        std::thread::sleep(Duration::from_millis(1));
    };
    Outcome {
        status: status.code(),
        stdout: stdout.join().unwrap(),
        stderr: stderr.join().unwrap(),
        peak_mib,
        seconds: began.elapsed().as_secs_f64(),
    }
}

/// Peak of a process's resident memory so far, MiB.
fn peak_of(process: u32) -> u64 {
    let status = std::fs::read_to_string(format!("/proc/{process}/status")).unwrap_or_default();
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"));
    let kib = line.and_then(|line| line.trim().strip_suffix("kB")?.trim().parse::<u64>().ok());
    kib.unwrap_or(0) / 1024
}

/// A glTF document of these parts.
pub fn document(parts: Value) -> String {
    joined(json!({ "asset": { "version": "2.0" } }), parts).to_string()
}

/// What both hold.
fn joined(mut parts: Value, mut more: Value) -> Value {
    let all = parts.as_object_mut().unwrap();
    all.append(more.as_object_mut().unwrap());
    parts
}

/// An accessor of zeros.
fn zeros(count: u64, component: u32, kind: &str) -> Value {
    json!({ "componentType": component, "count": count, "type": kind })
}

/// A document that shows one mesh of one primitive at `nodes` nodes.
fn placed(primitive: Value, nodes: usize, more: Value) -> String {
    let parts = json!({
        "scenes": [{ "nodes": (0..nodes).collect::<Vec<_>>() }],
        "nodes": vec![json!({ "mesh": 0 }); nodes],
        "meshes": [{ "primitives": [primitive] }],
    });
    document(joined(parts, more))
}

/// A sphere of `rows * columns * 2` triangles as buffer, views and accessors: positions, then indices.
fn sphere(rows: u32, columns: u32) -> Value {
    let mut bytes = Vec::new();
    for row in 0..=rows {
        for column in 0..columns {
            let t = std::f32::consts::PI * row as f32 / rows as f32;
            let p = std::f32::consts::TAU * column as f32 / columns as f32;
            for x in [t.sin() * p.cos(), t.cos(), t.sin() * p.sin()] {
                bytes.extend(x.to_le_bytes());
            }
        }
    }
    let positions = bytes.len();
    for row in 0..rows {
        for column in 0..columns {
            let [a, b] = [column, (column + 1) % columns].map(|at| row * columns + at);
            for index in [a, b, a + columns, b, b + columns, a + columns] {
                bytes.extend(index.to_le_bytes());
            }
        }
    }
    json!({
        "buffers": [{ "byteLength": bytes.len(), "uri": data_uri("application/octet-stream", &bytes) }],
        "bufferViews": [
            { "buffer": 0, "byteLength": positions },
            { "buffer": 0, "byteOffset": positions, "byteLength": bytes.len() - positions },
        ],
        "accessors": [
            { "componentType": 5126, "count": positions / 12, "type": "VEC3", "bufferView": 0 },
            { "componentType": 5125, "count": (bytes.len() - positions) / 4, "type": "SCALAR", "bufferView": 1 },
        ],
    })
}

/// `bytes` as a data URI, in base64.
pub fn data_uri(kind: &str, bytes: &[u8]) -> String {
    let text = BASE64_STANDARD_NO_PAD.encode(bytes);
    format!("data:{kind};base64,{text}")
}

/// A PNG of one bit per pixel, all black: a deflate stream of one zero and copies of it.
pub fn black_png(width: u32, height: u32) -> Vec<u8> {
    let count = u64::from(height) * (u64::from(width.div_ceil(8)) + 1);
    let mut zlib = vec![0x78, 0x01];
    let (mut bits, mut held) = (0_u64, 0);
    let mut put = |value: u64, length: u32| {
        bits |= value << held;
        held += length;
        while held >= 8 {
            zlib.push(bits as u8);
            bits >>= 8;
            held -= 8;
        }
    };
    // One last block with fixed codes. Codes go in from their highest bit: literal 0 is 00110000, length 258 is 11000101,
    // distance 1 is 00000, the end 0000000.
    put(0b011, 3);
    let literals = 1 + (count - 1) % 258;
    for _ in 0..literals {
        put(0b0000_1100, 8);
    }
    for _ in 0..(count - literals) / 258 {
        put(0b1010_0011, 8);
        put(0, 5);
    }
    put(0, 7);
    put(0, 7);
    // Adler-32 of zeros.
    zlib.extend((((count % 65521) as u32) << 16 | 1).to_be_bytes());
    let mut header = Vec::new();
    header.extend(width.to_be_bytes());
    header.extend(height.to_be_bytes());
    header.extend([1, 0, 0, 0, 0]);
    let mut png = b"\x89PNG\r\n\x1a\n".to_vec();
    for (kind, data) in [(b"IHDR", &header), (b"IDAT", &zlib), (b"IEND", &Vec::new())] {
        png.extend((data.len() as u32).to_be_bytes());
        let start = png.len();
        png.extend(kind);
        png.extend(data);
        png.extend(crc(&png[start..]).to_be_bytes());
    }
    png
}

fn crc(bytes: &[u8]) -> u32 {
    let mut sum = u32::MAX;
    for byte in bytes {
        sum ^= u32::from(*byte);
        for _ in 0..8 {
            sum = (sum >> 1) ^ (0xedb8_8320 * (sum & 1));
        }
    }
    !sum
}

/// An OpenEXR file of three channels of halves, its blocks compressed with `compression` and left out.
pub fn exr(data_window: [i32; 4], display_window: [i32; 4], compression: u8) -> Vec<u8> {
    let mut file = vec![0x76, 0x2f, 0x31, 0x01, 2, 0, 0, 0];
    let mut attribute = |name: &str, kind: &str, value: &[u8]| {
        for text in [name, kind] {
            file.extend(text.as_bytes());
            file.push(0);
        }
        file.extend((value.len() as i32).to_le_bytes());
        file.extend(value);
    };
    let mut channels = Vec::new();
    for name in [b'B', b'G', b'R'] {
        channels.extend([name, 0]);
        for word in [1_i32, 0, 1, 1] {
            channels.extend(word.to_le_bytes());
        }
    }
    channels.push(0);
    let window = |bounds: [i32; 4]| bounds.map(i32::to_le_bytes).concat();
    attribute("channels", "chlist", &channels);
    attribute("compression", "compression", &[compression]);
    attribute("dataWindow", "box2i", &window(data_window));
    attribute("displayWindow", "box2i", &window(display_window));
    attribute("lineOrder", "lineOrder", &[0]);
    attribute("pixelAspectRatio", "float", &1.0_f32.to_le_bytes());
    attribute("screenWindowCenter", "v2f", &[0; 8]);
    attribute("screenWindowWidth", "float", &1.0_f32.to_le_bytes());
    file.push(0);
    // Where the first blocks lie, and a block that is as small as it can be.
    let table = file.len();
    for _ in 0..16 {
        file.extend(((table + 128) as u64).to_le_bytes());
    }
    file.extend(data_window[1].to_le_bytes());
    file.extend(14_i32.to_le_bytes());
    file.extend([0x78, 0x01, 0x03, 0x00, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0]);
    file
}

/// A Radiance map, all of one colour, run-length coded.
pub fn hdr(width: u16, height: u32) -> Vec<u8> {
    let mut file =
        format!("#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y {height} +X {width}\n").into_bytes();
    let [high, low] = width.to_be_bytes();
    for _ in 0..height {
        file.extend([2, 2, high, low]);
        for value in [128, 128, 128, 129] {
            let mut rest = width;
            while rest > 0 {
                let run = rest.min(127);
                file.extend([128 + run as u8, value]);
                rest -= run;
            }
        }
    }
    file
}

/// A file that must be refused before it takes memory, or read within bounds.
pub struct Case {
    pub name: &'static str,
    pub path: PathBuf,
    /// What reads it.
    pub way: Way,
    /// Words of the refusal; none where it is read.
    pub refused: Option<&'static str>,
}

/// How a file gets into the program.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Way {
    Scene,
    Environment,
    Compare,
}

impl Case {
    /// Runs the command that reads it.
    pub fn run(&self) -> Outcome {
        let path = self.path.to_str().unwrap();
        match self.way {
            Way::Scene => run(&["info", "--scene", path]),
            Way::Environment => {
                let setting = format!("environment.path={path}");
                run(&["info", "--scene", "builtin:plane", "--set", &setting])
            }
            Way::Compare => run(&["compare", path, path]),
        }
    }
}

/// Writes all files into `folder`.
pub fn cases(folder: &Folder) -> Vec<Case> {
    let mut cases = Vec::new();
    let over = Some("limits.load_memory");
    let mut add = |name: &'static str, way, refused, bytes: Vec<u8>| {
        let path = folder.write(name, bytes);
        cases.push(Case {
            name,
            path,
            way,
            refused,
        });
    };
    std::fs::write(folder.join("black16k.png"), black_png(16_384, 16_384)).unwrap();
    std::fs::write(folder.join("zeros.bin"), vec![0; 1_200_000]).unwrap();
    for (name, refused, text) in [geometry(), lists(), resources()].into_iter().flatten() {
        add(name, Way::Scene, refused, text.into_bytes());
    }
    let wild = [-553_648_128, 0, 15, 15];
    let small = [0, 0, 15, 15];
    let large = [0, 0, 16_384, 16_384];
    add("window.exr", Way::Compare, over, exr(wild, small, 3));
    add("window-piz.exr", Way::Compare, over, exr(wild, small, 4));
    let zip = exr(wild, small, 3);
    add("window-env.exr", Way::Environment, over, zip);
    add("large.exr", Way::Compare, over, exr(large, large, 3));
    let row = [0, 0, 100_663_311, 0];
    add("row-env.exr", Way::Environment, over, exr(row, row, 3));
    add("large-env.hdr", Way::Environment, over, hdr(16_384, 8_192));
    let black = black_png(32_768, 32_768);
    add("black32k.png", Way::Compare, over, black);
    cases
}

type Texts = Vec<(&'static str, Option<&'static str>, String)>;

/// Counts that accessors claim, and products of lists.
fn geometry() -> Texts {
    let over = Some("limits.load_memory");
    let one = || json!({ "attributes": { "POSITION": 0 } });
    let triangle = json!({ "accessors": [zeros(3, 5126, "VEC3")] });
    let with_targets = |target: Value, count: usize| json!({ "attributes": { "POSITION": 0 }, "targets": vec![target; count] });
    let glowing = |nodes, rows, columns| {
        let mut parts = sphere(rows, columns);
        parts["materials"] = json!([{ "emissiveFactor": [1, 1, 1] }]);
        let primitive = json!({ "attributes": { "POSITION": 0 }, "indices": 1, "material": 0 });
        placed(primitive, nodes, parts)
    };
    let mut grey = sphere(100, 200);
    grey["materials"] = json!([{}]);
    let indexed = json!({ "attributes": { "POSITION": 0 }, "indices": 1 });
    let normals = json!({ "attributes": { "POSITION": 0, "NORMAL": 1 } });
    let strip = json!({ "attributes": { "POSITION": 0 }, "indices": 1, "mode": 5 });
    // Positions, and what more there is beside three of them.
    let with =
        |primitive, accessors: &[Value]| placed(primitive, 1, json!({ "accessors": accessors }));
    let of_zeros = |primitive, count| with(primitive, &[zeros(count, 5126, "VEC3")]);
    let beside = |primitive, more| with(primitive, &[zeros(3, 5126, "VEC3"), more]);
    let many_indices = beside(strip, zeros(67_108_864, 5125, "SCALAR"));
    let many_normals = beside(normals, zeros(22_000_000, 5126, "VEC3"));
    let many_targets = of_zeros(with_targets(json!({ "POSITION": 0 }), 300), 3_000_000);
    let placed_targets = placed(with_targets(json!({}), 20_000), 60_000, triangle);
    let placed_triangles = placed(indexed, 60_000, grey);
    vec![
        ("zero-positions.gltf", over, of_zeros(one(), 22_000_000)),
        (
            "zero-strip.gltf",
            Some("vertices or triangles"),
            many_indices,
        ),
        ("zero-normals.gltf", Some("NORMAL has"), many_normals),
        ("zero-targets.gltf", over, many_targets),
        ("nodes-and-targets.gltf", over, placed_targets),
        ("nodes-and-lights.gltf", over, glowing(40_000, 40, 64)),
        ("some-nodes-and-lights.gltf", None, glowing(4_000, 16, 24)),
        ("coincident.gltf", None, of_zeros(one(), 6_000_000)),
        ("nodes-and-triangles.gltf", over, placed_triangles),
    ]
}

/// Long lists: they take memory by their length, and so must time.
fn lists() -> Texts {
    let over = Some("limits.load_memory");
    let list_of = |key: &str, one: &str, count: usize| {
        let all = format!("{one},").repeat(count);
        format!(r#"{{"asset":{{"version":"2.0"}},"{key}":[{all}{one}]}}"#)
    };
    let count = 100_000;
    let each = |make: &dyn Fn(usize) -> Value| (0..count).map(make).collect::<Vec<_>>();
    let png = data_uri("image/png", &black_png(1, 1));
    let many_materials =
        each(&|index| json!({ "attributes": { "POSITION": 0 }, "material": index }));
    vec![
        (
            "channels.gltf",
            None,
            document(json!({
                "nodes": vec![json!({}); count],
                "accessors": [zeros(1, 5126, "SCALAR"), zeros(1, 5126, "VEC3")],
                "animations": [{
                    "samplers": [{ "input": 0, "output": 1 }],
                    "channels": each(&|node| json!({
                        "sampler": 0, "target": { "node": node, "path": "translation" }
                    })),
                }],
            })),
        ),
        (
            "extensions.gltf",
            None,
            document(json!({
                "extensionsUsed": (0..2 * count).map(|n| format!("E{n}")).collect::<Vec<_>>(),
            })),
        ),
        (
            "textures.gltf",
            None,
            document(json!({
                "images": vec![json!({ "uri": png }); count],
                "textures": each(&|source| json!({ "source": source })),
                "materials": each(&|index| json!({
                    "pbrMetallicRoughness": { "baseColorTexture": { "index": index } }
                })),
            })),
        ),
        (
            "primitives.gltf",
            None,
            document(json!({
                "scenes": [{ "nodes": [0] }],
                "nodes": [{ "mesh": 0 }],
                "meshes": [{ "primitives": many_materials }],
                "materials": vec![json!({}); count],
                "accessors": [zeros(3, 5126, "VEC3")],
            })),
        ),
        (
            "skins.gltf",
            over,
            document(json!({
                "nodes": each(&|node| json!({ "mesh": 0, "skin": node / 100 })),
                "skins": vec![json!({ "joints": [0] }); count / 100],
                "meshes": [{ "primitives": [{ "attributes": {
                    "POSITION": 0, "JOINTS_0": 1, "WEIGHTS_0": 2
                } }] }],
                "accessors": [
                    zeros(30_000, 5126, "VEC3"), zeros(30_000, 5121, "VEC4"), zeros(30_000, 5126, "VEC4"),
                ],
            })),
        ),
        ("numbers.gltf", over, list_of("x", "0", 20_000_000)),
        ("objects.gltf", over, list_of("nodes", "{}", 3_000_000)),
    ]
}

/// Buffers and images.
fn resources() -> Texts {
    let textured: Vec<_> = (0..8)
        .map(|material| json!({ "attributes": { "POSITION": 0 }, "material": material }))
        .collect();
    let buffers = |length: usize| {
        document(
            json!({ "buffers": vec![json!({ "uri": "zeros.bin", "byteLength": length }); 8_000] }),
        )
    };
    vec![
        (
            "images.gltf",
            Some("limits.load_memory"),
            document(json!({
                "scenes": [{ "nodes": [0] }],
                "nodes": [{ "mesh": 0 }],
                "meshes": [{ "primitives": textured }],
                "accessors": [zeros(3, 5126, "VEC3")],
                "images": vec![json!({ "uri": "black16k.png" }); 8],
                "textures": (0..8).map(|source| json!({ "source": source })).collect::<Vec<_>>(),
                "materials": (0..8).map(|index| json!({
                    "pbrMetallicRoughness": { "baseColorTexture": { "index": index } }
                })).collect::<Vec<_>>(),
            })),
        ),
        ("short-buffers.gltf", None, buffers(1)),
        ("whole-buffers.gltf", None, buffers(1_200_000)),
    ]
}
