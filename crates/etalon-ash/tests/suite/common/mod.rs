//! What the tests share: devices, kernels, and a way to run a graph on each.
//!
//! Tests run on every usable Vulkan device that the loader finds; choose with
//! `VK_DRIVER_FILES`. Where there is none, or the validation layer is not
//! installed, they say so and pass, unless `ETALON_REQUIRE` (a list with
//! commas) contains `ash` or `validation`.

pub(crate) mod draw;
pub(crate) mod engine;

use std::sync::Arc;

use etalon_ash::{AshBackend, AshOptions, Validation, ValidationLog, enumerate};
use etalon_core::Format;
use etalon_core::backend::{Backend, BackendError, Execution, Inputs};
use etalon_core::graph::Graph;
use etalon_core::image::ImageData;
use etalon_core::kernel::{Arithmetic, KernelLibrary};
use etalon_core::plan::{Capture, Plan, PlanOptions};
use etalon_core::resource::TextureDesc;

/// Whether `ETALON_REQUIRE` asks for something.
pub(crate) fn required(what: &str) -> bool {
    std::env::var("ETALON_REQUIRE")
        .is_ok_and(|list| list.split(',').any(|item| item.trim() == what))
}

/// The names of the devices to test.
pub(crate) fn devices() -> Vec<String> {
    let found = enumerate();
    let names: Vec<String> = found
        .iter()
        .flatten()
        .filter(|device| device.missing.is_empty())
        .map(|device| device.name.clone())
        .collect();
    if names.is_empty() {
        let why = match found {
            Ok(devices) => format!("no usable device among {devices:?}"),
            Err(error) => error.to_string(),
        };
        assert!(!required("ash"), "ETALON_REQUIRE asks for `ash`: {why}");
        println!("not tested: {why}");
    }
    names
}

/// A backend on the named device, with synchronization validation if it is
/// installed. Messages are collected and do not make runs fail.
pub(crate) fn backend(device: &str) -> AshBackend {
    backend_with(AshOptions {
        device: Some(device.to_owned()),
        ..AshOptions::default()
    })
}

/// As [`backend`], with other options.
pub(crate) fn backend_with(options: AshOptions) -> AshBackend {
    let validated = AshOptions {
        validation: Validation::Synchronization,
        validation_fails: false,
        ..options.clone()
    };
    match AshBackend::new(validated) {
        Ok(backend) => backend,
        Err(BackendError::NoDevice { reason, .. }) if reason.contains("validation") => {
            assert!(
                !required("validation"),
                "ETALON_REQUIRE asks for `validation`: {reason}"
            );
            println!("not validated: {reason}");
            AshBackend::new(AshOptions {
                validation: Validation::Off,
                ..options
            })
            .unwrap()
        }
        Err(error) => panic!("{error}"),
    }
}

/// Runs a test on each device, and fails if the validation layer has anything
/// to say, up to and including the destruction of the device.
pub(crate) fn on_each(test: impl Fn(&mut AshBackend)) {
    for device in devices() {
        println!("on {device}");
        let mut backend = backend(&device);
        let log = backend.validation_log();
        test(&mut backend);
        drop(backend);
        silent(log);
    }
}

/// Fails if the log has messages.
pub(crate) fn silent(log: Option<Arc<ValidationLog>>) {
    let messages = log.map(|log| log.messages()).unwrap_or_default();
    let text: Vec<String> = messages.iter().map(ToString::to_string).collect();
    assert!(text.is_empty(), "{}", text.join("\n\n"));
}

/// Plans for a backend.
pub(crate) fn plan(backend: &AshBackend, graph: &Graph, capture: Capture) -> Plan {
    let options = PlanOptions {
        arithmetic: Arithmetic::Fast,
        limits: backend.limits(),
        capture,
        memory: backend.memory(),
    };
    Plan::new(graph, &kernels(), &options).unwrap()
}

/// Plans and runs, and captures the outputs.
pub(crate) fn execute(backend: &mut AshBackend, graph: &Graph, inputs: &Inputs<'_>) -> Execution {
    let plan = plan(backend, graph, Capture::Outputs);
    backend.execute(&plan, inputs).unwrap()
}

/// An `r32float` image with a value for each texel.
pub(crate) fn image(width: u32, height: u32, value: impl Fn(u32, u32) -> f32) -> ImageData {
    let texels: Vec<[f32; 4]> = (0..height)
        .flat_map(|y| (0..width).map(move |x| (x, y)))
        .map(|(x, y)| [value(x, y), 0.0, 0.0, 1.0])
        .collect();
    ImageData::from_rgba_f32(TextureDesc::d2(width, height, Format::R32Float), &texels).unwrap()
}

/// The red channels of an image.
pub(crate) fn reds(image: &ImageData) -> Vec<f32> {
    image
        .to_rgba_f32()
        .unwrap()
        .into_iter()
        .map(|texel| texel[0])
        .collect()
}

/// The kernels of the tests, each of which does one thing.
pub(crate) fn kernels() -> KernelLibrary {
    let mut library = KernelLibrary::new();
    for (path, source) in KERNELS.iter().chain(draw::KERNELS) {
        library.add_source(path, source);
    }
    library
}

const KERNELS: &[(&str, &str)] = &[
    // result = source + offset
    (
        "test/add",
        "struct Params { offset: f32 }
         @group(0) @binding(0) var source: texture_2d<f32>;
         @group(0) @binding(1) var result: texture_storage_2d<r32float, write>;
         @group(0) @binding(2) var<uniform> params: Params;
         @compute @workgroup_size(8, 8)
         fn main(@builtin(global_invocation_id) id: vec3<u32>) {
             let size = textureDimensions(result);
             if (id.x >= size.x || id.y >= size.y) { return; }
             let value = textureLoad(source, id.xy, 0).x + params.offset;
             textureStore(result, id.xy, vec4<f32>(value, 0.0, 0.0, 1.0));
         }",
    ),
    // As test/add, of the texel opposite.
    (
        "test/turn",
        "struct Params { offset: f32 }
         @group(0) @binding(0) var source: texture_2d<f32>;
         @group(0) @binding(1) var result: texture_storage_2d<r32float, write>;
         @group(0) @binding(2) var<uniform> params: Params;
         @compute @workgroup_size(8, 8)
         fn main(@builtin(global_invocation_id) id: vec3<u32>) {
             let size = textureDimensions(result);
             if (id.x >= size.x || id.y >= size.y) { return; }
             let value = textureLoad(source, size - 1u - id.xy, 0).x + params.offset;
             textureStore(result, id.xy, vec4<f32>(value, 0.0, 0.0, 1.0));
         }",
    ),
    // result = first + second
    (
        "test/sum_of",
        "@group(0) @binding(0) var first: texture_2d<f32>;
         @group(0) @binding(1) var second: texture_2d<f32>;
         @group(0) @binding(2) var result: texture_storage_2d<r32float, write>;
         @compute @workgroup_size(8, 8)
         fn main(@builtin(global_invocation_id) id: vec3<u32>) {
             let size = textureDimensions(result);
             if (id.x >= size.x || id.y >= size.y) { return; }
             let value = textureLoad(first, id.xy, 0).x + textureLoad(second, id.xy, 0).x;
             textureStore(result, id.xy, vec4<f32>(value, 0.0, 0.0, 1.0));
         }",
    ),
    // A format that WebGPU does not have everywhere.
    (
        "test/half",
        "@group(0) @binding(0) var result: texture_storage_2d<r16float, write>;
         @compute @workgroup_size(8, 8)
         fn main(@builtin(global_invocation_id) id: vec3<u32>) {
             let size = textureDimensions(result);
             if (id.x >= size.x || id.y >= size.y) { return; }
             textureStore(result, id.xy, vec4<f32>(0.5, 0.0, 0.0, 1.0));
         }",
    ),
    // Stores without asking for the size.
    (
        "test/overrun",
        "@group(0) @binding(0) var result: texture_storage_2d<r32float, write>;
         @compute @workgroup_size(8, 8)
         fn main(@builtin(global_invocation_id) id: vec3<u32>) {
             textureStore(result, id.xy, vec4<f32>(f32(id.x), 0.0, 0.0, 1.0));
         }",
    ),
    // Means of 2 × 2 texels.
    (
        "test/halve",
        "@group(0) @binding(0) var source: texture_2d<f32>;
         @group(0) @binding(1) var result: texture_storage_2d<r32float, write>;
         @compute @workgroup_size(8, 8)
         fn main(@builtin(global_invocation_id) id: vec3<u32>) {
             let size = textureDimensions(result);
             if (id.x >= size.x || id.y >= size.y) { return; }
             let last = textureDimensions(source) - 1u;
             var sum = 0.0;
             for (var i = 0u; i < 4u; i++) {
                 let at = min(2u * id.xy + vec2<u32>(i % 2u, i / 2u), last);
                 sum += textureLoad(source, at, 0).x;
             }
             textureStore(result, id.xy, vec4<f32>(0.25 * sum, 0.0, 0.0, 1.0));
         }",
    ),
    // values[i] = 3 i + 1
    (
        "test/ramp",
        "@group(0) @binding(0) var<storage, read_write> values: array<u32>;
         @compute @workgroup_size(64)
         fn main(@builtin(global_invocation_id) id: vec3<u32>) {
             if (id.x < arrayLength(&values)) { values[id.x] = 3u * id.x + 1u; }
         }",
    ),
    // values[i] = values[i] * factor
    (
        "test/scale",
        "struct Params { factor: u32 }
         @group(0) @binding(3) var<storage, read_write> values: array<u32>;
         @group(0) @binding(7) var<uniform> params: Params;
         @compute @workgroup_size(64)
         fn main(@builtin(global_invocation_id) id: vec3<u32>) {
             if (id.x < arrayLength(&values)) { values[id.x] *= params.factor; }
         }",
    ),
    // result = source, buffers
    (
        "test/copy_values",
        "@group(0) @binding(0) var<storage, read> source: array<u32>;
         @group(0) @binding(1) var<storage, read_write> result: array<u32>;
         @compute @workgroup_size(64)
         fn main(@builtin(global_invocation_id) id: vec3<u32>) {
             if (id.x < arrayLength(&result)) { result[id.x] = source[id.x]; }
         }",
    ),
    // Workgroup counts: (count, 1, 1)
    (
        "test/counts",
        "struct Params { count: u32 }
         @group(0) @binding(0) var<storage, read_write> counts: array<u32>;
         @group(0) @binding(1) var<uniform> params: Params;
         @compute @workgroup_size(1)
         fn main() {
             counts[0] = 7u;
             counts[1] = params.count;
             counts[2] = 1u;
             counts[3] = 1u;
         }",
    ),
    // One word for each workgroup, which is the number of all.
    (
        "test/mark",
        "@group(0) @binding(0) var<storage, read_write> values: array<u32>;
         @compute @workgroup_size(1)
         fn main(@builtin(workgroup_id) id: vec3<u32>, @builtin(num_workgroups) all: vec3<u32>) {
             if (id.x < arrayLength(&values)) { values[id.x] = 100u + all.x; }
         }",
    ),
    // sums[g] = the sum of the 64 values of workgroup g
    (
        "test/sum",
        "@group(0) @binding(0) var<storage, read> values: array<u32>;
         @group(0) @binding(1) var<storage, read_write> sums: array<u32>;
         var<workgroup> partial: array<u32, 64>;
         @compute @workgroup_size(64)
         fn main(@builtin(local_invocation_index) local: u32,
                 @builtin(workgroup_id) group: vec3<u32>,
                 @builtin(global_invocation_id) id: vec3<u32>) {
             partial[local] = select(0u, values[id.x], id.x < arrayLength(&values));
             for (var stride = 32u; stride > 0u; stride >>= 1u) {
                 workgroupBarrier();
                 if (local < stride) { partial[local] += partial[local + stride]; }
             }
             if (local == 0u) { sums[group.x] = partial[0]; }
         }",
    ),
    // In place, read and written.
    (
        "test/increment",
        "@group(0) @binding(0) var image: texture_storage_2d<r32float, read_write>;
         @compute @workgroup_size(8, 8)
         fn main(@builtin(global_invocation_id) id: vec3<u32>) {
             let size = textureDimensions(image);
             if (id.x >= size.x || id.y >= size.y) { return; }
             let value = textureLoad(image, id.xy).x + 1.0;
             textureStore(image, id.xy, vec4<f32>(value, 0.0, 0.0, 1.0));
         }",
    ),
    // Reads through a storage binding.
    (
        "test/copy_stored",
        "@group(0) @binding(0) var source: texture_storage_2d<r32float, read>;
         @group(0) @binding(1) var result: texture_storage_2d<r32float, write>;
         @compute @workgroup_size(8, 8)
         fn main(@builtin(global_invocation_id) id: vec3<u32>) {
             let size = textureDimensions(result);
             if (id.x >= size.x || id.y >= size.y) { return; }
             textureStore(result, id.xy, textureLoad(source, id.xy));
         }",
    ),
    // Samples at texel corners, where linear filtering takes the mean of four.
    (
        "test/sample",
        "@group(0) @binding(0) var source: texture_2d<f32>;
         @group(0) @binding(1) var filtering: sampler;
         @group(0) @binding(2) var result: texture_storage_2d<rgba32float, write>;
         @compute @workgroup_size(8, 8)
         fn main(@builtin(global_invocation_id) id: vec3<u32>) {
             let size = textureDimensions(result);
             if (id.x >= size.x || id.y >= size.y) { return; }
             let uv = vec2<f32>(id.xy + 1u) / vec2<f32>(size);
             textureStore(result, id.xy, textureSampleLevel(source, filtering, uv, 0.0));
         }",
    ),
    // One value for each layer of a cube, seen as a cube, an array and one layer.
    (
        "test/faces",
        "@group(0) @binding(0) var source: texture_cube<f32>;
         @group(0) @binding(1) var filtering: sampler;
         @group(0) @binding(2) var result: texture_storage_2d_array<rgba16float, write>;
         @compute @workgroup_size(4, 4, 1)
         fn main(@builtin(global_invocation_id) id: vec3<u32>) {
             let size = textureDimensions(result);
             if (id.x >= size.x || id.y >= size.y) { return; }
             let sign = select(1.0, -1.0, id.z % 2u == 1u);
             var direction = vec3<f32>(0.0);
             if (id.z < 2u) { direction.x = sign; }
             else if (id.z < 4u) { direction.y = sign; }
             else { direction.z = sign; }
             textureStore(result, id.xy, id.z,
                          textureSampleLevel(source, filtering, direction, 0.0));
         }",
    ),
    // texel (x, y, z) = x + 10 y + 100 z
    (
        "test/volume",
        "@group(0) @binding(0) var result: texture_storage_3d<r32float, write>;
         @compute @workgroup_size(4, 4, 4)
         fn main(@builtin(global_invocation_id) id: vec3<u32>) {
             if (any(id >= textureDimensions(result))) { return; }
             let value = f32(id.x + 10u * id.y + 100u * id.z);
             textureStore(result, id, vec4<f32>(value, 0.0, 0.0, 1.0));
         }",
    ),
];
