// For galerkin.wgsl: the finer level's rows are in the same buffer as this level's.

fn fine_row_value(at: u32) -> u32 {
    return rows[at];
}
