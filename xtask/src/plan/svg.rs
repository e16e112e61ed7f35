//! The plan drawn: its graph, and its memory over the steps.

use std::collections::BTreeMap;
use std::fmt::Write;

use etalon_accuracy::report::{bytes, escape};
use etalon_core::graph::ResourceDesc;
use etalon_core::plan::{Plan, PlannedResource};

use super::dot::outside;
use super::flow::{Edge, edges};
use super::layout::{Size, layout};
use super::model::Report;
use super::text::{why, work};

/// Pixels that a character takes at the sizes used, on average, for widths of boxes.
const CHARACTER: f64 = 7.4;
const SMALL: f64 = 6.2;

/// First byte of a transient and the one after its last, with the heap of buffers
/// behind that of textures.
pub(super) fn bytes_of(plan: &Plan, resource: &PlannedResource) -> Option<(u64, u64)> {
    let place = resource.placement()?;
    let base = match resource.desc {
        ResourceDesc::Texture(_) => 0,
        ResourceDesc::Buffer(_) => plan.texture_heap,
    };
    let first = base.saturating_add(place.offset);
    Some((first, first.saturating_add(place.bytes)))
}

/// The effects of the plan, in the order in which they first run: their number is
/// their colour.
pub(super) fn colours(plan: &Plan) -> BTreeMap<String, usize> {
    let mut colours = BTreeMap::new();
    for step in &plan.steps {
        let next = colours.len();
        colours.entry(step.effect.clone()).or_insert(next);
    }
    colours
}

/// The class that gives something the colour of an effect.
pub(super) fn class(colours: &BTreeMap<String, usize>, effect: &str) -> String {
    format!("effect-{}", colours.get(effect).copied().unwrap_or(0) % 8)
}

/// Something drawn as a box of the graph.
struct Node {
    name: String,
    below: String,
    class: String,
    title: String,
}

/// The passes and what they hand to each other.
pub(super) fn graph(plan: &Plan) -> String {
    let edges = edges(plan);
    let colours = colours(plan);
    let mut nodes = Vec::new();
    // What enters first, then the steps, then what leaves: edges lead to later numbers.
    let mut entering: BTreeMap<u32, usize> = BTreeMap::new();
    for edge in edges.iter().filter(|edge| edge.from.is_none()) {
        entering.entry(edge.resource).or_insert_with(|| {
            nodes.push(outer(plan, edge.resource, "comes in"));
            nodes.len() - 1
        });
    }
    let first = nodes.len();
    for step in &plan.steps {
        nodes.push(Node {
            name: step.name.clone(),
            below: work(step),
            class: format!("step {}", class(&colours, &step.effect)),
            title: format!("{}: {}", step.name, why(step)),
        });
    }
    let mut leaving: BTreeMap<u32, usize> = BTreeMap::new();
    for edge in edges.iter().filter(|edge| edge.to.is_none()) {
        leaving.insert(edge.resource, nodes.len());
        nodes.push(outer(plan, edge.resource, "goes out"));
    }
    let number = |edge: &Edge| {
        let from = match edge.from {
            Some(step) => first + step,
            None => entering.get(&edge.resource).copied().unwrap_or(0),
        };
        let to = match edge.to {
            Some(step) => first + step,
            None => leaving.get(&edge.resource).copied().unwrap_or(0),
        };
        (from, to)
    };
    // Several resources between two steps are one line.
    let mut lines: BTreeMap<(usize, usize), Vec<String>> = BTreeMap::new();
    for edge in &edges {
        let resource = plan.resources.get(edge.resource as usize);
        let name = resource.map_or("?", |resource| &resource.name).to_owned();
        lines.entry(number(edge)).or_default().push(name);
    }
    draw_graph(&nodes, &lines)
}

fn outer(plan: &Plan, resource: u32, how: &str) -> Node {
    let name = outside(plan, resource);
    Node {
        title: format!("{name} {how}"),
        name,
        below: String::new(),
        class: "outer".to_owned(),
    }
}

fn draw_graph(nodes: &[Node], lines: &BTreeMap<(usize, usize), Vec<String>>) -> String {
    let sizes: Vec<Size> = nodes
        .iter()
        .map(|node| {
            let name = node.name.chars().count() as f64 * CHARACTER;
            let below = node.below.chars().count() as f64 * SMALL;
            Size {
                width: name.max(below) + 20.0,
                height: if node.below.is_empty() { 26.0 } else { 42.0 },
            }
        })
        .collect();
    let ends: Vec<(usize, usize)> = lines.keys().copied().collect();
    let layout = layout(&sizes, &ends);
    let margin = 12.0;
    let (width, height) = (layout.width + 2.0 * margin, layout.height + 2.0 * margin);
    let mut svg = format!(
        "<svg class=\"graph\" viewBox=\"{:.0} {:.0} {width:.0} {height:.0}\" width=\"{width:.0}\" \
         height=\"{height:.0}\" role=\"img\" aria-label=\"Passes and what they hand to each other\">\n\
         <defs><marker id=\"tip\" viewBox=\"0 0 8 8\" refX=\"7\" refY=\"4\" markerWidth=\"8\" \
         markerHeight=\"8\" orient=\"auto\"><path d=\"M0 0L8 4L0 8z\"/></marker></defs>\n",
        -margin, -margin
    );
    for (path, names) in layout.paths.iter().zip(lines.values()) {
        let mut line = String::new();
        for (at, [x, y]) in path.iter().enumerate() {
            if at == 0 {
                let _ = write!(line, "M{x:.1} {y:.1}");
            } else {
                // Leaves and arrives upright.
                let [before_x, before_y] = path[at - 1];
                let middle = 0.5 * (before_y + y);
                let _ = write!(
                    line,
                    "C{before_x:.1} {middle:.1} {x:.1} {middle:.1} {x:.1} {y:.1}"
                );
            }
        }
        let names = escape(&names.join(", "));
        let _ = writeln!(
            svg,
            "<path class=\"line\" d=\"{line}\" marker-end=\"url(#tip)\"><title>{names}</title></path>"
        );
    }
    for ((node, size), [x, y]) in nodes.iter().zip(&sizes).zip(&layout.centres) {
        let (left, top) = (x - 0.5 * size.width, y - 0.5 * size.height);
        let radius = if node.below.is_empty() { 13 } else { 6 };
        let _ = writeln!(
            svg,
            "<g class=\"{}\"><title>{}</title><rect x=\"{left:.1}\" y=\"{top:.1}\" width=\"{:.1}\" \
             height=\"{:.1}\" rx=\"{radius}\"/>",
            node.class,
            escape(&node.title),
            size.width,
            size.height
        );
        let name_y = if node.below.is_empty() {
            y + 4.5
        } else {
            y - 3.0
        };
        let _ = writeln!(
            svg,
            "<text x=\"{x:.1}\" y=\"{name_y:.1}\">{}</text>",
            escape(&node.name)
        );
        if !node.below.is_empty() {
            let _ = writeln!(
                svg,
                "<text class=\"below\" x=\"{x:.1}\" y=\"{:.1}\">{}</text>",
                y + 12.5,
                escape(&node.below)
            );
        }
        svg.push_str("</g>\n");
    }
    svg.push_str("</svg>\n");
    svg
}

/// Which bytes are held by what while each step runs: steps from left to right, bytes
/// from bottom to top.
pub(super) fn memory(report: &Report) -> String {
    let plan = &report.plan;
    let colours = colours(plan);
    let steps = plan.steps.len().max(1);
    let all = report.memory.planned.max(1) as f64;
    let (left, top, chart) = (74.0, 10.0, 320.0);
    let column = (1000.0 / steps as f64).clamp(14.0, 48.0);
    let wide = column * steps as f64;
    let longest = plan.steps.iter().map(|step| step.name.chars().count());
    let below = longest.max().unwrap_or(0) as f64 * SMALL * 0.72 + 20.0;
    let (width, height) = (left + wide + 0.4 * below + 20.0, top + chart + below);
    let y = |byte: u64| top + chart - chart * byte as f64 / all;
    let mut svg = format!(
        "<svg class=\"memory\" viewBox=\"0 0 {width:.0} {height:.0}\" width=\"{width:.0}\" \
         height=\"{height:.0}\" role=\"img\" aria-label=\"Bytes held at each step\">\n"
    );
    for quarter in 0..=4_u64 {
        let byte = report.memory.planned / 4 * quarter;
        let at = y(byte);
        let _ = writeln!(
            svg,
            "<line class=\"rule\" x1=\"{left}\" x2=\"{:.1}\" y1=\"{at:.1}\" y2=\"{at:.1}\"/>\
             <text class=\"scale\" x=\"{:.1}\" y=\"{:.1}\">{}</text>",
            left + wide,
            left - 6.0,
            at + 4.0,
            escape(&bytes(byte))
        );
    }
    for resource in &plan.resources {
        let Some((first, end)) = bytes_of(plan, resource) else {
            continue;
        };
        let writer = plan.steps.get(resource.first as usize);
        let effect = writer.map_or("", |step| step.effect.as_str());
        let x = left + column * f64::from(resource.first);
        let wide = column * f64::from(resource.last - resource.first + 1);
        // However few bytes it has, it is seen.
        let (top, tall) = (y(end), (y(first) - y(end)).max(1.5));
        let title = format!(
            "{}: {} from byte {first} on, steps {} to {}",
            resource.name,
            bytes(end - first),
            resource.first,
            resource.last
        );
        let _ = write!(
            svg,
            "<g class=\"{}\"><title>{}</title><rect x=\"{x:.1}\" y=\"{top:.1}\" width=\"{wide:.1}\" \
             height=\"{tall:.1}\"/>",
            class(&colours, effect),
            escape(&title)
        );
        let fits = resource.name.chars().count() as f64 * SMALL + 6.0 <= wide && tall >= 13.0;
        if fits {
            let _ = write!(
                svg,
                "<text x=\"{:.1}\" y=\"{:.1}\">{}</text>",
                x + 0.5 * wide,
                top + 0.5 * tall + 4.0,
                escape(&resource.name)
            );
        }
        svg.push_str("</g>\n");
    }
    for (index, at) in report.timeline.iter().enumerate() {
        let x = left + column * index as f64;
        let alive = y(at.alive);
        let _ = writeln!(
            svg,
            "<line class=\"alive\" x1=\"{x:.1}\" x2=\"{:.1}\" y1=\"{alive:.1}\" y2=\"{alive:.1}\">\
             <title>{} alive at {}</title></line>",
            x + column,
            escape(&bytes(at.alive)),
            escape(&at.step)
        );
        let (x, y) = (x + 0.5 * column, top + chart + 14.0);
        let _ = writeln!(
            svg,
            "<text class=\"name\" transform=\"translate({x:.1} {y:.1}) rotate(60)\">{}</text>",
            escape(&at.step)
        );
    }
    svg.push_str("</svg>\n");
    svg
}
