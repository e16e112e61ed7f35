//! Etalon's descriptions in wgpu's words.

use etalon_core::Format;
use etalon_core::graph::Subresources;
use etalon_core::kernel::{Access, ViewDimension};
use etalon_core::plan::{Usage, UsageSet};
use etalon_core::resource::{AddressMode, Compare, Dimension, Filter, SamplerDesc, TextureDesc};

/// wgpu's name of a format, if it has one.
pub(crate) const fn format(format: Format) -> Option<wgpu::TextureFormat> {
    use wgpu::TextureFormat as T;
    Some(match format {
        Format::R8Unorm => T::R8Unorm,
        Format::R8Snorm => T::R8Snorm,
        Format::R8Uint => T::R8Uint,
        Format::R8Sint => T::R8Sint,
        Format::R16Uint => T::R16Uint,
        Format::R16Sint => T::R16Sint,
        Format::R16Float => T::R16Float,
        Format::Rg8Unorm => T::Rg8Unorm,
        Format::Rg8Snorm => T::Rg8Snorm,
        Format::Rg8Uint => T::Rg8Uint,
        Format::Rg8Sint => T::Rg8Sint,
        Format::R32Uint => T::R32Uint,
        Format::R32Sint => T::R32Sint,
        Format::R32Float => T::R32Float,
        Format::Rg16Uint => T::Rg16Uint,
        Format::Rg16Sint => T::Rg16Sint,
        Format::Rg16Float => T::Rg16Float,
        Format::Rgba8Unorm => T::Rgba8Unorm,
        Format::Rgba8UnormSrgb => T::Rgba8UnormSrgb,
        Format::Rgba8Snorm => T::Rgba8Snorm,
        Format::Rgba8Uint => T::Rgba8Uint,
        Format::Rgba8Sint => T::Rgba8Sint,
        Format::Bgra8Unorm => T::Bgra8Unorm,
        Format::Rgb9e5Ufloat => T::Rgb9e5Ufloat,
        Format::Rgb10a2Unorm => T::Rgb10a2Unorm,
        Format::Rg11b10Ufloat => T::Rg11b10Ufloat,
        Format::Rg32Uint => T::Rg32Uint,
        Format::Rg32Sint => T::Rg32Sint,
        Format::Rg32Float => T::Rg32Float,
        Format::Rgba16Uint => T::Rgba16Uint,
        Format::Rgba16Sint => T::Rgba16Sint,
        Format::Rgba16Float => T::Rgba16Float,
        Format::Rgba32Uint => T::Rgba32Uint,
        Format::Rgba32Sint => T::Rgba32Sint,
        Format::Rgba32Float => T::Rgba32Float,
        Format::Depth16Unorm => T::Depth16Unorm,
        Format::Depth32Float => T::Depth32Float,
        _ => return None,
    })
}

/// Whether an engine's texture of format `given` can be read as `wanted`.
///
/// A depth buffer with stencil, or of unspecified precision, can be read like a
/// float one, but neither copied nor written.
pub(crate) fn reads_as(given: wgpu::TextureFormat, wanted: wgpu::TextureFormat) -> bool {
    use wgpu::TextureFormat as T;
    wanted == T::Depth32Float
        && matches!(
            given,
            T::Depth24Plus | T::Depth24PlusStencil8 | T::Depth32FloatStencil8
        )
}

/// The part of a texture that views and copies mean: all of it, or the depth.
pub(crate) fn aspect(format: wgpu::TextureFormat) -> wgpu::TextureAspect {
    if format.has_stencil_aspect() && format.has_depth_aspect() {
        wgpu::TextureAspect::DepthOnly
    } else {
        wgpu::TextureAspect::All
    }
}

/// What a texture used in these ways must allow.
pub(crate) fn texture_usages(usages: UsageSet, format: Format) -> wgpu::TextureUsages {
    use wgpu::TextureUsages as T;
    usages.iter().fold(T::empty(), |sum, usage| {
        sum | match usage {
            Usage::Sampled => T::TEXTURE_BINDING,
            Usage::StorageRead | Usage::StorageWrite | Usage::StorageUpdate => T::STORAGE_BINDING,
            Usage::CopySource => T::COPY_SRC,
            // WebGPU copies into float depth only from float depth; clearing it
            // takes a render pass.
            Usage::CopyTarget if format == Format::Depth32Float => {
                T::COPY_DST | T::RENDER_ATTACHMENT
            }
            Usage::CopyTarget => T::COPY_DST,
            Usage::ColourTarget | Usage::DepthTarget => T::RENDER_ATTACHMENT,
            Usage::Indirect | Usage::Vertices | Usage::Indices => T::empty(),
        }
    })
}

/// What a buffer used in these ways must allow.
pub(crate) fn buffer_usages(usages: UsageSet) -> wgpu::BufferUsages {
    use wgpu::BufferUsages as B;
    usages.iter().fold(B::empty(), |sum, usage| {
        sum | match usage {
            Usage::Sampled | Usage::StorageRead | Usage::StorageWrite | Usage::StorageUpdate => {
                B::STORAGE
            }
            Usage::CopySource => B::COPY_SRC,
            Usage::CopyTarget => B::COPY_DST,
            Usage::Indirect => B::INDIRECT,
            Usage::Vertices => B::VERTEX,
            Usage::Indices => B::INDEX,
            Usage::ColourTarget | Usage::DepthTarget => B::empty(),
        }
    })
}

/// 2D with layers, or 3D: cubes are views of layers.
pub(crate) const fn texture_dimension(dimension: Dimension) -> wgpu::TextureDimension {
    match dimension {
        Dimension::D2 | Dimension::Cube => wgpu::TextureDimension::D2,
        Dimension::D3 => wgpu::TextureDimension::D3,
    }
}

/// The shape of a kernel's view.
pub(crate) const fn view_dimension(dimension: ViewDimension) -> wgpu::TextureViewDimension {
    match dimension {
        ViewDimension::D2 => wgpu::TextureViewDimension::D2,
        ViewDimension::D2Array => wgpu::TextureViewDimension::D2Array,
        ViewDimension::Cube => wgpu::TextureViewDimension::Cube,
        ViewDimension::CubeArray => wgpu::TextureViewDimension::CubeArray,
        ViewDimension::D3 => wgpu::TextureViewDimension::D3,
    }
}

/// The size of a mip, with all layers.
pub(crate) const fn extent(desc: &TextureDesc, mip: u32) -> wgpu::Extent3d {
    let extent = desc.mip_extent(mip);
    wgpu::Extent3d {
        width: extent.width,
        height: extent.height,
        depth_or_array_layers: extent.depth_or_layers,
    }
}

/// The size of a mip, with the depth or layers that a range covers.
pub(crate) fn copy_extent(desc: &TextureDesc, mip: u32, range: Subresources) -> wgpu::Extent3d {
    let whole = extent(desc, mip);
    match desc.dimension {
        Dimension::D3 => whole,
        Dimension::D2 | Dimension::Cube => wgpu::Extent3d {
            depth_or_array_layers: range.layers,
            ..whole
        },
    }
}

/// What a kernel may do with a storage texture.
pub(crate) const fn storage_access(access: Access) -> wgpu::StorageTextureAccess {
    match access {
        Access::Read => wgpu::StorageTextureAccess::ReadOnly,
        Access::Write => wgpu::StorageTextureAccess::WriteOnly,
        Access::ReadWrite => wgpu::StorageTextureAccess::ReadWrite,
    }
}

/// A sampler. Without mip filtering the nearest mip is taken.
pub(crate) fn sampler(desc: &SamplerDesc) -> wgpu::SamplerDescriptor<'static> {
    let [u, v, w] = desc.address.map(|address| match address {
        AddressMode::ClampToEdge => wgpu::AddressMode::ClampToEdge,
        AddressMode::Repeat => wgpu::AddressMode::Repeat,
        AddressMode::MirrorRepeat => wgpu::AddressMode::MirrorRepeat,
    });
    let filter = |filter| match filter {
        Filter::Nearest => wgpu::FilterMode::Nearest,
        Filter::Linear => wgpu::FilterMode::Linear,
    };
    wgpu::SamplerDescriptor {
        label: Some("etalon sampler"),
        address_mode_u: u,
        address_mode_v: v,
        address_mode_w: w,
        mag_filter: filter(desc.mag_filter),
        min_filter: filter(desc.min_filter),
        mipmap_filter: match desc.mip_filter {
            Filter::Nearest => wgpu::MipmapFilterMode::Nearest,
            Filter::Linear => wgpu::MipmapFilterMode::Linear,
        },
        lod_min_clamp: desc.lod.min_level(),
        lod_max_clamp: desc.lod.max_level(),
        compare: desc.compare.map(compare),
        ..wgpu::SamplerDescriptor::default()
    }
}

pub(crate) const fn compare(compare: Compare) -> wgpu::CompareFunction {
    match compare {
        Compare::Never => wgpu::CompareFunction::Never,
        Compare::Less => wgpu::CompareFunction::Less,
        Compare::Equal => wgpu::CompareFunction::Equal,
        Compare::LessEqual => wgpu::CompareFunction::LessEqual,
        Compare::Greater => wgpu::CompareFunction::Greater,
        Compare::NotEqual => wgpu::CompareFunction::NotEqual,
        Compare::GreaterEqual => wgpu::CompareFunction::GreaterEqual,
        Compare::Always => wgpu::CompareFunction::Always,
    }
}
