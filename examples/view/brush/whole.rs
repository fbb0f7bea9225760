//! Tools that change all of a map: grow, shrink, invert.

use super::canvas::Canvas;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Tool {
    Grow,
    Shrink,
    Invert,
}

/// Texels of a map's side for each texel that features grow by.
const PER_TEXEL: u32 = 400;

/// The map after a tool was used; `charts` has the chart of each texel, which does not grow into others.
pub fn used(tool: Tool, canvas: &Canvas, charts: &[Option<u32>]) -> Vec<u16> {
    let best = match tool {
        Tool::Invert => return canvas.texels.iter().map(|&texel| 65535 - texel).collect(),
        Tool::Grow => u16::max,
        Tool::Shrink => u16::min,
    };
    let mut texels = canvas.texels.clone();
    let [width, height] = canvas.size.map(|side| side as usize);
    for round in 0..canvas.size[0].max(canvas.size[1]).div_ceil(PER_TEXEL) {
        let old = texels.clone();
        // Squares and crosses in turn make octagons, which are nearly round.
        let cross = [(0, 1), (1, 0), (1, 2), (2, 1)];
        let corners = [(0, 0), (0, 2), (2, 0), (2, 2)];
        let near: Vec<_> = if round % 2 == 0 { [cross, corners].concat() } else { cross.to_vec() };
        for (k, texel) in texels.iter_mut().enumerate().filter(|(k, _)| charts[*k].is_some()) {
            let (x, y) = (k % width, k / width);
            for &(dx, dy) in &near {
                let (nx, ny) = (x + dx, y + dy);
                // From one texel to the left and above.
                if nx == 0 || ny == 0 || nx > width || ny > height {
                    continue;
                }
                let other = (ny - 1) * width + nx - 1;
                if charts[other] == charts[k] {
                    *texel = best(*texel, old[other]);
                }
            }
        }
    }
    texels
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A map of two charts, left and right of column 6, with one rigid texel at [5, 5].
    fn canvas() -> (Canvas, Vec<Option<u32>>) {
        let mut texels = vec![0; 144];
        texels[5 * 12 + 5] = 65535;
        let charts = (0..144).map(|k| if k / 12 == 11 { None } else { Some(u32::from(k % 12 > 5)) });
        (Canvas { size: [12, 12], texels, deep: false }, charts.collect())
    }

    #[test]
    fn features_grow_within_their_chart_and_shrink_again() {
        let (mut canvas, charts) = canvas();
        canvas.texels = used(Tool::Grow, &canvas, &charts);
        let rigid: Vec<usize> = (0..144).filter(|&k| canvas.texels[k] > 0).collect();
        let expected: Vec<usize> = [4, 5, 6].into_iter().flat_map(|y| [4, 5].map(|x| 12 * y + x)).collect();
        assert_eq!(rigid, expected, "the chart ends at column 6");
        canvas.texels = used(Tool::Shrink, &canvas, &charts);
        assert_eq!((0..144).filter(|&k| canvas.texels[k] > 0).collect::<Vec<_>>(), [5 * 12 + 5]);
        canvas.texels = used(Tool::Invert, &canvas, &charts);
        assert_eq!(canvas.texels.iter().filter(|&&t| t == 0).count(), 1);
    }
}
