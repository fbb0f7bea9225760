//! Solves of some tiles: those that are named, those that moved vertices touch, all but frozen ones; and results that
//! are given up for the next ones.

use vrtm::{Asset, ErrorKind, Quality, SolveOptions, SolveRequest};
use vrtm_testkit::Lab as _;
use vrtm_testkit::{self, Model, bits, change, scenes, view};

/// The arm has two tiles.
fn arm() -> (Model, Asset) {
    let model = Model::from(scenes::by_name("arm").unwrap());
    let asset = model.asset(2, 64);
    assert_eq!(asset.tile_count(), 2);
    (model, asset)
}

fn tile_bits(asset: &Asset, tile: usize) -> Vec<[u32; 2]> {
    asset.displacements(tile).unwrap().iter().map(|u| u.map(f32::to_bits)).collect()
}

/// The bits of both tiles for a frame, solved alone.
fn frame(model: &Model, number: usize) -> [Vec<[u32; 2]>; 2] {
    let asset = model.solved(&vrtm_testkit::cpu(2), 64, number, &SolveOptions::default());
    [0, 1].map(|tile| tile_bits(&asset, tile))
}

fn kept(asset: &Asset) -> Vec<bool> {
    (0..asset.tile_count()).map(|tile| asset.tile(tile).report().unwrap().kept).collect()
}

#[test]
fn only_the_tiles_that_are_named() {
    let (model, mut asset) = arm();
    let (one, three) = (frame(&model, 1), frame(&model, 3));
    assert!(one[0] != three[0] && one[1] != three[1]);
    asset.solve(model.frame(1), &SolveOptions::default()).unwrap();
    let request = SolveRequest { positions: model.frame(3), tiles: Some(&[1, 1]), ..SolveRequest::default() };
    asset.run(&request, &mut []).unwrap();
    assert!(tile_bits(&asset, 0) == one[0] && tile_bits(&asset, 1) == three[1]);
    assert_eq!(kept(&asset), [true, false]);
    assert_eq!(asset.report().unwrap().tiles_kept, 1);
    // None at all is no error, and changes nothing.
    asset.run(&SolveRequest { tiles: Some(&[]), ..request.clone() }, &mut []).unwrap();
    assert!(tile_bits(&asset, 0) == one[0] && tile_bits(&asset, 1) == three[1]);
    assert_eq!(asset.report().unwrap().tiles_kept, 2);
    let error = asset.run(&SolveRequest { tiles: Some(&[0, 2]), ..request }, &mut []).unwrap_err();
    assert_eq!(error.message, "options.tiles[1]: 2 is out of range, there are 2");
}

/// A tile that has never been solved has no result, but the others have theirs.
#[test]
fn a_tile_that_was_never_solved_has_no_result() {
    let (model, mut asset) = arm();
    let request = SolveRequest { positions: model.frame(3), tiles: Some(&[1]), ..SolveRequest::default() };
    asset.run(&request, &mut []).unwrap();
    assert_eq!(asset.tile(0).report().unwrap_err().kind, ErrorKind::NotSolved);
    assert!(tile_bits(&asset, 1) == frame(&model, 3)[1]);
    // Its corners have the mesh's own UVs, those of the other tile their redirected ones.
    let uvs = vrtm_testkit::corner_uvs(&asset);
    let own: Vec<[f32; 2]> = model.uv_indices.iter().map(|&k| model.uvs[k as usize]).collect();
    let moved = |tile: f32| {
        let of_tile = |(uv, _): &(&[f32; 2], &[f32; 2])| uv[0].floor() == tile;
        own.iter().zip(&uvs).filter(of_tile).filter(|(own, uv)| own != uv).count()
    };
    assert_eq!(moved(0.0), 0);
    assert!(moved(1.0) > 0);
    // A list of dirty vertices does not leave it out.
    let request = SolveRequest { tiles: None, dirty_vertices: Some(&[]), ..request };
    asset.run(&request, &mut []).unwrap();
    assert_eq!(kept(&asset), [false, true]);
}

#[test]
fn only_the_tiles_that_dirty_vertices_touch() {
    let (model, mut asset) = arm();
    let one = frame(&model, 1);
    asset.solve(model.frame(1), &SolveOptions::default()).unwrap();
    // A vertex of the second tile alone moves.
    let in_tile = |tile: f32| {
        let of: Vec<bool> = model.vertices(|uv| uv[0].floor() == tile);
        move |v: &usize| of[*v]
    };
    let vertex = (0..model.rest.len()).filter(in_tile(1.0)).find(|v| !in_tile(0.0)(v)).unwrap();
    let mut pose = model.frames[0].clone();
    pose[vertex][1] += 0.05;
    let positions = vrtm::Strided::from_slice(&pose);
    let mut whole = model.asset(2, 64);
    whole.solve(positions, &SolveOptions::default()).unwrap();
    let dirty = [vertex as u32];
    let request = SolveRequest { positions, dirty_vertices: Some(&dirty), ..SolveRequest::default() };
    asset.run(&request, &mut []).unwrap();
    assert_eq!(kept(&asset), [true, false]);
    assert!(bits(&asset) == bits(&whole) && tile_bits(&asset, 0) == one[0]);
    // Nothing has moved: nothing is done. But other options, maps or settings count as well.
    let nothing = SolveRequest { dirty_vertices: Some(&[]), ..request.clone() };
    asset.run(&nothing, &mut []).unwrap();
    assert_eq!(kept(&asset), [true, true]);
    change(&mut asset, 0, |settings| settings.room = 0.2);
    asset.run(&nothing, &mut []).unwrap();
    assert_eq!(kept(&asset), [false, true]);
    asset.tile_mut(1).set_mask(Some(view(&[255], 1, 1))).unwrap();
    asset.run(&nothing, &mut []).unwrap();
    assert_eq!(kept(&asset), [true, false]);
    let options = SolveOptions { quality: Quality::Draft, ..SolveOptions::default() };
    asset.run(&SolveRequest { options, ..nothing.clone() }, &mut []).unwrap();
    assert_eq!(kept(&asset), [false, false]);
    let count = model.rest.len() as u32;
    let beyond = [0, count];
    let request = SolveRequest { dirty_vertices: Some(&beyond), ..nothing };
    let error = asset.run(&request, &mut []).unwrap_err();
    let expected =
        format!("options.dirty_vertices[1]: {count} is out of range, the mesh has {count} vertices");
    assert_eq!(error.message, expected);
}

#[test]
fn a_frozen_tile_keeps_its_result() {
    let (model, mut asset) = arm();
    let (one, three) = (frame(&model, 1), frame(&model, 3));
    asset.solve(model.frame(1), &SolveOptions::default()).unwrap();
    asset.tile_mut(0).freeze(true).unwrap();
    asset.solve(model.frame(3), &SolveOptions::default()).unwrap();
    assert!(tile_bits(&asset, 0) == one[0] && tile_bits(&asset, 1) == three[1]);
    assert_eq!(kept(&asset), [true, false]);
    // Naming it does not wake it, letting it go does.
    let request = SolveRequest { positions: model.frame(3), tiles: Some(&[0]), ..SolveRequest::default() };
    asset.run(&request, &mut []).unwrap();
    assert_eq!(kept(&asset), [true, true]);
    asset.tile_mut(0).freeze(false).unwrap();
    asset.run(&request, &mut []).unwrap();
    assert!(tile_bits(&asset, 0) == three[0]);
    assert_eq!(asset.tile_mut(2).freeze(true).unwrap_err().kind, ErrorKind::InvalidArgument);
}

/// Solvers' memory that is given back: the same results, and less that is held.
#[test]
fn solvers_are_given_back() {
    let (model, mut asset) = arm();
    let held = |asset: &vrtm::Asset| asset.device().info().bytes_held;
    asset.solve(model.frame(1), &SolveOptions::default()).unwrap();
    let with = held(&asset);
    for tiles in [None, Some(&[1][..])] {
        let request = SolveRequest {
            positions: model.frame(3),
            tiles,
            release_solvers: true,
            ..SolveRequest::default()
        };
        asset.run(&request, &mut []).unwrap();
    }
    let nodes: u64 = [0, 1].map(|tile| asset.tile(tile).report().unwrap().nodes_active).iter().sum();
    let without = held(&asset);
    assert!(without + 100 * nodes < with, "{with} bytes, then {without}, of {nodes} nodes");
    for (tile, bits) in frame(&model, 3).iter().enumerate() {
        assert!(tile_bits(&asset, tile) == *bits);
    }
    // They come back when they are needed.
    asset.solve(model.frame(1), &SolveOptions::default()).unwrap();
    assert_eq!(held(&asset), with);
}

/// Savings and cost of release_last.
#[test]
fn a_result_that_is_given_up_is_gone_until_the_next_one() {
    let (model, mut asset) = arm();
    asset.solve(model.frame(1), &SolveOptions::default()).unwrap();
    let results = asset.results().clone();
    let seen = std::sync::Arc::new(std::sync::Mutex::new(Vec::new()));
    let list = seen.clone();
    let control = std::sync::Arc::new(vrtm::Control::with_progress(std::sync::Arc::new(move |_| {
        list.lock().unwrap().push([0, 1].map(|tile| results.tile(tile).report().is_ok()));
        false
    })));
    let request = SolveRequest {
        positions: model.frame(3),
        tiles: Some(&[1]),
        release_last: true,
        control: Some(control.clone()),
        ..SolveRequest::default()
    };
    asset.run(&request, &mut []).unwrap();
    // The tile that is solved had none meanwhile, the other one kept its own; the end is told when both have theirs.
    let seen = seen.lock().unwrap().clone();
    let (end, during) = seen.split_last().unwrap();
    assert!(*end == [true; 2] && during.iter().all(|seen| *seen == [true, false]), "{seen:?}");
    assert!(tile_bits(&asset, 1) == frame(&model, 3)[1]);
    control.cancel_at_item(1);
    let error = asset.run(&request, &mut []).unwrap_err();
    assert_eq!(error.kind, ErrorKind::Cancelled);
    assert!(asset.tile(0).report().is_ok());
}
