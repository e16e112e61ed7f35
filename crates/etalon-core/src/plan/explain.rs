//! Why passes run or do not, in words; and the plan as text.

use std::collections::BTreeMap;
use std::fmt;

use crate::graph::{Decision, Graph, ResourceDesc};
use crate::plan::cull::{Goal, Live, Need};
use crate::plan::{CulledPass, Plan, PlannedEffect, PlannedStep, ResourceKind, Step};

/// Why a live pass runs.
pub(crate) fn reason(graph: &Graph, need: Option<Need>) -> String {
    match need {
        Some(Need::Output(output)) => {
            format!("writes output `{}`", graph.outputs[output as usize].name)
        }
        Some(Need::Pass(reader)) => format!(
            "`{}` reads what it writes",
            graph.passes[reader as usize].name
        ),
        Some(Need::History(history)) => {
            format!(
                "writes history `{}` for the next frame",
                graph.histories[history as usize].name
            )
        }
        None => String::new(),
    }
}

/// The name of the output, or the history, for whose sake a live pass runs.
pub(crate) fn goal(graph: &Graph, goal: Option<Goal>) -> String {
    match goal {
        Some(Goal::Output(output)) => graph.outputs[output as usize].name.clone(),
        Some(Goal::History(history)) => graph.histories[history as usize].name.clone(),
        None => String::new(),
    }
}

/// The effect that a pass belongs to: what its name has before the first slash.
/// Clears and copies, which have none, belong to nobody.
pub(crate) fn effect_of(pass: &str) -> &str {
    pass.split_once('/').map_or("", |(effect, _)| effect)
}

/// Every effect that was decided of or has passes, by name.
pub(crate) fn effects(graph: &Graph, live: &Live) -> Vec<PlannedEffect> {
    let mut known: BTreeMap<&str, PlannedEffect> = BTreeMap::new();
    fn entry<'k, 'n>(
        known: &'k mut BTreeMap<&'n str, PlannedEffect>,
        name: &'n str,
    ) -> &'k mut PlannedEffect {
        known.entry(name).or_insert_with(|| PlannedEffect {
            name: name.to_owned(),
            decision: Decision::runs("its passes were declared, and nothing was decided of it"),
            passes: 0,
            culled: 0,
        })
    }
    for (name, decision) in &graph.decisions {
        entry(&mut known, name).decision = decision.clone();
    }
    for (pass, need) in graph.passes.iter().zip(&live.needs) {
        let effect = effect_of(&pass.name);
        let names = [effect, pass.name.as_str()];
        for name in names {
            // A pass by itself is something decided of, or part of an effect.
            if name.is_empty() || (name != effect && !known.contains_key(name)) {
                continue;
            }
            let effect = entry(&mut known, name);
            match need {
                Some(_) => effect.passes += 1,
                None => effect.culled += 1,
            }
        }
    }
    known.into_values().collect()
}

/// Why each of the other passes does not run.
pub(crate) fn culled(graph: &Graph, live: &Live) -> Vec<CulledPass> {
    let mut readers: Vec<Option<u32>> = vec![None; graph.passes.len()];
    for (index, pass) in graph.passes.iter().enumerate() {
        for access in pass.accesses.iter().filter(|access| access.kind.reads()) {
            let resource = &graph.resources[access.resource as usize];
            let (_, layers) = resource.desc.subresources();
            let writers = &resource.versions[access.version as usize];
            for subresource in access.range.indices(layers) {
                if let Some(writer) = writers.get(subresource).copied().flatten() {
                    readers[writer as usize].get_or_insert(index as u32);
                }
            }
        }
    }
    let passes = graph
        .passes
        .iter()
        .enumerate()
        .filter(|(index, _)| live.needs[*index].is_none());
    let mut culled: Vec<CulledPass> = passes
        .map(|(index, pass)| {
            let written = pass.accesses.iter().find(|access| access.kind.writes());
            let what = written.map_or("nothing", |access| {
                graph.resources[access.resource as usize].name.as_str()
            });
            let reason = match readers[index] {
                Some(reader) => {
                    format!(
                        "writes `{what}` for `{}`, which does not run either",
                        graph.passes[reader as usize].name
                    )
                }
                None => format!("writes `{what}`, which nothing reads and no output asks for"),
            };
            CulledPass {
                name: pass.name.clone(),
                reason,
            }
        })
        .collect();
    culled.sort_by(|a, b| a.name.cmp(&b.name));
    culled
}

impl PlannedStep {
    /// For whose sake it runs, where its reason does not say so.
    fn for_goal(&self) -> String {
        if self.goal.is_empty() || self.reason.contains(&format!("`{}`", self.goal)) {
            String::new()
        } else {
            format!(", for `{}`", self.goal)
        }
    }
}

impl fmt::Display for Plan {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let memory = self.transient_memory();
        writeln!(
            f,
            "{} dispatches, {} draws, {} barriers, {} resources; transient memory {} bytes, of which {} \
             are alive at once ({} without aliasing)",
            self.dispatch_count(),
            self.draw_count(),
            self.barrier_count(),
            self.resources.len(),
            memory.planned,
            memory.least,
            memory.unaliased
        )?;
        for effect in &self.effects {
            let (passes, culled) = (effect.passes, effect.culled);
            write!(f, "      {} {}", effect.name, effect.decision)?;
            match (passes, culled) {
                (0, 0) => writeln!(f)?,
                (passes, 0) => writeln!(f, " ({passes} passes)")?,
                (passes, culled) => writeln!(f, " ({passes} passes, {culled} culled)")?,
            }
        }
        let name = |resource: u32| {
            self.resources
                .get(resource as usize)
                .map_or("?", |resource| resource.name.as_str())
        };
        for (index, step) in self.steps.iter().enumerate() {
            for barrier in &step.barriers {
                writeln!(
                    f,
                    "      barrier {}: {:?} -> {:?}",
                    name(barrier.resource),
                    barrier.from,
                    barrier.to
                )?;
            }
            match &step.step {
                Step::Dispatch { kernel, groups, .. } => {
                    writeln!(
                        f,
                        "{index:4}  {} ({}, {groups:?}): {}{}",
                        step.name,
                        kernel.0.name,
                        step.reason,
                        step.for_goal()
                    )?;
                }
                Step::Raster(raster) => {
                    let (draws, colours) = (raster.draws.len(), raster.colours.len());
                    let depth = if raster.depth.is_some() {
                        " and depth"
                    } else {
                        ""
                    };
                    writeln!(
                        f,
                        "{index:4}  {} ({draws} draws into {colours} colours{depth}): {}{}",
                        step.name,
                        step.reason,
                        step.for_goal()
                    )?;
                }
                _ => writeln!(
                    f,
                    "{index:4}  {}: {}{}",
                    step.name,
                    step.reason,
                    step.for_goal()
                )?,
            }
        }
        for resource in &self.resources {
            let shape = match resource.desc {
                ResourceDesc::Texture(desc) => format!(
                    "{} {}×{}×{}, {} mips",
                    desc.format,
                    desc.extent.width,
                    desc.extent.height,
                    desc.extent.depth_or_layers,
                    desc.mips
                ),
                ResourceDesc::Buffer(desc) => format!("{} bytes", desc.bytes),
            };
            let place = match &resource.kind {
                ResourceKind::Import(name) => format!("import `{name}`"),
                ResourceKind::Output(names) => format!("output {}", names.join(", ")),
                ResourceKind::HistoryPrevious(_) => "history, as the last frame left it".to_owned(),
                ResourceKind::HistoryCurrent(_) => "history, for the next frame".to_owned(),
                ResourceKind::Transient(place) => {
                    format!("bytes {}..{}", place.offset, place.offset + place.bytes)
                }
            };
            writeln!(
                f,
                "      {} ({shape}): steps {}–{}, {place}",
                resource.name, resource.first, resource.last
            )?;
        }
        for pass in &self.culled {
            writeln!(f, "   -  {}: {}", pass.name, pass.reason)?;
        }
        Ok(())
    }
}
