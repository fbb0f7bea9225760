//! vrtm for JavaScript, on the CPU: what `src/index.ts` makes its classes of. Without threads, and without a way to
//! cancel a call: it belongs into a worker.

#![cfg(target_arch = "wasm32")]

mod arrays;
mod objects;
mod outputs;
mod paint;

use std::num::NonZeroU32;

use arrays::Array;
use js_sys::{Float32Array, Function, Object};
use objects::{Fields, list, natural};
use outputs::Output;
use vrtm::{
    Backend, Bind, Carrier, CarrierSettings, Device, DeviceSettings, Error, Fetch, Fit, LogEntry, MeshSource,
    OpenBorders, Overlap, Quality, Scale, Seams, SolveOptions, Solver, TileSettings, UvSource, Weld, WeldBy,
};
use wasm_bindgen::prelude::{JsValue, wasm_bindgen};

/// An error, which is thrown as an array of its kind and its message: nothing else that leaves the module is one.
pub struct Thrown(Error);

impl From<Error> for Thrown {
    fn from(error: Error) -> Thrown {
        Thrown(error)
    }
}

impl From<Thrown> for JsValue {
    fn from(Thrown(error): Thrown) -> JsValue {
        objects::pair([&*format!("{:?}", error.kind), &*error.message])
    }
}

/// A function of this thread.
struct Log(Function);

// SAFETY: it is called and dropped on its own thread: helpers of a call write no lines, and an asset stays in its
// worker.
unsafe impl Send for Log {}
// SAFETY: as above.
unsafe impl Sync for Log {}

impl Log {
    fn tell(&self, entry: &LogEntry) {
        // What it throws, it has to tell itself.
        let _ = self.0.call1(&JsValue::NULL, &objects::log_entry(entry));
    }
}

/// The module and its memory, for workers that help.
#[cfg(target_feature = "atomics")]
#[wasm_bindgen]
pub fn shared() -> js_sys::Array {
    js_sys::Array::of2(&wasm_bindgen::module(), &wasm_bindgen::memory())
}

/// A worker's life: it helps the others that share its memory.
#[cfg(target_feature = "atomics")]
#[wasm_bindgen]
pub fn help() {
    vrtm::serve()
}

/// Carriers by their numbers, which are drawn at random: in no worker has another asset one of them.
type Carriers = Vec<(f64, Carrier)>;

type Result<T> = std::result::Result<T, Thrown>;

/// A mesh with its tiles, their maps, carriers and results.
#[wasm_bindgen]
pub struct Asset {
    asset: vrtm::Asset,
    carriers: Carriers,
}

// `src/methods.ts` documents them, with their errors.
#[wasm_bindgen]
impl Asset {
    /// Reads a mesh; `log` is called with each line of the log. Solves have `threads`, as far as workers wait to help.
    #[wasm_bindgen(constructor)]
    pub fn new(mesh: &JsValue, log: Function, threads: f64) -> Result<Asset> {
        let log = Log(log);
        let told = move |entry: &LogEntry| log.tell(entry);
        let settings = DeviceSettings {
            backend: Backend::Cpu,
            threads: NonZeroU32::new(natural("threads", threads)?),
            log: Some(std::sync::Arc::new(told)),
            ..DeviceSettings::default()
        };
        let device = Device::new(&settings)?;
        let asset = read_mesh(Fields::new("mesh.", mesh)?, |source| vrtm::Asset::new(&device, source))?;
        Ok(Asset { asset, carriers: Vec::new() })
    }

    /// The tiles in their order. None is prepared: the first solve warns of what it finds before that.
    pub fn tiles(&self) -> js_sys::Array {
        let tile = |tile| {
            let tile = self.asset.tile(tile);
            let (udim, uv_set, (layer, _)) = (tile.udim(), tile.uv_set(), tile.layer());
            objects::object(&[("udim", udim.into()), ("uvSet", uv_set.into()), ("layer", layer.into())])
        };
        (0..self.asset.tile_count()).map(tile).collect()
    }

    /// Cells of the grid in u and v that a tile has with its present rigidity and settings.
    pub fn grid(&mut self, tile: f64) -> Result<JsValue> {
        Ok(objects::pair(self.tile(tile)?.grid()?))
    }

    /// Sets or removes a tile's rigidity or warp mask.
    #[wasm_bindgen(js_name = setMap)]
    pub fn set_map(
        &mut self,
        is_mask: bool,
        tile: f64,
        values: &JsValue,
        width: f64,
        height: f64,
    ) -> Result<()> {
        let size = [natural("width", width)?, natural("height", height)?];
        let is_none = values.is_null() || values.is_undefined();
        let values = if is_none { None } else { Some(Array::new("values", values)?) };
        let image = values.as_ref().map(|values| values.image(size)).transpose()?;
        let mut tile = self.tile(tile)?;
        Ok(if is_mask { tile.set_mask(image) } else { tile.set_rigidity(image) }?)
    }

    /// Replaces a part of a tile's rigidity: `part` is the first column and row, and the columns and rows.
    #[wasm_bindgen(js_name = updateRigidity)]
    pub fn update_rigidity(
        &mut self,
        tile: f64,
        values: &JsValue,
        width: f64,
        height: f64,
        part: &JsValue,
    ) -> Result<()> {
        let values = Array::new("values", values)?;
        let part = list("part", part)?;
        let part = part.iter().map(|number| natural("part", number.as_f64().unwrap_or(f64::NAN)));
        let &[x, y, columns, rows] = part.collect::<vrtm::Result<Vec<u32>>>()?.as_slice() else {
            return Err(Error::argument("part: it has four numbers").into());
        };
        let size = [natural("width", width)?, natural("height", height)?];
        Ok(self.tile(tile)?.update_rigidity(values.image(size)?, [x, y], [columns, rows])?)
    }

    /// Changes those settings of a tile that are given.
    #[wasm_bindgen(js_name = setSettings)]
    pub fn set_settings(&mut self, tile: f64, settings: &JsValue) -> Result<()> {
        let mut tile = self.tile(tile)?;
        let mut of_tile = tile.settings()?;
        read_settings(Fields::new("settings.", settings)?, &mut of_tile)?;
        Ok(tile.set_settings(&of_tile)?)
    }

    /// Solves all tiles for a pose, and fetches outputs of that solve.
    pub fn redirect(&mut self, positions: &JsValue, options: &JsValue, fetches: &JsValue) -> Result<Object> {
        let positions = Array::new("positions", positions)?;
        let options = read_options(Fields::new("options.", options)?)?;
        let Asset { asset, carriers } = self;
        let mut outputs = Vec::new();
        for (k, fetch) in list("fetches", fetches)?.iter().enumerate() {
            let find = |number| find(carriers, number);
            outputs.push(Output::read(Fields::new(format!("fetches[{k}]."), fetch)?, find)?);
        }
        let mut fetches = outputs.iter_mut().map(Output::fetch).collect::<vrtm::Result<Vec<Fetch>>>()?;
        asset.redirect(positions.strided(3)?, &options, &mut fetches)?;
        let [images, carried, reports] = std::array::from_fn(|_| js_sys::Array::new());
        for output in outputs {
            if matches!(output, Output::Image { .. }) { &images } else { &carried }.push(&output.into_js());
        }
        for tile in 0..asset.tile_count() {
            reports.push(&objects::report(&asset.tile(tile).report()?));
        }
        let report = asset.report()?;
        let values = [("scale", report.scale.into()), ("scaleSpread", report.scale_spread.into())];
        let lists = [("images", images.into()), ("carried", carried.into()), ("reports", reports.into())];
        Ok(objects::object(&[&lists[..], &values[..]].concat()))
    }

    /// An output of the last solve.
    pub fn fetch(&self, fetch: &JsValue) -> Result<JsValue> {
        let mut output = Output::read(Fields::new("", fetch)?, |number| find(&self.carriers, number))?;
        self.asset.fetch_all(&mut [output.fetch()?])?;
        Ok(output.into_js())
    }

    /// The redirected UV of each corner of a UV set, two numbers each.
    #[wasm_bindgen(js_name = cornerUvs)]
    pub fn corner_uvs(&self, uv_set: f64) -> Result<Float32Array> {
        let mut uvs = vec![[0.0; 2]; self.asset.info().corners as usize];
        self.asset.corner_uvs(natural("uvSet", uv_set)?, &mut uvs)?;
        Ok(Float32Array::from(uvs.as_flattened()))
    }

    /// Figures of a tile's last solve.
    pub fn report(&self, tile: f64) -> Result<Object> {
        Ok(objects::report(&self.asset.tile(natural("tile", tile)? as usize).report()?))
    }

    /// Binds points to the surface at rest, and returns the number of their carrier.
    pub fn carrier(&mut self, settings: &JsValue) -> Result<f64> {
        let carrier =
            read_carrier(Fields::new("carrier.", settings)?, |settings| self.asset.carrier(settings))?;
        self.carriers.push((js_sys::Math::random(), carrier));
        Ok(self.carriers[self.carriers.len() - 1].0)
    }

    /// Sizes of a carrier, the binding of its points, and what the last fetch found.
    #[wasm_bindgen(js_name = carrierInfo)]
    pub fn carrier_info(&self, number: f64) -> Result<Object> {
        Ok(objects::carrier(find(&self.carriers, number)?))
    }

    /// Frees a carrier, if it is not freed yet.
    #[wasm_bindgen(js_name = freeCarrier)]
    pub fn free_carrier(&mut self, number: f64) {
        self.carriers.retain(|carrier| carrier.0 != number);
    }
}

impl Asset {
    fn tile(&mut self, tile: f64) -> vrtm::Result<vrtm::TileMut<'_>> {
        Ok(self.asset.tile_mut(natural("tile", tile)? as usize))
    }
}

fn find(carriers: &Carriers, number: f64) -> vrtm::Result<&Carrier> {
    let found = carriers.iter().find(|carrier| carrier.0 == number);
    let wrong = || Error::argument("carrier: it was freed, or it is no carrier of this asset");
    found.map(|(_, carrier)| carrier).ok_or_else(wrong)
}

fn read_mesh<R>(mut fields: Fields, make: impl FnOnce(&MeshSource) -> vrtm::Result<R>) -> vrtm::Result<R> {
    let [positions, indices] = [fields.array("positions")?, fields.array("indices")?];
    let counts = fields.u32s_if("faceCounts")?;
    let mut sets = vec![(fields.array("uvs")?, fields.u32s_if("uvIndices")?)];
    let further = fields.take("uvSets").map(|further| list("mesh.uvSets", &further)).transpose()?;
    for (k, set) in further.iter().flatten().enumerate() {
        let mut set = Fields::new(format!("mesh.uvSets[{k}]."), set)?;
        sets.push((set.array("uvs")?, set.u32s_if("uvIndices")?));
        set.end()?;
    }
    let mut sources = Vec::new();
    for (uvs, indices) in &sets {
        sources.push(UvSource { u: uvs.strided(2)?, v: None, indices: indices.as_deref() });
    }
    let by_position = fields.flag("weldByPosition")?.unwrap_or(false);
    let by = if by_position { WeldBy::Position } else { WeldBy::Index };
    let max_layers = fields.natural("maxLayers")?.unwrap_or(0);
    fields.end()?;
    make(&MeshSource {
        positions: positions.strided(3)?,
        face_counts: counts.as_deref(),
        indices: &indices.u32s()?,
        uvs: sources[0],
        uv_sets: &sources[1..],
        weld: Weld { by, ..Weld::default() },
        max_layers,
        ..MeshSource::default()
    })
}

fn read_carrier(
    mut fields: Fields,
    make: impl FnOnce(&CarrierSettings) -> vrtm::Result<Carrier>,
) -> vrtm::Result<Carrier> {
    let [uvs, corners, positions] =
        [fields.array_if("uvs")?, fields.array_if("corners")?, fields.array_if("positions")?];
    let [heights, frames] = [fields.array_if("heights")?, fields.array_if("frames")?];
    let pieces = fields.u32s_if("pieces")?;
    let (uv_set, skirt) = (fields.natural("uvSet")?, fields.number("skirt")?);
    let mut fit = Fit::default();
    let fits = [("feature", Fit::Feature), ("surface", Fit::Surface), ("none", Fit::None)];
    fields.choice("fit", &fits, &mut fit)?;
    let (layers, of_faces, weights);
    let (by, points) = match (&uvs, &corners, &positions) {
        (Some(uvs), None, None) => {
            layers = fields.u32s_if("layers")?;
            (Bind::Uv { uvs: uvs.strided(2)?, layers: layers.as_deref() }, uvs.len() / 2)
        }
        (None, Some(corners), None) => {
            (of_faces, weights) = (corners.u32s()?, fields.array("weights")?);
            let (corners, []) = of_faces.as_chunks() else {
                return Err(fields.error("corners", "there are three for each point"));
            };
            (Bind::Corners { corners, weights: weights.strided(3)? }, corners.len())
        }
        (None, None, Some(positions)) => {
            let farthest = fields.number("farthest")?;
            (Bind::Nearest { positions: positions.strided(3)?, farthest }, positions.len() / 3)
        }
        _ => {
            return Err(Error::argument(
                "carrier: one of uvs, corners and positions says where the points are",
            ));
        }
    };
    fields.end()?;
    // Nine numbers of a matrix for each point, or the four of a quaternion.
    let of_frame = |frames: &Array| if frames.len() == 9 * points { 9 } else { 4 };
    make(&CarrierSettings {
        uv_set: uv_set.unwrap_or(0),
        heights: heights.as_ref().map(|heights| heights.strided(1)).transpose()?,
        frames: frames.as_ref().map(|frames| frames.strided(of_frame(frames))).transpose()?,
        pieces: pieces.as_deref(),
        fit,
        skirt: skirt.unwrap_or(0.0),
        ..CarrierSettings::new(by)
    })
}

fn read_options(mut fields: Fields) -> vrtm::Result<SolveOptions> {
    let mut options = SolveOptions::default();
    let qualities = [("draft", Quality::Draft), ("normal", Quality::Normal)];
    fields.choice("quality", &qualities, &mut options.quality)?;
    fields.choice("solver", &[("descent", Solver::Descent), ("pbd", Solver::Pbd)], &mut options.solver)?;
    fields.choice("scale", &[("keep", Scale::Keep), ("follow", Scale::Follow)], &mut options.scale)?;
    if let Some(ms) = fields.number("timeBudget")? {
        let budget = std::time::Duration::try_from_secs_f64(ms / 1000.0);
        let wrong = |_| Error::argument(format!("options.timeBudget: {ms} is no time in milliseconds"));
        options.time_budget = Some(budget.map_err(wrong)?);
    }
    options.max_corrections = fields.natural("maxCorrections")?.or(options.max_corrections);
    options.tolerance = fields.number("tolerance")?.map(|x| x as f32);
    options.temporal_weight = fields.number("temporalWeight")?.map_or(options.temporal_weight, |x| x as f32);
    // For workers, which have replaced nothing when they come here.
    fields.flag("replace")?;
    options.warm = fields.flag("warm")?.unwrap_or(options.warm);
    options.measure = fields.flag("measure")?.unwrap_or(options.measure);
    fields.end()?;
    Ok(options)
}

fn read_settings(mut fields: Fields, settings: &mut TileSettings) -> vrtm::Result<()> {
    if let Some(size) = fields.natural("grid")? {
        // 0 leaves the size to the library.
        settings.grid = [Some(size).filter(|&size| size > 0); 2];
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
