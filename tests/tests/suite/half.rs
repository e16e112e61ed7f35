//! `f16` in kernels of a graph: on every executor whose device has it, and a
//! typed error on the others.

use etalon::backend::{Backend, BackendError, CapturedData, Inputs};
use etalon::graph::Graph;
use etalon::kernel::{Arithmetic, KernelLibrary, Need};
use etalon::plan::Capture;
use etalon::resource::BufferDesc;
use etalon_tests::{executors, plan_for};

/// Every way in which `f16` lies in memory: alone, in vectors and matrices, next
/// to numbers of 32 bits, written by neighbours at once, and in a workgroup.
const KERNEL: &str = "
enable f16;
struct S {
    a: f16,
    b: vec3<f16>,
    c: f16,
    m: mat3x3<f16>,
    n: mat2x2<f16>,
    list: array<f16, 5>,
    e: f32,
    v: vec2<f16>,
}
@group(0) @binding(0) var<storage, read> data: array<S>;
@group(0) @binding(1) var<storage, read_write> result: array<S>;
@group(0) @binding(2) var<storage, read_write> flat: array<f16>;
var<workgroup> kept: array<f16, 64>;
@compute @workgroup_size(64)
fn main(@builtin(local_invocation_index) i: u32) {
    let s = data[i];
    kept[i] = s.a * s.v.x - s.v.y;
    workgroupBarrier();
    var list = s.list;
    list[i % 5u] = kept[63u - i];
    result[i].a = s.a + s.c / s.b.z;
    result[i].b = s.b * s.a + s.b.zyx;
    result[i].c = sqrt(abs(s.c));
    result[i].m = s.m * s.a;
    result[i].n = transpose(s.n);
    result[i].list = list;
    result[i].e = f32(s.v.x) + s.e;
    result[i].v = vec2(f16(s.e), f16(i));
    flat[i] = kept[i ^ 1u];
}
";

const STRUCT: usize = 72;

/// Ordinary numbers, every `f16` of them with a few bits to spare.
fn data() -> Vec<u8> {
    let mut bytes = Vec::new();
    for i in 0..64_u32 {
        for half in 0..STRUCT as u32 / 2 {
            // From 0.5 to 4, of either sign.
            let mix = (i * 131 + half * 37) % 509;
            let code = 0x3800 + mix * 6 + (mix & 1) * 0x8000;
            bytes.extend((code as u16).to_le_bytes());
        }
        let start = i as usize * STRUCT;
        let e = 0.75 + i as f32 * 0.125;
        bytes[start + 60..start + 64].copy_from_slice(&e.to_le_bytes());
    }
    bytes
}

fn run(
    executor: &mut dyn Backend,
    library: &KernelLibrary,
    arithmetic: Arithmetic,
) -> Result<Vec<Vec<u8>>, BackendError> {
    let data = data();
    let bytes = data.len() as u64;
    let mut graph = Graph::new();
    let input = graph.import_buffer("data", BufferDesc { bytes }).unwrap();
    let result = graph.buffer("result", BufferDesc { bytes });
    let flat = graph.buffer("flat", BufferDesc { bytes: 128 });
    let written = graph
        .compute("test/half")
        .read_buffer("data", input)
        .write_buffer("result", result)
        .write_buffer("flat", flat)
        .groups([1, 1, 1])
        .unwrap();
    for name in ["result", "flat"] {
        graph
            .output_buffer(name, written.buffer(name).unwrap())
            .unwrap();
    }
    let plan = plan_for(executor, &graph, library, arithmetic, Capture::Outputs).unwrap();
    let execution = executor.execute(&plan, &Inputs::new().buffer("data", &data))?;
    let mut captures = execution.captures;
    captures.sort_by(|a, b| a.binding.cmp(&b.binding));
    Ok(captures
        .into_iter()
        .map(|captured| match captured.data {
            CapturedData::Buffer(bytes) => bytes,
            CapturedData::Texture(_) => panic!("a texture"),
        })
        .collect())
}

/// Without the bytes between members, which nobody writes.
fn members(result: &[u8]) -> Vec<Vec<u8>> {
    // Members and columns with their sizes: WGSL §14.4.1.
    let parts = [
        (0, 2),
        (8, 6),
        (14, 2),
        (16, 6),
        (24, 6),
        (32, 6),
        (40, 8),
        (48, 10),
        (60, 4),
        (64, 4),
    ];
    result
        .chunks(STRUCT)
        .flat_map(|one| parts.map(|(start, size)| one[start..start + size].to_vec()))
        .collect()
}

#[test]
fn half_floats_are_the_same_everywhere_or_refused_by_name() {
    let mut library = KernelLibrary::new();
    library.add_source("test/half", KERNEL);
    let mut first: Option<Vec<Vec<u8>>> = None;
    for mut executor in executors() {
        let info = executor.info();
        let captured = match run(executor.as_mut(), &library, Arithmetic::Strict) {
            Ok(captured) => captured,
            Err(BackendError::Lacking {
                kernel,
                need,
                feature,
                ..
            }) => {
                assert_ne!(info.backend, "cpu", "the interpreter has everything");
                assert_eq!((kernel.as_str(), &need), ("test/half", &Need::F16));
                assert!(
                    ["SHADER_F16", "shaderFloat16"].contains(&feature),
                    "{feature}"
                );
                eprintln!("{info} lacks {feature}");
                continue;
            }
            Err(error) => panic!("{info}: {error}"),
        };
        let [flat, result] = &captured[..] else {
            panic!("{info}: {} buffers", captured.len());
        };
        let mut parts = members(result);
        parts.push(flat.clone());
        match &first {
            None => first = Some(parts),
            Some(first) => {
                for (at, (want, got)) in first.iter().zip(&parts).enumerate() {
                    let place = (at / 10, at % 10);
                    assert_eq!(got, want, "{info}: struct and member {place:?}");
                }
            }
        }
    }
}
