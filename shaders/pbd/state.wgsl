// pbd: access to the two copies of a level's state in the paper's solver (method §10). Each pass reads one copy and
// writes the other one, so no pass reads data that it writes. The counterpart is `crates/cpu/src/pbd.rs`.

/// The second copy, in the memory of the vectors, which this solver does not need: the planes of the state, and the
/// displacement at the last integration (2).
@group(0) @binding(10) var<storage, read_write> other_state: array<u32>;

fn get_state(b: u32, plane: u32, s: u32) -> u32 {
    if (params.mode & PBD_FROM_VECTORS) != 0u {
        return other_state[vector_index(b, plane, s)];
    }
    return state[state_index(b, plane, s)];
}

fn put_state(b: u32, plane: u32, s: u32, bits: u32) {
    if (params.mode & PBD_FROM_VECTORS) != 0u {
        state[state_index(b, plane, s)] = bits;
    } else {
        other_state[vector_index(b, plane, s)] = bits;
    }
}

fn get_u(b: u32, s: u32) -> vec2f {
    return bitcast<vec2f>(vec2u(get_state(b, U, s), get_state(b, U + 1u, s)));
}
