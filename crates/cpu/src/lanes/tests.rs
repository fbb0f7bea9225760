//! Every level gives the same bits as plain loops.

use super::*;
use crate::{Memory, Run};
use vrtm_core::allocation::{Vec, vec};
use vrtm_core::fixtures::{Posed, discs, maps};
use vrtm_core::grid::planes::NODES;
use vrtm_core::method::deadline::Deadline;
use vrtm_core::method::plan::{Input, Plan, Purpose};
use vrtm_core::method::progress::Progress;
use vrtm_core::method::schedule;
use vrtm_core::settings::{Quality, SolveOptions, TileSettings};
use vrtm_core::team::Team;

/// Numbers of all kinds.
const SAMPLES: [f32; LANES] = [0.0, -0.0, 1.5, -2.25, 1e-38, -3e38, f32::INFINITY, f32::NAN];

/// All operations on lanes, with their results as bits.
struct Everything;

impl Vectorised for Everything {
    type Output = Vec<u32>;

    #[inline(always)]
    fn run<V: Lanes>(self) -> Vec<u32> {
        let mut bits = Vec::new();
        let mut keep = |v: V| bits.extend(v.to_array().map(f32::to_bits));
        for turn in 0..LANES {
            let mut other = SAMPLES;
            other.rotate_left(turn);
            let (a, b) = (V::from_array(SAMPLES), V::load(&other, 0));
            let bytes: [u8; LANES] = std::array::from_fn(|k| u8::from(k % 3 == 0));
            for v in
                [a + b, a - b, a * b, a / b, a * 0.3, a + 0.1, a.max(b), a.min(b), -a, b.sqrt(), b.floor()]
            {
                // The bit pattern of a NaN is unspecified.
                keep(v.lt(v).select(v, v + V::load_u8(&bytes, 0)));
                keep(V::splat(v.sum()));
            }
            for mask in [a.lt(b), a.le(b), V::Mask::from_bits(0b1010_0110), a.lt(b).and(b.le(a + 1.0))] {
                keep(mask.select(a, b));
                keep(mask.and_not(V::Mask::from_bits(0b0011_1100)).select(V::one(), V::zero()));
                keep(V::splat(f32::from(mask.bits())));
            }
            let (i, j) =
                (V::index_from_array([1, 2, 3, 4, 5, 6, 7, 8]), V::load_index(&[8, 2, 6, 4, 4, 6, 2, 8], 0));
            keep(V::index_eq(i, j).select(a, b));
            let chosen =
                V::index_to_array(V::select_index(V::index_eq(i, j), i, V::index_from_array([9; LANES])));
            keep(V::from_array(chosen.map(|x| x as f32)));
            let codes: [u16; LANES] = [0, 1, 2, 500, 32_767, 32_768, 65_534, 65_535];
            keep(V::load_u16(&codes, 0));
            for lengths in
                [Lengths::between(0.3, 0.3), Lengths::between(0.3, 7.0), Lengths::between(1e-30, 1e30)]
            {
                keep(V::load_lengths(&codes, 0, lengths));
            }
            let words = V::pack_two(a, b);
            V::unpack_two(words).into_iter().for_each(&mut keep);
            keep(V::from_array(V::index_to_array(words).map(|word| (word >> 8) as f32)));
            let records: [[f32; LANES]; LANES] =
                std::array::from_fn(|r| std::array::from_fn(|c| (10 * r + c) as f32));
            for row in V::transpose(records.each_ref()) {
                keep(row);
            }
        }
        bits
    }
}

/// Replaces every NaN by one pattern.
fn canonical(bits: Vec<u32>) -> Vec<u32> {
    bits.into_iter().map(|b| if f32::from_bits(b).is_nan() { f32::NAN.to_bits() } else { b }).collect()
}

#[test]
fn levels_agree() {
    let best = canonical(dispatch(Everything));
    let others =
        forced::LEVELS.iter().map(|&level| canonical(forced::at_most(level, || dispatch(Everything))));
    let plain = canonical(Everything.run::<Portable>());
    assert_eq!(best, plain);
    others.for_each(|other| assert_eq!(other, plain));
    println!("level: {:?}", processor_level());
}

#[test]
fn masks_are_bits() {
    for bits in 0..=u8::MAX {
        assert_eq!(<Portable as Lanes>::Mask::from_bits(bits).bits(), bits);
    }
}

/// A whole solve of a stretched sheet with rigid discs: the bits of the displacements.
fn displacements(quality: Quality) -> Vec<u32> {
    let stretched = |u: f64, v: f64| [u + 0.4 * (u - 0.4).clamp(-0.2, 0.3), v + 0.1 * u * u, 0.0];
    let sheet = Posed::new(4, maps(64, TileSettings::default(), discs), stretched);
    let plan = Plan::new(&SolveOptions { quality, ..SolveOptions::default() });
    let (grid, input) = (&sheet.grid, Input { continuation: plan.continuation, ..sheet.input() });
    let mut memory = Memory::new(grid, Purpose::default());
    let mut u = vec![[[0.0; NODES]; 2]; grid.levels[0].blocks.list.len()];
    Team::with(2, |team| {
        let mut run = Run::new(team, &input, &mut memory, &mut u, &[]);
        let (deadline, mut progress) = (Deadline::unlimited(), Progress::new(None, 1.0));
        schedule::run(&mut run, &input, &plan, false, &deadline, &mut progress);
    });
    let u = u.as_flattened().as_flattened();
    assert!(u.iter().any(|u| u.abs() > 0.5), "something moved");
    u.iter().map(|u| u.to_bits()).collect()
}

#[test]
#[cfg_attr(miri, ignore = "too long; tests/sound runs the same code")]
fn a_solve_has_the_same_bits_at_every_level() {
    for quality in [Quality::Draft, Quality::Normal] {
        let best = displacements(quality);
        for &level in forced::LEVELS {
            let other = forced::at_most(level, || displacements(quality));
            assert!(best == other, "{quality:?}, {level:?}");
        }
    }
}
