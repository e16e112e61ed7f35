//! Steps of draws, against pictures known in closed form.

mod buffers;
mod coverage;
mod extents;
mod refused;
mod state;
mod steps;
mod targets;

use crate::common::{Route, everywhere, library};
use etalon_core::Format;
use etalon_core::backend::{Backend, BackendError, Execution, Inputs};
use etalon_core::graph::{Buffer, ClearValue, Draw, Graph, Load, Texture};
use etalon_core::image::ImageData;
use etalon_core::kernel::{Arithmetic, KernelLibrary};
use etalon_core::plan::{Capture, Plan, PlanOptions};
use etalon_core::raster::{RasterState, VertexFormat, VertexLayout};
use etalon_core::resource::{BufferDesc, TextureDesc};
use etalon_core::texel::Texel;
use etalon_wgpu::WgpuBackend;

/// Zeros everywhere.
pub(super) const CLEAR: Load = Load::Clear(ClearValue::Float([0.0; 4]));

/// One colour, on triangles whose corners are given in clip space.
pub(super) const FLAT: &str = "
    struct Params { colour: vec4f }
    @group(0) @binding(3) var<uniform> params: Params;
    @vertex fn vertex(@location(0) position: vec4f) -> @builtin(position) vec4f { return position; }
    @fragment fn fragment() -> @location(0) vec4f { return params.colour; }";

/// A triangle over everything, of the colour that is the pixel's centre.
pub(super) const CENTRES: &str = "
    @vertex fn vertex(@builtin(vertex_index) index: u32) -> @builtin(position) vec4f {
        return vec4f(f32(index & 1u) * 4.0 - 1.0, f32(index >> 1u) * 4.0 - 1.0, 1.0, 1.0);
    }
    @fragment fn fragment(@builtin(position) position: vec4f) -> @location(0) vec4f {
        return vec4f(position.xy, 7.0, 1.0);
    }";

/// The kernels that most tests draw with.
pub(super) fn kernels() -> KernelLibrary {
    let mut library = library("test/flat", FLAT);
    library.add_source("test/centres", CENTRES);
    library
}

/// A graph, and what it imports.
#[derive(Default)]
pub(super) struct Scene {
    pub(super) graph: Graph,
    buffers: Vec<(&'static str, Vec<u8>)>,
    /// Whether kernels are fast, and may sample.
    pub(super) fast: bool,
}

impl Scene {
    /// A buffer with these bytes.
    pub(super) fn buffer(&mut self, name: &'static str, bytes: Vec<u8>) -> Buffer {
        let desc = BufferDesc {
            bytes: bytes.len() as u64,
        };
        self.buffers.push((name, bytes));
        self.graph.import_buffer(name, desc).unwrap()
    }

    /// A buffer with these floats.
    pub(super) fn floats(&mut self, name: &'static str, floats: &[f32]) -> Buffer {
        let bytes = floats.iter().flat_map(|value| value.to_le_bytes());
        self.buffer(name, bytes.collect())
    }

    /// A buffer with these words.
    pub(super) fn words(&mut self, name: &'static str, words: &[u32]) -> Buffer {
        let bytes = words.iter().flat_map(|value| value.to_le_bytes());
        self.buffer(name, bytes.collect())
    }

    /// A texture to draw to.
    pub(super) fn target(&mut self, size: (u32, u32), format: Format) -> Texture {
        let desc = TextureDesc::d2(size.0, size.1, format);
        self.graph.texture(format!("{format} target"), desc)
    }

    /// Draws into one cleared colour target, which becomes the output `image`.
    pub(super) fn draw(
        &mut self,
        size: (u32, u32),
        format: Format,
        draws: impl IntoIterator<Item = Draw>,
    ) {
        let target = self.target(size, format);
        let pass = self.graph.raster("draws").colour("colour", target, CLEAR);
        let written = pass.draws(draws).finish().unwrap();
        let image = written.texture("colour").unwrap();
        self.graph.output("image", image).unwrap();
    }

    /// Plans and runs once.
    pub(super) fn attempt(
        &self,
        backend: &mut WgpuBackend,
        library: &KernelLibrary,
    ) -> Result<Execution, BackendError> {
        let options = PlanOptions {
            arithmetic: match self.fast {
                true => Arithmetic::Fast,
                false => Arithmetic::Strict,
            },
            limits: backend.limits(),
            capture: Capture::Outputs,
            memory: backend.memory(),
        };
        let plan = Plan::new(&self.graph, library, &options).unwrap();
        let inputs = self
            .buffers
            .iter()
            .fold(Inputs::new(), |inputs, (name, bytes)| {
                inputs.buffer(*name, bytes)
            });
        backend.execute(&plan, &inputs)
    }

    /// Plans and runs once.
    pub(super) fn run(&self, backend: &mut WgpuBackend, library: &KernelLibrary) -> Execution {
        self.attempt(backend, library)
            .unwrap_or_else(|error| panic!("{error}"))
    }
}

/// Runs a scene on every route, on OpenGL unless it says that it cannot.
pub(super) fn on_routes(
    library: &KernelLibrary,
    scene: impl Fn() -> Scene,
    test: impl Fn(&Execution),
) {
    everywhere(|route, backend| match scene().attempt(backend, library) {
        Ok(execution) => test(&execution),
        Err(BackendError::Unsupported { step, what }) if route == Route::Gl => {
            println!("refused on {route:?}: {step}: {what}");
        }
        Err(error) => panic!("{route:?}: {error}"),
    });
}

/// The layout of a buffer of positions.
pub(super) fn positions() -> VertexLayout {
    VertexLayout::packed("position", VertexFormat::Float32x4)
}

/// One colour on the corners of a buffer of positions.
pub(super) fn flat(corners: Buffer, colour: [f32; 4]) -> Draw {
    Draw::new("test/flat")
        .vertices(corners, 0, positions())
        .set("colour", glam::Vec4::from(colour))
}

/// Two triangles that make a rectangle of pixels in a target.
pub(super) fn rectangle(size: (u32, u32), from: (f32, f32), to: (f32, f32), z: f32) -> Vec<f32> {
    let corner = |x: f32, y: f32| {
        let x = x / size.0 as f32 * 2.0 - 1.0;
        let y = 1.0 - y / size.1 as f32 * 2.0;
        [x, y, z, 1.0]
    };
    // Counter-clockwise as seen in the picture.
    [
        corner(from.0, from.1),
        corner(from.0, to.1),
        corner(to.0, to.1),
        corner(from.0, from.1),
        corner(to.0, to.1),
        corner(to.0, from.1),
    ]
    .concat()
}

/// Every pixel of an output, row by row.
pub(super) fn pixels(execution: &Execution, output: &str) -> Vec<(u32, u32, Texel)> {
    image_pixels(execution.output(output).expect("it was captured"))
}

pub(super) fn image_pixels(image: &ImageData) -> Vec<(u32, u32, Texel)> {
    image
        .texels(0)
        .map(|(place, texel)| (place.x, place.y, texel))
        .collect()
}

/// The channels of every pixel of an output of floats.
pub(super) fn colours(execution: &Execution, output: &str) -> Vec<(u32, u32, [f32; 4])> {
    pixels(execution, output)
        .into_iter()
        .map(|(x, y, texel)| (x, y, texel.to_f32()))
        .collect()
}

/// A state with one colour target.
pub(super) fn with_target(target: etalon_core::raster::TargetState) -> RasterState {
    RasterState {
        targets: vec![target],
        ..RasterState::default()
    }
}
