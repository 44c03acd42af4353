//! The two pipelines, and what they bind.

use crate::render::scene::{Prism, Vertex};

use super::View;
use super::target::{DEPTH, FORMAT, SAMPLES};

const VIEW: &str = include_str!("../../../shaders/render/view.wgsl");

/// Each pipeline's name and the parts of its source.
pub const SHADERS: [(&str, [&str; 2]); 2] = [
    ("prism", [VIEW, include_str!("../../../shaders/render/prisms.wgsl")]),
    ("mesh", [VIEW, include_str!("../../../shaders/render/mesh.wgsl")]),
];

/// The fields of [`Prism`]; those of [`Vertex`] are the first four.
const ATTRIBUTES: [wgpu::VertexAttribute; 5] = wgpu::vertex_attr_array![
    0 => Float32x3, 1 => Float32, 2 => Float32x3, 3 => Unorm8x4, 4 => Uint32
];

/// The pipelines.
pub struct Pipelines {
    /// Draws boxes, an instance each.
    pub prisms: wgpu::RenderPipeline,
    /// Draws triangles.
    pub mesh: wgpu::RenderPipeline,
    layout: wgpu::BindGroupLayout,
}

impl Pipelines {
    /// Compiles the shaders.
    pub fn new(device: &wgpu::Device) -> Pipelines {
        let layout = device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
            label: Some("view"),
            entries: &ENTRIES,
        });
        let [prisms, mesh] = SHADERS;
        let buffer = |step_mode, stride: usize, attributes| wgpu::VertexBufferLayout {
            array_stride: stride as u64,
            step_mode,
            attributes,
        };
        let (instance, vertex) = (wgpu::VertexStepMode::Instance, wgpu::VertexStepMode::Vertex);
        let boxes = buffer(instance, size_of::<Prism>(), &ATTRIBUTES);
        let corners = buffer(vertex, size_of::<Vertex>(), &ATTRIBUTES[..4]);
        Pipelines {
            prisms: pipeline(device, &layout, prisms, boxes),
            mesh: pipeline(device, &layout, mesh, corners),
            layout,
        }
    }

    /// Binds a view and the colours of values.
    pub fn bind(
        &self,
        device: &wgpu::Device,
        view: &wgpu::Buffer,
        colours: &wgpu::TextureView,
    ) -> wgpu::BindGroup {
        let entry = |binding, resource| wgpu::BindGroupEntry { binding, resource };
        device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some("view"),
            layout: &self.layout,
            entries: &[
                entry(0, view.as_entire_binding()),
                entry(1, wgpu::BindingResource::TextureView(colours)),
            ],
        })
    }
}

const ENTRIES: [wgpu::BindGroupLayoutEntry; 2] = [
    wgpu::BindGroupLayoutEntry {
        binding: 0,
        visibility: wgpu::ShaderStages::VERTEX_FRAGMENT,
        ty: wgpu::BindingType::Buffer {
            ty: wgpu::BufferBindingType::Uniform,
            has_dynamic_offset: false,
            min_binding_size: wgpu::BufferSize::new(size_of::<View>() as u64),
        },
        count: None,
    },
    wgpu::BindGroupLayoutEntry {
        binding: 1,
        visibility: wgpu::ShaderStages::FRAGMENT,
        ty: wgpu::BindingType::Texture {
            sample_type: wgpu::TextureSampleType::Float { filterable: false },
            view_dimension: wgpu::TextureViewDimension::D2,
            multisampled: false,
        },
        count: None,
    },
];

fn pipeline(
    device: &wgpu::Device,
    layout: &wgpu::BindGroupLayout,
    (name, source): (&str, [&str; 2]),
    buffer: wgpu::VertexBufferLayout<'_>,
) -> wgpu::RenderPipeline {
    let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
        label: Some(name),
        source: wgpu::ShaderSource::Wgsl(source.join("\n").into()),
    });
    let layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
        label: Some(name),
        bind_group_layouts: &[Some(layout)],
        immediate_size: 0,
    });
    let (vertex, fragment) = (format!("{name}_vertex"), format!("{name}_fragment"));
    device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
        label: Some(name),
        layout: Some(&layout),
        vertex: wgpu::VertexState {
            module: &module,
            entry_point: Some(&vertex),
            compilation_options: Default::default(),
            buffers: &[Some(buffer)],
        },
        primitive: wgpu::PrimitiveState::default(),
        depth_stencil: Some(wgpu::DepthStencilState {
            format: DEPTH,
            depth_write_enabled: Some(true),
            depth_compare: Some(wgpu::CompareFunction::Less),
            stencil: Default::default(),
            bias: Default::default(),
        }),
        multisample: wgpu::MultisampleState { count: SAMPLES, ..Default::default() },
        fragment: Some(wgpu::FragmentState {
            module: &module,
            entry_point: Some(&fragment),
            compilation_options: Default::default(),
            targets: &[Some(FORMAT.into())],
        }),
        multiview_mask: None,
        cache: None,
    })
}
