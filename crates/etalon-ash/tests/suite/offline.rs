//! Plans with inputs from the host, on every device, under validation.

use crate::common;

use common::{execute, image, on_each, plan, reds};
use etalon_ash::{AshBackend, AshOptions};
use etalon_core::Format;
use etalon_core::backend::{Backend, BackendError, CapturedData, Execution, Inputs};
use etalon_core::graph::{ClearValue, Graph, GraphError};
use etalon_core::image::ImageData;
use etalon_core::kernel::Arithmetic;
use etalon_core::plan::{Capture, Groups, Plan, PlanOptions, Step};
use etalon_core::resource::{BufferDesc, Limits, SamplerDesc, TextureDesc};

/// The buffer captured as this output.
fn words(execution: &Execution, output: &str) -> Vec<u32> {
    let captured = execution
        .captures
        .iter()
        .find(|captured| captured.binding == output)
        .unwrap();
    let CapturedData::Buffer(bytes) = &captured.data else {
        panic!("`{output}` is no buffer");
    };
    bytes
        .chunks_exact(4)
        .map(|word| u32::from_le_bytes(word.try_into().unwrap()))
        .collect()
}

/// `passes` runs of a kernel that adds 1, one after the other.
fn chain_of(kernel: &'static str, desc: TextureDesc, passes: u32) -> Result<Graph, GraphError> {
    let mut graph = Graph::new();
    let mut newest = graph.import_texture("source", desc)?;
    for pass in 0..passes {
        let result = graph.texture(format!("link {pass}"), desc);
        newest = graph
            .compute(kernel)
            .read("source", newest)
            .write("result", result)
            .set("offset", 1.0_f32)
            .per_texel("result")?;
    }
    graph.output("result", newest)?;
    Ok(graph)
}

/// `passes` additions of 1, one after the other.
fn chain(desc: TextureDesc, passes: u32) -> Result<Graph, GraphError> {
    chain_of("test/add", desc, passes)
}

#[test]
fn texels_come_out_as_they_went_in_at_any_size() {
    on_each(|backend| {
        for (width, height) in [(1, 1), (1, 4096), (4096, 1), (7, 13), (257, 129)] {
            let source = image(width, height, |x, y| (x + 4099 * y) as f32);
            let graph = chain(source.desc, 1).unwrap();
            let inputs = Inputs::new().texture("source", &source);
            let execution = execute(backend, &graph, &inputs);
            let result = execution.output("result").unwrap();
            assert_eq!(result.desc, source.desc);
            let expected: Vec<f32> = reds(&source).iter().map(|value| value + 1.0).collect();
            assert_eq!(reds(result), expected, "{width}×{height}");
        }
    });
}

#[test]
fn transients_that_share_memory_do_not_disturb_each_other() {
    on_each(|backend| {
        let source = image(61, 47, |x, y| (x * x + y) as f32);
        // Each pass reads where others write.
        let graph = chain_of("test/turn", source.desc, 12).unwrap();
        let plan = plan(backend, &graph, Capture::EveryPass);
        assert!(
            plan.texture_heap < plan.unaliased_bytes,
            "the chain is to share memory: {} of {}",
            plan.texture_heap,
            plan.unaliased_bytes
        );
        let inputs = Inputs::new().texture("source", &source);
        for _ in 0..2 {
            let execution = backend.execute(&plan, &inputs).unwrap();
            assert_eq!(execution.captures.len(), 12);
            let mut expected = reds(&source);
            for captured in &execution.captures {
                let CapturedData::Texture(result) = &captured.data else {
                    panic!("no texture");
                };
                expected = expected.iter().rev().map(|v| v + 1.0).collect();
                assert_eq!(reds(result), expected, "{}", captured.pass);
            }
        }
    });
}

#[test]
fn each_mip_is_made_of_the_one_above() {
    on_each(|backend| {
        let source = image(37, 21, |x, y| (x * 8 + y) as f32);
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
        let inputs = Inputs::new().texture("source", &source);
        let execution = execute(backend, &graph, &inputs);
        let result = execution.output("chain").unwrap();
        assert_eq!(result.desc.mips, mips);
        let value = |mip, x: u32, y: u32| {
            let extent = result.desc.mip_extent(mip);
            let (x, y) = (x.min(extent.width - 1), y.min(extent.height - 1));
            result.texel(x, y, 0, mip).unwrap().to_f32()[0]
        };
        for mip in 1..mips {
            let extent = result.desc.mip_extent(mip);
            for (x, y) in (0..extent.height).flat_map(|y| (0..extent.width).map(move |x| (x, y))) {
                // The same order of additions, each exact enough to repeat.
                let mut sum = 0.0;
                for i in 0..4 {
                    sum += value(mip - 1, 2 * x + i % 2, 2 * y + i / 2);
                }
                assert_eq!(value(mip, x, y), 0.25 * sum, "mip {mip} at {x}, {y}");
            }
        }
    });
}

#[test]
fn buffers_are_written_updated_cleared_and_copied() {
    on_each(|backend| {
        let count = 1000_u32;
        let desc = BufferDesc {
            bytes: u64::from(count) * 4,
        };
        let mut graph = Graph::new();
        let ramp = graph.buffer("ramp", desc);
        let groups = [count.div_ceil(64), 1, 1];
        let ramp = graph
            .compute("test/ramp")
            .write_buffer("values", ramp)
            .groups(groups)
            .unwrap()
            .buffer("values")
            .unwrap();
        let copy = graph.buffer("copy", desc);
        let copy = graph.copy_buffer(ramp, copy).unwrap();
        let scaled = graph
            .compute("test/scale")
            .update_buffer("values", copy)
            .set("factor", 5_u32)
            .groups(groups)
            .unwrap()
            .buffer("values")
            .unwrap();
        let zero = graph.buffer("zero", desc);
        let zero = graph.clear_buffer(zero).unwrap();
        graph.output_buffer("ramp", ramp).unwrap();
        graph.output_buffer("scaled", scaled).unwrap();
        graph.output_buffer("zero", zero).unwrap();
        let execution = execute(backend, &graph, &Inputs::new());
        let expected: Vec<u32> = (0..count).map(|i| 3 * i + 1).collect();
        assert_eq!(words(&execution, "ramp"), expected);
        let expected: Vec<u32> = (0..count).map(|i| 5 * (3 * i + 1)).collect();
        assert_eq!(words(&execution, "scaled"), expected);
        assert_eq!(words(&execution, "zero"), vec![0; count as usize]);
    });
}

#[test]
fn as_many_workgroups_run_as_a_buffer_says() {
    on_each(|backend| {
        for count in [0_u32, 1, 37] {
            let mut graph = Graph::new();
            let counts = graph.buffer("counts", BufferDesc { bytes: 16 });
            let counts = graph
                .compute("test/counts")
                .write_buffer("counts", counts)
                .set("count", count)
                .groups([1, 1, 1])
                .unwrap()
                .buffer("counts")
                .unwrap();
            let values = graph.buffer("values", BufferDesc { bytes: 200 });
            let values = graph.clear_buffer(values).unwrap();
            // Behind the first word, which says something else.
            let marked = graph
                .compute("test/mark")
                .update_buffer("values", values)
                .indirect(counts, 4)
                .unwrap()
                .buffer("values")
                .unwrap();
            graph.output_buffer("marked", marked).unwrap();
            let execution = execute(backend, &graph, &Inputs::new());
            let expected: Vec<u32> = (0..50)
                .map(|i| if i < count { 100 + count } else { 0 })
                .collect();
            assert_eq!(words(&execution, "marked"), expected);
        }
    });
}

#[test]
fn no_workgroups_are_no_dispatch() {
    on_each(|backend| {
        let mut graph = Graph::new();
        let values = graph.buffer("values", BufferDesc { bytes: 64 });
        let values = graph.clear_buffer(values).unwrap();
        let marked = graph
            .compute("test/mark")
            .update_buffer("values", values)
            .groups([0, 1, 1])
            .unwrap()
            .buffer("values")
            .unwrap();
        graph.output_buffer("marked", marked).unwrap();
        let before = backend.counters().dispatches;
        let execution = execute(backend, &graph, &Inputs::new());
        assert_eq!(words(&execution, "marked"), [0; 16]);
        assert_eq!(backend.counters().dispatches, before);
    });
}

#[test]
fn workgroups_reduce_in_shared_memory() {
    on_each(|backend| {
        let values: Vec<u32> = (0..300_u32).map(|i| i * i).collect();
        let bytes: Vec<u8> = values.iter().flat_map(|v| v.to_le_bytes()).collect();
        let mut graph = Graph::new();
        let input = graph
            .import_buffer("values", BufferDesc { bytes: 1200 })
            .unwrap();
        let sums = graph.buffer("sums", BufferDesc { bytes: 20 });
        let sums = graph
            .compute("test/sum")
            .read_buffer("values", input)
            .write_buffer("sums", sums)
            .groups([5, 1, 1])
            .unwrap()
            .buffer("sums")
            .unwrap();
        graph.output_buffer("sums", sums).unwrap();
        let mut inputs = Inputs::new();
        inputs.buffers.insert("values".into(), &bytes);
        let execution = execute(backend, &graph, &inputs);
        let expected: Vec<u32> = values.chunks(64).map(|part| part.iter().sum()).collect();
        assert_eq!(words(&execution, "sums"), expected);
    });
}

#[test]
fn textures_are_updated_in_place() {
    on_each(|backend| {
        let desc = TextureDesc::d2(9, 5, Format::R32Float);
        let mut graph = Graph::new();
        let image = graph.texture("image", desc);
        let mut newest = graph.clear(image, ClearValue::Float([0.5; 4])).unwrap();
        for _ in 0..3 {
            newest = graph
                .compute("test/increment")
                .update("image", newest)
                .per_texel("image")
                .unwrap();
        }
        graph.output("image", newest).unwrap();
        let execution = execute(backend, &graph, &Inputs::new());
        assert_eq!(reds(execution.output("image").unwrap()), vec![3.5; 45]);
    });
}

#[test]
fn samplers_filter() {
    on_each(|backend| {
        let desc = TextureDesc::d2(4, 4, Format::Rgba16Float);
        // Multiples of 4, whose means of four are exact at any weight precision.
        let texels: Vec<[f32; 4]> = (0..16).map(|i| [4.0 * i as f32, 0.0, 0.0, 1.0]).collect();
        let source = ImageData::from_rgba_f32(desc, &texels).unwrap();
        let mut graph = Graph::new();
        let input = graph.import_texture("source", desc).unwrap();
        let result = graph.texture("result", desc.with_format(Format::Rgba32Float));
        let result = graph
            .compute("test/sample")
            .read("source", input)
            .write("result", result)
            .sampler("filtering", SamplerDesc::LINEAR_CLAMP)
            .per_texel("result")
            .unwrap();
        graph.output("result", result).unwrap();
        let execution = execute(backend, &graph, &Inputs::new().texture("source", &source));
        let result = reds(execution.output("result").unwrap());
        for (index, value) in result.into_iter().enumerate() {
            let (x, y) = (index % 4, index / 4);
            let at = |dx: usize, dy: usize| 4.0 * ((x + dx).min(3) + 4 * (y + dy).min(3)) as f32;
            let mean = 0.25 * (at(0, 0) + at(1, 0) + at(0, 1) + at(1, 1));
            assert_eq!(value, mean, "{x}, {y}");
        }
    });
}

#[test]
fn stores_outside_a_texture_go_nowhere() {
    on_each(|backend| {
        let desc = TextureDesc::d2(5, 3, Format::R32Float);
        let mut graph = Graph::new();
        let result = graph.texture("result", desc);
        // Eight by eight invocations.
        let result = graph
            .compute("test/overrun")
            .write("result", result)
            .per_texel("result")
            .unwrap();
        graph.output("result", result).unwrap();
        let execution = execute(backend, &graph, &Inputs::new());
        let row = [0.0, 1.0, 2.0, 3.0, 4.0];
        assert_eq!(
            reds(execution.output("result").unwrap()),
            [row, row, row].concat()
        );
    });
}

/// Adds `offset` to what the last frame left in the history `sum`.
fn accumulate(size: u32, offset: f32) -> Graph {
    let desc = TextureDesc::d2(size, size, Format::R32Float);
    let mut graph = Graph::new();
    let history = graph
        .history("sum", desc, ClearValue::Float([10.0; 4]))
        .unwrap();
    let sum = graph
        .compute("test/add")
        .read("source", history.previous)
        .write("result", history.current)
        .set("offset", offset)
        .per_texel("result")
        .unwrap();
    graph.output("sum", sum).unwrap();
    let copy = graph.texture("copy", desc);
    let copy = graph.copy(sum, copy).unwrap();
    graph.output("copy", copy).unwrap();
    graph
}

fn first(execution: &Execution, output: &str) -> f32 {
    reds(execution.output(output).unwrap())[0]
}

#[test]
fn histories_carry_over_and_start_anew() {
    on_each(|backend| {
        let run = |backend: &mut AshBackend, size, offset| {
            let execution = execute(backend, &accumulate(size, offset), &Inputs::new());
            assert_eq!(first(&execution, "copy"), first(&execution, "sum"));
            first(&execution, "sum")
        };
        assert_eq!(run(backend, 6, 1.0), 11.0);
        assert_eq!(run(backend, 6, 2.0), 13.0);
        assert_eq!(run(backend, 6, 3.0), 16.0);
        // Another shape.
        assert_eq!(run(backend, 7, 1.0), 11.0);
        assert_eq!(run(backend, 7, 1.0), 12.0);
        // A frame without it.
        let source = image(2, 2, |_, _| 0.0);
        let without = chain(source.desc, 1).unwrap();
        execute(backend, &without, &Inputs::new().texture("source", &source));
        assert_eq!(run(backend, 7, 1.0), 11.0);
        backend.reset_histories();
        assert_eq!(run(backend, 7, 5.0), 15.0);
    });
}

#[test]
fn times_are_those_of_the_steps_that_do_something() {
    on_each(|backend| {
        let source = image(64, 64, |_, _| 1.0);
        let graph = chain(source.desc, 3).unwrap();
        let inputs = Inputs::new().texture("source", &source);
        let plan = plan(backend, &graph, Capture::EveryPass);
        let execution = backend.execute(&plan, &inputs).unwrap();
        let steps: Vec<&str> = plan
            .steps
            .iter()
            .filter(|step| !matches!(step.step, Step::Capture { .. }))
            .map(|step| step.name.as_str())
            .collect();
        assert_eq!(steps.len(), 3);
        // Both software drivers have timestamps; a device need not.
        if !execution.times.is_empty() {
            let timed: Vec<&str> = execution.times.iter().map(|t| t.step.as_str()).collect();
            assert_eq!(timed, steps);
            assert!(execution.times.iter().any(|time| time.nanoseconds > 0));
        }
    });
}

#[test]
fn a_frame_like_an_earlier_one_makes_nothing() {
    on_each(|backend| {
        let source = image(33, 17, |x, _| x as f32);
        let frame = |backend: &mut AshBackend, offset: f32| {
            let mut graph = accumulate(8, offset);
            let input = graph.import_texture("source", source.desc).unwrap();
            let result = graph.texture("result", source.desc);
            let result = graph
                .compute("test/add")
                .read("source", input)
                .write("result", result)
                .set("offset", offset)
                .per_texel("result")
                .unwrap();
            graph.output("result", result).unwrap();
            let plan = plan(backend, &graph, Capture::Outputs);
            let before = backend.counters();
            let inputs = Inputs::new().texture("source", &source);
            let execution = backend.execute(&plan, &inputs).unwrap();
            assert_eq!(
                reds(execution.output("result").unwrap())[3],
                3.0 + offset,
                "uniforms are this frame's"
            );
            (before, backend.counters(), plan)
        };
        // Two frames, one for each side of the history.
        frame(backend, 0.0);
        frame(backend, 1.0);
        for index in 0..5 {
            let (before, after, plan) = frame(backend, 2.0 + index as f32);
            assert_eq!(before.kernels, after.kernels);
            assert_eq!(before.pipelines, after.pipelines);
            assert_eq!(before.bind_groups, after.bind_groups);
            assert_eq!(before.textures, after.textures);
            assert_eq!(before.buffers, after.buffers);
            assert_eq!(before.allocations, after.allocations);
            assert_eq!(before.bytes, after.bytes);
            assert_eq!(
                after.dispatches - before.dispatches,
                plan.dispatch_count() as u64
            );
            assert_eq!(
                after.barriers - before.barriers,
                plan.barrier_count() as u64
            );
        }
    });
}

#[test]
fn plans_used_long_ago_are_let_go() {
    for device in common::devices() {
        let mut backend = common::backend_with(AshOptions {
            device: Some(device),
            plans_kept: 2,
            ..AshOptions::default()
        });
        let log = backend.validation_log();
        let run = |backend: &mut AshBackend, size: u32| {
            let source = image(size, size, |_, _| 1.0);
            let graph = chain(source.desc, 2).unwrap();
            execute(backend, &graph, &Inputs::new().texture("source", &source));
            backend.counters()
        };
        let two = [run(&mut backend, 1), run(&mut backend, 2)][1];
        let three = run(&mut backend, 3);
        assert_eq!(three.pipelines, two.pipelines, "pipelines are kept");
        // The second is still there, the first is not.
        let again = run(&mut backend, 2);
        assert_eq!(again.textures, three.textures);
        let anew = run(&mut backend, 1);
        assert!(anew.textures > again.textures);
        for size in 4..12 {
            run(&mut backend, size);
        }
        let settled = run(&mut backend, 12).bytes;
        for size in [11, 12, 11, 10, 12, 11] {
            run(&mut backend, size);
        }
        // What three plans held, two of them kept and one not yet gone.
        assert!(backend.counters().bytes <= settled * 2);
        drop(backend);
        common::silent(log);
    }
}

#[test]
fn wrong_inputs_are_named_before_anything_is_made() {
    on_each(|backend| {
        let source = image(4, 4, |_, _| 0.0);
        let graph = chain(source.desc, 1).unwrap();
        let plan = plan(backend, &graph, Capture::Outputs);
        let before = backend.counters();
        let error = backend.execute(&plan, &Inputs::new()).unwrap_err();
        assert!(
            matches!(&error, BackendError::MissingInput { name } if name == "source"),
            "{error}"
        );
        let other = image(4, 5, |_, _| 0.0);
        let inputs = Inputs::new().texture("source", &other);
        let error = backend.execute(&plan, &inputs).unwrap_err();
        assert!(error.to_string().contains("4×5"), "{error}");
        assert!(error.to_string().contains("4×4"), "{error}");
        let mut short = source.clone();
        short.bytes.pop();
        let inputs = Inputs::new().texture("source", &short);
        let error = backend.execute(&plan, &inputs).unwrap_err();
        assert!(
            matches!(error, BackendError::InputMismatch { .. }),
            "{error}"
        );
        assert_eq!(backend.counters(), before);
        // And the backend can be used again.
        let inputs = Inputs::new().texture("source", &source);
        backend.execute(&plan, &inputs).unwrap();
    });
}

#[test]
fn what_the_device_cannot_have_is_refused_before_anything_is_made() {
    on_each(|backend| {
        let limits = backend.limits();
        let size = limits.max_texture_2d;
        let texture_of = |desc| {
            let mut graph = Graph::new();
            let texture = graph.texture("huge", desc);
            let texture = graph.clear(texture, ClearValue::Float([0.0; 4])).unwrap();
            graph.output("huge", texture).unwrap();
            graph
        };
        let too_wide = TextureDesc::d2(size + 1, 1, Format::R32Float);
        for desc in [too_wide, TextureDesc::d2(1, size + 1, Format::R32Float)] {
            // With the device's limits there is no plan, …
            let options = PlanOptions {
                limits,
                ..PlanOptions::default()
            };
            let graph = texture_of(desc);
            let kernels = common::kernels();
            assert!(Plan::new(&graph, &kernels, &options).is_err());
            // … with others there is, and it is refused.
            let options = PlanOptions {
                limits: Limits {
                    max_texture_2d: u32::MAX,
                    max_texture_bytes: u64::MAX,
                    ..limits
                },
                ..PlanOptions::default()
            };
            let plan = Plan::new(&graph, &kernels, &options).unwrap();
            let before = backend.counters();
            let error = backend.execute(&plan, &Inputs::new()).unwrap_err();
            let BackendError::Unsupported { step, what } = &error else {
                panic!("{error}");
            };
            assert!(step.contains("clear"), "{error}");
            assert!(what.contains("huge") && what.contains("limit"), "{error}");
            assert_eq!(backend.counters(), before);
        }
    });
}

#[test]
fn memory_that_is_not_there_is_an_error_with_its_size() {
    on_each(|backend| {
        let source = image(4, 4, |_, _| 0.0);
        let graph = chain(source.desc, 2).unwrap();
        let good = plan(backend, &graph, Capture::Outputs);
        let inputs = Inputs::new().texture("source", &source);
        backend.execute(&good, &inputs).unwrap();
        let mut huge = good.clone();
        huge.texture_heap = 1 << 52;
        let before = backend.counters().bytes;
        let error = backend.execute(&huge, &inputs).unwrap_err();
        let BackendError::OutOfMemory { what, bytes } = &error else {
            panic!("{error}");
        };
        assert_eq!(*bytes, 1 << 52);
        assert!(what.contains("transient textures"), "{error}");
        assert_eq!(backend.counters().bytes, before);
        // And the backend can be used again.
        backend.execute(&good, &inputs).unwrap();
    });
}

#[test]
fn strict_kernels_run() {
    on_each(|backend| {
        let source = image(10, 10, |x, y| (x + y) as f32 * 0.1);
        let graph = chain(source.desc, 3).unwrap();
        let options = PlanOptions {
            arithmetic: Arithmetic::Strict,
            limits: backend.limits(),
            capture: Capture::Outputs,
            memory: backend.memory(),
        };
        let plan = Plan::new(&graph, &common::kernels(), &options).unwrap();
        let execution = backend
            .execute(&plan, &Inputs::new().texture("source", &source))
            .unwrap();
        // Each addition rounded, as it is here.
        let expected: Vec<f32> = reds(&source).iter().map(|v| v + 1.0 + 1.0 + 1.0).collect();
        assert_eq!(reds(execution.output("result").unwrap()), expected);
    });
}

#[test]
fn plans_that_were_tampered_with_are_refused() {
    on_each(|backend| {
        let source = image(4, 4, |_, _| 0.0);
        let graph = chain(source.desc, 2).unwrap();
        let good = plan(backend, &graph, Capture::Outputs);
        let inputs = Inputs::new().texture("source", &source);
        let mut refused = |what: &str, spoil: &dyn Fn(&mut Plan)| {
            let mut plan = good.clone();
            spoil(&mut plan);
            let error = backend.execute(&plan, &inputs);
            assert!(error.is_err(), "{what} went through");
        };
        refused("a binding too few", &|plan| {
            if let Step::Dispatch { bindings, .. } = &mut plan.steps[0].step {
                bindings.pop();
            }
        });
        refused("a resource that is not there", &|plan| {
            if let Step::Capture { resource, .. } = &mut plan.steps[2].step {
                *resource = 99;
            }
        });
        refused("a mip that is not there", &|plan| {
            if let Step::Capture { range, .. } = &mut plan.steps[2].step {
                range.mip = 1;
            }
        });
        refused("a barrier that reaches outside", &|plan| {
            plan.steps[1].barriers[0].range.layers = 2;
        });
        refused("too many workgroups", &|plan| {
            if let Step::Dispatch { groups, .. } = &mut plan.steps[0].step {
                *groups = Groups::Direct([u32::MAX; 3]);
            }
        });
        refused("uniforms that are not there", &|plan| plan.uniforms.clear());
        refused("a place outside the heap", &|plan| plan.texture_heap = 16);
        backend.execute(&good, &inputs).unwrap();
    });
}

#[test]
fn plans_made_with_another_memory_model_run_all_the_same() {
    on_each(|backend| {
        let source = image(50, 30, |x, y| (x + y) as f32);
        let graph = chain(source.desc, 9).unwrap();
        let options = PlanOptions {
            limits: backend.limits(),
            capture: Capture::Outputs,
            ..PlanOptions::default()
        };
        let plan = Plan::new(&graph, &common::kernels(), &options).unwrap();
        let inputs = Inputs::new().texture("source", &source);
        for _ in 0..2 {
            let execution = backend.execute(&plan, &inputs).unwrap();
            let expected: Vec<f32> = reds(&source).iter().map(|v| v + 9.0).collect();
            assert_eq!(reds(execution.output("result").unwrap()), expected);
        }
    });
}
