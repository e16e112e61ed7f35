//! Etalon's words in Vulkan's: formats, shapes and samplers.
//!
//! How usages become stages, accesses and layouts is in [`usage`](crate::usage).

use ash::vk;
use etalon_core::Format;
use etalon_core::format::SampleKind;
use etalon_core::graph::Subresources;
use etalon_core::kernel::ViewDimension;
use etalon_core::raster::{
    Blend, BlendFactor, BlendOperation, ColourWrites, IndexFormat, TargetState, VertexFormat,
};
use etalon_core::resource::{
    AddressMode, Compare, Dimension, Filter, LodRange, SamplerDesc, TextureDesc,
};

/// The Vulkan format, or `None` for one this backend does not know.
pub(crate) fn format(format: Format) -> Option<vk::Format> {
    use vk::Format as V;
    Some(match format {
        Format::R8Unorm => V::R8_UNORM,
        Format::R8Snorm => V::R8_SNORM,
        Format::R8Uint => V::R8_UINT,
        Format::R8Sint => V::R8_SINT,
        Format::R16Uint => V::R16_UINT,
        Format::R16Sint => V::R16_SINT,
        Format::R16Float => V::R16_SFLOAT,
        Format::Rg8Unorm => V::R8G8_UNORM,
        Format::Rg8Snorm => V::R8G8_SNORM,
        Format::Rg8Uint => V::R8G8_UINT,
        Format::Rg8Sint => V::R8G8_SINT,
        Format::R32Uint => V::R32_UINT,
        Format::R32Sint => V::R32_SINT,
        Format::R32Float => V::R32_SFLOAT,
        Format::Rg16Uint => V::R16G16_UINT,
        Format::Rg16Sint => V::R16G16_SINT,
        Format::Rg16Float => V::R16G16_SFLOAT,
        Format::Rgba8Unorm => V::R8G8B8A8_UNORM,
        Format::Rgba8UnormSrgb => V::R8G8B8A8_SRGB,
        Format::Rgba8Snorm => V::R8G8B8A8_SNORM,
        Format::Rgba8Uint => V::R8G8B8A8_UINT,
        Format::Rgba8Sint => V::R8G8B8A8_SINT,
        Format::Bgra8Unorm => V::B8G8R8A8_UNORM,
        Format::Rgb9e5Ufloat => V::E5B9G9R9_UFLOAT_PACK32,
        Format::Rgb10a2Unorm => V::A2B10G10R10_UNORM_PACK32,
        Format::Rg11b10Ufloat => V::B10G11R11_UFLOAT_PACK32,
        Format::Rg32Uint => V::R32G32_UINT,
        Format::Rg32Sint => V::R32G32_SINT,
        Format::Rg32Float => V::R32G32_SFLOAT,
        Format::Rgba16Uint => V::R16G16B16A16_UINT,
        Format::Rgba16Sint => V::R16G16B16A16_SINT,
        Format::Rgba16Float => V::R16G16B16A16_SFLOAT,
        Format::Rgba32Uint => V::R32G32B32A32_UINT,
        Format::Rgba32Sint => V::R32G32B32A32_SINT,
        Format::Rgba32Float => V::R32G32B32A32_SFLOAT,
        Format::Depth16Unorm => V::D16_UNORM,
        Format::Depth32Float => V::D32_SFLOAT,
        _ => return None,
    })
}

/// Which part of its texels a format has.
pub(crate) const fn aspect(format: Format) -> vk::ImageAspectFlags {
    match format.sample_kind() {
        SampleKind::Depth => vk::ImageAspectFlags::DEPTH,
        SampleKind::Float | SampleKind::Sint | SampleKind::Uint => vk::ImageAspectFlags::COLOR,
    }
}

/// Mips and layers of a texture.
pub(crate) const fn range(format: Format, range: Subresources) -> vk::ImageSubresourceRange {
    vk::ImageSubresourceRange {
        aspect_mask: aspect(format),
        base_mip_level: range.mip,
        level_count: range.mips,
        base_array_layer: range.layer,
        layer_count: range.layers,
    }
}

/// Every mip and layer of a texture.
pub(crate) const fn whole(desc: &TextureDesc) -> Subresources {
    Subresources {
        mip: 0,
        mips: desc.mips,
        layer: 0,
        layers: desc.layers(),
    }
}

/// The size of one mip as copies count it: depth is 1 for layered textures.
pub(crate) const fn copy_extent(desc: &TextureDesc, mip: u32) -> vk::Extent3D {
    let extent = desc.mip_extent(mip);
    vk::Extent3D {
        width: extent.width,
        height: extent.height,
        depth: match desc.dimension {
            Dimension::D3 => extent.depth_or_layers,
            Dimension::D2 | Dimension::Cube => 1,
        },
    }
}

/// The layers of one mip within a run of them.
pub(crate) const fn layers(
    format: Format,
    range: Subresources,
    mip: u32,
) -> vk::ImageSubresourceLayers {
    vk::ImageSubresourceLayers {
        aspect_mask: aspect(format),
        mip_level: mip,
        base_array_layer: range.layer,
        layer_count: range.layers,
    }
}

/// The view a shader declares.
pub(crate) const fn view_type(dimension: ViewDimension) -> vk::ImageViewType {
    match dimension {
        ViewDimension::D2 => vk::ImageViewType::TYPE_2D,
        ViewDimension::D2Array => vk::ImageViewType::TYPE_2D_ARRAY,
        ViewDimension::Cube => vk::ImageViewType::CUBE,
        ViewDimension::CubeArray => vk::ImageViewType::CUBE_ARRAY,
        ViewDimension::D3 => vk::ImageViewType::TYPE_3D,
    }
}

/// The view that shows all of a texture as what it is.
pub(crate) const fn whole_view_type(desc: &TextureDesc) -> vk::ImageViewType {
    match (desc.dimension, desc.layers()) {
        (Dimension::D3, _) => vk::ImageViewType::TYPE_3D,
        (Dimension::Cube, 6) => vk::ImageViewType::CUBE,
        (Dimension::Cube, _) => vk::ImageViewType::CUBE_ARRAY,
        (Dimension::D2, 1) => vk::ImageViewType::TYPE_2D,
        (Dimension::D2, _) => vk::ImageViewType::TYPE_2D_ARRAY,
    }
}

/// A sampler; the level of detail is always explicit.
pub(crate) fn sampler(desc: &SamplerDesc) -> vk::SamplerCreateInfo<'static> {
    let filter = |filter| match filter {
        Filter::Nearest => vk::Filter::NEAREST,
        Filter::Linear => vk::Filter::LINEAR,
    };
    let mipmap = match desc.mip_filter {
        Filter::Nearest => vk::SamplerMipmapMode::NEAREST,
        Filter::Linear => vk::SamplerMipmapMode::LINEAR,
    };
    let [u, v, w] = desc.address.map(|address| match address {
        AddressMode::ClampToEdge => vk::SamplerAddressMode::CLAMP_TO_EDGE,
        AddressMode::Repeat => vk::SamplerAddressMode::REPEAT,
        AddressMode::MirrorRepeat => vk::SamplerAddressMode::MIRRORED_REPEAT,
    });
    let max_lod = if desc.lod.max == LodRange::ALL.max {
        vk::LOD_CLAMP_NONE
    } else {
        desc.lod.max_level()
    };
    let info = vk::SamplerCreateInfo::default()
        .mag_filter(filter(desc.mag_filter))
        .min_filter(filter(desc.min_filter))
        .mipmap_mode(mipmap)
        .address_mode_u(u)
        .address_mode_v(v)
        .address_mode_w(w)
        .min_lod(desc.lod.min_level())
        .max_lod(max_lod);
    match desc.compare {
        Some(compare) => info.compare_enable(true).compare_op(compare_op(compare)),
        None => info,
    }
}

pub(crate) const fn compare_op(compare: Compare) -> vk::CompareOp {
    match compare {
        Compare::Never => vk::CompareOp::NEVER,
        Compare::Less => vk::CompareOp::LESS,
        Compare::Equal => vk::CompareOp::EQUAL,
        Compare::LessEqual => vk::CompareOp::LESS_OR_EQUAL,
        Compare::Greater => vk::CompareOp::GREATER,
        Compare::NotEqual => vk::CompareOp::NOT_EQUAL,
        Compare::GreaterEqual => vk::CompareOp::GREATER_OR_EQUAL,
        Compare::Always => vk::CompareOp::ALWAYS,
    }
}

/// How the numbers of a vertex attribute are stored, or `None` for a format
/// that this backend does not know.
pub(crate) const fn vertex_format(format: VertexFormat) -> Option<vk::Format> {
    use VertexFormat as F;
    use vk::Format as V;
    Some(match format {
        F::Float32 => V::R32_SFLOAT,
        F::Float32x2 => V::R32G32_SFLOAT,
        F::Float32x3 => V::R32G32B32_SFLOAT,
        F::Float32x4 => V::R32G32B32A32_SFLOAT,
        F::Float16x2 => V::R16G16_SFLOAT,
        F::Float16x4 => V::R16G16B16A16_SFLOAT,
        F::Unorm8x2 => V::R8G8_UNORM,
        F::Unorm8x4 => V::R8G8B8A8_UNORM,
        F::Snorm8x4 => V::R8G8B8A8_SNORM,
        F::Unorm16x2 => V::R16G16_UNORM,
        F::Unorm16x4 => V::R16G16B16A16_UNORM,
        F::Snorm16x2 => V::R16G16_SNORM,
        F::Snorm16x4 => V::R16G16B16A16_SNORM,
        F::Uint8x4 => V::R8G8B8A8_UINT,
        F::Uint16x2 => V::R16G16_UINT,
        F::Uint16x4 => V::R16G16B16A16_UINT,
        F::Uint32 => V::R32_UINT,
        F::Uint32x2 => V::R32G32_UINT,
        F::Uint32x4 => V::R32G32B32A32_UINT,
        F::Sint32 => V::R32_SINT,
        F::Sint32x4 => V::R32G32B32A32_SINT,
        _ => return None,
    })
}

/// How indices are stored.
pub(crate) const fn index_type(format: IndexFormat) -> vk::IndexType {
    match format {
        IndexFormat::Uint16 => vk::IndexType::UINT16,
        IndexFormat::Uint32 => vk::IndexType::UINT32,
    }
}

/// How a draw writes one colour target.
pub(crate) fn target_state(target: &TargetState) -> vk::PipelineColorBlendAttachmentState {
    let ColourWrites {
        red,
        green,
        blue,
        alpha,
    } = target.writes;
    let writes = [
        (red, vk::ColorComponentFlags::R),
        (green, vk::ColorComponentFlags::G),
        (blue, vk::ColorComponentFlags::B),
        (alpha, vk::ColorComponentFlags::A),
    ]
    .into_iter()
    .filter(|(written, _)| *written)
    .fold(vk::ColorComponentFlags::empty(), |all, (_, flag)| {
        all | flag
    });
    let state = vk::PipelineColorBlendAttachmentState::default().color_write_mask(writes);
    match &target.blend {
        None => state,
        Some(Blend { colour, alpha }) => state
            .blend_enable(true)
            .src_color_blend_factor(blend_factor(colour.source))
            .dst_color_blend_factor(blend_factor(colour.target))
            .color_blend_op(blend_op(colour.operation))
            .src_alpha_blend_factor(blend_factor(alpha.source))
            .dst_alpha_blend_factor(blend_factor(alpha.target))
            .alpha_blend_op(blend_op(alpha.operation)),
    }
}

const fn blend_factor(factor: BlendFactor) -> vk::BlendFactor {
    match factor {
        BlendFactor::Zero => vk::BlendFactor::ZERO,
        BlendFactor::One => vk::BlendFactor::ONE,
        BlendFactor::Source => vk::BlendFactor::SRC_COLOR,
        BlendFactor::OneMinusSource => vk::BlendFactor::ONE_MINUS_SRC_COLOR,
        BlendFactor::SourceAlpha => vk::BlendFactor::SRC_ALPHA,
        BlendFactor::OneMinusSourceAlpha => vk::BlendFactor::ONE_MINUS_SRC_ALPHA,
        BlendFactor::Target => vk::BlendFactor::DST_COLOR,
        BlendFactor::OneMinusTarget => vk::BlendFactor::ONE_MINUS_DST_COLOR,
        BlendFactor::TargetAlpha => vk::BlendFactor::DST_ALPHA,
        BlendFactor::OneMinusTargetAlpha => vk::BlendFactor::ONE_MINUS_DST_ALPHA,
    }
}

const fn blend_op(operation: BlendOperation) -> vk::BlendOp {
    match operation {
        BlendOperation::Add => vk::BlendOp::ADD,
        BlendOperation::Subtract => vk::BlendOp::SUBTRACT,
        BlendOperation::ReverseSubtract => vk::BlendOp::REVERSE_SUBTRACT,
        BlendOperation::Min => vk::BlendOp::MIN,
        BlendOperation::Max => vk::BlendOp::MAX,
    }
}

/// A texture in words, for errors.
pub(crate) fn describe(desc: &TextureDesc) -> String {
    let extent = desc.extent;
    let (shape, third) = match desc.dimension {
        Dimension::D2 => ("2D", "layers"),
        Dimension::Cube => ("cube", "layers"),
        Dimension::D3 => ("3D", "slices"),
    };
    format!(
        "a {shape} {} texture of {}×{} texels, {} {third}, {} mips",
        desc.format, extent.width, extent.height, extent.depth_or_layers, desc.mips
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_format_has_a_distinct_name_in_vulkan() {
        let mut seen = std::collections::BTreeSet::new();
        for &known in Format::ALL {
            let vulkan = format(known);
            assert!(vulkan.is_some(), "{known} has no Vulkan format");
            assert!(
                seen.insert(vulkan.map(vk::Format::as_raw)),
                "{known} is given twice"
            );
        }
    }

    #[test]
    fn every_vertex_format_has_a_distinct_name_in_vulkan() {
        let mut seen = std::collections::BTreeSet::new();
        for &known in VertexFormat::ALL {
            let vulkan = vertex_format(known);
            assert!(vulkan.is_some(), "{known:?} has no Vulkan format");
            assert!(
                seen.insert(vulkan.map(vk::Format::as_raw)),
                "{known:?} is given twice"
            );
        }
    }

    #[test]
    fn depth_of_layered_textures_is_one() {
        let layered = TextureDesc {
            extent: etalon_core::resource::Extent {
                width: 8,
                height: 4,
                depth_or_layers: 6,
            },
            ..TextureDesc::d2(8, 4, Format::R8Unorm)
        };
        assert_eq!(copy_extent(&layered, 0).depth, 1);
        let deep = TextureDesc {
            dimension: Dimension::D3,
            ..layered
        };
        assert_eq!(copy_extent(&deep, 1).depth, 3);
    }
}
