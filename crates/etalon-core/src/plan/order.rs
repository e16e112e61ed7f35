//! Phase 2: an order that respects every version.
//!
//! Passes are visited depth first from the outputs in the order of the
//! outputs' names, so the order follows from the shape of the graph alone:
//! adding an unrelated effect earlier or later changes nothing. Depth first
//! also keeps producers next to their consumers, which keeps lifetimes short.

use crate::graph::Graph;
use crate::plan::PlanError;
use crate::plan::cull::Live;

/// One use of a resource by a live pass.
#[derive(Clone, Copy)]
struct Event {
    resource: u32,
    version: u32,
    writes: bool,
    pass: u32,
    access: u32,
}

/// The indices of the live passes in the order they run.
pub(crate) fn order(graph: &Graph, live: &Live) -> Result<Vec<u32>, PlanError> {
    let dependencies = dependencies(graph, live)?;
    let mut state = vec![Visit::Unseen; graph.passes.len()];
    let mut order = Vec::new();
    // Explicit stack: a chain of passes may be longer than the thread's stack.
    let mut stack: Vec<(u32, usize)> = Vec::new();
    for root in roots(graph, live) {
        if state[root as usize] == Visit::Unseen {
            state[root as usize] = Visit::Open;
            stack.push((root, 0));
        }
        while let Some((pass, next)) = stack.last_mut() {
            let pass = *pass;
            match dependencies[pass as usize].get(*next).copied() {
                Some(dependency) => {
                    *next += 1;
                    match state[dependency as usize] {
                        Visit::Unseen => {
                            state[dependency as usize] = Visit::Open;
                            stack.push((dependency, 0));
                        }
                        Visit::Open => return Err(cycle(graph, &stack, dependency)),
                        Visit::Done => {}
                    }
                }
                None => {
                    state[pass as usize] = Visit::Done;
                    order.push(pass);
                    stack.pop();
                }
            }
        }
    }
    Ok(order)
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum Visit {
    Unseen,
    Open,
    Done,
}

/// Writers of outputs by the outputs' names, then of histories by theirs.
fn roots(graph: &Graph, live: &Live) -> Vec<u32> {
    let mut outputs: Vec<_> = graph.outputs.iter().collect();
    outputs.sort_by(|a, b| a.name.cmp(&b.name));
    let mut histories: Vec<_> = live
        .histories
        .iter()
        .map(|&index| &graph.histories[index as usize])
        .collect();
    histories.sort_by(|a, b| a.name.cmp(&b.name));
    let mut roots = Vec::new();
    for output in outputs {
        roots.extend(
            graph.resources[output.resource as usize].versions[output.version as usize]
                .iter()
                .flatten(),
        );
    }
    for history in histories {
        if let Some(writers) = graph.resources[history.current as usize].versions.last() {
            roots.extend(writers.iter().flatten());
        }
    }
    roots
}

/// For each pass, the passes it must follow: those that wrote what it reads
/// (in the order of its accesses), then those that read or wrote what it
/// writes over (by name).
fn dependencies(graph: &Graph, live: &Live) -> Result<Vec<Vec<u32>>, PlanError> {
    let mut after: Vec<Vec<u32>> = vec![Vec::new(); graph.passes.len()];
    let mut events = Vec::new();
    for (index, pass) in graph
        .passes
        .iter()
        .enumerate()
        .filter(|(index, _)| live.needs[*index].is_some())
    {
        for (position, access) in pass.accesses.iter().enumerate() {
            let event = Event {
                resource: access.resource,
                version: access.version,
                writes: access.kind.writes(),
                pass: index as u32,
                access: position as u32,
            };
            events.push(event);
            if access.kind.reads() {
                let resource = &graph.resources[access.resource as usize];
                let (_, layers) = resource.desc.subresources();
                let writers = &resource.versions[access.version as usize];
                let found = access
                    .range
                    .indices(layers)
                    .filter_map(|index| writers.get(index).copied().flatten());
                after[index].extend(found);
            }
        }
    }
    events.sort_by_key(|event| (event.resource, event.version, event.writes, event.pass));
    let mut overwrites: Vec<Vec<u32>> = vec![Vec::new(); graph.passes.len()];
    for group in events.chunk_by(|a, b| a.resource == b.resource) {
        overwritten(graph, group, &mut overwrites);
    }
    for (pass, mut earlier) in overwrites.into_iter().enumerate() {
        earlier.sort_by(|a, b| {
            graph.passes[*a as usize]
                .name
                .cmp(&graph.passes[*b as usize].name)
        });
        after[pass].append(&mut earlier);
        let mut seen = std::collections::HashSet::new();
        after[pass].retain(|&earlier| earlier as usize != pass && seen.insert(earlier));
    }
    check_outputs(graph, &events)?;
    Ok(after)
}

/// Walks the uses of one resource by version: a write follows every earlier
/// use of the mips and layers it writes.
fn overwritten(graph: &Graph, events: &[Event], after: &mut [Vec<u32>]) {
    let Some(first) = events.first() else { return };
    let resource = &graph.resources[first.resource as usize];
    let (_, layers) = resource.desc.subresources();
    let mut users: Vec<Vec<u32>> = vec![Vec::new(); resource.versions[0].len()];
    for event in events {
        let access = &graph.passes[event.pass as usize].accesses[event.access as usize];
        for index in access.range.indices(layers) {
            let Some(users) = users.get_mut(index) else {
                continue;
            };
            if event.writes {
                after[event.pass as usize].append(users);
            }
            users.push(event.pass);
        }
    }
}

/// An output must still be there at the end.
fn check_outputs(graph: &Graph, events: &[Event]) -> Result<(), PlanError> {
    for output in &graph.outputs {
        let of_resource = events.partition_point(|event| event.resource < output.resource);
        let later = events[of_resource..]
            .iter()
            .take_while(|event| event.resource == output.resource)
            .find(|event| event.writes && event.version >= output.version);
        if let Some(event) = later {
            return Err(PlanError::OutputOverwritten {
                output: output.name.clone(),
                resource: graph.resources[output.resource as usize].name.clone(),
                by: graph.passes[event.pass as usize].name.clone(),
            });
        }
    }
    Ok(())
}

fn cycle(graph: &Graph, stack: &[(u32, usize)], back_to: u32) -> PlanError {
    let start = stack
        .iter()
        .position(|(pass, _)| *pass == back_to)
        .unwrap_or(0);
    let passes = stack[start..]
        .iter()
        .map(|(pass, _)| graph.passes[*pass as usize].name.clone())
        .collect();
    PlanError::Cycle { passes }
}
