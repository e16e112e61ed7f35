//! A sweep of made-up numbers, to look at the report without running anything.
//!
//! Errors fall and times grow as they plausibly would, so that charts look like
//! real ones; one preset is dominated on purpose.

use std::collections::BTreeMap;
use std::path::Path;

use etalon_accuracy::model::{
    ErrorKind, Executor, Fact, Knob, Metric, Outcome, Point, Spread, Subject, Sweep, Work,
};

/// What pages have to survive, as a name.
pub(crate) const HOSTILE: &str = "</script><b onclick=\"x\">'&amp; \u{1F600}";

fn executors() -> Vec<Executor> {
    [
        (
            "cpu/avx2",
            "avx2",
            "interpreter, 2 threads",
            "etalon-cpu 0.1.0",
        ),
        (
            "wgpu",
            "vulkan",
            "llvmpipe (LLVM 19.1.7, 256 bits)",
            "Mesa 25.0.7",
        ),
        (
            "ash",
            "vulkan",
            "llvmpipe (LLVM 19.1.7, 256 bits)",
            "Mesa 25.0.7",
        ),
    ]
    .map(
        |(id, api, device, driver): (&str, &str, &str, &str)| Executor {
            id: id.to_owned(),
            api: api.to_owned(),
            device: device.to_owned(),
            driver: driver.to_owned(),
        },
    )
    .to_vec()
}

fn knob(name: &str, unit: &str, default: &str, description: &str) -> Knob {
    Knob {
        name: name.to_owned(),
        description: description.to_owned(),
        unit: unit.to_owned(),
        default: default.to_owned(),
    }
}

fn metric(id: &str, kind: ErrorKind, name: &str, unit: &str, description: &str) -> Metric {
    Metric {
        id: id.to_owned(),
        kind,
        name: name.to_owned(),
        unit: unit.to_owned(),
        description: description.to_owned(),
        larger_is_better: false,
    }
}

fn fact(name: &str, value: f64, unit: &str) -> Fact {
    Fact {
        name: name.to_owned(),
        value,
        unit: unit.to_owned(),
    }
}

/// A number between 0 and 1 that seems to follow from nothing.
fn noise(seed: u64) -> f64 {
    let mut state = seed.wrapping_add(0x9e37_79b9_7f4a_7c15);
    state = (state ^ (state >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    state = (state ^ (state >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    ((state ^ (state >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
}

/// Reflections: all three kinds of error, and a measure of which more is better.
fn reflections() -> Subject {
    let mut recall = metric(
        "algorithm.recall",
        ErrorKind::Algorithm,
        "hits found",
        "",
        "The share of the hits of an exact walk of the depth buffer that were found.",
    );
    recall.larger_is_better = true;
    let mut subject = Subject {
        effect: "ssr".to_owned(),
        scene: "wet-floor".to_owned(),
        knobs: vec![
            knob(
                "max_steps",
                "",
                "64",
                "most cells that a ray visits before it gives up",
            ),
            knob("refine", "", "4", "halvings of the last step"),
            knob(
                "thickness",
                "m",
                "0.2",
                "how far behind a surface a ray still hits it",
            ),
        ],
        metrics: vec![
            metric(
                "rounding.hit-median",
                ErrorKind::Rounding,
                "hit position, median",
                "px",
                "Distance on screen to the hit of the same walk in f64, over rays that hit in both; silhouettes left out.",
            ),
            metric(
                "algorithm.hit-median",
                ErrorKind::Algorithm,
                "hit position, median",
                "px",
                "Distance on screen to the hit of an exact walk of every cell of the depth buffer in f64, over rays that hit in both; silhouettes left out.",
            ),
            recall,
            metric(
                "algorithm.hit-p95",
                ErrorKind::Algorithm,
                "hit position, 95th percentile",
                "px",
                "The same, of which one ray in twenty is worse.",
            ),
            metric(
                "model.flip",
                ErrorKind::Model,
                "HDR-FLIP, mean",
                "",
                "Perceived difference to the scene traced exactly, at 67 pixels per degree.",
            ),
        ],
        facts: vec![
            fact("rays that the screen cannot answer", 0.137, ""),
            fact("mean length of a ray on screen", 83.4, "px"),
        ],
        points: Vec::new(),
    };
    for (steps_place, max_steps) in [8, 16, 32, 64, 128, 256].into_iter().enumerate() {
        for refine in [0_u32, 2, 4, 8] {
            for (thick_place, thickness) in ["0.05", "0.2", "0.8"].into_iter().enumerate() {
                let preset = match (max_steps, refine, thickness) {
                    (16, 2, "0.2") => Some("low"),
                    (64, 4, "0.2") => Some("medium"),
                    (64, 8, "0.8") => Some("high"),
                    (256, 8, "0.2") => Some("ultra"),
                    _ => None,
                };
                for arithmetic in ["strict", "fast"] {
                    let number = subject.points.len() as u64;
                    subject.points.push(reflection(
                        (max_steps, steps_place, refine, thick_place),
                        thickness,
                        preset,
                        arithmetic,
                        number,
                    ));
                }
            }
        }
    }
    subject
}

fn reflection(
    (max_steps, steps_place, refine, thick_place): (u32, usize, u32, usize),
    thickness: &str,
    preset: Option<&str>,
    arithmetic: &str,
    number: u64,
) -> Point {
    let fast = arithmetic == "fast";
    let steps = f64::from(max_steps);
    let walked = 70.0 * (1.0 - (-steps / 70.0).exp()) + f64::from(refine);
    let wobble = 0.9 + 0.2 * noise(number / 2);
    let missed = (0.6 * (-steps / 40.0).exp() + [0.02, 0.004, 0.03][thick_place]) * wobble;
    let position = (1.6 / f64::from(1 << refine) + 0.004 + [0.0, 0.01, 0.3][thick_place]) * wobble;
    let results = executors()
        .iter()
        .enumerate()
        .filter(|_| steps_place < 6)
        .map(|(place, executor)| {
            let per_step = [9.0e5, 2.1e5, 1.9e5][place] * if fast { 0.82 } else { 1.0 };
            let median =
                (walked + 6.0) * per_step * (0.97 + 0.06 * noise(number * 7 + place as u64));
            let errors = [
                (
                    "rounding.hit-median",
                    if fast {
                        3e-4 * wobble
                    } else if place == 0 {
                        0.0
                    } else {
                        2e-7 * wobble
                    },
                ),
                ("algorithm.hit-median", position),
                ("algorithm.hit-p95", position * 6.0 + missed),
                ("algorithm.recall", 1.0 - missed),
                ("model.flip", 0.03 + 0.2 * missed + 0.02 * position),
            ];
            Outcome {
                executor: executor.id.clone(),
                // One executor has not come to all of them yet.
                time: (place < 2 || !number.is_multiple_of(9)).then_some(Spread {
                    median,
                    lower: median * (0.99 - 0.02 * noise(number)),
                    upper: median * (1.02 + 0.1 * noise(number + 1)),
                    frames: 24,
                }),
                errors: errors
                    .into_iter()
                    .map(|(id, error)| (id.to_owned(), error))
                    .collect(),
                picture: Some(format!(
                    "pictures/{}.png",
                    id(max_steps, refine, thickness, arithmetic)
                )),
                difference: Some(format!(
                    "pictures/{}-difference.png",
                    id(max_steps, refine, thickness, arithmetic)
                )),
            }
        })
        .collect();
    Point {
        fingerprint: String::new(),
        id: id(max_steps, refine, thickness, arithmetic),
        settings: BTreeMap::from([
            ("max_steps".to_owned(), max_steps.to_string()),
            ("refine".to_owned(), refine.to_string()),
            ("thickness".to_owned(), thickness.to_owned()),
        ]),
        arithmetic: arithmetic.to_owned(),
        preset: preset.map(str::to_owned),
        bytes: 1920 * 1080 * 8 * (2 + u64::from(refine > 0)),
        work: Work {
            texel_fetches: (walked * 230_400.0) as u64,
            operations: (walked * 230_400.0 * 61.0) as u64,
            steps_per_ray: Some(walked),
        },
        results,
    }
}

fn id(max_steps: u32, refine: u32, thickness: &str, arithmetic: &str) -> String {
    format!("steps{max_steps}-refine{refine}-thick{thickness}-{arithmetic}")
}

/// Bloom: no model error, exact results, a point that nobody ran, a hostile name.
fn bloom() -> Subject {
    let mut subject = Subject {
        effect: "bloom".to_owned(),
        scene: HOSTILE.to_owned(),
        knobs: vec![
            knob("levels", "", "6", "how often the picture is halved"),
            knob("filter", "", "tent", "how it is halved"),
        ],
        metrics: vec![
            metric(
                "rounding.relmse",
                ErrorKind::Rounding,
                "relMSE",
                "",
                "To the same in f64.",
            ),
            metric(
                "algorithm.relmse",
                ErrorKind::Algorithm,
                "relMSE",
                "",
                "To the sum of all kernels in f64.",
            ),
        ],
        facts: Vec::new(),
        points: Vec::new(),
    };
    for levels in 3..9_u32 {
        for filter in ["box", "tent"] {
            let number = u64::from(levels);
            let cost =
                4e6 * (1.0 + 0.02 * f64::from(levels)) * if filter == "box" { 0.7 } else { 1.0 };
            let error = 0.3 / f64::from(levels).powi(3) * if filter == "box" { 4.0 } else { 1.0 };
            let results = executors().into_iter().map(|executor| Outcome {
                executor: executor.id,
                time: Some(Spread {
                    median: cost * (0.98 + 0.04 * noise(number)),
                    lower: cost * 0.97,
                    upper: cost * 1.05,
                    frames: 24,
                }),
                errors: BTreeMap::from([
                    ("rounding.relmse".to_owned(), 0.0),
                    ("algorithm.relmse".to_owned(), error),
                ]),
                picture: None,
                difference: None,
            });
            subject.points.push(Point {
                fingerprint: String::new(),
                id: format!("levels{levels}-{filter}"),
                settings: BTreeMap::from([
                    ("levels".to_owned(), levels.to_string()),
                    ("filter".to_owned(), filter.to_owned()),
                ]),
                arithmetic: "strict".to_owned(),
                preset: (levels == 4 && filter == "box").then(|| "low, \"quoted\"".to_owned()),
                bytes: 1 << (20 + levels),
                work: Work {
                    texel_fetches: 4_000_000 + number,
                    operations: 90_000_000,
                    steps_per_ray: None,
                },
                results: results.collect(),
            });
        }
    }
    subject.points.push(Point {
        fingerprint: String::new(),
        id: "nobody".to_owned(),
        arithmetic: "strict".to_owned(),
        ..Point::default()
    });
    subject
}

/// All of it.
pub(crate) fn sweep() -> Sweep {
    Sweep {
        size: [640, 360],
        executors: executors(),
        subjects: vec![reflections(), bloom()],
        notes: vec![
            "These numbers are made up.".to_owned(),
            "lavapipe draws on the processor: its times say how settings compare, not how fast a GPU is.".to_owned(),
        ],
    }
}

/// Draws small pictures for every point of a sweep that has some.
pub(crate) fn draw(sweep: &Sweep, folder: &Path) {
    for subject in &sweep.subjects {
        for (number, point) in subject.points.iter().enumerate() {
            for outcome in &point.results {
                for (shift, path) in [(0, &outcome.picture), (128, &outcome.difference)] {
                    let Some(path) = path else { continue };
                    let path = folder.join(path);
                    if path.exists() {
                        continue;
                    }
                    std::fs::create_dir_all(path.parent().unwrap()).unwrap();
                    let pixel = |x: u32, y: u32| {
                        image::Rgb([(x * 4) as u8, (y * 7) as u8, (number * 5 + shift) as u8])
                    };
                    image::RgbImage::from_fn(64, 36, pixel).save(path).unwrap();
                }
            }
        }
    }
}
