//! A small sweep on the interpreter.

use std::time::Duration;

use etalon_accuracy::executors::Kind;
use etalon_economy::mask::Layout;
use etalon_economy::sweep::{COVERAGES, EconomyError, Options, Progress, sweep};
use etalon_effects::tiles::Tiling;
use etalon_scenes::FrameSize;

#[derive(Default)]
struct Counted {
    begun: Vec<(String, u64)>,
    steps: u64,
}

impl Progress for Counted {
    fn begin(&mut self, what: &str, steps: u64) {
        self.begun.push((what.to_owned(), steps));
    }

    fn step(&mut self) {
        self.steps += 1;
    }
}

fn options() -> Options {
    Options {
        scene: "corridor-grazing".to_owned(),
        size: FrameSize::new(96, 54).unwrap(),
        backends: vec![Kind::Cpu],
        tiles: Tiling::Texels8,
        frames: 3,
        budget: Duration::from_secs(600),
    }
}

#[test]
fn a_sweep_has_every_share_in_both_layouts() {
    let mut counted = Counted::default();
    let found = sweep(&options(), &mut counted).unwrap();
    assert_eq!(found.size, [96, 54]);
    assert_eq!(found.sweeps.len(), 2);
    for (swept, layout) in found.sweeps.iter().zip(Layout::ALL) {
        assert_eq!((swept.executor.as_str(), swept.layout), ("cpu", layout));
        assert_eq!(swept.points.len(), COVERAGES.len());
        let first = &swept.points[0];
        let last = &swept.points[COVERAGES.len() - 1];
        // Where nothing mirrors nothing is marched, and all where everything does.
        assert_eq!((first.coverage, first.marched), (0.0, 0.0));
        assert_eq!((last.coverage, last.marched), (1.0, 1.0));
        for point in &swept.points {
            assert!(point.marched >= point.coverage, "{point:?}");
            for times in [point.tiled, point.classification, point.whole] {
                assert!(times.median > 0.0 && times.frames == 3, "{point:?}");
            }
            assert!(point.classification.median < point.tiled.median);
        }
    }
    assert_eq!(found.frames[0].lacking, "nothing");
    let without = found
        .frames
        .iter()
        .find(|frame| frame.lacking == "reflections");
    assert!(without.unwrap().dispatches < found.frames[0].dispatches);
    let steps: u64 = counted.begun.iter().map(|(_, steps)| steps).sum();
    assert_eq!(counted.steps, steps);
}

#[test]
fn what_there_is_not_is_refused() {
    let refused = |options: Options| sweep(&options, &mut Counted::default()).unwrap_err();
    let nowhere = refused(Options {
        scene: "nowhere".to_owned(),
        ..options()
    });
    assert!(matches!(nowhere, EconomyError::NoScene { .. }), "{nowhere}");
    let off = refused(Options {
        tiles: Tiling::Off,
        ..options()
    });
    assert!(matches!(off, EconomyError::NoTiles), "{off}");
}
