//! Sweeps on the interpreter: the same each time, gone on with where they stopped,
//! and with what theory says.

use std::collections::BTreeMap;
use std::time::Duration;

use etalon_accuracy::executors::Kind;
use etalon_accuracy::model::{Point, Subject, Sweep};
use etalon_accuracy::pictures::Pictures;
use etalon_accuracy::profile::profile;
use etalon_accuracy::sweep::{Options, Progress, Scenes, SweepError, sweep};
use etalon_accuracy::trial::Swept;
use etalon_accuracy::{store, table};
use etalon_effects::budget::{BudgetError, DeviceProfile};
use etalon_effects::{ChainSettings, effect};
use etalon_scenes::FrameSize;

/// Keeps nothing; stops after a number of steps, as a user might.
#[derive(Default)]
struct Quiet {
    kept: Vec<Sweep>,
    stop_after: Option<usize>,
}

impl Progress for Quiet {
    fn begin(&mut self, _: &str, _: usize) {}

    fn step(&mut self) {}

    fn keep(&mut self, sweep: &Sweep) -> Result<(), String> {
        self.kept.push(sweep.clone());
        match self.stop_after {
            Some(count) if self.kept.len() >= count => Err("stopped".to_owned()),
            _ => Ok(()),
        }
    }
}

fn options(name: &str, depth: usize) -> Options {
    Options {
        effects: vec![Swept::named(name).unwrap()],
        scenes: Scenes::Judged,
        backends: vec![Kind::Cpu],
        size: FrameSize::new(160, 90).unwrap(),
        depth,
        frames: 3,
        budget: Duration::from_secs(3600),
    }
}

fn run(options: &Options) -> Sweep {
    sweep(options, None, &Pictures::none(), &mut Quiet::default()).unwrap()
}

/// All that no clock decides.
fn timeless(mut sweep: Sweep) -> Sweep {
    for subject in &mut sweep.subjects {
        for point in &mut subject.points {
            for result in &mut point.results {
                result.time = None;
            }
        }
    }
    sweep
}

fn at<'a>(subject: &'a Subject, settings: &[(&str, &str)]) -> &'a Point {
    let same = |point: &&Point| {
        point.arithmetic == "strict"
            && subject.knobs.iter().all(|knob| {
                let set = settings.iter().find(|(name, _)| *name == knob.name);
                point.settings[&knob.name] == set.map_or(knob.default.as_str(), |(_, value)| value)
            })
    };
    let found = subject.points.iter().find(same);
    found.unwrap_or_else(|| panic!("no point with {settings:?}"))
}

fn error(point: &Point, metric: &str) -> f64 {
    point
        .error_on("cpu", metric)
        .unwrap_or_else(|| panic!("{} has no {metric}", point.id))
}

#[test]
fn two_sweeps_find_the_same_but_for_times() {
    for effect in ["bloom", "exposure", "composite"] {
        let options = options(effect, 1);
        let first = run(&options);
        for subject in &first.subjects {
            assert!(subject.points.len() >= 2, "{effect}");
            for point in &subject.points {
                let time = point.on("cpu").unwrap().time.unwrap();
                assert!(time.frames >= 3 && time.median > 0.0, "{effect} {time:?}");
                assert!(time.lower <= time.median && time.median <= time.upper);
                assert!(point.work.texel_fetches > 0 && point.work.operations > 0);
                for metric in &subject.metrics {
                    let error = point.error_on("cpu", &metric.id);
                    assert!(error.is_some_and(f64::is_finite), "{effect} {}", metric.id);
                }
            }
        }
        assert_eq!(timeless(first), timeless(run(&options)), "{effect}");
    }
}

#[test]
fn a_stopped_sweep_is_gone_on_with() {
    let folder = tempfile::tempdir().unwrap();
    let options = options("bloom", 1);
    let pictures = Pictures::beside(folder.path());
    let mut stopped = Quiet {
        stop_after: Some(1),
        ..Quiet::default()
    };
    let error = sweep(&options, None, &pictures, &mut stopped).unwrap_err();
    assert!(matches!(error, SweepError::Keep(_)), "{error}");
    let mut before = stopped.kept.pop().unwrap();
    store::keep(&before, folder.path()).unwrap();
    assert_eq!(store::read(folder.path()).unwrap(), Some(before.clone()));
    // What it says it knows is believed, so that what is measured anew shows.
    let known = before.subjects[0].points.len();
    assert!(known > 0);
    for point in &mut before.subjects[0].points {
        point.bytes = 12_345;
    }
    let mut quiet = Quiet::default();
    let found = sweep(&options, Some(&before), &pictures, &mut quiet).unwrap();
    let kept = found.subjects[0]
        .points
        .iter()
        .filter(|point| point.bytes == 12_345);
    assert_eq!(kept.count(), known);
    assert_eq!(found.subjects.len(), 2);
    // Without its picture a point is not known.
    let lost = before.subjects[0].points[0]
        .on("cpu")
        .unwrap()
        .picture
        .clone()
        .unwrap();
    std::fs::remove_file(folder.path().join(&lost)).unwrap();
    let found = sweep(&options, Some(&before), &pictures, &mut quiet).unwrap();
    assert_ne!(found.subjects[0].points[0].bytes, 12_345);
    assert!(folder.path().join(lost).is_file());
    // Another size has nothing in common.
    let other = Options {
        size: FrameSize::new(96, 54).unwrap(),
        ..options
    };
    let found = sweep(&other, Some(&before), &Pictures::none(), &mut quiet).unwrap();
    assert!(
        found.subjects[0]
            .points
            .iter()
            .all(|point| point.bytes != 12_345)
    );
}

#[test]
fn no_time_leaves_the_most_turned_out_and_says_so() {
    let hurried = Options {
        budget: Duration::ZERO,
        ..options("bloom", 2)
    };
    let found = run(&hurried);
    for subject in &found.subjects {
        assert_eq!(subject.points.len(), 2);
        assert_eq!(subject.points[0].id, "strict");
        assert!(
            subject
                .points
                .iter()
                .all(|point| point.time_on("cpu").is_some())
        );
    }
    let left_out = |note: &&String| note.contains("left out for want of time");
    assert_eq!(
        found.notes.iter().filter(left_out).count(),
        2,
        "{:?}",
        found.notes
    );
}

/// From what a sweep found settings can be picked: the most accurate for any time,
/// cheaper ones for less.
#[test]
fn a_sweep_makes_a_profile_that_settings_are_picked_from() {
    let all = Options {
        effects: Swept::all().collect(),
        scenes: Scenes::First,
        size: FrameSize::new(97, 55).unwrap(),
        ..options("ssr", 2)
    };
    let found = run(&all);
    assert!(found.subjects.iter().any(|one| one.effect == "environment"));
    // What is made once is no part of a frame's time.
    let profile = profile(&found, &found.executors[0]);
    assert_eq!((profile.size, profile.effects.len()), ([97, 55], 4));
    let picked = |budget| ChainSettings::full().for_budget(budget, &profile);
    let most = picked(1e9).unwrap();
    let bloom = found
        .subjects
        .iter()
        .find(|subject| subject.effect == "bloom")
        .unwrap();
    let fast = bloom
        .points
        .iter()
        .filter(|point| point.arithmetic == "fast");
    let best = fast.min_by(|a, b| {
        let [a, b] = [a, b].map(|point| error(point, "algorithm.colour"));
        a.total_cmp(&b)
    });
    assert_eq!(
        most.bloom.unwrap().levels.to_string(),
        best.unwrap().settings["levels"]
    );
    assert_eq!(most.exposure.unwrap().stride, 1);
    let Err(BudgetError::TooLittle { least, .. }) = picked(0.0) else {
        panic!("nothing takes no time")
    };
    assert!(least > 0.0 && picked(least).is_ok());
    assert!(table::text(&found).contains("bloom on dark-room-lights, cpu"));
}

#[test]
fn what_is_not_there_is_said() {
    let scene = Options {
        scenes: Scenes::Named(vec!["nowhere".to_owned()]),
        ..options("ssr", 0)
    };
    let error = sweep(&scene, None, &Pictures::none(), &mut Quiet::default()).unwrap_err();
    assert!(error.to_string().contains("wet-floor"), "{error}");
    let chain = Options {
        effects: vec![Swept::Frame(effect("chain").unwrap())],
        scenes: Scenes::Named(vec!["wet-floor".to_owned()]),
        ..options("ssr", 0)
    };
    let error = sweep(&chain, None, &Pictures::none(), &mut Quiet::default()).unwrap_err();
    assert!(
        error.to_string().contains("no truth for `chain`"),
        "{error}"
    );
    // A scene is no sky, so that there is nothing to do.
    let scene = Options {
        scenes: Scenes::Named(vec!["wet-floor".to_owned()]),
        ..options("environment", 0)
    };
    let error = sweep(&scene, None, &Pictures::none(), &mut Quiet::default()).unwrap_err();
    assert!(matches!(error, SweepError::Nothing), "{error}");
}

/// More texels looked at and more halvings bring the hit nearer to the first
/// crossing, and cost look-ups.
#[test]
fn reflections_come_nearer_as_resolution_and_steps_rise() {
    let found = run(&options("ssr", 2));
    for subject in &found.subjects {
        let ladder = ["0.0625", "0.125", "0.25", "0.5", "1"];
        let mut before: Option<&Point> = None;
        for resolution in ladder {
            let point = at(subject, &[("resolution", resolution)]);
            if let Some(before) = before {
                let [worse, better] = [before, point].map(|point| error(point, "algorithm.recall"));
                assert!(
                    better >= worse,
                    "{} {resolution}: {worse} to {better}",
                    subject.scene
                );
                assert!(point.work.texel_fetches > before.work.texel_fetches);
                assert!(point.work.steps_per_ray > before.work.steps_per_ray);
            }
            before = Some(point);
        }
        // The bracket is a step of four texels, and every halving halves it; what is
        // left is found by halving, not by more of the march.
        let mut bracket = 4.0;
        for steps in ["1", "2", "3", "5", "8", "12"] {
            let point = at(subject, &[("resolution", "0.25"), ("steps", steps)]);
            bracket = 4.0 / f64::from(1 << steps.parse::<u32>().unwrap());
            let median = error(point, "algorithm.hit-median");
            // Along the longer axis; across, at most as much again.
            assert!(
                median <= bracket * std::f64::consts::SQRT_2 + 0.05,
                "{} {steps}: {median} of {bracket}",
                subject.scene
            );
        }
        assert!(bracket < 0.01);
        let converged = at(subject, &[("steps", "12")]);
        assert!(
            error(converged, "algorithm.hit-median") < 0.05,
            "{}",
            subject.scene
        );
        let linear = at(subject, &[("search", "linear"), ("resolution", "0.25")]);
        let refined = at(subject, &[("resolution", "0.25")]);
        assert!(
            error(linear, "algorithm.hit-median") > 4.0 * error(refined, "algorithm.hit-median"),
            "{}",
            subject.scene
        );
    }
}

/// More directions bring each level nearer to the integral, and cost look-ups in
/// proportion. Of a sum over `n` evenly spread directions that each see as much as they
/// stand for the error falls with `n`, its square with `n²`; what the choice of mips
/// leaves falls as fast. Half of that slope has to be seen over the ladder.
#[test]
fn environments_come_nearer_as_samples_rise() {
    let found = run(&Options {
        size: FrameSize::new(128, 128).unwrap(),
        ..options("environment", 1)
    });
    assert_eq!(found.subjects.len(), 2);
    for subject in &found.subjects {
        let ladder = ["16", "32", "64", "128", "256", "512", "1024"]
            .map(|samples| at(subject, &[("samples", samples)]));
        for pair in ladder.windows(2) {
            let [worse, better] = [0, 1].map(|k| error(pair[k], "algorithm.colour"));
            println!("{} {}: {worse:e} to {better:e}", subject.scene, pair[1].id);
            assert!(better < worse, "{} {}", subject.scene, pair[1].id);
            let [less, more] = [0, 1].map(|k| pair[k].work.texel_fetches as f64);
            // Directions under the horizon are left out, and each takes four texels.
            assert!((more / less - 2.0).abs() < 0.1, "{less} to {more}");
        }
        let [worst, best] = [0, 6].map(|k| error(ladder[k], "algorithm.colour"));
        assert!(best < worst / 64.0, "{}: {worst} to {best}", subject.scene);
        // The map has texels, which no number of directions makes smaller.
        let [few, many] = [0, 6].map(|k| error(ladder[k], "model.colour"));
        assert!(many < few, "{}: {few} to {many}", subject.scene);
        assert!(many >= best * 0.5, "{}: {many}", subject.scene);
    }
}

/// Rounding is far below what the algorithm leaves out, or the sweep says where not:
/// where the algorithm is exact there is nothing else left.
#[test]
fn rounding_is_far_below_what_the_algorithm_leaves_out_or_it_is_said() {
    for (name, small) in [
        ("ssr", true),
        ("bloom", true),
        ("exposure", false),
        ("composite", false),
        ("environment", true),
    ] {
        let found = run(&options(name, 0));
        for subject in &found.subjects {
            let point = &subject.points[0];
            assert_eq!(point.id, "strict");
            let measure = if name == "exposure" { "ev" } else { "colour" };
            let [rounding, algorithm] =
                ["rounding", "algorithm"].map(|kind| error(point, &format!("{kind}.{measure}")));
            let what = format!("{name} on {}: {rounding} of {algorithm}", subject.scene);
            assert_eq!(rounding * 10.0 <= algorithm, small, "{what}");
            let said = |note: &String| note.contains("rounding") && note.contains(&subject.scene);
            assert_eq!(found.notes.iter().any(said), !small, "{what}");
        }
    }
}

/// Work in counters, and error, of one setting: all are the better the less.
#[derive(Clone, Copy, Debug, Default, PartialEq, PartialOrd)]
struct Sum {
    operations: u64,
    fetches: u64,
    bytes: u64,
    error: f64,
}

impl Sum {
    fn beats(&self, other: &Self) -> bool {
        self.operations <= other.operations
            && self.fetches <= other.fetches
            && self.bytes <= other.bytes
            && self.error <= other.error
            && self != other
    }
}

/// A preset that another setting beats in all counters and in error is none. Over
/// the scenes of the effect, at the size that the rule for presets says.
#[test]
fn no_preset_is_beaten_in_work_and_error() {
    for effect in Swept::all() {
        let found = run(&Options {
            size: FrameSize::new(320, 180).unwrap(),
            ..options(effect.name(), 2)
        });
        let mut sums: BTreeMap<&str, (Sum, Option<&str>)> = BTreeMap::new();
        for subject in &found.subjects {
            let main = &subject.mains()[0].id;
            for point in subject
                .points
                .iter()
                .filter(|point| point.arithmetic == "strict")
            {
                let (sum, preset) = sums.entry(&point.id).or_default();
                sum.operations += point.work.operations;
                sum.fetches += point.work.texel_fetches;
                sum.bytes += point.bytes;
                sum.error += error(point, main);
                *preset = point.preset.as_deref();
            }
        }
        let presets = sums.iter().filter(|(_, (_, preset))| preset.is_some());
        assert!(presets.clone().count() > 0, "{}", effect.name());
        for (id, (sum, preset)) in presets {
            for (other_id, (other, _)) in &sums {
                assert!(
                    !other.beats(sum),
                    "{} {preset:?}: {other_id} with {other:?} beats {id} with {sum:?}",
                    effect.name()
                );
            }
        }
    }
}

/// The profile that is kept of llvmpipe is one, and has a choice for its times.
#[test]
fn the_kept_profile_can_be_picked_from() {
    let text = include_str!("../../../../docs/measurements/llvmpipe.profile.json");
    let profile: DeviceProfile = serde_json::from_str(text).unwrap();
    assert_eq!(profile.size, [640, 360]);
    let picked = |budget| ChainSettings::full().for_budget(budget, &profile);
    let (little, much) = (picked(100.0).unwrap(), picked(400.0).unwrap());
    assert!(little.ssr.unwrap().resolution < much.ssr.unwrap().resolution);
    assert!(matches!(picked(10.0), Err(BudgetError::TooLittle { .. })));
}
