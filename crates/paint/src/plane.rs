//! Fields of numbers.

/// Numbers row by row; width and height.
#[derive(Clone)]
pub struct Plane {
    pub values: Vec<f32>,
    pub size: [usize; 2],
}

impl Plane {
    pub fn of_map(map: &[u8], size: [usize; 2]) -> Plane {
        assert_eq!(map.len(), size[0] * size[1], "texels of a map of {size:?}");
        Plane { values: map.iter().map(|&value| f32::from(value) / 255.0).collect(), size }
    }

    pub fn to_map(&self) -> Vec<u8> {
        self.values.iter().map(|value| (255.0 * value).round_ties_even() as u8).collect()
    }

    /// Means of whole blocks, so that the longer side has at most `side` values.
    pub fn smaller(&self, side: usize) -> Plane {
        blocks(self.size, side, |k| self.values[k])
    }

    /// The field in another size, by bilinear interpolation.
    pub fn fitted(&self, size: [usize; 2]) -> Plane {
        let mut found = self.clone();
        for axis in [1, 0] {
            let last = found.size[axis] - 1;
            let part = (last + 1) as f64 / size[axis] as f64;
            found = found.along(axis, size[axis], |line, k| {
                let at = ((k as f64 + 0.5) * part - 0.5).clamp(0.0, last as f64);
                let (low, share) = (at as usize, at.fract());
                (f64::from(line((low + 1).min(last))) * share + f64::from(line(low)) * (1.0 - share)) as f32
            });
        }
        found
    }

    /// Blurred by three means over squares, nearly a Gaussian; the border goes on beyond the field.
    pub fn blurred(&self, radius: usize) -> Plane {
        let mut found = self.clone();
        for axis in [1, 0, 1, 0, 1, 0] {
            let last = found.size[axis] - 1;
            let mut sum = 0.0;
            found = found.along(axis, last + 1, |line, k| {
                let entry = |k: usize| f64::from(line(k.saturating_sub(radius).min(last)));
                if k == 0 {
                    sum = (0..=2 * radius).map(entry).sum();
                } else {
                    sum += entry(k + 2 * radius) - f64::from(line((k - 1).saturating_sub(radius)));
                }
                (sum / (2 * radius + 1) as f64) as f32
            });
        }
        found
    }

    /// A field of `count` values along an axis: `value` makes each of its line, in their order.
    fn along(
        &self,
        axis: usize,
        count: usize,
        mut value: impl FnMut(&dyn Fn(usize) -> f32, usize) -> f32,
    ) -> Plane {
        let mut size = self.size;
        size[axis] = count;
        let mut values = vec![0.0; size[0] * size[1]];
        for other in 0..size[1 - axis] {
            let index =
                |k: usize, width: usize| if axis == 0 { other * width + k } else { k * width + other };
            let line = |k: usize| self.values[index(k, self.size[0])];
            for k in 0..count {
                values[index(k, size[0])] = value(&line, k);
            }
        }
        Plane { values, size }
    }
}

/// Means over whole blocks of what has a value at each index, so that the longer side has at most `side` values.
pub fn blocks([width, height]: [usize; 2], side: usize, value: impl Fn(usize) -> f32) -> Plane {
    let block = width.max(height).div_ceil(side);
    let [columns, rows] = [width, height].map(|n| block.min(n));
    let size = [width / columns, height / rows];
    let mut values = vec![0.0; size[0] * size[1]];
    for y in 0..size[1] * rows {
        for x in 0..size[0] * columns {
            values[y / rows * size[0] + x / columns] += value(y * width + x);
        }
    }
    values.iter_mut().for_each(|value| *value /= (columns * rows) as f32);
    Plane { values, size }
}

/// A map in another size: means of blocks, then bilinear interpolation.
#[must_use]
pub fn fitted(map: &[u8], from: [usize; 2], to: [usize; 2]) -> Vec<u8> {
    if from == to {
        return map.to_vec();
    }
    Plane::of_map(map, from).smaller(to[0].max(to[1])).fitted(to).to_map()
}

/// The texels at most about so many steps from marked ones: crosses and squares in turn make an octagon.
pub fn grown(mut marked: Vec<bool>, [width, height]: [usize; 2], steps: usize) -> Vec<bool> {
    for step in 0..steps {
        let old = marked.clone();
        for (k, mark) in marked.iter_mut().enumerate().filter(|(_, mark)| !**mark) {
            let (x, y) = (k % width, k / width);
            let [columns, rows] = [(x, width), (y, height)].map(|(x, n)| x.saturating_sub(1)..(x + 2).min(n));
            let is_near = |i: usize, j: usize| step % 2 == 1 || i == x || j == y;
            *mark = rows.into_iter().any(|j| columns.clone().any(|i| is_near(i, j) && old[j * width + i]));
        }
    }
    marked
}
