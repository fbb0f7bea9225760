// samples: writes the quantities that follow from a level's state and that no other kernel stores, for inspection.

/// Planes per block: position or metric at W (3), triangle under W.
@group(0) @binding(10) var<storage, read_write> samples_at_w: array<u32>;

@compute @workgroup_size(64)
fn samples(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) t: u32) {
    let b = block_of_workgroup(group, t);
    if b == NONE {
        return;
    }
    for (var colour = 0u; colour < 4u; colour++) {
        let s = thread_slot(colour, t);
        let fixed = is_fixed(b, s);
        let triangle = triangle_in_state(b, s, fixed);
        let value = bitcast<vec3u>(value_at(b, s, displacement(b, s), triangle, fixed));
        let to = b * SAMPLE_PLANES * NODES + s;
        samples_at_w[to] = value.x;
        samples_at_w[to + NODES] = value.y;
        samples_at_w[to + 2u * NODES] = value.z;
        samples_at_w[to + 3u * NODES] = triangle;
    }
}
