// The finer level's rows, in the same buffer as this level's.

fn fine_row_value(at: u32) -> u32 {
    return rows[at];
}
