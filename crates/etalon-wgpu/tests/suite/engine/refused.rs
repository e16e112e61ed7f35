//! What an engine hands over that a plan cannot use.

use super::{Engine, OUTPUT, ROW, add, adder, row};
use crate::common::{half_floats, image, plan};
use etalon_core::backend::{Backend, BackendError};
use etalon_core::graph::Graph;
use etalon_core::kernel::{KernelLibrary, Need};
use etalon_core::plan::{Capture, Plan};
use etalon_core::resource::BufferDesc;
use etalon_wgpu::{WgpuBindings, wgpu};

#[test]
fn what_does_not_fit_is_refused_with_what_would() {
    let Some(engine) = Engine::new() else { return };
    let mut backend = engine.backend();
    let mut library = adder();
    library.add_source(
        "test/buffer",
        "@group(0) @binding(0) var<storage, read_write> values: array<u32, 16>;
         @compute @workgroup_size(16)
         fn main(@builtin(local_invocation_index) id: u32) { values[id] += 1u; }",
    );
    let plan = add(&backend, &library, 1);
    let source = engine.filled(&row(1));
    let mut refuse = |plan: &Plan, bindings: &WgpuBindings<'_>, name: &str, texts: &[&str]| {
        let mut encoder = engine.encoder();
        let error = backend.record(&mut encoder, plan, bindings).unwrap_err();
        let BackendError::InputMismatch { name: found, .. } = &error else {
            panic!("{error}");
        };
        assert_eq!(found, name);
        let message = error.to_string();
        for text in texts {
            assert!(message.contains(text), "no `{text}` in: {message}");
        }
        // The encoder is as good as new.
        engine.queue.submit([encoder.finish()]);
    };
    let sampled = wgpu::TextureUsages::TEXTURE_BINDING;
    let wrong = |format, size: (u32, u32, u32), samples, dimension, usage| {
        engine.device.create_texture(&wgpu::TextureDescriptor {
            label: None,
            size: wgpu::Extent3d {
                width: size.0,
                height: size.1,
                depth_or_array_layers: size.2,
            },
            mip_level_count: 1,
            sample_count: samples,
            dimension,
            format,
            usage,
            view_formats: &[],
        })
    };
    let (uint, d2) = (wgpu::TextureFormat::R32Uint, wgpu::TextureDimension::D2);
    let float = wrong(wgpu::TextureFormat::R32Float, (64, 1, 1), 1, d2, sampled);
    refuse(
        &plan,
        &WgpuBindings::new().texture("row", &float),
        "row",
        &["R32Float", "r32uint"],
    );
    let small = wrong(uint, (63, 1, 1), 1, d2, sampled);
    refuse(
        &plan,
        &WgpuBindings::new().texture("row", &small),
        "row",
        &["63×1", "64×1"],
    );
    let deep = wrong(uint, (64, 1, 1), 1, wgpu::TextureDimension::D3, sampled);
    refuse(
        &plan,
        &WgpuBindings::new().texture("row", &deep),
        "row",
        &["D3", "D2"],
    );
    let usage = wrong(uint, (64, 1, 1), 1, d2, wgpu::TextureUsages::COPY_DST);
    refuse(
        &plan,
        &WgpuBindings::new().texture("row", &usage),
        "row",
        &["COPY_DST", "TEXTURE_BINDING"],
    );
    refuse(
        &plan,
        &WgpuBindings::new().texture_part("row", &source, 0, 1),
        "row",
        &["layer 1"],
    );
    refuse(
        &plan,
        &WgpuBindings::new().texture_part("row", &source, u32::MAX, 0),
        "row",
        &["0 mips"],
    );
    let good = WgpuBindings::new().texture("row", &source);
    refuse(
        &plan,
        &good.clone().output("sum", &source),
        "sum",
        &["STORAGE_BINDING"],
    );
    let other = engine.texture((64, 1, 1), 1, OUTPUT);
    refuse(
        &plan,
        &good.clone().output("total", &other),
        "total",
        &["`sum`"],
    );
    refuse(
        &plan,
        &WgpuBindings::new()
            .texture("row", &other)
            .output("sum", &other),
        "result",
        &["`row`"],
    );

    let mut graph = Graph::new();
    let values = graph
        .import_buffer("values", BufferDesc { bytes: 64 })
        .unwrap();
    let values = graph
        .compute("test/buffer")
        .update_buffer("values", values)
        .groups([1, 1, 1])
        .unwrap()
        .buffer("values")
        .unwrap();
    graph.output_buffer("values", values).unwrap();
    let counted = crate::common::plan(&engine.backend(), &graph, &library, Capture::None);
    let buffer = |size, usage| {
        engine.device.create_buffer(&wgpu::BufferDescriptor {
            label: None,
            size,
            usage,
            mapped_at_creation: false,
        })
    };
    let short = buffer(60, wgpu::BufferUsages::STORAGE);
    refuse(
        &counted,
        &WgpuBindings::new().buffer("values", &short),
        "values",
        &["60 bytes", "64 bytes"],
    );
    let uniform = buffer(64, wgpu::BufferUsages::UNIFORM);
    refuse(
        &counted,
        &WgpuBindings::new().buffer("values", &uniform),
        "values",
        &["UNIFORM", "STORAGE"],
    );
    refuse(
        &counted,
        &WgpuBindings::new().texture("values", &source),
        "values",
        &["a texture", "a buffer of 64 bytes"],
    );

    let mut encoder = engine.encoder();
    let error = backend
        .record(&mut encoder, &plan, &WgpuBindings::new())
        .unwrap_err();
    assert!(matches!(error, BackendError::MissingInput { ref name } if name == "row"));
    // Textures of another device: wgpu's to refuse, not to panic about.
    let stranger = Engine::on(engine.adapter.clone()).unwrap();
    let foreign = stranger.filled(&row(1));
    let bindings = WgpuBindings::new().texture("row", &foreign);
    let error = backend.record(&mut encoder, &plan, &bindings).unwrap_err();
    assert!(matches!(error, BackendError::Api { .. }), "{error}");
}

#[test]
fn half_floats_are_refused_where_the_engine_has_not_enabled_them() {
    let Some(engine) = Engine::new() else { return };
    let mut backend = engine.backend();
    let (library, graph) = half_floats();
    let plan = plan(&backend, &graph, &library, Capture::None);
    let mut encoder = engine.encoder();
    let error = backend
        .record(&mut encoder, &plan, &WgpuBindings::new())
        .unwrap_err();
    let BackendError::Lacking {
        kernel,
        need,
        feature,
        ..
    } = &error
    else {
        panic!("{error}");
    };
    assert_eq!(
        (kernel.as_str(), need, *feature),
        ("test/half", &Need::F16, "SHADER_F16")
    );
    assert!(
        error.to_string().contains("`test/half` needs `f16`"),
        "{error}"
    );
}

#[test]
fn captures_are_for_the_host() {
    let Some(engine) = Engine::new() else { return };
    let mut backend = engine.backend();
    let mut graph = Graph::new();
    let source = graph.import_texture("row", ROW).unwrap();
    graph.output("row", source).unwrap();
    let plan = plan(&backend, &graph, &KernelLibrary::new(), Capture::Outputs);
    let image = image(ROW);
    let texture = engine.filled(&image);
    let mut encoder = engine.encoder();
    let bindings = WgpuBindings::new().texture("row", &texture);
    let error = backend.record(&mut encoder, &plan, &bindings).unwrap_err();
    assert!(matches!(error, BackendError::Unsupported { .. }), "{error}");
    let inputs = etalon_core::backend::Inputs::new().texture("row", &image);
    let execution = backend.execute(&plan, &inputs).unwrap();
    assert_eq!(execution.output("row"), Some(&image));
}
