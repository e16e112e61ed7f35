//! Handing SPIR-V to the driver untouched.

use etalon_core::backend::BackendError;
use etalon_core::kernel::{Binding, Kernel, KernelError, SpirvOptions, Stages, spirv};

use crate::fault::Fault;
use crate::gpu::Gpu;

/// Why a kernel has no shader module.
pub(crate) enum ModuleError {
    /// It cannot be said in SPIR-V.
    Kernel(Box<KernelError>),
    /// wgpu or the driver refused it.
    Fault(Fault),
}

impl ModuleError {
    /// As an error of the step that needs the kernel.
    pub(crate) fn of(self, step: &str) -> BackendError {
        match self {
            Self::Kernel(error) => BackendError::Kernel {
                step: step.to_owned(),
                error,
            },
            Self::Fault(fault) => fault.of_kernel(step),
        }
    }
}

/// The shader module of one stage of a kernel, from the words that every Vulkan
/// executor of Etalon runs.
pub(crate) fn module(
    gpu: &Gpu,
    kernel: &Kernel,
    stage: naga::ShaderStage,
) -> Result<wgpu::ShaderModule, ModuleError> {
    let mut words = spirv(kernel, stage, &SpirvOptions::default())
        .map_err(|error| ModuleError::Kernel(Box::new(error)))?;
    // Of all stages, since one layout is for all.
    pack_bindings(&mut words, &kernel.bindings);
    let (name, [x, y, z]) = match (&kernel.stages, stage) {
        (Stages::Compute(stage), _) => (stage.entry_point.as_str(), stage.workgroup_size),
        (Stages::Raster(stages), naga::ShaderStage::Fragment) => match &stages.fragment {
            Some(fragment) => (fragment.entry_point.as_str(), [1; 3]),
            None => ("fragment", [1; 3]),
        },
        (Stages::Raster(stages), _) => (stages.vertex.entry_point.as_str(), [1; 3]),
    };
    let descriptor = wgpu::ShaderModuleDescriptorPassthrough {
        label: Some(&kernel.name),
        entry_points: vec![wgpu::PassthroughShaderEntryPoint {
            name: name.into(),
            workgroup_size: (x, y, z),
        }]
        .into(),
        spirv: Some(words.into()),
        ..wgpu::ShaderModuleDescriptorPassthrough::default()
    };
    gpu.guarded(|| {
        // SAFETY: the words are naga's translation of a module that naga has
        // validated, with every index into buffers, arrays and textures
        // checked. The bindings they name are those of the explicit layout
        // which is made from the same kernel and with which alone the module is
        // used. What vertices are fed with, what they hand to fragments and
        // what those put out is held against layouts, stages and targets before
        // a pipeline is made.
        #[allow(unsafe_code)]
        unsafe {
            gpu.device.create_shader_module_passthrough(descriptor)
        }
    })
    .map_err(ModuleError::Fault)
}

/// Words before the first instruction (SPIR-V §2.3).
const HEADER: usize = 5;
const OP_DECORATE: u32 = 71;
const DECORATION_BINDING: u32 = 33;

/// Renumbers bindings as wgpu numbers them in its descriptor set layouts on
/// Vulkan: without gaps, in the order of the kernel's numbers. A kernel has
/// gaps where a variant leaves a binding unused.
fn pack_bindings(words: &mut [u32], bindings: &[Binding]) {
    let mut numbers: Vec<u32> = bindings.iter().map(|binding| binding.binding).collect();
    numbers.sort_unstable();
    let mut at = HEADER;
    while let Some(&first) = words.get(at) {
        let (opcode, count) = (first & 0xffff, (first >> 16) as usize);
        if let (OP_DECORATE, Some([_, DECORATION_BINDING, number])) =
            (opcode, words.get_mut(at + 1..at + count))
            && let Ok(packed) = numbers.binary_search(number)
        {
            *number = packed as u32;
        }
        // A count of zero cannot come from naga, and must not loop.
        at += count.max(1);
    }
}

#[cfg(test)]
mod tests {
    use etalon_core::kernel::{Arithmetic, KernelLibrary, KernelRequest};

    use super::*;

    /// Every `Binding` decoration, sorted.
    fn decorated(words: &[u32]) -> Vec<u32> {
        let mut found = Vec::new();
        let mut at = HEADER;
        while at < words.len() {
            let count = (words[at] >> 16) as usize;
            if words[at] & 0xffff == OP_DECORATE && words[at + 2] == DECORATION_BINDING {
                found.push(words[at + 3]);
            }
            at += count;
        }
        found.sort_unstable();
        found
    }

    #[test]
    fn gaps_between_bindings_are_closed_in_order() {
        let mut library = KernelLibrary::new();
        library.add_source(
            "test/gaps",
            "@group(0) @binding(7) var<storage, read_write> c: array<u32>;
             @group(0) @binding(2) var<storage, read> a: array<u32>;
             @group(0) @binding(5) var<storage, read> b: array<u32>;
             @compute @workgroup_size(1) fn main() { c[0] = a[0] - b[0]; }",
        );
        let kernel = library
            .get(&KernelRequest::new("test/gaps"), Arithmetic::Strict)
            .unwrap();
        let mut words = spirv(
            &kernel,
            naga::ShaderStage::Compute,
            &SpirvOptions::default(),
        )
        .unwrap();
        assert_eq!(decorated(&words), [2, 5, 7]);
        let before = words.clone();
        pack_bindings(&mut words, &kernel.bindings);
        assert_eq!(decorated(&words), [0, 1, 2]);
        let changed: Vec<(u32, u32)> = before
            .iter()
            .zip(&words)
            .filter(|(a, b)| a != b)
            .map(|(a, b)| (*a, *b))
            .collect();
        let mut sorted = changed.clone();
        sorted.sort_unstable();
        assert_eq!(sorted, [(2, 0), (5, 1), (7, 2)]);
    }

    #[test]
    fn nonsense_words_do_not_hang_or_panic() {
        for words in [
            vec![],
            vec![0; 9],
            vec![u32::MAX; 9],
            vec![0, 0, 0, 0, 0, 3 << 16 | OP_DECORATE, 1],
        ] {
            let mut copy = words.clone();
            pack_bindings(&mut copy, &[]);
            assert_eq!(copy, words);
        }
    }
}
