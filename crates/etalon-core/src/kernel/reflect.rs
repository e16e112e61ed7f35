//! What a module binds.

use std::collections::BTreeMap;

use naga::valid::{FunctionInfo, ModuleInfo};
use naga::{
    AddressSpace, ArraySize, GlobalVariable, Handle, ImageClass, ImageDimension, Module, Scalar,
    ScalarKind, Span, StorageAccess, StorageFormat, Type, TypeInner,
};

use super::compile::Origin;
use super::error::KernelError;
use super::{
    Access, Binding, BindingKind, UniformLayout, UniformMember, UniformScalar, UniformType,
    ViewDimension,
};
use crate::Format;
use crate::format::SampleKind;

/// Checks that every resource says where it is bound, and each elsewhere.
///
/// Done before validation, whose messages about it name neither resource.
///
/// # Errors
/// At the first resource of which that is not so.
pub(super) fn check_places(module: &Module, origin: &Origin<'_>) -> Result<(), KernelError> {
    let mut taken: BTreeMap<u32, &str> = BTreeMap::new();
    let mut uniform: Option<&str> = None;
    for (handle, variable) in module.global_variables.iter() {
        if matches!(
            variable.space,
            AddressSpace::Private | AddressSpace::WorkGroup
        ) {
            continue;
        }
        let name = name(variable, origin);
        let refuse = |message: String| {
            let span = module.global_variables.get_span(handle);
            Err(KernelError::Interface(origin.diagnostic(span, &message)))
        };
        let Some(place) = variable.binding else {
            return refuse(format!(
                "`{name}` needs an explicit `@group(0) @binding(…)`"
            ));
        };
        if place.group != 0 {
            return refuse(format!(
                "`{name}` is in group {}; everything a kernel binds is in group 0",
                place.group
            ));
        }
        if let Some(other) = taken.insert(place.binding, name) {
            return refuse(format!(
                "`{name}` and `{other}` both have binding {}",
                place.binding
            ));
        }
        if variable.space == AddressSpace::Uniform
            && let Some(other) = uniform.replace(name)
        {
            return refuse(format!(
                "`{name}` and `{other}` are both uniform; a kernel has one uniform block"
            ));
        }
    }
    Ok(())
}

/// The bindings of the module's one entry point, by binding number.
///
/// # Errors
/// If a resource is of a kind that passes cannot fill.
pub(super) fn bindings(
    module: &Module,
    info: &ModuleInfo,
    origin: &Origin<'_>,
) -> Result<Vec<Binding>, KernelError> {
    let reflection = Reflection {
        module,
        functions: (0..module.entry_points.len())
            .map(|index| info.get_entry_point(index))
            .collect(),
        origin,
    };
    let mut found: Vec<Binding> = Vec::new();
    for (handle, variable) in module.global_variables.iter() {
        let Some(place) = variable.binding else {
            continue;
        };
        let name = name(variable, origin);
        let refuse = |reason: Reason| {
            let span = module.global_variables.get_span(handle);
            let message = format!("`{name}` {}", reason.message);
            KernelError::Interface(origin.diagnostic(reason.span.unwrap_or(span), &message))
        };
        // An imported file may have a variable of the same name as the kernel.
        if found.iter().any(|other| other.name == name) {
            return Err(refuse("is the name of two resources".to_owned().into()));
        }
        found.push(Binding {
            name: name.to_owned(),
            group: place.group,
            binding: place.binding,
            kind: reflection.kind(handle, variable).map_err(refuse)?,
        });
    }
    found.sort_by_key(|binding| binding.binding);
    Ok(found)
}

/// The name of a variable in its file.
fn name<'a>(variable: &'a GlobalVariable, origin: &'a Origin<'_>) -> &'a str {
    origin
        .names
        .original(variable.name.as_deref().unwrap_or_default())
}

/// Why something cannot be bound.
struct Reason {
    message: String,
    /// Where, if not at the variable.
    span: Option<Span>,
}

impl From<String> for Reason {
    fn from(message: String) -> Self {
        Self {
            message,
            span: None,
        }
    }
}

struct Reflection<'a> {
    module: &'a Module,
    /// The entry points'.
    functions: Vec<&'a FunctionInfo>,
    origin: &'a Origin<'a>,
}

impl Reflection<'_> {
    fn inner(&self, ty: Handle<Type>) -> &TypeInner {
        &self.module.types[ty].inner
    }

    fn kind(
        &self,
        handle: Handle<GlobalVariable>,
        variable: &GlobalVariable,
    ) -> Result<BindingKind, Reason> {
        match variable.space {
            AddressSpace::Uniform => self.uniform(variable.ty).map(BindingKind::Uniform),
            AddressSpace::Storage { access } => Ok(BindingKind::StorageBuffer {
                access: storage_access(access).ok_or_else(|| "has no access".to_owned())?,
                min_size: self
                    .inner(variable.ty)
                    .try_size(self.module.to_ctx())
                    .ok_or_else(|| "is too large".to_owned())?
                    .into(),
            }),
            _ => self.opaque(handle, variable),
        }
    }

    /// Textures and samplers.
    fn opaque(
        &self,
        handle: Handle<GlobalVariable>,
        variable: &GlobalVariable,
    ) -> Result<BindingKind, Reason> {
        let (dim, arrayed, class) = match *self.inner(variable.ty) {
            TypeInner::Sampler { comparison } => return Ok(BindingKind::Sampler { comparison }),
            TypeInner::Image {
                dim,
                arrayed,
                class,
            } => (dim, arrayed, class),
            _ => {
                return Err("is neither a texture, a sampler nor a buffer"
                    .to_owned()
                    .into());
            }
        };
        let dimension = match (dim, arrayed) {
            (ImageDimension::D2, false) => ViewDimension::D2,
            (ImageDimension::D2, true) => ViewDimension::D2Array,
            (ImageDimension::Cube, false) => ViewDimension::Cube,
            (ImageDimension::Cube, true) => ViewDimension::CubeArray,
            (ImageDimension::D3, _) => ViewDimension::D3,
            (ImageDimension::D1, _) => {
                return Err("is a 1D texture; passes have 2D, cube and 3D ones"
                    .to_owned()
                    .into());
            }
        };
        let kind = match class {
            ImageClass::Sampled { multi: true, .. } | ImageClass::Depth { multi: true } => {
                return Err("is multisampled; passes have textures of one sample"
                    .to_owned()
                    .into());
            }
            ImageClass::External => {
                return Err("is an external texture, which passes do not have"
                    .to_owned()
                    .into());
            }
            ImageClass::Storage { format, access } => {
                return Ok(BindingKind::StorageTexture {
                    dimension,
                    format: storage_format(format).ok_or_else(|| {
                        format!("has the texel format {format:?}, which textures do not have")
                    })?,
                    access: storage_access(access).ok_or_else(|| {
                        "is accessed by atomics, which textures do not allow".to_owned()
                    })?,
                });
            }
            ImageClass::Depth { multi: false } => SampleKind::Depth,
            ImageClass::Sampled { kind, multi: false } => match kind {
                ScalarKind::Sint => SampleKind::Sint,
                ScalarKind::Uint => SampleKind::Uint,
                _ => SampleKind::Float,
            },
        };
        // A comparison sampler filters comparison results, not texels.
        let mut pairs = self.functions.iter().flat_map(|f| f.sampling_set.iter());
        let filtered = pairs.any(|pair| {
            let sampler = self.module.global_variables[pair.sampler].ty;
            pair.image == handle
                && matches!(
                    self.inner(sampler),
                    TypeInner::Sampler { comparison: false }
                )
        });
        Ok(BindingKind::Texture {
            dimension,
            kind,
            filtered,
        })
    }

    fn uniform(&self, ty: Handle<Type>) -> Result<UniformLayout, Reason> {
        let TypeInner::Struct { members, span } = self.inner(ty) else {
            return Err(
                "is uniform but no structure; uniforms are set by member name"
                    .to_owned()
                    .into(),
            );
        };
        let members = members
            .iter()
            .map(|member| {
                let name = member.name.clone().unwrap_or_default();
                let ty = self.uniform_type(member.ty).map_err(|message| Reason {
                    message: format!("has a member `{name}` that is {message}"),
                    span: self.member_span(ty, &name),
                })?;
                Ok(UniformMember {
                    name,
                    offset: member.offset,
                    ty,
                })
            })
            .collect::<Result<_, Reason>>()?;
        Ok(UniformLayout {
            size: *span,
            members,
        })
    }

    /// Where a member stands. naga keeps only the place of the structure, so
    /// its text is searched for the name.
    fn member_span(&self, ty: Handle<Type>, name: &str) -> Option<Span> {
        let structure = self.module.types.get_span(ty).to_range()?;
        let text = self.origin.map.generated().get(structure.clone())?;
        let body = text.find('{')?;
        let at = structure.start + body + super::scan::find_word(text.get(body..)?, name)?;
        Some(Span::from(at..at + name.len()))
    }

    fn uniform_type(&self, ty: Handle<Type>) -> Result<UniformType, String> {
        match *self.inner(ty) {
            TypeInner::Scalar(scalar) => uniform_scalar(scalar).map(UniformType::Scalar),
            TypeInner::Vector { size, scalar } => Ok(UniformType::Vector {
                scalar: uniform_scalar(scalar)?,
                size: size as u32,
            }),
            TypeInner::Matrix { scalar, .. } if scalar != Scalar::F32 => {
                Err("a matrix of something other than f32".to_owned())
            }
            TypeInner::Matrix { columns, rows, .. } => Ok(UniformType::Matrix {
                columns: columns as u32,
                rows: rows as u32,
                // WGSL §14.4.1: columns are aligned as vectors of their size.
                stride: if rows as u32 == 2 { 8 } else { 16 },
            }),
            TypeInner::Array { base, size, stride } => {
                let ArraySize::Constant(count) = size else {
                    return Err("an array whose size is not constant".to_owned());
                };
                if let TypeInner::Array { .. } = self.inner(base) {
                    return Err("an array of arrays; use one array".to_owned());
                }
                Ok(UniformType::Array {
                    element: Box::new(self.uniform_type(base)?),
                    count: count.get(),
                    stride,
                })
            }
            TypeInner::Struct { .. } => Err("a structure; list its members instead".to_owned()),
            _ => Err("of a type that uniforms do not have".to_owned()),
        }
    }
}

fn uniform_scalar(scalar: Scalar) -> Result<UniformScalar, String> {
    match scalar {
        Scalar::F32 => Ok(UniformScalar::F32),
        Scalar::I32 => Ok(UniformScalar::I32),
        Scalar::U32 => Ok(UniformScalar::U32),
        _ => Err("of a scalar other than f32, i32 and u32".to_owned()),
    }
}

fn storage_access(access: StorageAccess) -> Option<Access> {
    if access.contains(StorageAccess::ATOMIC) {
        return None;
    }
    match (
        access.contains(StorageAccess::LOAD),
        access.contains(StorageAccess::STORE),
    ) {
        (true, true) => Some(Access::ReadWrite),
        (true, false) => Some(Access::Read),
        (false, true) => Some(Access::Write),
        (false, false) => None,
    }
}

fn storage_format(format: StorageFormat) -> Option<Format> {
    Some(match format {
        StorageFormat::R8Unorm => Format::R8Unorm,
        StorageFormat::R8Snorm => Format::R8Snorm,
        StorageFormat::R8Uint => Format::R8Uint,
        StorageFormat::R8Sint => Format::R8Sint,
        StorageFormat::R16Uint => Format::R16Uint,
        StorageFormat::R16Sint => Format::R16Sint,
        StorageFormat::R16Float => Format::R16Float,
        StorageFormat::Rg8Unorm => Format::Rg8Unorm,
        StorageFormat::Rg8Snorm => Format::Rg8Snorm,
        StorageFormat::Rg8Uint => Format::Rg8Uint,
        StorageFormat::Rg8Sint => Format::Rg8Sint,
        StorageFormat::R32Uint => Format::R32Uint,
        StorageFormat::R32Sint => Format::R32Sint,
        StorageFormat::R32Float => Format::R32Float,
        StorageFormat::Rg16Uint => Format::Rg16Uint,
        StorageFormat::Rg16Sint => Format::Rg16Sint,
        StorageFormat::Rg16Float => Format::Rg16Float,
        StorageFormat::Rgba8Unorm => Format::Rgba8Unorm,
        StorageFormat::Rgba8Snorm => Format::Rgba8Snorm,
        StorageFormat::Rgba8Uint => Format::Rgba8Uint,
        StorageFormat::Rgba8Sint => Format::Rgba8Sint,
        StorageFormat::Bgra8Unorm => Format::Bgra8Unorm,
        StorageFormat::Rgb10a2Unorm => Format::Rgb10a2Unorm,
        StorageFormat::Rg11b10Ufloat => Format::Rg11b10Ufloat,
        StorageFormat::Rg32Uint => Format::Rg32Uint,
        StorageFormat::Rg32Sint => Format::Rg32Sint,
        StorageFormat::Rg32Float => Format::Rg32Float,
        StorageFormat::Rgba16Uint => Format::Rgba16Uint,
        StorageFormat::Rgba16Sint => Format::Rgba16Sint,
        StorageFormat::Rgba16Float => Format::Rgba16Float,
        StorageFormat::Rgba32Uint => Format::Rgba32Uint,
        StorageFormat::Rgba32Sint => Format::Rgba32Sint,
        StorageFormat::Rgba32Float => Format::Rgba32Float,
        StorageFormat::Rgb10a2Uint
        | StorageFormat::R64Uint
        | StorageFormat::R16Unorm
        | StorageFormat::R16Snorm
        | StorageFormat::Rg16Unorm
        | StorageFormat::Rg16Snorm
        | StorageFormat::Rgba16Unorm
        | StorageFormat::Rgba16Snorm => return None,
    })
}
