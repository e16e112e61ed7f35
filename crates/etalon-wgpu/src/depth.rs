//! Float depth textures, which WebGPU fills by rendering only.

use etalon_core::Format;
use etalon_core::backend::BackendError;
use etalon_core::graph::Subresources;
use etalon_core::image::ImageData;
use etalon_core::resource::TextureDesc;

use crate::bind::{Physical, TexturePart};
use crate::gpu::Gpu;
use crate::tally::Owned;

/// Whether rendering can store a depth; what is wrong with it otherwise.
pub(crate) fn check(value: f32) -> Result<(), String> {
    // Viewports span 0 to 1 and clamp whatever is outside.
    if (0.0..=1.0).contains(&value) {
        Ok(())
    } else {
        Err(format!("a depth of {value} (only 0 to 1 can be stored)"))
    }
}

/// A view of each mip and layer of a range, to render to or load from.
pub(crate) fn views(
    gpu: &Gpu,
    step: &str,
    part: TexturePart<'_>,
    range: Subresources,
) -> Result<Vec<wgpu::TextureView>, BackendError> {
    let single = |mip: u32, layer: u32| Subresources {
        mip,
        mips: 1,
        layer,
        layers: 1,
    };
    let views: Vec<_> = gpu
        .guarded(|| {
            (range.mip..range.mip + range.mips)
                .flat_map(|mip| {
                    (range.layer..range.layer + range.layers).map(move |layer| single(mip, layer))
                })
                .map(|range| part.view(wgpu::TextureViewDimension::D2, range))
                .collect()
        })
        .map_err(|fault| fault.of("create_view", step, 0))?;
    gpu.tally.views.add(views.len() as u64);
    Ok(views)
}

fn pass<'e>(
    encoder: &'e mut wgpu::CommandEncoder,
    view: &wgpu::TextureView,
    value: f32,
) -> wgpu::RenderPass<'e> {
    encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
        label: Some("etalon depth"),
        depth_stencil_attachment: Some(wgpu::RenderPassDepthStencilAttachment {
            view,
            depth_ops: Some(wgpu::Operations {
                load: wgpu::LoadOp::Clear(value),
                store: wgpu::StoreOp::Store,
            }),
            stencil_ops: None,
        }),
        ..wgpu::RenderPassDescriptor::default()
    })
}

/// Fills one mip of one layer.
pub(crate) fn clear(encoder: &mut wgpu::CommandEncoder, view: &wgpu::TextureView, value: f32) {
    drop(pass(encoder, view, value));
}

/// A triangle over everything, at the depth that a texture holds.
const SHADER: &str = "
@group(0) @binding(0) var source: texture_2d<f32>;

@vertex fn corner(@builtin(vertex_index) index: u32) -> @builtin(position) vec4f {
    return vec4f(f32(index & 1u) * 4.0 - 1.0, f32(index >> 1u) * 4.0 - 1.0, 0.0, 1.0);
}

@fragment fn depth(@builtin(position) position: vec4f) -> @builtin(frag_depth) f32 {
    return textureLoad(source, vec2i(position.xy), 0).x;
}
";

/// Copies images into a float depth texture, through a colour texture.
#[derive(Debug)]
pub(crate) struct DepthUpload {
    pipeline: wgpu::RenderPipeline,
    staging: Owned<wgpu::Texture>,
    /// For each mip and layer: what to load from, and what to render to.
    parts: Vec<(wgpu::BindGroup, wgpu::TextureView)>,
}

impl DepthUpload {
    /// Prepares uploads into `target`, which is all of a texture.
    pub(crate) fn new(
        gpu: &Gpu,
        name: &str,
        desc: &TextureDesc,
        target: &wgpu::Texture,
    ) -> Result<Self, BackendError> {
        let staging = gpu.texture(
            name,
            &desc.with_format(Format::R32Float),
            wgpu::TextureFormat::R32Float,
            wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::COPY_DST,
        )?;
        let all = Subresources {
            mip: 0,
            mips: desc.mips,
            layer: 0,
            layers: desc.layers(),
        };
        let (source, target) = (Physical::whole(&staging), Physical::whole(target));
        let (Some(source), Some(target)) = (source.texture(), target.texture()) else {
            return Err(BackendError::Api {
                call: "create_texture",
                reason: format!("`{name}` is no texture"),
            });
        };
        let sources = views(gpu, name, source, all)?;
        let targets = views(gpu, name, target, all)?;
        let device = &gpu.device;
        let (pipeline, groups) = gpu
            .guarded(|| {
                let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
                    label: Some("etalon depth"),
                    source: wgpu::ShaderSource::Wgsl(SHADER.into()),
                });
                let layout = device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
                    label: Some("etalon depth"),
                    entries: &[wgpu::BindGroupLayoutEntry {
                        binding: 0,
                        visibility: wgpu::ShaderStages::FRAGMENT,
                        ty: wgpu::BindingType::Texture {
                            sample_type: wgpu::TextureSampleType::Float { filterable: false },
                            view_dimension: wgpu::TextureViewDimension::D2,
                            multisampled: false,
                        },
                        count: None,
                    }],
                });
                let pipeline = pipeline(device, &module, &layout);
                let groups: Vec<_> = sources
                    .iter()
                    .map(|view| {
                        device.create_bind_group(&wgpu::BindGroupDescriptor {
                            label: Some("etalon depth"),
                            layout: &layout,
                            entries: &[wgpu::BindGroupEntry {
                                binding: 0,
                                resource: wgpu::BindingResource::TextureView(view),
                            }],
                        })
                    })
                    .collect();
                (pipeline, groups)
            })
            .map_err(|fault| fault.of("create_render_pipeline", name, 0))?;
        gpu.tally.pipelines.add(1);
        gpu.tally.bind_groups.add(groups.len() as u64);
        Ok(Self {
            pipeline,
            staging,
            parts: groups.into_iter().zip(targets).collect(),
        })
    }

    /// Where the image is to be written first, as [`Format::R32Float`].
    pub(crate) fn staging(&self) -> &wgpu::Texture {
        &self.staging
    }

    /// Records the copy from there into the depth texture.
    pub(crate) fn record(&self, encoder: &mut wgpu::CommandEncoder) {
        for (group, view) in &self.parts {
            let mut pass = pass(encoder, view, 0.0);
            pass.set_pipeline(&self.pipeline);
            pass.set_bind_group(0, group, &[]);
            pass.draw(0..3, 0..1);
        }
    }
}

fn pipeline(
    device: &wgpu::Device,
    module: &wgpu::ShaderModule,
    layout: &wgpu::BindGroupLayout,
) -> wgpu::RenderPipeline {
    let layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
        label: Some("etalon depth"),
        bind_group_layouts: &[Some(layout)],
        immediate_size: 0,
    });
    device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
        label: Some("etalon depth"),
        layout: Some(&layout),
        vertex: wgpu::VertexState {
            module,
            entry_point: Some("corner"),
            compilation_options: wgpu::PipelineCompilationOptions::default(),
            buffers: &[],
        },
        primitive: wgpu::PrimitiveState::default(),
        depth_stencil: Some(wgpu::DepthStencilState {
            format: wgpu::TextureFormat::Depth32Float,
            depth_write_enabled: Some(true),
            depth_compare: Some(wgpu::CompareFunction::Always),
            stencil: wgpu::StencilState::default(),
            bias: wgpu::DepthBiasState::default(),
        }),
        multisample: wgpu::MultisampleState::default(),
        fragment: Some(wgpu::FragmentState {
            module,
            entry_point: Some("depth"),
            compilation_options: wgpu::PipelineCompilationOptions::default(),
            targets: &[],
        }),
        multiview_mask: None,
        cache: None,
    })
}

/// Checks that rendering can store every depth of an image.
pub(crate) fn check_image(image: &ImageData) -> Result<(), String> {
    image
        .bytes
        .chunks_exact(4)
        .try_for_each(|bytes| check(f32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]])))
}
