//! What cannot be run, and how that is said.

use crate::common::{Route, everywhere, half_floats, library, on_vulkan, open, plan, run, words};
use etalon_core::Format;
use etalon_core::backend::{Backend, BackendError, Inputs};
use etalon_core::graph::{ClearValue, Graph};
use etalon_core::image::ImageData;
use etalon_core::kernel::{Arithmetic, KernelLibrary, Need};
use etalon_core::plan::{Capture, Plan, PlanOptions, Step};
use etalon_core::resource::{BufferDesc, Extent, Limits, TextureDesc};
use etalon_wgpu::{WgpuBackend, WgpuOptions, enumerate, wgpu};

/// Plans for a device with other limits.
fn planned_for(limits: Limits, graph: &Graph, library: &KernelLibrary) -> Plan {
    let options = PlanOptions {
        arithmetic: Arithmetic::Strict,
        limits,
        capture: Capture::Outputs,
        ..PlanOptions::default()
    };
    Plan::new(graph, library, &options).unwrap()
}

#[test]
fn a_device_that_is_not_there_is_said_with_those_that_are() {
    let options = WgpuOptions {
        adapter: Some("no such adapter".to_owned()),
        ..WgpuOptions::default()
    };
    let error = WgpuBackend::new(&options).unwrap_err();
    let BackendError::NoDevice { backend, reason } = &error else {
        panic!("{error}");
    };
    assert_eq!(*backend, "wgpu");
    for adapter in enumerate(options.backends) {
        assert!(reason.contains(&adapter.device), "{reason}");
    }
    let none = WgpuOptions {
        backends: wgpu::Backends::empty(),
        ..WgpuOptions::default()
    };
    assert!(matches!(
        WgpuBackend::new(&none),
        Err(BackendError::NoDevice { .. })
    ));
}

#[test]
fn adapters_can_be_chosen_by_name() {
    if open(Route::Vulkan).is_none() {
        return;
    }
    for adapter in enumerate(wgpu::Backends::VULKAN) {
        let options = WgpuOptions {
            adapter: Some(adapter.device.to_uppercase()),
            ..Route::Vulkan.options()
        };
        let backend = WgpuBackend::new(&options).unwrap();
        assert_eq!(backend.info(), adapter);
        assert_eq!(backend.info().api, "vulkan");
    }
}

#[test]
fn spirv_is_handed_through_unless_told_otherwise() {
    if let Some(backend) = open(Route::Vulkan) {
        assert!(backend.keeps_strict_arithmetic());
    }
    for route in [Route::Translated, Route::Gl] {
        if let Some(backend) = open(route) {
            assert!(!backend.keeps_strict_arithmetic());
        }
    }
}

#[test]
fn inputs_are_held_against_the_plan() {
    on_vulkan(|backend| {
        let desc = TextureDesc::d2(4, 4, Format::R32Float);
        let mut graph = Graph::new();
        let image = graph.import_texture("image", desc).unwrap();
        let buffer = graph
            .import_buffer("buffer", BufferDesc { bytes: 16 })
            .unwrap();
        graph.output("image", image).unwrap();
        graph.output_buffer("buffer", buffer).unwrap();
        let plan = plan(backend, &graph, &KernelLibrary::new(), Capture::Outputs);
        let good = ImageData::zeroed(desc).unwrap();
        let half = ImageData::zeroed(desc.half()).unwrap();
        let mut short = good.clone();
        short.bytes.pop();
        let bytes = [0; 16];
        let cases: [(Inputs<'_>, &str); 5] = [
            (Inputs::new().buffer("buffer", &bytes), "image"),
            (Inputs::new().texture("image", &good), "buffer"),
            (
                Inputs::new()
                    .texture("image", &half)
                    .buffer("buffer", &bytes),
                "2×2×1",
            ),
            (
                Inputs::new()
                    .texture("image", &short)
                    .buffer("buffer", &bytes),
                "63 bytes",
            ),
            (
                Inputs::new()
                    .texture("image", &good)
                    .buffer("buffer", &bytes[..12]),
                "12 bytes",
            ),
        ];
        for (inputs, text) in cases {
            let error = backend.execute(&plan, &inputs).unwrap_err();
            assert!(
                matches!(
                    error,
                    BackendError::MissingInput { .. } | BackendError::InputMismatch { .. }
                ),
                "{error}"
            );
            assert!(error.to_string().contains(text), "{error}");
        }
        let inputs = Inputs::new()
            .texture("image", &good)
            .buffer("buffer", &bytes);
        let execution = backend.execute(&plan, &inputs).unwrap();
        assert_eq!(execution.output("image"), Some(&good));
    });
}

#[test]
fn depths_that_cannot_be_stored_are_refused() {
    on_vulkan(|backend| {
        let desc = TextureDesc::d2(2, 1, Format::Depth32Float);
        let mut graph = Graph::new();
        let depth = graph.import_texture("depth", desc).unwrap();
        graph.output("depth", depth).unwrap();
        let imported = plan(backend, &graph, &KernelLibrary::new(), Capture::Outputs);
        for bad in [f32::NAN, -0.5, 1.5, f32::INFINITY] {
            let bytes = [0.5_f32, bad].map(f32::to_le_bytes).concat();
            let image = ImageData::from_bytes(desc, bytes).unwrap();
            let error = backend
                .execute(&imported, &Inputs::new().texture("depth", &image))
                .unwrap_err();
            assert!(
                matches!(error, BackendError::InputMismatch { .. }),
                "{error}"
            );

            let mut graph = Graph::new();
            let cleared = graph.texture("cleared", desc);
            let cleared = graph
                .clear(cleared, ClearValue::Float([bad, 0.0, 0.0, 0.0]))
                .unwrap();
            graph.output("cleared", cleared).unwrap();
            let plan = plan(backend, &graph, &KernelLibrary::new(), Capture::Outputs);
            let error = backend.execute(&plan, &Inputs::new()).unwrap_err();
            assert!(matches!(error, BackendError::Unsupported { .. }), "{error}");
        }
    });
}

#[test]
fn what_is_too_large_is_refused_before_anything_is_made() {
    on_vulkan(|backend| {
        let generous = Limits {
            max_texture_2d: u32::MAX,
            max_texture_3d: u32::MAX,
            max_texture_layers: u32::MAX,
            max_texture_bytes: u64::MAX,
            max_buffer_bytes: u64::MAX,
            ..backend.limits()
        };
        let before = backend.counters();
        let refuse = |backend: &mut WgpuBackend, graph: &Graph, text: &str| {
            let plan = planned_for(generous, graph, &KernelLibrary::new());
            let error = backend.execute(&plan, &Inputs::new()).unwrap_err();
            assert!(matches!(error, BackendError::Unsupported { .. }), "{error}");
            assert!(error.to_string().contains(text), "{error}");
            assert!(error.to_string().contains("clear huge"), "{error}");
        };
        let side = backend.limits().max_texture_2d;
        for desc in [
            TextureDesc::d2(side + 1, 1, Format::R8Unorm),
            TextureDesc::d2(1 << 31, 1 << 31, Format::Rgba32Float),
            TextureDesc::d3(4, 4, backend.limits().max_texture_3d + 1, Format::R8Unorm),
        ] {
            let mut graph = Graph::new();
            let texture = graph.texture("huge", desc);
            let texture = graph.clear(texture, ClearValue::Float([0.0; 4])).unwrap();
            graph.output("huge", texture).unwrap();
            refuse(backend, &graph, "over the device's limit");
        }
        for (bytes, text) in [
            (
                backend.limits().max_buffer_bytes + 4,
                "over the device's limit",
            ),
            (1 << 60, "over the device's limit"),
            (6, "multiples of 4"),
        ] {
            let mut graph = Graph::new();
            let buffer = graph.buffer("huge", BufferDesc { bytes });
            let buffer = graph.clear_buffer(buffer).unwrap();
            graph.output_buffer("huge", buffer).unwrap();
            refuse(backend, &graph, text);
        }
        assert_eq!(backend.counters(), before);
    });
}

fn dispatch(workgroup: &str, memory: u32, groups: [u32; 3]) -> (KernelLibrary, Graph) {
    let library = library(
        "test/group",
        &format!(
            "var<workgroup> memory: array<u32, {memory}>;
             struct Settings {{ value: u32 }}
             @group(0) @binding(0) var<storage, read_write> seen: array<u32>;
             @group(0) @binding(1) var<uniform> settings: Settings;
             @compute @workgroup_size({workgroup})
             fn main(@builtin(local_invocation_index) id: u32) {{
                 memory[id % {memory}u] = settings.value;
                 workgroupBarrier();
                 if id == 0u {{ seen[0] = memory[0]; }}
             }}"
        ),
    );
    let mut graph = Graph::new();
    let seen = graph.buffer("seen", BufferDesc { bytes: 4 });
    let seen = graph
        .compute("test/group")
        .write_buffer("seen", seen)
        .set("value", 5_u32)
        .groups(groups)
        .unwrap()
        .buffer("seen")
        .unwrap();
    graph.output_buffer("seen", seen).unwrap();
    (library, graph)
}

#[test]
fn half_floats_run_or_are_refused_by_name() {
    everywhere(|route, backend| {
        let (library, graph) = half_floats();
        let plan = plan(backend, &graph, &library, Capture::Outputs);
        match backend.execute(&plan, &Inputs::new()) {
            Ok(execution) => assert_eq!(words(&execution, "halves"), [0x3e00_4600]),
            Err(BackendError::Lacking {
                step,
                kernel,
                need,
                feature,
            }) => {
                assert_eq!((step.as_str(), kernel.as_str()), ("test/half", "test/half"));
                assert_eq!((need, feature), (Need::F16, "SHADER_F16"));
                println!("{route:?} has no f16");
            }
            Err(error) => panic!("{route:?}: {error}"),
        }
    });
}

#[test]
fn dispatches_over_the_limits_are_refused() {
    on_vulkan(|backend| {
        let limits = backend.limits();
        let generous = Limits {
            max_workgroups: u32::MAX,
            max_workgroup_invocations: u32::MAX,
            max_workgroup_bytes: u32::MAX,
            ..limits
        };
        let cases = [
            (
                "1".to_owned(),
                1,
                [limits.max_workgroups + 1, 1, 1],
                "workgroups",
            ),
            (
                format!("{}", limits.max_workgroup_invocations + 1),
                1,
                [1, 1, 1],
                "invocations",
            ),
            (
                "1".to_owned(),
                limits.max_workgroup_bytes / 4 + 1,
                [1, 1, 1],
                "bytes of workgroup memory",
            ),
        ];
        for (workgroup, memory, groups, text) in cases {
            let (library, graph) = dispatch(&workgroup, memory, groups);
            let plan = planned_for(generous, &graph, &library);
            let error = backend.execute(&plan, &Inputs::new()).unwrap_err();
            let BackendError::Unsupported { step, what } = &error else {
                panic!("{error}");
            };
            assert_eq!(step, "test/group");
            assert!(what.contains(text), "{error}");
        }
        let (library, graph) = dispatch("64", 64, [2, 1, 1]);
        let execution = run(backend, &graph, &library, &Inputs::new());
        assert_eq!(words(&execution, "seen"), [5]);
    });
}

#[test]
fn a_plan_that_contradicts_itself_is_refused() {
    on_vulkan(|backend| {
        let (library, graph) = dispatch("1", 1, [1, 1, 1]);
        let good = plan(backend, &graph, &library, Capture::Outputs);
        type Spoil = fn(&mut Plan);
        let spoils: [Spoil; 6] = [
            |plan| plan.resources.clear(),
            |plan| plan.uniforms.clear(),
            |plan| {
                if let Step::Dispatch { bindings, .. } = &mut plan.steps[0].step {
                    bindings.pop();
                }
            },
            |plan| {
                if let Step::Dispatch { bindings, .. } = &mut plan.steps[0].step {
                    bindings.swap(0, 1);
                }
            },
            |plan| {
                if let Step::Capture { resource, .. } = &mut plan.steps[1].step {
                    *resource = 99;
                }
            },
            |plan| {
                plan.steps[0].step = Step::CopyBuffer {
                    source: 0,
                    target: 0,
                };
            },
        ];
        for (index, spoil) in spoils.iter().enumerate() {
            let mut plan = good.clone();
            spoil(&mut plan);
            let error = backend.execute(&plan, &Inputs::new()).unwrap_err();
            assert!(
                matches!(error, BackendError::Api { call: "plan", .. }),
                "{index}: {error}"
            );
        }
        let execution = backend.execute(&good, &Inputs::new()).unwrap();
        assert_eq!(words(&execution, "seen"), [5]);
    });
}

#[test]
fn a_lost_device_is_an_error() {
    on_vulkan(|backend| {
        let (library, graph) = dispatch("1", 1, [1, 1, 1]);
        let plan = plan(backend, &graph, &library, Capture::Outputs);
        backend.execute(&plan, &Inputs::new()).unwrap();
        backend.device().destroy();
        let lost = |error: BackendError| {
            assert!(matches!(error, BackendError::DeviceLost { .. }), "{error}");
        };
        lost(backend.execute(&plan, &Inputs::new()).unwrap_err());
        lost(backend.execute(&plan, &Inputs::new()).unwrap_err());
    });
}

#[test]
fn steady_frames_from_the_host_make_nothing_either() {
    on_vulkan(|backend| {
        let mut made = None;
        for value in 0..5_u32 {
            let (library, _) = dispatch("8", 8, [1, 1, 1]);
            let mut graph = Graph::new();
            let seen = graph.buffer("seen", BufferDesc { bytes: 4 });
            let seen = graph
                .compute("test/group")
                .write_buffer("seen", seen)
                .set("value", value)
                .groups([1, 1, 1])
                .unwrap()
                .buffer("seen")
                .unwrap();
            graph.output_buffer("seen", seen).unwrap();
            let execution = run(backend, &graph, &library, &Inputs::new());
            assert_eq!(words(&execution, "seen"), [value]);
            let counters = backend.counters();
            assert_eq!(counters.dispatches, u64::from(value) + 1);
            assert_eq!(counters.made(), *made.get_or_insert(counters.made()));
        }
    });
}

#[test]
fn a_copy_for_the_host_that_no_buffer_holds_is_refused_before_anything_is_made() {
    on_vulkan(|backend| {
        // Rows of one byte take 256 in a buffer.
        let limits = backend.limits();
        let height = limits.max_texture_2d;
        let largest = backend.device().limits().max_buffer_size;
        let layers = u32::try_from(largest / 256 / u64::from(height) + 1).unwrap();
        if layers > limits.max_texture_layers {
            println!("skipped: a buffer of {largest} bytes holds anything");
            return;
        }
        let mut graph = Graph::new();
        let desc = TextureDesc {
            extent: Extent {
                width: 1,
                height,
                depth_or_layers: layers,
            },
            ..TextureDesc::d2(1, 1, Format::R8Unorm)
        };
        let texture = graph.texture("thin", desc);
        let texture = graph.clear(texture, ClearValue::Float([0.0; 4])).unwrap();
        graph.output("thin", texture).unwrap();
        let plan = plan(backend, &graph, &KernelLibrary::new(), Capture::Outputs);
        let before = backend.counters();
        let error = backend.execute(&plan, &Inputs::new()).unwrap_err();
        let BackendError::OutOfMemory { bytes, .. } = error else {
            panic!("{error}");
        };
        assert_eq!(bytes, 256 * u64::from(height) * u64::from(layers));
        let after = backend.counters();
        assert_eq!(
            (after.textures, after.bytes),
            (before.textures, before.bytes)
        );
    });
}

#[test]
fn backends_can_be_moved_between_threads() {
    fn assert_send<T: Send>() {}
    assert_send::<WgpuBackend>();
    let Some(mut backend) = open(Route::Vulkan) else {
        return;
    };
    let (library, graph) = dispatch("1", 1, [1, 1, 1]);
    std::thread::spawn(move || {
        let execution = run(&mut backend, &graph, &library, &Inputs::new());
        assert_eq!(words(&execution, "seen"), [5]);
    })
    .join()
    .unwrap();
}
