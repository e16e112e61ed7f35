//! Whole frames of scenes that lack something, and of settings that do without an
//! effect.

use std::time::Instant;

use etalon_accuracy::executors::Executor;
use etalon_accuracy::metric::spread;
use etalon_core::backend::Inputs;
use etalon_core::graph::Graph;
use etalon_core::image::ImageData;
use etalon_core::kernel::KernelLibrary;
use etalon_core::plan::Capture;
use etalon_effects::ssr::Ssr;
use etalon_effects::{ChainSettings, chain};
use etalon_scenes::Frame;

use crate::mask::{Layout, mask};
use crate::model::{Economy, LackingFrame};
use crate::sweep::{
    DELTA_TIME, EconomyError, LEAST_FRAMES, Options, Progress, plan, specular, time,
};

/// Share of the screen that mirrors where nothing is lacking.
const MIRRORS: f64 = 0.3;

/// A frame, and what it is drawn with.
struct Case {
    lacking: &'static str,
    why: &'static str,
    /// Images in place of the scene's own, by name.
    images: Vec<(&'static str, ImageData)>,
    settings: ChainSettings,
}

impl Case {
    fn inputs<'a>(&'a self, frame: &'a Frame) -> Inputs<'a> {
        let images = self.images.iter();
        images.fold(frame.inputs(), |inputs, (name, image)| {
            inputs.texture(*name, image)
        })
    }
}

fn cases(frame: &Frame, options: &Options) -> Result<Vec<Case>, EconomyError> {
    let full = ChainSettings {
        ssr: Some(Ssr {
            tiles: options.tiles,
            ..Ssr::default()
        }),
        ..ChainSettings::full()
    };
    let mirrors = mask(Layout::Compact, MIRRORS, frame.size());
    let rough = specular(frame, &mirrors)?;
    let smooth = changed(&rough, |_, [r, g, b, _]| [r, g, b, 1.0])?;
    let width = rough.desc.extent.width as usize;
    let half = changed(&rough, |index, [r, g, b, _]| {
        let left = index % width < width / 2;
        [r, g, b, if left { 1.0 } else { 0.2 }]
    })?;
    let quarter = |quarter_from| ChainSettings {
        ssr: full.ssr.map(|ssr| Ssr {
            quarter_from,
            ..ssr
        }),
        ..full
    };
    let none = ImageData::zeroed(frame.specular.desc)?;
    let dark = changed(&frame.colour, |_, [r, g, b, a]| {
        [r.min(0.01), g.min(0.01), b.min(0.01), a]
    })?;
    let sky = vec![
        ("depth", ImageData::zeroed(frame.depth.desc)?),
        ("normal", ImageData::zeroed(frame.normal.desc)?),
        ("specular", none.clone()),
    ];
    let mirroring = || vec![("specular", rough.clone())];
    let case = |lacking, why, images, settings| Case {
        lacking,
        why,
        images,
        settings,
    };
    let off = "The effect is off.";
    Ok(vec![
        case(
            "nothing",
            "All effects; three tenths of the screen mirror, and roughly.",
            mirroring(),
            full,
        ),
        case(
            "rough surfaces",
            "What mirrors is smooth: no blur.",
            vec![("specular", smooth)],
            full,
        ),
        case(
            "mirroring surfaces",
            "Reflections are on and have nothing to do but to see that.",
            vec![("specular", none)],
            full,
        ),
        case("surfaces", "Nothing but sky.", sky, full),
        case(
            "three rays in four",
            "As the first, of which one texel in four is marched.",
            mirroring(),
            quarter(0.0),
        ),
        case(
            "half of what is rough",
            "As the first, but what mirrors on the left is smooth.",
            vec![("specular", half.clone())],
            full,
        ),
        case(
            "three rays in four of what is rough there",
            "The same, of which one texel in four is marched where it is rough.",
            vec![("specular", half)],
            quarter(0.5),
        ),
        case(
            "bright light",
            "Nothing blooms; bloom works all the same.",
            vec![("specular", rough.clone()), ("colour", dark)],
            full,
        ),
        case(
            "reflections",
            off,
            mirroring(),
            ChainSettings { ssr: None, ..full },
        ),
        case(
            "bloom",
            off,
            mirroring(),
            ChainSettings {
                bloom: None,
                ..full
            },
        ),
        case(
            "exposure",
            off,
            mirroring(),
            ChainSettings {
                exposure: None,
                ..full
            },
        ),
    ])
}

fn changed(
    image: &ImageData,
    change: impl Fn(usize, [f32; 4]) -> [f32; 4],
) -> Result<ImageData, EconomyError> {
    let texels = image.to_rgba_f32()?.into_iter().enumerate();
    let texels: Vec<[f32; 4]> = texels.map(|(index, texel)| change(index, texel)).collect();
    Ok(ImageData::from_rgba_f32(image.desc, &texels)?)
}

/// Times the frames in turns on every executor, until `end`.
pub(crate) fn frames(
    frame: &Frame,
    options: &Options,
    executors: &mut [Executor],
    kernels: &KernelLibrary,
    end: Instant,
    economy: &mut Economy,
    progress: &mut dyn Progress,
) -> Result<(), EconomyError> {
    let cases = cases(frame, options)?;
    let mut plans = Vec::new();
    for case in &cases {
        let mut graph = Graph::new();
        let inputs = frame.import(&mut graph, DELTA_TIME)?;
        let result = chain(&mut graph, &inputs, &case.settings)?;
        graph.output("picture", result.picture)?;
        for executor in executors.iter() {
            plans.push(plan(executor, &graph, kernels, Capture::None)?);
        }
    }
    let count = executors.len();
    let mut times = vec![Vec::new(); plans.len()];
    let steps = u64::from(options.frames + 1) * plans.len() as u64;
    progress.begin("frames that lack something", steps);
    for round in 0..=options.frames {
        let start = Instant::now();
        for (index, plan) in plans.iter().enumerate() {
            let (case, executor) = (&cases[index / count], &mut executors[index % count]);
            let [took, _] = time(executor, plan, &case.inputs(frame))?;
            // The first makes pipelines and warms caches.
            if round > 0 {
                times[index].push(took);
            }
            progress.step();
        }
        if round >= LEAST_FRAMES && round < options.frames && Instant::now() + start.elapsed() > end
        {
            economy.notes.push(format!(
                "frames that lack something were timed {round} times instead of {} for want of time",
                options.frames
            ));
            break;
        }
    }
    for (number, case) in cases.iter().enumerate() {
        let own = number * count..(number + 1) * count;
        let Some(first) = plans.get(own.start) else {
            continue;
        };
        let mut found = LackingFrame {
            lacking: case.lacking.to_owned(),
            why: case.why.to_owned(),
            dispatches: first.dispatch_count(),
            bytes: first.texture_heap + first.buffer_heap,
            times: Vec::new(),
        };
        for (executor, times) in executors.iter().zip(&times[own]) {
            found
                .times
                .push((executor.kind.to_string(), spread(times)?));
        }
        economy.frames.push(found);
    }
    Ok(())
}
