//! Running WGSL on the interpreter in tests.

pub(crate) mod checks;
pub(crate) mod raster;

use etalon_core::Format;
use etalon_core::image::ImageData;
use etalon_core::resource::TextureDesc;
use etalon_cpu::{
    BoundResource, Buffer, Checks, Executor, Program, Texture, Tier, TranslateError,
    TranslateOptions,
};

/// Parses, validates and translates; the entry point is `main`.
pub(crate) fn translate(wgsl: &str) -> Result<Program, TranslateError> {
    translate_with(wgsl, Checks::NONE)
}

/// [`translate`] with checks.
pub(crate) fn translate_with(wgsl: &str, checks: Checks) -> Result<Program, TranslateError> {
    let options = TranslateOptions {
        checks,
        ..TranslateOptions::default()
    };
    translate_as(wgsl, &options)
}

/// [`translate`] with options.
pub(crate) fn translate_as(
    wgsl: &str,
    options: &TranslateOptions,
) -> Result<Program, TranslateError> {
    let module = naga::front::wgsl::parse_str(wgsl)
        .unwrap_or_else(|error| panic!("{}", error.emit_to_string(wgsl)));
    let info = naga::valid::Validator::new(
        naga::valid::ValidationFlags::all(),
        naga::valid::Capabilities::all(),
    )
    .subgroup_stages(naga::valid::ShaderStages::all())
    .subgroup_operations(naga::valid::SubgroupOperationSet::all())
    .validate(&module)
    .unwrap_or_else(|error| panic!("{}", error.emit_to_string(wgsl)));
    Program::from_module_with("test", wgsl, &module, &info, "main", options)
}

pub(crate) fn program(wgsl: &str) -> Program {
    translate(wgsl).unwrap_or_else(|error| panic!("{error}"))
}

/// Every way of running that must give the same bits.
pub(crate) fn executors() -> Vec<(String, Executor)> {
    let mut all = Vec::new();
    for tier in Tier::ALL.into_iter().filter(|tier| tier.is_available()) {
        for (threads, lanes) in [(1, 64), (3, 64), (2, 256)] {
            let executor = Executor::new(threads)
                .unwrap()
                .with_tier(tier)
                .with_lanes(lanes);
            all.push((
                format!("{tier}, {threads} threads, {lanes} lanes"),
                executor,
            ));
        }
    }
    all
}

pub(crate) fn words(buffer: &Buffer) -> Vec<u32> {
    buffer
        .to_bytes()
        .unwrap()
        .chunks_exact(4)
        .map(|b| u32::from_le_bytes([b[0], b[1], b[2], b[3]]))
        .collect()
}

pub(crate) fn buffer(words: &[u32]) -> Buffer {
    let bytes: Vec<u8> = words.iter().flat_map(|word| word.to_le_bytes()).collect();
    Buffer::from_bytes(&bytes).unwrap()
}

pub(crate) fn floats(values: &[f32]) -> Buffer {
    buffer(
        &values
            .iter()
            .map(|value| value.to_bits())
            .collect::<Vec<_>>(),
    )
}

/// Runs a kernel with storage buffers `data` (binding 0) and `result`
/// (binding 1), in every way, and returns the words of `result`.
pub(crate) fn run_buffers(wgsl: &str, data: &[u32], results: usize, workgroups: u32) -> Vec<u32> {
    let program = program(wgsl);
    let input = buffer(data);
    let mut first: Option<Vec<u32>> = None;
    for (name, executor) in executors() {
        let output = buffer(&vec![0; results]);
        let bound: Vec<BoundResource<'_>> = program
            .bindings()
            .iter()
            .map(|binding| {
                BoundResource::Buffer(if binding.binding == 0 {
                    &input
                } else {
                    &output
                })
            })
            .collect();
        program
            .dispatch(&executor, [workgroups, 1, 1], &bound)
            .unwrap_or_else(|error| panic!("{error}\n{program}"));
        let got = words(&output);
        match &first {
            None => first = Some(got),
            Some(first) => {
                for (i, (a, b)) in first.iter().zip(&got).enumerate() {
                    // The payload of a NaN is nobody's promise.
                    let nans = f32::from_bits(*a).is_nan() && f32::from_bits(*b).is_nan();
                    assert!(
                        a == b || nans,
                        "word {i} differs on {name}: {a:#x} and {b:#x}\n{program}"
                    );
                }
            }
        }
    }
    first.unwrap()
}

/// An image whose texels are `f(x, y)`.
pub(crate) fn image(
    width: u32,
    height: u32,
    format: Format,
    f: impl Fn(u32, u32) -> [f32; 4],
) -> ImageData {
    let texels: Vec<[f32; 4]> = (0..height)
        .flat_map(|y| (0..width).map(move |x| (x, y)))
        .map(|(x, y)| f(x, y))
        .collect();
    ImageData::from_rgba_f32(TextureDesc::d2(width, height, format), &texels).unwrap()
}

pub(crate) fn texture(image: &ImageData) -> Texture {
    Texture::from_image(image).unwrap()
}

pub(crate) fn empty(width: u32, height: u32, format: Format) -> Texture {
    Texture::zeroed(TextureDesc::d2(width, height, format)).unwrap()
}

/// A kernel over `data` (binding 0), of which invocation `i` has `x`, that leaves `result`
/// (binding 1), after functions of its own.
pub(crate) fn kernel(functions: &str, body: &str) -> String {
    format!(
        "@group(0) @binding(0) var<storage, read> data: array<f32>;
@group(0) @binding(1) var<storage, read_write> result: array<f32>;
{functions}
@compute @workgroup_size(64) fn main(@builtin(global_invocation_id) id: vec3u) {{
    let i = id.x;
    let x = data[i];
{body}
}}
"
    )
}
