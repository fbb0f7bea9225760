//! Opens a GPU and creates textures on it.

use super::Result;

/// GL is left out, as in the library.
const BACKENDS: wgpu::Backends =
    wgpu::Backends::VULKAN.union(wgpu::Backends::DX12).union(wgpu::Backends::METAL);

pub struct Gpu {
    pub device: wgpu::Device,
    pub queue: wgpu::Queue,
    /// The adapter's name, with interface and driver.
    pub name: String,
    /// True for a software driver, which has no meaningful times.
    pub software: bool,
    /// True if samplers filter rg32float.
    pub filterable: bool,
}

/// A texture of several layers, one for each tile, and its levels.
pub struct Layers<'a> {
    pub format: wgpu::TextureFormat,
    /// Texels on a side of the finest level.
    pub side: u32,
    /// Texels of each level of each layer.
    pub layers: Vec<Vec<&'a [u8]>>,
}

impl Gpu {
    /// Opens an adapter by its number; hardware comes before software.
    pub fn open(number: usize) -> Result<Gpu> {
        let mut descriptor = wgpu::InstanceDescriptor::new_without_display_handle();
        descriptor.backends = BACKENDS;
        let instance = wgpu::Instance::new(descriptor);
        let mut adapters = pollster::block_on(instance.enumerate_adapters(BACKENDS));
        adapters.sort_by_key(|adapter| match adapter.get_info().device_type {
            wgpu::DeviceType::DiscreteGpu => 0,
            wgpu::DeviceType::IntegratedGpu => 1,
            wgpu::DeviceType::VirtualGpu => 2,
            wgpu::DeviceType::Cpu => 3,
            wgpu::DeviceType::Other => 4,
        });
        let adapter = adapters
            .get(number)
            .ok_or_else(|| format!("--adapter {number}: there are {} GPU adapters here", adapters.len()))?;
        let info = adapter.get_info();
        let features = adapter.features() & wgpu::Features::FLOAT32_FILTERABLE;
        let request = adapter.request_device(&wgpu::DeviceDescriptor {
            required_features: features,
            required_limits: adapter.limits(),
            ..Default::default()
        });
        let (device, queue) = pollster::block_on(request)
            .map_err(|error| format!("--adapter {number}: {} cannot be opened: {error}", info.name))?;
        Ok(Gpu {
            device,
            name: format!("{} ({:?}; {} {})", info.name, info.backend, info.driver, info.driver_info),
            software: matches!(info.device_type, wgpu::DeviceType::Cpu | wgpu::DeviceType::Other),
            filterable: !features.is_empty(),
            queue,
        })
    }

    /// Samples along the longer side of a pixel's footprint. It is 1 on software drivers: Mesa's llvmpipe computes
    /// wrong footprints from explicit derivatives along silhouettes, where it leaves dark pixels, and anisotropy takes
    /// ten times as long there.
    pub fn anisotropy(&self) -> u16 {
        if self.software { 1 } else { 16 }
    }

    /// Checks the size of a texture before it is computed.
    pub fn check(&self, label: &str, side: u32, layers: u32) -> Result<()> {
        let limits = self.device.limits();
        if side <= limits.max_texture_dimension_2d && layers <= limits.max_texture_array_layers {
            return Ok(());
        }
        Err(format!(
            "{label}: {side}x{side} texels in {layers} layers, but {} has {1}x{1} in {2}",
            self.name, limits.max_texture_dimension_2d, limits.max_texture_array_layers
        ))
    }

    /// Creates a texture and fills it.
    pub fn upload(&self, label: &str, layers: &Layers) -> Result<wgpu::TextureView> {
        let count = layers.layers.len() as u32;
        self.check(label, layers.side, count)?;
        let size = wgpu::Extent3d { width: layers.side, height: layers.side, depth_or_array_layers: count };
        let texture = self.device.create_texture(&wgpu::TextureDescriptor {
            label: Some(label),
            size,
            mip_level_count: layers.layers[0].len() as u32,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D2,
            format: layers.format,
            usage: wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::COPY_DST,
            view_formats: &[],
        });
        let texel = layers.format.block_copy_size(None).unwrap_or(4);
        for (z, levels) in (0..).zip(&layers.layers) {
            for (level, bytes) in (0..).zip(levels) {
                let side = layers.side >> level;
                let place = wgpu::TexelCopyTextureInfo {
                    texture: &texture,
                    mip_level: level,
                    origin: wgpu::Origin3d { x: 0, y: 0, z },
                    aspect: wgpu::TextureAspect::All,
                };
                let rows = wgpu::TexelCopyBufferLayout {
                    offset: 0,
                    bytes_per_row: Some(side * texel),
                    rows_per_image: None,
                };
                let part = wgpu::Extent3d { width: side, height: side, depth_or_array_layers: 1 };
                self.queue.write_texture(place, bytes, rows, part);
                // Frees the memory of this copy before the next copy takes as much.
                self.queue.submit([]);
                self.wait()?;
            }
        }
        Ok(texture.create_view(&wgpu::TextureViewDescriptor {
            dimension: Some(wgpu::TextureViewDimension::D2Array),
            ..Default::default()
        }))
    }

    /// Uploads the finest level of a layer of a texture, with its first row at v = 0.
    pub fn write(&self, texture: &wgpu::Texture, layer: u32, bytes: &[u8]) {
        let origin = wgpu::Origin3d { x: 0, y: 0, z: layer };
        let place = wgpu::TexelCopyTextureInfo { origin, ..texture.as_image_copy() };
        let texel = texture.format().block_copy_size(None).unwrap_or(4);
        let rows = wgpu::TexelCopyBufferLayout {
            offset: 0,
            bytes_per_row: Some(texture.width() * texel),
            rows_per_image: None,
        };
        let part = wgpu::Extent3d { depth_or_array_layers: 1, ..texture.size() };
        self.queue.write_texture(place, bytes, rows, part);
    }

    /// A texture used as a render target.
    pub fn target(
        &self,
        [width, height]: [u32; 2],
        format: wgpu::TextureFormat,
        usage: wgpu::TextureUsages,
    ) -> wgpu::Texture {
        self.device.create_texture(&wgpu::TextureDescriptor {
            label: None,
            size: wgpu::Extent3d { width, height, depth_or_array_layers: 1 },
            mip_level_count: 1,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D2,
            format,
            usage: wgpu::TextureUsages::RENDER_ATTACHMENT | usage,
            view_formats: &[],
        })
    }

    /// A buffer with this content.
    pub fn buffer(&self, bytes: &[u8], usage: wgpu::BufferUsages) -> wgpu::Buffer {
        let buffer = self.device.create_buffer(&wgpu::BufferDescriptor {
            label: None,
            size: (bytes.len() as u64).max(4),
            usage: usage | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        });
        self.queue.write_buffer(&buffer, 0, bytes);
        buffer
    }

    /// Waits for all submitted work.
    pub fn wait(&self) -> Result<()> {
        let all = self.device.poll(wgpu::PollType::Wait { submission_index: None, timeout: None });
        all.map(drop).map_err(|error| format!("{}: {error}", self.name))
    }

    /// Reads a buffer that can be mapped.
    pub fn read(&self, buffer: &wgpu::Buffer) -> Result<Vec<u8>> {
        buffer.map_async(wgpu::MapMode::Read, .., |_| {});
        self.wait()?;
        let bytes = buffer.get_mapped_range(..).map_err(|error| format!("{}: {error}", self.name))?.to_vec();
        buffer.unmap();
        Ok(bytes)
    }
}
