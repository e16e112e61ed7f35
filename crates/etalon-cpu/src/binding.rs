//! What a kernel needs bound.

use naga::{
    AddressSpace, GlobalVariable, ImageClass, ImageDimension, Module, ScalarKind, StorageAccess,
    StorageFormat, TypeInner,
};

use etalon_core::Format;

use crate::translate::Fail;

/// One resource variable of a program.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct BindingInfo {
    /// The variable's name.
    pub name: String,
    /// `@group`.
    pub group: u32,
    /// `@binding`.
    pub binding: u32,
    /// What it takes.
    pub kind: BindingKind,
}

/// What a resource variable takes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BindingKind {
    /// A uniform block of this many bytes.
    Uniform {
        /// Bytes.
        size: u32,
    },
    /// A storage buffer of at least this many bytes.
    Storage {
        /// Bytes, with one element of a runtime-sized array.
        min_size: u32,
        /// Whether the kernel may write it.
        writable: bool,
    },
    /// A texture that is read.
    Texture {
        /// How it is addressed.
        view: View,
        /// What its channels are read as.
        kind: ChannelKind,
    },
    /// A texture that is stored to.
    StorageTexture {
        /// How it is addressed.
        view: View,
        /// Its format.
        format: Format,
        /// Whether the kernel may write it.
        writable: bool,
    },
    /// A sampler.
    Sampler {
        /// Whether it compares depth.
        comparison: bool,
    },
}

/// How a texture is addressed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum View {
    /// One dimension: a two-dimensional texture of height 1.
    D1,
    /// Two dimensions.
    D2,
    /// Two dimensions and a layer.
    D2Array,
    /// Three dimensions.
    D3,
    /// A direction.
    Cube,
    /// A direction and a cube.
    CubeArray,
}

/// What channels are read as.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ChannelKind {
    /// `f32`, depth included.
    Float,
    /// `i32`.
    Sint,
    /// `u32`.
    Uint,
}

impl BindingInfo {
    /// Whether the kernel may write what is bound.
    #[must_use]
    pub fn is_writable(&self) -> bool {
        matches!(
            self.kind,
            BindingKind::Storage { writable: true, .. }
                | BindingKind::StorageTexture { writable: true, .. }
        )
    }
}

/// What textures of several samples are called in errors.
pub(crate) const MULTISAMPLED: &str =
    "multisampled textures: the textures of an effect have one sample per texel";

/// The layout of a resource variable.
pub(crate) fn describe_binding(
    module: &Module,
    global: &GlobalVariable,
) -> Result<BindingInfo, Fail> {
    let name = global
        .name
        .clone()
        .unwrap_or_else(|| "(unnamed)".to_owned());
    let Some(binding) = global.binding else {
        return Err(Fail::invalid(format!(
            "the resource `{name}` has no @group and @binding"
        )));
    };
    let ty = &module.types[global.ty].inner;
    let kind = match (global.space, ty) {
        (AddressSpace::Uniform, _) => BindingKind::Uniform {
            size: ty.size(module.to_ctx()),
        },
        // naga counts one element of a runtime-sized array.
        (AddressSpace::Storage { access }, _) => BindingKind::Storage {
            min_size: ty.size(module.to_ctx()),
            writable: access.contains(StorageAccess::STORE),
        },
        (_, &TypeInner::Sampler { comparison }) => BindingKind::Sampler { comparison },
        (
            _,
            &TypeInner::Image {
                dim,
                arrayed,
                class,
            },
        ) => {
            let view = match (dim, arrayed) {
                (ImageDimension::D2, false) => View::D2,
                (ImageDimension::D2, true) => View::D2Array,
                (ImageDimension::D3, _) => View::D3,
                (ImageDimension::Cube, false) => View::Cube,
                (ImageDimension::Cube, true) => View::CubeArray,
                (ImageDimension::D1, _) => View::D1,
            };
            match class {
                ImageClass::Sampled { multi: true, .. } | ImageClass::Depth { multi: true } => {
                    return Err(Fail::unsupported(MULTISAMPLED));
                }
                ImageClass::Sampled { kind, .. } => BindingKind::Texture {
                    view,
                    kind: match kind {
                        ScalarKind::Sint => ChannelKind::Sint,
                        ScalarKind::Uint => ChannelKind::Uint,
                        _ => ChannelKind::Float,
                    },
                },
                ImageClass::Depth { .. } => BindingKind::Texture {
                    view,
                    kind: ChannelKind::Float,
                },
                ImageClass::External => return Err(Fail::unsupported("external textures")),
                ImageClass::Storage { format, access } => BindingKind::StorageTexture {
                    view,
                    format: storage_format(format)?,
                    writable: access.contains(StorageAccess::STORE),
                },
            }
        }
        (_, TypeInner::AccelerationStructure { .. }) => {
            return Err(Fail::unsupported("ray queries"));
        }
        (_, TypeInner::BindingArray { .. }) => {
            return Err(Fail::unsupported("arrays of resources"));
        }
        _ => return Err(Fail::unsupported(format!("resources like `{name}`"))),
    };
    Ok(BindingInfo {
        name,
        group: binding.group,
        binding: binding.binding,
        kind,
    })
}

fn storage_format(format: StorageFormat) -> Result<Format, Fail> {
    use StorageFormat as S;
    Ok(match format {
        S::R8Unorm => Format::R8Unorm,
        S::R8Snorm => Format::R8Snorm,
        S::R8Uint => Format::R8Uint,
        S::R8Sint => Format::R8Sint,
        S::R16Uint => Format::R16Uint,
        S::R16Sint => Format::R16Sint,
        S::R16Float => Format::R16Float,
        S::Rg8Unorm => Format::Rg8Unorm,
        S::Rg8Snorm => Format::Rg8Snorm,
        S::Rg8Uint => Format::Rg8Uint,
        S::Rg8Sint => Format::Rg8Sint,
        S::R32Uint => Format::R32Uint,
        S::R32Sint => Format::R32Sint,
        S::R32Float => Format::R32Float,
        S::Rg16Uint => Format::Rg16Uint,
        S::Rg16Sint => Format::Rg16Sint,
        S::Rg16Float => Format::Rg16Float,
        S::Rgba8Unorm => Format::Rgba8Unorm,
        S::Rgba8Snorm => Format::Rgba8Snorm,
        S::Rgba8Uint => Format::Rgba8Uint,
        S::Rgba8Sint => Format::Rgba8Sint,
        S::Bgra8Unorm => Format::Bgra8Unorm,
        S::Rgb10a2Unorm => Format::Rgb10a2Unorm,
        S::Rg11b10Ufloat => Format::Rg11b10Ufloat,
        S::Rg32Uint => Format::Rg32Uint,
        S::Rg32Sint => Format::Rg32Sint,
        S::Rg32Float => Format::Rg32Float,
        S::Rgba16Uint => Format::Rgba16Uint,
        S::Rgba16Sint => Format::Rgba16Sint,
        S::Rgba16Float => Format::Rgba16Float,
        S::Rgba32Uint => Format::Rgba32Uint,
        S::Rgba32Sint => Format::Rgba32Sint,
        S::Rgba32Float => Format::Rgba32Float,
        other => {
            return Err(Fail::unsupported(format!(
                "storage textures of format {other:?}"
            )));
        }
    })
}
