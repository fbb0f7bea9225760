//! Log messages about a new mesh.

use super::given::Which;
use crate::device::Device;
use vrtm_core::log::LogCode;
use vrtm_core::mesh::{Mesh, TileMesh};

/// Describes a mesh and its tiles, and warns of possible mistakes of the host.
pub(super) fn describe(device: &Device, mesh: &Mesh) {
    let info = &mesh.info;
    let counts = [
        info.vertices,
        info.faces,
        info.faces_skipped,
        info.faces_untextured,
        info.triangles,
        info.tiles.into(),
    ];
    let [vertices, faces, skipped, untextured, triangles, tiles] = counts;
    let message = format!(
        "mesh: {vertices} vertices, {faces} faces ({skipped} skipped, {untextured} without texture), \
         {triangles} triangles in {tiles} tiles"
    );
    device.log(LogCode::Mesh, None, &counts.map(|count| count as f64), &message);
    for tile in &mesh.tiles {
        let set = if info.uv_sets > 1 { format!("UV set {}, ", tile.uv_set) } else { String::new() };
        let [triangles, charts, welded] =
            [tile.triangles.len(), tile.charts.len(), tile.welds.len()].map(|count| count as u64);
        let (border, apart) = (tile.border_edges(), tile.edges_apart);
        let message = format!(
            "{set}{triangles} triangles, {charts} charts, {border} border edges, {welded} welded by position, \
             {apart} edges apart"
        );
        let counts = [triangles, charts, border, welded, apart].map(|count| count as f64);
        device.log(LogCode::Tile, Some(tile), &counts, &message);
    }
    let apart = "edges have two sides that lie together, in space and nearly in UV, and are not connected, so that \
                 charts end there: if they are no cuts, weld by position, give UVs with less noise, or a larger UV \
                 tolerance";
    for (code, count, what) in [
        (LogCode::FacesClipped, info.clipped_faces, "faces reach out of their tile and are clipped to it"),
        (LogCode::FacesOutside, info.faces_outside, "faces lie in no UDIM tile and are left out"),
        (LogCode::TrianglesDegenerate, info.degenerate_triangles, "triangles without UV area are left out"),
        (LogCode::EdgesApart, info.edges_apart, apart),
        (LogCode::SeamsUnused, info.seams_unused, "seams are no edge of a face and do nothing"),
    ] {
        if count > 0 {
            device.log(code, None, &[count as f64], &format!("mesh: {count} {what}"));
        }
    }
    if mesh.rest.iter().all(|point| *point == mesh.rest[0]) {
        let message =
            "mesh: all rest positions are one point, so that no chart has an extent and none will move";
        device.log(LogCode::RestIsPoint, None, &[], message);
    }
}

/// Warns of values in another range than 0..1, and of integers whose white is 1 instead of their largest number. `what`
/// names the values of the map `which`, `largest` is the largest of them.
pub(super) fn doubt(device: &Device, which: Which, tile: Option<&TileMesh>, what: &str, largest: f32) {
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
    let code = match which {
        Which::Rigidity => LogCode::RigidityRange,
        Which::Mask => LogCode::MaskRange,
    };
    device.log(code, tile, &[f64::from(largest)], &message);
}
