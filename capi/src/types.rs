//! Structs and constants that several functions share.

use std::ffi::c_void;
use std::ops::Range;

use super::desc::{self, sized};
use super::mirror::{Mirror, choice};
use super::status::{Failure, Outcome};
use super::strips::Strips;
use vrtm::FetchKind;
use vrtm_core::image::format::PixelFormat;
use vrtm_core::image::{ImageLayout, ImageView, ImageViewMut, Origin, TexelLayout};
use vrtm_core::view::{Scalar, Strided};

choice! {
    SCALARS: vrtm_scalar of Scalar { VRTM_SCALAR_F32 = 0: F32, VRTM_SCALAR_F64 = 1: F64 }
}

choice! {
    PIXEL_FORMATS: vrtm_pixel_format of PixelFormat {
        VRTM_PIXEL_F32 = 0: F32, VRTM_PIXEL_F16 = 1: F16, VRTM_PIXEL_U16 = 2: U16, VRTM_PIXEL_U8 = 3: U8,
    }
}

choice! {
    ORIGINS: vrtm_origin of Origin { VRTM_ORIGIN_TOP = 0: Top, VRTM_ORIGIN_BOTTOM = 1: Bottom }
}

/// A host's array of vectors or numbers, such as vertex positions. Start from vrtm_array_init(). The function or field
/// that takes the array determines the number of components per element: 3 for positions (a fourth, as in Maya's
/// double4, is skipped by the stride), 2 for UV pairs, 1 for single values. The data need not be aligned. It is read
/// during the call only.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct vrtm_array {
    /// sizeof(vrtm_array); set by vrtm_array_init().
    pub struct_size: u32,
    /// VRTM_SCALAR_F32 (0, the default) or VRTM_SCALAR_F64.
    pub format: vrtm_scalar,
    /// The first component of the first element.
    pub data: *const c_void,
    /// Number of elements (not of components or bytes).
    pub count: usize,
    /// Bytes from one element to the next; 0 = tightly packed. At least the size of an element.
    pub stride: usize,
}

/// An input image with one channel: a rigidity map or a warp mask. It covers the whole tile; texel (x, y) from the
/// corner (0, 0) has its centre at u = (x + 0.5) / width, v = (y + 0.5) / height. Start from vrtm_image_init(). To use
/// one channel of several, point `data` at it and set `pixel_stride`. The data is copied before the call returns.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct vrtm_image {
    /// sizeof(vrtm_image); set by vrtm_image_init().
    pub struct_size: u32,
    /// One of VRTM_PIXEL_: F32 (0, the default), F16, U16, U8.
    pub format: vrtm_pixel_format,
    /// Texels in u, at least 1.
    pub width: u32,
    /// Texels in v, at least 1.
    pub height: u32,
    /// VRTM_ORIGIN_TOP (0, the default) or VRTM_ORIGIN_BOTTOM.
    pub origin: vrtm_origin,
    /// The first texel of the first row. Need not be aligned.
    pub data: *const c_void,
    /// Bytes from one texel to the next; 0 = tightly packed.
    pub pixel_stride: usize,
    /// Bytes from one row to the next; 0 = tightly packed.
    pub row_stride: usize,
}

/// An output image in the caller's memory: width * height * channels values, if packed. Any size is allowed; the first
/// `channels` channels of each texel are written. Bytes that a stride skips stay. Start from vrtm_image_out_init().
#[repr(C)]
#[derive(Clone, Copy)]
pub struct vrtm_image_out {
    /// sizeof(vrtm_image_out); set by vrtm_image_out_init().
    pub struct_size: u32,
    /// VRTM_PIXEL_F32 (0, the default) or VRTM_PIXEL_F16.
    pub format: vrtm_pixel_format,
    /// Texels in u, at least 1.
    pub width: u32,
    /// Texels in v, at least 1.
    pub height: u32,
    /// VRTM_ORIGIN_TOP (0, the default) or VRTM_ORIGIN_BOTTOM.
    pub origin: vrtm_origin,
    /// Channels to write per texel; 0 (the default) = as many as the kind of output has: 1 for FILTER_SCALE, 4 for
    /// JACOBIAN, 2 for all others. With 3, the third channel of UVs is 0; with 4, for all but a warp, the fourth is 1
    /// where a chart covers the texel's centre and 0 elsewhere.
    pub channels: u32,
    /// Address of the first texel of the first row: width * height * channels values, if packed. Need not be aligned.
    pub data: *mut c_void,
    /// Bytes from one texel to the next; 0 = tightly packed (for two channels 8 for f32, 4 for f16).
    pub pixel_stride: usize,
    /// Bytes from one row to the next; 0 = tightly packed.
    pub row_stride: usize,
}

/// An array of vectors in the caller's memory. Start from vrtm_array_out_init(). It need not be aligned; bytes that
/// the stride skips are left unchanged.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct vrtm_array_out {
    /// sizeof(vrtm_array_out); set by vrtm_array_out_init().
    pub struct_size: u32,
    /// VRTM_SCALAR_F32 (0, the default) or VRTM_SCALAR_F64.
    pub format: vrtm_scalar,
    /// Address of the first component of the first element: count * components numbers, if packed.
    pub data: *mut c_void,
    /// Number of elements: vrtm_carrier_info.points.
    pub count: usize,
    /// Bytes from one element to the next; 0 = tightly packed. At least the size of an element.
    pub stride: usize,
}

/// Destinations of carried points, vrtm_carrier_info.points elements in each array; null arrays are skipped. Elements
/// of different arrays may be interleaved. Start from vrtm_carried_init().
#[repr(C)]
#[derive(Clone, Copy)]
pub struct vrtm_carried {
    /// sizeof(vrtm_carried); set by vrtm_carried_init().
    pub struct_size: u32,
    /// Positions in the pose, 3 components.
    pub positions: *const vrtm_array_out,
    /// Rotations of the frames at rest: quaternions x, y, z, w, 4 components.
    pub rotations: *const vrtm_array_out,
    /// Instead of `rotations`: matrices row by row, 9 components.
    pub matrices: *const vrtm_array_out,
    /// The stretch of the surface under what is painted that is left, as two factors, the larger first: 2 components.
    pub stretch: *const vrtm_array_out,
    /// UV of the surface point under each point, W(p) for a point painted at p (as VRTM_FETCH_WARP), with the tile's
    /// offset added: 2 components.
    pub uvs: *const vrtm_array_out,
}

// SAFETY: repr(C), struct_size first, plain numbers and raw pointers.
sized!(vrtm_array, vrtm_image, vrtm_image_out, vrtm_array_out, vrtm_carried);

/// A view of a host's array; the host guarantees that the memory it spans is valid.
pub(super) unsafe fn strided<'a>(
    array: *const vrtm_array,
    components: usize,
    name: &str,
) -> Outcome<Strided<'a>> {
    // SAFETY: passed on.
    unsafe { strided_and_span(array, components, name) }.map(|(view, _)| view)
}

/// A view of a host's array; null gives `None`.
pub(super) unsafe fn strided_or_none<'a>(
    array: *const vrtm_array,
    components: usize,
    name: &str,
) -> Outcome<Option<Strided<'a>>> {
    // SAFETY: passed on.
    (!array.is_null()).then(|| unsafe { strided(array, components, name) }).transpose()
}

/// A view of a host's array, and the range of addresses that it spans.
pub(super) unsafe fn strided_and_span<'a>(
    array: *const vrtm_array,
    components: usize,
    name: &str,
) -> Outcome<(Strided<'a>, Range<usize>)> {
    // SAFETY: the host's pointer.
    let array = unsafe { desc::read(array, name) }?;
    let scalar = Scalar::from_c(array.format, &format!("{name}.format"))?;
    ensure!(!array.data.is_null(), "{name}.data is null");
    ensure!(array.count != 0, "{name}.count is 0");
    let element = scalar.size() * components;
    let stride = if array.stride == 0 { element } else { array.stride };
    ensure!(stride >= element, "{name}.stride is {stride} bytes, smaller than an element ({element} bytes)");
    let most = (usize::MAX - array.data.addr()).min(isize::MAX as usize);
    let span = |stride: usize| {
        let bytes = (array.count - 1).checked_mul(stride).and_then(|n| n.checked_add(element));
        bytes.filter(|&n| n <= most)
    };
    // Blame the stride if the elements would fit when tightly packed.
    let bytes = span(stride).ok_or_else(|| {
        let (count, far) = (array.count, "exceed the address space");
        Failure::argument(match span(element) {
            Some(_) => format!("{name}.stride is {stride} bytes: {count} elements that far apart {far}"),
            None => format!("{name}.count: {count} elements {far}"),
        })
    })?;
    // SAFETY: the host vouches for `count` elements.
    let bytes = unsafe { desc::slice(array.data.cast::<u8>(), bytes, name) }?;
    let start = bytes.as_ptr().addr();
    let view = Strided::new(name, bytes, scalar, components, array.count, stride)?;
    Ok((view, start..start + bytes.len()))
}

fn layout(
    format: vrtm_pixel_format,
    size: [u32; 2],
    strides: [usize; 2],
    origin: vrtm_origin,
    name: &str,
) -> Outcome<ImageLayout> {
    let format = PixelFormat::from_c(format, &format!("{name}.format"))?;
    let origin = Origin::from_c(origin, &format!("{name}.origin"))?;
    let [width, height] = size;
    // In C, a stride of 0 means packed.
    let [pixel_stride, row_stride] = strides.map(|stride| (stride != 0).then_some(stride));
    let packed = ImageLayout::packed(width, height, format);
    Ok(ImageLayout { pixel_stride, row_stride, origin, ..packed })
}

/// A view of a host's map; null gives `None`.
pub(super) unsafe fn image_or_none<'a>(
    image: *const vrtm_image,
    name: &str,
) -> Outcome<Option<ImageView<'a>>> {
    if image.is_null() {
        return Ok(None);
    }
    // SAFETY: the host's pointer.
    let image = unsafe { desc::read(image, name) }?;
    ensure!(!image.data.is_null(), "{name}.data is null");
    let size = [image.width, image.height];
    let layout = layout(image.format, size, [image.pixel_stride, image.row_stride], image.origin, name)?;
    let bytes = layout.resolve_within(name, 1, usize::MAX - image.data.addr())?.bytes;
    // SAFETY: the host vouches for the memory that the layout spans.
    let bytes = unsafe { desc::slice(image.data.cast::<u8>(), bytes, name) }?;
    Ok(Some(ImageView::new(name, bytes, layout)?))
}

/// A checked output image that is not a view yet, so that several may exist at once.
pub(super) struct Target {
    data: *mut u8,
    layout: ImageLayout,
    texels: TexelLayout,
}

impl Target {
    /// Reads and checks the description of an output of this kind.
    pub unsafe fn read(image: *const vrtm_image_out, name: &str, kind: FetchKind) -> Outcome<Target> {
        // SAFETY: the host's pointer.
        let image = unsafe { desc::read(image, name) }?;
        ensure!(!image.data.is_null(), "{name}.data is null");
        let size = [image.width, image.height];
        let strides = [image.pixel_stride, image.row_stride];
        let layout = layout(image.format, size, strides, image.origin, name)?;
        if !matches!(layout.format, PixelFormat::F32 | PixelFormat::F16) {
            return Err(Failure::unsupported(format!("{name}.format must be f32 or f16 for an output")));
        }
        let channels = if image.channels == 0 { kind.channels() } else { image.channels };
        kind.check_channels(name, channels)?;
        let layout = ImageLayout { channels: Some(channels), ..layout };
        let data = image.data.cast::<u8>();
        let texels = layout.resolve_output(name, data)?;
        Ok(Target { data, layout, texels })
    }

    /// The bytes that are written.
    pub fn written(&self) -> Strips {
        let TexelLayout { width, height, pixel_stride, row_stride, .. } = self.texels;
        Strips {
            start: self.data.addr(),
            size: self.texels.format.size() * self.texels.channels as usize,
            steps: [(width as usize, pixel_stride), (height as usize, row_stride)],
        }
    }

    /// The image to write to. Nothing else may touch its texels while it is in use.
    pub unsafe fn view<'a>(&self, name: &str) -> Outcome<ImageViewMut<'a>> {
        // SAFETY: the host vouches for the memory that the layout spans.
        Ok(unsafe { ImageViewMut::from_raw(name, self.data, self.layout) }?)
    }
}
