//! Time over the share of the screen that mirrors, drawn. Both axes are linear, so that
//! a line is a line.

use std::fmt::Write;

use etalon_accuracy::model::Spread;
use etalon_accuracy::report::escape;
use etalon_accuracy::text;

use crate::model::Sweep;
use crate::table::percent;

/// Rules for what is drawn.
pub const STYLE: &str = include_str!("chart.css");

const WIDTH: f64 = 720.0;
const HEIGHT: f64 = 420.0;
const LEFT: f64 = 84.0;
const RIGHT: f64 = WIDTH - 24.0;
const TOP: f64 = 70.0;
const BOTTOM: f64 = HEIGHT - 56.0;

/// The place of a share along the horizontal axis.
fn across(share: f64) -> f64 {
    LEFT + share.clamp(0.0, 1.0) * (RIGHT - LEFT)
}

/// The vertical axis: from nothing to a round number above every time.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Axis {
    step: f64,
    steps: u32,
}

impl Axis {
    /// Holds a time, with steps of one, two or five times a power of ten.
    fn up_to(most: f64) -> Self {
        let most = if most > 0.0 && most.is_finite() {
            most
        } else {
            1.0
        };
        let power = 10f64.powi((most / 6.0).log10().floor() as i32);
        let steps = [1.0, 2.0, 5.0, 10.0].map(|multiple| multiple * power);
        let step = steps.into_iter().find(|step| most / step <= 6.0);
        let step = step.unwrap_or(10.0 * power);
        Self {
            step,
            steps: ((most / step).ceil() as u32).clamp(1, 6),
        }
    }

    fn top(&self) -> f64 {
        self.step * f64::from(self.steps)
    }

    fn place(&self, time: f64) -> f64 {
        let share = time / self.top();
        let share = if share.is_nan() {
            0.0
        } else {
            share.clamp(0.0, 1.0)
        };
        BOTTOM - share * (BOTTOM - TOP)
    }
}

/// A chart of the sweeps of one executor, as an element of a page or, with `alone`, a
/// file of its own.
#[must_use]
pub fn svg(title: &str, sweeps: &[&Sweep], alone: bool) -> String {
    let mut svg = String::new();
    let escaped = escape(title);
    let view = format!("class=\"economy-chart\" viewBox=\"0 0 {WIDTH} {HEIGHT}\" role=\"img\"");
    if alone {
        let _ = writeln!(
            svg,
            "<svg xmlns=\"http://www.w3.org/2000/svg\" {view} width=\"{WIDTH}\" height=\"{HEIGHT}\">\n<style>\n{}\n</style>",
            STYLE.trim_end()
        );
    } else {
        let _ = writeln!(svg, "<svg {view}>");
    }
    let _ = writeln!(
        svg,
        "<title>{escaped}: time over the share of the screen that mirrors</title>\n\
         <rect class=\"page\" width=\"{WIDTH}\" height=\"{HEIGHT}\"/>\n<text class=\"title\" x=\"16\" y=\"26\">{escaped}</text>"
    );
    let points = || sweeps.iter().flat_map(|sweep| &sweep.points);
    if points().next().is_none() {
        let _ = writeln!(
            svg,
            "<text class=\"empty\" x=\"{}\" y=\"{}\" text-anchor=\"middle\">Nothing was timed.</text>\n</svg>",
            WIDTH / 2.0,
            HEIGHT / 2.0
        );
        return svg;
    }
    let most = points()
        .flat_map(|point| [point.tiled.upper, point.whole.upper])
        .filter(|time| time.is_finite())
        .fold(0.0, f64::max);
    let axis = Axis::up_to(most);
    grid(&mut svg, axis);
    legend(&mut svg, sweeps);
    for sweep in sweeps {
        series(&mut svg, axis, sweep);
    }
    if let Some(first) = sweeps.first() {
        for point in &first.points {
            let what = format!("whole picture, {} mirroring", percent(point.coverage));
            mark(
                &mut svg,
                axis,
                ("whole", point.coverage),
                &point.whole,
                &what,
            );
        }
    }
    svg.push_str("</svg>\n");
    svg
}

fn grid(svg: &mut String, axis: Axis) {
    for step in 0..=axis.steps {
        let time = axis.step * f64::from(step);
        let y = axis.place(time);
        let name = if step == 0 {
            "0".to_owned()
        } else {
            text::time(time)
        };
        let _ = writeln!(
            svg,
            "<path class=\"grid\" d=\"M{LEFT} {y:.1}H{RIGHT}\"/><text class=\"tick\" x=\"{:.1}\" y=\"{:.1}\" \
             text-anchor=\"end\">{name}</text>",
            LEFT - 8.0,
            y + 4.0
        );
    }
    for tenth in [0, 2, 4, 6, 8, 10] {
        let x = across(f64::from(tenth) / 10.0);
        let _ = writeln!(
            svg,
            "<path class=\"grid\" d=\"M{x:.1} {TOP}V{BOTTOM}\"/><text class=\"tick\" x=\"{x:.1}\" y=\"{:.1}\" \
             text-anchor=\"middle\">{} %</text>",
            BOTTOM + 18.0,
            tenth * 10
        );
    }
    let _ = writeln!(
        svg,
        "<text class=\"axis\" x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"middle\">share of the screen that mirrors</text>",
        (LEFT + RIGHT) / 2.0,
        HEIGHT - 14.0
    );
}

fn legend(svg: &mut String, sweeps: &[&Sweep]) {
    let mut x = LEFT;
    let mut entry = |class: &str, name: &str| {
        let _ = writeln!(
            svg,
            "<path class=\"fit {class}\" d=\"M{x:.1} 48h22\"/><circle class=\"{class}\" cx=\"{:.1}\" cy=\"48\" r=\"4\"/>\
             <text x=\"{:.1}\" y=\"52\">{name}</text>",
            x + 11.0,
            x + 30.0
        );
        x += 62.0 + 7.0 * name.chars().count() as f64;
    };
    for sweep in sweeps {
        let name = sweep.layout.to_string();
        entry(&name, &format!("on tiles, {name}"));
    }
    entry("whole", "on the whole picture");
}

/// A sweep's points, the line through them, and where that meets the whole.
fn series(svg: &mut String, axis: Axis, sweep: &Sweep) {
    let class = sweep.layout.to_string();
    let (x0, x1) = (across(0.0), across(1.0));
    let _ = writeln!(
        svg,
        "<path class=\"fit {class}\" d=\"M{x0:.1} {:.1}L{x1:.1} {:.1}\"/>",
        axis.place(sweep.fit.at(0.0)),
        axis.place(sweep.fit.at(1.0))
    );
    let whole = axis.place(sweep.cost.whole);
    let _ = writeln!(
        svg,
        "<path class=\"fit whole\" d=\"M{x0:.1} {whole:.1}H{x1:.1}\"/>"
    );
    let crossover = sweep.crossover();
    if crossover > 0.0 && crossover < 1.0 {
        let x = across(crossover);
        let _ = writeln!(
            svg,
            "<path class=\"crossing {class}\" d=\"M{x:.1} {whole:.1}V{BOTTOM}\"><title>{class}: tiles are faster below {}</title></path>",
            percent(crossover)
        );
    }
    for point in &sweep.points {
        let what = format!("on tiles, {class}, {} mirroring", percent(point.coverage));
        mark(
            svg,
            axis,
            (class.as_str(), point.coverage),
            &point.tiled,
            &what,
        );
    }
}

/// A point with its quartiles.
fn mark(svg: &mut String, axis: Axis, (class, share): (&str, f64), times: &Spread, what: &str) {
    let x = across(share);
    let _ = writeln!(
        svg,
        "<path class=\"bar {class}\" d=\"M{x:.1} {:.1}V{:.1}\"/><circle class=\"{class}\" cx=\"{x:.1}\" cy=\"{:.1}\" \
         r=\"4\"><title>{}: {}</title></circle>",
        axis.place(times.lower),
        axis.place(times.upper),
        axis.place(times.median),
        escape(what),
        text::time(times.median)
    );
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fit::Line;
    use crate::model::Point;
    use etalon_effects::tiles::crossover::Cost;

    #[test]
    fn axes_are_round_and_hold_everything() {
        for most in [1e-3, 0.9, 1.0, 1.01, 6.0, 61.0, 1.3e8, 9.9e9] {
            let axis = Axis::up_to(most);
            assert!(axis.top() >= most * (1.0 - 1e-12), "{most}: {axis:?}");
            assert!(axis.top() <= 2.5 * most, "{most}: {axis:?}");
            assert!((1..=6).contains(&axis.steps));
            assert_eq!(axis.place(0.0), BOTTOM);
            assert_eq!(axis.place(axis.top()), TOP);
        }
        for broken in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            assert_eq!(Axis::up_to(broken), Axis::up_to(1.0));
        }
        assert_eq!(Axis::up_to(1.0).place(f64::NAN), BOTTOM);
    }

    /// A line of our own, whose ends must stand where the axes say.
    #[test]
    fn the_line_is_drawn_where_it_is() {
        let spread = |median| Spread {
            median,
            lower: median,
            upper: median,
            frames: 3,
        };
        let point = |coverage, tiled| Point {
            coverage,
            tiled: spread(tiled),
            whole: spread(4e6),
            ..Point::default()
        };
        let sweep = Sweep {
            points: vec![point(0.0, 1e6), point(1.0, 5e6)],
            fit: Line {
                intercept: 1e6,
                slope: 4e6,
                r_squared: 1.0,
            },
            cost: Cost {
                idle: 1e6,
                slope: 4e6,
                whole: 4e6,
            },
            ..Sweep::default()
        };
        let drawn = svg("a <title>", &[&sweep], true);
        assert!(drawn.contains("a &lt;title&gt;") && !drawn.contains("a <title>"));
        // Five steps of a millisecond over 294 units.
        let line = format!(
            "M{LEFT:.1} {:.1}L{RIGHT:.1} {TOP:.1}",
            BOTTOM - (BOTTOM - TOP) / 5.0
        );
        assert!(drawn.contains(&line), "{line}\n{drawn}");
        // They cross at three quarters.
        let crossing = format!(
            "class=\"crossing compact\" d=\"M{:.1}",
            LEFT + 0.75 * (RIGHT - LEFT)
        );
        assert!(drawn.contains(&crossing), "{crossing}\n{drawn}");
        assert_eq!(drawn.matches("<circle class=\"compact\" cx").count(), 3);
    }

    #[test]
    fn nothing_is_said_to_be_nothing() {
        assert!(svg("none", &[], false).contains("Nothing was timed."));
    }
}
