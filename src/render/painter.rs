//! The render pipelines: a scene goes in, pixels come out.

mod pipeline;
mod target;

use bytemuck::{Pod, Zeroable};
use firn_engine::frame::EngineError;
use firn_engine::gpu::device::{Device, Purpose};
use wgpu::util::{BufferInitDescriptor, DeviceExt, TextureDataOrder};

use super::renderer::Paint;
use super::scale::COLOURS;
use super::scene::Scene;
use pipeline::Pipelines;
use target::Target;

pub use pipeline::SHADERS;

/// Corners of the three faces of a box that can be seen.
const PRISM_CORNERS: u32 = 18;

/// What is drawn, and how it is seen.
#[derive(Clone, Debug)]
pub struct Shot {
    /// Pixels across and down.
    pub size: (u32, u32),
    /// Where in the picture the scene is: left, top, width and height in pixels.
    pub area: [f32; 4],
    /// How the scene is seen.
    pub view: View,
    /// What is behind it.
    pub background: [u8; 4],
    /// The scene.
    pub scene: Scene,
}

/// Laid out as `View` in `shaders/render/view.wgsl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct View {
    /// From metres to clip space, column by column.
    pub clip: [f32; 16],
    /// Where the eye is; a direction, with w = 0, for parallel projection.
    pub eye: [f32; 4],
    /// Direction to the light.
    pub light: [f32; 3],
    /// How much sides are shaded and boxes outlined, from 0 to 1.
    pub shading: f32,
}

/// A device made ready to draw.
pub struct Painter {
    device: Device,
    pipelines: Pipelines,
    /// That of the last picture.
    target: Option<Target>,
}

/// What one picture puts on the device.
struct Uploads {
    bindings: wgpu::BindGroup,
    prisms: Option<wgpu::Buffer>,
    mesh: Option<(wgpu::Buffer, wgpu::Buffer)>,
}

impl Painter {
    /// Opens the best adapter.
    ///
    /// # Errors
    /// [`EngineError::NoAdapter`], or [`EngineError::DeviceFailed`] where it can't draw.
    pub fn open() -> Result<Painter, EngineError> {
        let device = Device::open(Purpose::Draw)?;
        let pipelines = Pipelines::new(&device.device);
        device.check()?;
        Ok(Painter { device, pipelines, target: None })
    }

    fn upload(&self, shot: &Shot) -> Uploads {
        let device = &self.device.device;
        let buffer = |label, usage, contents: &[u8]| {
            let descriptor = BufferInitDescriptor { label: Some(label), contents, usage };
            (!contents.is_empty()).then(|| device.create_buffer_init(&descriptor))
        };
        let (vertex, index) = (wgpu::BufferUsages::VERTEX, wgpu::BufferUsages::INDEX);
        let Scene { prisms, vertices, indices, scale, .. } = &shot.scene;
        let view = device.create_buffer_init(&BufferInitDescriptor {
            label: Some("view"),
            contents: bytemuck::bytes_of(&shot.view),
            usage: wgpu::BufferUsages::UNIFORM,
        });
        let table: Vec<u8> = scale.colours().iter().flat_map(|&[r, g, b]| [r, g, b, 255]).collect();
        let colours = device.create_texture_with_data(
            &self.device.queue,
            &wgpu::TextureDescriptor {
                label: Some("colours"),
                size: extent(COLOURS as u32, 1),
                mip_level_count: 1,
                sample_count: 1,
                dimension: wgpu::TextureDimension::D2,
                format: target::FORMAT,
                usage: wgpu::TextureUsages::TEXTURE_BINDING,
                view_formats: &[],
            },
            TextureDataOrder::LayerMajor,
            &table,
        );
        Uploads {
            bindings: self.pipelines.bind(device, &view, &colours.create_view(&Default::default())),
            prisms: buffer("prisms", vertex, bytemuck::cast_slice(prisms)),
            mesh: buffer("vertices", vertex, bytemuck::cast_slice(vertices)).zip(buffer(
                "indices",
                index,
                bytemuck::cast_slice(indices),
            )),
        }
    }

    fn encode(&self, shot: &Shot, uploads: &Uploads, target: &Target) -> wgpu::CommandBuffer {
        let mut encoder = self.device.device.create_command_encoder(&Default::default());
        {
            let mut pass = target.begin(&mut encoder, shot.background);
            let [left, top, width, height] = shot.area;
            pass.set_viewport(left, top, width, height, 0.0, 1.0);
            pass.set_bind_group(0, &uploads.bindings, &[]);
            if let Some(prisms) = &uploads.prisms {
                pass.set_pipeline(&self.pipelines.prisms);
                pass.set_vertex_buffer(0, prisms.slice(..));
                pass.draw(0..PRISM_CORNERS, 0..shot.scene.prisms.len() as u32);
            }
            if let Some((vertices, indices)) = &uploads.mesh {
                pass.set_pipeline(&self.pipelines.mesh);
                pass.set_vertex_buffer(0, vertices.slice(..));
                pass.set_index_buffer(indices.slice(..), wgpu::IndexFormat::Uint32);
                pass.draw_indexed(0..shot.scene.indices.len() as u32, 0, 0..1);
            }
        }
        target.copy(&mut encoder);
        encoder.finish()
    }
}

impl Paint for Painter {
    fn paint(&mut self, shot: &Shot) -> Result<Vec<u8>, EngineError> {
        let target = match self.target.take().filter(|target| target.size == shot.size) {
            Some(target) => target,
            None => self.device.allocate(|| Target::new(&self.device.device, shot.size))?,
        };
        let uploads = self.device.allocate(|| self.upload(shot))?;
        let commands = self.encode(shot, &uploads, &target);
        self.device.queue.submit([commands]);
        let pixels = target.read(&self.device)?;
        self.device.check()?;
        self.target = Some(target).filter(Target::is_small);
        Ok(pixels)
    }
}

fn extent(width: u32, height: u32) -> wgpu::Extent3d {
    wgpu::Extent3d { width, height, depth_or_array_layers: 1 }
}
