//! Kernels of every kind of binding, against results known in closed form.

use std::borrow::Cow;

use crate::common::{
    Route, copy_kernel, everywhere, floats, image, library, noise, on_vulkan, plan, run, uints,
    words,
};
use etalon_core::Format;
use etalon_core::backend::{Backend, BackendError, CapturedData, Inputs};
use etalon_core::graph::{ClearValue, Graph};
use etalon_core::image::ImageData;
use etalon_core::kernel::{Arithmetic, KernelLibrary};
use etalon_core::plan::{Capture, Plan, PlanOptions};
use etalon_core::resource::{BufferDesc, Dimension, Extent, SamplerDesc, TextureDesc};
use etalon_wgpu::{WgpuBackend, wgpu};

#[test]
fn a_copy_of_each_texel_is_the_image_at_any_size() {
    for (width, height) in [(1, 1), (1, 4096), (7, 13), (257, 129)] {
        everywhere(|_, backend| {
            let desc = TextureDesc::d2(width, height, Format::Rgba16Float);
            let image = image(desc);
            let library = library("test/copy", &copy_kernel(desc.format));
            let mut graph = Graph::new();
            let source = graph.import_texture("source", desc).unwrap();
            let target = graph.texture("target", desc);
            let target = graph
                .compute("test/copy")
                .read("source", source)
                .write("result", target)
                .per_texel("result")
                .unwrap();
            graph.output("image", target).unwrap();
            let inputs = Inputs::new().texture("source", &image);
            let execution = run(backend, &graph, &library, &inputs);
            assert_eq!(execution.output("image"), Some(&image));
        });
    }
}

#[test]
fn uniforms_arrive_by_name_whatever_their_padding() {
    everywhere(|_, backend| {
        let library = library(
            "test/uniforms",
            "struct Settings { scale: f32, count: u32, axis: vec3f, shift: i32, turn: mat3x3f, last: vec2u }
             @group(0) @binding(3) var<uniform> settings: Settings;
             @group(0) @binding(9) var<storage, read_write> seen: array<u32>;
             @compute @workgroup_size(1) fn main() {
                 seen[0] = bitcast<u32>(settings.scale);
                 seen[1] = settings.count;
                 for (var i = 0u; i < 3u; i++) { seen[2u + i] = bitcast<u32>(settings.axis[i]); }
                 seen[5] = bitcast<u32>(settings.shift);
                 for (var c = 0u; c < 3u; c++) {
                     for (var r = 0u; r < 3u; r++) { seen[6u + c * 3u + r] = bitcast<u32>(settings.turn[c][r]); }
                 }
                 seen[15] = settings.last.x;
                 seen[16] = settings.last.y;
             }",
        );
        let turn = [[1.0_f32, 2.0, 3.0], [4.0, 5.0, 6.0], [7.0, 8.0, 9.0]];
        let mut graph = Graph::new();
        let buffer = graph.buffer("seen", BufferDesc { bytes: 17 * 4 });
        let seen = graph
            .compute("test/uniforms")
            .write_buffer("seen", buffer)
            .set("last", glam::UVec2::new(70, 80))
            .set("turn", glam::Mat3::from_cols_array_2d(&turn))
            .set("shift", -3_i32)
            .set("axis", glam::Vec3::new(0.25, -0.5, 8.0))
            .set("count", 11_u32)
            .set("scale", 1.5_f32)
            .groups([1, 1, 1])
            .unwrap()
            .buffer("seen")
            .unwrap();
        graph.output_buffer("seen", seen).unwrap();
        let execution = run(backend, &graph, &library, &Inputs::new());
        let mut wanted = vec![1.5_f32.to_bits(), 11];
        wanted.extend([0.25_f32, -0.5, 8.0].map(f32::to_bits));
        wanted.push(-3_i32 as u32);
        wanted.extend(turn.as_flattened().iter().map(|value| value.to_bits()));
        wanted.extend([70, 80]);
        assert_eq!(words(&execution, "seen"), wanted);
    });
}

#[test]
fn each_mip_is_made_of_the_one_above() {
    everywhere(|route, backend| {
        let library = library(
            "test/max",
            "@group(0) @binding(0) var source: texture_2d<f32>;
             @group(0) @binding(1) var result: texture_storage_2d<r32float, write>;
             @compute @workgroup_size(4, 4)
             fn main(@builtin(global_invocation_id) id: vec3u) {
                 if any(id.xy >= textureDimensions(result)) { return; }
                 let end = textureDimensions(source) - 1u;
                 var best = 0.0;
                 for (var y = 0u; y < 2u; y++) {
                     for (var x = 0u; x < 2u; x++) {
                         best = max(best, textureLoad(source, min(id.xy * 2u + vec2u(x, y), end), 0).x);
                     }
                 }
                 textureStore(result, id.xy, vec4f(best));
             }",
        );
        let desc = TextureDesc::d2(13, 7, Format::R32Float);
        let base = image(desc);
        let mut graph = Graph::new();
        let source = graph.import_texture("base", desc).unwrap();
        let pyramid = graph.texture("pyramid", desc.with_mips(4));
        let pyramid = graph.copy(source, pyramid.mip(0)).unwrap();
        let pyramid = graph
            .compute("test/max")
            .per_mip("source", "result", pyramid)
            .unwrap();
        graph.output("pyramid", pyramid).unwrap();
        let inputs = Inputs::new().texture("base", &base);
        if route == Route::Gl {
            // wgpu's stores to mips other than those sampled get lost.
            let plan = plan(backend, &graph, &library, Capture::Outputs);
            let error = backend.execute(&plan, &inputs).unwrap_err();
            assert!(matches!(error, BackendError::Unsupported { .. }), "{error}");
            return;
        }
        let execution = run(backend, &graph, &library, &inputs);
        let result = execution.output("pyramid").unwrap();
        assert_eq!(result.mip(0), base.mip(0));
        let texel = |mip: u32, x: u32, y: u32| {
            let bytes = result.texel_bytes(x, y, 0, mip).unwrap();
            f32::from_le_bytes(bytes.try_into().unwrap())
        };
        for mip in 1..4 {
            let (above, size) = (result.desc.mip_extent(mip - 1), result.desc.mip_extent(mip));
            for y in 0..size.height {
                for x in 0..size.width {
                    let best = [(0, 0), (1, 0), (0, 1), (1, 1)]
                        .map(|(dx, dy)| {
                            let x = (2 * x + dx).min(above.width - 1);
                            let y = (2 * y + dy).min(above.height - 1);
                            texel(mip - 1, x, y)
                        })
                        .into_iter()
                        .fold(0.0, f32::max);
                    assert_eq!(texel(mip, x, y), best, "mip {mip} at {x}, {y}");
                }
            }
        }
    });
}

/// Reads `count` numbers and writes as many, or has its groups counted.
fn buffer_library() -> KernelLibrary {
    let mut library = library(
        "test/map",
        "@group(0) @binding(0) var<storage, read> values: array<u32>;
         @group(0) @binding(1) var<storage, read_write> results: array<u32>;
         @compute @workgroup_size(64)
         fn main(@builtin(global_invocation_id) id: vec3u) {
             if id.x < arrayLength(&values) { results[id.x] = values[id.x] * 3u + arrayLength(&results); }
         }",
    );
    library.add_source(
        "test/mark",
        "@group(0) @binding(0) var<storage, read_write> marks: array<u32>;
         @compute @workgroup_size(1)
         fn main(@builtin(workgroup_id) id: vec3u, @builtin(num_workgroups) count: vec3u) {
             marks[id.x + id.y * count.x + id.z * count.x * count.y] = 1u + id.x + 10u * id.y + 100u * id.z;
         }",
    );
    library.add_source(
        "test/arguments",
        "@group(0) @binding(0) var<storage, read_write> arguments: array<u32>;
         @compute @workgroup_size(1) fn main() {
             arguments[4] = 3u; arguments[5] = 2u; arguments[6] = 1u;
         }",
    );
    library
}

#[test]
fn storage_buffers_have_the_length_they_were_declared_with() {
    everywhere(|_, backend| {
        let values: Vec<u32> = (0..1000).map(|i| i * i).collect();
        let mut graph = Graph::new();
        let desc = BufferDesc { bytes: 4000 };
        let source = graph.import_buffer("values", desc).unwrap();
        let results = graph.buffer("results", desc);
        let results = graph
            .compute("test/map")
            .read_buffer("values", source)
            .write_buffer("results", results)
            .groups([16, 1, 1])
            .unwrap()
            .buffer("results")
            .unwrap();
        graph.output_buffer("results", results).unwrap();
        let bytes: Vec<u8> = values
            .iter()
            .flat_map(|value| value.to_le_bytes())
            .collect();
        let inputs = Inputs::new().buffer("values", &bytes);
        let execution = run(backend, &graph, &buffer_library(), &inputs);
        let wanted: Vec<u32> = values.iter().map(|value| value * 3 + 1000).collect();
        assert_eq!(words(&execution, "results"), wanted);
    });
}

#[test]
fn a_buffer_says_how_many_groups_run() {
    everywhere(|_, backend| {
        let mut graph = Graph::new();
        let arguments = graph.buffer("arguments", BufferDesc { bytes: 32 });
        let arguments = graph.clear_buffer(arguments).unwrap();
        let arguments = graph
            .compute("test/arguments")
            .update_buffer("arguments", arguments)
            .groups([1, 1, 1])
            .unwrap()
            .buffer("arguments")
            .unwrap();
        for (name, offset) in [("some", 16), ("none", 0)] {
            let marks = graph.buffer(name, BufferDesc { bytes: 32 });
            let marks = graph.clear_buffer(marks).unwrap();
            let marks = graph
                .compute("test/mark")
                .update_buffer("marks", marks)
                .indirect(arguments, offset)
                .unwrap()
                .buffer("marks")
                .unwrap();
            graph.output_buffer(name, marks).unwrap();
        }
        let execution = run(backend, &graph, &buffer_library(), &Inputs::new());
        assert_eq!(words(&execution, "some"), [1, 2, 3, 11, 12, 13, 0, 0]);
        assert_eq!(words(&execution, "none"), [0; 8]);
    });
}

#[test]
fn no_groups_do_nothing() {
    everywhere(|_, backend| {
        let mut graph = Graph::new();
        let marks = graph.buffer("marks", BufferDesc { bytes: 16 });
        let marks = graph.clear_buffer(marks).unwrap();
        let marks = graph
            .compute("test/mark")
            .update_buffer("marks", marks)
            .groups([4, 0, 1])
            .unwrap()
            .buffer("marks")
            .unwrap();
        graph.output_buffer("marks", marks).unwrap();
        let before = backend.counters();
        let execution = run(backend, &graph, &buffer_library(), &Inputs::new());
        assert_eq!(words(&execution, "marks"), [0; 4]);
        assert_eq!(backend.counters().dispatches, before.dispatches);
    });
}

#[test]
fn a_workgroup_adds_up_what_its_invocations_loaded() {
    everywhere(|_, backend| {
        let library = library(
            "test/sum",
            "@group(0) @binding(0) var source: texture_2d<u32>;
             @group(0) @binding(1) var<storage, read_write> sums: array<u32>;
             var<workgroup> partial: array<u32, 64>;
             @compute @workgroup_size(8, 8)
             fn main(@builtin(global_invocation_id) id: vec3u, @builtin(local_invocation_index) local: u32,
                     @builtin(workgroup_id) group: vec3u, @builtin(num_workgroups) count: vec3u) {
                 let size = textureDimensions(source);
                 if all(id.xy < size) { partial[local] = textureLoad(source, id.xy, 0).x; }
                 workgroupBarrier();
                 for (var step = 32u; step > 0u; step >>= 1u) {
                     if local < step { partial[local] += partial[local + step]; }
                     workgroupBarrier();
                 }
                 if local == 0u { sums[group.x + group.y * count.x] = partial[0]; }
             }",
        );
        let desc = TextureDesc::d2(21, 10, Format::R32Uint);
        let image = image(desc);
        let mut graph = Graph::new();
        let source = graph.import_texture("source", desc).unwrap();
        let sums = graph.buffer("sums", BufferDesc { bytes: 6 * 4 });
        let sums = graph
            .compute("test/sum")
            .read("source", source)
            .write_buffer("sums", sums)
            .groups([3, 2, 1])
            .unwrap()
            .buffer("sums")
            .unwrap();
        graph.output_buffer("sums", sums).unwrap();
        let inputs = Inputs::new().texture("source", &image);
        let execution = run(backend, &graph, &library, &inputs);
        let mut wanted = [0_u32; 6];
        for (place, value) in image.texels(0).zip(uints(&image)) {
            let group = (place.0.x / 8 + place.0.y / 8 * 3) as usize;
            // Texels beyond the image are workgroup memory, which starts zeroed.
            wanted[group] = wanted[group].wrapping_add(value);
        }
        assert_eq!(words(&execution, "sums"), wanted);
    });
}

#[test]
fn layers_slices_and_faces_are_told_apart() {
    let shapes = [
        (
            Dimension::D2,
            3,
            "texture_2d_array",
            "texture_storage_2d_array",
        ),
        (Dimension::D3, 5, "texture_3d", "texture_storage_3d"),
    ];
    for (dimension, depth_or_layers, texture, storage) in shapes {
        everywhere(|route, backend| {
            let library = library(
                "test/deep",
                &format!(
                    "@group(0) @binding(0) var source: {texture}<u32>;
                     @group(0) @binding(1) var result: {storage}<r32uint, write>;
                     @compute @workgroup_size(4, 4, 2)
                     fn main(@builtin(global_invocation_id) id: vec3u) {{
                         if any(id.xy >= textureDimensions(result).xy) || id.z >= {depth_or_layers}u {{ return; }}
                         let here = {load};
                         textureStore(result, {place}, vec4u(here.x + id.z));
                     }}",
                    load = if dimension == Dimension::D3 {
                        "textureLoad(source, id, 0)"
                    } else {
                        "textureLoad(source, id.xy, id.z, 0)"
                    },
                    place = if dimension == Dimension::D3 { "id" } else { "id.xy, id.z" },
                ),
            );
            let desc = TextureDesc {
                dimension,
                extent: Extent {
                    width: 9,
                    height: 6,
                    depth_or_layers,
                },
                mips: 1,
                format: Format::R32Uint,
            };
            let image = image(desc);
            let mut graph = Graph::new();
            let source = graph.import_texture("source", desc).unwrap();
            let target = graph.texture("target", desc);
            let target = graph
                .compute("test/deep")
                .read("source", source)
                .write("result", target)
                .per_texel("result")
                .unwrap();
            graph.output("image", target).unwrap();
            let inputs = Inputs::new().texture("source", &image);
            if route == Route::Gl && dimension == Dimension::D3 {
                // wgpu would store to the first slice only.
                let plan = plan(backend, &graph, &library, Capture::Outputs);
                let error = backend.execute(&plan, &inputs).unwrap_err();
                assert!(matches!(error, BackendError::Unsupported { .. }), "{error}");
                return;
            }
            let execution = run(backend, &graph, &library, &inputs);
            let result = execution.output("image").unwrap();
            assert_eq!(result.desc, desc);
            let wanted: Vec<u32> = image
                .texels(0)
                .zip(uints(&image))
                .map(|((place, _), value)| value.wrapping_add(place.layer))
                .collect();
            assert_eq!(uints(result), wanted);
        });
    }
}

#[test]
fn cubes_are_seen_as_cubes_and_as_layers() {
    on_vulkan(|backend| {
        // The middle of each face, and the texel it must be: with an odd size
        // there is one.
        let library = library(
            "test/faces",
            "@group(0) @binding(0) var cube: texture_cube<f32>;
             @group(0) @binding(1) var nearest: sampler;
             @group(0) @binding(2) var layers: texture_2d_array<f32>;
             @group(0) @binding(3) var<storage, read_write> seen: array<f32>;
             @compute @workgroup_size(1) fn main() {
                 var axes = array(vec3f(1, 0, 0), vec3f(-1, 0, 0), vec3f(0, 1, 0), vec3f(0, -1, 0), vec3f(0, 0, 1), vec3f(0, 0, -1));
                 for (var face = 0u; face < 6u; face++) {
                     seen[face] = textureSampleLevel(cube, nearest, axes[face], 0.0).x;
                     seen[6u + face] = textureLoad(layers, vec2u(2, 2), face, 0).x;
                 }
             }",
        );
        let desc = TextureDesc::cube(5, Format::R16Float);
        let image = image(desc);
        let mut graph = Graph::new();
        let cube = graph.import_texture("cube", desc).unwrap();
        let seen = graph.buffer("seen", BufferDesc { bytes: 48 });
        let seen = graph
            .compute("test/faces")
            .read("cube", cube)
            .read("layers", cube)
            .sampler("nearest", SamplerDesc::default())
            .write_buffer("seen", seen)
            .groups([1, 1, 1])
            .unwrap()
            .buffer("seen")
            .unwrap();
        graph.output_buffer("seen", seen).unwrap();
        // Samplers are a fast kernel's.
        let options = PlanOptions {
            arithmetic: Arithmetic::Fast,
            limits: backend.limits(),
            capture: Capture::Outputs,
            memory: backend.memory(),
        };
        let plan = Plan::new(&graph, &library, &options).unwrap();
        let execution = backend
            .execute(&plan, &Inputs::new().texture("cube", &image))
            .unwrap();
        let middles: Vec<u32> = (0..6)
            .map(|face| image.texel(2, 2, face, 0).unwrap().to_f32()[0].to_bits())
            .collect();
        let seen = words(&execution, "seen");
        assert_eq!(seen[..6], middles);
        assert_eq!(seen[6..], middles);
    });
}

#[test]
fn a_linear_sampler_meets_texels_at_their_centres_and_averages_between() {
    on_vulkan(|backend| {
        let library = library(
            "test/sample",
            "@group(0) @binding(0) var source: texture_2d<f32>;
             @group(0) @binding(1) var linear: sampler;
             @group(0) @binding(2) var<storage, read_write> seen: array<f32>;
             @compute @workgroup_size(1) fn main() {
                 for (var i = 0u; i < 8u; i++) {
                     seen[i] = textureSampleLevel(source, linear, vec2f((f32(i) + 1.0) / 8.0, 0.5), 0.0).x;
                 }
             }",
        );
        let desc = TextureDesc::d2(4, 1, Format::R16Float);
        let texels = [1.0_f32, 3.0, 0.5, 2.0];
        let image = ImageData::from_rgba_f32(desc, &texels.map(|x| [x, 0.0, 0.0, 1.0])).unwrap();
        let mut graph = Graph::new();
        let source = graph.import_texture("source", desc).unwrap();
        let seen = graph.buffer("seen", BufferDesc { bytes: 32 });
        let seen = graph
            .compute("test/sample")
            .read("source", source)
            .sampler("linear", SamplerDesc::LINEAR_CLAMP)
            .write_buffer("seen", seen)
            .groups([1, 1, 1])
            .unwrap()
            .buffer("seen")
            .unwrap();
        graph.output_buffer("seen", seen).unwrap();
        let options = PlanOptions {
            arithmetic: Arithmetic::Fast,
            limits: backend.limits(),
            capture: Capture::Outputs,
            memory: backend.memory(),
        };
        let plan = Plan::new(&graph, &library, &options).unwrap();
        let execution = backend
            .execute(&plan, &Inputs::new().texture("source", &image))
            .unwrap();
        let wanted = [1.0, 2.0, 3.0, 1.75, 0.5, 1.25, 2.0, 2.0];
        for (seen, wanted) in words(&execution, "seen").into_iter().zip(wanted) {
            // Vulkan lets weights have as few as 4 fractional bits
            // (subTexelPrecisionBits), of the largest step of 2.5.
            let seen = f32::from_bits(seen);
            assert!((seen - wanted).abs() <= 2.5 / 16.0, "{seen} for {wanted}");
        }
    });
}

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
fn depth_is_loaded_as_it_was_given() {
    everywhere(|route, backend| {
        for format in [Format::Depth32Float, Format::Depth16Unorm] {
            let desc = TextureDesc::d2(37, 11, format);
            let image = image(desc);
            let library = library("test/depth", &copy_kernel(Format::R32Float));
            let mut graph = Graph::new();
            let depth = graph.import_texture("depth", desc).unwrap();
            let target = graph.texture("target", desc.with_format(Format::R32Float));
            let target = graph
                .compute("test/depth")
                .read("source", depth)
                .write("result", target)
                .per_texel("result")
                .unwrap();
            graph.output("loaded", target).unwrap();
            let inputs = Inputs::new().texture("depth", &image);
            if route == Route::Gl && format == Format::Depth16Unorm {
                // OpenGL ES does not copy between depth textures and buffers.
                let plan = plan(backend, &graph, &library, Capture::Outputs);
                let error = backend.execute(&plan, &inputs).unwrap_err();
                assert!(error.to_string().contains("depth16unorm"), "{error}");
                continue;
            }
            let execution = run(backend, &graph, &library, &inputs);
            let wanted: Vec<f32> = image
                .texels(0)
                .map(|(_, texel)| texel.to_f32()[0])
                .collect();
            let seen = floats(execution.output("loaded").unwrap());
            for (seen, wanted) in seen.into_iter().zip(wanted) {
                // Vulkan converts 16-bit normalised values within one unit in
                // the last place of the quotient; 2⁻²⁴ is half of that near 1.
                let tolerance = if format == Format::Depth16Unorm {
                    1.2e-7
                } else {
                    0.0
                };
                assert!(
                    (seen - wanted).abs() <= tolerance,
                    "{format}: {seen} for {wanted}"
                );
            }
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
fn strict_arithmetic_gives_the_bits_of_ieee_754() {
    on_vulkan(|backend| {
        let library = library(
            "test/strict",
            "@group(0) @binding(0) var<storage, read> values: array<vec4f>;
             @group(0) @binding(1) var<storage, read_write> results: array<vec4f>;
             @compute @workgroup_size(64)
             fn main(@builtin(global_invocation_id) id: vec3u) {
                 let v = values[id.x];
                 results[id.x] = vec4f(v.x * v.y + v.z, v.x * v.y - v.z * v.w, v.x / v.y, sqrt(abs(v.z)) * v.w + v.x);
             }",
        );
        // Around one, where contraction would show in the last bits, and with
        // products that nearly cancel.
        let values: Vec<[f32; 4]> = noise(1024 * 16, 77)
            .chunks_exact(16)
            .map(|bytes| {
                let [x, y, z, w] = [0, 4, 8, 12].map(|at| {
                    let bits = u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap());
                    f32::from_bits(bits & 0x80ff_ffff | 0x3f00_0000)
                });
                if bytes[0] & 1 == 0 {
                    [x, y, -x * y, w]
                } else {
                    [x, y, z, w]
                }
            })
            .collect();
        let bytes: Vec<u8> = values
            .iter()
            .flatten()
            .flat_map(|value| value.to_le_bytes())
            .collect();
        let desc = BufferDesc {
            bytes: bytes.len() as u64,
        };
        let mut graph = Graph::new();
        let source = graph.import_buffer("values", desc).unwrap();
        let results = graph.buffer("results", desc);
        let results = graph
            .compute("test/strict")
            .read_buffer("values", source)
            .write_buffer("results", results)
            .groups([16, 1, 1])
            .unwrap()
            .buffer("results")
            .unwrap();
        graph.output_buffer("results", results).unwrap();
        let inputs = Inputs::new().buffer("values", &bytes);
        let execution = run(backend, &graph, &library, &inputs);
        let seen = words(&execution, "results");
        for ([x, y, z, w], seen) in values.iter().zip(seen.chunks_exact(4)) {
            let wanted = [x * y + z, x * y - z * w, x / y, z.abs().sqrt() * w + x];
            let seen = seen.iter().map(|bits| f32::from_bits(*bits));
            for (seen, wanted) in seen.zip(wanted) {
                // Equal, or both flushed to zero.
                let flushed = wanted.is_subnormal() && seen == 0.0;
                assert!(
                    seen == wanted || flushed || !backend.keeps_strict_arithmetic(),
                    "{seen:e} for {wanted:e} of {x:e}, {y:e}, {z:e}, {w:e}"
                );
            }
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
