use vrtm_core::grid::node_set::*;

#[test]
fn windows_hold_the_neighbours_nodes() {
    let mut seed = 1u32;
    let mut random = || {
        seed = seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (seed >> 16) as u16 | (seed >> 8) as u16
    };
    let sets: [NodeSet; 9] = std::array::from_fn(|_| NodeSet(std::array::from_fn(|_| random())));
    let window = NodeWindow::new(|k| sets[k]);
    let at = |i: i64, j: i64| {
        let k = (j.div_euclid(16) + 1) * 3 + i.div_euclid(16) + 1;
        sets[k as usize].contains(i.rem_euclid(16) as usize, j.rem_euclid(16) as usize)
    };
    for j in -1..=16 {
        for i in -1..=16 {
            assert_eq!(window.contains((i + 1) as usize, (j + 1) as usize), at(i, j), "{i} {j}");
        }
    }
    for j in 0..16 {
        for i in 0..16 {
            let around = || (-1..=1).flat_map(|dj| (-1..=1).map(move |di| at(i + di, j + dj)));
            let (i, j) = (i as usize, j as usize);
            assert_eq!(window.eroded().contains(i, j), around().all(|x| x));
            assert_eq!(window.dilated().contains(i, j), around().any(|x| x));
        }
    }
    assert_eq!(sets[4].count(), (0..256).filter(|n| sets[4].contains(n % 16, n / 16)).count() as u64);
}
