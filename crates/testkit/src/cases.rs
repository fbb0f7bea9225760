//! The cases: one tile of one frame of a scene or an asset, on one grid. Other tiles get no rigidity and are the
//! identity, so that a time is that of one tile.

use vrtm::{Asset, Device, Strided};

use crate::features::models;
use crate::model::{Model, set_grid, view};

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

/// The frame and the tile of each scene and asset that are measured.
const CHOSEN: [(&str, usize, u32); 15] = [
    ("squash", 1, 1001),
    ("squash to 40 %", 1, 1001),
    ("bulge", 1, 1001),
    ("pinch", 1, 1001),
    ("shear", 1, 1001),
    ("torus", 1, 1001),
    ("strips", 1, 1001),
    ("mug_to_jug", 5, 1001),
    ("creature", 4, 1001),
    ("arm", 3, 1002),
    ("mh_face", 1, 1001),
    ("spot", 2, 1001),
    ("cesium_man", 3, 1001),
    ("fox", 3, 1001),
    ("ict_inner", 2, 1003),
];

/// All cases, or those whose names are in `wanted`.
///
/// # Errors
/// An unknown name, or the name of a missing asset.
pub fn cases(wanted: &[String], grid: u32) -> Result<Vec<Case>, String> {
    let models = models();
    let known = |name: &String| models.iter().any(|model| model.name == *name);
    if let Some(name) = wanted.iter().find(|name| !known(name)) {
        return Err(format!("no scene or asset '{name}'"));
    }
    let chosen =
        CHOSEN.iter().filter(|chosen| wanted.is_empty() || wanted.iter().any(|name| name == chosen.0));
    let case = |&(name, frame, udim): &(&str, usize, u32)| {
        let model = models.iter().find(|model| model.name == name)?;
        Some(Case::new(model.clone(), frame, udim, grid))
    };
    Ok(chosen.filter_map(case).collect())
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
        let mut asset = self.model.bare_on(device, Strided::from_f32x3(&self.model.rest));
        let tile = asset.find_tile(self.udim).expect("the tile that was chosen");
        let maps = self.model.maps.iter().find(|maps| maps.udim == self.udim).expect("its maps");
        let image = |bytes| view(bytes, maps.width, maps.height);
        asset.set_rigidity(tile, Some(image(&maps.rigidity))).expect("a map of the right size");
        asset.set_mask(tile, maps.mask.as_ref().map(|mask| image(mask))).expect("a map of the right size");
        set_grid(&mut asset, self.grid);
        (asset, tile)
    }

    pub fn pose(&self, k: usize) -> Strided<'_> {
        Strided::from_f32x3(&self.poses[k % 2])
    }
}
