//! Views of a host's images: maps on the way in, redirection and warp on the way out.

use std::marker::PhantomData;

use half::f16;

use crate::error::{Error, ErrorKind, Result};

/// The number format of one channel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum PixelFormat {
    /// 8-bit, 0..255 for 0..1. Input only.
    U8,
    /// 16-bit, 0..65535 for 0..1. Input only.
    U16,
    /// Half float.
    F16,
    /// Float.
    F32,
}

impl PixelFormat {
    /// Bytes of one channel.
    #[must_use]
    pub fn size(self) -> usize {
        match self {
            PixelFormat::U8 => 1,
            PixelFormat::U16 | PixelFormat::F16 => 2,
            PixelFormat::F32 => 4,
        }
    }
}

/// The end of the tile at which the first row of an image lies.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum Origin {
    /// The first row is v = 1, as in image files.
    #[default]
    Top,
    /// The first row is v = 0.
    Bottom,
}

/// Size and layout of an image in memory.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ImageLayout {
    /// Texels in u.
    pub width: u32,
    /// Texels in v.
    pub height: u32,
    /// Number format of a channel.
    pub format: PixelFormat,
    /// Bytes from one texel to the next; `None` = packed.
    pub pixel_stride: Option<usize>,
    /// Bytes from one row to the next; `None` = packed.
    pub row_stride: Option<usize>,
    /// The end of the tile at which the first row lies.
    pub origin: Origin,
}

impl ImageLayout {
    /// A packed image whose first row is v = 1.
    #[must_use]
    pub fn packed(width: u32, height: u32, format: PixelFormat) -> ImageLayout {
        ImageLayout { width, height, format, pixel_stride: None, row_stride: None, origin: Origin::Top }
    }

    /// Checks the layout for `channels` channels per texel.
    ///
    /// # Errors
    /// `InvalidArgument` naming `name` for a zero size or a stride smaller than what it spans.
    pub(crate) fn resolve(&self, name: &str, channels: usize) -> Result<TexelLayout> {
        self.resolve_within(name, channels, isize::MAX as usize)
    }

    /// The same for an image that must not span more than `most` bytes: its address leaves no more. What is to blame is
    /// named: a stride, if the image would fit without it.
    pub(crate) fn resolve_within(&self, name: &str, channels: usize, most: usize) -> Result<TexelLayout> {
        let &ImageLayout { width, height, format, origin, .. } = self;
        if width == 0 || height == 0 {
            return Err(Error::argument(format!("{name}: the size is {width}x{height}, a side is zero")));
        }
        let most = most.min(isize::MAX as usize);
        let texel = format.size() * channels;
        // `last` steps of `stride` bytes, then `size` bytes.
        let span = |last: u32, stride: usize, size: usize| {
            let bytes = (last as usize).checked_mul(stride).and_then(|n| n.checked_add(size));
            bytes.filter(|&n| n <= most)
        };
        let packed = span(width - 1, texel, texel).and_then(|row| span(height - 1, row, row));
        if packed.is_none() {
            return Err(Error::argument(format!("{name}: {width}x{height} texels are too large")));
        }
        let pixel_stride = self.pixel_stride.unwrap_or(texel);
        if pixel_stride < texel {
            return Err(Error::argument(format!(
                "{name}: pixel_stride is {pixel_stride} bytes, smaller than a texel ({texel} bytes)"
            )));
        }
        let too_far = |stride: &str, bytes: usize, count: u32, what: &str| {
            Error::argument(format!(
                "{name}: {stride} is {bytes} bytes: {count} {what} that far apart exceed the address space"
            ))
        };
        let wide = || too_far("pixel_stride", pixel_stride, width, "texels");
        let row = span(width - 1, pixel_stride, texel).ok_or_else(wide)?;
        // Bytes behind the last texel of a row of its own need not be there.
        let row_stride = self.row_stride.map_or_else(
            || if height == 1 { Ok(row) } else { pixel_stride.checked_mul(width as usize).ok_or_else(wide) },
            Ok,
        )?;
        if row_stride < row {
            return Err(Error::argument(format!(
                "{name}: row_stride is {row_stride} bytes, smaller than a row ({row} bytes)"
            )));
        }
        let bytes = span(height - 1, row_stride, row).ok_or_else(|| match self.row_stride {
            Some(stride) => too_far("row_stride", stride, height, "rows"),
            None => wide(),
        })?;
        Ok(TexelLayout { width, height, format, pixel_stride, row_stride, origin, bytes })
    }
}

/// An [`ImageLayout`] that was checked.
#[derive(Clone, Copy, Debug)]
pub(crate) struct TexelLayout {
    pub width: u32,
    pub height: u32,
    pub format: PixelFormat,
    pub pixel_stride: usize,
    pub row_stride: usize,
    origin: Origin,
    /// Bytes that the image spans.
    pub bytes: usize,
}

impl TexelLayout {
    /// Byte offset of texel `x` in row `y`, rows counted from v = 0 upward.
    pub fn offset(&self, x: usize, y: usize) -> usize {
        self.row(y) * self.row_stride + x * self.pixel_stride
    }

    /// The row in memory of row `y`, counted from v = 0 upward.
    fn row(&self, y: usize) -> usize {
        match self.origin {
            Origin::Bottom => y,
            Origin::Top => self.height as usize - 1 - y,
        }
    }
}

/// A host's single-channel map: rigidity or warp mask. Further channels are skipped by `pixel_stride`.
#[derive(Clone, Copy, Debug)]
pub struct ImageView<'a> {
    bytes: &'a [u8],
    layout: TexelLayout,
}

impl<'a> ImageView<'a> {
    /// A view of `bytes`; `name` is the argument's name, for messages.
    ///
    /// # Errors
    /// `InvalidArgument` for a zero size, a short stride or too few bytes.
    pub fn new(name: &str, bytes: &'a [u8], layout: ImageLayout) -> Result<ImageView<'a>> {
        let layout = layout.resolve(name, 1)?;
        if bytes.len() < layout.bytes {
            let (given, needed) = (bytes.len(), layout.bytes);
            return Err(Error::argument(format!("{name}: {given} bytes given, {needed} needed")));
        }
        Ok(ImageView { bytes, layout })
    }

    /// Copies the image, packed, rows from v = 0 upward. Values must be finite; they are clamped to 0..1.
    pub(crate) fn to_map(self, name: &str) -> Result<Map> {
        let (width, height) = (self.layout.width as usize, self.layout.height as usize);
        let mut values = Vec::new();
        values
            .try_reserve_exact(width * height)
            .map_err(|_| Error::new(ErrorKind::OutOfMemory, format!("{name}: no memory for a copy")))?;
        for y in 0..height {
            for x in 0..width {
                let at = self.layout.offset(x, y);
                let b = &self.bytes[at..];
                let value = match self.layout.format {
                    PixelFormat::U8 => f32::from(b[0]) / 255.0,
                    PixelFormat::U16 => f32::from(u16::from_ne_bytes([b[0], b[1]])) / 65535.0,
                    PixelFormat::F16 => f16::from_ne_bytes([b[0], b[1]]).to_f32(),
                    PixelFormat::F32 => f32::from_ne_bytes([b[0], b[1], b[2], b[3]]),
                };
                if !value.is_finite() {
                    let row = self.layout.row(y);
                    return Err(Error::argument(format!("{name}: texel ({x}, {row}) is {value}")));
                }
                values.push(value.clamp(0.0, 1.0));
            }
        }
        Ok(Map { width, height, values })
    }
}

/// A host's two-channel image to be written: redirection or warp.
#[derive(Debug)]
pub struct ImageViewMut<'a> {
    /// No slice: the bytes that strides skip may be another image's, which is written through a view of its own.
    data: *mut u8,
    pub(crate) layout: TexelLayout,
    lifetime: PhantomData<&'a mut [u8]>,
}

// SAFETY: as `&mut [u8]`, for which it stands.
unsafe impl Send for ImageViewMut<'_> {}
// SAFETY: as above.
unsafe impl Sync for ImageViewMut<'_> {}

impl<'a> ImageViewMut<'a> {
    /// A view of `bytes` with two channels (u, v) per texel, f16 or f32; other bytes of a stride are left alone.
    ///
    /// # Errors
    /// `InvalidArgument` for a zero size, a short stride or too few bytes; `Unsupported` for integer formats.
    pub fn new(name: &str, bytes: &'a mut [u8], layout: ImageLayout) -> Result<ImageViewMut<'a>> {
        // SAFETY: the bytes are borrowed for as long as the view lives, and their number is checked here.
        let view = unsafe { ImageViewMut::from_raw(name, bytes.as_mut_ptr(), layout) }?;
        if bytes.len() < view.layout.bytes {
            let (given, needed) = (bytes.len(), view.layout.bytes);
            return Err(Error::argument(format!("{name}: {given} bytes given, {needed} needed")));
        }
        Ok(view)
    }

    /// A view of the image whose first row begins at `data`.
    ///
    /// # Errors
    /// Those of [`ImageViewMut::new`], but for too few bytes.
    ///
    /// # Safety
    /// While the view is in use, the texels are memory that nothing but this view touches; the bytes between them may be
    /// anyone's.
    pub(crate) unsafe fn from_raw(
        name: &str,
        data: *mut u8,
        layout: ImageLayout,
    ) -> Result<ImageViewMut<'a>> {
        if !matches!(layout.format, PixelFormat::F16 | PixelFormat::F32) {
            return Err(Error::new(
                ErrorKind::Unsupported,
                format!("{name}: format must be f16 or f32 for an output"),
            ));
        }
        let layout = layout.resolve_within(name, 2, usize::MAX - data.addr())?;
        Ok(ImageViewMut { data, layout, lifetime: PhantomData })
    }

    pub(crate) fn as_mut_ptr(&mut self) -> *mut u8 {
        self.data
    }
}

/// A copied map: f32 in 0..1, rows from v = 0 upward.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Map {
    pub width: usize,
    pub height: usize,
    pub values: Vec<f32>,
}

impl Map {
    /// Resamples the map to the (nx + 1) x (ny + 1) nodes of a grid (method §1): its mean over a box of one cell around
    /// the node where it is finer than the grid, bilinear interpolation between texel centres where it is coarser.
    pub fn to_nodes(&self, nx: usize, ny: usize) -> Vec<f32> {
        let columns = taps(self.width, nx);
        let rows = taps(self.height, ny);
        let mut out = Vec::with_capacity((nx + 1) * (ny + 1));
        // Per row of nodes: sums over v first, then over u.
        let mut line = vec![0.0f32; self.width];
        for row in &rows {
            line.fill(0.0);
            for &(y, weight) in row {
                let source = &self.values[y * self.width..(y + 1) * self.width];
                for (sum, value) in line.iter_mut().zip(source) {
                    *sum += weight * value;
                }
            }
            for column in &columns {
                let value: f32 = column.iter().map(|&(x, weight)| weight * line[x]).sum();
                out.push(value.clamp(0.0, 1.0));
            }
        }
        out
    }

    /// Per node, true if the mask has no texel under 0.5 within half a cell. A line one texel wide that must not move
    /// is thus a barrier, however coarse the grid.
    pub fn to_free_nodes(&self, nx: usize, ny: usize) -> Vec<bool> {
        let columns = spans(self.width, nx);
        let rows = spans(self.height, ny);
        let mut out = Vec::with_capacity((nx + 1) * (ny + 1));
        let mut line = vec![true; self.width];
        for row in &rows {
            line.fill(true);
            for y in row.clone() {
                for (free, value) in line.iter_mut().zip(&self.values[y * self.width..]) {
                    *free &= *value >= 0.5;
                }
            }
            out.extend(columns.iter().map(|column| line[column.clone()].iter().all(|&free| free)));
        }
        out
    }
}

/// Per node along one axis, the texels that are averaged, with weights that sum to 1.
fn taps(texels: usize, cells: usize) -> Vec<Vec<(usize, f32)>> {
    let per_cell = texels as f64 / cells as f64;
    let half = 0.5 * per_cell.max(1.0);
    (0..=cells)
        .map(|node| {
            let centre = node as f64 * per_cell;
            let (low, high) = (centre - half, centre + half);
            // A box one texel wide, sampled between texel centres, is the bilinear filter.
            let mut taps: Vec<(usize, f32)> = Vec::new();
            let first = low.floor() as i64;
            let last = high.ceil() as i64;
            for texel in first..last {
                let weight = (high.min(texel as f64 + 1.0) - low.max(texel as f64)).max(0.0) / (high - low);
                if weight > 0.0 {
                    let x = texel.clamp(0, texels as i64 - 1) as usize;
                    taps.push((x, weight as f32));
                }
            }
            taps
        })
        .collect()
}

/// Per node along one axis, the texels that come within half a cell of it.
fn spans(texels: usize, cells: usize) -> Vec<std::ops::Range<usize>> {
    let per_cell = texels as f64 / cells as f64;
    (0..=cells)
        .map(|node| {
            let centre = node as f64 * per_cell;
            let first = (centre - 0.5 * per_cell).floor().max(0.0) as usize;
            let last = (centre + 0.5 * per_cell).ceil() as usize;
            first.min(texels - 1)..last.clamp(1, texels)
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn map(width: usize, height: usize, f: impl Fn(usize, usize) -> f32) -> Map {
        let values = (0..width * height).map(|i| f(i % width, i / width)).collect();
        Map { width, height, values }
    }

    #[test]
    fn nodes_of_a_constant_map_are_that_constant() {
        for (w, h) in [(1, 1), (3, 7), (16, 16), (100, 33)] {
            let nodes = map(w, h, |_, _| 0.75).to_nodes(32, 16);
            assert_eq!(nodes.len(), 33 * 17);
            assert!(nodes.iter().all(|v| (v - 0.75).abs() < 1e-6));
        }
    }

    #[test]
    fn nodes_of_a_ramp_lie_on_the_ramp() {
        // A linear map keeps its values under both filters, away from the clamped edge.
        for w in [8, 16, 64] {
            let nodes = map(w, 4, |x, _| (x as f32 + 0.5) / w as f32).to_nodes(16, 16);
            for (i, node) in nodes.iter().enumerate().take(15).skip(2) {
                assert!((node - i as f32 / 16.0).abs() < 1e-6, "{w}: {node} at {i}");
            }
        }
    }

    #[test]
    fn a_line_of_one_texel_is_a_barrier_on_any_grid() {
        let mask = map(128, 128, |x, _| f32::from(x != 70));
        for n in [16, 32, 128, 256] {
            let free = mask.to_free_nodes(n, n);
            let row = &free[..n + 1];
            assert!(row.iter().any(|f| !f), "{n}");
            assert!(row.iter().filter(|f| !**f).count() <= 3, "{n}");
        }
    }

    #[test]
    fn layouts_are_checked() {
        let bytes = [0u8; 64];
        let packed = ImageLayout::packed(4, 4, PixelFormat::F32);
        assert!(ImageView::new("map", &bytes, packed).is_ok());
        let short = ImageLayout { row_stride: Some(15), ..packed };
        let message = ImageView::new("map", &bytes, short).unwrap_err().message;
        assert!(message.contains("map: row_stride"), "{message}");
        let message = |layout| ImageView::new("map", &bytes, layout).unwrap_err().message;
        // What is beyond memory because of a stride is the stride's fault, not the size's.
        let far = ImageLayout { row_stride: Some(usize::MAX / 2), ..packed };
        assert!(
            message(far).starts_with("map: row_stride is 9223372036854775807 bytes: 4 rows"),
            "{}",
            message(far)
        );
        for row_stride in [None, Some(usize::MAX)] {
            let far = ImageLayout { pixel_stride: Some(usize::MAX / 2), row_stride, ..packed };
            assert!(message(far).starts_with("map: pixel_stride is "), "{}", message(far));
        }
        let large = ImageLayout::packed(u32::MAX, u32::MAX, PixelFormat::F32);
        assert_eq!(message(large), "map: 4294967295x4294967295 texels are too large");
        let empty = ImageLayout { width: 0, ..packed };
        assert!(ImageView::new("map", &bytes, empty).unwrap_err().message.contains("zero"));
        assert!(ImageView::new("map", &bytes[..63], packed).is_err());
    }
}
