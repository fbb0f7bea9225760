//! Every level gives the same bits as plain loops.

use super::*;

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
            let words = V::pack_bfloat16(a, b);
            let (high, low) = V::unpack_bfloat16(words);
            keep(high);
            keep(low);
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

/// A whole solve: three squares in a row, of which the outer ones are stretched, with a rigid patch in each.
fn displacements(quality: crate::Quality) -> Vec<[u32; 2]> {
    use crate::{
        Asset, Device, DeviceSettings, ImageLayout, ImageView, MeshSource, PixelFormat, SolveOptions,
        Strided, UvSource,
    };
    let rest: Vec<[f32; 3]> =
        (0..8).map(|k| [(k % 4) as f32, (k / 4) as f32, (k % 3) as f32 * 0.1]).collect();
    let uvs: Vec<[f32; 2]> = rest.iter().map(|[x, y, _]| [x / 3.0, *y]).collect();
    let corners = [0, 1, 5, 4, 1, 2, 6, 5, 2, 3, 7, 6];
    let settings = DeviceSettings {
        backend: crate::Backend::Cpu,
        threads: std::num::NonZeroU32::new(2),
        ..DeviceSettings::default()
    };
    let mut asset = Asset::new(
        &Device::new(&settings).unwrap(),
        &MeshSource {
            positions: Strided::from_f32x3(&rest),
            face_counts: Some(&[4, 4, 4]),
            indices: &corners,
            uvs: UvSource { u: Strided::from_f32x2(&uvs), v: None, indices: Some(&corners) },
            ..MeshSource::default()
        },
    )
    .unwrap();
    let painted: Vec<u8> =
        (0..64 * 64).map(|i| if i % 64 % 20 > 8 && i / 64 % 24 > 10 { 255 } else { 0 }).collect();
    let image = ImageView::new("rigidity", &painted, ImageLayout::packed(64, 64, PixelFormat::U8)).unwrap();
    let tile = asset.find_tile(1001).unwrap();
    asset.set_rigidity(tile, Some(image)).unwrap();
    let mut pose = rest;
    pose.iter_mut().for_each(|p| p[0] += 0.35 * (p[0] - 1.5).clamp(-0.7, 0.9));
    let options = SolveOptions { quality, ..SolveOptions::default() };
    asset.solve(Strided::from_f32x3(&pose), &options).unwrap();
    assert!(asset.tile_report(tile).unwrap().max_displacement > 0.5, "something moved");
    asset.displacements(tile).unwrap().into_iter().map(|u| u.map(f32::to_bits)).collect()
}

#[test]
#[cfg_attr(miri, ignore = "too long; tests/sound runs the same code")]
fn a_solve_has_the_same_bits_at_every_level() {
    for quality in [crate::Quality::Draft, crate::Quality::Normal, crate::Quality::High] {
        let best = displacements(quality);
        for &level in forced::LEVELS {
            let other = forced::at_most(level, || displacements(quality));
            assert!(best == other, "{quality:?}, {level:?}");
        }
    }
}
