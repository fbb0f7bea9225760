// redirect: the values of a redirection from W⁻¹ at texel centres (method §9), in the format that a host asks for. They
// are bit for bit those of the CPU, which computes them in f64, rounds them to f32, and that to f16 if it is asked for.
// This kernel therefore emulates f64 with integers, which every driver evaluates in the same way.
//
// A workgroup works on 64 texels of a band of texel rows. Reads 8 bytes per texel, and 8 per column and row; writes 8
// per texel in f32, 4 in f16.

@group(0) @binding(10) var<storage, read> redirect_request: RedirectRequest;
/// Texel centres in UV, as the low and the high word of an f64: u of all columns, then v of all rows.
@group(0) @binding(11) var<storage, read> redirect_centres: array<vec2u>;
/// W⁻¹(c) - c in cells, as bits of f32.
@group(0) @binding(12) var<storage, read> inverse: array<vec2u>;
/// The texels: u and v as the bits of two f32, or of two f16 in a word.
@group(0) @binding(13) var<storage, read_write> texels: array<u32>;

/// A number: mantissa 2^(exponent - 63), where the mantissa has 64 bits, the high word first. If an operation loses
/// nonzero bits, the last bit is set, so that later rounding is exact.
struct Wide {
    mantissa: vec2u,
    exponent: i32,
    negative: bool,
}

/// A mantissa divided by 2^n.
fn shifted(mantissa: vec2u, n: u32) -> vec2u {
    let high = mantissa.x;
    let low = mantissa.y;
    if n == 0u {
        return mantissa;
    }
    if n < 32u {
        let lost = low << (32u - n);
        return vec2u(high >> n, (low >> n) | (high << (32u - n)) | u32(lost != 0u));
    }
    if n == 32u {
        return vec2u(0u, high | u32(low != 0u));
    }
    if n < 64u {
        let lost = low | (high << (64u - n));
        return vec2u(0u, (high >> (n - 32u)) | u32(lost != 0u));
    }
    return vec2u(0u, u32((high | low) != 0u));
}

/// The same number with the first bit of its mantissa set, unless it is 0.
fn normalised(a: Wide) -> Wide {
    var r = a;
    if r.mantissa.x == 0u {
        r.mantissa = r.mantissa.yx;
        r.exponent -= 32;
    }
    if r.mantissa.x == 0u {
        return Wide();
    }
    let n = countLeadingZeros(r.mantissa.x);
    if n > 0u {
        r.mantissa = vec2u((r.mantissa.x << n) | (r.mantissa.y >> (32u - n)), r.mantissa.y << n);
        r.exponent -= i32(n);
    }
    return r;
}

/// A normalised number rounded to the 53 bits of f64, to the nearest, ties to even.
fn rounded(a: Wide) -> Wide {
    var r = a;
    let rest = a.mantissa.y & 0x7ffu;
    r.mantissa.y -= rest;
    if rest > 0x400u || (rest == 0x400u && (a.mantissa.y & 0x800u) != 0u) {
        r.mantissa.y += 0x800u;
        if r.mantissa.y == 0u {
            r.mantissa.x += 1u;
            if r.mantissa.x == 0u {
                r.mantissa.x = 0x80000000u;
                r.exponent += 1;
            }
        }
    }
    return r;
}

/// An integer as a number.
fn whole(n: u32) -> Wide {
    return normalised(Wide(vec2u(n, 0u), 31, false));
}

/// A positive f64, given by its low and its high word.
fn from_f64(words: vec2u) -> Wide {
    let exponent = i32((words.y >> 20u) & 0x7ffu) - 1023;
    let high = 0x80000000u | ((words.y & 0xfffffu) << 11u) | (words.x >> 21u);
    return Wide(vec2u(high, words.x << 11u), exponent, false);
}

/// The quotient, rounded as in f64, of a nonzero f32, given by its bits, and an integer 1 <= n < 65536.
fn quotient(bits: u32, n: u32) -> Wide {
    var mantissa = bits & 0x7fffffu;
    var exponent = i32((bits >> 23u) & 0xffu) - 127;
    if exponent == -127 {
        // A subnormal f32 has no implicit leading bit: shift out its leading zeros.
        let lead = countLeadingZeros(mantissa) - 8u;
        mantissa <<= lead;
        exponent = -126 - i32(lead);
    } else {
        mantissa |= 0x800000u;
    }
    // The divisor has 16 bits; the quotient then has 8 or 9 integer bits and a fraction of three digits of 16 bits
    // each.
    let shift = countLeadingZeros(n) - 16u;
    let divisor = n << shift;
    let q = mantissa / divisor;
    var rest = (mantissa % divisor) << 16u;
    let first = rest / divisor;
    rest = (rest % divisor) << 16u;
    let second = rest / divisor;
    rest = (rest % divisor) << 16u;
    let third = rest / divisor;
    let lost = u32(rest % divisor != 0u);
    let quotient = vec2u((q << 16u) | first, (second << 16u) | third | lost);
    return rounded(normalised(Wide(quotient, exponent + i32(shift) - 8, (bits >> 31u) != 0u)));
}

/// True if a has the smaller magnitude; both are normalised.
fn is_smaller(a: Wide, b: Wide) -> bool {
    if a.exponent != b.exponent {
        return a.exponent < b.exponent;
    }
    if a.mantissa.x != b.mantissa.x {
        return a.mantissa.x < b.mantissa.x;
    }
    return a.mantissa.y < b.mantissa.y;
}

/// The sum, rounded as in f64.
fn sum(a: Wide, b: Wide) -> Wide {
    if a.mantissa.x == 0u {
        return b;
    }
    if b.mantissa.x == 0u {
        return a;
    }
    var large = a;
    var small = b;
    if is_smaller(a, b) {
        large = b;
        small = a;
    }
    // Leave one bit for the carry. Mantissas of f64 end in eleven zeros: their difference loses none of its 53 bits.
    let x = shifted(large.mantissa, 1u);
    let y = shifted(small.mantissa, u32(large.exponent - small.exponent) + 1u);
    var r = Wide(vec2u(), large.exponent + 1, large.negative);
    if large.negative == small.negative {
        let low = x.y + y.y;
        r.mantissa = vec2u(x.x + y.x + u32(low < x.y), low);
    } else {
        r.mantissa = vec2u(x.x - y.x - u32(x.y < y.y), x.y - y.y);
    }
    return rounded(normalised(r));
}

/// The bits of the nearest f32, ties to even.
fn to_f32(a: Wide) -> u32 {
    if a.mantissa.x == 0u {
        return 0u;
    }
    let biased = max(a.exponent + 127, 1);
    let mantissa = shifted(a.mantissa, u32(biased - a.exponent - 127));
    let rest = mantissa.x & 0xffu;
    let top = mantissa.x >> 8u;
    let beyond = rest > 0x80u || (rest == 0x80u && (mantissa.y != 0u || (top & 1u) != 0u));
    // A carry out of the mantissa goes into the exponent, as does the bit that f32 does not store.
    return (u32(a.negative) << 31u) | ((u32(biased - 1) << 23u) + top + u32(beyond));
}

/// The bits of the nearest finite f16, ties to even, of an f32.
fn to_f16(bits: u32) -> u32 {
    let size = min(bits & 0x7fffffffu, 0x477fe000u);
    let exponent = size >> 23u;
    var half: u32;
    if exponent >= 113u {
        half = (size - 0x38000000u + 0xfffu + ((size >> 13u) & 1u)) >> 13u;
    } else {
        // A subnormal f16 counts steps of 2^-24. From 25 places on nothing is left of the 24 bits of an f32.
        let mantissa = (size & 0x7fffffu) | 0x800000u;
        let places = min(126u - exponent, 25u);
        half = (mantissa + (1u << (places - 1u)) - 1u + ((mantissa >> places) & 1u)) >> places;
    }
    return ((bits >> 16u) & 0x8000u) | half;
}

/// A redirection's value along one axis.
fn value(bits: u32, centre: vec2u, axis: u32) -> u32 {
    let still = (bits & 0x7fffffffu) == 0u;
    let cells = redirect_request.cells[axis];
    if redirect_request.is_delta != 0u {
        if still {
            return bits;
        }
        return to_f32(quotient(bits, cells));
    }
    var at = from_f64(centre);
    if !still {
        at = sum(at, quotient(bits, cells));
    }
    return to_f32(sum(at, whole(redirect_request.origin[axis])));
}

@compute @workgroup_size(64)
fn redirect(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) t: u32) {
    let i = (group.y * SPREAD + group.x) * 64u + t;
    let width = redirect_request.width;
    let x = i % width;
    let row = i / width;
    if row >= redirect_request.rows {
        return;
    }
    let bits = inverse[i];
    let u = value(bits.x, redirect_centres[x], 0u);
    let v = value(bits.y, redirect_centres[width + redirect_request.row + row], 1u);
    let at = redirect_request.first + row * redirect_request.step + x;
    if redirect_request.is_half != 0u {
        texels[at] = to_f16(u) | (to_f16(v) << 16u);
    } else {
        texels[2u * at] = u;
        texels[2u * at + 1u] = v;
    }
}
