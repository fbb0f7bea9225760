//! vrtm for JavaScript, on the CPU: what `src/index.ts` makes its classes of. Without threads, and without a way to cancel a
//! call: it belongs into a worker.

#![cfg(target_arch = "wasm32")]

mod arrays;
mod objects;

use arrays::Array;
use js_sys::{Float32Array, Object, Uint16Array};
use objects::Fields;
use vrtm::{
    Backend, Device, DeviceSettings, Error, FetchKind, ImageLayout, ImageViewMut, LogEntry, LogLevel,
    MeshSource, OpenBorders, Overlap, PixelFormat, Quality, Seams, SolveOptions, Solver, TileSettings,
    UvSource, Weld, WeldBy,
};
use wasm_bindgen::prelude::{JsValue, wasm_bindgen};

/// An error of JavaScript: the kind is its name, and the message names the argument.
pub struct Thrown(js_sys::Error);

impl From<Error> for Thrown {
    fn from(error: Error) -> Thrown {
        let thrown = js_sys::Error::new(&error.message);
        thrown.set_name(&format!("{:?}", error.kind));
        Thrown(thrown)
    }
}

impl From<Thrown> for JsValue {
    fn from(thrown: Thrown) -> JsValue {
        thrown.0.into()
    }
}

type Result<T> = std::result::Result<T, Thrown>;

/// A mesh with its tiles, their maps and results.
#[wasm_bindgen]
pub struct Asset(vrtm::Asset);

#[wasm_bindgen]
impl Asset {
    /// Reads a mesh; warnings go to the console.
    ///
    /// # Errors
    /// An array that is missing or wrong, by name.
    #[wasm_bindgen(constructor)]
    pub fn new(mesh: &JsValue) -> Result<Asset> {
        let log = |entry: &LogEntry| {
            if entry.level == LogLevel::Warning {
                warn(entry.message);
            }
        };
        let settings = DeviceSettings {
            backend: Backend::Cpu,
            log: Some(std::sync::Arc::new(log)),
            ..DeviceSettings::default()
        };
        let device = Device::new(&settings)?;
        let asset = read_mesh(Fields::new("mesh", mesh)?, |source| vrtm::Asset::new(&device, source))?;
        Ok(Asset(asset))
    }

    /// The tiles in their order.
    ///
    /// # Errors
    /// A tile whose maps cannot be prepared.
    pub fn tiles(&mut self) -> Result<js_sys::Array> {
        let tiles = js_sys::Array::new();
        for tile in 0..self.0.tile_count() {
            tiles.push(&objects::tile(&self.0.tile_mut(tile).info()?));
        }
        Ok(tiles)
    }

    /// Sets or removes a tile's rigidity.
    ///
    /// # Errors
    /// An array of another length or type.
    #[wasm_bindgen(js_name = setRigidity)]
    pub fn set_rigidity(&mut self, tile: usize, values: &JsValue, width: u32, height: u32) -> Result<()> {
        let values = Array::of_map("values", values)?;
        let image = values.as_ref().map(|values| values.image("values", [width, height])).transpose()?;
        Ok(self.0.tile_mut(tile).set_rigidity(image)?)
    }

    /// Sets or removes a tile's warp mask.
    ///
    /// # Errors
    /// An array of another length or type.
    #[wasm_bindgen(js_name = setMask)]
    pub fn set_mask(&mut self, tile: usize, values: &JsValue, width: u32, height: u32) -> Result<()> {
        let values = Array::of_map("values", values)?;
        let image = values.as_ref().map(|values| values.image("values", [width, height])).transpose()?;
        Ok(self.0.tile_mut(tile).set_mask(image)?)
    }

    /// Replaces a part of a tile's rigidity: `part` is the first column and row, and the columns and rows.
    ///
    /// # Errors
    /// A part that is not inside of the map that was set, or a map of another size or type.
    #[wasm_bindgen(js_name = updateRigidity)]
    pub fn update_rigidity(
        &mut self,
        tile: usize,
        values: &JsValue,
        width: u32,
        height: u32,
        part: &[u32],
    ) -> Result<()> {
        let values = Array::new("values", values)?;
        let &[x, y, columns, rows] = part else {
            return Err(Error::argument("part: it has four numbers").into());
        };
        let image = values.image("values", [width, height])?;
        Ok(self.0.tile_mut(tile).update_rigidity(image, [x, y], [columns, rows])?)
    }

    /// Changes those settings of a tile that are given.
    ///
    /// # Errors
    /// A setting that does not exist, or a value out of its range.
    #[wasm_bindgen(js_name = setSettings)]
    pub fn set_settings(&mut self, tile: usize, settings: &JsValue) -> Result<()> {
        let mut of_tile = self.0.tile_mut(tile).settings()?;
        read_settings(Fields::new("settings", settings)?, &mut of_tile)?;
        Ok(self.0.tile_mut(tile).set_settings(&of_tile)?)
    }

    /// Solves all tiles for a pose.
    ///
    /// # Errors
    /// Positions of another number, or that are not finite; options that do not exist.
    pub fn solve(&mut self, positions: &JsValue, options: &JsValue) -> Result<()> {
        let positions = Array::new("positions", positions)?;
        let options = read_options(Fields::new("options", options)?)?;
        Ok(self.0.solve(positions.strided("positions", 3)?, &options)?)
    }

    /// A result as an image, two numbers per texel, first row at v = 1: `Float32Array`, or `Uint16Array` with the bits of half
    /// floats.
    ///
    /// # Errors
    /// Nothing was solved yet; a kind that does not exist; a size of 0.
    pub fn fetch(&self, tile: usize, kind: &str, width: u32, height: u32, half: bool) -> Result<JsValue> {
        let kind = match kind {
            "uv" => FetchKind::Redirection,
            "delta" => FetchKind::RedirectionDelta,
            "udim" => FetchKind::RedirectionUdim,
            "warp" => FetchKind::Warp,
            _ => return Err(Error::argument(format!("kind: '{kind}' is not uv, delta, udim or warp")).into()),
        };
        let format = if half { PixelFormat::F16 } else { PixelFormat::F32 };
        let layout = ImageLayout::packed(width, height, format);
        let mut bytes = vec![0; 2 * format.size() * width as usize * height as usize];
        self.0.tile(tile).fetch(kind, &mut ImageViewMut::new("image", &mut bytes, layout)?)?;
        let bytes = js_sys::Uint8Array::from(bytes.as_slice()).buffer();
        Ok(if half { Uint16Array::new(&bytes).into() } else { Float32Array::new(&bytes).into() })
    }

    /// The redirected UV of each corner of a UV set, two numbers each.
    ///
    /// # Errors
    /// Nothing was solved yet; a set that does not exist.
    #[wasm_bindgen(js_name = cornerUvs)]
    pub fn corner_uvs(&self, uv_set: u32) -> Result<Float32Array> {
        let mut uvs = vec![[0.0; 2]; self.0.info().corners as usize];
        self.0.corner_uvs(uv_set, &mut uvs)?;
        Ok(Float32Array::from(uvs.as_flattened()))
    }

    /// Figures of a tile's last solve.
    ///
    /// # Errors
    /// Nothing was solved yet.
    pub fn report(&self, tile: usize) -> Result<Object> {
        Ok(objects::report(&self.0.tile(tile).report()?))
    }
}

#[wasm_bindgen]
extern "C" {
    #[wasm_bindgen(js_namespace = console, js_name = warn)]
    fn warn(line: &str);
}

fn read_mesh<R>(mut fields: Fields, make: impl FnOnce(&MeshSource) -> vrtm::Result<R>) -> vrtm::Result<R> {
    let positions = fields.array("positions")?;
    let [indices, uvs] = [fields.array("indices")?, fields.array("uvs")?];
    let [counts, uv_indices] = [fields.array_if("faceCounts")?, fields.array_if("uvIndices")?];
    let counts = counts.as_ref().map(|counts| counts.u32s("mesh.faceCounts")).transpose()?;
    let uv_indices = uv_indices.as_ref().map(|indices| indices.u32s("mesh.uvIndices")).transpose()?;
    let by_position = fields.flag("weldByPosition")?.unwrap_or(false);
    let by = if by_position { WeldBy::Position } else { WeldBy::Index };
    let max_layers = fields.number("maxLayers")?.unwrap_or(0.0) as u32;
    fields.end()?;
    make(&MeshSource {
        positions: positions.strided("mesh.positions", 3)?,
        face_counts: counts.as_deref(),
        indices: &indices.u32s("mesh.indices")?,
        uvs: UvSource { u: uvs.strided("mesh.uvs", 2)?, v: None, indices: uv_indices.as_deref() },
        weld: Weld { by, ..Weld::default() },
        max_layers,
        ..MeshSource::default()
    })
}

fn read_options(mut fields: Fields) -> vrtm::Result<SolveOptions> {
    let mut options = SolveOptions::default();
    let qualities = [("draft", Quality::Draft), ("normal", Quality::Normal)];
    fields.choice("quality", &qualities, &mut options.quality)?;
    fields.choice("solver", &[("descent", Solver::Descent), ("pbd", Solver::Pbd)], &mut options.solver)?;
    if let Some(ms) = fields.number("timeBudget")? {
        let budget = std::time::Duration::try_from_secs_f64(ms / 1000.0);
        let wrong = |_| Error::argument(format!("options.timeBudget: {ms} is no time in milliseconds"));
        options.time_budget = Some(budget.map_err(wrong)?);
    }
    if let Some(most) = fields.number("maxCorrections")? {
        options.max_corrections = Some(most as u32);
    }
    options.tolerance = fields.number("tolerance")?.map(|x| x as f32);
    options.temporal_weight = fields.number("temporalWeight")?.map_or(options.temporal_weight, |x| x as f32);
    options.warm = fields.flag("warm")?.unwrap_or(options.warm);
    options.measure = fields.flag("measure")?.unwrap_or(options.measure);
    fields.end()?;
    Ok(options)
}

fn read_settings(mut fields: Fields, settings: &mut TileSettings) -> vrtm::Result<()> {
    if let Some(size) = fields.number("grid")? {
        // 0 leaves the size to the library.
        settings.grid = [Some(size as u32).filter(|&size| size > 0); 2];
    }
    fields.choice(
        "overlap",
        &[("fixed", Overlap::Fixed), ("firstFace", Overlap::FirstFace)],
        &mut settings.overlap,
    )?;
    let seams = [("shut", Seams::Shut), ("continue", Seams::Continue), ("keep", Seams::Keep)];
    fields.choice("seams", &seams, &mut settings.seams)?;
    let borders = [("fixed", OpenBorders::Fixed), ("slide", OpenBorders::Slide)];
    fields.choice("openBorders", &borders, &mut settings.open_borders)?;
    for setting in TileSettings::SETTINGS {
        let Some(number) = settings.number(setting.name) else { continue };
        if let Some(value) = fields.number(&objects::camel(setting.name))? {
            *number = value as f32;
        }
    }
    fields.end()
}
