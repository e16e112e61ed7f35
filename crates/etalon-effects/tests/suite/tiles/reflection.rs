//! Reflections on tiles are those on the whole picture, bit for bit.

use etalon_core::Format;
use etalon_core::image::ImageData;
use etalon_core::kernel::{Arithmetic, KernelLibrary};
use etalon_core::plan::{Capture, Groups, Step};
use etalon_cpu::{Checks, CpuBackend, CpuOptions, FindingKind};
use etalon_effects::ssr::{Blend, HitStorage, Search, Ssr, ssr};
use etalon_effects::tiles::Tiling;
use etalon_effects::tiles::crossover::Cost;
use etalon_scenes::{Frame, FrameSize, scene};

use crate::common::{Run, hash, image};

/// Which texels mirror, and how rough they are.
pub(super) type Mask = Box<dyn Fn(u32, u32) -> [f32; 4]>;

pub(super) const ROUGH: [f32; 4] = [0.6, 0.8, 1.0, 0.25];
pub(super) const SMOOTH: [f32; 4] = [1.0, 0.7, 0.2, 1.0];

pub(super) const SEARCHES: [Search; 4] =
    [Search::Linear, Search::Refined, Search::Dda, Search::HiZ];

/// A frame whose every surface could mirror, with a specular map of our own.
pub(super) fn frame(name: &str, width: u32, height: u32, mask: &Mask) -> Frame {
    let size = FrameSize::new(width, height).unwrap();
    let mut frame = scene(name).unwrap().frame(size).unwrap();
    frame.specular = image(Format::Rgba8Unorm, width, height, mask);
    frame
}

pub(super) fn single(at: (u32, u32), texel: [f32; 4]) -> Mask {
    Box::new(move |x, y| if (x, y) == at { texel } else { [0.0; 4] })
}

/// One texel in so many, half of them smooth.
pub(super) fn sparse(seed: u32, one_in: u32) -> Mask {
    Box::new(move |x, y| {
        let random = hash(seed ^ hash(x ^ hash(y)));
        match random % one_in {
            0 if random & 1 << 20 == 0 => ROUGH,
            0 => SMOOTH,
            _ => [0.0; 4],
        }
    })
}

/// Kernels that leave a number in every texel between the passes: what an executor
/// would otherwise find there, if it looked where nothing was written, is what an
/// earlier picture left.
fn poison() -> KernelLibrary {
    let mut kernels = etalon_effects::kernels();
    for (path, stored) in [
        ("ssr/march", "textureStore(result, texel, found)"),
        (
            "ssr/resolve",
            "textureStore(result, texel, f16_rounded(vec4<f32>(colour, visibility)))",
        ),
        (
            "ssr/blur",
            "textureStore(result, texel, f16_rounded(sum / f32(2 * radius + 1)))",
        ),
    ] {
        let source = kernels.source(path).unwrap().to_string();
        let poisoned = source.replace(stored, "textureStore(result, texel, vec4<f32>(1234.0))");
        assert_ne!(source, poisoned, "{path}");
        kernels.add_source(path, &poisoned);
    }
    kernels
}

pub(super) struct Bench {
    pub(super) kernels: KernelLibrary,
    pub(super) poison: KernelLibrary,
    pub(super) backend: CpuBackend,
    pub(super) arithmetic: Arithmetic,
}

impl Bench {
    pub(super) fn new(arithmetic: Arithmetic) -> Self {
        Self::with(arithmetic, CpuOptions::default())
    }

    pub(super) fn with(arithmetic: Arithmetic, options: CpuOptions) -> Self {
        Self {
            kernels: etalon_effects::kernels(),
            poison: poison(),
            backend: CpuBackend::new(&options).unwrap(),
            arithmetic,
        }
    }

    pub(super) fn picture(&mut self, frame: &Frame, settings: &Ssr) -> ImageData {
        let mut run = Run::new();
        std::mem::swap(&mut run.kernels, &mut self.kernels);
        run.arithmetic = self.arithmetic;
        let inputs = run.import_frame(frame);
        let result = ssr(&mut run.graph, &inputs, settings).unwrap();
        run.graph.output("result", result).unwrap();
        let execution = run.execute(&mut self.backend, Capture::Outputs);
        std::mem::swap(&mut run.kernels, &mut self.kernels);
        execution.output("result").unwrap().clone()
    }

    /// Where the picture on tiles is another than the whole one.
    pub(super) fn difference(
        &mut self,
        frame: &Frame,
        settings: &Ssr,
        tiles: Tiling,
    ) -> Option<usize> {
        let off = Ssr {
            tiles: Tiling::Off,
            ..*settings
        };
        let whole = self.picture(frame, &off);
        std::mem::swap(&mut self.kernels, &mut self.poison);
        let poisoned = self.picture(frame, &off);
        std::mem::swap(&mut self.kernels, &mut self.poison);
        assert_eq!(poisoned.desc, whole.desc);
        let tiled = self.picture(frame, &Ssr { tiles, ..*settings });
        assert_eq!(whole.desc, tiled.desc);
        let mut texels = whole.bytes.chunks(8).zip(tiled.bytes.chunks(8));
        texels.position(|(whole, tiled)| whole != tiled)
    }

    pub(super) fn hold(&mut self, frame: &Frame, settings: &Ssr, what: &str) {
        for tiles in &Tiling::ALL[1..] {
            let found = self.difference(frame, settings, *tiles);
            assert_eq!(found, None, "{what}, {tiles:?}, {:?}", self.arithmetic);
        }
    }
}

/// Quick to march, and blurred beyond a tile.
pub(super) fn settings(blur_radius: u32) -> Ssr {
    Ssr {
        resolution: 0.25,
        camera_fade: 0.0,
        border: 0.0,
        blur_radius,
        ..Ssr::default()
    }
}

#[test]
fn single_texels_at_corners_and_edges_of_tiles() {
    // Two tiles of 64 and a part of a third.
    let (width, height) = (131, 70);
    for arithmetic in [Arithmetic::Strict, Arithmetic::Fast] {
        let mut bench = Bench::new(arithmetic);
        let places = [
            (0, 0),
            (130, 0),
            (0, 69),
            (130, 69),
            (7, 7),
            (8, 7),
            (7, 8),
            (63, 63),
            (64, 63),
            (63, 64),
            (64, 64),
            (128, 40),
            (40, 15),
            (127, 68),
        ];
        for (number, place) in places.into_iter().enumerate() {
            let radius = [0, 1, 7, 8, 9, 30][number % 6];
            for (name, texel) in [("rough", ROUGH), ("smooth", SMOOTH)] {
                let frame = frame("corridor-grazing", width, height, &single(place, texel));
                let what = format!("{name} at {place:?}, radius {radius}");
                bench.hold(&frame, &settings(radius), &what);
            }
        }
    }
}

#[test]
fn random_masks_of_every_density_on_every_size() {
    let sizes = [
        (1, 1),
        (1, 40),
        (40, 1),
        (8, 8),
        (9, 7),
        (64, 64),
        (65, 63),
        (97, 55),
        (200, 3),
    ];
    for arithmetic in [Arithmetic::Strict, Arithmetic::Fast] {
        let mut bench = Bench::new(arithmetic);
        for (number, (width, height)) in sizes.into_iter().enumerate() {
            for one_in in [1, 3, 50, 1000, u32::MAX] {
                let seed = hash(number as u32 ^ one_in);
                let frame = frame("corridor-grazing", width, height, &sparse(seed, one_in));
                let mut settings = settings([0, 6, 13, 64][seed as usize % 4]);
                settings.storage = [HitStorage::Full, HitStorage::Half][seed as usize / 4 % 2];
                settings.blend = [Blend::Add, Blend::Replace][seed as usize / 8 % 2];
                settings.search = SEARCHES[seed as usize / 16 % SEARCHES.len()];
                let what = format!("{width}×{height}, one in {one_in}, {settings:?}");
                bench.hold(&frame, &settings, &what);
            }
        }
    }
}

/// NaN, infinities, negative numbers and -0 in any image, on tiles that mirror and
/// on those that do not.
#[test]
fn hard_inputs() {
    for arithmetic in [Arithmetic::Strict, Arithmetic::Fast] {
        let mut bench = Bench::new(arithmetic);
        for (width, height) in [(96, 54), (33, 17)] {
            for one_in in [2, 400] {
                let mask = sparse(width ^ one_in, one_in);
                let masked = frame("hard-inputs", width, height, &mask);
                bench.hold(&masked, &settings(6), "hard inputs, masked");
            }
            let size = FrameSize::new(width, height).unwrap();
            let given = scene("hard-inputs").unwrap().frame(size).unwrap();
            bench.hold(&given, &settings(6), "hard inputs");
        }
    }
}

/// Specular maps that are no 8-bit texture hold anything: what counts is what the mix
/// makes of it.
#[test]
fn maps_of_any_numbers() {
    let values = [
        0.0,
        -0.0,
        -1.0,
        f32::NAN,
        f32::NEG_INFINITY,
        f32::INFINITY,
        f32::MIN_POSITIVE / 2.0,
        1e-9,
        1e-7,
        0.0019,
        0.002,
        0.5,
        2.0,
    ];
    let shine = [0.0, 0.5, 0.998, 0.999_9, 1.0, 7.0, f32::NAN];
    for arithmetic in [Arithmetic::Strict, Arithmetic::Fast] {
        let mut bench = Bench::new(arithmetic);
        let (width, height) = (8 * 13, 8 * 7);
        let mut frame = frame("corridor-grazing", width, height, &single((0, 0), SMOOTH));
        // One texel of each pair in a tile of its own.
        frame.specular = image(Format::Rgba32Float, width, height, |x, y| {
            if x % 8 != 3 || y % 8 != 6 {
                return [0.0; 4];
            }
            let value = values[(x / 8) as usize];
            [0.0, value, 0.0, shine[(y / 8) as usize]]
        });
        for radius in [0, 3] {
            bench.hold(&frame, &settings(radius), "a float map");
        }
    }
}

/// The comparison must be able to fail: where marks spread one tile less than the
/// blur reaches, pictures differ, and the interpreter says what was read.
#[test]
fn a_spread_that_is_too_small_is_seen() {
    let checks = Checks {
        uninitialised: true,
        ..Checks::NONE
    };
    let options = CpuOptions {
        checks,
        ..CpuOptions::default()
    };
    for axis in ["params.axis.x", "params.axis.y"] {
        let mut bench = Bench::with(Arithmetic::Strict, options.clone());
        let frame = frame("corridor-grazing", 131, 70, &sparse(5, 700));
        bench.hold(&frame, &settings(6), "as it is");
        assert!(bench.backend.take_findings().is_empty());

        let source = bench.kernels.source("tiles/spread").unwrap().to_string();
        let short = source.replacen(
            "min(max(params.reach, 0), MOST_REACH)",
            &format!("min(max(params.reach - {axis}, 0), MOST_REACH)"),
            1,
        );
        assert_ne!(source, short);
        bench.kernels.add_source("tiles/spread", &short);
        let found = bench.difference(&frame, &settings(6), Tiling::Texels8);
        assert!(found.is_some(), "{axis}");
        let findings = bench.backend.take_findings();
        let read = |kind: FindingKind| {
            let mut list = findings.list.iter();
            list.any(|entry| entry.finding.kind == kind && entry.step.starts_with("ssr/blur"))
        };
        assert!(read(FindingKind::Uninitialised), "{axis}: {findings:?}");
    }
}

/// What nothing asks for is not run: heavy kernels have no invocation where nothing
/// mirrors, and no blur where nothing is rough.
#[test]
fn what_no_tile_asks_for_has_no_invocation() {
    let heavy = ["ssr/march", "ssr/resolve", "ssr/blur", "ssr/mix"];
    let cases: [(&str, Mask, &[&str]); 3] = [
        ("nothing", single((999, 999), ROUGH), &heavy),
        ("smooth", single((20, 20), SMOOTH), &["ssr/blur"]),
        ("everything", Box::new(|_, _| ROUGH), &["ssr/keep"]),
    ];
    for (name, mask, absent) in cases {
        let mut bench = Bench::with(
            Arithmetic::Strict,
            CpuOptions {
                profile: true,
                ..CpuOptions::default()
            },
        );
        let frame = frame("corridor-grazing", 97, 55, &mask);
        bench.picture(
            &frame,
            &Ssr {
                tiles: Tiling::Texels16,
                ..settings(6)
            },
        );
        for profile in bench.backend.profiles() {
            let expected = absent.contains(&profile.kernel.as_str());
            // The blurred and the smooth mix are kernels of one name.
            if profile.kernel == "ssr/mix" && !expected {
                continue;
            }
            let ran = profile.batches > 0;
            assert_eq!(ran, !expected, "{name}: {}", profile.kernel);
        }
    }
}

#[test]
fn tiles_are_a_matter_of_passes_that_are_dispatched_indirectly() {
    let frame = frame("corridor-grazing", 64, 36, &sparse(1, 9));
    let steps = |tiles| {
        let mut run = Run::new();
        let inputs = run.import_frame(&frame);
        let settings = Ssr {
            tiles,
            ..Ssr::default()
        };
        let result = ssr(&mut run.graph, &inputs, &settings).unwrap();
        run.graph.output("result", result).unwrap();
        run.plan()
    };
    let indirect = |tiles| -> Vec<String> {
        let plan = steps(tiles);
        let steps = plan.steps.iter().filter(|step| {
            matches!(
                step.step,
                Step::Dispatch {
                    groups: Groups::Indirect { .. },
                    ..
                }
            )
        });
        steps.map(|step| step.name.clone()).collect()
    };
    assert!(indirect(Tiling::Off).is_empty());
    assert_eq!(
        indirect(Tiling::Texels8),
        [
            "ssr/march",
            "ssr/resolve",
            "ssr/blur x",
            "ssr/blur y",
            "ssr/mix",
            "ssr/mix smooth",
            "ssr/keep"
        ]
    );
}

#[test]
fn tiles_are_used_below_the_share_at_which_they_pay() {
    let cost = Cost {
        idle: 10.0,
        slope: 120.0,
        whole: 100.0,
    };
    let settings = Ssr {
        tiles: Tiling::Texels32,
        ..settings(6)
    };
    for (coverage, tiles) in [
        (0.0, Tiling::Texels32),
        (0.749, Tiling::Texels32),
        (0.75, Tiling::Off),
        (1.0, Tiling::Off),
        (f64::NAN, Tiling::Texels32),
    ] {
        let chosen = settings.for_coverage(coverage, &cost);
        assert_eq!(chosen, Ssr { tiles, ..settings }, "{coverage}");
    }
}
