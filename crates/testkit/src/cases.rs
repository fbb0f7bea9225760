//! The cases: one tile of one frame of a scene or an asset, on one grid. Other tiles get no rigidity and are the
//! identity, so that a time is that of one tile.

use vrtm::{Asset, Device, Strided};

use crate::features::{CASES, models};
use crate::model::{Model, paint, set_grid};

pub struct Case {
    pub name: String,
    pub model: Model,
    /// Number of the frame, from 1.
    pub frame: usize,
    pub udim: u32,
    /// Cells on a side.
    pub grid: u32,
    /// The pose, and the same pose moved slightly towards rest. They are solved alternately, so that charts are not
    /// reused because of equal inputs.
    pub poses: [Vec<[f32; 3]>; 2],
}

/// All cases, or those whose names are in `wanted`.
pub fn cases(wanted: &[String], grid: u32) -> Result<Vec<Case>, String> {
    let models = models();
    let known = |name: &String| models.iter().any(|model| model.name == *name);
    if let Some(name) = wanted.iter().find(|name| !known(name)) {
        return Err(format!("no scene or asset '{name}'"));
    }
    let is_wanted = |case: &(&str, usize)| wanted.is_empty() || wanted.iter().any(|name| name == case.0);
    let case = |(name, frame): (&str, usize)| {
        let model = models.iter().find(|model| model.name == name)?;
        // The tile that is measured; of the head in another frame.
        let (frame, udim) = match name {
            "arm" => (frame, 1002),
            "ict_inner" => (2, 1003),
            _ => (frame, 1001),
        };
        Some(Case::new(model.clone(), frame, udim, grid))
    };
    Ok(CASES.into_iter().filter(is_wanted).filter_map(case).collect())
}

impl Case {
    pub fn new(model: Model, frame: usize, udim: u32, grid: u32) -> Case {
        let pose = &model.frames[frame - 1];
        // Each moved coordinate has to differ in f32, even if the change is smaller than its rounding; coordinates at
        // rest must stay.
        let near = |p: f32, r: f32| match p + 0.001 * (r - p) {
            same if same == p && p != r => p.next_up(),
            other => other,
        };
        let nearly = pose.iter().zip(&model.rest).map(|(p, r)| [0, 1, 2].map(|k| near(p[k], r[k])));
        let poses = [pose.clone(), nearly.collect()];
        Case { name: model.name.clone(), model, frame, udim, grid, poses }
    }

    /// Creates the asset on a device. Returns it with the tile's index.
    pub fn asset(&self, device: &Device) -> (Asset, usize) {
        let mut asset = self.model.bare_on(device, Strided::from_slice(&self.model.rest));
        let tile = asset.find_tile(self.udim).expect("the tile that was chosen");
        let maps = self.model.maps.iter().find(|maps| maps.udim == self.udim).expect("its maps");
        paint(&mut asset, maps);
        set_grid(&mut asset, self.grid);
        (asset, tile)
    }

    pub fn pose(&self, k: usize) -> Strided<'_> {
        Strided::from_slice(&self.poses[k % 2])
    }
}
