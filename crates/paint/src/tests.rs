use crate::{Picture, cover, fitted, of_brightness, of_colour, of_detail, otsu};

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
