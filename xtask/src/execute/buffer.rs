//! Buffers as images, so that one comparison serves both.

use etalon_core::Format;
use etalon_core::image::{ImageData, ImageError};
use etalon_core::plan::{Plan, Step};
use etalon_core::resource::TextureDesc;
use naga::{ScalarKind, TypeInner};

/// A buffer as an image of one row of 32-bit numbers. Bytes beyond a multiple
/// of four are padded with zeros.
///
/// # Errors
/// If the buffer is empty or too large for an image.
pub(super) fn as_image(mut bytes: Vec<u8>, format: Format) -> Result<ImageData, ImageError> {
    bytes.resize(bytes.len().next_multiple_of(4), 0);
    let words = u32::try_from(bytes.len() / 4).unwrap_or(u32::MAX);
    ImageData::from_bytes(TextureDesc::d2(words, 1, format), bytes)
}

/// What a buffer that a pass wrote consists of, by the type the kernel gives
/// it: floats, signed integers, or, where it is a mixture, unsigned integers,
/// which compares bits.
#[must_use]
pub(super) fn format_of(plan: &Plan, pass: &str, binding: &str) -> Format {
    let kernel = plan.steps.iter().find_map(|step| match &step.step {
        Step::Dispatch { kernel, .. } if step.name == pass => Some(&kernel.0.module),
        _ => None,
    });
    let variable = kernel.and_then(|module| {
        let mut variables = module.global_variables.iter();
        Some((
            module,
            variables
                .find(|(_, variable)| variable.name.as_deref() == Some(binding))?
                .1
                .ty,
        ))
    });
    match variable.and_then(|(module, ty)| scalar_of(module, ty)) {
        Some(ScalarKind::Float) => Format::R32Float,
        Some(ScalarKind::Sint) => Format::R32Sint,
        _ => Format::R32Uint,
    }
}

/// The one kind of 32-bit scalar a type consists of; `None` for a mixture.
fn scalar_of(module: &naga::Module, ty: naga::Handle<naga::Type>) -> Option<ScalarKind> {
    match &module.types[ty].inner {
        TypeInner::Scalar(scalar)
        | TypeInner::Atomic(scalar)
        | TypeInner::Vector { scalar, .. }
        | TypeInner::Matrix { scalar, .. } => (scalar.width == 4).then_some(scalar.kind),
        TypeInner::Array { base, .. } => scalar_of(module, *base),
        TypeInner::Struct { members, .. } => {
            let mut kinds = members.iter().map(|member| scalar_of(module, member.ty));
            let first = kinds.next()??;
            kinds.all(|kind| kind == Some(first)).then_some(first)
        }
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn buffers_become_rows_of_words() {
        let image = as_image(vec![1, 0, 0, 0, 2, 0], Format::R32Uint).unwrap();
        assert_eq!(image.desc, TextureDesc::d2(2, 1, Format::R32Uint));
        assert_eq!(image.bytes, [1, 0, 0, 0, 2, 0, 0, 0]);
        assert!(as_image(Vec::new(), Format::R32Uint).is_err());
    }

    #[test]
    fn the_kind_of_scalar_is_found_through_arrays_and_structs() {
        let text = "struct Sums { count: atomic<u32>, bins: array<u32, 4> }
            struct State { exposure: f32, history: array<vec4f, 2> }
            struct Mixed { index: u32, weight: f32 }
            @group(0) @binding(0) var<storage, read_write> sums: Sums;
            @group(0) @binding(1) var<storage, read_write> states: array<State>;
            @group(0) @binding(2) var<storage, read_write> mixed: Mixed;
            @group(0) @binding(3) var<storage, read_write> signed: array<vec2i>;";
        let module = naga::front::wgsl::parse_str(text).unwrap();
        let kinds: Vec<_> = module
            .global_variables
            .iter()
            .map(|(_, variable)| scalar_of(&module, variable.ty))
            .collect();
        assert_eq!(
            kinds,
            [
                Some(ScalarKind::Uint),
                Some(ScalarKind::Float),
                None,
                Some(ScalarKind::Sint)
            ]
        );
    }
}
