//! A refined mesh as a host fetches it, and checks of it that share no code with the library.

pub mod truth;

use std::collections::{BTreeMap, BTreeSet};

use vrtm::{Asset, Refinement, RefinementPattern};

use crate::Model;

/// All that a refinement hands out.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Refined {
    pub vertex_sources: Vec<[u32; 3]>,
    pub vertex_weights: Vec<[f32; 3]>,
    pub face_sources: Vec<u32>,
    pub face_counts: Vec<u32>,
    pub corner_vertices: Vec<u32>,
    pub corner_sources: Vec<[u32; 3]>,
    pub corner_weights: Vec<[f32; 3]>,
    pub uvs: Vec<[f32; 2]>,
    pub redirected: Vec<[f32; 2]>,
}

impl Refined {
    pub fn of(refinement: &Refinement) -> Refined {
        let info = refinement.info();
        let (vertices, faces, corners) = (info.vertices as usize, info.faces as usize, info.corners as usize);
        let mut all = Refined {
            vertex_sources: vec![[u32::MAX; 3]; vertices],
            vertex_weights: vec![[f32::NAN; 3]; vertices],
            face_sources: vec![u32::MAX; faces],
            face_counts: vec![u32::MAX; faces],
            corner_vertices: vec![u32::MAX; corners],
            corner_sources: vec![[u32::MAX; 3]; corners],
            corner_weights: vec![[f32::NAN; 3]; corners],
            uvs: vec![[f32::NAN; 2]; corners],
            redirected: vec![[f32::NAN; 2]; corners],
        };
        let mut pattern = RefinementPattern {
            vertex_sources: Some(&mut all.vertex_sources),
            vertex_weights: Some(&mut all.vertex_weights),
            face_sources: Some(&mut all.face_sources),
            face_counts: Some(&mut all.face_counts),
            corner_vertices: Some(&mut all.corner_vertices),
            corner_sources: Some(&mut all.corner_sources),
            corner_weights: Some(&mut all.corner_weights),
            corner_uvs: Some(&mut all.uvs),
        };
        refinement.pattern(&mut pattern).unwrap();
        refinement.corner_uvs(&mut all.redirected).unwrap();
        all
    }

    /// The corners of each face.
    pub fn faces(&self) -> impl Iterator<Item = std::ops::Range<usize>> {
        crate::faces(&self.face_counts)
    }

    /// Positions of all vertices, from those of the mesh.
    pub fn positions(&self, mesh: &[[f32; 3]]) -> Vec<[f64; 3]> {
        let of = |(sources, weights): (&[u32; 3], &[f32; 3])| {
            [0, 1, 2].map(|axis| {
                (0..3).map(|k| f64::from(weights[k]) * f64::from(mesh[sources[k] as usize][axis])).sum()
            })
        };
        self.vertex_sources.iter().zip(&self.vertex_weights).map(of).collect()
    }

    /// The triangles of a face, by their corners. A quad has two ways to be cut, of which `other` is the second.
    pub fn triangles(&self, face: std::ops::Range<usize>, other: bool) -> Vec<[usize; 3]> {
        let first = face.start + usize::from(other && face.len() == 4);
        let at = |k: usize| face.start + (first - face.start + k) % face.len();
        (1..face.len().max(2) - 1).map(|k| [at(0), at(k), at(k + 1)]).collect()
    }

    fn sources(&self, vertex: u32) -> BTreeMap<u32, u64> {
        let v = vertex as usize;
        let mut all = BTreeMap::new();
        for (of, weight) in self.vertex_sources[v].into_iter().zip(self.vertex_weights[v]) {
            if weight != 0.0 {
                *all.entry(of).or_insert(0) += (f64::from(weight) * f64::from(1 << 30)) as u64;
            }
        }
        all
    }

    /// Weights, sources, original UVs, areas.
    pub fn check_pattern(&self, model: &Model) {
        let name = &model.name;
        let faces: Vec<_> = model.faces().collect();
        for (v, (sources, weights)) in self.vertex_sources.iter().zip(&self.vertex_weights).enumerate() {
            assert_eq!(weights.iter().sum::<f32>(), 1.0, "{name}: vertex {v}");
            assert!(weights.iter().all(|w| (0.0..=1.0).contains(w)), "{name}: vertex {v}");
            assert!(sources.iter().all(|&s| (s as usize) < model.rest.len()), "{name}: vertex {v}");
            if v < model.rest.len() {
                assert_eq!((sources, weights), (&[v as u32; 3], &[1.0, 0.0, 0.0]), "{name}: vertex {v}");
            } else {
                assert!(self.sources(v as u32).len() >= 2, "{name}: vertex {v} lies on another one");
            }
        }
        let used: BTreeSet<u32> = self.corner_vertices.iter().copied().collect();
        let old: BTreeSet<u32> = model.indices.iter().copied().collect();
        assert!(used.iter().all(|v| *v as usize >= model.rest.len() || old.contains(v)), "{name}");
        assert_eq!(
            used.len(),
            old.len() + self.vertex_sources.len() - model.rest.len(),
            "{name}: unused vertices"
        );
        let positions = self.positions(&model.rest);
        let mut areas = vec![0.0; faces.len()];
        for (f, face) in self.faces().enumerate() {
            let of = self.face_sources[f] as usize;
            assert!(f == 0 || self.face_sources[f - 1] as usize <= of, "{name}: order of faces");
            for c in face.clone() {
                let (sources, weights) = (self.corner_sources[c], self.corner_weights[c]);
                assert_eq!(weights.iter().sum::<f32>(), 1.0, "{name}: corner {c}");
                assert!(sources.iter().all(|&s| faces[of].contains(&(s as usize))), "{name}: corner {c}");
                let sum = |value: &dyn Fn(usize) -> f64| -> f64 {
                    (0..3).map(|k| f64::from(weights[k]) * value(sources[k] as usize)).sum()
                };
                for axis in 0..2 {
                    let uv = sum(&|s| f64::from(model.uvs[model.uv_indices[s] as usize][axis]));
                    let off = (uv - f64::from(self.uvs[c][axis])).abs();
                    assert!(
                        off <= f64::from(f32::EPSILON) * uv.abs(),
                        "{name}: uv of corner {c}: off by {off}"
                    );
                }
                let place = positions[self.corner_vertices[c] as usize];
                for (axis, place) in place.into_iter().enumerate() {
                    let at = sum(&|s| f64::from(model.rest[model.indices[s] as usize][axis]));
                    let off = (at - place).abs();
                    assert!(off <= 1e-12 * at.abs().max(1.0), "{name}: place of corner {c}: off by {off}");
                }
            }
            areas[of] += doubled_area(&face.map(|c| self.uvs[c]).collect::<Vec<_>>());
        }
        for (f, face) in faces.into_iter().enumerate() {
            let polygon: Vec<_> = face.map(|c| model.uvs[model.uv_indices[c] as usize]).collect();
            let area = doubled_area(&polygon);
            assert!((areas[f] - area).abs() <= 1e-6, "{name}: face {f}: {} of {area}", areas[f]);
        }
    }

    /// Each edge has as many faces as the mesh has at that place, and no vertex lies within an edge. `place` makes
    /// vertices of the mesh one.
    pub fn check_conforming(&self, model: &Model, place: impl Fn(u32) -> u32) {
        let name = &model.name;
        let sorted = |a: u32, b: u32| [a.min(b), a.max(b)];
        let mut expected: BTreeMap<[u32; 2], usize> = BTreeMap::new();
        for face in model.faces().filter(|face| face.len() >= 3) {
            for c in face.clone() {
                let next = if c + 1 == face.end { face.start } else { c + 1 };
                let edge = sorted(place(model.indices[c]), place(model.indices[next]));
                *expected.entry(edge).or_default() += 1;
            }
        }
        type Key = Vec<(u32, u64)>;
        let key = |v: u32| -> Key {
            let mut all = BTreeMap::new();
            self.sources(v).into_iter().for_each(|(of, w)| *all.entry(place(of)).or_insert(0) += w);
            all.into_iter().collect()
        };
        let mut found: BTreeMap<[Key; 2], usize> = BTreeMap::new();
        for face in self.faces().filter(|face| face.len() >= 3) {
            for c in face.clone() {
                let next = if c + 1 == face.end { face.start } else { c + 1 };
                let mut ends = [c, next].map(|c| key(self.corner_vertices[c]));
                ends.sort();
                *found.entry(ends).or_default() += 1;
            }
        }
        // Where the vertices on each edge of the mesh lie.
        let mut on_edge: BTreeMap<[u32; 2], BTreeSet<u64>> = BTreeMap::new();
        let along = |edge: [u32; 2], key: &Key| {
            let weight = |v: u32| key.iter().find(|k| k.0 == v).map_or(0, |k| k.1);
            (weight(edge[0]) + weight(edge[1]) == 1 << 30).then(|| weight(edge[1]))
        };
        let edge_of = |ends: &[Key; 2]| {
            let all: BTreeSet<u32> = ends.iter().flatten().map(|k| k.0).collect();
            let all: Vec<u32> = all.into_iter().collect();
            (all.len() == 2).then(|| [all[0], all[1]]).filter(|edge| expected.contains_key(edge))
        };
        for ends in found.keys() {
            if let Some(edge) = edge_of(ends) {
                on_edge.entry(edge).or_default().extend(ends.iter().filter_map(|key| along(edge, key)));
            }
        }
        for (ends, &count) in &found {
            let Some(edge) = edge_of(ends) else {
                assert_eq!(count, 2, "{name}: an edge within a face: {ends:?}");
                continue;
            };
            assert_eq!(count, expected[&edge], "{name}: an edge on {edge:?}: {ends:?}");
            let [a, b] = ends.each_ref().map(|key| along(edge, key).unwrap());
            let between = on_edge[&edge].range(a.min(b) + 1..a.max(b)).count();
            assert_eq!(between, 0, "{name}: a vertex within an edge on {edge:?}");
        }
        assert_eq!(on_edge.len(), expected.len(), "{name}: edges are lost");
        for (edge, places) in on_edge {
            assert!(places.contains(&0) && places.contains(&(1 << 30)), "{name}: {edge:?} is not covered");
        }
    }

    /// Corners of the mesh have the redirected UVs that the asset tells.
    pub fn check_corners(&self, model: &Model, asset: &Asset) {
        let own = crate::corner_uvs(asset);
        let mut seen = 0;
        for (c, weights) in self.corner_weights.iter().enumerate() {
            if weights[0] == 1.0 {
                let of = self.corner_sources[c][0] as usize;
                assert_eq!(self.redirected[c].map(f32::to_bits), own[of].map(f32::to_bits), "{}", model.name);
                seen += 1;
            }
        }
        assert!(seen >= model.indices.len(), "{}", model.name);
    }
}

/// Twice the signed area of a polygon.
fn doubled_area(polygon: &[[f32; 2]]) -> f64 {
    let p = |k: usize| polygon[k % polygon.len()].map(f64::from);
    let o = p(0);
    (0..polygon.len())
        .map(|k| {
            let (a, b) = (p(k), p(k + 1));
            (a[0] - o[0]) * (b[1] - o[1]) - (b[0] - o[0]) * (a[1] - o[1])
        })
        .sum()
}
