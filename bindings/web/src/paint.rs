//! Rigidity from pictures and from a brush: `src/paint.ts` documents it.

use js_sys::{Float32Array, Object, Uint8Array, Uint32Array};
use vrtm::Error;
use vrtm_paint::{self as paint, Picture};
use wasm_bindgen::prelude::{JsValue, wasm_bindgen};

use crate::Result;
use crate::arrays::Array;
use crate::objects::object;

/// Columns and rows, from which the bytes of a texel and those of all maps are counted.
fn texels(name: &str, size: &[u32]) -> Result<[usize; 2]> {
    match size.iter().map(|&side| side as usize).collect::<Vec<_>>()[..] {
        [width, height] if width * height > 0 => Ok([width, height]),
        _ => Err(Error::argument(format!("{name}: columns and rows are expected")).into()),
    }
}

fn three(name: &str, numbers: &[f32]) -> Result<[f32; 3]> {
    let wrong = |_| Error::argument(format!("{name}: three numbers are expected"));
    Ok(<[f32; 3]>::try_from(numbers).map_err(wrong)?)
}

/// A map of another size, made of a picture.
fn map_of(
    data: &JsValue,
    own: &[u32],
    size: &[u32],
    make: impl FnOnce(Picture) -> Vec<u8>,
) -> Result<Uint8Array> {
    let data = Array::new("picture.data", data)?;
    let [own, size] = [texels("picture", own)?, texels("size", size)?];
    let wrong = || Error::argument(format!("picture.data: it has not four bytes for each of {own:?} texels"));
    let map = make(Picture::new(data.u8s()?, own).ok_or_else(wrong)?);
    Ok(Uint8Array::from(paint::fitted(&map, own, size).as_slice()))
}

#[wasm_bindgen(js_name = ofColour)]
pub fn of_colour(
    data: &JsValue,
    own: &[u32],
    size: &[u32],
    colour: &[f32],
    tolerance: f32,
) -> Result<Uint8Array> {
    let colour = three("colour", colour)?;
    map_of(data, own, size, |picture| paint::of_colour(picture, colour, tolerance))
}

#[wasm_bindgen(js_name = ofBrightness)]
pub fn of_brightness(data: &JsValue, own: &[u32], size: &[u32], threshold: f32) -> Result<Uint8Array> {
    map_of(data, own, size, |picture| {
        let threshold = if threshold == 0.0 { paint::otsu(&[picture]) } else { threshold };
        paint::of_brightness(picture, threshold)
    })
}

#[wasm_bindgen(js_name = ofDetail)]
pub fn of_detail(
    data: &JsValue,
    own: &[u32],
    size: &[u32],
    features: &JsValue,
    ceiling: f32,
) -> Result<Uint8Array> {
    let features = if features.is_undefined() { None } else { Some(Array::new("features", features)?) };
    let of = texels("size", size)?;
    let map = features.as_ref().map(Array::u8s).transpose()?;
    if map.is_some_and(|map| map.len() != of[0] * of[1]) {
        return Err(Error::argument(format!("features: it has not {of:?} texels")).into());
    }
    map_of(data, own, size, |picture| paint::of_detail(picture, map.map(|map| (map, of)), ceiling))
}

/// The surface of a mesh to paint on, in a pose.
#[wasm_bindgen]
pub struct Surface {
    surface: paint::Surface,
    /// Number of its vertices, and where they are; nowhere before the first pose.
    vertices: usize,
    positions: Vec<[f32; 3]>,
    /// Half floats of the redirection, and its columns and rows.
    delta: (Vec<u8>, [usize; 2]),
}

#[wasm_bindgen]
impl Surface {
    /// Reads a mesh of triangles.
    #[wasm_bindgen(constructor)]
    pub fn new(indices: &[u32], uv_indices: &[u32], uvs: &[f32], vertices: usize) -> Result<Surface> {
        let (corners, rest) = indices.as_chunks::<3>();
        let (uvs, _) = uvs.as_chunks::<2>();
        let is_in = |indices: &[u32], count| indices.iter().all(|&index| (index as usize) < count);
        let fits = rest.is_empty() && uv_indices.len() == indices.len();
        if !fits || !is_in(indices, vertices) || !is_in(uv_indices, uvs.len()) {
            return Err(
                Error::argument("mesh: its faces are triangles, with vertices and UVs in range").into()
            );
        }
        let uvs = uv_indices.as_chunks().0.iter().map(|of| of.map(|uv| uvs[uv as usize])).collect();
        let surface = paint::Surface::new(corners.to_vec(), uvs, vertices);
        Ok(Surface { surface, vertices, positions: Vec::new(), delta: (Vec::new(), [0, 0]) })
    }

    /// Sets the pose, and the redirection through which the texture is seen there.
    pub fn pose(&mut self, positions: &JsValue, delta: &JsValue, size: &[u32]) -> Result<()> {
        let positions = Array::new("positions", positions)?;
        let of_vertices = positions.strided(3)?;
        let size = texels("size", size)?;
        let delta = Array::new("delta", delta)?.halves()?.to_vec();
        if positions.len() != 3 * self.vertices || delta.len() != 4 * size[0] * size[1] {
            return Err(
                Error::argument("pose: it has not the mesh's vertices, or not the delta's texels").into()
            );
        }
        self.positions = (0..self.vertices).map(|k| of_vertices.get3(k).map(|x| x as f32)).collect();
        self.delta = (delta, size);
        Ok(())
    }

    /// The triangle that a ray hits first, the place there and its UV; nothing where it hits none.
    pub fn hit(&self, from: &[f32], way: &[f32]) -> Result<JsValue> {
        let ray = (three("from", from)?, three("way", way)?);
        if self.positions.is_empty() {
            return Ok(JsValue::NULL);
        }
        let found = self.surface.hit(&self.positions, ray).map(|(triangle, weights)| {
            let list = |numbers: &[f32]| numbers.iter().map(|&x| JsValue::from(x)).collect::<js_sys::Array>();
            let point = list(&paint::mixed(self.surface.corners(triangle, &self.positions), weights));
            let uv = list(&self.surface.uv(triangle, weights));
            object(&[("triangle", triangle.into()), ("point", point.into()), ("uv", uv.into())]).into()
        });
        Ok(found.unwrap_or(JsValue::NULL))
    }

    /// The texels of a map of `size` under a brush at a place of a triangle, and their coverage.
    pub fn dab(
        &self,
        triangle: usize,
        point: &[f32],
        radius: f32,
        softness: f32,
        size: &[u32],
    ) -> Result<Object> {
        let (ball, size) = ((three("point", point)?, radius), texels("size", size)?);
        if triangle >= self.surface.triangles() || self.positions.is_empty() {
            return Err(Error::argument("dab: there is no such triangle, or no pose yet").into());
        }
        let (delta, grid) = &self.delta;
        let delta = |column: usize, row: usize| {
            let at = 4 * (row * grid[0] + column);
            [at, at + 2].map(|at| half(u16::from_le_bytes([delta[at], delta[at + 1]])))
        };
        let mut found = Vec::new();
        for k in self.surface.disc(&self.positions, triangle, ball) {
            self.surface.fill((k, &self.positions), ball, size, (*grid, delta), |texel, away| {
                found.push((texel as u32, paint::cover(away, softness)));
            });
        }
        found.sort_unstable_by(|a, b| a.0.cmp(&b.0).then(b.1.total_cmp(&a.1)));
        found.dedup_by_key(|(texel, _)| *texel);
        let (texels, cover): (Vec<u32>, Vec<f32>) = found.into_iter().unzip();
        let lists =
            [("texels", Uint32Array::from(&*texels).into()), ("cover", Float32Array::from(&*cover).into())];
        Ok(object(&lists))
    }
}

/// The number of a half float that is finite.
fn half(bits: u16) -> f32 {
    let size = f32::from_bits(u32::from(bits & 0x7fff) << 13) * 2f32.powi(112);
    if bits >> 15 == 0 { size } else { -size }
}
