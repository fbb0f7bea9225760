//! The results that tests of quality judge: each scene is solved once, on 512 x 512 cells with `normal`, and its
//! features, the gaps at its seams and its strain are read from that.

use std::collections::BTreeMap;
use std::sync::{Arc, LazyLock, Mutex, OnceLock};

use vrtm::{Quality, Seams, SolveOptions, TileReport};

use crate::features::{Borders, CASES, Feature, Kind, Summary, gaps, models, of_asset, solve};
use crate::model::{Model, options};

/// Figures by which one result is judged.
pub struct Judged {
    pub features: Vec<Feature>,
    /// Distances between both sides of seams, if charts continue beyond them: see `gaps`.
    pub gaps: Vec<f64>,
    /// Of the tiles, with their strain.
    pub reports: Vec<TileReport>,
}

impl Judged {
    pub fn of(&self, kind: Kind) -> Summary {
        Summary::of(&self.features, kind)
    }
}

type Key = (String, usize, String);

/// The results so far.
static ALL: Mutex<BTreeMap<Key, Arc<OnceLock<Judged>>>> = Mutex::new(BTreeMap::new());
static MODELS: LazyLock<Vec<Model>> = LazyLock::new(models);

/// A scene or an asset, if it is there.
pub fn model(name: &str) -> Option<&'static Model> {
    MODELS.iter().find(|model| model.name == name)
}

/// The frame in which a scene is judged.
pub fn frame(name: &str) -> usize {
    CASES.iter().find(|case| case.0 == name).unwrap().1
}

/// Result of a call of `judge`, once it has been solved.
pub struct Entry(Arc<OnceLock<Judged>>);

impl std::ops::Deref for Entry {
    type Target = Judged;

    fn deref(&self) -> &Judged {
        self.0.get().unwrap()
    }
}

/// A scene in a frame, numbered from 1.
pub fn judge(model: &Model, frame: usize, borders: Borders) -> Entry {
    let key = (model.name.clone(), frame, format!("{borders:?}"));
    let entry = ALL.lock().unwrap().entry(key).or_default().clone();
    entry.get_or_init(|| {
        let pose = &model.frames[frame - 1];
        let options = SolveOptions { measure: true, ..options(Quality::Normal) };
        let asset = solve(model, pose, 1, 512, borders, &options);
        let reports = (0..asset.tile_count()).map(|tile| asset.tile(tile).report().unwrap()).collect();
        let gaps = if borders.0 == Seams::Continue { gaps(model, &asset) } else { Vec::new() };
        Judged { features: of_asset(model, pose, &asset), gaps, reports }
    });
    Entry(entry)
}
