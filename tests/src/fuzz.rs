//! What fuzzing runs: inputs on which nothing may panic. `crates/etalon-cpu/fuzz`
//! has the targets; `tests/suite/fuzz.rs` runs the same over a corpus and mutations
//! of it.

use std::panic::catch_unwind;
use std::sync::OnceLock;

use etalon::cpu::{
    BindingInfo, BindingKind, BoundResource, Buffer, ChannelKind, Executor, Program, Texture, Tier,
    View,
};
use etalon::format::Format;
use etalon::kernel::{Arithmetic, KernelRequest};
use etalon::resource::{Dimension, Extent, SamplerDesc, TextureDesc};
use naga::valid::{Capabilities, ModuleInfo, ValidationFlags, Validator};
use naga::{Module, ShaderStage};

use crate::programs::{
    Choices, Held, Interpreters, STEPS, Trial, differences, evaluate, generate, of_seed,
};

/// Longer texts are not looked at: they take long and show nothing new.
const LONGEST: usize = 1 << 15;

/// How often a loop may repeat. Loops nest.
const TRIPS: u32 = 6;

/// Most bytes of a buffer that is bound.
const BUFFER: u32 = 1 << 20;

/// Translates a text and runs all its compute entry points, if naga takes it.
///
/// naga itself may panic on a text; that is not looked at. What translation and
/// execution answer is of no interest here, only that they do.
pub fn wgsl(bytes: &[u8]) {
    let Ok(text) = std::str::from_utf8(bytes) else {
        return;
    };
    if text.len() > LONGEST {
        return;
    }
    let Ok(Some((module, info))) = catch_unwind(|| validated(text)) else {
        return;
    };
    static EXECUTORS: OnceLock<Vec<Executor>> = OnceLock::new();
    let executors = EXECUTORS.get_or_init(|| {
        let executor = |tier| {
            Executor::new(1)
                .ok()
                .map(|executor| executor.with_tier(tier))
        };
        [Tier::Baseline, Tier::best()]
            .into_iter()
            .filter_map(executor)
            .map(|executor| executor.with_max_trips(TRIPS))
            .collect()
    });
    for entry in &module.entry_points {
        if entry.stage != ShaderStage::Compute {
            continue;
        }
        let Ok(program) = Program::from_module("fuzzed", text, &module, &info, &entry.name) else {
            continue;
        };
        // What reads the code is to cope with it too.
        let _ = program.to_string();
        let Some(resources) = program
            .bindings()
            .iter()
            .map(Resource::new)
            .collect::<Option<Vec<_>>>()
        else {
            continue;
        };
        for executor in executors {
            let bound: Vec<BoundResource<'_>> = resources.iter().map(Resource::bound).collect();
            let _ = program.dispatch(executor, [2, 1, 1], &bound);
        }
    }
}

fn validated(text: &str) -> Option<(Module, ModuleInfo)> {
    let module = naga::front::wgsl::parse_str(text).ok()?;
    let info = Validator::new(ValidationFlags::all(), Capabilities::all())
        .validate(&module)
        .ok()?;
    Some((module, info))
}

/// Something to bind.
enum Resource {
    Buffer(Buffer),
    Texture(Texture),
    Sampler,
}

impl Resource {
    /// What a binding takes, if it is not too large.
    fn new(binding: &BindingInfo) -> Option<Self> {
        let texture = |view: View, format: Format| {
            let mut desc = TextureDesc::d2(4, 4, format);
            let layers = |layers| Extent {
                width: 4,
                height: 4,
                depth_or_layers: layers,
            };
            match view {
                View::D2Array => desc.extent = layers(2),
                View::D3 => (desc.dimension, desc.extent) = (Dimension::D3, layers(4)),
                View::Cube => (desc.dimension, desc.extent) = (Dimension::Cube, layers(6)),
                View::CubeArray => (desc.dimension, desc.extent) = (Dimension::Cube, layers(12)),
                // Of two dimensions.
                _ => {}
            }
            Texture::zeroed(desc).ok().map(Self::Texture)
        };
        let buffer = |size: u32| {
            let words = size.checked_next_multiple_of(4)? / 4 + 8;
            // Some of everything: small numbers, floats, NaNs.
            let bytes: Vec<u8> = (0..words)
                .flat_map(|i| (i.wrapping_mul(0x9e37_79b9) >> (i % 32)).to_le_bytes())
                .collect();
            (size <= BUFFER)
                .then(|| Buffer::from_bytes(&bytes).ok())
                .flatten()
                .map(Self::Buffer)
        };
        match binding.kind {
            BindingKind::Uniform { size } => buffer(size),
            BindingKind::Storage { min_size, .. } => buffer(min_size),
            BindingKind::Texture { view, kind } => {
                let format = match kind {
                    ChannelKind::Float => Format::Rgba32Float,
                    ChannelKind::Sint => Format::Rgba32Sint,
                    ChannelKind::Uint => Format::Rgba32Uint,
                };
                texture(view, format)
            }
            BindingKind::StorageTexture { view, format, .. } => texture(view, format),
            BindingKind::Sampler { .. } => Some(Self::Sampler),
        }
    }

    fn bound(&self) -> BoundResource<'_> {
        match self {
            Self::Buffer(buffer) => BoundResource::Buffer(buffer),
            Self::Texture(texture) => BoundResource::Texture(texture.view()),
            Self::Sampler => BoundResource::Sampler(SamplerDesc::default()),
        }
    }
}

/// Generates the program that bytes choose, and runs it as the evaluation of
/// one invocation at a time says.
///
/// # Panics
/// If the interpreter refuses it, or computes something else.
pub fn program(bytes: &[u8]) {
    static INTERPRETERS: OnceLock<Option<Interpreters>> = OnceLock::new();
    let Some(interpreters) = INTERPRETERS
        .get_or_init(|| Interpreters::of([(Tier::Baseline, 64, 1), (Tier::best(), 256, 1)]).ok())
    else {
        return;
    };
    let program = generate(Choices::of_bytes(bytes));
    let Ok(evaluation) = evaluate(&program, STEPS) else {
        return;
    };
    let mut trial = Trial::new(&program, &evaluation.results);
    let all = match interpreters.run(&trial) {
        Ok(all) => all,
        Err(error) => panic!("{error}\n{program}"),
    };
    if evaluation.open.unspecified {
        trial.expected.clone_from(&all[0].1);
    }
    for (name, results) in all {
        if let Some(difference) = differences(&trial, &results, Held::Bits).first() {
            panic!("on {name}: {difference}\n{program}");
        }
    }
}

/// Texts to begin with: every kernel of the library as WGSL, in both
/// arithmetics where they differ, and some random programs.
#[must_use]
pub fn corpus() -> Vec<String> {
    let kernels = etalon::effects::kernels();
    let mut texts: Vec<String> = Vec::new();
    for path in kernels.paths() {
        for arithmetic in [Arithmetic::Strict, Arithmetic::Fast] {
            // Libraries have no entry point.
            if let Ok(kernel) = kernels.get(&KernelRequest::new(path.to_owned()), arithmetic) {
                texts.push(kernel.wgsl.clone());
            }
        }
    }
    texts.extend((0..40).map(|seed| of_seed(seed).0.to_string()));
    texts.dedup();
    texts
}
