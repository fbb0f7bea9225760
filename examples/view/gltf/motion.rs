//! Animations: values of nodes over time.

use glam::DVec3;
use gltf::json::accessor::Type;
use gltf::json::animation::{Interpolation, Property};
use gltf::json::validation::Checked;
use gltf::json::{self, Index};

use super::file::File;
use super::nodes::{Local, rotation};

/// An animation, ready to be sampled.
pub struct Animation {
    pub name: String,
    channels: Vec<Channel>,
    /// Seconds of its first and last key.
    pub span: [f64; 2],
}

/// A property of a node over time.
struct Channel {
    node: usize,
    property: Property,
    track: Track,
}

/// Keys, and the values at them.
struct Track {
    times: Vec<f32>,
    /// `width` numbers per key; of a cubic spline the tangent before it, its value and the tangent after it.
    values: Vec<f32>,
    width: usize,
    interpolation: Interpolation,
}

/// Names of all animations.
pub fn names(root: &json::Root) -> Vec<String> {
    let name = |(k, animation): (usize, &json::Animation)| {
        animation.name.clone().filter(|name| !name.is_empty()).unwrap_or_else(|| format!("animation {k}"))
    };
    root.animations.iter().enumerate().map(name).collect()
}

/// Index of the longest animation.
pub fn longest(file: &File) -> Result<Option<usize>, String> {
    let length = |animation: &json::Animation| -> Result<f64, String> {
        let ends = animation.samplers.iter().map(|sampler| times(file, sampler));
        let spans =
            ends.map(|times| times.map(|times| f64::from(times[times.len() - 1]) - f64::from(times[0])));
        spans.collect::<Result<Vec<_>, _>>().map(|spans| spans.into_iter().fold(0.0, f64::max))
    };
    let lengths = file.root.animations.iter().map(length).collect::<Result<Vec<_>, _>>()?;
    Ok((0..lengths.len()).rev().max_by(|&a, &b| lengths[a].total_cmp(&lengths[b])))
}

fn times(file: &File, sampler: &json::animation::Sampler) -> Result<Vec<f32>, String> {
    let times = file.numbers(sampler.input, Type::Scalar)?;
    if times.is_empty() || times.windows(2).any(|pair| pair[0] > pair[1]) {
        return Err(format!("accessor {}: the times of keys do not ascend", sampler.input.value()));
    }
    Ok(times)
}

impl Animation {
    pub fn read(file: &File, index: usize) -> Result<Animation, String> {
        let (name, animation) = (names(&file.root)[index].clone(), &file.root.animations[index]);
        let channels = animation.channels.iter().map(|channel| Channel::read(file, animation, channel));
        let channels = channels
            .collect::<Result<Vec<_>, _>>()
            .map_err(|reason| format!("animation \"{name}\": {reason}"))?;
        let ends =
            |channel: &Channel| [channel.track.times[0], channel.track.times[channel.track.times.len() - 1]];
        let first = channels.iter().map(|channel| ends(channel)[0]).reduce(f32::min);
        let last = channels.iter().map(|channel| ends(channel)[1]).reduce(f32::max);
        Ok(Animation { name, channels, span: [first, last].map(|time| time.unwrap_or(0.0).into()) })
    }

    /// Writes the values of a time into transforms, and into the weights of nodes' morph targets.
    pub fn apply(&self, time: f64, locals: &mut [Local], weights: &mut [Vec<f64>]) {
        for Channel { node, property, track } in &self.channels {
            let value = track.at(time, *property == Property::Rotation);
            match property {
                Property::Translation => locals[*node].translation = DVec3::from_slice(&value),
                Property::Scale => locals[*node].scale = DVec3::from_slice(&value),
                Property::Rotation => locals[*node].rotation = rotation(&value),
                Property::MorphTargetWeights => weights[*node] = value,
            }
        }
    }
}

impl Channel {
    fn read(
        file: &File,
        animation: &json::Animation,
        channel: &json::animation::Channel,
    ) -> Result<Channel, String> {
        let (sampler, node) = (channel.sampler.value(), channel.target.node.value());
        let sampler =
            animation.samplers.get(sampler).ok_or_else(|| format!("sampler {sampler} is missing"))?;
        if node >= file.root.nodes.len() {
            return Err(format!("node {node} is missing"));
        }
        let (Checked::Valid(property), Checked::Valid(interpolation)) =
            (channel.target.path, sampler.interpolation)
        else {
            return Err("a channel of an unknown kind".into());
        };
        let times = times(file, sampler)?;
        let of = match property {
            Property::Rotation => Type::Vec4,
            Property::MorphTargetWeights => Type::Scalar,
            Property::Translation | Property::Scale => Type::Vec3,
        };
        let values = file.numbers(sampler.output, of)?;
        let keys = times.len() * if interpolation == Interpolation::CubicSpline { 3 } else { 1 };
        let width = values.len() / keys;
        if width * keys != values.len() || (of != Type::Scalar && width != of.multiplicity()) {
            let output: Index<_> = sampler.output;
            let [accessor, count] = [output.value(), values.len() / of.multiplicity()];
            return Err(format!("accessor {accessor}: {count} values for {} keys", times.len()));
        }
        Ok(Channel { node, property, track: Track { times, values, width, interpolation } })
    }
}

impl Track {
    /// The value at a time: before the first key and after the last one that of this key.
    fn at(&self, time: f64, turns: bool) -> Vec<f64> {
        let after = self.times.partition_point(|&key| f64::from(key) <= time);
        let key = after.saturating_sub(1);
        if after == 0 || after == self.times.len() {
            return self.value(key, 1);
        }
        let [start, end] = [key, after].map(|key| f64::from(self.times[key]));
        let (length, t) = (end - start, (time - start) / (end - start));
        match self.interpolation {
            Interpolation::Step => self.value(key, 1),
            Interpolation::Linear if turns => {
                let [from, to] = [key, after].map(|key| rotation(&self.value(key, 1)));
                from.slerp(to, t).to_array().into()
            }
            Interpolation::Linear => mix([(&self.value(key, 1), 1.0 - t), (&self.value(after, 1), t)]),
            // The cubic Hermite spline; its tangents are per second.
            Interpolation::CubicSpline => {
                let [t2, t3] = [t * t, t * t * t];
                mix([
                    (&self.value(key, 1), 2.0 * t3 - 3.0 * t2 + 1.0),
                    (&self.value(key, 2), length * (t3 - 2.0 * t2 + t)),
                    (&self.value(after, 1), 3.0 * t2 - 2.0 * t3),
                    (&self.value(after, 0), length * (t3 - t2)),
                ])
            }
        }
    }

    /// The value of a key (`part` 1), or its tangents (0 and 2).
    fn value(&self, key: usize, part: usize) -> Vec<f64> {
        let element = if self.interpolation == Interpolation::CubicSpline { 3 * key + part } else { key };
        self.values[element * self.width..(element + 1) * self.width].iter().map(|&x| x.into()).collect()
    }
}

fn mix<const N: usize>(parts: [(&Vec<f64>, f64); N]) -> Vec<f64> {
    (0..parts[0].0.len()).map(|k| parts.iter().map(|(value, weight)| value[k] * weight).sum()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn track(interpolation: Interpolation, values: &[f32], width: usize) -> Track {
        Track { times: vec![1.0, 3.0], values: values.to_vec(), width, interpolation }
    }

    #[test]
    fn values_between_keys_follow_the_interpolation() {
        let linear = track(Interpolation::Linear, &[1.0, 2.0], 1);
        let step = track(Interpolation::Step, &[1.0, 2.0], 1);
        for (time, between, held) in [(0.0, 1.0, 1.0), (1.5, 1.25, 1.0), (3.0, 2.0, 2.0), (9.0, 2.0, 2.0)] {
            assert_eq!((linear.at(time, false), step.at(time, false)), (vec![between], vec![held]), "{time}");
        }
        // The parabola (t - 1)^2 with its slopes is a cubic spline, too.
        let cubic = track(Interpolation::CubicSpline, &[9.0, 0.0, 0.0, 4.0, 4.0, 9.0], 1);
        for time in [1.0, 1.7, 2.0, 2.9] {
            let error = cubic.at(time, false)[0] - (time - 1.0) * (time - 1.0);
            assert!(error.abs() < 1e-12, "{time}: {error}");
        }
    }

    #[test]
    fn rotations_turn_the_shorter_way_at_constant_speed() {
        let half = std::f32::consts::FRAC_PI_4;
        let turn = |sign: f32| [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, sign * half.sin(), sign * half.cos()];
        for sign in [1.0, -1.0] {
            let track = track(Interpolation::Linear, &turn(sign), 4);
            // A third of a quarter turn.
            let q = rotation(&track.at(1.0 + 2.0 / 3.0, true));
            let angle = 2.0 * (q.z / q.w).atan();
            assert!((angle - std::f64::consts::PI / 6.0).abs() < 1e-7, "{angle}");
        }
    }
}
