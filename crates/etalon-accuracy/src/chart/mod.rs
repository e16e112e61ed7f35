//! Error against time, drawn.
//!
//! Both axes are logarithmic: a setting that halves the error for twice the time is
//! one step down and one to the right wherever it starts. Lower left is better.
//!
//! The Pareto front is drawn of each series by itself, `strict` and `fast`: which
//! arithmetic to take is decided by other reasons than its time, and a setting that
//! is only beaten by itself in other arithmetic is not a bad setting.

mod labels;
mod scale;

use std::fmt::Write;

use crate::front::{Candidate, front};
use crate::model::{Executor, Metric, Outcome, Point, Spread, Subject};
use crate::text;
use labels::Area;
use scale::Scale;

/// Rules for what is drawn, by way of the page's colours.
pub(crate) const STYLE: &str = include_str!("chart.css");
/// The page's colours, for a chart without a page.
const COLOURS: &str = include_str!("colours.css");

/// Where a chart is going to stand.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Place {
    /// In the report, which has colours and rules for it.
    Page,
    /// In a file of its own, with colours for light and dark, not to be operated.
    Alone,
}

/// A chart of one error on one executor.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Chart {
    /// Above it.
    pub title: String,
    /// Along the axis of errors, with the unit.
    pub error: String,
    /// What is drawn.
    pub marks: Vec<Mark>,
}

/// A point of a chart.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Mark {
    /// The point's id.
    pub id: String,
    /// What it is called in the chart, if it has a name.
    pub name: Option<String>,
    /// Whether nobody set anything.
    pub default: bool,
    /// Drawn alike: `strict` or `fast`.
    pub series: String,
    /// For how long it takes.
    pub time: Option<Spread>,
    /// How wrong it is, smaller being better.
    pub error: Option<f64>,
    /// All about it in a line.
    pub description: String,
}

/// How the errors of a metric become distances from the best, which alone have a
/// logarithm: themselves, or what is missing from it.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Missing {
    Nothing,
    /// To one whole.
    One,
    /// To the largest found.
    Largest(f64),
}

impl Missing {
    fn of<'a>(metric: &Metric, outcomes: impl Iterator<Item = &'a Outcome>) -> Self {
        if !metric.larger_is_better {
            return Self::Nothing;
        }
        let values = outcomes.filter_map(|outcome| outcome.errors.get(&metric.id).copied());
        let values: Vec<f64> = values.filter(|value| value.is_finite()).collect();
        if metric.unit.is_empty() && values.iter().all(|value| (0.0..=1.0).contains(value)) {
            Self::One
        } else {
            Self::Largest(values.into_iter().fold(f64::NEG_INFINITY, f64::max))
        }
    }

    fn distance(self, value: f64) -> f64 {
        match self {
            Self::Nothing => value,
            Self::One => 1.0 - value,
            Self::Largest(largest) => largest - value,
        }
    }
}

/// Whether a point has every knob as it is if nobody turns it.
pub(crate) fn is_default(subject: &Subject, point: &Point) -> bool {
    let default = |(knob, value): (&String, &String)| {
        let mut knobs = subject.knobs.iter();
        knobs.any(|known| known.name == *knob && known.default == *value)
    };
    !point.settings.is_empty() && point.settings.iter().all(default)
}

/// Time with quartiles.
pub(crate) fn spread_text(spread: &Spread) -> String {
    format!(
        "{} ({} to {})",
        text::time(spread.median),
        text::time(spread.lower),
        text::time(spread.upper)
    )
}

impl Chart {
    /// The chart of a subject by one of its metrics on one executor. Of a metric of
    /// which larger is better, what is missing to the best is drawn: to 1 of shares,
    /// else to the largest found on any executor.
    #[must_use]
    pub fn of(subject: &Subject, metric: &Metric, executor: &Executor) -> Self {
        let all = subject.points.iter().flat_map(|point| &point.results);
        let missing = Missing::of(metric, all);
        let mark = |point: &Point| {
            let outcome = point.on(&executor.id)?;
            let value = outcome.errors.get(&metric.id).copied();
            let time = outcome
                .time
                .as_ref()
                .map_or_else(|| "not timed".to_owned(), spread_text);
            let error = value.map_or_else(
                || "no such error".to_owned(),
                |value| format!("{} {}", metric.name, text::quantity(value, &metric.unit)),
            );
            let settings = text::settings(&point.settings);
            let preset = point
                .preset
                .as_ref()
                .map_or_else(String::new, |preset| format!("{preset}: "));
            Some(Mark {
                id: point.id.clone(),
                name: point.preset.clone(),
                default: is_default(subject, point),
                series: point.arithmetic.clone(),
                time: outcome.time,
                error: value.map(|value| missing.distance(value)),
                description: format!("{preset}{settings}, {}; {time}; {error}", point.arithmetic),
            })
        };
        let unit = match (missing, metric.unit.as_str()) {
            (Missing::Nothing, "") => String::new(),
            (Missing::Nothing, unit) => format!(" [{unit}]"),
            (Missing::One, _) => ", missing to 1".to_owned(),
            (Missing::Largest(_), "") => ", missing to the best".to_owned(),
            (Missing::Largest(_), unit) => format!(", missing to the best [{unit}]"),
        };
        Self {
            title: if executor.device.is_empty() {
                executor.id.clone()
            } else {
                format!("{} · {}", executor.id, executor.device)
            },
            error: format!("{}{unit}", metric.name),
            marks: subject.points.iter().filter_map(mark).collect(),
        }
    }

    /// The chart as SVG: a file of its own, or an element of a page.
    #[must_use]
    pub fn svg(&self, place: Place) -> String {
        let drawing = Drawing::of(self);
        let mut svg = String::new();
        head(&mut svg, self, place);
        drawing.grid(&mut svg, &self.error);
        drawing.legend(&mut svg);
        drawing.front(&mut svg);
        drawing.bars(&mut svg);
        drawing.points(&mut svg, place);
        drawing.names(&mut svg);
        drawing.left_out(&mut svg, self.marks.len());
        svg.push_str("</svg>\n");
        svg
    }
}

const WIDTH: f64 = 720.0;
const HEIGHT: f64 = 450.0;
const LEFT: f64 = 84.0;
const RIGHT: f64 = WIDTH - 20.0;
const TOP: f64 = 66.0;
const BOTTOM: f64 = HEIGHT - 62.0;
/// Height of the strip for errors of 0, and of the gap above it.
const STRIP: f64 = 28.0;
const GAP: f64 = 8.0;

/// The root element, what describes it, and the background.
fn head(svg: &mut String, chart: &Chart, place: Place) {
    let title = text::escape(&chart.title);
    let error = text::escape(&chart.error);
    let view = format!("class=\"chart-svg\" viewBox=\"0 0 {WIDTH} {HEIGHT}\"");
    match place {
        Place::Page => {
            let _ = writeln!(
                svg,
                "<svg {view} role=\"group\" aria-label=\"{title}: {error} against time\">"
            );
        }
        Place::Alone => {
            let _ = writeln!(
                svg,
                "<svg xmlns=\"http://www.w3.org/2000/svg\" {view} width=\"{WIDTH}\" height=\"{HEIGHT}\" role=\"img\">\n\
                 <title>{title}: {error} against time</title>\n<style>\n{}\n{}\n</style>",
                COLOURS.trim_end(),
                STYLE.trim_end(),
            );
        }
    }
    let _ = writeln!(
        svg,
        "<rect class=\"page\" width=\"{WIDTH}\" height=\"{HEIGHT}\"/>\n<text class=\"title\" x=\"16\" y=\"26\">{title}</text>"
    );
}

/// A point that has a place.
#[derive(Debug)]
struct Drawn<'a> {
    mark: &'a Mark,
    time: Spread,
    error: f64,
    x: f64,
    y: f64,
    /// Nothing of its series dominates it.
    on_front: bool,
}

impl Drawn<'_> {
    /// Whether it is there only to be compared with.
    const fn is_faint(&self) -> bool {
        !self.on_front && self.mark.name.is_none() && !self.mark.default
    }
}

/// The series drawn: the known ones first, others as they come.
fn series_of<'a>(points: &[Drawn<'a>]) -> Vec<&'a str> {
    let mut all: Vec<&'a str> = Vec::new();
    for known in ["strict", "fast"] {
        let mut points = points.iter();
        all.extend(
            points
                .find(|point| point.mark.series == known)
                .map(|point| point.mark.series.as_str()),
        );
    }
    for point in points {
        if !all.contains(&point.mark.series.as_str()) {
            all.push(&point.mark.series);
        }
    }
    all
}

/// A chart laid out.
#[derive(Debug)]
struct Drawing<'a> {
    /// From the cheapest to the dearest.
    points: Vec<Drawn<'a>>,
    times: Scale,
    /// `None` if no error has a logarithm.
    errors: Option<Scale>,
    /// Middle of the strip for errors of 0, if there are any.
    zero: Option<f64>,
    /// Lower end of the axis of errors.
    floor: f64,
    without_time: usize,
    without_error: usize,
}

impl<'a> Drawing<'a> {
    fn of(chart: &'a Chart) -> Self {
        let (mut without_time, mut without_error) = (0, 0);
        let mut kept: Vec<(&Mark, Spread, f64)> = Vec::new();
        for mark in &chart.marks {
            let time = mark
                .time
                .filter(|time| time.median > 0.0 && time.median.is_finite());
            let error = mark
                .error
                .filter(|error| *error >= 0.0 && error.is_finite());
            match (time, error) {
                (Some(time), Some(error)) => kept.push((mark, time, error)),
                (None, _) => without_time += 1,
                (_, None) => without_error += 1,
            }
        }
        kept.sort_by(|a, b| {
            (a.1.median.total_cmp(&b.1.median))
                .then(a.2.total_cmp(&b.2))
                .then_with(|| a.0.id.cmp(&b.0.id))
        });
        let ends = |time: &Spread| [time.lower, time.median, time.upper];
        let times = Scale::new(
            kept.iter().flat_map(|(_, time, _)| ends(time)),
            [LEFT, RIGHT],
        );
        let has_zero = kept.iter().any(|(_, _, error)| *error == 0.0);
        let has_more = kept.iter().any(|(_, _, error)| *error > 0.0);
        let floor = if has_zero {
            BOTTOM - STRIP - GAP
        } else {
            BOTTOM
        };
        let errors = (has_more || !has_zero)
            .then(|| Scale::new(kept.iter().map(|(_, _, error)| *error), [floor, TOP]));
        let zero = has_zero.then_some(BOTTOM - STRIP / 2.0);
        let mut points: Vec<Drawn<'_>> = kept
            .iter()
            .map(|&(mark, time, error)| Drawn {
                mark,
                time,
                error,
                x: times.place(time.median),
                y: match (error > 0.0, &errors, zero) {
                    (true, Some(errors), _) => errors.place(error),
                    (_, _, Some(zero)) => zero,
                    _ => floor,
                },
                on_front: false,
            })
            .collect();
        for series in series_of(&points) {
            let of_series: Vec<usize> = (0..points.len())
                .filter(|&place| points[place].mark.series == series)
                .collect();
            let candidates: Vec<Candidate> = of_series
                .iter()
                .map(|&place| Candidate {
                    cost: points[place].time.median,
                    error: points[place].error,
                })
                .collect();
            for place in front(&candidates) {
                points[of_series[place]].on_front = true;
            }
        }
        Self {
            points,
            times,
            errors,
            zero,
            floor,
            without_time,
            without_error,
        }
    }

    /// Axes with their names, the grid, and the strip for errors of 0.
    fn grid(&self, svg: &mut String, error: &str) {
        let _ = writeln!(
            svg,
            "<text class=\"axis\" x=\"16\" y=\"{}\">↑ {}</text>\n\
             <text class=\"axis\" x=\"{RIGHT}\" y=\"{}\" text-anchor=\"end\">time on the device, per frame →</text>\n\
             <text class=\"axis\" x=\"16\" y=\"{}\">lower left is better</text>",
            TOP - 16.0,
            text::escape(error),
            HEIGHT - 14.0,
            HEIGHT - 14.0,
        );
        if self.points.is_empty() {
            let why = match (self.without_time, self.without_error) {
                (0, 0) => "Nothing was tried here.",
                (_, 0) => "Nothing was timed here.",
                (0, _) => "Nothing has this error here.",
                _ => "Nothing was timed and has this error as well.",
            };
            let _ = writeln!(
                svg,
                "<rect class=\"frame\" x=\"{LEFT}\" y=\"{TOP}\" width=\"{}\" height=\"{}\"/>\n\
                 <text class=\"empty\" x=\"{}\" y=\"{}\" text-anchor=\"middle\">{why}</text>",
                RIGHT - LEFT,
                BOTTOM - TOP,
                (LEFT + RIGHT) / 2.0,
                (TOP + BOTTOM) / 2.0,
            );
            return;
        }
        for tick in self.times.ticks(9) {
            let x = tick.place;
            let class = if tick.named { "decade" } else { "minor" };
            let _ = writeln!(
                svg,
                "<path class=\"{class}\" d=\"M{x:.1} {TOP}V{BOTTOM}\"/>"
            );
            if tick.named {
                let _ = writeln!(
                    svg,
                    "<text class=\"tick\" x=\"{x:.1}\" y=\"{}\" text-anchor=\"middle\">{}</text>",
                    BOTTOM + 20.0,
                    tick.time()
                );
            }
        }
        let floor = self.floor;
        if let Some(errors) = &self.errors {
            for tick in errors.ticks(8) {
                let y = tick.place;
                let class = if tick.named { "decade" } else { "minor" };
                let _ = writeln!(
                    svg,
                    "<path class=\"{class}\" d=\"M{LEFT} {y:.1}H{RIGHT}\"/>"
                );
                if tick.named {
                    let _ = writeln!(
                        svg,
                        "<text class=\"tick\" x=\"{}\" y=\"{:.1}\" text-anchor=\"end\">{}</text>",
                        LEFT - 8.0,
                        y + 4.5,
                        tick.number()
                    );
                }
            }
            let _ = writeln!(
                svg,
                "<rect class=\"frame\" x=\"{LEFT}\" y=\"{TOP}\" width=\"{}\" height=\"{}\"/>",
                RIGHT - LEFT,
                floor - TOP
            );
        }
        if let Some(zero) = self.zero {
            let _ = writeln!(
                svg,
                "<rect class=\"zero\" x=\"{LEFT}\" y=\"{}\" width=\"{}\" height=\"{STRIP}\"/>\n\
                 <text class=\"tick strong\" x=\"{}\" y=\"{}\" text-anchor=\"end\">exactly 0</text>",
                BOTTOM - STRIP,
                RIGHT - LEFT,
                LEFT - 8.0,
                zero + 4.5,
            );
            if self.errors.is_none() {
                let _ = writeln!(
                    svg,
                    "<text class=\"empty\" x=\"{}\" y=\"{}\" text-anchor=\"middle\">Every error is exactly 0.</text>",
                    (LEFT + RIGHT) / 2.0,
                    (TOP + floor) / 2.0,
                );
            }
        }
    }

    /// What is drawn how: only what is there.
    fn legend(&self, svg: &mut String) {
        let mut entries: Vec<(String, String)> = Vec::new();
        for series in series_of(&self.points) {
            let class = series_class(series);
            // A point on the line of its front.
            let shape = format!(
                "<path class=\"front {class}\" d=\"M-12 -4.5H12\"/><circle class=\"{class}\" cx=\"0\" cy=\"-4.5\" r=\"5\"/>",
            );
            entries.push((shape, text::escape(series)));
        }
        if self.points.iter().any(|point| point.mark.default) {
            entries.push((
                "<circle class=\"default-ring\" cx=\"0\" cy=\"-4.5\" r=\"7\"/>".to_owned(),
                "default".to_owned(),
            ));
        }
        let mut right = RIGHT;
        for (shape, name) in entries.iter().rev() {
            let left = right - 0.9 * labels::width(name) - 22.0;
            let _ = writeln!(
                svg,
                "<g class=\"legend\" transform=\"translate({left:.1} {})\">{shape}<text x=\"18\" y=\"0\">{name}</text></g>",
                TOP - 16.0
            );
            right = left - 18.0;
        }
    }

    /// What is reachable within a time, of each series: level until something better
    /// is.
    fn front(&self, svg: &mut String) {
        for series in series_of(&self.points) {
            let mut path = String::new();
            let of_series = |point: &&Drawn<'_>| point.on_front && point.mark.series == series;
            for point in self.points.iter().filter(of_series) {
                let _ = if path.is_empty() {
                    write!(path, "M{:.1} {:.1}", point.x, point.y)
                } else {
                    write!(path, "H{:.1}V{:.1}", point.x, point.y)
                };
            }
            let class = series_class(series);
            let _ = writeln!(svg, "<path class=\"front {class}\" d=\"{path}H{RIGHT}\"/>");
        }
    }

    /// The middle half of the times.
    fn bars(&self, svg: &mut String) {
        for point in &self.points {
            let Spread { lower, upper, .. } = point.time;
            let sound = |time: f64| time > 0.0 && time.is_finite();
            if !(sound(lower) && sound(upper) && lower < upper) {
                continue;
            }
            let (from, to, y) = (self.times.place(lower), self.times.place(upper), point.y);
            let _ = writeln!(
                svg,
                "<path class=\"bar {}{}\" d=\"M{from:.1} {:.1}v6m0 -3H{to:.1}m0 -3v6\"/>",
                series_class(&point.mark.series),
                if point.is_faint() { " faint" } else { "" },
                y - 3.0,
            );
        }
    }

    /// Those to be seen above the others last.
    fn points(&self, svg: &mut String, place: Place) {
        let rank = |point: &&Drawn<'_>| {
            (
                point.mark.name.is_some() || point.mark.default,
                point.on_front,
            )
        };
        let mut points: Vec<&Drawn<'_>> = self.points.iter().collect();
        points.sort_by_key(rank);
        for point in points {
            let mark = point.mark;
            let named = mark.name.is_some();
            if mark.default {
                let _ = writeln!(
                    svg,
                    "<circle class=\"default-ring\" cx=\"{:.1}\" cy=\"{:.1}\" r=\"10\"/>",
                    point.x, point.y
                );
            }
            let radius = match (named, point.on_front) {
                (true, _) => 6.0,
                (false, true) => 4.5,
                (false, false) => 3.5,
            };
            let class = format!(
                "point {}{}{}",
                series_class(&mark.series),
                if point.on_front { " on-front" } else { "" },
                if point.is_faint() { " faint" } else { "" },
            );
            let focus = match place {
                Place::Page => " tabindex=\"0\"",
                Place::Alone => "",
            };
            let _ = writeln!(
                svg,
                "<circle class=\"{class}\" data-point=\"{}\"{focus} cx=\"{:.1}\" cy=\"{:.1}\" r=\"{radius}\"><title>{}</title></circle>",
                text::escape(&mark.id),
                point.x,
                point.y,
                text::escape(&mark.description),
            );
        }
    }

    /// The names of presets and of the default.
    fn names(&self, svg: &mut String) {
        let named: Vec<(&Drawn<'_>, String)> = self
            .points
            .iter()
            .filter_map(|point| {
                let name = match (&point.mark.name, point.mark.default) {
                    (Some(name), _) => name.clone(),
                    (None, true) => "default".to_owned(),
                    (None, false) => return None,
                };
                // A name as long as the chart says nothing more than its start.
                let short: String = name.chars().take(32).collect();
                Some((point, short))
            })
            .collect();
        let wanted: Vec<(f64, f64, f64)> = named
            .iter()
            .map(|(point, name)| (point.x, point.y, labels::width(name)))
            .collect();
        let places: Vec<(f64, f64)> = self.points.iter().map(|point| (point.x, point.y)).collect();
        let bounds = Area {
            x: LEFT + 2.0,
            y: TOP + 2.0,
            width: RIGHT - LEFT - 4.0,
            height: BOTTOM - TOP - 4.0,
        };
        for ((point, name), area) in named.iter().zip(labels::place(&wanted, &places, bounds)) {
            let (x, y) = (area.x + area.width / 2.0, area.y + area.height / 2.0);
            // Names far from their points are tied to them.
            let near = (
                point.x.clamp(area.x, area.x + area.width),
                point.y.clamp(area.y, area.y + area.height),
            );
            if (near.0 - point.x).hypot(near.1 - point.y) > 14.0 {
                let _ = writeln!(
                    svg,
                    "<path class=\"tie\" d=\"M{:.1} {:.1}L{:.1} {:.1}\"/>",
                    point.x, point.y, near.0, near.1
                );
            }
            let _ = writeln!(
                svg,
                "<text class=\"name {}\" x=\"{x:.1}\" y=\"{:.1}\" text-anchor=\"middle\">{}</text>",
                series_class(&point.mark.series),
                y + 4.5,
                text::escape(name)
            );
        }
    }

    /// Points without a place are not passed over in silence.
    fn left_out(&self, svg: &mut String, all: usize) {
        if self.points.is_empty() || self.points.len() == all {
            return;
        }
        let mut why = Vec::new();
        if self.without_time > 0 {
            why.push(format!("{} not timed", self.without_time));
        }
        if self.without_error > 0 {
            why.push(format!("{} without this error", self.without_error));
        }
        let _ = writeln!(
            svg,
            "<text class=\"axis\" x=\"{RIGHT}\" y=\"26\" text-anchor=\"end\">{} of {all} drawn: {}</text>",
            self.points.len(),
            why.join(", ")
        );
    }
}

/// How a series is drawn.
fn series_class(series: &str) -> &'static str {
    match series {
        "strict" => "strict",
        "fast" => "fast",
        _ => "other",
    }
}

#[cfg(test)]
mod tests;
