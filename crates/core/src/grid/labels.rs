//! Finds the painted features of a grid (`features`): connected nodes of a block, then those of different blocks.

use super::Level;
use super::features::{Features, LEAST_EDGES, LEVELS, Pieces};
use super::node_set::{NodeSet, NodeWindow};
use super::planes::{EDGES, NODES, Plane, SIDE, node_at, slot};
use super::window::{self, place};
use crate::allocation::{Vec, vec, zeroed};
use crate::mesh::NONE;
use crate::sets::{grouped, root};
use crate::team::Team;

/// Most pieces of a block; the nodes of further ones are in no feature.
const MOST_PIECES: usize = 255;

/// The tags of a block's nodes, and of each of its pieces the feature and the number of edges.
type OfBlock = (Plane<u16>, Vec<[u32; 2]>);

/// The features of the levels of a grid. On level 0, `movable` are the blocks' movable nodes, and `triangle` names the
/// triangles under the nodes.
pub fn features(team: &Team, levels: &[Level], movable: &[NodeSet], triangle: &[Plane<u32>]) -> Features {
    let mut blocks = finest(team, &levels[0], movable, triangle);
    let count = join(&levels[0], &mut blocks);
    let mut features = Features { count, levels: Vec::with_capacity(LEVELS) };
    features.levels.push(pieces(blocks, count));
    for level in levels.iter().take(LEVELS).skip(1) {
        let finer = features.levels.last().expect("level 0");
        let names = team.map(level.blocks.list.len(), |b| names(level, finer, b));
        features.levels.push(pieces(team.map(names.len(), |b| coarser(level, &names, b)), count));
    }
    features
}

/// The pieces in the blocks of a level.
fn pieces(blocks: Vec<OfBlock>, count: usize) -> Pieces {
    let mut pieces =
        Pieces { edges: zeroed(count), tags: Vec::with_capacity(blocks.len()), ..Pieces::default() };
    for (tags, own) in blocks {
        pieces.tags.push(tags);
        pieces.first.push(pieces.feature.len() as u32);
        for [feature, edges] in own {
            pieces.feature.push(feature);
            pieces.edges[feature as usize] += edges;
        }
    }
    pieces.first.push(pieces.feature.len() as u32);
    let with_feature = pieces.feature.iter().zip(0..).map(|(&feature, piece)| (feature as usize, piece));
    (pieces.first_of_feature, pieces.of_feature) = grouped(count, with_feature);
    pieces
}

/// The blocks of level 0, whose pieces have no features yet.
fn finest(team: &Team, level: &Level, movable: &[NodeSet], triangle: &[Plane<u32>]) -> Vec<OfBlock> {
    let largest = |blocks: &std::ops::Range<usize>| {
        level.rigidity[blocks.clone()].as_flattened().iter().copied().max().unwrap_or(0)
    };
    let largest: Vec<u16> = level.blocks.of_chart.iter().map(largest).collect();
    let rigid = team.map(triangle.len(), |b| {
        // Half of the largest is no code of its own where that is odd, and is stored as the next one.
        let least = largest[level.blocks.list[b].chart as usize].div_ceil(2);
        let mut nodes = NodeSet::EMPTY;
        if level.rigidity[b].iter().any(|code| *code > least) {
            let codes = level.rigidity[b].iter().zip(&triangle[b]).enumerate();
            for (s, _) in codes.filter(|(_, (code, triangle))| **code > least && **triangle != NONE) {
                let (i, j) = node_at(s);
                nodes.insert(i, j);
            }
        }
        nodes
    });
    team.map(triangle.len(), |b| match rigid[b].is_empty() {
        true => ([0; NODES], Vec::new()),
        false => {
            let windows = [level.blocks.window(&rigid, b), level.blocks.window(movable, b)];
            connected(rigid[b], movable[b], &windows)
        }
    })
}

/// The pieces of connected rigid nodes of a block.
fn connected(mut left: NodeSet, movable: NodeSet, [rigid, free]: &[NodeWindow; 2]) -> OfBlock {
    // Of each owned edge, the nodes where it is inside of a feature.
    let inside = EDGES.map(|(di, dj)| {
        NodeSet(std::array::from_fn(|j| {
            let rows =
                |nodes: &NodeWindow| (nodes.0[j + 1] >> 1, nodes.0[(j as i64 + 1 + dj) as usize] >> (1 + di));
            let ((near, far), (near_free, far_free)) = (rows(rigid), rows(free));
            (near & far & (near_free | far_free)) as u16
        }))
    });
    let (mut tags, mut own) = ([0; NODES], Vec::new());
    while let Some(j) = left.0.iter().position(|row| *row != 0) {
        let mut piece = NodeSet::EMPTY;
        piece.insert(left.0[j].trailing_zeros() as usize, j);
        loop {
            let fixed = around(piece.without(movable)).and(movable);
            let grown = piece.or(around(piece.and(movable)).or(fixed).and(left));
            if grown == piece {
                break;
            }
            piece = grown;
        }
        left = left.without(piece);
        if own.len() == MOST_PIECES {
            break;
        }
        for (j, mut row) in piece.0.into_iter().enumerate() {
            while row != 0 {
                let i = row.trailing_zeros() as usize;
                row &= row - 1;
                let edges = (0..4).map(|e| (inside[e].0[j] >> i & 1) << (8 + e)).sum::<u16>();
                tags[slot(i, j)] = own.len() as u16 + 1 + edges;
            }
        }
        own.push([NONE, inside.map(|nodes| nodes.and(piece).count() as u32).iter().sum()]);
    }
    (tags, own)
}

/// Some nodes of a block and their neighbours in it.
fn around(nodes: NodeSet) -> NodeSet {
    let rows = nodes.0.map(|row| row | row << 1 | row >> 1);
    let row = |j: usize| rows.get(j).copied().unwrap_or(0);
    NodeSet(std::array::from_fn(|j| row(j) | row(j + 1) | row(j.wrapping_sub(1))))
}

/// Numbers the features of level 0, in the order of their first pieces, and leaves out those with few edges.
fn join(level: &Level, blocks: &mut [OfBlock]) -> usize {
    let mut first: Vec<u32> = Vec::with_capacity(blocks.len());
    let mut count = 0;
    for (_, own) in blocks.iter() {
        first.push(count);
        count += own.len() as u32;
    }
    let mut parents: Vec<u32> = (0..count).collect();
    let rim = |&(i, j): &(usize, usize)| i == 0 || i == SIDE - 1 || j == SIDE - 1;
    let rim: Vec<(usize, usize)> = (0..NODES).map(node_at).filter(rim).collect();
    for (b, (tags, _)) in blocks.iter().enumerate().filter(|(_, (_, own))| !own.is_empty()) {
        for &(i, j) in &rim {
            let tag = tags[slot(i, j)];
            for (_, (di, dj)) in EDGES.into_iter().enumerate().filter(|(e, _)| tag >> (8 + e) & 1 != 0) {
                let [x, y] = [i as i64 + di, j as i64 + dj].map(|n| (n + SIDE as i64) as usize);
                let holder = level.blocks.neighbours[b][y / SIDE * 3 + x / SIDE] as usize;
                let other = blocks[holder].0[slot(x % SIDE, y % SIDE)] & 0xff;
                if holder != b && other != 0 {
                    let piece = |b: usize, tag: u16| first[b] + u32::from(tag & 0xff) - 1;
                    let [one, other] = [piece(b, tag), piece(holder, other)].map(|n| root(&mut parents, n));
                    parents[one.max(other) as usize] = one.min(other);
                }
            }
        }
    }
    let roots: Vec<u32> = (0..count).map(|piece| root(&mut parents, piece)).collect();
    let mut edges: Vec<u32> = zeroed(count as usize);
    let all = blocks.iter().flat_map(|(_, own)| own);
    all.zip(&roots).for_each(|([_, own], &root)| edges[root as usize] += own);
    let (mut number, mut numbers) = (0, vec![NONE; count as usize]);
    for piece in (0..count as usize).filter(|&n| roots[n] as usize == n && edges[n] >= LEAST_EDGES) {
        numbers[piece] = number;
        number += 1;
    }
    for ((tags, own), &first) in blocks.iter_mut().zip(&first) {
        let of_piece = own.iter_mut().zip(&roots[first as usize..]);
        of_piece.for_each(|(piece, &root)| piece[0] = numbers[root as usize]);
        if own.iter().any(|piece| piece[0] == NONE) {
            let mut kept = 0;
            let number = |piece: &[u32; 2]| {
                kept += u16::from(piece[0] != NONE);
                if piece[0] == NONE { 0 } else { kept }
            };
            let renumbered: Vec<u16> = own.iter().map(number).collect();
            for tag in tags.iter_mut().filter(|tag| **tag != 0) {
                let piece = renumbered[usize::from(*tag & 0xff) - 1];
                *tag = if piece == 0 { 0 } else { *tag & 0xff00 | piece };
            }
            own.retain(|piece| piece[0] != NONE);
        }
    }
    number as usize
}

/// The features of the nodes of a block, which they have on the next finer level; or `NONE`.
fn names(level: &Level, finer: &Pieces, b: usize) -> Plane<u32> {
    let mut names = [NONE; NODES];
    for (quarter, &child) in level.children[b].iter().enumerate().filter(|(_, child)| **child != NONE) {
        let first = finer.first[child as usize] as usize;
        for n in 0..NODES / 4 {
            let (i, j) = (n % (SIDE / 2), n / (SIDE / 2));
            let piece = usize::from(finer.tags[child as usize][slot(2 * i, 2 * j)] & 0xff);
            if piece > 0 {
                names[slot(quarter % 2 * 8 + i, quarter / 2 * 8 + j)] = finer.feature[first + piece - 1];
            }
        }
    }
    names
}

/// A block of a coarser level, whose nodes are in these features.
fn coarser(level: &Level, names: &[Plane<u32>], b: usize) -> OfBlock {
    let (mut tags, mut own) = ([0; NODES], Vec::<[u32; 2]>::new());
    if names[b].iter().all(|&name| name == NONE) {
        return (tags, own);
    }
    let window = window::of(&level.blocks.neighbours[b], NONE, |b| &names[b]);
    let movable = window::of(&level.blocks.neighbours[b], 0, |b| &level.movable[b]);
    for (s, &name) in names[b].iter().enumerate().filter(|(_, name)| **name != NONE) {
        let piece = own.iter().position(|[feature, _]| *feature == name).unwrap_or(own.len());
        if piece == own.len() {
            if piece == MOST_PIECES {
                continue;
            }
            own.push([name, 0]);
        }
        let (i, j) = node_at(s);
        tags[s] = piece as u16 + 1;
        for (e, &(di, dj)) in EDGES.iter().enumerate() {
            let far = place((i as i64 + 1 + di) as usize, (j as i64 + 1 + dj) as usize);
            if window[far] == name && movable[place(i + 1, j + 1)] | movable[far] != 0 {
                tags[s] |= 0x100 << e;
                own[piece][1] += 1;
            }
        }
    }
    (tags, own)
}
