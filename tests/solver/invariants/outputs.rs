//! All outputs of a result agree: formats, row orders, strides, corner UVs, and one call or two.

use vrtm::{Asset, Fetch, FetchKind, ImageLayout, ImageViewMut, Origin, PixelFormat, SolveOptions, f16};

use vrtm_testkit::{self, Model, Warp, fetch, floats, raw};

const KINDS: [FetchKind; 3] = [FetchKind::Redirection, FetchKind::RedirectionDelta, FetchKind::Warp];

fn solved(model: &Model) -> Asset {
    model.solved(&vrtm_testkit::cpu(0), 256, 1, &SolveOptions::default())
}

#[test]
fn half_floats_are_the_nearest_to_the_floats() {
    let asset = solved(&Model::from(vrtm_testkit::scenes::mug_to_jug()));
    for kind in KINDS {
        let layout = |format| ImageLayout::packed(256, 256, format);
        let whole = floats(&raw(&asset, 0, kind, layout(PixelFormat::F32), 256 * 256 * 8, 0));
        let halves = raw(&asset, 0, kind, layout(PixelFormat::F16), 256 * 256 * 4, 0);
        let halves = halves.chunks_exact(2).map(|b| f16::from_ne_bytes([b[0], b[1]]).to_f64());
        let mut nonzero = 0;
        for (&value, half) in whole.iter().flatten().zip(halves) {
            // Half a unit in the last place: 11 bits of precision, spacing 2^-24 below 2^-14.
            let exponent = f64::from(value.abs()).log2().floor().max(-14.0);
            let slack = 2f64.powi(exponent as i32 - 11);
            assert!((f64::from(value) - half).abs() <= slack, "{kind:?}: {value} {half}");
            nonzero += usize::from(half != 0.0);
        }
        assert!(nonzero > 1000, "{kind:?}");
    }
}

#[test]
fn the_origin_mirrors_rows() {
    let asset = solved(&Model::from(vrtm_testkit::scenes::mug_to_jug()));
    let (width, height) = (100u32, 63u32);
    let row = width as usize * 8;
    for kind in KINDS {
        let [top, bottom] = [Origin::Top, Origin::Bottom].map(|origin| {
            let layout = ImageLayout { origin, ..ImageLayout::packed(width, height, PixelFormat::F32) };
            raw(&asset, 0, kind, layout, row * height as usize, 0)
        });
        assert!(top != bottom, "{kind:?}");
        assert!(top.chunks_exact(row).rev().eq(bottom.chunks_exact(row)), "{kind:?}");
    }
    // v points up: with the origin at the bottom, it grows with the row.
    let layout = ImageLayout { origin: Origin::Bottom, ..ImageLayout::packed(4, 64, PixelFormat::F32) };
    let rows = floats(&raw(&asset, 0, FetchKind::Redirection, layout, 4 * 64 * 8, 0));
    assert!(rows[0][1] < 0.05 && rows[4 * 63][1] > 0.95);
}

#[test]
fn strides_leave_the_bytes_between_alone() {
    let asset = solved(&Model::from(vrtm_testkit::scenes::mug_to_jug()));
    for (format, size) in [(PixelFormat::F32, 8), (PixelFormat::F16, 4)] {
        for kind in KINDS {
            let (width, height) = (37usize, 41usize);
            let packed = ImageLayout::packed(width as u32, height as u32, format);
            let expected = raw(&asset, 0, kind, packed, width * height * size, 0);
            // Strides that are no multiple of any type's alignment.
            let (pixel, line) = (size + 5, (size + 5) * width + 13);
            let layout = ImageLayout { pixel_stride: Some(pixel), row_stride: Some(line), ..packed };
            for fill in [0x5a, 0xa5] {
                let out = raw(&asset, 0, kind, layout, line * height + 99, fill);
                for (at, &byte) in out.iter().enumerate() {
                    let (y, along) = (at / line, at % line);
                    let (x, within) = (along / pixel, along % pixel);
                    let texel = y < height && x < width && within < size;
                    let wanted = if texel { expected[(y * width + x) * size + within] } else { fill };
                    assert_eq!(byte, wanted, "{kind:?}, {format:?}: byte {at}");
                }
            }
        }
    }
}

#[test]
fn one_call_is_solve_and_fetch() {
    let model = Model::from(vrtm_testkit::scenes::arm());
    let mut two = solved(&model);
    let mut one = model.asset(0, 256);
    let layout = ImageLayout { origin: Origin::Bottom, ..ImageLayout::packed(96, 96, PixelFormat::F32) };
    let mut images = vec![vec![0u8; 96 * 96 * 8]; 6];
    let outputs = [0, 1].into_iter().flat_map(|tile| KINDS.map(|kind| (tile, kind)));
    let mut fetches: Vec<Fetch> = outputs
        .zip(&mut images)
        .map(|((tile, kind), bytes)| Fetch::Image {
            tile,
            kind,
            image: ImageViewMut::new("image", bytes, layout).unwrap(),
        })
        .collect();
    one.redirect(model.frame(1), &SolveOptions::default(), &mut fetches).unwrap();
    drop(fetches);
    for (k, bytes) in images.iter().enumerate() {
        assert_eq!(floats(bytes), fetch(&mut two, k / 3, KINDS[k % 3], [96, 96]), "output {k}");
    }
    // A tile index out of range: nothing is written, nothing is solved.
    let before = images[0].clone();
    let image = ImageViewMut::new("image", &mut images[0], layout).unwrap();
    let mut fetches = [Fetch::Image { tile: 2, kind: FetchKind::Warp, image }];
    assert!(one.redirect(model.frame(2), &SolveOptions::default(), &mut fetches).is_err());
    assert_eq!(images[0], before);
    assert!(vrtm_testkit::bits(&one) == vrtm_testkit::bits(&two));
}

/// One interpolation everywhere: a warp of any size is that of the triangles that redirection and corner UVs invert.
#[test]
fn a_warp_of_any_size_lies_on_the_triangles_that_the_redirection_inverts() {
    let model = Model::from(vrtm_testkit::scenes::analytic::squash(0.4));
    for device in vrtm_testkit::devices() {
        let mut asset = model.solved(&device, 128, 1, &SolveOptions::default());
        let warp = Warp::of(&asset, 0);
        let n = warp.nx as f64;
        let (mut moved, mut unlike_bilinear) = (0, 0.0f64);
        for size in [[257, 257], [385, 200], [97, 513], [64, 1]] {
            let texels = fetch(&mut asset, 0, FetchKind::Warp, size);
            for (k, texel) in texels.iter().enumerate() {
                let at = [k as u32 % size[0], k as u32 / size[0]];
                let p = [0, 1].map(|c| f64::from(at[c]) * n / f64::from(size[c] - 1).max(1.0));
                let expected = warp.at(p);
                for c in 0..2 {
                    // The f64 value rounded to f32 once.
                    let off = f64::from(texel[c]) * n - expected[c];
                    assert!(off.abs() < 1e-7 * n, "{size:?}: texel {at:?} is {off:.1e} cells off");
                }
                moved += usize::from(expected != p);
                // The other diagonal is as far from the bilinear middle as this one, on the other side.
                if p.iter().all(|x| x.fract() == 0.5) {
                    let [i, j] = p.map(|x| x as usize);
                    let corners = [(0, 0), (1, 0), (0, 1), (1, 1)].map(|(x, y)| warp.node(i + x, j + y));
                    for c in 0..2 {
                        let middle = corners.iter().map(|corner| corner[c]).sum::<f64>() / 4.0;
                        unlike_bilinear = unlike_bilinear.max((middle - expected[c]).abs());
                    }
                }
            }
        }
        assert!(moved > 1000 && unlike_bilinear > 0.05, "{moved} moved, {unlike_bilinear} cells");
        // W of the redirection is the texel centre, at a size that has nothing to do with the grid.
        let (width, height) = (301u32, 190u32);
        for (k, uv) in fetch(&mut asset, 0, FetchKind::Redirection, [width, height]).iter().enumerate() {
            let centre = [(k as u32 % width, width), (k as u32 / width, height)]
                .map(|(x, size)| (f64::from(x) + 0.5) / f64::from(size));
            let back = warp.at([0, 1].map(|c| f64::from(uv[c]) * n));
            for (c, size) in [width, height].into_iter().enumerate() {
                let off = (back[c] / n - centre[c]) * f64::from(size);
                assert!(off.abs() < 1e-3, "texel {k} comes back {off:.1e} texels off");
            }
        }
    }
}
