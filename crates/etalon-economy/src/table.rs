//! What was found, for a terminal.

use std::fmt::Write;

use etalon_accuracy::text::{number, time};

use crate::model::{Economy, Sweep};

/// A share in per cent.
#[must_use]
pub fn percent(share: f64) -> String {
    format!("{} %", number(share * 100.0))
}

/// The conclusions of a sweep in a line.
#[must_use]
pub fn verdict(sweep: &Sweep) -> String {
    let cost = sweep.cost;
    let share = |part: f64| {
        if cost.whole > 0.0 {
            percent(part / cost.whole)
        } else {
            "?".to_owned()
        }
    };
    format!(
        "idle {} ({} of the whole), {} more per screen that mirrors (R² {}); {} and {} more per screen marched (R² {}), \
         so that tiles are faster below {} marched",
        time(sweep.fit.intercept),
        share(sweep.fit.intercept),
        time(sweep.fit.slope),
        number(sweep.fit.r_squared),
        time(cost.idle),
        time(cost.slope),
        number(sweep.work.r_squared),
        percent(cost.crossover()),
    )
}

/// All as text.
#[must_use]
pub fn text(economy: &Economy) -> String {
    let mut text = String::new();
    let [width, height] = economy.size;
    let _ = writeln!(
        text,
        "Reflections on {}, {width} × {height}\n",
        economy.scene
    );
    for sweep in &economy.sweeps {
        let _ = writeln!(
            text,
            "{}, {}: {}",
            sweep.executor,
            sweep.layout,
            verdict(sweep)
        );
        let _ = writeln!(
            text,
            "  {:>10} {:>10} {:>10} {:>14} {:>10} {:>10}",
            "mirroring", "marched", "on tiles", "classification", "whole", "ratio"
        );
        for point in &sweep.points {
            let _ = writeln!(
                text,
                "  {:>10} {:>10} {:>10} {:>14} {:>10} {:>10}",
                percent(point.coverage),
                percent(point.marched),
                time(point.tiled.median),
                time(point.classification.median),
                time(point.whole.median),
                percent(point.ratio.median),
            );
        }
        for (aim, ratio, met) in sweep.targets() {
            let sign = if met { "met" } else { "missed" };
            let _ = writeln!(text, "  {sign}: {aim}; {}", percent(ratio));
        }
        text.push('\n');
    }
    if !economy.frames.is_empty() {
        let _ = writeln!(text, "Whole frames that lack");
    }
    for frame in &economy.frames {
        let times = frame.times.iter();
        let times: Vec<String> = times
            .map(|(executor, spread)| format!("{executor} {}", time(spread.median)))
            .collect();
        let _ = writeln!(
            text,
            "  {:<20} {:>3} dispatches  {}",
            frame.lacking,
            frame.dispatches,
            times.join(", ")
        );
    }
    for note in &economy.notes {
        let _ = writeln!(text, "\n{note}");
    }
    text
}
