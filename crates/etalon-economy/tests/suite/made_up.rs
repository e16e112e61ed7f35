//! Findings of our own, of which everything is known.

use etalon_accuracy::model::{Executor, Spread};
use etalon_economy::fit;
use etalon_economy::mask::Layout;
use etalon_economy::model::{Economy, LackingFrame, Point, Sweep};
use etalon_economy::sweep::COVERAGES;
use etalon_effects::tiles::crossover::Cost;

pub(crate) fn times(median: f64) -> Spread {
    Spread {
        median,
        lower: 0.97 * median,
        upper: 1.04 * median,
        frames: 9,
    }
}

/// Times in milliseconds: a line that meets 100 at a share of `crossover`.
fn sweep(executor: &str, layout: Layout, idle: f64, crossover: f64) -> Sweep {
    let (whole, slope) = (100e6, (100.0 - idle) * 1e6 / crossover);
    let points = COVERAGES.map(|coverage| {
        let tiled = idle * 1e6 + slope * coverage;
        Point {
            coverage,
            marched: (1.2 * coverage).min(1.0),
            tiled: times(tiled),
            classification: times(1e6),
            whole: times(whole),
            ratio: times(tiled / whole),
        }
    });
    let line: Vec<_> = points
        .iter()
        .map(|point| (point.coverage, point.tiled.median))
        .collect();
    Sweep {
        executor: executor.to_owned(),
        layout,
        points: points.to_vec(),
        fit: fit::line(&line).unwrap(),
        work: fit::line(&line).unwrap(),
        cost: Cost {
            idle: idle * 1e6,
            slope,
            whole,
        },
    }
}

pub(crate) fn economy() -> Economy {
    let executors = ["cpu", "wgpu", "ash"].map(|id| Executor {
        id: id.to_owned(),
        api: "an interface".to_owned(),
        device: format!("a device of {id} <b>"),
        driver: "a driver".to_owned(),
    });
    let mut sweeps = Vec::new();
    for (number, executor) in executors.iter().enumerate() {
        let idle = 3.0 + number as f64;
        sweeps.push(sweep(&executor.id, Layout::Compact, idle, 0.97));
        sweeps.push(sweep(&executor.id, Layout::Scattered, idle, 0.8));
    }
    let frame = |lacking: &str, dispatches, milliseconds: f64| LackingFrame {
        lacking: lacking.to_owned(),
        why: "as an example".to_owned(),
        dispatches,
        bytes: 5 << 20,
        times: executors
            .iter()
            .map(|executor| (executor.id.clone(), times(milliseconds * 1e6)))
            .collect(),
    };
    Economy {
        size: [640, 360],
        scene: "corridor-grazing".to_owned(),
        sweeps,
        frames: vec![frame("nothing", 30, 60.0), frame("reflections", 15, 15.0)],
        notes: vec!["a note with <angles>".to_owned()],
        executors: executors.to_vec(),
    }
}
