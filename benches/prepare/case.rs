//! One case: sixteen square charts that cover a share of a tile, with discs of rigidity all over it.

use std::num::NonZeroU32;
use std::time::Instant;

use vrtm::{
    Backend, Device, DeviceSettings, FetchKind, ImageLayout, ImageView, ImageViewMut, PixelFormat,
    SolveOptions, Strided, TileSettings,
};

use super::memory;
use vrtm_testkit::sixteen::{bulged, discs, sixteen_asset, sixteen_charts};

/// Texels from one disc to the next.
const PITCH: usize = 32;
/// Rows of the map that are fetched at once: the whole map would be larger than the grid.
const BAND: u32 = 128;

pub struct Case {
    pub grid: u32,
    pub share: f64,
    pub solve: bool,
    pub threads: Option<u32>,
}

/// Begins the table of rows. Bytes exclude the memory of the caller's mesh and map.
pub const HEAD: &str = "\
    | grid | share | active nodes | s | peak MiB | held MiB | peak / held | bytes held per node | first solve s \
    | next s | map s | peak MiB | held, bytes per node |\n|---|---|---|---|---|---|---|---|---|---|---|---|---|";

impl Case {
    /// Measures the case in this process. Returns its row.
    pub fn run(&self) -> Result<String, String> {
        let settings = DeviceSettings {
            backend: Backend::Cpu,
            threads: self.threads.and_then(NonZeroU32::new),
            ..DeviceSettings::default()
        };
        let device = Device::new(&settings).map_err(|e| e.to_string())?;
        let (positions, ..) = sixteen_charts(self.share);
        let n = self.grid as usize;
        let texels = discs(n, PITCH);
        let before = memory::resident();
        let mut asset = sixteen_asset(&device, self.share).map_err(|e| e.to_string())?;
        let layout = ImageLayout::packed(self.grid, self.grid, PixelFormat::U8);
        let map = ImageView::new("rigidity", &texels, layout).map_err(|e| e.to_string())?;
        asset.tile_mut(0).set_rigidity(Some(map)).map_err(|e| e.to_string())?;
        let settings = TileSettings { grid: [Some(self.grid); 2], ..TileSettings::default() };
        asset.tile_mut(0).set_settings(&settings).map_err(|e| e.to_string())?;
        drop(texels);
        // The caller has freed its map by then, as a host would.
        let before = before.saturating_sub((n * n) as u64);
        memory::restart_peak();
        let start = Instant::now();
        let info = asset.tile_mut(0).info().map_err(|e| e.to_string())?;
        let seconds = start.elapsed().as_secs_f64();
        let (peak, held) = (memory::peak() - before, memory::resident() - before);
        let mib = |bytes: u64| bytes as f64 / f64::from(1 << 20);
        let per_node = |bytes: u64| bytes as f64 / info.movable_nodes.max(1) as f64;
        let mut row = format!(
            "| {}² | {:.0} % | {} | {seconds:.3} | {:.0} | {:.0} | {:.2} | {:.1} |",
            self.grid,
            100.0 * self.share,
            info.movable_nodes,
            mib(peak),
            mib(held),
            peak as f64 / held as f64,
            per_node(held)
        );
        if self.solve {
            memory::restart_peak();
            let mut seconds = [0.0; 2];
            for (k, seconds) in seconds.iter_mut().enumerate() {
                let pose = bulged(&positions, 0.2 + 0.1 * k as f32);
                let start = Instant::now();
                asset
                    .solve(Strided::from_slice(&pose), &SolveOptions::default())
                    .map_err(|e| e.to_string())?;
                *seconds = start.elapsed().as_secs_f64();
            }
            let report = asset.tile(0).report().map_err(|e| e.to_string())?;
            if report.folds > 0 || report.energy >= report.energy_before {
                return Err(format!("{} folds, energy {}", report.folds, report.energy));
            }
            let held = memory::resident() - before;
            let start = Instant::now();
            let layout = ImageLayout::packed(self.grid, BAND, PixelFormat::F32);
            let mut image = vec![0; self.grid as usize * BAND as usize * 8];
            for first in (0..self.grid).step_by(BAND as usize) {
                ImageViewMut::new("image", &mut image, layout)
                    .and_then(|view| view.part_of("image", [self.grid; 2], [0, first]))
                    .and_then(|mut view| asset.tile(0).fetch(FetchKind::Redirection, &mut view))
                    .map_err(|e| e.to_string())?;
            }
            let fetched = start.elapsed().as_secs_f64();
            let [first, next] = seconds;
            let (peak, held) = (mib(memory::peak() - before), per_node(held));
            row += &format!(" {first:.2} | {next:.2} | {fetched:.2} | {peak:.0} | {held:.0} |");
        }
        Ok(row)
    }
}
