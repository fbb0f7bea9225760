//! Measures how long a solve continues after it is cancelled at various moments, and how long reading its last result
//! takes meanwhile. First for a tile that has to be prepared, then for a tile that has been solved before.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::{scope, sleep};
use std::time::{Duration, Instant};

use vrtm::{Asset, Control, Device, ErrorKind, SolveRequest};
use vrtm_testkit::Model;

pub const HEAD: &str = "
## Cancelled solves

| scene | grid | solve | whole | cancelled | median | 99 % | longest | longest read of the report |
|---|---|---|---|---|---|---|---|---|";

/// Solves the first frame, or cancels the solve after a while. Returns the milliseconds of the solve, or those since it
/// was cancelled (`None` if it was already done), and the longest milliseconds that reading the last report took
/// meanwhile.
fn solve(asset: &mut Asset, model: &Model, cancel_after: Option<Duration>) -> (Option<f64>, f64) {
    let control = Arc::new(Control::new());
    let (results, over) = (asset.results().clone(), AtomicBool::new(false));
    scope(|scope| {
        let canceller = scope.spawn(|| {
            let Some(time) = cancel_after else { return (None, 0.0) };
            sleep(time);
            let start = Instant::now();
            control.cancel();
            let mut longest = 0.0f64;
            while !over.load(Ordering::Relaxed) {
                let read = Instant::now();
                let _ = results.report();
                longest = longest.max(read.elapsed().as_secs_f64());
                sleep(Duration::from_micros(500));
            }
            (Some(start), longest)
        });
        let request = SolveRequest {
            positions: model.frame(1),
            control: Some(control.clone()),
            ..SolveRequest::default()
        };
        let start = Instant::now();
        let outcome = asset.run(&request, &mut []);
        let end = Instant::now();
        over.store(true, Ordering::Relaxed);
        let (cancelled, longest) = canceller.join().expect("a thread");
        match outcome {
            Ok(()) if cancel_after.is_some() => (None, longest * 1000.0),
            Ok(()) => (Some(end.duration_since(start).as_secs_f64() * 1000.0), longest * 1000.0),
            Err(error) => {
                assert_eq!(error.kind, ErrorKind::Cancelled);
                let since = end.saturating_duration_since(cancelled.expect("a cancelled solve"));
                (Some(since.as_secs_f64() * 1000.0), longest * 1000.0)
            }
        }
    })
}

/// Makes the next solve compute everything from scratch.
fn forget(asset: &mut Asset) {
    for tile in 0..asset.tile_count() {
        let settings = asset.settings(tile).expect("settings");
        let room = if settings.room == 0.3 { 0.300_01 } else { 0.3 };
        asset.set_settings(tile, &vrtm::TileSettings { room, ..settings }).expect("settings");
    }
}

/// Prints the row of `repeats` cancelled solves.
pub fn measure(repeats: u32, device: &Device, model: &Model, grid: u32, first: bool) {
    let mut asset = model.asset_on(device, grid);
    let mut whole = solve(&mut asset, model, None).0;
    if !first {
        forget(&mut asset);
        whole = solve(&mut asset, model, None).0;
    }
    let whole = whole.expect("a solve that is not cancelled");
    let mut times = Vec::new();
    let mut longest_read = 0.0f64;
    for k in 0..repeats {
        if first {
            asset = model.asset_on(device, grid);
        }
        forget(&mut asset);
        // Spread over the solve, but not synchronous with any part of it.
        let part = (f64::from(k) * 0.618_034).fract();
        let (time, read) =
            solve(&mut asset, model, Some(Duration::from_secs_f64(whole * 0.95 * part / 1000.0)));
        times.extend(time);
        longest_read = longest_read.max(read);
    }
    times.sort_by(f64::total_cmp);
    let at = |part: f64| times[((times.len() - 1) as f64 * part).round() as usize];
    let (name, which) = (&model.name, if first { "first" } else { "next" });
    println!(
        "| {name} | {grid} | {which} | {whole:.0} | {} | {:.2} | {:.2} | {:.2} | {longest_read:.3} |",
        times.len(),
        at(0.5),
        at(0.99),
        at(1.0)
    );
}
