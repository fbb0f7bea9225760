//! Splits triangles consistently across edges: an edge is split for all triangles that share it or for none, and never
//! before the longest edge of each of these triangles. The surface thus stays free of cracks, and no angle becomes
//! smaller than about half of the smallest original angle (Rivara's longest-edge partition).

use vrtm_core::allocation::{Vec, zeroed};
use vrtm_core::mesh::hash::{Table, enter};
use vrtm_core::mesh::{Mesh, NONE};

use crate::base::{Base, UvPoint};

/// A vertex that splits an edge.
#[derive(Clone, Copy, Debug)]
pub struct NewVertex {
    /// The edge's ends.
    parents: [u32; 2],
    pub source: Source,
    point: u32,
}

/// Up to three vertices or corners of the mesh with their weights; a weight of 0 repeats the first.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Source {
    pub of: [u32; 3],
    pub weights: [f32; 3],
}

impl Source {
    pub fn one(of: u32) -> Source {
        Source { of: [of; 3], weights: [1.0, 0.0, 0.0] }
    }

    /// A source of three with their weights.
    pub fn weighed(of: [u32; 3], weights: [f32; 3]) -> Source {
        let (mut found, mut count) = (Source { of, weights: [0.0; 3] }, 0);
        for k in (0..3).filter(|&k| weights[k] > 0.0) {
            (found.of[count], found.weights[count]) = (of[k], weights[k]);
            count += 1;
        }
        (count..3).for_each(|k| found.of[k] = found.of[0]);
        found
    }

    /// The midpoint of two sources. Weights are sums of halves, and exact. Both lie in one triangle, so at most three
    /// sources occur.
    fn between(a: Source, b: Source) -> Source {
        let mut sum: [(u32, f32); 3] = [(NONE, 0.0); 3];
        let mut count = 0;
        for (of, weight) in [a, b].iter().flat_map(|s| s.of.into_iter().zip(s.weights)) {
            if weight == 0.0 {
                continue;
            }
            match sum[..count].iter_mut().find(|one| one.0 == of) {
                Some(one) => one.1 += 0.5 * weight,
                None if count < 3 => {
                    sum[count] = (of, 0.5 * weight);
                    count += 1;
                }
                None => panic!("more than three sources"),
            }
        }
        sum[..count].sort_unstable_by_key(|one| one.0);
        let first = sum[0].0;
        let of = std::array::from_fn(|k| if k < count { sum[k].0 } else { first });
        Source { of, weights: sum.map(|one| one.1) }
    }
}

/// An edge between two points. Vertices that are welded by position are one point.
#[derive(Clone, Copy, Debug)]
struct Edge {
    /// Its two points, in ascending order.
    ends: [u32; 2],
    /// Square of its length at rest.
    square: f64,
    /// The point that splits it, or `NONE`.
    middle: u32,
}

/// A corner of a piece.
#[derive(Clone, Copy, Debug)]
pub struct PieceCorner {
    pub vertex: u32,
    pub uv_point: u32,
    /// Barycentric coordinates in the base triangle.
    pub weights: [f32; 3],
}

/// A triangle of the refined mesh.
#[derive(Clone, Copy, Debug)]
pub struct Piece {
    /// The triangle of the mesh that it is a part of.
    pub base: u32,
    pub corners: [PieceCorner; 3],
    /// Edge k goes from corner k to the next. Edge 0 is the longest at rest.
    edges: [u32; 3],
}

/// A refined mesh.
#[derive(Clone, Debug, Default)]
pub struct Pieces {
    /// The new vertices, which follow those of the mesh.
    pub vertices: Vec<NewVertex>,
    pub uv_points: Vec<UvPoint>,
    /// The UV points after those of the base: each is halfway between these two.
    uv_parents: Vec<[u32; 2]>,
    /// Rest positions of the points after those of the mesh.
    points: Vec<[f64; 3]>,
    edges: Vec<Edge>,
    /// Ordered by base triangle.
    pub list: Vec<Piece>,
    /// Per face, true if it is still the mesh's own polygon.
    pub whole: Vec<bool>,
}

impl Pieces {
    /// Bytes held.
    pub fn bytes(&self) -> usize {
        size_of_val(&*self.vertices)
            + size_of_val(&*self.uv_points)
            + size_of_val(&*self.uv_parents)
            + size_of_val(&*self.points)
            + size_of_val(&*self.edges)
            + size_of_val(&*self.list)
            + size_of_val(&*self.whole)
    }
}

/// Pieces that are being split, with look-up tables.
pub struct Splitter<'a> {
    mesh: &'a Mesh,
    pub pieces: Pieces,
    edges: Table<[u32; 2], u32>,
    middles: Table<[u32; 2], u32>,
    uv_middles: Table<[u32; 2], u32>,
}

impl<'a> Splitter<'a> {
    /// Starts with the mesh itself.
    pub fn new(mesh: &'a Mesh, base: &Base) -> Splitter<'a> {
        let pieces = Pieces {
            uv_points: base.uv_points.clone(),
            whole: (1..mesh.faces.len()).map(|_| true).collect(),
            ..Pieces::default()
        };
        let mut splitter = Splitter::go_on(mesh, base, pieces);
        let mut list = Vec::with_capacity(base.triangles.len());
        for (t, triangle) in base.triangles.iter().enumerate() {
            let corner = |k: usize| PieceCorner {
                vertex: mesh.indices[triangle.corners[k] as usize],
                uv_point: base.uv_point[triangle.corners[k] as usize],
                weights: std::array::from_fn(|l| if k == l { 1.0 } else { 0.0 }),
            };
            let corners = [corner(0), corner(1), corner(2)];
            list.push(splitter.piece(t as u32, corners));
        }
        splitter.pieces.list = list;
        splitter
    }

    /// Continues with existing pieces.
    pub fn go_on(mesh: &'a Mesh, base: &Base, pieces: Pieces) -> Splitter<'a> {
        let mut splitter = Splitter {
            mesh,
            edges: Table::default(),
            middles: Table::default(),
            uv_middles: Table::default(),
            pieces,
        };
        let Pieces { vertices, uv_parents, edges, .. } = &splitter.pieces;
        for (k, edge) in (0..).zip(edges) {
            enter(&mut splitter.edges, edge.ends, k);
        }
        for (k, vertex) in (mesh.rest.len() as u32..).zip(vertices) {
            enter(&mut splitter.middles, sorted(vertex.parents), k);
        }
        for (k, &parents) in (base.uv_points.len() as u32..).zip(uv_parents) {
            enter(&mut splitter.uv_middles, sorted(parents), k);
        }
        splitter
    }

    /// True if the longest edge of a piece has a length.
    pub fn can_split(&self, piece: &Piece) -> bool {
        self.pieces.edges[piece.edges[0] as usize].square > 0.0
    }

    /// The edges to split for these pieces: the longest edge of each, or all of its edges if the flag is set. For each
    /// edge, the longest edge of every piece that shares it is split as well. Also returns the resulting number of
    /// pieces.
    pub fn marked(&self, wanted: impl Iterator<Item = (u32, bool)>) -> (Vec<bool>, usize) {
        let list = &self.pieces.list;
        let mut marked = zeroed(self.pieces.edges.len());
        for (k, all) in wanted {
            let piece = &list[k as usize];
            marked[piece.edges[0] as usize] = true;
            if all {
                piece.edges.iter().for_each(|&e| marked[e as usize] = true);
            }
        }
        loop {
            let mut changed = false;
            let mut count = list.len();
            for piece in list {
                let split = piece.edges.iter().filter(|&&e| marked[e as usize]).count();
                count += split;
                if split == 0 || split == 3 {
                    continue;
                }
                let longest = piece.edges[0] as usize;
                if !marked[longest] {
                    marked[longest] = true;
                    changed = true;
                }
            }
            if !changed {
                return (marked, count);
            }
        }
    }

    /// Splits the marked edges. `values` has one value per piece; new parts get `new`.
    pub fn split(&mut self, marked: &[bool], values: &mut Vec<f64>, new: f64) {
        let old = std::mem::take(&mut self.pieces.list);
        let mut list = Vec::with_capacity(old.len());
        let mut next = Vec::with_capacity(old.len());
        for (piece, value) in old.iter().zip(values.iter()) {
            let before = list.len();
            self.split_piece(piece, marked, &mut list);
            let parts = list.len() - before;
            if parts == 1 {
                next.push(*value);
            } else {
                (0..parts).for_each(|_| next.push(new));
            }
        }
        self.pieces.list = list;
        *values = next;
    }

    fn split_piece(&mut self, piece: &Piece, marked: &[bool], list: &mut Vec<Piece>) {
        let is_marked = |k: usize| marked[piece.edges[k] as usize];
        if !is_marked(0) {
            list.push(*piece);
            return;
        }
        let [a, b, c] = piece.corners;
        let middle = self.middle(a, b);
        // Each half stays whole, or its side that belonged to the piece is split, too.
        if is_marked(2) {
            let side = self.middle(c, a);
            list.push(self.piece(piece.base, [a, middle, side]));
            list.push(self.piece(piece.base, [side, middle, c]));
        } else {
            list.push(self.piece(piece.base, [a, middle, c]));
        }
        if is_marked(1) {
            let side = self.middle(b, c);
            list.push(self.piece(piece.base, [middle, b, side]));
            list.push(self.piece(piece.base, [middle, side, c]));
        } else {
            list.push(self.piece(piece.base, [middle, b, c]));
        }
    }

    /// A piece with its edges, the longest first. Of equal edges all pieces choose the same one.
    fn piece(&mut self, base: u32, corners: [PieceCorner; 3]) -> Piece {
        let edges = [0, 1, 2].map(|k| self.edge(corners[k].vertex, corners[(k + 1) % 3].vertex));
        let edge = |k: usize| &self.pieces.edges[edges[k] as usize];
        let longer = |a: usize, b: usize| {
            let (e, f) = (edge(a), edge(b));
            if e.square.total_cmp(&f.square).then(e.ends.cmp(&f.ends)).is_lt() { b } else { a }
        };
        let first = longer(longer(0, 1), 2);
        let turned = |k: usize| (first + k) % 3;
        Piece {
            base,
            corners: [0, 1, 2].map(|k| corners[turned(k)]),
            edges: [0, 1, 2].map(|k| edges[turned(k)]),
        }
    }

    /// The edge between two vertices.
    fn edge(&mut self, a: u32, b: u32) -> u32 {
        let ends = sorted([a, b].map(|v| self.point(v)));
        if let Some(&edge) = self.edges.get(&ends) {
            return edge;
        }
        let [p, q] = ends.map(|point| self.rest(point));
        let square = (0..3).map(|axis| (p[axis] - q[axis]).powi(2)).sum();
        let edge = self.pieces.edges.len() as u32;
        self.pieces.edges.push(Edge { ends, square, middle: NONE });
        enter(&mut self.edges, ends, edge);
        edge
    }

    /// The corner halfway between two corners of one piece.
    fn middle(&mut self, a: PieceCorner, b: PieceCorner) -> PieceCorner {
        PieceCorner {
            vertex: self.middle_vertex(a.vertex, b.vertex),
            uv_point: self.middle_uv_point(a.uv_point, b.uv_point),
            weights: std::array::from_fn(|k| 0.5 * (a.weights[k] + b.weights[k])),
        }
    }

    fn middle_vertex(&mut self, a: u32, b: u32) -> u32 {
        let parents = sorted([a, b]);
        if let Some(&vertex) = self.middles.get(&parents) {
            return vertex;
        }
        let point = self.middle_point(a, b);
        let source = Source::between(self.source(parents[0]), self.source(parents[1]));
        let vertex = (self.mesh.rest.len() + self.pieces.vertices.len()) as u32;
        self.pieces.vertices.push(NewVertex { parents, source, point });
        enter(&mut self.middles, parents, vertex);
        vertex
    }

    /// The point on the edge between two vertices, shared by all vertices on it.
    fn middle_point(&mut self, a: u32, b: u32) -> u32 {
        let edge = self.edge(a, b) as usize;
        let Edge { ends, middle, .. } = self.pieces.edges[edge];
        if middle != NONE {
            return middle;
        }
        let [p, q] = ends.map(|point| self.rest(point));
        let point = (self.mesh.rest.len() + self.pieces.points.len()) as u32;
        self.pieces.points.push(std::array::from_fn(|axis| 0.5 * p[axis] + 0.5 * q[axis]));
        self.pieces.edges[edge].middle = point;
        point
    }

    fn middle_uv_point(&mut self, a: u32, b: u32) -> u32 {
        let parents = sorted([a, b]);
        if let Some(&point) = self.uv_middles.get(&parents) {
            return point;
        }
        let [p, q] = parents.map(|point| self.pieces.uv_points[point as usize]);
        // A corner of triangles without area only has no triangle.
        let triangle = if p.triangle == NONE { q.triangle } else { p.triangle };
        let uv = std::array::from_fn(|axis| 0.5 * (p.uv[axis] + q.uv[axis]));
        let point = self.pieces.uv_points.len() as u32;
        self.pieces.uv_points.push(UvPoint { uv, tile: p.tile, triangle });
        self.pieces.uv_parents.push(parents);
        enter(&mut self.uv_middles, parents, point);
        point
    }

    fn point(&self, vertex: u32) -> u32 {
        match (vertex as usize).checked_sub(self.mesh.rest.len()) {
            Some(new) => self.pieces.vertices[new].point,
            None => self.mesh.place.get(vertex as usize).copied().unwrap_or(vertex),
        }
    }

    fn rest(&self, point: u32) -> [f64; 3] {
        match (point as usize).checked_sub(self.mesh.rest.len()) {
            Some(new) => self.pieces.points[new],
            None => self.mesh.rest[point as usize],
        }
    }

    fn source(&self, vertex: u32) -> Source {
        match (vertex as usize).checked_sub(self.mesh.rest.len()) {
            Some(new) => self.pieces.vertices[new].source,
            None => Source::one(vertex),
        }
    }
}

fn sorted([a, b]: [u32; 2]) -> [u32; 2] {
    [a.min(b), a.max(b)]
}
