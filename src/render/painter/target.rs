//! What is drawn into, and how its pixels come back.

use std::time::Duration;

use firn_engine::frame::EngineError;
use firn_engine::gpu::device::Device;

use super::extent;

/// Colours are sRGB as they are: those of a colour map come out to the bit.
pub const FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::Rgba8Unorm;

/// Format of depths.
pub const DEPTH: wgpu::TextureFormat = wgpu::TextureFormat::Depth32Float;

/// Samples of a pixel; every adapter can take four of these formats.
pub const SAMPLES: u32 = 4;

/// Pixels of the largest target that is kept for the next picture.
const LARGEST_KEPT: u32 = 1 << 21;

/// Longest time for a picture to be drawn.
const PATIENCE: Duration = Duration::from_secs(20);

/// Textures that a picture is drawn into, and a buffer that it is copied to.
pub struct Target {
    /// Pixels across and down.
    pub size: (u32, u32),
    samples: wgpu::TextureView,
    depth: wgpu::TextureView,
    resolved: wgpu::Texture,
    readback: wgpu::Buffer,
}

impl Target {
    /// For pictures of a size.
    pub fn new(device: &wgpu::Device, size: (u32, u32)) -> Target {
        let texture = |label, format, sample_count, usage| {
            device.create_texture(&wgpu::TextureDescriptor {
                label: Some(label),
                size: extent(size.0, size.1),
                mip_level_count: 1,
                sample_count,
                dimension: wgpu::TextureDimension::D2,
                format,
                usage,
                view_formats: &[],
            })
        };
        let drawn = wgpu::TextureUsages::RENDER_ATTACHMENT;
        let view = |texture: &wgpu::Texture| texture.create_view(&Default::default());
        Target {
            size,
            samples: view(&texture("samples", FORMAT, SAMPLES, drawn)),
            depth: view(&texture("depth", DEPTH, SAMPLES, drawn)),
            resolved: texture("picture", FORMAT, 1, drawn | wgpu::TextureUsages::COPY_SRC),
            readback: device.create_buffer(&wgpu::BufferDescriptor {
                label: Some("picture"),
                size: u64::from(row_bytes(size.0)) * u64::from(size.1),
                usage: wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST,
                mapped_at_creation: false,
            }),
        }
    }

    /// Whether it is worth keeping.
    pub fn is_small(&self) -> bool {
        self.size.0 * self.size.1 <= LARGEST_KEPT
    }

    /// Begins to draw on a background.
    pub fn begin<'encoder>(
        &self,
        encoder: &'encoder mut wgpu::CommandEncoder,
        background: [u8; 4],
    ) -> wgpu::RenderPass<'encoder> {
        let [r, g, b, a] = background.map(|part| f64::from(part) / 255.0);
        encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            label: Some("picture"),
            color_attachments: &[Some(wgpu::RenderPassColorAttachment {
                view: &self.samples,
                depth_slice: None,
                resolve_target: Some(&self.resolved.create_view(&Default::default())),
                ops: wgpu::Operations {
                    load: wgpu::LoadOp::Clear(wgpu::Color { r, g, b, a }),
                    store: wgpu::StoreOp::Discard,
                },
            })],
            depth_stencil_attachment: Some(wgpu::RenderPassDepthStencilAttachment {
                view: &self.depth,
                depth_ops: Some(wgpu::Operations {
                    load: wgpu::LoadOp::Clear(1.0),
                    store: wgpu::StoreOp::Discard,
                }),
                stencil_ops: None,
            }),
            ..Default::default()
        })
    }

    /// Copies what was drawn to where it can be read.
    pub fn copy(&self, encoder: &mut wgpu::CommandEncoder) {
        encoder.copy_texture_to_buffer(
            self.resolved.as_image_copy(),
            wgpu::TexelCopyBufferInfo {
                buffer: &self.readback,
                layout: wgpu::TexelCopyBufferLayout {
                    offset: 0,
                    bytes_per_row: Some(row_bytes(self.size.0)),
                    rows_per_image: None,
                },
            },
            extent(self.size.0, self.size.1),
        );
    }

    /// The pixels, once everything that was submitted is done.
    ///
    /// # Errors
    /// [`EngineError::DeviceFailed`] where they don't come.
    pub fn read(&self, device: &Device) -> Result<Vec<u8>, EngineError> {
        let failed = |why: String| EngineError::DeviceFailed(format!("reading a picture: {why}"));
        let (send, mapped) = std::sync::mpsc::channel();
        self.readback.slice(..).map_async(wgpu::MapMode::Read, move |result| {
            let _ = send.send(result);
        });
        let wait = wgpu::PollType::Wait { submission_index: None, timeout: Some(PATIENCE) };
        device.device.poll(wait).map_err(|error| failed(error.to_string()))?;
        match mapped.try_recv() {
            Ok(Ok(())) => {}
            Ok(Err(error)) => return Err(failed(error.to_string())),
            Err(_) => return Err(failed("the device was lost".to_owned())),
        }
        let view = self.readback.get_mapped_range(..).map_err(|error| failed(error.to_string()))?;
        let (padded, row) = (row_bytes(self.size.0) as usize, self.size.0 as usize * 4);
        let mut pixels = Vec::with_capacity(row * self.size.1 as usize);
        view.to_vec().chunks(padded).for_each(|line| pixels.extend_from_slice(&line[..row]));
        drop(view);
        self.readback.unmap();
        Ok(pixels)
    }
}

/// Bytes of a row in a buffer, aligned as copies want them.
fn row_bytes(width: u32) -> u32 {
    (width * 4).next_multiple_of(wgpu::COPY_BYTES_PER_ROW_ALIGNMENT)
}
