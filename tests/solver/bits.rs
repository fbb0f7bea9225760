//! Hashes every bit of every result, per scene, effort and backend, and compares the hashes with those in
//! `tests/bits.txt`. A change that must not alter the results must not alter these either; a change that is meant to
//! alter them writes them anew with `VRTM_UPDATE_BITS=1 cargo test --test solver bits::`.
//!
//! The CPU's bits are the same on every machine. A GPU's bits are the same on one device with one driver: for an
//! adapter that the file does not list nothing is compared, and a message says so.

mod hash;
mod outputs;
mod small;

use std::collections::BTreeMap;
use std::fmt::Write;
use std::path::PathBuf;
use std::sync::{Mutex, PoisonError};

use hash::Hash;
use small::{Small, drawn, hard, outputs, small};
use vrtm::{Device, DeviceSettings, FetchKind, PbdSettings, Quality, SolveOptions, Solver, adapters};
use vrtm_testkit::{self, Model, bits, change_all, cpu, fetch, on_all_cores, options};

/// A named combination of solver options.
struct Effort {
    name: &'static str,
    options: SolveOptions,
    orientation_density: f32,
}

fn efforts() -> Vec<Effort> {
    let pbd = SolveOptions {
        solver: Solver::Pbd,
        pbd: PbdSettings { iterations: 6, orientation_preservation: 0.01, ..PbdSettings::default() },
        ..SolveOptions::default()
    };
    let effort = |name, options| Effort { name, options, orientation_density: 0.0 };
    vec![
        effort("normal", options(Quality::Normal)),
        effort("draft", options(Quality::Draft)),
        effort("seven corrections", SolveOptions { max_corrections: Some(7), ..SolveOptions::default() }),
        effort("warm", SolveOptions { warm: true, ..SolveOptions::default() }),
        effort("held", SolveOptions { warm: true, temporal_weight: 0.1, ..SolveOptions::default() }),
        effort("pbd", pbd),
        Effort { name: "density", options: options(Quality::Normal), orientation_density: 0.2 },
    ]
}

fn models() -> Vec<Model> {
    use vrtm_testkit::scenes::{analytic::squash, arm, creature, mug_to_jug};
    let mut models = vrtm_testkit::analytic();
    models.push(Model { name: "squash to 40 %".into(), ..Model::from(squash(0.4)) });
    models.extend([mug_to_jug(), creature(), arm()].map(Model::from));
    models.extend(vrtm_testkit::assets());
    models
}

/// Solves a model's first frame (warm: its first two) and hashes displacements, maps and reports of all tiles.
fn hash(model: &Model, device: &Device, grid: u32, effort: &Effort) -> u64 {
    let mut asset = model.asset_on(device, grid);
    change_all(&mut asset, |settings| settings.orientation_density = effort.orientation_density);
    if effort.options.warm {
        asset.solve(model.frame(model.frames.len()), &options(Quality::Draft)).unwrap();
    }
    asset.solve(model.frame(1), &effort.options).unwrap();
    let mut hash = Hash::default();
    bits(&asset).into_iter().flatten().for_each(|bits| hash.add(bits.into()));
    for tile in 0..asset.tile_count() {
        for kind in [FetchKind::Redirection, FetchKind::RedirectionDelta] {
            let texels = fetch(&mut asset, tile, kind, [75, 61]);
            texels.into_iter().flatten().for_each(|x| hash.add(x.to_bits().into()));
        }
        let report = asset.tile(tile).report().unwrap();
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
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("bits.txt")
}

/// Hashes by backend, scene and effort.
type Hashes = BTreeMap<Key, u64>;
type Key = (String, String, String);

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

/// All tests write the same file.
static WRITING: Mutex<()> = Mutex::new(());

/// Compares the hashes found on a backend with the file, or writes them into it.
fn compare(backend: &str, found: &Hashes) {
    let _alone = WRITING.lock().unwrap_or_else(PoisonError::into_inner);
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
    let differs = |key: &&Key| all.get(*key) != found.get(*key);
    let wrong: Vec<_> =
        found.keys().filter(differs).map(|(_, scene, effort)| format!("{scene}, {effort}")).collect();
    assert!(wrong.is_empty(), "{backend}: other bits than in tests/bits.txt: {}", wrong.join("; "));
}

fn key(backend: &str, scene: &str, what: &str) -> Key {
    (backend.to_owned(), scene.to_owned(), what.to_owned())
}

#[test]
fn results_have_the_bits_that_they_had() {
    let (mut found, device) = (Hashes::new(), cpu(0));
    for model in &models() {
        for effort in &efforts() {
            found.insert(key("cpu", &model.name, effort.name), hash(model, &device, 128, effort));
        }
    }
    compare("cpu", &found);
}

#[test]
fn results_have_the_bits_that_they_had_on_a_gpu() {
    let Some(device) = vrtm_testkit::gpu(&DeviceSettings::default()) else { return };
    let (models, efforts) = (models(), efforts());
    let (mut found, backend) = (Hashes::new(), vrtm_testkit::backend(&adapters()[0]));
    for (n, model) in models.iter().enumerate() {
        // A software driver is slow: all efforts run on every fourth scene only.
        for effort in efforts.iter().take(if n % 4 == 0 { efforts.len() } else { 1 }) {
            found.insert(key(&backend, &model.name, effort.name), hash(model, &device, 64, effort));
        }
    }
    compare(&backend, &found);
}

/// The small scenes, and the outputs of one.
fn of_small(backend: &str, scenes: &[Small], device: &Device) -> Hashes {
    let hashes = on_all_cores(scenes, |small| small.hash(device).0);
    let keys = scenes.iter().map(|small| key(backend, small.scene(), &small.what));
    let outputs = outputs(device).into_iter().map(|(what, hash)| (key(backend, "outputs", what), hash.0));
    keys.zip(hashes).chain(outputs).collect()
}

#[test]
fn small_scenes_have_the_bits_that_they_had() {
    let device = cpu(1);
    let mut found = of_small("cpu", &small(), &device);
    let drawn = drawn(&device, &[0, 1, 2, 3, 4, 5, 6, 7, 8, 9]);
    let all = hard().into_iter().map(|(what, hash)| (key("cpu", "hard", &what), hash.0));
    found.extend(all.chain(drawn.into_iter().map(|(what, hash)| (key("cpu", "random", &what), hash.0))));
    compare("cpu", &found);
}

#[test]
fn small_scenes_have_the_bits_that_they_had_on_a_gpu() {
    let Some(device) = vrtm_testkit::gpu(&DeviceSettings::default()) else { return };
    let scenes: Vec<Small> = small().into_iter().filter(|small| small.on_gpu).collect();
    let backend = vrtm_testkit::backend(&adapters()[0]);
    compare(&backend, &of_small(&backend, &scenes, &device));
}
