//! What lasts from frame to frame, what is captured and what is timed.

use super::kernels::buffer_library;
use std::borrow::Cow;

use crate::common::{everywhere, library, on_vulkan, plan, run, uints, words};
use etalon_core::Format;
use etalon_core::backend::{Backend, BackendError, CapturedData, Inputs};
use etalon_core::graph::{ClearValue, Graph};
use etalon_core::image::ImageData;
use etalon_core::kernel::KernelLibrary;
use etalon_core::plan::Capture;
use etalon_core::resource::{BufferDesc, TextureDesc};
use etalon_wgpu::{WgpuBackend, wgpu};

#[test]
fn a_history_is_what_the_last_frame_left() {
    everywhere(|_, backend| {
        let library = library(
            "test/count",
            "struct Settings { by: u32 }
             @group(0) @binding(0) var before: texture_2d<u32>;
             @group(0) @binding(1) var after: texture_storage_2d<r32uint, write>;
             @group(0) @binding(2) var<uniform> settings: Settings;
             @compute @workgroup_size(8, 8)
             fn main(@builtin(global_invocation_id) id: vec3u) {
                 if any(id.xy >= textureDimensions(after)) { return; }
                 textureStore(after, id.xy, vec4u(textureLoad(before, id.xy, 0).x + settings.by));
             }",
        );
        let frame = |name: &str, by: u32, size: u32| {
            let mut graph = Graph::new();
            let desc = TextureDesc::d2(size, 3, Format::R32Uint);
            let history = graph
                .history(name, desc, ClearValue::Uint([5, 0, 0, 0]))
                .unwrap();
            let current = graph
                .compute("test/count")
                .read("before", history.previous)
                .write("after", history.current)
                .set("by", by)
                .per_texel("after")
                .unwrap();
            // Histories are copied to be captured: an output of its own.
            let seen = graph.texture("seen", desc);
            let seen = graph.copy(current, seen).unwrap();
            graph.output("seen", seen).unwrap();
            graph
        };
        let mut expect = |name: &str, by: u32, size: u32, wanted: u32| {
            let graph = frame(name, by, size);
            let execution = run(backend, &graph, &library, &Inputs::new());
            let seen = uints(execution.output("seen").unwrap());
            assert_eq!(seen, vec![wanted; size as usize * 3]);
        };
        expect("a", 1, 7, 6);
        expect("a", 10, 7, 16);
        expect("a", 100, 7, 116);
        // Another name, and the first is forgotten; another size, anew.
        expect("b", 1, 7, 6);
        expect("a", 1, 7, 6);
        expect("a", 1, 8, 6);
        expect("a", 1, 8, 7);
        backend.reset_histories();
        let graph = frame("a", 2, 8);
        let execution = run(backend, &graph, &library, &Inputs::new());
        assert_eq!(uints(execution.output("seen").unwrap())[0], 7);
    });
}

#[test]
fn a_failed_frame_leaves_histories_as_they_were() {
    on_vulkan(|backend| {
        let library = library(
            "test/add",
            "@group(0) @binding(0) var before: texture_2d<u32>;
             @group(0) @binding(1) var more: texture_2d<u32>;
             @group(0) @binding(2) var after: texture_storage_2d<r32uint, write>;
             @compute @workgroup_size(1)
             fn main() { textureStore(after, vec2u(), textureLoad(before, vec2u(), 0) + textureLoad(more, vec2u(), 0)); }",
        );
        let desc = TextureDesc::d2(1, 1, Format::R32Uint);
        let mut graph = Graph::new();
        let more = graph.import_texture("more", desc).unwrap();
        let history = graph
            .history("sum", desc, ClearValue::Uint([0; 4]))
            .unwrap();
        let after = graph
            .compute("test/add")
            .read("before", history.previous)
            .read("more", more)
            .write("after", history.current)
            .per_texel("after")
            .unwrap();
        let seen = graph.texture("seen", desc);
        let seen = graph.copy(after, seen).unwrap();
        graph.output("seen", seen).unwrap();
        let plan = plan(backend, &graph, &library, Capture::Outputs);
        let seven = ImageData::from_bytes(desc, 7_u32.to_le_bytes().to_vec()).unwrap();
        let inputs = Inputs::new().texture("more", &seven);
        for wanted in [7, 14, 21] {
            let error = backend.execute(&plan, &Inputs::new()).unwrap_err();
            assert!(matches!(error, BackendError::MissingInput { ref name } if name == "more"));
            let execution = backend.execute(&plan, &inputs).unwrap();
            assert_eq!(uints(execution.output("seen").unwrap()), [wanted]);
        }
    });
}

#[test]
fn every_pass_is_captured_as_it_left_things() {
    everywhere(|_, backend| {
        let library = library(
            "test/twice",
            "@group(0) @binding(0) var<storage, read_write> values: array<u32>;
             @compute @workgroup_size(4)
             fn main(@builtin(global_invocation_id) id: vec3u) { values[id.x] = values[id.x] * 2u + 1u; }",
        );
        let mut graph = Graph::new();
        let values = graph.buffer("values", BufferDesc { bytes: 16 });
        let mut values = graph.clear_buffer(values).unwrap();
        for _ in 0..3 {
            values = graph
                .compute("test/twice")
                .update_buffer("values", values)
                .groups([1, 1, 1])
                .unwrap()
                .buffer("values")
                .unwrap();
        }
        graph.output_buffer("values", values).unwrap();
        let plan = plan(backend, &graph, &library, Capture::EveryPass);
        let execution = backend.execute(&plan, &Inputs::new()).unwrap();
        let seen: Vec<(Cow<'_, str>, u8)> = execution
            .captures
            .iter()
            .map(|captured| match &captured.data {
                CapturedData::Buffer(bytes) => (Cow::from(&captured.pass), bytes[12]),
                CapturedData::Texture(_) => panic!("a buffer was captured"),
            })
            .collect();
        let wanted = [
            ("clear values", 0),
            ("test/twice", 1),
            ("test/twice#2", 3),
            ("test/twice#3", 7),
        ]
        .map(|(name, value)| (Cow::from(name), value));
        assert_eq!(seen, wanted);
        let timed: Vec<&str> = execution
            .times
            .iter()
            .map(|time| time.step.as_str())
            .collect();
        let steps = ["clear values", "test/twice", "test/twice#2", "test/twice#3"];
        if tells_time(backend) {
            assert_eq!(timed, steps);
        } else {
            assert!(timed.is_empty(), "{timed:?}");
        }
    });
}

/// Whether the device was opened with what timing takes.
fn tells_time(backend: &WgpuBackend) -> bool {
    backend
        .device()
        .features()
        .contains(wgpu::Features::TIMESTAMP_QUERY | wgpu::Features::TIMESTAMP_QUERY_INSIDE_ENCODERS)
}

#[test]
fn more_steps_are_timed_than_one_query_set_holds() {
    on_vulkan(|backend| {
        let mut graph = Graph::new();
        let marks = graph.buffer("marks", BufferDesc { bytes: 8 });
        let mut marks = graph.clear_buffer(marks).unwrap();
        let steps = 2100;
        for index in 0..steps {
            marks = graph
                .compute("test/mark")
                .update_buffer("marks", marks)
                // One that runs nothing, in the second set too.
                .groups([u32::from(index % 2 == 0), 1, 1])
                .unwrap()
                .buffer("marks")
                .unwrap();
        }
        graph.output_buffer("marks", marks).unwrap();
        let execution = run(backend, &graph, &buffer_library(), &Inputs::new());
        assert_eq!(words(&execution, "marks"), [1, 0]);
        if tells_time(backend) {
            assert_eq!(execution.times.len(), steps + 1);
            assert_eq!(execution.times[steps].step, format!("test/mark#{steps}"));
        }
    });
}

#[test]
fn a_plan_of_nothing_runs() {
    on_vulkan(|backend| {
        let plan = plan(
            backend,
            &Graph::new(),
            &KernelLibrary::new(),
            Capture::Outputs,
        );
        assert!(plan.steps.is_empty());
        let execution = backend.execute(&plan, &Inputs::new()).unwrap();
        assert!(execution.captures.is_empty() && execution.times.is_empty());
    });
}
