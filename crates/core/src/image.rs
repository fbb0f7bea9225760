//! Views of a host's images: maps as input, redirection and warp as output.

pub mod external;
pub mod format;
pub mod map;
pub mod resample;
pub mod texels;

use std::marker::PhantomData;

use crate::allocation::Vec;
use crate::error::{Error, ErrorKind, Result, ensure};
use format::{PixelFormat, decode};
use map::{Map, TexelRect};

/// Side of the tile at which the first row of an image lies.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum Origin {
    /// The first row is at v = 1, as in image files.
    #[default]
    Top,
    /// The first row is at v = 0, as in OpenGL textures.
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
    /// Channels to write per texel of an output, 1 to 4; `None` = two. Inputs have one.
    pub channels: Option<u32>,
}

impl ImageLayout {
    /// A packed image whose first row is v = 1; as an output it has two channels.
    #[must_use]
    pub fn packed(width: u32, height: u32, format: PixelFormat) -> ImageLayout {
        ImageLayout {
            width,
            height,
            format,
            pixel_stride: None,
            row_stride: None,
            origin: Origin::Top,
            channels: None,
        }
    }

    /// The same layout for an output with this number of channels.
    #[must_use]
    pub fn with_channels(self, channels: u32) -> ImageLayout {
        ImageLayout { channels: Some(channels), ..self }
    }

    /// Checks the layout for `channels` channels per texel.
    #[doc(hidden)]
    pub fn resolve(&self, name: &str, channels: u32) -> Result<TexelLayout> {
        self.resolve_within(name, channels, isize::MAX as usize)
    }

    /// Checks the layout of an output at `data`, with its own number of channels.
    #[doc(hidden)]
    pub fn resolve_output(&self, name: &str, data: *const u8) -> Result<TexelLayout> {
        let channels = self.channels.unwrap_or(2);
        ensure!((1..=4).contains(&channels), "{name}: channels is {channels}, not 1 to 4");
        self.resolve_within(name, channels, usize::MAX - data.addr())
    }

    /// Checks the layout of an image that may span at most `most` bytes, the limit set by its address. The error blames
    /// a stride if the image would fit without it.
    #[doc(hidden)]
    pub fn resolve_within(&self, name: &str, channels: u32, most: usize) -> Result<TexelLayout> {
        let &ImageLayout { width, height, format, origin, .. } = self;
        ensure!(width > 0 && height > 0, "{name}: the size is {width}x{height}, a side is zero");
        let most = most.min(isize::MAX as usize);
        let texel = format.size() * channels as usize;
        // `last` steps of `stride` bytes, then `size` bytes.
        let span = |last: u32, stride: usize, size: usize| {
            let bytes = (last as usize).checked_mul(stride).and_then(|n| n.checked_add(size));
            bytes.filter(|&n| n <= most)
        };
        let packed = span(width - 1, texel, texel).and_then(|row| span(height - 1, row, row));
        ensure!(packed.is_some(), "{name}: {width}x{height} texels are too large");
        let pixel_stride = self.pixel_stride.unwrap_or(texel);
        ensure!(
            pixel_stride >= texel,
            "{name}: pixel_stride is {pixel_stride} bytes, smaller than a texel ({texel} bytes)"
        );
        let too_far = |stride: &str, bytes: usize, count: u32, what: &str| {
            Error::argument(format!(
                "{name}: {stride} is {bytes} bytes: {count} {what} that far apart exceed the address space"
            ))
        };
        let wide = || too_far("pixel_stride", pixel_stride, width, "texels");
        let row = span(width - 1, pixel_stride, texel).ok_or_else(wide)?;
        // The bytes after the last texel of a row need not exist.
        let row_stride = self.row_stride.map_or_else(
            || if height == 1 { Ok(row) } else { pixel_stride.checked_mul(width as usize).ok_or_else(wide) },
            Ok,
        )?;
        ensure!(
            row_stride >= row,
            "{name}: row_stride is {row_stride} bytes, smaller than a row ({row} bytes)"
        );
        let bytes = span(height - 1, row_stride, row).ok_or_else(|| match self.row_stride {
            Some(stride) => too_far("row_stride", stride, height, "rows"),
            None => wide(),
        })?;
        Ok(TexelLayout { width, height, format, channels, pixel_stride, row_stride, origin, bytes })
    }
}

/// A checked [`ImageLayout`].
#[derive(Clone, Copy, Debug)]
pub struct TexelLayout {
    pub width: u32,
    pub height: u32,
    pub format: PixelFormat,
    pub channels: u32,
    pub pixel_stride: usize,
    pub row_stride: usize,
    origin: Origin,
    /// Bytes that the image spans.
    pub bytes: usize,
}

impl TexelLayout {
    fn check_bytes(&self, name: &str, given: usize) -> Result<()> {
        let needed = self.bytes;
        match given >= needed {
            true => Ok(()),
            false => Err(Error::argument(format!("{name}: {given} bytes given, {needed} needed"))),
        }
    }

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
    pub layout: TexelLayout,
}

impl<'a> ImageView<'a> {
    /// A view of `bytes`; `name` is the argument's name, for messages.
    pub fn new(name: &str, bytes: &'a [u8], layout: ImageLayout) -> Result<ImageView<'a>> {
        let layout = layout.resolve(name, 1)?;
        layout.check_bytes(name, bytes.len())?;
        Ok(ImageView { bytes, layout })
    }

    /// Copies the `wanted` pages of the image, in its format, rows from v = 0 upward. Values must be finite; they are
    /// clamped to 0..1.
    #[doc(hidden)]
    pub fn to_map(self, name: &str, wanted: impl Fn(&TexelRect) -> bool) -> Result<Map> {
        let size = [self.layout.width as usize, self.layout.height as usize];
        self.check_finite(name, TexelRect { first: [0, 0], end: size })?;
        let mut map = Map::new(size, self.layout.format, wanted);
        let stored: Vec<TexelRect> = map.stored().collect();
        for rect in stored {
            self.copy_to(&mut map, rect);
        }
        Ok(map)
    }

    /// Copies some texels to a map of the same size and format.
    #[doc(hidden)]
    pub fn copy_to(&self, map: &mut Map, rect: TexelRect) {
        let size = self.layout.format.size();
        let is_packed = self.layout.pixel_stride == size;
        for y in rect.first[1]..rect.end[1] {
            if is_packed {
                let row = &self.bytes[self.layout.offset(rect.first[0], y)..];
                map.put_row(rect.first[0], y, &row[..(rect.end[0] - rect.first[0]) * size]);
                continue;
            }
            for x in rect.first[0]..rect.end[0] {
                map.put_row(x, y, &self.bytes[self.layout.offset(x, y)..][..size]);
            }
        }
    }

    /// Checks that the values of some texels are finite.
    #[doc(hidden)]
    pub fn check_finite(&self, name: &str, rect: TexelRect) -> Result<()> {
        if matches!(self.layout.format, PixelFormat::U8 | PixelFormat::U16) {
            return Ok(());
        }
        for y in rect.first[1]..rect.end[1] {
            for x in rect.first[0]..rect.end[0] {
                let value = decode(self.layout.format, &self.bytes[self.layout.offset(x, y)..]);
                ensure!(value.is_finite(), "{name}: texel ({x}, {}) is {value}", self.layout.row(y));
            }
        }
        Ok(())
    }

    /// A rectangle of texels, given by its first column and row in memory, its width and its height.
    #[doc(hidden)]
    pub fn rect(&self, name: &str, first: [u32; 2], size: [u32; 2]) -> Result<TexelRect> {
        let ([width, height], _) = self.shape();
        let [first, size] = [first, size].map(|pair| pair.map(|x| x as usize));
        let end = [first[0] + size[0], first[1] + size[1]];
        ensure!(
            !size.contains(&0) && end[0] <= width && end[1] <= height,
            "{name}: the part of {}x{} texels at ({}, {}) is empty or not inside of {width}x{height}",
            size[0],
            size[1],
            first[0],
            first[1]
        );
        // Rows run in the same direction as in memory, or in the opposite one.
        let [a, b] = [self.layout.row(first[1]), self.layout.row(end[1] - 1)];
        Ok(TexelRect { first: [first[0], a.min(b)], end: [end[0], a.max(b) + 1] })
    }

    /// Texels in u and v, and their format.
    pub fn shape(&self) -> ([usize; 2], PixelFormat) {
        ([self.layout.width as usize, self.layout.height as usize], self.layout.format)
    }
}

/// A part of an image of the whole tile: the texels from `first` to before `end`, rows counted from v = 0 upwards.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ImagePart {
    /// The image's width and height.
    pub size: [usize; 2],
    pub first: [usize; 2],
    pub end: [usize; 2],
}

impl ImagePart {
    /// Width and height of the part.
    pub fn extent(&self) -> [usize; 2] {
        [0, 1].map(|axis| self.end[axis] - self.first[axis])
    }
}

/// A host's image to be written.
#[derive(Debug)]
pub struct ImageViewMut<'a> {
    /// Not a slice: the bytes that strides skip may belong to another image, written through its own view.
    data: *mut u8,
    #[doc(hidden)]
    pub layout: TexelLayout,
    /// Place in the image of the whole tile.
    part: ImagePart,
    lifetime: PhantomData<&'a mut [u8]>,
}

// SAFETY: the view behaves like a `&mut [u8]`.
unsafe impl Send for ImageViewMut<'_> {}
// SAFETY: as above.
unsafe impl Sync for ImageViewMut<'_> {}

impl<'a> ImageViewMut<'a> {
    /// A view of `bytes` with `layout.channels` channels per texel, f16 or f32; bytes skipped by strides are left
    /// alone.
    ///
    /// # Errors
    /// `Unsupported` for integer formats.
    pub fn new(name: &str, bytes: &'a mut [u8], layout: ImageLayout) -> Result<ImageViewMut<'a>> {
        // SAFETY: the bytes are borrowed for as long as the view lives, and their number is checked here.
        let view = unsafe { ImageViewMut::from_raw(name, bytes.as_mut_ptr(), layout) }?;
        view.layout.check_bytes(name, bytes.len())?;
        Ok(view)
    }

    /// A view of the image whose first row begins at `data`.
    ///
    /// # Safety
    /// While the view is in use, nothing else may access the texels; the bytes between them may belong to anyone.
    pub unsafe fn from_raw(name: &str, data: *mut u8, layout: ImageLayout) -> Result<ImageViewMut<'a>> {
        if !matches!(layout.format, PixelFormat::F16 | PixelFormat::F32) {
            return Err(Error::new(
                ErrorKind::Unsupported,
                format!("{name}: format must be f16 or f32 for an output"),
            ));
        }
        let layout = layout.resolve_output(name, data)?;
        let size = [layout.width as usize, layout.height as usize];
        let part = ImagePart { size, first: [0, 0], end: size };
        Ok(ImageViewMut { data, layout, part, lifetime: PhantomData })
    }

    /// Makes this view a part of a larger image of `size` texels, beginning at the column and row `first`, counted in
    /// the image's own order. Large outputs can thus be fetched in bands; on the CPU the parts are bit-identical to the
    /// whole image.
    pub fn part_of(mut self, name: &str, size: [u32; 2], first: [u32; 2]) -> Result<ImageViewMut<'a>> {
        let own = self.part.extent();
        let [size, first] = [size, first].map(|pair| pair.map(|x| x as usize));
        let ([w, h], [x, y], [width, height]) = (own, first, size);
        ensure!(
            x + w <= width && y + h <= height,
            "{name}: its {w}x{h} texels at ({x}, {y}) are not inside of {width}x{height}"
        );
        let row = match self.layout.origin {
            Origin::Bottom => first[1],
            Origin::Top => size[1] - first[1] - own[1],
        };
        let first = [first[0], row];
        self.part = ImagePart { size, first, end: [0, 1].map(|axis| first[axis] + own[axis]) };
        Ok(self)
    }

    /// The part of the image of the whole tile that this view is.
    #[doc(hidden)]
    pub fn part(&self) -> &ImagePart {
        &self.part
    }

    #[doc(hidden)]
    pub fn as_mut_ptr(&mut self) -> *mut u8 {
        self.data
    }
}
