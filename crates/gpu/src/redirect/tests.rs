//! Compares the kernel with the same values in f64, rounded to f32 and f16.

use half::f16;

use super::*;
use crate::context::tests::gpu;
use vrtm_core::backend::Options;

/// The words that the kernel writes for such W⁻¹.
fn written(gpu: &Context, values: &Values, inverse: &[u32]) -> std::vec::Vec<u32> {
    use wgpu::BufferUsages as Usage;
    let [width, height] = values.size;
    let bytes = (width * height) as u64 * texel_bytes(values.format);
    let band = RowBand { rows: 0..height, bytes: 0..bytes, first: 0, step: width as u32 };
    let redirection = Redirection::new(gpu, values, [band].into_iter().collect()).unwrap();
    let inverse = gpu.filled("inverse", bytemuck::cast_slice(inverse), Usage::STORAGE).unwrap();
    let memory = gpu.buffer("memory", bytes, Usage::STORAGE | Usage::COPY_SRC).unwrap();
    let mut encoder = gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
    redirection.record(&mut encoder, 0, &inverse, &memory);
    gpu.submit([encoder]).unwrap();
    bytemuck::pod_collect_to_vec(&gpu.read(&memory, 0..bytes).unwrap())
}

/// Bits of f32 of all magnitudes and both signs, all finite, including values at which rounding changes direction.
fn inputs(count: usize) -> Vec<u32> {
    let mut state = 1u64;
    let mut next = move || {
        state = state.wrapping_mul(0x5851_f42d_4c95_7f2d).wrapping_add(0x1405_7b7e_f767_814f);
        (state >> 32) as u32
    };
    let of = |k: usize| {
        let random = next();
        let exponent = match k % 4 {
            // In turn: any magnitude; typical displacements; as large as the texel's centre; much smaller than it.
            0 => next() % 150,
            1 => 110 + next() % 25,
            2 => 126 + next() % 8,
            _ => 90 + next() % 20,
        };
        let mantissa = match k % 7 {
            0 => 0,
            1 => 1,
            2 => 0x7f_ffff,
            3 => random & 0x7f_f000,
            _ => random & 0x7f_ffff,
        };
        (random & 0x8000_0000) | exponent << 23 | mantissa
    };
    (0..count).map(of).collect()
}

#[test]
fn values_are_those_of_f64_bit_by_bit() {
    let Some(gpu) = gpu(Options::default()) else { return };
    let size = [257, 131];
    let count = size[0] * size[1];
    let input = inputs(2 * count);
    for cells in [[1, 16], [96, 128], [1000, 1008], [16384, 12368], [2048, 4096]] {
        for origin in [None, Some([0, 0]), Some([7, 0]), Some([3, 219])] {
            let found = written(&gpu, &Values { size, cells, origin, format: PixelFormat::F32 }, &input);
            let halves = written(&gpu, &Values { size, cells, origin, format: PixelFormat::F16 }, &input);
            for (k, (&bits, &found)) in input.iter().zip(&found).enumerate() {
                let (axis, texel) = (k % 2, k / 2);
                let at = [texel % size[0], texel / size[0]][axis];
                let delta = f64::from(f32::from_bits(bits)) / cells[axis] as f64;
                let centre = (at as f64 + 0.5) / size[axis] as f64;
                let expected = match origin {
                    None => delta,
                    Some([0, 0]) => centre + delta,
                    Some(origin) => (centre + delta) + f64::from(origin[axis]),
                };
                let expected = expected as f32;
                assert_eq!(
                    found,
                    expected.to_bits(),
                    "{origin:?} {cells:?}: {:e} at {centre}: {:e}, not {expected:e}",
                    f32::from_bits(bits),
                    f32::from_bits(found)
                );
                let half = (halves[texel] >> (16 * axis)) as u16;
                let nearest = f16::from_f32(expected).clamp(f16::MIN, f16::MAX);
                assert_eq!(half, nearest.to_bits(), "{expected:e} in f16");
            }
        }
    }
}
