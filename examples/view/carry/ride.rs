//! Moves what stands on features with a pose: on the plain skin, and as the library carries it.

use bytemuck::{Pod, Zeroable};
use vrtm::{Asset, Bind, Carried, Carrier, CarrierSettings, Scalar, Strided, StridedMut};

use super::pieces::{self, Piece};
use crate::brush::canvas::Canvas;
use crate::model::{Model, cross, dot, minus, unit};

/// A stud or a spike in a pose: where its three axes and its origin come to, in the layout of `carried.wgsl`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Placed {
    /// On the skin, as it is bound without vrtm: by the point of the triangle, stretched as the feature is.
    pub plain: [[f32; 3]; 4],
    pub carried: [[f32; 3]; 4],
}

/// Geometry on the features of a mesh.
pub struct Riders {
    pieces: Vec<Piece>,
    /// Largest height of a piece.
    highest: f32,
    carrier: Carrier,
}

/// Largest ratio of a piece's height to the usual one: a large feature between small ones gets a short spike.
const HIGHER: f32 = 1.3;

impl Riders {
    /// `tiles` are the asset's, for each of the model's.
    ///
    /// # Errors
    /// Those of vrtm.
    pub fn new(model: &Model, asset: &Asset, canvases: &[Canvas]) -> vrtm::Result<Riders> {
        let pieces = pieces::find(model, canvases);
        let uv = |piece: &Piece| {
            let udim = model.pages[model.tiles[piece.tile].page].udim - 1001;
            [piece.uv[0] + (udim % 10) as f32, piece.uv[1] + (udim / 10) as f32]
        };
        let uvs: Vec<[f32; 2]> = pieces.iter().map(uv).collect();
        let layers: Vec<u32> = pieces.iter().map(|piece| model.tiles[piece.tile].layer).collect();
        // Rows of a matrix whose columns are the axes.
        let rows = |piece: &Piece| [0, 1, 2].map(|row| piece.frame.map(|axis| axis[row]));
        let frames: Vec<[[f32; 3]; 3]> = pieces.iter().map(rows).collect();
        let bytes = bytemuck::cast_slice(&frames);
        let frames = Strided::new("frames", bytes, Scalar::F32, 9, pieces.len(), 0)?;
        let carrier = asset.carrier(&CarrierSettings {
            frames: Some(frames),
            ..CarrierSettings::new(Bind::Uv { uvs: Strided::from_f32x2(&uvs), layers: Some(&layers) })
        })?;
        let mut sizes: Vec<f32> = pieces.iter().map(size).collect();
        sizes.sort_by(f32::total_cmp);
        let highest = sizes.get(sizes.len() / 2).map_or(0.0, |median| HIGHER * median);
        Ok(Riders { pieces, highest, carrier })
    }

    /// Their places in the pose of the last solve.
    ///
    /// # Errors
    /// Those of vrtm.
    pub fn place(&self, model: &Model, pose: &[[f32; 3]]) -> vrtm::Result<Vec<Placed>> {
        let mut positions = vec![[0.0f32; 3]; self.pieces.len()];
        let mut rotations = vec![[0.0f32; 9]; self.pieces.len()];
        self.carrier.fetch(&Carried {
            positions: Some(StridedMut::from_f32(&mut positions)),
            rotations: Some(StridedMut::from_f32(&mut rotations)),
            ..Carried::default()
        })?;
        let carried = positions.into_iter().zip(rotations);
        let placed = |(piece, (position, rows)): (&Piece, ([f32; 3], [f32; 9]))| {
            let axes = [0, 1, 2].map(|k| [rows[k], rows[k + 3], rows[k + 6]]);
            let height = size(piece).min(self.highest);
            let carried = scaled(axes, piece, height, position);
            Placed { plain: plain(piece, height, model, pose), carried }
        };
        Ok(self.pieces.iter().zip(carried).map(placed).collect())
    }
}

/// The mean radius.
fn size(piece: &Piece) -> f32 {
    (piece.radii[0] * piece.radii[1]).sqrt()
}

/// Axes of the length of the piece's radii and its height.
fn scaled(axes: [[f32; 3]; 3], piece: &Piece, height: f32, origin: [f32; 3]) -> [[f32; 3]; 4] {
    let [a, b] = piece.radii;
    let [x, y, z] = [(axes[0], a), (axes[1], b), (axes[2], height)].map(|(v, s)| v.map(|x| x * s));
    [x, y, z, origin]
}

/// A piece that is bound to the surface alone: at the point of its triangle, with the linear map, from the plane of the
/// feature at rest to the pose, that is nearest to what the skin does under it.
fn plain(piece: &Piece, height: f32, model: &Model, pose: &[[f32; 3]]) -> [[f32; 3]; 4] {
    let origin = piece.centre.of(model, pose);
    let at_rest = piece.centre.of(model, &model.rest);
    let [e, f, _] = piece.frame;
    let (mut square, mut mixed) = ([0.0f32; 3], [[0.0f32; 3]; 2]);
    for sample in &piece.samples {
        let way = minus(sample.of(model, &model.rest), at_rest);
        let [x, y] = [dot(way, e), dot(way, f)];
        let now = minus(sample.of(model, pose), origin);
        square = [square[0] + x * x, square[1] + x * y, square[2] + y * y];
        mixed = [(mixed[0], x), (mixed[1], y)].map(|(sum, t)| [0, 1, 2].map(|c| sum[c] + t * now[c]));
    }
    let [xx, xy, yy] = square;
    let det = xx * yy - xy * xy;
    if det <= 0.0 {
        return scaled(piece.frame, piece, height, origin);
    }
    let column = |p: f32, q: f32| [0, 1, 2].map(|c| (p * mixed[0][c] + q * mixed[1][c]) / det);
    let [along, across] = [column(yy, -xy), column(-xy, xx)];
    scaled([along, across, unit(cross(along, across))], piece, height, origin)
}

#[cfg(test)]
mod tests {
    use vrtm::{Device, DeviceSettings, ImageLayout, ImageView, PixelFormat, SolveOptions};

    use super::*;
    use crate::model::{length, mesh_source};
    use crate::solve::answer::Maps;

    /// A sheet of discs that is squashed to 0.7 of its width: on the skin they become ovals; carried they stay round,
    /// where the redirection shows what is painted.
    #[test]
    fn pieces_are_carried_as_rigid_bodies_and_squashed_on_the_plain_skin() {
        let model = Model::scene("squash");
        let settings = DeviceSettings { backend: vrtm::Backend::Cpu, ..DeviceSettings::default() };
        let device = Device::new(&settings).expect("a device");
        let mut asset = Asset::new(&device, &mesh_source(&model.mesh, &model.rest, 0)).expect("an asset");
        let canvas = Canvas::new(model.pages[0].rigidity.as_ref());
        let layout = ImageLayout::packed(canvas.size[0], canvas.size[1], PixelFormat::U16);
        let view = ImageView::new("rigidity", bytemuck::cast_slice(&canvas.texels), layout);
        asset.set_rigidity(0, Some(view.expect("a map"))).expect("set");
        let riders = Riders::new(&model, &asset, &[canvas]).expect("riders");
        assert_eq!(riders.pieces.len(), 36);
        let pose = &model.poses[0];
        asset.solve(Strided::from_f32x3(pose), &SolveOptions::default()).expect("solved");
        let placed = riders.place(&model, pose).expect("placed");
        let maps = Maps::fetch(&asset, 0, &asset.tile_report(0).expect("a report")).expect("maps");
        for (piece, Placed { plain, carried }) in riders.pieces.iter().zip(placed) {
            let along = |axes: [[f32; 3]; 4]| axes[0][0].hypot(axes[1][0]);
            let of_rest = piece.frame[0][0] * piece.radii[0];
            let of_rest = of_rest.hypot(piece.frame[1][0] * piece.radii[1]);
            assert!((along(plain) / of_rest - 0.7).abs() < 1e-3, "{plain:?}");
            for (axis, size) in [(0, piece.radii[0]), (1, piece.radii[1])] {
                assert!((length(carried[axis]) / size - 1.0).abs() < 1e-4, "{carried:?}");
            }
            // The warp that is fetched is that of the nodes, between which the disc's body has its mean.
            let [u, v] = maps.warped(piece.uv);
            let painted = [0.5 + 0.7 * (u - 0.5), v, 0.0];
            assert!(length(minus(carried[3], painted)) < 0.002, "{carried:?} {painted:?}");
            let bound = [0.5 + 0.7 * (piece.uv[0] - 0.5), piece.uv[1], 0.0];
            assert!(length(minus(plain[3], bound)) < 1e-4, "{plain:?} {bound:?}");
        }
    }
}
