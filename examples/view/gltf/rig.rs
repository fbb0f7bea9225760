//! Poses of a mesh: what its nodes, its skin and its morph targets make of it.

use std::collections::HashSet;

use glam::{DMat4, DVec3};

use super::file::File;
use super::geometry::{Bone, Geometry, Target};
use super::motion::Animation;
use super::nodes::{Local, Nodes};

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
    pub geometry: &'a Geometry,
    /// Weights of morph targets per node where nothing is animated.
    weights: Vec<Vec<f64>>,
    /// From the mesh to the world at rest, per bone.
    rest: Vec<DMat4>,
}

/// A pose with its name.
pub struct Pose {
    pub name: String,
    pub points: Vec<[f32; 3]>,
}

impl<'a> Rig<'a> {
    pub fn new(file: &File, nodes: &'a Nodes, geometry: &'a Geometry) -> Rig<'a> {
        let weights = file.root.nodes.iter().map(|node| {
            let of_mesh = || node.mesh.and_then(|mesh| file.root.get(mesh)?.weights.clone());
            let weights = node.weights.clone().or_else(of_mesh).unwrap_or_default();
            weights.into_iter().map(f64::from).collect()
        });
        let mut rig = Rig { nodes, geometry, weights: weights.collect(), rest: Vec::new() };
        let matrices = rig.matrices(&nodes.locals);
        // In the bind pose all joints have the same matrix. The topmost one's leads to the world, with the size that
        // the poses have; a movement of the whole is none of the skin's.
        let is_sound = |matrix: &DMat4| matrix.is_finite() && matrix.determinant() != 0.0;
        let rest = |bone: &Bone| Some(matrices[bone.top]).filter(is_sound).unwrap_or_default();
        rig.rest = geometry.bones.iter().map(rest).collect();
        rig
    }

    /// The matrix of each bone.
    fn matrices(&self, locals: &[Local]) -> Vec<DMat4> {
        let globals = self.nodes.globals(locals);
        self.geometry.bones.iter().map(|bone| globals[bone.node] * bone.inverse_bind).collect()
    }

    /// Points moved by the morph targets with their weights, and by the bones with their matrices.
    fn moved(&self, matrices: &[DMat4], weight: impl Fn(&Target) -> f64) -> Vec<[f32; 3]> {
        let mut points: Vec<DVec3> = self.geometry.points.iter().map(|&p| vector(p)).collect();
        for target in &self.geometry.targets {
            let weight = weight(target);
            if weight != 0.0 {
                target.moves.iter().for_each(|&(v, by)| points[v as usize] += weight * vector(by));
            }
        }
        let moved = points.into_iter().zip(&self.geometry.influences).map(|(point, influences)| {
            let by = |&(bone, weight): &(u32, f64)| matrices[bone as usize].transform_point3(point) * weight;
            influences.iter().map(by).sum::<DVec3>().as_vec3().to_array()
        });
        moved.collect()
    }

    /// The bind pose, and that of meshes without a skin.
    pub fn rest(&self) -> Vec<[f32; 3]> {
        self.moved(&self.rest, |_| 0.0)
    }

    fn pose(&self, locals: &[Local], weights: &[Vec<f64>]) -> Vec<[f32; 3]> {
        let weight = |target: &Target| {
            let (node, k) = target.weight;
            weights[node].get(k).copied().unwrap_or(0.0)
        };
        self.moved(&self.matrices(locals), weight)
    }

    /// Poses of a file without animations: that of its nodes, if it is another one than rest, and each morph target,
    /// once for all meshes that have it.
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
        // Meshes that move together, such as a head and its teeth, have targets of the same name.
        let mut names: Vec<&str> = self.geometry.targets.iter().map(|target| target.name.as_str()).collect();
        let mut known = HashSet::new();
        names.retain(|name| known.insert(*name));
        for name in names.into_iter().take(most) {
            let points = self.moved(&self.rest, |target| f64::from(u8::from(target.name == name)));
            poses.push(Pose { name: name.into(), points });
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

fn vector(p: [f32; 3]) -> DVec3 {
    DVec3::from_array(p.map(f64::from))
}
