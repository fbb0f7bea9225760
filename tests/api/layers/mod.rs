//! Charts that lie over one another, in layers of their own (`MeshSource::max_layers`): each is solved as if it were
//! alone.

mod stacks;

use stacks::{DEPTH, GRID, Island, SIDE, Stack};
use vrtm::{Asset, ErrorKind, FetchKind, Seams, SolveOptions, StrainReport, TileSettings};
use vrtm_testkit::random::Random;
use vrtm_testkit::{
    self, Model, bits, change_all, corner_uvs, cpu, cross, fetch, long, on_all_cores, quads, scenes, view,
};

const MOST: u32 = 32;

/// The layer of each island; all of its faces are in one.
fn layers(stack: &Stack, asset: &Asset) -> Vec<u32> {
    let mut of_face = vec![u32::MAX; stack.indices.len() / 4];
    asset.results().face_layers(0, &mut of_face).unwrap();
    let tiles = asset.tile_count() as u32;
    (0..stack.islands.len())
        .map(|k| {
            let of_island = &of_face[stack.faces(k)];
            assert!(of_island.iter().all(|&layer| layer == of_island[0] && layer < tiles));
            of_island[0]
        })
        .collect()
}

/// Islands in one layer share no more than borders, and each is in the first layer where there was room for it.
fn check_layers(stack: &Stack, layers: &[u32]) -> Result<(), String> {
    for (k, island) in stack.islands.iter().enumerate() {
        let depth = |other: usize| stack.islands[other].shared_depth(island);
        for other in 0..k {
            let depth = depth(other);
            if layers[other] == layers[k] && depth > 4.0 * DEPTH {
                return Err(format!("islands {other} and {k} share a layer, {depth} deep"));
            }
        }
        for lower in 0..layers[k] {
            let blocks = |other: usize| layers[other] == lower && depth(other) > 0.9 * DEPTH;
            if !(0..k).any(blocks) {
                return Err(format!("island {k} could be in layer {lower}"));
            }
        }
    }
    Ok(())
}

/// The warp of a tile is one-to-one, from its nodes alone.
fn check_one_to_one(asset: &mut Asset, tile: usize) -> Result<(), String> {
    let nodes = GRID as usize + 1;
    let warp = fetch(asset, tile, FetchKind::Warp, [GRID + 1; 2]);
    let at = |i: usize, j: usize| warp[j * nodes + i].map(f64::from);
    for (i, j) in (0..nodes - 1).flat_map(|j| (0..nodes - 1).map(move |i| (i, j))) {
        let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
        if cross(a, b, c) <= 0.0 || cross(a, c, d) <= 0.0 {
            return Err(format!("tile {tile} folds at {i}, {j}"));
        }
    }
    Ok(())
}

/// Checks a random stack; returns the number of islands that were compared with themselves alone, and that moved.
fn check(seed: u64) -> Result<usize, String> {
    let stack = Stack::random(seed);
    let device = cpu(1);
    let mut asset = stack.asset(&device, MOST, None);
    let layers = layers(&stack, &asset);
    check_layers(&stack, &layers)?;
    asset.solve(stack.positions(), &SolveOptions::default()).unwrap();
    for tile in 0..asset.tile_count() {
        check_one_to_one(&mut asset, tile)?;
    }
    let uvs = corner_uvs(&asset);
    let mut moved = 0;
    for (k, island) in stack.islands.iter().enumerate() {
        let beside: Vec<&Island> = (0..stack.islands.len())
            .filter(|&other| other != k && layers[other] == layers[k])
            .map(|other| &stack.islands[other])
            .collect();
        // A neighbour's border fixes the cells that it crosses.
        if beside.iter().any(|other| other.shared_depth(island) > -3.0 / f64::from(GRID)) {
            continue;
        }
        // Coarse levels of the grid know a little of neighbours in the layer: a tenth of a cell.
        let tolerance = if beside.is_empty() { 0.0 } else { 0.1 / GRID as f32 };
        let equal = |a: &[f32; 2], b: &[f32; 2]| (0..2).all(|c| (a[c] - b[c]).abs() <= tolerance);
        let mut alone = stack.asset(&device, 0, Some(k));
        alone.solve(stack.positions(), &SolveOptions::default()).unwrap();
        let expected = corner_uvs(&alone);
        let faces = stack.faces(k);
        let corners = 4 * faces.start..4 * faces.end;
        if !corners.clone().all(|c| equal(&uvs[c], &expected[c])) {
            return Err(format!("island {k} has other corner UVs than alone"));
        }
        let size = [90, 90];
        let own = fetch(&mut asset, layers[k] as usize, FetchKind::Redirection, size);
        let expected = fetch(&mut alone, 0, FetchKind::Redirection, size);
        for (n, (own, expected)) in own.iter().zip(&expected).enumerate() {
            let uv = [n % 90, n / 90].map(|x| (x as f64 + 0.5) / 90.0);
            if island.depth(uv) > 0.0 && !equal(own, expected) {
                return Err(format!("island {k} has another map than alone at {uv:?}"));
            }
        }
        let stays = |c: usize| uvs[c] == stack.uvs[stack.indices[c] as usize];
        moved += usize::from(!corners.into_iter().all(stays));
    }
    Ok(moved)
}

#[test]
fn random_stacks_are_solved_as_if_each_island_were_alone() {
    let count = long::cases(2_000, 80, "random stacks");
    let seeds: Vec<u64> = (1..=count).collect();
    let found = on_all_cores(&seeds, |&seed| check(seed).map_err(|error| format!("seed {seed}: {error}")));
    let failed: Vec<&String> = found.iter().filter_map(|result| result.as_ref().err()).collect();
    assert!(failed.is_empty(), "{} of {count}: {:?}", failed.len(), &failed[..failed.len().min(5)]);
    let moved: usize = found.iter().flatten().sum();
    assert!(moved as u64 > 2 * count, "{moved} of {count}");
}

/// Two islands of the same place, one mirrored.
fn mirrored() -> Stack {
    let half = Island { origin: [0.1, 0.1], sides: [[0.8, 0.0], [0.0, 0.8]] };
    let other = Island { sides: [half.sides[1], half.sides[0]], ..half };
    Stack::of(vec![half, other], &mut Random(7))
}

#[test]
fn mirrored_halves_both_move_and_stay_without_layers() {
    let (stack, device) = (mirrored(), cpu(2));
    let options = SolveOptions { measure: true, ..SolveOptions::default() };
    for most in [0, 1] {
        let mut asset = stack.asset(&device, most, None);
        asset.solve(stack.positions(), &options).unwrap();
        assert_eq!(asset.tile_count(), 1);
        let info = asset.tile_mut(0).info().unwrap();
        assert_eq!((info.layer, info.layers, info.movable_nodes), (0, 1, 0));
        assert_eq!(info.rigid_overlapped, info.rigid_nodes);
        assert_eq!(asset.tile(0).report().unwrap().strain.unwrap().segments, 0);
    }
    let mut asset = stack.asset(&device, MOST, None);
    asset.solve(stack.positions(), &options).unwrap();
    assert_eq!(asset.tile_count(), 2);
    for layer in 0..2 {
        let info = asset.tile_mut(layer).info().unwrap();
        assert_eq!((info.udim, info.layer, info.layers), (1001, layer as u32, 2));
        assert_eq!((info.rigid_overlapped, info.overlap), (0, 0.0));
        assert!(info.rigid_nodes > 200);
        let strain = asset.tile(layer).report().unwrap().strain.unwrap();
        assert!(strain.after.rms < strain.before.rms / 3.0, "{strain:?}");
    }
}

#[test]
fn layers_share_maps_and_settings() {
    let (stack, device) = (mirrored(), cpu(2));
    let solved = |asset: &mut Asset| {
        asset.solve(stack.positions(), &SolveOptions::default()).unwrap();
        bits(asset)
    };
    let mut asset = stack.asset(&device, MOST, None);
    let before = solved(&mut asset);
    let held = device.info().bytes_held;
    // What is set for the second layer holds for the first one.
    asset.tile_mut(1).set_rigidity(None).unwrap();
    assert!(solved(&mut asset).iter().all(|u| *u == [0; 2]));
    asset.tile_mut(1).set_rigidity(Some(view(&stack.rigidity, 64, 64))).unwrap();
    assert!(solved(&mut asset) == before);
    assert_eq!(device.info().bytes_held, held);
    let settings = TileSettings { room: 0.1, ..asset.tile_mut(1).settings().unwrap() };
    asset.tile_mut(1).set_settings(&settings).unwrap();
    assert_eq!(asset.tile_mut(0).settings().unwrap(), settings);
    asset.tile_mut(0).set_settings(&TileSettings { room: 0.3, ..settings }).unwrap();
    asset.tile_mut(1).set_mask(Some(view(&[0], 1, 1))).unwrap();
    assert!(solved(&mut asset).iter().all(|u| *u == [0; 2]));
    asset.tile_mut(0).set_mask(None).unwrap();
    // A stroke changes both, too, as if the whole map had been set.
    let mut painted = stack.rigidity.clone();
    for y in 20..30 {
        painted[y * 64 + 20..y * 64 + 40].fill(255);
    }
    asset.tile_mut(1).update_rigidity(view(&painted, 64, 64), [20, 20], [20, 10]).unwrap();
    let stroke = solved(&mut asset);
    asset.tile_mut(0).set_rigidity(Some(view(&painted, 64, 64))).unwrap();
    assert!(solved(&mut asset) == stroke && stroke != before);
    // A part outside of the map changes neither.
    let error = asset.tile_mut(1).update_rigidity(view(&painted, 64, 64), [60, 0], [20, 10]).unwrap_err();
    assert_eq!(error.kind, ErrorKind::InvalidArgument);
    assert!(solved(&mut asset) == stroke);
}

#[test]
fn as_many_layers_as_are_allowed() {
    let island = Island { origin: [0.2, 0.2], sides: [[0.6, 0.0], [0.0, 0.6]] };
    let stack = Stack::of(vec![island; 30], &mut Random(3));
    let device = cpu(2);
    let mut asset = stack.asset(&device, MOST, None);
    assert_eq!(layers(&stack, &asset), (0..30).collect::<Vec<u32>>());
    asset.solve(stack.positions(), &SolveOptions::default()).unwrap();
    assert!((0..30).all(|layer| asset.tile(layer).report().unwrap().max_displacement > 0.1));
    // Too few: the islands that are left over share the last layer, where nothing moves.
    let mut asset = stack.asset(&device, 4, None);
    let expected: Vec<u32> = (0..30).map(|k| k.min(3)).collect();
    assert_eq!(layers(&stack, &asset), expected);
    asset.solve(stack.positions(), &SolveOptions::default()).unwrap();
    let moves = |layer: usize| asset.tile(layer).report().unwrap().max_displacement > 0.1;
    assert_eq!([0, 1, 2, 3].map(moves), [true, true, true, false]);
    assert_eq!(asset.tile_mut(3).info().unwrap().overlap, 1.0);
}

/// A ring-like strip of squares that goes around more than once lies over itself: it is one chart, which stays where it
/// covers itself, and moves elsewhere.
#[test]
fn a_chart_that_lies_over_itself_stays_there() {
    const TURNS: usize = 40;
    let mut stack = mirrored();
    let (mut rest, mut pose, mut uvs, mut indices) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
    for k in 0..=TURNS {
        // One and a half turns.
        let angle = k as f64 / TURNS as f64 * 1.5 * std::f64::consts::TAU;
        for j in 0..=SIDE {
            let radius = 0.15 + 0.25 * j as f64 / SIDE as f64;
            let along = 0.3 * angle;
            rest.push([along as f32, radius as f32, 0.0]);
            pose.push([
                (along + 0.1 * (5.0 * along).sin()) as f32,
                (radius + 0.4 * radius * radius) as f32,
                0.0,
            ]);
            uvs.push([0.5 + radius * angle.cos(), 0.5 + radius * angle.sin()].map(|x| x as f32));
        }
    }
    // Along the strip first, then outward.
    indices.extend(quads([SIDE, TURNS], 0).chunks_exact(4).flat_map(|q| [q[0], q[3], q[2], q[1]]));
    (stack.rest, stack.pose, stack.uvs, stack.indices) = (rest, pose, uvs, indices);
    let mut asset = stack.asset(&cpu(2), MOST, None);
    let info = asset.tile_mut(0).info().unwrap();
    assert_eq!((asset.tile_count(), info.charts, info.layers), (1, 1, 1));
    assert!(info.overlap > 0.4 && info.rigid_overlapped > 0 && info.movable_nodes > 100, "{info:?}");
    asset.solve(stack.positions(), &SolveOptions::default()).unwrap();
    check_one_to_one(&mut asset, 0).unwrap();
    let moved = fetch(&mut asset, 0, FetchKind::RedirectionDelta, [64, 64]);
    // The upper half is covered twice.
    let upper = |n: usize| n / 64 > 34;
    let is_moved = |(n, delta): (usize, &[f32; 2])| *delta != [0.0; 2] && upper(n);
    assert!(!moved.iter().enumerate().any(is_moved));
    assert!(moved.iter().any(|delta| *delta != [0.0; 2]));
}

#[test]
fn unique_layouts_have_one_layer_and_the_same_bits() {
    for scene in ["torus", "arm", "mug_to_jug"] {
        let mut model = Model::from(scenes::by_name(scene).unwrap());
        let [alone, layered] = [0, MOST].map(|most| {
            model.max_layers = most;
            let mut asset = model.solved(&cpu(2), 64, 1, &SolveOptions::default());
            (asset.tile_count(), bits(&asset), asset.tile_mut(0).saved_size().unwrap())
        });
        assert!(alone == layered, "{scene}");
    }
}

/// A sheet whose halves lie over one another, the second one `shift` farther along u; three discs are on the line where
/// they meet, where the first half has it.
fn folded(shift: f32) -> Stack {
    const HALF: usize = 16;
    let mut stack = mirrored();
    let (mut rest, mut pose, mut uvs, mut indices) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
    for j in 0..=HALF {
        for i in 0..=2 * HALF {
            let (x, y) = (i as f64 / HALF as f64 - 1.0, j as f64 / HALF as f64);
            rest.push([x, y, 0.0].map(|x| x as f32));
            let wide = 1.0 + 0.15 * (-4.0 * x * x).exp() * (1.0 + 0.5 * y);
            let high = y + 0.1 * (3.0 * y).sin() * (2.0 * x + 0.4).cos();
            pose.push([x * wide, high, 0.0].map(|x| x as f32));
            // Numbers that keep their bits when 1 is added.
            uvs.push([0.25 + 0.6 * x.abs(), 0.1 + 0.8 * y].map(|x| ((x * 65536.0).round() / 65536.0) as f32));
        }
    }
    for half in 0..2 {
        for (i, j) in (0..HALF).flat_map(|j| (0..HALF).map(move |i| (i + half * HALF, j))) {
            let at = |i: usize, j: usize| (j * (2 * HALF + 1) + i) as u32;
            indices.extend([at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)]);
        }
    }
    // Three discs whose middles are on the line.
    for (n, texel) in stack.rigidity.iter_mut().enumerate() {
        let [u, v] = [n % 64, n / 64].map(|k| (k as f64 + 0.5) / 64.0);
        let is_rigid = [0.25, 0.5, 0.75].iter().any(|middle| (u - 0.25).hypot(v - middle) < 0.07);
        *texel = 255 * u8::from(is_rigid);
    }
    let (count, second) = (uvs.len(), indices.len() / 2);
    uvs.extend_from_within(..);
    uvs[count..].iter_mut().for_each(|uv| uv[0] += shift);
    let of = |(c, &v): (usize, &u32)| if c < second { v } else { v + count as u32 };
    stack.uv_indices = Some(indices.iter().enumerate().map(of).collect());
    (stack.rest, stack.pose, stack.uvs, stack.indices) = (rest, pose, uvs, indices);
    stack
}

/// The halves of a body meet at a seam: each is the other's mirror image in the UV plane, and in another layer. They
/// are solved as if each had a UDIM tile to itself, also where they go on beyond the seam.
#[test]
fn a_layer_is_what_a_tile_of_its_own_would_be() {
    let stack = folded(0.0);
    // The same with the second half in tile 1002.
    let apart = folded(1.0);
    for seams in [Seams::Shut, Seams::Keep, Seams::Continue] {
        let [layered, apart] = [(&stack, MOST), (&apart, 0)].map(|(stack, most)| {
            let mut asset = stack.asset(&cpu(2), most, None);
            assert_eq!(asset.tile_count(), 2);
            change_all(&mut asset, |settings| (settings.seams, settings.seam_reach) = (seams, 0.1));
            asset
                .solve(stack.positions(), &SolveOptions { measure: true, ..SolveOptions::default() })
                .unwrap();
            let strain = [0, 1].map(|tile| asset.tile(tile).report().unwrap().strain.unwrap());
            (bits(&asset), strain)
        });
        assert!(layered == apart, "{seams:?}");
        let edges = |of: &StrainReport| of.segments > 0 && of.after.rms < of.before.rms;
        // All features are on the seam, so that `Keep` leaves them as they are.
        assert_eq!(layered.1.iter().all(edges), seams != Seams::Keep, "{seams:?}: {:?}", layered.1);
        // Features on the seam move only where charts go on.
        assert_eq!(layered.1.iter().all(|of| of.segments_fixed == 0), seams == Seams::Continue);
    }
}

/// All layers share a texture: what one of them has beyond its border must not come out of another one's chart, nor go
/// there.
#[test]
fn nothing_leads_beyond_a_border_into_a_chart_of_another_layer() {
    // The second half begins an eighth of the tile farther left, so that it lies beyond the first one's seam, or in
    // tile 1002.
    let farthest = [-0.125, 1.0].map(|shift| {
        let mut stack = folded(shift);
        // The surface is stretched on one side of the line and squeezed on the other, so that the discs move over it.
        for (posed, rest) in stack.pose.iter_mut().zip(&stack.rest) {
            posed[0] = rest[0] + 0.3 * (-6.0 * (rest[0] - 0.25).powi(2)).exp()
                - 0.25 * (-9.0 * (rest[0] + 0.2).powi(2)).exp();
        }
        let mut asset = stack.asset(&cpu(2), MOST, None);
        change_all(&mut asset, |settings| (settings.seams, settings.seam_reach) = (Seams::Continue, 0.1));
        asset.solve(stack.positions(), &SolveOptions::default()).unwrap();
        let redirected = fetch(&mut asset, 0, FetchKind::Redirection, [256; 2]);
        let in_chart = |n: &usize| (65..217).contains(&(n % 256)) && (27..230).contains(&(n / 256));
        let all = (0..redirected.len()).filter(in_chart).map(|n| redirected[n][0]);
        let dilated = vrtm_testkit::dilation(&asset, 0, 0.1, 256, [0.0f32; 2]);
        let own = |n: usize| (dilated[n][0] - (n % 256) as f32 / 256.0 - 0.5 / 256.0).abs() < 1e-6;
        // A few texels beyond the border, at half of its height.
        let beside = (40..62).all(|x| own(128 * 256 + x));
        (all.fold(1.0, f32::min), asset.tile(0).report().unwrap().texels_limited, beside)
    });
    let [stacked, apart] = farthest;
    assert!(stacked.0 > 0.2499 && stacked.1 > 50 && stacked.2, "{farthest:?}");
    assert!(!apart.2, "{farthest:?}");
}
