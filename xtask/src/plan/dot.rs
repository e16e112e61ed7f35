//! The plan as a Graphviz graph.

use std::collections::BTreeSet;
use std::fmt::Write;

use etalon_core::plan::{Plan, ResourceKind};

use super::flow::edges;

/// Text within the quotes of the DOT language, where `\` and `"` have a meaning.
fn quoted(text: &str) -> String {
    let mut quoted = String::with_capacity(text.len() + 2);
    quoted.push('"');
    for character in text.chars() {
        match character {
            '"' | '\\' => {
                quoted.push('\\');
                quoted.push(character);
            }
            '\n' | '\r' => quoted.push(' '),
            other => quoted.push(other),
        }
    }
    quoted.push('"');
    quoted
}

/// What a resource is called where it enters or leaves the plan.
pub(super) fn outside(plan: &Plan, resource: u32) -> String {
    let Some(planned) = plan.resources.get(resource as usize) else {
        return "?".to_owned();
    };
    match &planned.kind {
        ResourceKind::Import(name) => name.clone(),
        ResourceKind::Output(names) => names.join(", "),
        _ => planned.name.clone(),
    }
}

/// The graph: steps as boxes, what enters and leaves as ellipses.
pub(super) fn render(plan: &Plan) -> String {
    let mut text = String::from(
        "digraph plan {\n  node [shape=box, fontname=\"sans-serif\"];\n  \
         edge [fontname=\"sans-serif\", fontsize=10];\n",
    );
    for (index, step) in plan.steps.iter().enumerate() {
        let name = quoted(&step.name);
        let why = quoted(&step.reason);
        let _ = writeln!(text, "  step{index} [label={name}, tooltip={why}];");
    }
    let edges = edges(plan);
    let mut outer = BTreeSet::new();
    for edge in &edges {
        let end = |step: Option<usize>, word: &str| match step {
            Some(step) => format!("step{step}"),
            None => format!("{word}{}", edge.resource),
        };
        for (step, word) in [(edge.from, "in"), (edge.to, "out")] {
            if step.is_none() && outer.insert((word, edge.resource)) {
                let name = quoted(&outside(plan, edge.resource));
                let _ = writeln!(
                    text,
                    "  {word}{} [label={name}, shape=ellipse, style=dashed];",
                    edge.resource
                );
            }
        }
        let name = plan.resources.get(edge.resource as usize);
        let label = quoted(name.map_or("?", |resource| &resource.name));
        let _ = writeln!(
            text,
            "  {} -> {} [label={label}];",
            end(edge.from, "in"),
            end(edge.to, "out")
        );
    }
    text.push_str("}\n");
    text
}
