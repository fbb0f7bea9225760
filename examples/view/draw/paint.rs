//! Textures on the GPU, with levels for where texels are smaller than pixels.

use image::imageops::FilterType;
use image::{RgbaImage, imageops};

use super::gpu::Gpu;

/// A texture with all of its levels; without an image, a single texel, which stands for none. Colours are encoded as
/// sRGB.
pub fn texture(gpu: &Gpu, image: Option<&RgbaImage>, format: wgpu::TextureFormat) -> wgpu::Texture {
    let nothing = RgbaImage::new(1, 1);
    let mut image = image.unwrap_or(&nothing).clone();
    let levels = 1 + image.width().max(image.height()).ilog2();
    let usage = wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::COPY_DST;
    let texture = gpu.texture([image.width(), image.height()], format, usage, [levels, 1]);
    for level in 0..levels {
        let size = [image.width(), image.height()];
        gpu.write(&texture, level, [0, 0], size, &image);
        let [width, height] = size.map(|side| (side / 2).max(1));
        image = imageops::resize(&image, width, height, FilterType::Triangle);
    }
    texture
}
