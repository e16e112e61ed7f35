//! Kernels of every kind of binding, against results known in closed form.

use crate::common::{copy_kernel, everywhere, image, library, noise, on_vulkan, run, uints, words};
use etalon_core::Format;
use etalon_core::backend::{Backend, Inputs};
use etalon_core::graph::Graph;
use etalon_core::kernel::KernelLibrary;
use etalon_core::resource::{BufferDesc, TextureDesc};

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

/// Reads `count` numbers and writes as many, or has its groups counted.
pub(crate) fn buffer_library() -> KernelLibrary {
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
