//! A sweep over all backends: strict settings have the same errors everywhere, and
//! every backend says how long it took.

use std::time::Duration;

use etalon_accuracy::executors::{Executor, Kind};
use etalon_accuracy::model::Sweep;
use etalon_accuracy::pictures::Pictures;
use etalon_accuracy::sweep::{Options, Progress, Scenes, sweep};
use etalon_accuracy::trial::Swept;
use etalon_scenes::FrameSize;
use etalon_tests::required;

struct Quiet;

impl Progress for Quiet {
    fn begin(&mut self, _: &str, _: usize) {}
    fn step(&mut self) {}
    fn keep(&mut self, _: &Sweep) -> Result<(), String> {
        Ok(())
    }
}

#[test]
fn strict_errors_are_the_same_on_every_backend() {
    let there = |kind: &Kind| match Executor::open(*kind) {
        Ok(_) => true,
        Err(error) => {
            assert!(!required(&kind.to_string()), "{kind} is required: {error}");
            eprintln!("without {kind}: {error}");
            false
        }
    };
    let backends: Vec<Kind> = Kind::ALL.into_iter().filter(there).collect();
    let options = Options {
        effects: Swept::all().collect(),
        scenes: Scenes::Named(["wet-floor", "sun"].map(str::to_owned).to_vec()),
        backends: backends.clone(),
        size: FrameSize::new(97, 55).unwrap(),
        depth: 1,
        frames: 3,
        budget: Duration::from_secs(3600),
    };
    let found = sweep(&options, None, &Pictures::none(), &mut Quiet).unwrap();
    assert_eq!(found.executors.len(), backends.len());
    assert_eq!(found.subjects.len(), Swept::all().count());
    for subject in &found.subjects {
        for point in &subject.points {
            let what = format!("{} {}", subject.effect, point.id);
            let reference = &point.on("cpu").expect(&what).errors;
            assert_eq!(reference.len(), subject.metrics.len(), "{what}");
            for result in &point.results {
                assert!(result.time.is_some_and(|time| time.median > 0.0), "{what}");
                if point.arithmetic == "strict" {
                    assert_eq!(&result.errors, reference, "{what} on {}", result.executor);
                }
            }
        }
    }
}
