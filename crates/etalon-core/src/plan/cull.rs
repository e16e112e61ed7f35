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

/// For whose sake a pass runs in the end.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Goal {
    /// The output of this index.
    Output(u32),
    /// The history of this index.
    History(u32),
}

/// What runs.
#[derive(Debug)]
pub(crate) struct Live {
    /// Per pass: why it runs, if it does.
    pub(crate) needs: Vec<Option<Need>>,
    /// Per pass: for whose sake, if it runs.
    pub(crate) goals: Vec<Option<Goal>>,
    /// Indices of the histories whose last contents are read.
    pub(crate) histories: Vec<u32>,
}

/// Walks from the outputs, by name, to everything they need: of several needs the
/// first is told, and which that is does not depend on the order of declarations.
pub(crate) fn cull(graph: &Graph) -> Result<Live, PlanError> {
    let mut live = Live {
        needs: vec![None; graph.passes.len()],
        goals: vec![None; graph.passes.len()],
        histories: Vec::new(),
    };
    let mut history_live = vec![false; graph.histories.len()];
    let mut pending = Vec::new();
    for index in by_name(graph) {
        let output = &graph.outputs[index as usize];
        let goal = Goal::Output(index);
        let writers = &graph.resources[output.resource as usize].versions[output.version as usize];
        for writer in writers.iter().flatten() {
            let need = (Need::Output(index), goal);
            reach(&mut live, &mut pending, *writer, need);
        }
        if let Origin::HistoryPrevious(history) = graph.resources[output.resource as usize].origin {
            reach_history(graph, &mut live, &mut pending, &mut history_live, history)?;
        }
    }
    while let Some((pass, goal)) = pending.pop() {
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
                    let need = (Need::Pass(pass), goal);
                    reach(&mut live, &mut pending, writer, need);
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

/// The outputs' indices, by the outputs' names.
pub(crate) fn by_name(graph: &Graph) -> Vec<u32> {
    let mut outputs: Vec<u32> = (0..graph.outputs.len() as u32).collect();
    outputs.sort_by_key(|&index| &graph.outputs[index as usize].name);
    outputs
}

/// Passes that run, whose needs are still to be followed.
type Pending = Vec<(u32, Goal)>;

fn reach(live: &mut Live, pending: &mut Pending, pass: u32, (need, goal): (Need, Goal)) {
    let slot = &mut live.needs[pass as usize];
    if slot.is_none() {
        *slot = Some(need);
        live.goals[pass as usize] = Some(goal);
        pending.push((pass, goal));
    }
}

/// A history that is read must be written, or the next frame has nothing to read.
fn reach_history(
    graph: &Graph,
    live: &mut Live,
    pending: &mut Pending,
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
        let need = (Need::History(history), Goal::History(history));
        reach(live, pending, *writer, need);
    }
    Ok(())
}
