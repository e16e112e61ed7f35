//! Why passes run or do not, in words; and the plan as text.

use std::fmt;

use crate::graph::{Graph, ResourceDesc};
use crate::plan::cull::{Live, Need};
use crate::plan::{CulledPass, Plan, ResourceKind, Step};

/// Why a live pass runs.
pub(crate) fn reason(graph: &Graph, need: Need) -> String {
    match need {
        Need::Output(output) => format!("writes output `{}`", graph.outputs[output as usize].name),
        Need::Pass(reader) => format!(
            "`{}` reads what it writes",
            graph.passes[reader as usize].name
        ),
        Need::History(history) => {
            format!(
                "writes history `{}` for the next frame",
                graph.histories[history as usize].name
            )
        }
    }
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
    let culled = passes.map(|(index, pass)| {
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
    });
    culled.collect()
}

impl fmt::Display for Plan {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(
            f,
            "{} dispatches, {} barriers, {} resources; transient memory {} bytes ({} without aliasing)",
            self.dispatch_count(),
            self.barrier_count(),
            self.resources.len(),
            self.texture_heap + self.buffer_heap,
            self.unaliased_bytes
        )?;
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
                        "{index:4}  {} ({}, {groups:?}): {}",
                        step.name, kernel.0.name, step.reason
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
                        "{index:4}  {} ({draws} draws into {colours} colours{depth}): {}",
                        step.name, step.reason
                    )?;
                }
                _ => writeln!(f, "{index:4}  {}: {}", step.name, step.reason)?,
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
