use crate::{Picture, Surface, cover, fitted, mixed, of_brightness, of_colour, of_detail, otsu};

/// The picture of `test_rigidity.py`, whose bytes `value` makes of noise and the column.
fn picture([width, height]: [usize; 2], value: impl Fn(usize, usize) -> usize) -> Vec<u8> {
    let byte = |k: usize| {
        let (x, y, channel) = (k / 4 % width, k / 4 / width, k % 4);
        value((3 * x * x + 5 * x * y + 7 * y * y + 11 * channel) % 23, x) as u8
    };
    (0..4 * width * height).map(byte).collect()
}

/// Rounding may differ by one step of 255.
#[test]
fn maps_are_those_of_the_python_package() {
    let [size, wide_size] = [[12, 9], [2100, 6]];
    let small = picture(size, |noise, _| 15 + 10 * noise);
    let wide = picture(wide_size, |noise, x| 100 + noise * x / 1000);
    let [small, wide] =
        [(&small, size), (&wide, wide_size)].map(|(rgba, size)| Picture::new(rgba, size).unwrap());
    let features: Vec<u8> = (0..2100 * 6).map(|k| if k % 2100 / 50 == 30 { 255 } else { 0 }).collect();
    let some = |map: Vec<u8>| -> Vec<u8> {
        map.chunks(2100).step_by(2).flat_map(|row| row.iter().step_by(50)).copied().collect()
    };
    for line in include_str!("agreed.txt").lines() {
        let (name, digits) = line.split_once(' ').unwrap();
        let expected: Vec<u8> = (0..digits.len() / 2)
            .map(|k| u8::from_str_radix(&digits[2 * k..2 * k + 2], 16).unwrap())
            .collect();
        let found = match name {
            "brightness" => of_brightness(small, otsu(&[small])),
            "colour" => of_colour(small, [0.5, 0.3, 0.6], 0.4),
            "fitted" => fitted(&of_brightness(small, 0.5), size, [7, 5]),
            "detail" => some(of_detail(wide, None, 0.3)),
            _ => some(of_detail(wide, Some((&features, wide_size)), 1.0)),
        };
        assert_eq!(found.len(), expected.len(), "{name}");
        let differ = found.iter().zip(&expected).map(|(a, b)| a.abs_diff(*b)).max();
        assert!(differ <= Some(1), "{name} differs by {differ:?}\n{found:?}\n{expected:?}");
    }
}

#[test]
fn one_threshold_holds_for_all_pictures() {
    let dark = picture([8, 8], |noise, _| noise);
    let both = picture([8, 8], |noise, x| if x < 4 { 200 + noise } else { noise });
    let [dark, both] = [&dark, &both].map(|rgba| Picture::new(rgba, [8, 8]).unwrap());
    let threshold = otsu(&[dark, both]);
    assert!(of_brightness(dark, threshold).iter().all(|&value| value == 0));
    assert_eq!(of_brightness(both, threshold)[..8], [255, 255, 255, 191, 64, 0, 0, 0]);
    let grey = Picture::new(&[77; 16], [2, 2]).unwrap();
    assert!(of_brightness(grey, otsu(&[grey])).iter().all(|&value| value == 0));
}

#[test]
fn without_features_nothing_is_held_and_bytes_have_a_size() {
    let rgba = picture([8, 8], |noise, _| 10 * noise);
    let drawn = Picture::new(&rgba, [8, 8]).unwrap();
    assert!(of_detail(drawn, None, 0.2).contains(&51));
    assert_eq!(of_detail(drawn, Some((&[127; 6], [3, 2])), 0.3), [0; 6]);
    assert!(Picture::new(&rgba, [8, 7]).is_none() && Picture::new(&[], [0, 4]).is_none());
    assert!(Picture::new(&rgba[1..], [8, 8]).is_none());
}

#[test]
fn a_brush_fades_out_over_its_soft_part() {
    assert_eq!([0.0, 0.49, 0.75, 1.0, 2.0].map(|distance| cover(distance, 0.5)), [1.0, 1.0, 0.5, 0.0, 0.0]);
    assert_eq!([0.99, 1.01].map(|distance| cover(distance, 0.0)), [1.0, 0.0]);
}

/// Two sheets of squares from 0 to 1, the second closely over the first. Two charts are half as wide each, with a gap
/// of 0.2 between them.
struct Sheets {
    positions: Vec<[f32; 3]>,
    surface: Surface,
}

const SIDE: u32 = 8;
const SIZE: [usize; 2] = [80, 64];

impl Sheets {
    fn new() -> Sheets {
        let (mut positions, mut vertices, mut uvs) = (Vec::new(), Vec::new(), Vec::new());
        let part = |k: u32| k as f32 / SIDE as f32;
        for sheet in 0..2 {
            let vertex = |x, y| (sheet * (SIDE + 1) + y) * (SIDE + 1) + x;
            for (x, y) in (0..=SIDE).flat_map(|y| (0..=SIDE).map(move |x| (x, y))) {
                positions.push([part(x), part(y), 1e-4 * sheet as f32]);
                if x < SIDE && y < SIDE {
                    let gap = if x < SIDE / 2 { 0.0 } else { 0.2 };
                    let corner = |(i, j): (u32, u32)| (vertex(i, j), [0.8 * part(i) + gap, part(j)]);
                    let corners = [(x, y), (x + 1, y), (x + 1, y + 1), (x, y + 1)].map(corner);
                    for k in [[0, 1, 2], [0, 2, 3]] {
                        vertices.push(k.map(|k| corners[k].0));
                        uvs.push(k.map(|k| corners[k].1));
                    }
                }
            }
        }
        let surface = Surface::new(vertices, uvs, positions.len());
        Sheets { positions, surface }
    }

    /// The distance at each texel under a brush of this radius at (0.5, 0.5); over 1 beyond it.
    fn dabbed(&self, radius: f32, grid: [usize; 2], delta: [f32; 2]) -> Vec<f32> {
        let ball = ([0.5, 0.5, 0.0], radius);
        // A triangle with a corner there.
        let first = (SIDE * SIDE + SIDE) as usize;
        let under = self.surface.disc(&self.positions, first, ball);
        assert!(under.iter().all(|&k| k < self.surface.triangles() / 2), "the other sheet");
        let mut all = vec![9.0f32; SIZE[0] * SIZE[1]];
        for k in under {
            self.surface.fill((k, &self.positions), ball, SIZE, (grid, |_, _| delta), |texel, away| {
                all[texel] = all[texel].min(away);
            });
        }
        all
    }
}

#[test]
fn a_ray_hits_the_sheet_that_comes_first() {
    let Sheets { positions, surface } = Sheets::new();
    for (height, sheet) in [(1.0, 1), (-1.0, 0)] {
        let (at, w) = surface.hit(&positions, ([0.3, 0.65, height], [0.0, 0.05, -height])).unwrap();
        assert_eq!(at / (surface.triangles() / 2), sheet);
        let place = mixed(surface.corners(at, &positions), w);
        assert!((place[0] - 0.3).abs() < 1e-6 && (place[1] - 0.7).abs() < 1e-4, "{place:?}");
        assert_eq!(surface.hit(&positions, ([0.3, 0.65, height], [0.0, 0.0, height])), None);
    }
}

#[test]
fn a_dab_is_round_on_the_surface_across_seams_and_through_a_redirection() {
    let (sheets, radius) = (Sheets::new(), 0.2);
    for (grid, shift) in [(SIZE, 0), ([32, 32], 0), ([40, 48], 10)] {
        let all = sheets.dabbed(radius, grid, [0.0, shift as f32 / SIZE[1] as f32]);
        let mut margin = 0;
        for (k, away) in all.iter().enumerate() {
            let u = ((k % 80) as f32 + 0.5) / 80.0;
            // Up on the map where the redirection looks farther up.
            let v = 1.0 - ((k / 80) as f32 + 0.5 + shift as f32) / 64.0;
            let x = if u < 0.5 { (u / 0.8).min(0.5) } else { ((u - 0.2) / 0.8).max(0.5) };
            let expected = (x - 0.5).hypot(v - 0.5) / radius;
            if (0.4..0.6).contains(&u) {
                margin += usize::from(*away < 1.0);
            } else if expected < 0.99 || *away < 1.0 {
                assert!((away - expected).abs() < 0.02, "{k} {grid:?}: {away}, not {expected}");
            }
        }
        // Two texels beside both charts, over nearly the diameter: the redirection's grid is coarser than the map.
        assert!((80..=104).contains(&margin), "{margin}");
    }
}
