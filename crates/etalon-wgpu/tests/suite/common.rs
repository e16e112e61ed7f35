//! Devices, kernels and images that the tests share.

use std::cell::RefCell;

use etalon_core::Format;
use etalon_core::backend::{Backend, BackendError, CapturedData, Execution, Inputs};
use etalon_core::format::SampleKind;
use etalon_core::graph::Graph;
use etalon_core::image::ImageData;
use etalon_core::kernel::{Arithmetic, KernelLibrary};
use etalon_core::plan::{Capture, Plan, PlanOptions};
use etalon_core::resource::{BufferDesc, TextureDesc};
use etalon_wgpu::{WgpuBackend, WgpuOptions, wgpu};

/// A way from a plan to a device.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Route {
    /// Vulkan, with SPIR-V handed through.
    Vulkan,
    /// Vulkan, with kernels translated by wgpu.
    Translated,
    /// OpenGL.
    Gl,
}

pub(crate) const ROUTES: [Route; 3] = [Route::Vulkan, Route::Translated, Route::Gl];

impl Route {
    pub(crate) fn options(self) -> WgpuOptions {
        WgpuOptions {
            backends: match self {
                Self::Gl => wgpu::Backends::GL,
                Self::Vulkan | Self::Translated => wgpu::Backends::VULKAN,
            },
            passthrough: self == Self::Vulkan,
            validation: true,
            ..WgpuOptions::default()
        }
    }
}

/// Whether something missing is a failure.
fn required(what: &str) -> bool {
    std::env::var("ETALON_REQUIRE")
        .is_ok_and(|list| list.split(',').any(|name| name.trim() == what))
}

thread_local! {
    /// What the validation layer has said on this thread.
    static COMPLAINTS: RefCell<Vec<String>> = const { RefCell::new(Vec::new()) };
}

/// Hears what wgpu logs of the validation layer, on the thread whose call it is
/// about.
struct Listener;

impl log::Log for Listener {
    fn enabled(&self, metadata: &log::Metadata<'_>) -> bool {
        metadata.level() <= log::Level::Warn && metadata.target().starts_with("wgpu_hal::vulkan")
    }

    fn log(&self, record: &log::Record<'_>) {
        let message = record.args().to_string();
        let missing = message.contains("unable to find layer");
        assert!(!missing || !required("validation"), "{message}");
        // WGSL's number among the source languages of SPIR-V, with which wgpu
        // marks what it translates, is newer than some layers.
        let unknown = message.contains("Invalid source language operand: 10");
        let error = self.enabled(record.metadata()) && record.level() == log::Level::Error;
        // What follows a message, one line each, is about it.
        let more = message.starts_with('\t');
        if error && !unknown && !more {
            COMPLAINTS.with_borrow_mut(|complaints| complaints.push(message));
        }
    }

    fn flush(&self) {}
}

/// Begins to listen, on every thread.
fn listen() {
    if log::set_logger(&Listener).is_ok() {
        log::set_max_level(log::LevelFilter::Warn);
    }
}

/// Fails if the validation layer has complained on this thread.
fn assert_silent() {
    let complaints = COMPLAINTS.take();
    assert!(
        complaints.is_empty(),
        "validation: {}",
        complaints.join("\n")
    );
}

#[test]
#[should_panic(expected = "planted")]
fn complaints_of_the_validation_layer_are_heard() {
    listen();
    log::error!(target: "wgpu_hal::vulkan::instance", "planted");
    assert_silent();
}

/// Opens a device, or says why there is none.
pub(crate) fn open(route: Route) -> Option<WgpuBackend> {
    listen();
    match WgpuBackend::new(&route.options()) {
        Ok(backend) => Some(backend),
        Err(error @ BackendError::NoDevice { .. }) => {
            // OpenGL is extra: CI requires one Vulkan driver.
            assert!(
                !required("wgpu") || route == Route::Gl,
                "{route:?}: {error}"
            );
            println!("skipped on {route:?}: {error}");
            None
        }
        Err(error) => panic!("{route:?}: {error}"),
    }
}

/// Runs a test on Vulkan, both ways.
pub(crate) fn on_vulkan(test: impl Fn(&mut WgpuBackend)) {
    for route in [Route::Vulkan, Route::Translated] {
        if let Some(mut backend) = open(route) {
            println!("{route:?}: {}", backend.info());
            test(&mut backend);
            assert_silent();
        }
    }
}

/// Runs a test on every route.
pub(crate) fn everywhere(test: impl Fn(Route, &mut WgpuBackend)) {
    for route in ROUTES {
        if let Some(mut backend) = open(route) {
            println!("{route:?}: {}", backend.info());
            test(route, &mut backend);
            assert_silent();
        }
    }
}

/// A strict plan of everything the graph asks for.
pub(crate) fn plan(
    backend: &WgpuBackend,
    graph: &Graph,
    library: &KernelLibrary,
    capture: Capture,
) -> Plan {
    let options = PlanOptions {
        arithmetic: Arithmetic::Strict,
        limits: backend.limits(),
        capture,
        memory: backend.memory(),
    };
    Plan::new(graph, library, &options).unwrap_or_else(|error| panic!("{error}"))
}

/// Plans and runs once, capturing outputs.
pub(crate) fn run(
    backend: &mut WgpuBackend,
    graph: &Graph,
    library: &KernelLibrary,
    inputs: &Inputs<'_>,
) -> Execution {
    let plan = plan(backend, graph, library, Capture::Outputs);
    backend
        .execute(&plan, inputs)
        .unwrap_or_else(|error| panic!("{error}"))
}

/// A library with one added kernel.
pub(crate) fn library(path: &str, source: &str) -> KernelLibrary {
    let mut library = KernelLibrary::new();
    library.add_source(path, source);
    library
}

/// A kernel that copies one texel per invocation into a storage texture.
pub(crate) fn copy_kernel(format: Format) -> String {
    let ty = match format.sample_kind() {
        SampleKind::Float | SampleKind::Depth => "f32",
        SampleKind::Sint => "i32",
        SampleKind::Uint => "u32",
    };
    format!(
        "@group(0) @binding(0) var source: texture_2d<{ty}>;
         @group(0) @binding(1) var result: texture_storage_2d<{format}, write>;
         @compute @workgroup_size(8, 8)
         fn main(@builtin(global_invocation_id) id: vec3u) {{
             let size = textureDimensions(result);
             if id.x >= size.x || id.y >= size.y {{ return; }}
             textureStore(result, id.xy, textureLoad(source, id.xy, 0));
         }}"
    )
}

/// Bytes that say where they are and look like nothing else.
pub(crate) fn noise(length: usize, seed: u32) -> Vec<u8> {
    let mut state = seed.wrapping_mul(0x9e37_79b9) | 1;
    (0..length)
        .map(|_| {
            // xorshift32 (Marsaglia, 2003).
            state ^= state << 13;
            state ^= state >> 17;
            state ^= state << 5;
            (state >> 11) as u8
        })
        .collect()
}

/// An image whose every texel differs from its neighbours and which loads and
/// stores without change: floats are finite and normal, in the format's range.
pub(crate) fn image(desc: TextureDesc) -> ImageData {
    let length = desc.bytes().expect("a small image") as usize;
    let mut bytes = noise(length, length as u32);
    match desc.format {
        Format::R16Float | Format::Rg16Float | Format::Rgba16Float => {
            for half in bytes.chunks_exact_mut(2) {
                // An exponent of 01xxx: from 2^-7 to 2^0.
                half[1] = half[1] & 0x83 | 0x20 | half[1] & 0x1c;
            }
        }
        Format::R32Float | Format::Rg32Float | Format::Rgba32Float | Format::Depth32Float => {
            for float in bytes.chunks_exact_mut(4) {
                // From 0.5 to 1, so that it is also a depth.
                float[3] = 0x3f;
                float[2] &= 0x7f;
            }
        }
        Format::Rg11b10Ufloat => {
            for texel in bytes.chunks_exact_mut(4) {
                let [r, g, b] = [
                    0x1e0 | u32::from(texel[0]) & 0x1f,
                    0x200 | u32::from(texel[1]) & 0x3f,
                    0x1c0 | u32::from(texel[2]) & 0x1f,
                ];
                texel.copy_from_slice(&(r | g << 11 | (b & 0x3ff) << 22).to_le_bytes());
            }
        }
        _ => {}
    }
    ImageData::from_bytes(desc, bytes).expect("the length is the description's")
}

/// The 32-bit words of a buffer captured as an output.
pub(crate) fn words(execution: &Execution, output: &str) -> Vec<u32> {
    let bytes = execution
        .captures
        .iter()
        .find_map(|captured| match &captured.data {
            CapturedData::Buffer(bytes)
                if captured.pass == "output" && captured.binding == output =>
            {
                Some(bytes)
            }
            _ => None,
        })
        .expect("the buffer was captured");
    bytes
        .chunks_exact(4)
        .map(|bytes| u32::from_le_bytes(bytes.try_into().expect("four bytes")))
        .collect()
}

/// The texels of an image of one 32-bit channel.
pub(crate) fn uints(image: &ImageData) -> Vec<u32> {
    assert_eq!(image.desc.format.texel_bytes(), 4);
    image
        .bytes
        .chunks_exact(4)
        .map(|bytes| u32::from_le_bytes(bytes.try_into().expect("four bytes")))
        .collect()
}

/// The texels of an image of one 32-bit float channel.
pub(crate) fn floats(image: &ImageData) -> Vec<f32> {
    uints(image).into_iter().map(f32::from_bits).collect()
}

/// A kernel with `f16`, in a buffer too, and a graph that runs it: 6 and 1.5 as
/// `f16`s.
pub(crate) fn half_floats() -> (KernelLibrary, Graph) {
    let library = library(
        "test/half",
        "enable f16;
         @group(0) @binding(0) var<storage, read_write> halves: array<f16>;
         @compute @workgroup_size(1)
         fn main(@builtin(global_invocation_id) id: vec3u) {
             let two = f16(id.x) + 2.0h;
             halves[0] = two * 3.0h;
             halves[1] = 3.0h / two;
         }",
    );
    let mut graph = Graph::new();
    let halves = graph.buffer("halves", BufferDesc { bytes: 4 });
    let halves = graph
        .compute("test/half")
        .write_buffer("halves", halves)
        .groups([1, 1, 1])
        .and_then(|written| written.buffer("halves"))
        .expect("one buffer is written");
    graph
        .output_buffer("halves", halves)
        .expect("there is no other output");
    (library, graph)
}
