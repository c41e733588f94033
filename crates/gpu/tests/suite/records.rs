//! Records are read four words at a time: what lies where is checked against the structs, whose layout the host shares.

use stereolux_gpu::Resources;
use stereolux_gpu::buffers::storage_buffer_with_data;

use crate::adapter::context;
use crate::trace_probe::{Random, ask, probe};

const RECORDS: u32 = 64;
/// Words of the largest record, a material.
const MOST_WORDS: usize = 80;
/// Names of the arrays as they are read, and as structs.
const ARRAYS: [[&str; 2]; 8] = [
    ["top_nodes", "as_top_nodes"],
    ["mesh_nodes", "as_mesh_nodes"],
    ["instances", "as_instances"],
    ["triangles", "as_triangles"],
    ["vertices", "as_vertices"],
    ["materials", "as_materials"],
    ["lights", "as_lights"],
    ["light_alias", "as_light_alias"],
];

#[test]
fn records_are_read_as_their_structs_say() {
    let context = context();
    let source = include_str!("../shared/records_probe.wesl");
    let kernel = probe(&context, source, &[]);
    let mut random = Random(11);
    // Of floats from 1 to 2, so that no number is rounded or none.
    let words: Vec<u32> = (0..RECORDS as usize * MOST_WORDS)
        .map(|_| 0x3f80_0000 | random.below(1 << 23) as u32)
        .collect();
    let mut others = words.clone();
    // Of the second triangle's first corner; of other records' too, but none is the first.
    others[12] ^= 1;
    let [read, other] = [&words, &others]
        .map(|words| storage_buffer_with_data(&context, "records", words).unwrap());
    let answers = |structs: &wgpu::Buffer| -> Vec<u32> {
        let given = ARRAYS
            .iter()
            .fold(Resources::new(), |given, [name, typed]| {
                given.with(name, &read).with(typed, structs)
            });
        let queries: Vec<u32> = (0..RECORDS).collect();
        ask(&context, &kernel, &given, &queries, RECORDS as usize)
    };
    assert_eq!(answers(&read), [1; RECORDS as usize]);
    let changed = answers(&other);
    assert_eq!(changed[1], 2, "a triangle whose word differs");
    assert_eq!(changed[40], 1, "nothing of it has changed");
}
