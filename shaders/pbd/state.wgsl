// pbd: what the passes of the paper's solver share. Each pass reads a level's state in one place and writes it to the other
// one: what a node becomes depends on nothing that the same pass writes. Its twin is `src/cpu/pbd.rs`.

/// The other state, in the vectors' place, which this solver does not need: displacement (2), position or metric at W (3),
/// triangle, displacement as it was integrated last (2).
@group(0) @binding(10) var<storage, read_write> aside: array<u32>;

const PREVIOUS: u32 = 6u;

/// Bits of the mode: the state is in `aside`; the level's last iteration; no velocities at all.
const FROM_ASIDE: u32 = 16u;
const LAST: u32 = 32u;
const STILL: u32 = 64u;

fn get_state(b: u32, plane: u32, s: u32) -> u32 {
    if (params.mode & FROM_ASIDE) != 0u {
        return aside[vector_at(b, plane, s)];
    }
    return state[state_at(b, plane, s)];
}

fn put_state(b: u32, plane: u32, s: u32, bits: u32) {
    if (params.mode & FROM_ASIDE) != 0u {
        state[state_at(b, plane, s)] = bits;
    } else {
        aside[vector_at(b, plane, s)] = bits;
    }
}

fn get_u(b: u32, s: u32) -> vec2f {
    return bitcast<vec2f>(vec2u(get_state(b, U, s), get_state(b, U + 1u, s)));
}
