//! One case: sixteen square charts that cover a share of a tile, with discs of rigidity all over it.

use std::num::NonZeroU32;
use std::time::Instant;

use serde_json::{Value, json};
use vrtm::{
    Backend, Device, DeviceSettings, FetchKind, ImageLayout, ImageView, ImageViewMut, PixelFormat,
    SolveOptions, Strided, TileSettings,
};

use super::memory;
use super::sixteen::{bulged, discs, sixteen_asset, sixteen_charts};

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

/// The cost of a case. Bytes exclude the memory of the caller's mesh and map.
pub struct Outcome {
    grid: u64,
    share: f64,
    nodes: u64,
    seconds: f64,
    peak: u64,
    held: u64,
    /// Seconds of the first solve, of the second solve and of fetching the map; bytes at the peak; bytes held.
    solve: Option<[f64; 5]>,
}

impl Case {
    pub fn run(&self) -> Result<Outcome, String> {
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
        asset.set_rigidity(0, Some(map)).map_err(|e| e.to_string())?;
        let settings = TileSettings { grid: [Some(self.grid); 2], ..TileSettings::default() };
        asset.set_settings(0, &settings).map_err(|e| e.to_string())?;
        drop(texels);
        // The caller has freed its map by then, as a host would.
        let before = before.saturating_sub((n * n) as u64);
        memory::restart_peak();
        let start = Instant::now();
        let info = asset.tile_info(0).map_err(|e| e.to_string())?;
        let seconds = start.elapsed().as_secs_f64();
        let (peak, held) = (memory::peak() - before, memory::resident() - before);
        let mut outcome = Outcome {
            grid: self.grid.into(),
            share: self.share,
            nodes: info.movable_nodes,
            seconds,
            peak,
            held,
            solve: None,
        };
        if self.solve {
            memory::restart_peak();
            let mut seconds = [0.0; 2];
            for (k, seconds) in seconds.iter_mut().enumerate() {
                let pose = bulged(&positions, 0.2 + 0.1 * k as f32);
                let start = Instant::now();
                asset
                    .solve(Strided::from_f32x3(&pose), &SolveOptions::default())
                    .map_err(|e| e.to_string())?;
                *seconds = start.elapsed().as_secs_f64();
            }
            let report = asset.tile_report(0).map_err(|e| e.to_string())?;
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
                    .and_then(|mut view| asset.fetch(0, FetchKind::Redirection, &mut view))
                    .map_err(|e| e.to_string())?;
            }
            let fetched = start.elapsed().as_secs_f64();
            let peak = (memory::peak() - before) as f64;
            outcome.solve = Some([seconds[0], seconds[1], fetched, peak, held as f64]);
        }
        Ok(outcome)
    }
}

impl Outcome {
    pub const HEAD: &'static str = "| grid | share | active nodes | s | peak MiB | held MiB | peak / held | bytes held per node | \
        first solve s | next s | map s | peak MiB | held, bytes per node |\n|---|---|---|---|---|---|---|---|---|---|---|---|---|";

    pub fn row(&self) -> String {
        let mib = |bytes: f64| bytes / f64::from(1 << 20);
        let per_node = |bytes: f64| bytes / self.nodes.max(1) as f64;
        let Outcome { grid, share, nodes, seconds, peak, held, .. } = self;
        let (peak, held) = (*peak as f64, *held as f64);
        let solve = self.solve.map_or_else(String::new, |[first, next, map, peak, held]| {
            format!(" {first:.2} | {next:.2} | {map:.2} | {:.0} | {:.0} |", mib(peak), per_node(held))
        });
        format!(
            "| {grid}² | {:.0} % | {nodes} | {seconds:.3} | {:.0} | {:.0} | {:.2} | {:.1} |{solve}",
            100.0 * share,
            mib(peak),
            mib(held),
            peak / held,
            per_node(held)
        )
    }

    pub fn grid(&self) -> u64 {
        self.grid
    }

    pub fn share(&self) -> f64 {
        self.share
    }

    /// Seconds, MiB at the peak, and MiB held.
    pub fn costs(&self) -> [f64; 3] {
        [self.seconds, self.peak as f64 / f64::from(1 << 20), self.held as f64 / f64::from(1 << 20)]
    }

    pub fn to_json(&self) -> Value {
        json!({
            "grid": self.grid, "share": self.share, "nodes": self.nodes, "seconds": self.seconds,
            "peak": self.peak, "held": self.held, "solve": self.solve,
        })
    }

    pub fn from_json(line: &str) -> Option<Outcome> {
        let value: Value = serde_json::from_str(line).ok()?;
        let number = |name: &str| value[name].as_u64();
        let solve = value["solve"].as_array().map(|list| {
            let mut solve = [0.0; 5];
            list.iter().zip(&mut solve).for_each(|(from, to)| *to = from.as_f64().unwrap_or_default());
            solve
        });
        Some(Outcome {
            grid: number("grid")?,
            share: value["share"].as_f64()?,
            nodes: number("nodes")?,
            seconds: value["seconds"].as_f64()?,
            peak: number("peak")?,
            held: number("held")?,
            solve,
        })
    }
}
