//! Draws into an engine's textures, from its buffers.

use super::Engine;
use crate::common::{library, plan};
use etalon_core::Format;
use etalon_core::backend::{Backend, BackendError};
use etalon_core::graph::{ClearValue, Draw, Graph, Load};
use etalon_core::kernel::KernelLibrary;
use etalon_core::plan::{Capture, Plan};
use etalon_core::raster::{IndexFormat, VertexFormat, VertexLayout};
use etalon_core::resource::{BufferDesc, TextureDesc};
use etalon_wgpu::{WgpuBackend, WgpuBindings, wgpu};

fn kernels() -> KernelLibrary {
    library(
        "test/id",
        "struct Settings { id: u32 }
         @group(0) @binding(2) var<uniform> settings: Settings;
         @vertex fn vertex(@location(0) position: vec2f) -> @builtin(position) vec4f {
             return vec4f(position, 0.0, 1.0);
         }
         struct Targets { @location(0) id: u32 }
         @fragment fn fragment() -> Targets { return Targets(settings.id); }",
    )
}

/// Draws `id` over the left half of a row, in whatever is there.
fn left_half(backend: &WgpuBackend, id: u32, indirect: bool) -> Plan {
    let mut graph = Graph::new();
    let mut buffer = |name, bytes| graph.import_buffer(name, BufferDesc { bytes }).unwrap();
    let (corners, indices) = (buffer("corners", 32), buffer("indices", 12));
    let records = buffer("records", 20);
    let desc = TextureDesc::d2(64, 1, Format::R32Uint);
    let target = graph.texture("target", desc);
    let layout = VertexLayout::packed("position", VertexFormat::Float32x2);
    let draw = Draw::new("test/id")
        .vertices(corners, 0, layout)
        .indices(indices, 0, IndexFormat::Uint16)
        .set("id", id);
    let draw = if indirect {
        draw.indirect(records, 0, 1)
    } else {
        draw.elements(0..6)
    };
    let clear = Load::Clear(ClearValue::Uint([7; 4]));
    let pass = graph.raster("draws").colour("id", target, clear);
    let written = pass.draw(draw).finish().unwrap();
    let image = written.texture("id").unwrap();
    graph.output("image", image).unwrap();
    plan(backend, &graph, &kernels(), Capture::None)
}

impl Engine {
    /// A buffer that is larger than what a plan knows of it.
    fn buffer(&self, bytes: &[u8], usage: wgpu::BufferUsages) -> wgpu::Buffer {
        let buffer = self.device.create_buffer(&wgpu::BufferDescriptor {
            label: None,
            size: 256,
            usage: usage | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        });
        self.queue.write_buffer(&buffer, 0, bytes);
        buffer
    }

    fn square(&self) -> [wgpu::Buffer; 3] {
        let corners = [[-1.0_f32, 1.0], [-1.0, -1.0], [0.0, 1.0], [0.0, -1.0]];
        let corners: Vec<u8> = corners
            .as_flattened()
            .iter()
            .flat_map(|value| value.to_le_bytes())
            .collect();
        let indices = [0_u16, 1, 2, 2, 1, 3].map(u16::to_le_bytes).concat();
        let record = [6_u32, 1, 0, 0, 0].map(u32::to_le_bytes).concat();
        [
            self.buffer(&corners, wgpu::BufferUsages::VERTEX),
            self.buffer(&indices, wgpu::BufferUsages::INDEX),
            self.buffer(&record, wgpu::BufferUsages::INDIRECT),
        ]
    }
}

const TARGET: wgpu::TextureUsages = wgpu::TextureUsages::RENDER_ATTACHMENT
    .union(wgpu::TextureUsages::TEXTURE_BINDING)
    .union(wgpu::TextureUsages::COPY_SRC);

fn half(id: u32) -> Vec<u32> {
    (0..64).map(|x| if x < 32 { id } else { 7 }).collect()
}

#[test]
fn draws_go_into_parts_of_an_engines_textures_and_steady_frames_make_nothing() {
    let Some(engine) = Engine::new() else { return };
    let mut backend = engine.backend();
    let [corners, indices, _] = engine.square();
    let arrays = [(); 2].map(|()| engine.texture((128, 1, 3), 2, TARGET));
    let mut made = None;
    for frame in 0..12_u32 {
        let array = &arrays[frame as usize % 2];
        let plan = left_half(&backend, frame, false);
        let bindings = WgpuBindings::new()
            .buffer("corners", &corners)
            .buffer("indices", &indices)
            .output_part("image", array, 1, 2);
        let mut encoder = engine.encoder();
        backend.record(&mut encoder, &plan, &bindings).unwrap();
        engine.queue.submit([encoder.finish()]);
        engine.wait();
        assert_eq!(engine.read_row(array, 1, 2), half(frame));
        assert_eq!(engine.read_row(array, 1, 1), [0; 64]);
        let counters = backend.counters();
        assert_eq!(counters.draws, u64::from(frame) + 1);
        let now = (counters.made(), backend.views_created());
        if frame >= 4 {
            assert_eq!(now, *made.get_or_insert(now));
        }
    }
    assert_eq!(backend.counters().pipelines, 1);
}

#[test]
fn an_engines_targets_must_be_for_drawing() {
    let Some(engine) = Engine::new() else { return };
    let mut backend = engine.backend();
    let [corners, indices, _] = engine.square();
    let plan = left_half(&backend, 1, false);
    let plain = engine.texture((64, 1, 1), 1, super::OUTPUT);
    let good = WgpuBindings::new()
        .buffer("corners", &corners)
        .buffer("indices", &indices);
    for (bindings, text) in [
        (good.clone().output("image", &plain), "RENDER_ATTACHMENT"),
        (good.clone().buffer("corners", &indices), "VERTEX"),
        (good.clone().buffer("indices", &corners), "INDEX"),
    ] {
        let mut encoder = engine.encoder();
        let error = backend.record(&mut encoder, &plan, &bindings).unwrap_err();
        assert!(
            matches!(error, BackendError::InputMismatch { .. }),
            "{error}"
        );
        assert!(error.to_string().contains(text), "{error}");
    }
}

/// WebGPU's default device draws nothing for a record with a first instance, so
/// that it must be one with the feature.
#[test]
fn indirect_draws_take_a_feature_of_the_engines_device() {
    let Some(engine) = Engine::new() else { return };
    let [corners, indices, records] = engine.square();
    let bindings = WgpuBindings::new()
        .buffer("corners", &corners)
        .buffer("indices", &indices)
        .buffer("records", &records);
    let mut backend = engine.backend();
    let plan = left_half(&backend, 1, true);
    let mut encoder = engine.encoder();
    let error = backend.record(&mut encoder, &plan, &bindings).unwrap_err();
    let BackendError::Unsupported { step, what } = &error else {
        panic!("{error}");
    };
    assert_eq!(step, "draws");
    assert!(what.contains("INDIRECT_FIRST_INSTANCE"), "{error}");
}
