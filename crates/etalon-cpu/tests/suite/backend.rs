//! Plans on the interpreter.

use etalon_core::Format;
use etalon_core::backend::{Backend, BackendError, CapturedData, Execution, Inputs};
use etalon_core::graph::{ClearValue, Graph};
use etalon_core::image::ImageData;
use etalon_core::kernel::{Arithmetic, KernelLibrary, KernelRequest};
use etalon_core::plan::{Capture, Plan, PlanOptions};
use etalon_core::resource::TextureDesc;
use etalon_cpu::{CpuBackend, CpuOptions, Program};

const R32: Format = Format::R32Float;

const KERNELS: &[(&str, &str)] = &[
    (
        "test/add",
        "struct Params { offset: f32 }
         @group(0) @binding(2) var<uniform> params: Params;
         @group(0) @binding(0) var source: texture_2d<f32>;
         @group(0) @binding(1) var result: texture_storage_2d<r32float, write>;
         @compute @workgroup_size(8, 8)
         fn main(@builtin(global_invocation_id) id: vec3<u32>) {
             let size = textureDimensions(result);
             if (id.x >= size.x || id.y >= size.y) { return; }
             let value = textureLoad(source, id.xy, 0).x + params.offset;
             textureStore(result, id.xy, vec4<f32>(value, 0.0, 0.0, 1.0));
         }",
    ),
    (
        "test/halve",
        "@group(0) @binding(0) var source: texture_2d<f32>;
         @group(0) @binding(1) var result: texture_storage_2d<r32float, write>;
         @compute @workgroup_size(8, 8)
         fn main(@builtin(global_invocation_id) id: vec3<u32>) {
             let size = textureDimensions(result);
             if (id.x >= size.x || id.y >= size.y) { return; }
             let value = textureLoad(source, 2u * id.xy, 0).x;
             textureStore(result, id.xy, vec4<f32>(value, 0.0, 0.0, 1.0));
         }",
    ),
    (
        "test/endless",
        "@group(0) @binding(0) var result: texture_storage_2d<r32float, write>;
         @compute @workgroup_size(8, 8)
         fn main(@builtin(global_invocation_id) id: vec3<u32>) {
             var i = 0u;
             while (i != 1u) { i += 2u; }
             textureStore(result, id.xy, vec4<f32>(f32(i), 0.0, 0.0, 1.0));
         }",
    ),
];

fn library() -> KernelLibrary {
    let mut library = KernelLibrary::new();
    for (path, source) in KERNELS {
        library.add_source(path, source);
    }
    library
}

fn backend() -> CpuBackend {
    CpuBackend::new(&CpuOptions {
        threads: 2,
        ..CpuOptions::default()
    })
    .unwrap()
}

fn plan(backend: &CpuBackend, graph: &Graph, capture: Capture) -> Plan {
    let options = PlanOptions {
        arithmetic: Arithmetic::Fast,
        limits: backend.limits(),
        capture,
        memory: backend.memory(),
    };
    Plan::new(graph, &library(), &options).unwrap()
}

fn image(width: u32, height: u32, value: impl Fn(u32, u32) -> f32) -> ImageData {
    let texels: Vec<[f32; 4]> = (0..height)
        .flat_map(|y| (0..width).map(move |x| (x, y)))
        .map(|(x, y)| [value(x, y), 0.0, 0.0, 1.0])
        .collect();
    ImageData::from_rgba_f32(TextureDesc::d2(width, height, R32), &texels).unwrap()
}

fn reds(image: &ImageData) -> Vec<f32> {
    image
        .to_rgba_f32()
        .unwrap()
        .into_iter()
        .map(|texel| texel[0])
        .collect()
}

fn chain(desc: TextureDesc, passes: u32, offset: f32) -> Graph {
    let mut graph = Graph::new();
    let mut newest = graph.import_texture("source", desc).unwrap();
    for pass in 0..passes {
        let result = graph.texture(format!("link {pass}"), desc);
        newest = graph
            .compute("test/add")
            .read("source", newest)
            .write("result", result)
            .set("offset", offset)
            .per_texel("result")
            .unwrap();
    }
    graph.output("result", newest).unwrap();
    graph
}

fn output(execution: &Execution, name: &str) -> Vec<f32> {
    reds(execution.output(name).unwrap())
}

#[test]
fn texels_come_out_as_they_went_in_at_any_size() {
    let mut backend = backend();
    for (width, height) in [(1, 1), (1, 4096), (4096, 1), (7, 13), (257, 129)] {
        let source = image(width, height, |x, y| (x + 4099 * y) as f32);
        let plan = plan(&backend, &chain(source.desc, 1, 1.0), Capture::Outputs);
        let execution = backend
            .execute(&plan, &Inputs::new().texture("source", &source))
            .unwrap();
        let expected: Vec<f32> = reds(&source).iter().map(|value| value + 1.0).collect();
        assert_eq!(output(&execution, "result"), expected, "{width}×{height}");
    }
}

#[test]
fn every_pass_is_captured_though_memory_is_shared() {
    let mut backend = backend();
    let source = image(61, 47, |x, y| (x * y) as f32);
    let plan = plan(&backend, &chain(source.desc, 12, 1.0), Capture::EveryPass);
    let execution = backend
        .execute(&plan, &Inputs::new().texture("source", &source))
        .unwrap();
    assert_eq!(execution.captures.len(), 12);
    assert_eq!(execution.times.len(), 12);
    for (pass, captured) in execution.captures.iter().enumerate() {
        let CapturedData::Texture(result) = &captured.data else {
            panic!("no texture")
        };
        let expected: Vec<f32> = reds(&source)
            .iter()
            .map(|v| v + (pass + 1) as f32)
            .collect();
        assert_eq!(reds(result), expected, "{}", captured.pass);
    }
}

#[test]
fn steady_frames_make_nothing() {
    let mut backend = backend();
    let source = image(61, 47, |x, y| (x * y) as f32);
    let inputs = Inputs::new().texture("source", &source);
    let mut before = backend.counters();
    for frame in 0..5 {
        // Other values of uniforms are no other structure.
        let plan = plan(
            &backend,
            &chain(source.desc, 5, frame as f32),
            Capture::Outputs,
        );
        backend.execute(&plan, &inputs).unwrap();
        let after = backend.counters();
        if frame > 0 {
            assert_eq!(
                (
                    after.textures,
                    after.buffers,
                    after.allocations,
                    after.kernels,
                    after.bytes
                ),
                (
                    before.textures,
                    before.buffers,
                    before.allocations,
                    before.kernels,
                    before.bytes
                )
            );
            assert_eq!(after.dispatches, before.dispatches + 5);
        }
        before = after;
    }
    assert_eq!(before.kernels, 1);
    // Frames of another size free the former ones' memory in the end.
    let small = image(2, 2, |_, _| 1.0);
    for _ in 0..8 {
        let plan = plan(&backend, &chain(small.desc, 1, 0.0), Capture::Outputs);
        backend
            .execute(&plan, &Inputs::new().texture("source", &small))
            .unwrap();
    }
    assert_eq!(backend.counters().bytes, 2 * 4 * 4);
}

#[test]
fn mips_and_copies_address_their_parts() {
    let mut backend = backend();
    let source = image(37, 21, |x, y| (x * 64 + y) as f32);
    let mut graph = Graph::new();
    let input = graph.import_texture("source", source.desc).unwrap();
    let mips = source.desc.max_mips();
    let chain = graph.texture("chain", source.desc.with_mips(mips));
    let first = graph.copy(input, chain.mip(0)).unwrap();
    let last = graph
        .compute("test/halve")
        .per_mip("source", "result", first)
        .unwrap();
    graph.output("chain", last).unwrap();
    let plan = plan(&backend, &graph, Capture::Outputs);
    let execution = backend
        .execute(&plan, &Inputs::new().texture("source", &source))
        .unwrap();
    let result = execution.output("chain").unwrap();
    assert_eq!(result.desc.mips, mips);
    for mip in 0..mips {
        let extent = result.desc.mip_extent(mip);
        for (x, y) in (0..extent.height).flat_map(|y| (0..extent.width).map(move |x| (x, y))) {
            let expected = ((x << mip) * 64 + (y << mip)) as f32;
            assert_eq!(
                result.texel(x, y, 0, mip).unwrap().to_f32()[0],
                expected,
                "mip {mip}, {x}, {y}"
            );
        }
    }
}

#[test]
fn histories_carry_over_until_reset() {
    let mut backend = backend();
    let desc = TextureDesc::d2(5, 3, R32);
    let frame = |backend: &mut CpuBackend| {
        let mut graph = Graph::new();
        let history = graph
            .history("count", desc, ClearValue::Float([10.0; 4]))
            .unwrap();
        let next = graph
            .compute("test/add")
            .read("source", history.previous)
            .write("result", history.current)
            .set("offset", 1.0_f32)
            .per_texel("result")
            .unwrap();
        graph.output("count", next).unwrap();
        let plan = plan(backend, &graph, Capture::Outputs);
        output(&backend.execute(&plan, &Inputs::new()).unwrap(), "count")[0]
    };
    assert_eq!(
        [
            frame(&mut backend),
            frame(&mut backend),
            frame(&mut backend)
        ],
        [11.0, 12.0, 13.0]
    );
    backend.reset_histories();
    assert_eq!(frame(&mut backend), 11.0);
}

#[test]
fn what_goes_wrong_is_said_and_leaves_the_backend_usable() {
    let mut backend = CpuBackend::new(&CpuOptions {
        max_trips: 1000,
        ..CpuOptions::default()
    })
    .unwrap();
    let source = image(4, 4, |_, _| 1.0);
    let good = plan(&backend, &chain(source.desc, 1, 1.0), Capture::Outputs);
    assert!(
        matches!(backend.execute(&good, &Inputs::new()), Err(BackendError::MissingInput { name }) if name == "source")
    );
    let other = image(5, 4, |_, _| 1.0);
    assert!(matches!(
        backend.execute(&good, &Inputs::new().texture("source", &other)),
        Err(BackendError::InputMismatch { .. })
    ));
    let mut graph = Graph::new();
    let result = graph.texture("result", source.desc);
    let result = graph
        .compute("test/endless")
        .write("result", result)
        .per_texel("result")
        .unwrap();
    graph.output("result", result).unwrap();
    let endless = plan(&backend, &graph, Capture::Outputs);
    let error = backend
        .execute(&endless, &Inputs::new())
        .unwrap_err()
        .to_string();
    assert!(
        error.contains("test/endless.wesl:5:14") && error.contains("1000"),
        "{error}"
    );
    assert!(
        backend
            .execute(&good, &Inputs::new().texture("source", &source))
            .is_ok()
    );
}

/// Every kernel that is shipped, in both arithmetics.
#[test]
fn shipped_kernels_translate() {
    let library = etalon_effects::kernels();
    let paths = [
        "bloom/upsample",
        "bloom/downsample",
        "bloom/threshold",
        "ssr/blur",
        "ssr/resolve",
        "ssr/march",
        "ssr/mix",
        "composite/composite",
        "exposure/adapt",
        "exposure/luminance",
        "exposure/reduce",
    ];
    for path in paths {
        for arithmetic in [Arithmetic::Strict, Arithmetic::Fast] {
            let kernel = library
                .get(&KernelRequest::new(path), arithmetic)
                .unwrap_or_else(|error| panic!("{error}"));
            let program = Program::translate(&kernel).unwrap_or_else(|error| panic!("{error}"));
            assert!(program.to_string().contains("end"));
            if std::env::var_os("ETALON_PRINT_CODE").is_some() {
                println!("{program}");
            }
        }
    }
}
