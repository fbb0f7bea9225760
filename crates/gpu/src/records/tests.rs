//! Tests the decoding of constants in the shaders, which must give the same bits as the host's decoding.

use crate::context::tests::{computed, gpu};
use crate::kernels::Kernel;
use vrtm_core::allocation::Vec;
use vrtm_core::backend::Options;
use vrtm_core::grid::codes::{Lengths, decode_rigidity, decode_weight};

/// Decodes each 16-bit code as a rigidity, as a weight (its lower 8 bits), and as a length in each coding.
const ENTRY: &str = "
@group(0) @binding(20) var<storage, read> codings: array<vec2u>;
@group(0) @binding(21) var<storage, read_write> decoded: array<u32>;

@compute @workgroup_size(64)
fn decode_all(@builtin(global_invocation_id) id: vec3u) {
    let code = id.x;
    let each = 2u + arrayLength(&codings);
    decoded[code * each] = bitcast<u32>(decode_rigidity(code));
    decoded[code * each + 1u] = bitcast<u32>(decode_weight(code & 0xffu));
    for (var k = 0u; k < arrayLength(&codings); k++) {
        decoded[code * each + 2u + k] = bitcast<u32>(decode_length(code, codings[k].x, codings[k].y));
    }
}
";

const CODES: usize = 1 << 16;

/// Codings of a single length, of common ranges of lengths, and of nearly the whole range of f32.
fn codings() -> [Lengths; 5] {
    [(0.5, 0.5), (0.013, 0.021), (1e-4, 0.7), (1e-30, 1e30), (1e-37, 1e37)]
        .map(|(low, high)| Lengths::between(low, high))
}

#[test]
fn shaders_decode_to_the_host_s_bits() {
    let Some(context) = gpu(Options::default()) else { return };
    let codings = codings();
    let words: Vec<u32> = codings.iter().flat_map(|coding| [coding.base, coding.shift]).collect();
    let each = 2 + codings.len();
    let text = Kernel::SelectCharts.source().text(0) + ENTRY;
    let (input, bytes) = (bytemuck::cast_slice(&words), (CODES * each * 4) as u64);
    let found: std::vec::Vec<u32> = computed(&context, text, "decode_all", input, bytes, CODES / 64);
    for (code, found) in (0..=u16::MAX).zip(found.chunks(each)) {
        assert_eq!(found[0], decode_rigidity(code).to_bits(), "rigidity {code}");
        // 255 is not the code of a weight.
        if code as u8 != 255 {
            assert_eq!(found[1], decode_weight(code as u8).to_bits(), "weight {code}");
        }
        for (coding, &found) in codings.iter().zip(&found[2..]) {
            // Codes greater than that of the longest length may decode to NaN.
            let length = coding.length(code);
            if code == 0 || length.is_normal() {
                assert_eq!(found, length.to_bits(), "length {code} in {coding:?}");
            }
        }
    }
}
