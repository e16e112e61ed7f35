//! Running graphs on the interpreter, and images made of functions.

pub(crate) mod drawn;

use etalon_core::Format;
use etalon_core::backend::{Backend, Execution, Inputs};
use etalon_core::graph::{Graph, Texture};
use etalon_core::image::ImageData;
use etalon_core::kernel::{Arithmetic, KernelLibrary};
use etalon_core::plan::{Capture, Plan, PlanOptions};
use etalon_core::resource::TextureDesc;
use etalon_effects::SceneInputs;
use etalon_effects::ssr::{Blend, HitStorage, Search, Ssr};
use etalon_effects::tiles::Tiling;
use etalon_scenes::Frame;

/// Reflections without fades and blur: visibility is 1 where there is a hit.
pub(crate) const PLAIN_SSR: Ssr = Ssr {
    max_distance: 50.0,
    resolution: 1.0,
    search: Search::Refined,
    steps: 8,
    thickness: 0.25,
    march_limit: 4096,
    camera_fade: 0.0,
    depth_fade: 0.0,
    distance_fade: 0.0,
    border: 0.0,
    blur_radius: 0,
    storage: HitStorage::Full,
    quarter_from: Ssr::NO_QUARTER,
    blend: Blend::Add,
    tiles: Tiling::Off,
};

/// The executor of these tests.
pub(crate) fn backend() -> Box<dyn Backend> {
    Box::new(etalon_cpu::CpuBackend::new(&etalon_cpu::CpuOptions::default()).expect("threads"))
}

/// An image whose texel (x, y) is `texel(x, y)`.
pub(crate) fn image(
    format: Format,
    width: u32,
    height: u32,
    texel: impl Fn(u32, u32) -> [f32; 4],
) -> ImageData {
    let texels: Vec<[f32; 4]> = (0..height)
        .flat_map(|y| (0..width).map(move |x| (x, y)))
        .map(|(x, y)| texel(x, y))
        .collect();
    ImageData::from_rgba_f32(TextureDesc::d2(width, height, format), &texels).expect("sizes agree")
}

/// All texels of mip 0, row by row.
pub(crate) fn texels(image: &ImageData) -> Vec<[f32; 4]> {
    image.to_rgba_f32().expect("a float image")
}

/// A frame's worth of passes on named images.
pub(crate) struct Run<'a> {
    pub(crate) graph: Graph,
    inputs: Inputs<'a>,
    pub(crate) kernels: KernelLibrary,
    pub(crate) arithmetic: Arithmetic,
}

impl<'a> Run<'a> {
    pub(crate) fn new() -> Self {
        Self {
            graph: Graph::new(),
            inputs: Inputs::new(),
            kernels: etalon_effects::kernels(),
            arithmetic: Arithmetic::Strict,
        }
    }

    /// Imports an image under a name.
    pub(crate) fn import(&mut self, name: &'static str, image: &'a ImageData) -> Texture {
        self.inputs = std::mem::take(&mut self.inputs).texture(name, image);
        self.graph
            .import_texture(name, image.desc)
            .expect("each name once")
    }

    /// Imports the images of a frame, a sixtieth of a second after the last.
    pub(crate) fn import_frame(&mut self, frame: &'a Frame) -> SceneInputs {
        self.inputs = frame.inputs();
        frame
            .import(&mut self.graph, 1.0 / 60.0)
            .expect("each name once")
    }

    /// Runs what `result` needs and returns it.
    pub(crate) fn output(self, result: Texture) -> ImageData {
        self.output_on(backend().as_mut(), result)
    }

    /// As [`Run::output`], on a backend that may have histories.
    pub(crate) fn output_on(mut self, backend: &mut dyn Backend, result: Texture) -> ImageData {
        self.graph.output("result", result).expect("written");
        let execution = self.execute(backend, Capture::Outputs);
        execution.output("result").expect("captured").clone()
    }

    /// The plan of everything asked for, for no device in particular.
    pub(crate) fn plan(&self) -> Plan {
        let options = PlanOptions {
            arithmetic: self.arithmetic,
            ..PlanOptions::default()
        };
        Plan::new(&self.graph, &self.kernels, &options).unwrap_or_else(|error| panic!("{error}"))
    }

    /// Runs everything asked for.
    pub(crate) fn execute(&self, backend: &mut dyn Backend, capture: Capture) -> Execution {
        let limits = backend.limits();
        let options = PlanOptions {
            arithmetic: self.arithmetic,
            limits,
            capture,
            ..PlanOptions::default()
        };
        let plan = Plan::new(&self.graph, &self.kernels, &options)
            .unwrap_or_else(|error| panic!("{error}"));
        backend
            .execute(&plan, &self.inputs)
            .unwrap_or_else(|error| panic!("{error}"))
    }
}

/// Distance of `value` from `exact` in units in the last place of f32 there.
pub(crate) fn ulps(value: f32, exact: f64) -> f64 {
    let magnitude = exact.abs().max(f64::from(f32::MIN_POSITIVE));
    // The exponent field of an f64 is that of the f32 ulp, shifted.
    let exponent = ((magnitude.to_bits() >> 52) as i32) - 1023;
    (f64::from(value) - exact).abs() / f64::from(exponent - 23).exp2()
}

/// A number that looks random: C. Wellons, "Prospecting for Hash Functions",
/// 2018, the hash `lowbias32`.
pub(crate) fn hash(mut x: u32) -> u32 {
    x ^= x >> 16;
    x = x.wrapping_mul(0x7feb_352d);
    x ^= x >> 15;
    x = x.wrapping_mul(0x846c_a68b);
    x ^ (x >> 16)
}
