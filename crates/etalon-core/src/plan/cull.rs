//! Phase 1: what no output asks for does not run.

use crate::graph::{Graph, Origin};
use crate::plan::PlanError;

/// Why a pass runs: the first need that reached it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Need {
    /// It writes the output of this index.
    Output(u32),
    /// The pass of this index reads what it writes.
    Pass(u32),
    /// It writes the history of this index, which the next frame will read.
    History(u32),
}

/// What runs.
#[derive(Debug)]
pub(crate) struct Live {
    /// Per pass: why it runs, if it does.
    pub(crate) needs: Vec<Option<Need>>,
    /// Indices of the histories whose last contents are read.
    pub(crate) histories: Vec<u32>,
}

/// Walks from the outputs to everything they need.
pub(crate) fn cull(graph: &Graph) -> Result<Live, PlanError> {
    let mut live = Live {
        needs: vec![None; graph.passes.len()],
        histories: Vec::new(),
    };
    let mut history_live = vec![false; graph.histories.len()];
    let mut pending = Vec::new();
    for (index, output) in graph.outputs.iter().enumerate() {
        let writers = &graph.resources[output.resource as usize].versions[output.version as usize];
        for writer in writers.iter().flatten() {
            reach(&mut live, &mut pending, *writer, Need::Output(index as u32));
        }
        if let Origin::HistoryPrevious(history) = graph.resources[output.resource as usize].origin {
            reach_history(graph, &mut live, &mut pending, &mut history_live, history)?;
        }
    }
    while let Some(pass) = pending.pop() {
        for access in graph.passes[pass as usize]
            .accesses
            .iter()
            .filter(|access| access.kind.reads())
        {
            let resource = &graph.resources[access.resource as usize];
            let (_, layers) = resource.desc.subresources();
            let writers = &resource.versions[access.version as usize];
            for index in access.range.indices(layers) {
                if let Some(writer) = writers.get(index).copied().flatten() {
                    reach(&mut live, &mut pending, writer, Need::Pass(pass));
                }
            }
            if let Origin::HistoryPrevious(history) = resource.origin {
                reach_history(graph, &mut live, &mut pending, &mut history_live, history)?;
            }
        }
    }
    live.histories = (0..graph.histories.len() as u32)
        .filter(|&index| history_live[index as usize])
        .collect();
    Ok(live)
}

fn reach(live: &mut Live, pending: &mut Vec<u32>, pass: u32, need: Need) {
    let slot = &mut live.needs[pass as usize];
    if slot.is_none() {
        *slot = Some(need);
        pending.push(pass);
    }
}

/// A history that is read must be written, or the next frame has nothing to read.
fn reach_history(
    graph: &Graph,
    live: &mut Live,
    pending: &mut Vec<u32>,
    reached: &mut [bool],
    history: u32,
) -> Result<(), PlanError> {
    if std::mem::replace(&mut reached[history as usize], true) {
        return Ok(());
    }
    let pair = &graph.histories[history as usize];
    let newest = graph.resources[pair.current as usize].versions.last();
    let writers = newest.map(|writers| writers.as_ref()).unwrap_or_default();
    if writers.iter().any(Option::is_none) {
        return Err(PlanError::HistoryNotWritten {
            history: pair.name.clone(),
        });
    }
    for writer in writers.iter().flatten() {
        reach(live, pending, *writer, Need::History(history));
    }
    Ok(())
}
