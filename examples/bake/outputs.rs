//! What is written per frame and tile, fetched as an image with the channels that a file gets.

use vrtm::{Asset, FetchKind, ImageLayout, ImageViewMut, PixelFormat};

use crate::args::{Args, Form};
use crate::fingerprint::Fingerprint;

/// One kind of file.
#[derive(Clone, Copy, Debug)]
pub struct Output {
    /// Its name in file names and metadata.
    pub kind: &'static str,
    /// How its UVs are meant, if it holds UVs.
    pub form: Option<&'static str>,
    pub fetch: FetchKind,
    /// Channels of the image that is fetched.
    channels: u32,
    /// Channels of the file: as many, or all alike.
    pub names: &'static [&'static str],
    pub format: PixelFormat,
    /// Whether values next to a fold of the interpolated map are moved, so that there is none.
    pub one_to_one: bool,
}

/// An image with its texels packed, first row at the top of the tile.
pub struct Image {
    pub size: [u32; 2],
    pub format: PixelFormat,
    pub names: &'static [&'static str],
    pub channels: usize,
    pub bytes: Vec<u8>,
}

const RGB: &[&str] = &["R", "G", "B"];
const RGBA: &[&str] = &["R", "G", "B", "A"];

impl Output {
    /// The kinds that the command line asks for; the first is the redirection.
    pub fn list(args: &Args) -> Vec<Output> {
        let format = if args.half { PixelFormat::F16 } else { PixelFormat::F32 };
        let (fetch, form) = match args.form {
            Form::Tile => (FetchKind::Redirection, "tile"),
            Form::Udim => (FetchKind::RedirectionUdim, "udim"),
            Form::Delta => (FetchKind::RedirectionDelta, "delta"),
        };
        let (channels, names) = if args.alpha { (4, RGBA) } else { (3, RGB) };
        let of = |kind, form, fetch, channels, names| Output {
            kind,
            form,
            fetch,
            channels,
            names,
            format,
            one_to_one: !args.exact,
        };
        let mut list = vec![of("redirect", Some(form), fetch, channels, names)];
        if !args.no_warp {
            list.push(of("warp", Some("tile"), FetchKind::Warp, 3, RGB));
        }
        if args.jacobian {
            list.push(of("jacobian", None, FetchKind::Jacobian, 4, RGBA));
        }
        if args.filter_scale {
            // Three times the same number: programs that read one channel alone show it as red, or not at all.
            list.push(of("filter", None, FetchKind::FilterScale, 1, RGB));
        }
        list
    }

    /// Adds to a fingerprint what a file of this kind and size depends on.
    pub fn add_to(&self, hash: &mut Fingerprint, size: [u32; 2]) {
        let Output { kind, form, names, format, one_to_one, .. } = self;
        hash.text(&format!("{kind} {form:?} {names:?} {format:?} {one_to_one} {size:?}"));
    }

    /// Fetches it.
    pub fn image(&self, asset: &Asset, tile: usize, size: [u32; 2]) -> vrtm::Result<Image> {
        let [width, height] = size;
        let layout = ImageLayout {
            one_to_one: self.one_to_one,
            ..ImageLayout::packed(width, height, self.format).with_channels(self.channels)
        };
        let texels = width as usize * height as usize;
        let each = if self.format == PixelFormat::F16 { 2 } else { 4 };
        let mut bytes = vec![0u8; texels * self.channels as usize * each];
        asset.fetch(tile, self.fetch, &mut ImageViewMut::new("image", &mut bytes, layout)?)?;
        Ok(Image { size, format: self.format, names: self.names, channels: self.channels as usize, bytes })
    }
}
