//! What plans do that a GPU hides, through the backend: by step, at the place in
//! the file that was written, imports and histories included.

use etalon_core::Format;
use etalon_core::backend::{Backend, Inputs};
use etalon_core::graph::{ClearValue, Graph};
use etalon_core::image::ImageData;
use etalon_core::kernel::{Arithmetic, KernelLibrary};
use etalon_core::plan::{Capture, Plan, PlanOptions};
use etalon_core::resource::TextureDesc;
use etalon_cpu::{Checks, CpuBackend, CpuOptions, FindingKind as K};

const R32: Format = Format::R32Float;

/// Imported by kernels.
const LIB: &str = "
// Padding, so that lines differ from those of the kernel.

fn ratio(a: f32, b: f32) -> f32 {
    let difference = a - b;
    return 1.0 + difference / b;
}
";

/// Divides by what may be zero, one column to the right.
const RATIO: &str = "import package::test::ratio_lib::ratio;

@group(0) @binding(0) var source: texture_2d<f32>;
@group(0) @binding(1) var result: texture_storage_2d<r32float, write>;

@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    let size = textureDimensions(result);
    if (id.x >= size.x || id.y >= size.y) { return; }
    let here = textureLoad(source, id.xy, 0).x;
    let right = textureLoad(source, id.xy + vec2<u32>(1u, 0u), 0).x;
    textureStore(result, id.xy, vec4<f32>(ratio(here, right), 0.0, 0.0, 1.0));
}
";

/// Writes the rows whose number is a multiple of a step.
const ROWS: &str = "struct Params { step: u32 }
@group(0) @binding(2) var<uniform> params: Params;
@group(0) @binding(0) var source: texture_2d<f32>;
@group(0) @binding(1) var result: texture_storage_2d<r32float, write>;
@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    let size = textureDimensions(result);
    if (id.x >= size.x || id.y >= size.y || id.y % params.step != 0u) { return; }
    textureStore(result, id.xy, textureLoad(source, id.xy, 0));
}
";

fn library() -> KernelLibrary {
    let mut library = KernelLibrary::new();
    for (path, source) in [
        ("test/ratio_lib", LIB),
        ("test/ratio", RATIO),
        ("test/rows", ROWS),
    ] {
        library.add_source(path, source);
    }
    library
}

fn backend(checks: Checks) -> CpuBackend {
    CpuBackend::new(&CpuOptions {
        threads: 2,
        checks,
        ..CpuOptions::default()
    })
    .unwrap()
}

fn plan(backend: &CpuBackend, graph: &Graph) -> Plan {
    let options = PlanOptions {
        arithmetic: Arithmetic::Fast,
        limits: backend.limits(),
        capture: Capture::Outputs,
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

/// Line and column of `what` in a file.
fn place(file: &str, what: &str) -> (u32, u32) {
    let at = file.find(what).unwrap();
    let before = &file[..at];
    let line = before.matches('\n').count() as u32 + 1;
    (
        line,
        (at - before.rfind('\n').map_or(0, |n| n + 1)) as u32 + 1,
    )
}

#[test]
fn places_are_those_of_the_files_that_were_written() {
    let mut backend = backend(Checks::all());
    let source = image(20, 10, |x, y| if x == 5 && y == 9 { 0.0 } else { 1.0 });
    let mut graph = Graph::new();
    let imported = graph.import_texture("source", source.desc).unwrap();
    let result = graph.texture("result", source.desc);
    let result = graph
        .compute("test/ratio")
        .read("source", imported)
        .write("result", result)
        .per_texel("result")
        .unwrap();
    graph.output("result", result).unwrap();
    let plan = plan(&backend, &graph);
    let inputs = Inputs::new().texture("source", &source);
    let first = backend.execute(&plan, &inputs).unwrap();
    let found = backend.take_findings();
    assert!(backend.findings().is_empty());
    let got: Vec<_> = found
        .list
        .iter()
        .map(|entry| {
            let finding = &entry.finding;
            (
                entry.step.as_str(),
                finding.kind,
                finding.location.file.as_str(),
                (finding.location.line, finding.location.column),
                finding.workgroup,
                finding.invocation,
                finding.count,
            )
        })
        .collect();
    let outside = place(RATIO, "textureLoad(source, id.xy + ");
    let division = place(LIB, "difference / b");
    // The zero texel is right of column 4; beyond the last column is 0, too.
    assert_eq!(
        got,
        [
            (
                "test/ratio",
                K::Texel,
                "test/ratio.wesl",
                outside,
                [2, 0, 0],
                [3, 0, 0],
                10
            ),
            (
                "test/ratio",
                K::NonFinite,
                "test/ratio_lib.wesl",
                division,
                [2, 0, 0],
                [3, 0, 0],
                11
            ),
        ],
        "{}",
        found
            .list
            .iter()
            .map(|entry| format!("{entry}\n"))
            .collect::<String>()
    );
    // Another frame counts on.
    backend.execute(&plan, &inputs).unwrap();
    backend.execute(&plan, &inputs).unwrap();
    assert_eq!(backend.findings().list[0].finding.count, 20);
    // What is watched comes out as what is not.
    let mut plain = self::backend(Checks::NONE);
    let plain_result = plain.execute(&plan, &inputs).unwrap();
    assert_eq!(
        plain_result.output("result").unwrap().bytes,
        first.output("result").unwrap().bytes
    );
    assert!(plain.findings().is_empty());
}

/// Passes of `test/rows`, each with its step.
fn rows(desc: TextureDesc, steps: &[u32]) -> Graph {
    let mut graph = Graph::new();
    let mut newest = graph.import_texture("source", desc).unwrap();
    for (i, &step) in steps.iter().enumerate() {
        let result = graph.texture(format!("rows {i}"), desc);
        newest = graph
            .compute("test/rows")
            .named(format!("pass {i}"))
            .read("source", newest)
            .write("result", result)
            .set("step", step)
            .per_texel("result")
            .unwrap();
    }
    graph.output("result", newest).unwrap();
    graph
}

#[test]
fn transient_textures_are_unwritten_in_every_frame_even_if_memory_is_shared() {
    let mut backend = backend(Checks::all());
    let source = image(16, 8, |x, _| x as f32);
    // The third and the fifth texture take the place of the first; only half of
    // the rows of the third are written.
    let graph = rows(source.desc, &[1, 1, 2, 1, 1]);
    let plan = plan(&backend, &graph);
    let inputs = Inputs::new().texture("source", &source);
    for frame in 1..=2 {
        backend.execute(&plan, &inputs).unwrap();
        let found = backend.findings();
        let got: Vec<_> = found
            .list
            .iter()
            .map(|entry| (entry.step.as_str(), entry.finding.kind, entry.finding.count))
            .collect();
        // Pass 3 reads all of what pass 2 wrote half of, and writes all.
        assert_eq!(got, [("pass 3", K::Uninitialised, 64 * frame)], "{found:?}");
        assert!(
            found.list[0]
                .finding
                .message
                .contains("texel (0, 1) of `source`"),
            "{}",
            found.list[0]
        );
    }
    let whole = rows(source.desc, &[1, 1, 1]);
    let plan = self::plan(&backend, &whole);
    backend.take_findings();
    backend.execute(&plan, &inputs).unwrap();
    assert!(backend.findings().is_empty(), "{:?}", backend.findings());
}

#[test]
fn histories_hold_what_the_last_frame_wrote() {
    let mut backend = backend(Checks::all());
    let source = image(16, 8, |x, _| x as f32);
    let mut graph = Graph::new();
    let imported = graph.import_texture("source", source.desc).unwrap();
    let history = graph
        .history("past", source.desc, ClearValue::Float([0.0; 4]))
        .unwrap();
    // All of it is read, a quarter is written.
    let read = graph.texture("read", source.desc);
    let read = graph
        .compute("test/rows")
        .named("reads")
        .read("source", history.previous)
        .write("result", read)
        .set("step", 1_u32)
        .per_texel("result")
        .unwrap();
    let written = graph
        .compute("test/rows")
        .named("writes")
        .read("source", imported)
        .write("result", history.current)
        .set("step", 4_u32)
        .per_texel("result")
        .unwrap();
    graph.output("read", read).unwrap();
    graph.output("written", written).unwrap();
    let plan = plan(&backend, &graph);
    let inputs = Inputs::new().texture("source", &source);
    // Its first contents are its initial value.
    for count in [0, 96, 96] {
        backend.execute(&plan, &inputs).unwrap();
        let found = backend.take_findings();
        let total: u64 = found.list.iter().map(|entry| entry.finding.count).sum();
        assert_eq!(total, count, "{found:?}");
        assert!(
            found.list.iter().all(|entry| entry.step == "reads"),
            "{found:?}"
        );
    }
}
