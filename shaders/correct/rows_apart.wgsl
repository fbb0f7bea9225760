// For galerkin.wgsl: the finer level's rows are in a separate buffer.

@group(0) @binding(11) var<storage, read> fine_rows: array<u32>;

fn fine_row_value(at: u32) -> u32 {
    return fine_rows[at];
}
