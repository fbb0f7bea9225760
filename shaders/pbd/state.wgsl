// pbd: what the passes of the paper's solver share. Each pass reads a level's state in one place and writes it to the other
// one: what a node becomes depends on nothing that the same pass writes. Its twin is `src/cpu/pbd.rs`.

/// The other state, in the vectors' place, which this solver does not need: displacement (2), position or metric at W (3),
/// triangle, displacement as it was integrated last (2).
@group(0) @binding(10) var<storage, read_write> other_state: array<u32>;

fn get_state(b: u32, plane: u32, s: u32) -> u32 {
    if (params.mode & PBD_FROM_VECTORS) != 0u {
        return other_state[vector_at(b, plane, s)];
    }
    return state[state_at(b, plane, s)];
}

fn put_state(b: u32, plane: u32, s: u32, bits: u32) {
    if (params.mode & PBD_FROM_VECTORS) != 0u {
        state[state_at(b, plane, s)] = bits;
    } else {
        other_state[vector_at(b, plane, s)] = bits;
    }
}

fn get_u(b: u32, s: u32) -> vec2f {
    return bitcast<vec2f>(vec2u(get_state(b, U, s), get_state(b, U + 1u, s)));
}
