//! Log messages about a new mesh.

use crate::device::Device;
use vrtm_core::mesh::Mesh;
use vrtm_core::settings::LogLevel;

/// Describes a mesh and its tiles, and warns of possible mistakes of the host.
pub(super) fn describe(device: &Device, mesh: &Mesh) {
    let info = &mesh.info;
    device.log(
        LogLevel::Info,
        &format!(
            "mesh: {} vertices, {} faces ({} skipped, {} without texture), {} triangles in {} tiles",
            info.vertices, info.faces, info.faces_skipped, info.faces_untextured, info.triangles, info.tiles
        ),
    );
    for tile in &mesh.tiles {
        let set = if info.uv_sets > 1 { format!(" of UV set {}", tile.uv_set) } else { String::new() };
        let message = format!(
            "{}{set}: {} triangles, {} charts, {} border edges, {} welded by position, {} edges apart",
            tile.name(),
            tile.triangles.len(),
            tile.charts.len(),
            tile.border_edges(),
            tile.welds.len(),
            tile.edges_apart
        );
        device.log(LogLevel::Info, &message);
    }
    let apart = "edges have two sides that lie together, in space and in UV, and are not connected, so that charts end \
                 there: if they are no cuts, weld by position, or give UVs with less noise";
    for (count, what) in [
        (info.clipped_faces, "faces reach out of their tile and are clipped to it"),
        (info.faces_outside, "faces lie in no UDIM tile and are left out"),
        (info.degenerate_triangles, "triangles without UV area are left out"),
        (info.edges_apart, apart),
        (info.seams_unused, "seams are no edge of a face and do nothing"),
    ] {
        if count > 0 {
            device.log(LogLevel::Warning, &format!("mesh: {count} {what}"));
        }
    }
    if mesh.rest.iter().all(|point| *point == mesh.rest[0]) {
        let message =
            "mesh: all rest positions are one point, so that no chart has an extent and none will move";
        device.log(LogLevel::Warning, message);
    }
}

/// Warns of values in another range than 0..1, and of integers whose white is 1 instead of their largest number. `what`
/// names the values, `largest` is the largest of them.
pub(super) fn doubt(device: &Device, what: &str, largest: f32) {
    // A filter overshoots by less; and with less than a tenth everywhere next to nothing is rigid, or free to move.
    let message = if largest > 2.0 {
        format!("{what} goes up to {largest}: values are 0..1, and all over 1 count as 1")
    } else if largest > 0.0 && largest < 0.1 {
        format!(
            "{what} goes up to {largest:.4} only: values are 0..1, and 1 is the largest number of an integer format"
        )
    } else {
        return;
    };
    device.log(LogLevel::Warning, &message);
}
