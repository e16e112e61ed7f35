//! Kernels that see mips, layers, faces, slices, filtered texels and depth.

use crate::common::{
    Route, copy_kernel, everywhere, floats, image, library, on_vulkan, plan, run, uints, words,
};
use etalon_core::Format;
use etalon_core::backend::{Backend, BackendError, Inputs};
use etalon_core::graph::Graph;
use etalon_core::image::ImageData;
use etalon_core::kernel::Arithmetic;
use etalon_core::plan::{Capture, Plan, PlanOptions};
use etalon_core::resource::{BufferDesc, Dimension, Extent, SamplerDesc, TextureDesc};

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
