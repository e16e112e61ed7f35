//! Kernels as SPIR-V.

use naga::back::spv;
use naga::proc::{BoundsCheckPolicies, BoundsCheckPolicy};

use super::error::KernelError;
use super::{Arithmetic, Kernel, Need};

/// How a kernel is translated to SPIR-V.
///
/// The default gives every access a defined result, whatever the kernel
/// computes as an index.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct SpirvOptions {
    /// What happens to indices out of range.
    ///
    /// By default indices into vectors, matrices, arrays and buffers are
    /// clamped to the last element (`Restrict`), loads from texels that do not
    /// exist give zeros, and stores to them do nothing (`ReadZeroSkipWrite`).
    /// WGSL §15.8 allows this and more; this much is what the interpreter
    /// does.
    pub bounds_checks: BoundsCheckPolicies,
    /// Whether loops count their iterations, and end after 2⁶⁴.
    ///
    /// Without, a loop that never ends is undefined behaviour, which a
    /// compiler may take as leave to drop bounds checks. It changes nothing
    /// about loops that end but their speed, so it is off by default; switch
    /// it on for kernels from people you do not trust.
    pub bounded_loops: bool,
    /// Whether names are kept, for capture tools.
    pub names: bool,
}

impl Default for SpirvOptions {
    fn default() -> Self {
        Self {
            bounds_checks: BoundsCheckPolicies {
                index: BoundsCheckPolicy::Restrict,
                buffer: BoundsCheckPolicy::Restrict,
                image_load: BoundsCheckPolicy::ReadZeroSkipWrite,
                binding_array: BoundsCheckPolicy::Restrict,
            },
            bounded_loops: false,
            names: true,
        }
    }
}

/// SPIR-V 1.3 is the newest that needs nothing beyond Vulkan 1.1.
const VERSION: (u8, u8) = (1, 3);

/// What a module may ask of a device: Vulkan's core, read-only and write-only
/// storage in the formats beyond WebGPU's (`shaderStorageImageExtendedFormats`)
/// and cube arrays (`imageCubeArray`). naga spells out what else it would use
/// shortcuts for. Kernels that need `f16` ask for `shaderFloat16`, and for
/// `storageBuffer16BitAccess` where a buffer holds any.
const CAPABILITIES: [spv::Capability; 9] = [
    spv::Capability::Shader,
    // Coarse and fine derivatives, which all of Vulkan has.
    spv::Capability::DerivativeControl,
    spv::Capability::Matrix,
    spv::Capability::ImageQuery,
    spv::Capability::StorageImageExtendedFormats,
    // `bgra8unorm` has no SPIR-V name.
    spv::Capability::StorageImageWriteWithoutFormat,
    spv::Capability::SampledCubeArray,
    spv::Capability::ImageCubeArray,
    spv::Capability::Float16,
];

/// The floating-point instructions that drivers may contract, which SPIR-V
/// lets them do unless the result is decorated: `OpFNegate`, `OpFAdd`,
/// `OpFSub`, `OpFMul`, `OpFDiv`, `OpFRem`, `OpFMod` and the products of
/// vectors and matrices.
pub const NO_CONTRACTION_OPCODES: [u16; 14] = [
    127, 129, 131, 133, 136, 140, 141, 142, 143, 144, 145, 146, 147, 148,
];

/// Translates one stage of a kernel to SPIR-V with one entry point.
///
/// Positions are as WGSL has them, +Y up: the viewport turns them over.
///
/// Descriptor sets and bindings are WGSL's groups and bindings. Workgroup
/// memory is zeroed by the shader itself, with a barrier behind it, since
/// letting the driver do it takes a device feature. Integer division by zero
/// and overflowing division have WGSL's results. Under
/// [`Arithmetic::Strict`], and only then, every floating-point operation that
/// could be contracted is decorated with `NoContraction`.
///
/// # Errors
/// [`KernelError::Spirv`] if the kernel needs what SPIR-V for these devices
/// does not have.
pub fn spirv(
    kernel: &Kernel,
    stage: naga::ShaderStage,
    options: &SpirvOptions,
) -> Result<Vec<u32>, KernelError> {
    let fail = |message: String| KernelError::Spirv {
        kernel: kernel.name.clone(),
        message,
    };
    let mut flags = spv::WriterFlags::empty();
    flags.set(spv::WriterFlags::DEBUG, options.names);
    let binding_map = kernel.bindings.iter().map(|binding| {
        let place = naga::ResourceBinding {
            group: binding.group,
            binding: binding.binding,
        };
        let info = spv::BindingInfo {
            descriptor_set: binding.group,
            binding: binding.binding,
            binding_array_size: None,
        };
        (place, info)
    });
    let writer = spv::Options {
        lang_version: VERSION,
        flags,
        fake_missing_bindings: false,
        binding_map: binding_map.collect(),
        capabilities: Some(CAPABILITIES.into_iter().collect()),
        bounds_check_policies: options.bounds_checks,
        zero_initialize_workgroup_memory: spv::ZeroInitializeWorkgroupMemoryMode::Polyfill,
        force_loop_bounding: options.bounded_loops,
        emit_int_div_checks: true,
        // Stages have no inputs and outputs of `f16`.
        use_storage_input_output_16: false,
        debug_info: None,
        ..spv::Options::default()
    };
    let entries = &kernel.module.entry_points;
    let entry = entries.iter().find(|entry| entry.stage == stage);
    let entry =
        entry.ok_or_else(|| fail(format!("it has no entry point of the stage {stage:?}")))?;
    let pipeline = spv::PipelineOptions {
        shader_stage: stage,
        entry_point: entry.name.clone(),
    };
    let mut words = spv::write_vec(&kernel.module, &kernel.info, &writer, Some(&pipeline))
        .map_err(|error| fail(error.to_string()))?;
    drop_unused_access(&mut words, kernel).map_err(|reason| fail(reason.to_owned()))?;
    if kernel.arithmetic == Arithmetic::Strict {
        forbid_contraction(&mut words).map_err(|reason| fail(reason.to_owned()))?;
    }
    Ok(words)
}

/// Words before the first instruction (SPIR-V §2.3).
const HEADER: usize = 5;
const OP_CAPABILITY: u16 = 17;
const STORAGE_BUFFER_16_BIT_ACCESS: u32 = 4433;
const UNIFORM_AND_STORAGE_BUFFER_16_BIT_ACCESS: u32 = 4434;
const OP_DECORATE: u32 = 71;
const DECORATION_NO_CONTRACTION: u32 = 42;

/// Instructions that stand before the declarations of types (SPIR-V §2.4,
/// sections 1 to 8): debug information, annotations and what precedes them.
const PREAMBLE: [u16; 22] = [
    2, 3, 4, 5, 6, 7, 10, 11, 14, 15, 16, 17, 71, 72, 73, 74, 75, 330, 331, 332, 5632, 5633,
];

/// Splits a module into instructions: offset, opcode and word count.
fn instructions(words: &[u32]) -> impl Iterator<Item = Result<(usize, u16, usize), &'static str>> {
    let mut at = HEADER;
    std::iter::from_fn(move || {
        let first = *words.get(at)?;
        let (opcode, count) = ((first & 0xffff) as u16, (first >> 16) as usize);
        let start = at;
        if count == 0 || start + count > words.len() {
            at = words.len();
            return Some(Err("the SPIR-V has an instruction of impossible length"));
        }
        at += count;
        Some(Ok((start, opcode, count)))
    })
}

/// Takes back the capabilities that naga declares for every module with `f16`
/// and that this one makes no use of: access to uniform buffers, which hold
/// none, and to storage buffers, if none does.
fn drop_unused_access(words: &mut Vec<u32>, kernel: &Kernel) -> Result<(), &'static str> {
    let in_buffers = kernel
        .needs
        .iter()
        .any(|need| matches!(need, Need::F16Buffer { .. }));
    let mut unused = Vec::new();
    for instruction in instructions(words) {
        let (at, opcode, count) = instruction?;
        if opcode != OP_CAPABILITY {
            break;
        }
        match words.get(at + 1) {
            Some(&UNIFORM_AND_STORAGE_BUFFER_16_BIT_ACCESS) => unused.push(at..at + count),
            Some(&STORAGE_BUFFER_16_BIT_ACCESS) if !in_buffers => unused.push(at..at + count),
            _ => {}
        }
    }
    for range in unused.into_iter().rev() {
        words.drain(range);
    }
    Ok(())
}

/// Decorates the result of every contractible instruction.
fn forbid_contraction(words: &mut Vec<u32>) -> Result<(), &'static str> {
    let mut annotations_end = None;
    let mut decorations = Vec::new();
    for instruction in instructions(words) {
        let (at, opcode, _) = instruction?;
        if annotations_end.is_none() && !PREAMBLE.contains(&opcode) {
            annotations_end = Some(at);
        }
        if NO_CONTRACTION_OPCODES.contains(&opcode) {
            // Operands: result type, result.
            let result = *words.get(at + 2).ok_or("the SPIR-V ends early")?;
            decorations.extend([3 << 16 | OP_DECORATE, result, DECORATION_NO_CONTRACTION]);
        }
    }
    let end = annotations_end.ok_or("the SPIR-V declares nothing")?;
    words.splice(end..end, decorations);
    Ok(())
}
