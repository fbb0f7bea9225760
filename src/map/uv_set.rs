//! Redirections written as UVs of another UV set: a tile's map is looked up by the UVs that the warp was solved in, and
//! gives those that textures use.

use glam::DVec2;

use crate::solved::Solved;
use vrtm_beyond::bands::Bands;
use vrtm_core::allocation::{Vec, vec};
use vrtm_core::image::ImagePart;
use vrtm_core::mesh::triangle::{barycentrics, point};
use vrtm_core::mesh::{Mesh, NONE, TileMesh};
use vrtm_core::strain::exact::Locator;
use vrtm_core::team::Team;

/// Texels beside a chart up to this far from it go on with the UVs of the chart's nearest triangle, so that a renderer
/// that interpolates between texels reads the chart's own UVs at its border.
const MARGIN: usize = 2;

/// The UVs of another set on the triangles of a tile, and the triangle under each texel of an image.
pub(crate) struct OtherSet<'a> {
    surface: &'a TileMesh,
    /// Per triangle, the UVs of its corners in the other set.
    uvs: Vec<[DVec2; 3]>,
    part: ImagePart,
    is_delta: bool,
    /// Per texel, the triangle under its centre, or the nearest one within `MARGIN`, or `NONE`.
    under: Bands<u32>,
}

impl<'a> OtherSet<'a> {
    /// The UVs of set `uv_set` for a result; `is_delta`: less those of the texel's own point of the surface.
    pub fn new(
        mesh: &Mesh,
        solved: &'a Solved,
        uv_set: u32,
        is_delta: bool,
        part: &ImagePart,
    ) -> OtherSet<'a> {
        let surface = solved.extended.as_deref().unwrap_or(&solved.mesh);
        let is_own = |tile: &TileMesh| {
            let id = |tile: &TileMesh| (tile.uv_set, tile.udim, tile.layer);
            id(tile) == id(surface)
        };
        let set = |uvs| OtherSet { surface, uvs, part: *part, is_delta, under: Bands::new(part, NONE) };
        if uv_set == surface.uv_set {
            let place = |t: usize| match surface.source(t) {
                Some(source) => (source.uv, mesh.tiles[source.tile as usize].origin()),
                None => (surface.triangles[t].uv, surface.origin()),
            };
            let of = |t: usize| {
                let (uvs, origin) = place(t);
                uvs.map(|uv| uv + origin)
            };
            return set((0..surface.triangles.len()).map(of).collect());
        }
        let own = mesh.tiles.iter().position(|tile| is_own(tile)).unwrap_or(0);
        let of_set = &mesh.corners[uv_set as usize];
        let of_number = |tile: usize, number: u32| {
            let corners = mesh.corners_of[tile][number as usize];
            corners.map(|corner| DVec2::from(of_set[corner as usize].uv.map(f64::from)))
        };
        let mut uvs: Vec<[DVec2; 3]> = surface.numbers().iter().map(|&n| of_number(own, n)).collect();
        let mut numbers: Vec<Option<Vec<u32>>> = vec![None; mesh.tiles.len()];
        for source in &surface.sources {
            let tile = source.tile as usize;
            let numbers = numbers[tile].get_or_insert_with(|| mesh.tiles[tile].numbers());
            let of_source = of_number(tile, numbers[source.triangle as usize]);
            let corners = mesh.tiles[tile].triangles[source.triangle as usize].uv;
            uvs.push(source.uv.map(|uv| point(of_source, barycentrics(corners, uv))));
        }
        set(uvs)
    }

    /// Finds the triangles under the texels' centres.
    pub fn draw(self, team: &Team) -> Drawn<'a> {
        let OtherSet { surface, uvs, part, is_delta, mut under } = self;
        let [width, height] = part.extent();
        let size = DVec2::new(part.size[0] as f64, part.size[1] as f64);
        let put = |t: usize, _, _, texel: &mut u32| *texel = if *texel == NONE { t as u32 } else { *texel };
        under.draw(team, &surface.triangles[..surface.own()], |triangle| triangle.uv, put);
        let under = under.into_texels();
        let covered = under.iter().map(|&t| t != NONE).collect();
        let under = (0..MARGIN).fold(under, |under, _| grown(team, &under, width));
        let lattice = [width - 1, height - 1];
        let locator = Locator::of(surface, lattice, |uv| uv * size - 0.5, under);
        Drawn { surface, uvs, size, width, is_delta, locator, covered }
    }
}

/// An image whose triangles have been found.
pub(crate) struct Drawn<'a> {
    surface: &'a TileMesh,
    uvs: Vec<[DVec2; 3]>,
    size: DVec2,
    width: usize,
    is_delta: bool,
    locator: Locator,
    /// Per texel, whether a chart covers its centre.
    covered: Vec<bool>,
}

impl Drawn<'_> {
    /// The channels of a texel whose redirected UV within the tile is `uv`, `delta` away from its centre: 0 beside all
    /// charts, and as the fourth channel whether a chart covers the centre.
    pub fn texel(&self, x: usize, y: usize, uv: [f64; 2], delta: [f64; 2]) -> [f64; 4] {
        let home = self.locator.under(x, y);
        let value = if home == NONE { DVec2::ZERO } else { self.value(home, uv.into(), delta.into()) };
        let covered = f64::from(u8::from(self.covered[y * self.width + x]));
        [value.x, value.y, 0.0, covered]
    }

    fn value(&self, home: u32, uv: DVec2, delta: DVec2) -> DVec2 {
        let at = |triangle: u32, uv: DVec2| {
            let corners = self.surface.triangles[triangle as usize].uv;
            point(self.uvs[triangle as usize], barycentrics(corners, uv))
        };
        let own = || at(home, uv - delta);
        if delta == DVec2::ZERO {
            return if self.is_delta { DVec2::ZERO } else { own() };
        }
        let there = at(self.locator.find(uv * self.size - 0.5, home), uv);
        if self.is_delta { there - own() } else { there }
    }
}

/// The triangles under texels, and for texels without one that of a neighbour.
fn grown(team: &Team, under: &[u32], width: usize) -> Vec<u32> {
    let height = under.len() / width;
    let at = |x: i64, y: i64| {
        let inside = (0..width as i64).contains(&x) && (0..height as i64).contains(&y);
        if inside { under[y as usize * width + x as usize] } else { NONE }
    };
    let mut grown = vec![NONE; under.len()];
    let mut rows: Vec<&mut [u32]> = grown.chunks_mut(width).collect();
    team.fill_large(&mut rows, |y, row| {
        for (x, triangle) in row.iter_mut().enumerate() {
            let near = [(0, 0), (-1, 0), (1, 0), (0, -1), (0, 1), (-1, -1), (1, -1), (-1, 1), (1, 1)];
            let found =
                near.into_iter().map(|(dx, dy)| at(x as i64 + dx, y as i64 + dy)).find(|&t| t != NONE);
            *triangle = found.unwrap_or(NONE);
        }
    });
    grown
}
