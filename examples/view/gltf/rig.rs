//! Poses of a mesh: what its nodes, its skin and its morph targets make of it.

use glam::{DMat4, DVec3};

use super::file::File;
use super::geometry::Geometry;
use super::motion::Animation;
use super::nodes::{Local, Nodes};
use super::subject::Subject;

/// Most poses, and most points of all poses together.
const MOST_POSES: i64 = 2_000;
const MOST_POINTS: i64 = 20_000_000;
/// Most frames of a timeline.
const MOST_FRAMES: f64 = 100_000.0;
/// Part of a frame by which a key may miss it.
const NEAR: f64 = 1e-3;
/// Movement of a vertex that is none, of the mesh's size.
const STILL: f64 = 1e-5;

/// A mesh, and what moves it.
pub struct Rig<'a> {
    pub nodes: &'a Nodes,
    pub subject: &'a Subject,
    pub geometry: &'a Geometry,
    /// Weights of morph targets per node where nothing is animated.
    weights: Vec<Vec<f64>>,
    /// From the mesh to the world at rest.
    rest: DMat4,
}

/// A pose with its name.
pub struct Pose {
    pub name: String,
    pub points: Vec<[f32; 3]>,
}

impl<'a> Rig<'a> {
    pub fn new(file: &File, nodes: &'a Nodes, subject: &'a Subject, geometry: &'a Geometry) -> Rig<'a> {
        let weights = file.root.nodes.iter().map(|node| {
            let of_mesh = || node.mesh.and_then(|mesh| file.root.get(mesh)?.weights.clone());
            let weights = node.weights.clone().or_else(of_mesh).unwrap_or_default();
            weights.into_iter().map(f64::from).collect()
        });
        let mut rig = Rig { nodes, subject, geometry, weights: weights.collect(), rest: DMat4::IDENTITY };
        let matrices = rig.matrices(&nodes.locals);
        // In the bind pose all joints have the same matrix. The topmost one's leads to the world, with the size that
        // the poses have; a movement of the whole is none of the skin's.
        let top = subject.skin.as_ref().and_then(|skin| nodes.topmost(&skin.joints)).unwrap_or(0);
        let rest = matrices[top];
        if rest.is_finite() && rest.determinant() != 0.0 {
            rig.rest = rest;
        }
        rig
    }

    /// The matrix of each joint, or of the node.
    fn matrices(&self, locals: &[Local]) -> Vec<DMat4> {
        let globals = self.nodes.globals(locals);
        let Some(skin) = &self.subject.skin else { return vec![globals[self.subject.nodes[0]]] };
        let inverse = |k: usize| match skin.inverse_bind.get(16 * k..16 * k + 16) {
            Some(columns) => DMat4::from_cols_array(&std::array::from_fn(|i| columns[i].into())),
            None => DMat4::IDENTITY,
        };
        skin.joints.iter().enumerate().map(|(k, &joint)| globals[joint] * inverse(k)).collect()
    }

    /// The mesh's own points, with morph targets by their weights.
    fn morphed(&self, weight: impl Fn((usize, usize)) -> f64) -> Vec<DVec3> {
        let mut points: Vec<DVec3> = self.geometry.points.iter().map(|&p| vector(p)).collect();
        for target in &self.geometry.targets {
            let weight = weight(target.weight);
            if weight != 0.0 {
                target.moves.iter().for_each(|&(v, by)| points[v as usize] += weight * vector(by));
            }
        }
        points
    }

    /// The bind pose, or that of a mesh without a skin.
    pub fn rest(&self) -> Vec<[f32; 3]> {
        moved(self.morphed(|_| 0.0), |_| self.rest)
    }

    fn pose(&self, locals: &[Local], weights: &[Vec<f64>]) -> Vec<[f32; 3]> {
        let matrices = self.matrices(locals);
        let points = self.morphed(|(node, k)| weights[node].get(k).copied().unwrap_or(0.0));
        moved(points, |vertex| match self.geometry.influences.get(vertex) {
            Some(influences) => influences
                .iter()
                .fold(DMat4::ZERO, |sum, &(joint, weight)| sum + matrices[joint as usize] * weight),
            None => matrices[0],
        })
    }

    /// Poses of a file without animations: that of its nodes, if it is another one than rest, and each morph target.
    pub fn shapes(&self) -> Vec<Pose> {
        let (rest, posed) = (self.rest(), self.pose(&self.nodes.locals, &self.weights));
        let size = rest.iter().map(|&p| vector(p).distance(vector(rest[0]))).fold(0.0, f64::max);
        let differs = |other: &[[f32; 3]]| {
            rest.iter().zip(other).any(|(&a, &b)| vector(a).distance(vector(b)) > STILL * size)
        };
        let mut poses = Vec::new();
        if differs(&posed) {
            poses.push(Pose { name: "posed".into(), points: posed });
        }
        let most = MOST_POSES.min(MOST_POINTS / rest.len() as i64) as usize;
        for target in self.geometry.targets.iter().take(most) {
            let points = moved(self.morphed(|weight| f64::from(weight == target.weight)), |_| self.rest);
            poses.push(Pose { name: target.name.clone(), points });
        }
        poses
    }

    /// Poses of an animation at whole frames, and the numbers of these frames; frame 0 is at 0 seconds. Of a long one
    /// only every second frame or fewer are poses.
    pub fn frames(&self, animation: &Animation, rate: f64) -> Result<(Vec<Pose>, Vec<i64>), String> {
        let [start, end] = animation.span.map(|time| time * rate);
        let [first, last] = [(start + NEAR).floor(), (end - NEAR).ceil().max((start + NEAR).floor())];
        if last - first > MOST_FRAMES || last.abs() > f64::from(i32::MAX) {
            let reason = format!("from {start} to {end} at {rate} a second; the most is {MOST_FRAMES}");
            return Err(format!("animation \"{}\": frames {reason}", animation.name));
        }
        let [first, last] = [first as i64, last as i64];
        let (count, points) = (last - first + 1, self.geometry.points.len() as i64);
        let step =
            ((count + MOST_POSES - 1) / MOST_POSES).max((count * points + MOST_POINTS - 1) / MOST_POINTS);
        let mut numbers: Vec<i64> = (first..last).step_by(step as usize).collect();
        numbers.push(last);
        let (mut locals, mut weights) = (self.nodes.locals.clone(), self.weights.clone());
        let pose = |&number: &i64| {
            animation.apply(number as f64 / rate, &mut locals, &mut weights);
            Pose { name: animation.name.clone(), points: self.pose(&locals, &weights) }
        };
        Ok((numbers.iter().map(pose).collect(), numbers))
    }
}

fn moved(points: Vec<DVec3>, by: impl Fn(usize) -> DMat4) -> Vec<[f32; 3]> {
    let moved = points.into_iter().enumerate().map(|(vertex, point)| by(vertex).transform_point3(point));
    moved.map(|p| p.to_array().map(|x| x as f32)).collect()
}

fn vector(p: [f32; 3]) -> DVec3 {
    DVec3::from_array(p.map(f64::from))
}
