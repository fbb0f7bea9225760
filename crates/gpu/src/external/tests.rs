//! Compares the kernel `redirect` with the same values in f64, and tests texels in all layouts. The import of a host's
//! memory is tested in `tests/gpu/external.rs`.

use super::*;
use crate::context::tests::gpu;
use vrtm_core::allocation::{Vec, vec};
use vrtm_core::backend::Options;
use vrtm_core::image::external::ExternalHandle;

fn texels(size: [usize; 2], offset: u64, row_stride: u64, is_top_first: bool) -> ExternalTexels {
    let row = size[0] as u64 * TEXEL_BYTES;
    let end = offset + (size[1] as u64 - 1) * row_stride + row;
    let handle = ExternalHandle::OpaqueFd(0);
    let memory_size = end;
    ExternalTexels { handle, memory_size, memory_type: 0, offset, size, row_stride, is_top_first, end }
}

/// A buffer that represents the host's memory.
fn memory(gpu: &Context, bytes: u64) -> wgpu::Buffer {
    use wgpu::BufferUsages as Usage;
    let buffer = gpu.buffer("memory", bytes, Usage::STORAGE | Usage::COPY_SRC | Usage::COPY_DST).unwrap();
    gpu.queue.write_buffer(&buffer, 0, &vec![0xa5; bytes as usize]);
    buffer
}

fn words(gpu: &Context, buffer: &wgpu::Buffer, bytes: u64) -> std::vec::Vec<u32> {
    bytemuck::pod_collect_to_vec(&gpu.read(buffer, 0..bytes).unwrap())
}

/// Bits of f32 of all magnitudes and both signs, all finite, including values at which rounding changes direction.
fn inputs(count: usize) -> Vec<u32> {
    let mut state = 1u64;
    let mut next = move || {
        state = state.wrapping_mul(0x5851_f42d_4c95_7f2d).wrapping_add(0x1405_7b7e_f767_814f);
        (state >> 32) as u32
    };
    let of = |k: usize, random: u32| {
        let exponent = match k % 4 {
            // In turn: any magnitude; typical displacements; as large as the texel's centre; much smaller than it.
            0 => next() % 140,
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
    let mut salt = 7u32;
    (0..count)
        .map(move |k| {
            salt = salt.wrapping_mul(0x2c1b_3c6d).wrapping_add(0x297a_2d39);
            (k, salt ^ (salt >> 13))
        })
        .map({
            let mut of = of;
            move |(k, random)| of(k, random)
        })
        .collect()
}

#[test]
fn values_are_those_of_f64_bit_by_bit() {
    let Some(gpu) = gpu(Options::default()) else { return };
    let size = [257, 131];
    let count = size[0] * size[1];
    let texels = texels(size, 0, 8 * size[0] as u64, false);
    let input = inputs(2 * count);
    for cells in [[1, 16], [96, 128], [1000, 1008], [16384, 12368], [2048, 4096]] {
        for origin in [None, Some([0, 0]), Some([7, 0]), Some([3, 219])] {
            let redirection = Redirection::new(&gpu, cells, origin, &texels, 1 << 27).unwrap();
            let image = redirection.image().unwrap();
            gpu.queue.write_buffer(&image, 0, bytemuck::cast_slice(&input));
            let memory = memory(&gpu, texels.end);
            let mut encoder = gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
            redirection.dispatch(&mut encoder, 0, &image, &memory);
            gpu.submit([encoder]).unwrap();
            let found = words(&gpu, &memory, texels.end);
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
            }
        }
    }
}

/// The identity is written texel by texel, without changing a byte in between. The smallest bindings hold one or two
/// rows each.
#[test]
fn texels_lie_where_the_layout_says() {
    let Some(gpu) = gpu(Options::default()) else { return };
    for size in [[1, 1], [33, 7], [5, 70]] {
        let row = 8 * size[0] as u64;
        for (offset, row_stride) in [(0, row), (8, row), (264, row + 8), (1000, row + 400)] {
            for is_top_first in [false, true] {
                for most in [ALIGNMENT + row, ALIGNMENT + 3 * row, 1 << 27] {
                    let texels = texels(size, offset, row_stride, is_top_first);
                    let origin = Some([0; 2]);
                    let redirection = Redirection::new(&gpu, [16, 16], origin, &texels, most).unwrap();
                    assert!(
                        redirection.bands.iter().all(|band| band.bytes.end - band.bytes.start <= most
                            && band.bytes.start.is_multiple_of(ALIGNMENT)),
                        "{size:?} {offset} {row_stride} {most}"
                    );
                    let (image, memory) = (redirection.image().unwrap(), memory(&gpu, texels.end));
                    gpu.submit([redirection.record(None, &image, &memory).unwrap()]).unwrap();
                    let mut expected = vec![0xa5a5_a5a5u32; texels.end as usize / 4];
                    for y in 0..size[1] {
                        let v = ((y as f64 + 0.5) / size[1] as f64) as f32;
                        let at = if is_top_first { size[1] - 1 - y } else { y };
                        for x in 0..size[0] {
                            let word = (offset as usize + at * row_stride as usize + 8 * x) / 4;
                            let u = ((x as f64 + 0.5) / size[0] as f64) as f32;
                            expected[word..word + 2].copy_from_slice(&[u.to_bits(), v.to_bits()]);
                        }
                    }
                    let found = words(&gpu, &memory, texels.end);
                    assert!(expected == found, "{size:?} {offset} {row_stride} {is_top_first} {most}");
                }
            }
        }
    }
}

#[test]
fn images_that_no_binding_holds_are_refused() {
    for size in [[20, 4], [(1 << 20) + 1, 1], [1, (1 << 20) + 1]] {
        let most = if size[0] == 20 { ALIGNMENT + 159 } else { 1 << 28 };
        let error = bands(&texels(size, 0, 8 * size[0] as u64, true), most).err().unwrap();
        assert_eq!(error.kind, ErrorKind::Unsupported);
        assert!(error.message.starts_with("image: "), "{error}");
    }
}
