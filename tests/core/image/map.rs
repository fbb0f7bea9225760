use super::map_of;
use vrtm_core::allocation::Vec;
use vrtm_core::allocation::vec;
use vrtm_core::image::format::PixelFormat;
use vrtm_core::image::map::*;

fn free_nodes(mask: &Map, cells: [usize; 2], first: [usize; 2], count: [usize; 2]) -> Vec<bool> {
    let mut free = vec![false; count[0] * count[1]];
    vrtm_core::image::map::free_nodes(mask, cells, first, count, |i, j| free[j * count[0] + i] = true);
    free
}

#[test]
fn a_part_of_the_nodes_is_free_as_in_the_whole() {
    let rough = map_of(150, 90, |x, y| (x * 37 + y * 101) as f32 % 17.0 / 16.0);
    for cells in [[16, 32], [160, 96], [320, 80]] {
        let free = free_nodes(&rough, cells, [0, 0], cells.map(|n| n + 1));
        let (first, count) = ([5, 7], [cells[0] - 5, 9]);
        let free_part = free_nodes(&rough, cells, first, count);
        for n in 0..free_part.len() {
            let whole = (first[1] + n / count[0]) * (cells[0] + 1) + first[0] + n % count[0];
            assert_eq!(free_part[n], free[whole], "{cells:?} {n}");
        }
    }
}

#[test]
fn a_line_of_one_texel_is_a_barrier_on_any_grid() {
    let mask = map_of(128, 128, |x, _| f32::from(x != 70));
    for n in [16, 32, 128, 256] {
        let free = free_nodes(&mask, [n, n], [0, 0], [n + 1, n + 1]);
        let row = &free[..n + 1];
        assert!(row.iter().any(|f| !f), "{n}");
        assert!(row.iter().filter(|f| !**f).count() <= 3, "{n}");
    }
}

#[test]
fn pages_that_nobody_wants_are_not_stored() {
    let whole = Map::new([200, 100], PixelFormat::U8, |_| true);
    assert_eq!(whole.stored().count(), 8);
    let wanted = |rect: &TexelRect| rect.first == [64, 0];
    let mut map = Map::new([200, 100], PixelFormat::U8, wanted);
    for (x, y) in [(64, 0), (127, 63), (128, 0), (10, 99)] {
        map.put_row(x, y, &[255]);
    }
    assert_eq!(
        [map.value(64, 0), map.value(127, 63), map.value(128, 0), map.value(10, 99)],
        [1., 1., 0., 0.]
    );
    assert!(map.bytes() < whole.bytes() / 6);
}
