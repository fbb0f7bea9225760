//! Texels in all layouts. The import of a host's memory is tested in `crates/gpu/tests/gpu/external.rs`.

use half::f16;

use super::*;
use crate::context::tests::gpu;
use vrtm_core::allocation::vec;
use vrtm_core::backend::Options;
use vrtm_core::image::Origin;
use vrtm_core::image::external::{ExternalHandle, ExternalImage};
use vrtm_core::image::format::PixelFormat::{self, F16, F32};

fn texels(
    size: [usize; 2],
    format: PixelFormat,
    offset: u64,
    row_stride: u64,
    is_top_first: bool,
) -> ExternalTexels {
    let origin = if is_top_first { Origin::Top } else { Origin::Bottom };
    let ([width, height], row_stride) = (size.map(|n| n as u32), Some(row_stride));
    let (handle, memory_size, memory_type) = (ExternalHandle::OpaqueFd(0), u64::MAX, 0);
    ExternalImage { handle, memory_size, memory_type, offset, width, height, format, row_stride, origin }
        .check("image")
        .unwrap()
}

/// A buffer that represents the host's memory.
fn memory(gpu: &Context, bytes: u64) -> wgpu::Buffer {
    use wgpu::BufferUsages as Usage;
    let buffer = gpu.buffer("memory", bytes, Usage::STORAGE | Usage::COPY_SRC | Usage::COPY_DST).unwrap();
    gpu.queue.write_buffer(&buffer, 0, &vec![0xa5; bytes as usize]);
    buffer
}

/// The identity is written texel by texel, without changing a byte in between. The smallest bindings hold one or two
/// rows each.
#[test]
fn texels_lie_where_the_layout_says() {
    let Some(gpu) = gpu(Options::default()) else { return };
    for (size, format) in [[1, 1], [33, 7], [5, 70]].into_iter().flat_map(|size| [(size, F32), (size, F16)]) {
        let texel = texel_bytes(format);
        let row = texel * size[0] as u64;
        for (offset, row_stride) in [(0, row), (texel, row), (264, row + texel), (1000, row + 400)] {
            for is_top_first in [false, true] {
                let wide = INVERSE_BYTES * size[0] as u64;
                for most in [ALIGNMENT + wide, ALIGNMENT + 3 * wide, 1 << 27] {
                    let texels = texels(size, format, offset, row_stride, is_top_first);
                    let bands = bands(&texels, most).unwrap();
                    assert!(
                        bands.iter().all(|band| band.bytes.end - band.bytes.start <= most
                            && band.bytes.start.is_multiple_of(ALIGNMENT)),
                        "{size:?} {offset} {row_stride} {most}"
                    );
                    let values = Values { size, cells: [16, 16], origin: Some([0; 2]), format };
                    let redirection = Redirection::new(&gpu, &values, bands).unwrap();
                    let inverse = inverse_buffer(&gpu, &redirection).unwrap();
                    let memory = memory(&gpu, texels.end);
                    gpu.submit([record(&gpu, &redirection, None, &inverse, &memory).unwrap()]).unwrap();
                    let mut expected = vec![0xa5u8; texels.end as usize];
                    for y in 0..size[1] {
                        let v = ((y as f64 + 0.5) / size[1] as f64) as f32;
                        let at = if is_top_first { size[1] - 1 - y } else { y };
                        for x in 0..size[0] {
                            let u = ((x as f64 + 0.5) / size[0] as f64) as f32;
                            let bytes = match format {
                                F16 => [u, v].map(|x| f16::from_f32(x).to_le_bytes()).concat(),
                                _ => [u, v].map(f32::to_le_bytes).concat(),
                            };
                            let first = offset as usize + at * row_stride as usize + bytes.len() * x;
                            expected[first..first + bytes.len()].copy_from_slice(&bytes);
                        }
                    }
                    let found = gpu.read(&memory, 0..texels.end).unwrap();
                    assert!(
                        expected == found,
                        "{size:?} {format:?} {offset} {row_stride} {is_top_first} {most}"
                    );
                }
            }
        }
    }
}

#[test]
fn images_that_no_binding_holds_are_refused() {
    for size in [[20, 4], [(1 << 20) + 1, 1], [1, (1 << 20) + 1]] {
        let most = if size[0] == 20 { ALIGNMENT + 159 } else { 1 << 28 };
        let error = bands(&texels(size, F32, 0, 8 * size[0] as u64, true), most).err().unwrap();
        assert_eq!(error.kind, ErrorKind::Unsupported);
        assert!(error.message.starts_with("image: "), "{error}");
    }
}
