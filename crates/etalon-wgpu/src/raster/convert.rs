//! The state of draws in wgpu's words.

use etalon_core::plan::{PlannedAttribute, PlannedLayout};
use etalon_core::raster::{
    Blend, BlendComponent, BlendFactor, BlendOperation, ColourWrites, CullMode, DepthState,
    FrontFace, IndexFormat, RasterState, StepMode, TargetState, Topology, VertexFormat,
};

use crate::convert::compare;

/// wgpu's name of a vertex format, if it has one.
pub(super) const fn vertex_format(format: VertexFormat) -> Option<wgpu::VertexFormat> {
    use wgpu::VertexFormat as V;
    Some(match format {
        VertexFormat::Float32 => V::Float32,
        VertexFormat::Float32x2 => V::Float32x2,
        VertexFormat::Float32x3 => V::Float32x3,
        VertexFormat::Float32x4 => V::Float32x4,
        VertexFormat::Float16x2 => V::Float16x2,
        VertexFormat::Float16x4 => V::Float16x4,
        VertexFormat::Unorm8x2 => V::Unorm8x2,
        VertexFormat::Unorm8x4 => V::Unorm8x4,
        VertexFormat::Snorm8x4 => V::Snorm8x4,
        VertexFormat::Unorm16x2 => V::Unorm16x2,
        VertexFormat::Unorm16x4 => V::Unorm16x4,
        VertexFormat::Snorm16x2 => V::Snorm16x2,
        VertexFormat::Snorm16x4 => V::Snorm16x4,
        VertexFormat::Uint8x4 => V::Uint8x4,
        VertexFormat::Uint16x2 => V::Uint16x2,
        VertexFormat::Uint16x4 => V::Uint16x4,
        VertexFormat::Uint32 => V::Uint32,
        VertexFormat::Uint32x2 => V::Uint32x2,
        VertexFormat::Uint32x4 => V::Uint32x4,
        VertexFormat::Sint32 => V::Sint32,
        VertexFormat::Sint32x4 => V::Sint32x4,
        _ => return None,
    })
}

/// The inputs that are fed from a buffer. The formats must have been checked.
pub(super) fn attributes(attributes: &[PlannedAttribute]) -> Vec<wgpu::VertexAttribute> {
    attributes
        .iter()
        .filter_map(|attribute| {
            Some(wgpu::VertexAttribute {
                format: vertex_format(attribute.format)?,
                offset: attribute.offset.into(),
                shader_location: attribute.location,
            })
        })
        .collect()
}

/// The layout of a buffer; `None` if nothing is fed from it, so that it need
/// not be bound.
pub(super) fn vertex_layout<'a>(
    vertices: &PlannedLayout,
    attributes: &'a [wgpu::VertexAttribute],
) -> Option<wgpu::VertexBufferLayout<'a>> {
    (!attributes.is_empty()).then(|| wgpu::VertexBufferLayout {
        array_stride: vertices.stride.into(),
        step_mode: match vertices.step {
            StepMode::Vertex => wgpu::VertexStepMode::Vertex,
            StepMode::Instance => wgpu::VertexStepMode::Instance,
        },
        attributes,
    })
}

pub(super) const fn index_format(format: IndexFormat) -> wgpu::IndexFormat {
    match format {
        IndexFormat::Uint16 => wgpu::IndexFormat::Uint16,
        IndexFormat::Uint32 => wgpu::IndexFormat::Uint32,
    }
}

/// How vertices make triangles; `strip` is the format of the indices of a strip.
pub(super) fn primitive(state: &RasterState, strip: Option<IndexFormat>) -> wgpu::PrimitiveState {
    wgpu::PrimitiveState {
        topology: match state.topology {
            Topology::TriangleList => wgpu::PrimitiveTopology::TriangleList,
            Topology::TriangleStrip => wgpu::PrimitiveTopology::TriangleStrip,
        },
        strip_index_format: strip.map(index_format),
        front_face: match state.front {
            FrontFace::CounterClockwise => wgpu::FrontFace::Ccw,
            FrontFace::Clockwise => wgpu::FrontFace::Cw,
        },
        cull_mode: match state.cull {
            CullMode::None => None,
            CullMode::Front => Some(wgpu::Face::Front),
            CullMode::Back => Some(wgpu::Face::Back),
        },
        ..wgpu::PrimitiveState::default()
    }
}

/// How depth is compared. wgpu wants it said of every depth target, also where
/// it is neither compared nor written.
pub(super) fn depth(
    state: Option<&DepthState>,
    format: wgpu::TextureFormat,
) -> wgpu::DepthStencilState {
    let bias = match state {
        Some(DepthState { bias, .. }) if !bias.is_none() => wgpu::DepthBiasState {
            constant: bias.constant,
            slope_scale: bias.slope,
            clamp: bias.clamp,
        },
        _ => wgpu::DepthBiasState::default(),
    };
    wgpu::DepthStencilState {
        format,
        depth_write_enabled: Some(state.is_some_and(|state| state.write)),
        depth_compare: Some(state.map_or(wgpu::CompareFunction::Always, |state| {
            compare(state.compare)
        })),
        stencil: wgpu::StencilState::default(),
        bias,
    }
}

/// How a colour target is written.
pub(super) fn target(state: &TargetState, format: wgpu::TextureFormat) -> wgpu::ColorTargetState {
    wgpu::ColorTargetState {
        format,
        blend: state.blend.as_ref().map(blend),
        write_mask: writes(state.writes),
    }
}

fn blend(blend: &Blend) -> wgpu::BlendState {
    wgpu::BlendState {
        color: component(&blend.colour),
        alpha: component(&blend.alpha),
    }
}

fn component(component: &BlendComponent) -> wgpu::BlendComponent {
    let operation = match component.operation {
        BlendOperation::Add => wgpu::BlendOperation::Add,
        BlendOperation::Subtract => wgpu::BlendOperation::Subtract,
        BlendOperation::ReverseSubtract => wgpu::BlendOperation::ReverseSubtract,
        BlendOperation::Min => wgpu::BlendOperation::Min,
        BlendOperation::Max => wgpu::BlendOperation::Max,
    };
    // WebGPU refuses other factors of these than the 1 they are taken as.
    let plain = matches!(
        component.operation,
        BlendOperation::Min | BlendOperation::Max
    );
    let factor = |given| {
        if plain {
            wgpu::BlendFactor::One
        } else {
            factor(given)
        }
    };
    wgpu::BlendComponent {
        src_factor: factor(component.source),
        dst_factor: factor(component.target),
        operation,
    }
}

const fn factor(factor: BlendFactor) -> wgpu::BlendFactor {
    use wgpu::BlendFactor as B;
    match factor {
        BlendFactor::Zero => B::Zero,
        BlendFactor::One => B::One,
        BlendFactor::Source => B::Src,
        BlendFactor::OneMinusSource => B::OneMinusSrc,
        BlendFactor::SourceAlpha => B::SrcAlpha,
        BlendFactor::OneMinusSourceAlpha => B::OneMinusSrcAlpha,
        BlendFactor::Target => B::Dst,
        BlendFactor::OneMinusTarget => B::OneMinusDst,
        BlendFactor::TargetAlpha => B::DstAlpha,
        BlendFactor::OneMinusTargetAlpha => B::OneMinusDstAlpha,
    }
}

fn writes(writes: ColourWrites) -> wgpu::ColorWrites {
    use wgpu::ColorWrites as W;
    [
        (writes.red, W::RED),
        (writes.green, W::GREEN),
        (writes.blue, W::BLUE),
        (writes.alpha, W::ALPHA),
    ]
    .into_iter()
    .filter(|(written, _)| *written)
    .fold(W::empty(), |sum, (_, channel)| sum | channel)
}
