//! Hashes every bit of every result, per scene, effort and backend, and compares the hashes with those in
//! `tests/bits.txt`. A change that must not alter the results must not alter these either; a change that is meant to
//! alter them writes them anew with `VRTM_UPDATE_BITS=1 cargo test --test solver bits::`.
//!
//! The CPU's bits are the same on every machine. A GPU's bits are the same on one device with one driver: for an
//! adapter that the file does not list nothing is compared, and a message says so.

use std::collections::BTreeMap;
use std::fmt::Write;
use std::path::PathBuf;

use crate::common::{self, Model, bits, cpu, fetch, options};
use vrtm::{
    Device, DeviceSettings, FetchKind, PbdSettings, Quality, SolveOptions, Solver, TileSettings, adapters,
};

/// A named combination of solver options.
struct Effort {
    name: &'static str,
    options: SolveOptions,
    orientation_density: f32,
}

fn efforts() -> Vec<Effort> {
    let pbd = SolveOptions {
        solver: Solver::Pbd,
        pbd: PbdSettings {
            iterations: Some(6),
            orientation_preservation: Some(0.01),
            ..PbdSettings::default()
        },
        ..SolveOptions::default()
    };
    let effort = |name, options| Effort { name, options, orientation_density: 0.0 };
    vec![
        effort("normal", options(Quality::Normal)),
        effort("draft", options(Quality::Draft)),
        effort("high", options(Quality::High)),
        effort("warm", SolveOptions { warm: true, ..SolveOptions::default() }),
        effort("held", SolveOptions { warm: true, temporal_weight: 0.1, ..SolveOptions::default() }),
        effort("pbd", pbd),
        Effort { name: "density", options: options(Quality::Normal), orientation_density: 0.2 },
    ]
}

fn models() -> Vec<Model> {
    use common::scenes::{analytic::squash, arm, creature, mug_to_jug};
    let mut models = common::analytic();
    models.push(Model { name: "squash to 40 %".into(), ..Model::from(squash(0.4)) });
    models.extend([mug_to_jug(), creature(), arm()].map(Model::from));
    models.extend(common::assets());
    models
}

/// 64-bit FNV-1a.
struct Hash(u64);

impl Hash {
    fn add(&mut self, x: u64) {
        for byte in x.to_le_bytes() {
            self.0 = (self.0 ^ u64::from(byte)).wrapping_mul(0x0000_0100_0000_01b3);
        }
    }
}

/// Solves a model's first frame (warm: its first two) and hashes displacements, maps and reports of all tiles.
fn hash(model: &Model, device: &Device, grid: u32, effort: &Effort) -> u64 {
    let mut asset = model.asset_on(device, grid);
    for tile in 0..asset.tile_count() {
        let settings = asset.settings(tile).unwrap();
        let orientation_density = effort.orientation_density;
        asset.set_settings(tile, &TileSettings { orientation_density, ..settings }).unwrap();
    }
    if effort.options.warm {
        asset.solve(model.frame(model.frames.len()), &options(Quality::Draft)).unwrap();
    }
    asset.solve(model.frame(1), &effort.options).unwrap();
    let mut hash = Hash(0xcbf2_9ce4_8422_2325);
    bits(&asset).into_iter().flatten().for_each(|bits| hash.add(bits.into()));
    for tile in 0..asset.tile_count() {
        for kind in [FetchKind::Redirection, FetchKind::RedirectionDelta] {
            let texels = fetch(&mut asset, tile, kind, [75, 61]);
            texels.into_iter().flatten().for_each(|x| hash.add(x.to_bits().into()));
        }
        let report = asset.tile_report(tile).unwrap();
        for x in [report.energy_before, report.energy, report.min_jacobian] {
            hash.add(x.to_bits());
        }
        for n in [report.folds, report.node_updates, report.sweeps.into(), report.corrections.into()] {
            hash.add(n);
        }
    }
    hash.0
}

fn file() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("tests/bits.txt")
}

/// Hashes by backend, scene and effort.
type Hashes = BTreeMap<(String, String, String), u64>;

fn stored() -> Hashes {
    let text = std::fs::read_to_string(file()).unwrap_or_default();
    let line = |line: &str| {
        let [backend, scene, effort, hash]: [&str; 4] =
            line.split(" | ").collect::<Vec<_>>().try_into().unwrap();
        let hash = u64::from_str_radix(hash, 16).unwrap();
        ((backend.to_owned(), scene.to_owned(), effort.to_owned()), hash)
    };
    text.lines().filter(|line| !line.starts_with('#')).map(line).collect()
}

/// Compares the hashes found on a backend with the file, or writes them into it.
fn compare(backend: &str, found: &Hashes) {
    let mut all = stored();
    if std::env::var_os("VRTM_UPDATE_BITS").is_some_and(|value| value == "1") {
        all.extend(found.clone());
        let mut text = String::from(
            "# Written by tests/solver/bits.rs: backend | scene | effort | hash of every bit.\n",
        );
        for ((backend, scene, effort), hash) in &all {
            writeln!(text, "{backend} | {scene} | {effort} | {hash:016x}").unwrap();
        }
        std::fs::write(file(), text).unwrap();
        return;
    }
    if !all.keys().any(|(known, ..)| known == backend) {
        println!("skipped: {} has no hashes of {backend}", file().display());
        return;
    }
    let differs = |key: &&(String, String, String)| all.get(*key) != found.get(*key);
    let wrong: Vec<_> =
        found.keys().filter(differs).map(|(_, scene, effort)| format!("{scene}, {effort}")).collect();
    assert!(wrong.is_empty(), "{backend}: other bits than in tests/bits.txt: {}", wrong.join("; "));
}

/// A single test, because both backends write the same file.
#[test]
fn results_have_the_bits_that_they_had() {
    let (models, efforts) = (models(), efforts());
    let key = |backend: &str, model: &Model, effort: &Effort| {
        (backend.to_owned(), model.name.clone(), effort.name.to_owned())
    };
    let mut found = Hashes::new();
    let device = cpu(0);
    for model in &models {
        for effort in &efforts {
            found.insert(key("cpu", model, effort), hash(model, &device, 128, effort));
        }
    }
    compare("cpu", &found);
    let Some(device) = common::gpu(&DeviceSettings::default()) else { return };
    let adapter = &adapters()[0];
    let backend = format!("{}, {}", adapter.name, adapter.driver);
    let mut found = Hashes::new();
    for (n, model) in models.iter().enumerate() {
        // A software driver is slow: all efforts run on every fourth scene only.
        for effort in efforts.iter().take(if n % 4 == 0 { efforts.len() } else { 1 }) {
            found.insert(key(&backend, model, effort), hash(model, &device, 64, effort));
        }
    }
    // The same grid, laid over several buffers.
    let settings = DeviceSettings { backend: vrtm::Backend::Gpu, ..DeviceSettings::default() };
    let banded = Device::with_variables(&settings, &[], Some(12)).unwrap();
    let model = models.iter().find(|model| model.name == "torus").unwrap();
    let name = "normal in bands".to_owned();
    found.insert((backend.clone(), model.name.clone(), name), hash(model, &banded, 64, &efforts[0]));
    compare(&backend, &found);
}
