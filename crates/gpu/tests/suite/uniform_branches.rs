//! The search for branches that uniforms decide finds them, and nothing else.

use crate::uniform_branches::uniform_branches;

/// The body of a kernel, with what its bodies use.
fn branches_of(body: &str) -> Vec<String> {
    let wgsl = format!(
        "struct Frame {{ flags: u32, depth: u32 }}
        @group(0) @binding(0) var<uniform> frame: Frame;
        @group(0) @binding(1) var<storage, read_write> sums: array<u32>;
        fn limit(group_id: vec3<u32>) -> u32 {{ return frame.depth + group_id.z; }}
        fn weight(x: u32) -> u32 {{ if (frame.flags & 1u) != 0u {{ return x; }} return 2u * x; }}
        fn ends(x: u32, at: u32) -> bool {{ if (frame.flags & 2u) != 0u {{ if x > 7u {{ return true; }} }} sums[at] += x;
            return false; }}
        fn walk(count: u32) {{ for (var i = 0u; i < count; i++) {{ sums[i] += 1u; }} }}
        @compute @workgroup_size(1) fn main(@builtin(workgroup_id) group_id: vec3<u32>) {{ {body} }}"
    );
    let module =
        naga::front::wgsl::parse_str(&wgsl).unwrap_or_else(|error| panic!("{error}: {body}"));
    uniform_branches(&module, &wgsl)
}

#[test]
fn the_search_finds_loops_that_uniforms_decide() {
    for body in [
        "for (var i = 0u; i < frame.depth; i++) { sums[i] = 1u; }",
        "let n = frame.depth * 2u; var i = 0u; loop { if i == n { break; } sums[i] = 1u; i++; }",
        "walk(frame.depth);",
        "for (var i = 0u; i < group_id.x; i++) { if frame.depth > 3u { sums[i] = 1u; } }",
        "for (var i = 0u; i < group_id.x; i++) { if ends(i + group_id.y, i) { break; } }",
        "for (var i = 0u; i < group_id.x; i++) { switch frame.flags { case 1u: { sums[i] = 1u; } default: {} } }",
    ] {
        assert_eq!(branches_of(body).len(), 1, "{body}");
    }
    for body in [
        "for (var i = 0u; i < limit(group_id); i++) { sums[i] = 1u; }",
        "for (var i = 0u; i < 8u; i++) { sums[i] = weight(i); }",
        "for (var i = 0u; i < 8u; i++) { sums[i] = select(0u, i, frame.depth > 3u); }",
        "for (var i = 0u; i < 8u; i++) { if sums[i] < frame.depth { sums[i] = 1u; } }",
        "for (var i = 0u; i < 8u; i++) { if sums[i] == 1u && frame.depth > 3u { sums[i] = 2u; } }",
        "walk(limit(group_id));",
        "if frame.depth > 3u { sums[0] = 1u; }",
    ] {
        assert_eq!(branches_of(body), Vec::<String>::new(), "{body}");
    }
}
