//! Phase 4: the steps in order, and when each resource is first and last used.

use crate::graph::{AccessKind, ClearValue, Graph, Origin, Pass, ResourceDesc, Subresources};
use crate::plan::bind::{BoundPasses, Use};
use crate::plan::cull::{Live, by_name};
use crate::plan::{
    Bound, Capture, CulledPass, Groups, Placement, PlannedEffect, PlannedHistory, PlannedResource,
    ResourceKind, Step, Usage, UsageSet, explain,
};

/// A step before its barriers are known.
#[derive(Debug)]
pub(crate) struct OrderedStep {
    pub(crate) name: String,
    pub(crate) effect: String,
    pub(crate) reason: String,
    pub(crate) goal: String,
    pub(crate) step: Step,
    pub(crate) uses: Vec<Use>,
}

/// Steps and the resources they use, which are renumbered by first use.
#[derive(Debug)]
pub(crate) struct Ordered {
    pub(crate) steps: Vec<OrderedStep>,
    pub(crate) resources: Vec<PlannedResource>,
    pub(crate) histories: Vec<PlannedHistory>,
    pub(crate) culled: Vec<CulledPass>,
    pub(crate) effects: Vec<PlannedEffect>,
    pub(crate) uniforms: Vec<u8>,
}

/// Lays out the steps.
pub(crate) fn steps(
    graph: &Graph,
    live: &Live,
    bound: BoundPasses,
    order: &[u32],
    capture: Capture,
) -> Ordered {
    let BoundPasses { passes, uniforms } = bound;
    let mut steps = Vec::with_capacity(order.len());
    for (&index, bound) in order.iter().zip(passes) {
        let pass = &graph.passes[index as usize];
        if capture == Capture::EveryPass {
            let goal = explain::goal(graph, live.goals[index as usize]);
            clears(graph, pass, &goal, &mut steps);
        }
        steps.push(OrderedStep {
            name: pass.name.clone(),
            effect: explain::effect_of(&pass.name).to_owned(),
            reason: explain::reason(graph, live.needs[index as usize]),
            goal: explain::goal(graph, live.goals[index as usize]),
            step: bound.step,
            uses: bound.uses,
        });
        if capture == Capture::EveryPass {
            for access in pass.accesses.iter().filter(|access| access.kind.writes()) {
                steps.push(capture_step(
                    &pass.name,
                    &access.binding,
                    access.resource,
                    access.range,
                ));
            }
        }
    }
    if capture == Capture::Outputs {
        for index in by_name(graph) {
            let output = &graph.outputs[index as usize];
            let (mips, layers) = graph.resources[output.resource as usize]
                .desc
                .subresources();
            let range = Subresources {
                mip: 0,
                mips,
                layer: 0,
                layers,
            };
            steps.push(capture_step("output", &output.name, output.resource, range));
        }
    }
    let mut numbering = Numbering {
        graph,
        planned: vec![None; graph.resources.len()],
        resources: Vec::new(),
    };
    for (index, step) in steps.iter_mut().enumerate() {
        numbering.renumber(index as u32, step);
    }
    let count = steps.len() as u32;
    let histories = numbering.histories(live, count);
    numbering.outputs(count);
    Ordered {
        steps,
        resources: numbering.resources,
        histories,
        culled: explain::culled(graph, live),
        effects: explain::effects(graph, live),
        uniforms,
    }
}

/// Clears what a pass writes in part and nothing wrote before: what is left out would
/// be captured as whatever the memory held.
fn clears(graph: &Graph, pass: &Pass, goal: &str, steps: &mut Vec<OrderedStep>) {
    let parts = pass
        .accesses
        .iter()
        .filter(|access| access.kind == AccessKind::WritePart);
    for access in parts {
        let resource = &graph.resources[access.resource as usize];
        let ResourceDesc::Texture(desc) = resource.desc else {
            continue;
        };
        if resource.has_contents() {
            continue;
        }
        let (_, layers) = resource.desc.subresources();
        let writers = &resource.versions[access.version as usize];
        let empty = access
            .range
            .indices(layers)
            .filter(|&index| writers.get(index).is_some_and(Option::is_none));
        for index in empty {
            let range = Subresources {
                mip: index as u32 / layers,
                mips: 1,
                layer: index as u32 % layers,
                layers: 1,
            };
            steps.push(OrderedStep {
                name: format!("clear {}/{}", pass.name, access.binding),
                effect: explain::effect_of(&pass.name).to_owned(),
                goal: goal.to_owned(),
                reason: "captures show what the pass leaves out".to_owned(),
                step: Step::ClearTexture {
                    resource: access.resource,
                    range,
                    value: ClearValue::zero(desc.format.sample_kind()),
                },
                uses: vec![Use {
                    resource: access.resource,
                    range,
                    usage: Usage::CopyTarget,
                    keeps: false,
                }],
            });
        }
    }
}

fn capture_step(pass: &str, binding: &str, resource: u32, range: Subresources) -> OrderedStep {
    OrderedStep {
        name: format!("capture {pass}/{binding}"),
        effect: String::new(),
        reason: "asked for by the caller".to_owned(),
        goal: String::new(),
        step: Step::Capture {
            resource,
            range,
            pass: pass.to_owned(),
            binding: binding.to_owned(),
        },
        uses: vec![Use {
            resource,
            range,
            usage: Usage::CopySource,
            keeps: true,
        }],
    }
}

/// The plan's numbers for the graph's resources.
struct Numbering<'a> {
    graph: &'a Graph,
    planned: Vec<Option<u32>>,
    resources: Vec<PlannedResource>,
}

impl Numbering<'_> {
    /// The planned number of a resource, which step `at` uses.
    fn number(&mut self, resource: u32, at: u32) -> u32 {
        if let Some(number) = self.planned[resource as usize] {
            let planned = &mut self.resources[number as usize];
            planned.last = planned.last.max(at);
            return number;
        }
        let number = self.resources.len() as u32;
        self.planned[resource as usize] = Some(number);
        let declared = &self.graph.resources[resource as usize];
        let kind = match declared.origin {
            Origin::Import => ResourceKind::Import(declared.name.clone()),
            // Histories are numbered and transients placed once all uses are known.
            Origin::HistoryPrevious(history) => ResourceKind::HistoryPrevious(history),
            Origin::HistoryCurrent(history) => ResourceKind::HistoryCurrent(history),
            Origin::Transient => ResourceKind::Transient(Placement {
                offset: 0,
                bytes: 0,
                slot: 0,
            }),
        };
        self.resources.push(PlannedResource {
            name: declared.name.clone(),
            desc: declared.desc,
            kind,
            usages: UsageSet::EMPTY,
            first: at,
            last: at,
        });
        number
    }

    fn renumber(&mut self, at: u32, step: &mut OrderedStep) {
        for used in &mut step.uses {
            used.resource = self.number(used.resource, at);
            let usages = &mut self.resources[used.resource as usize].usages;
            *usages = usages.with(used.usage);
        }
        match &mut step.step {
            Step::Dispatch {
                bindings, groups, ..
            } => {
                for binding in bindings {
                    if let Bound::Texture { resource, .. } | Bound::Buffer { resource } = binding {
                        *resource = self.number(*resource, at);
                    }
                }
                if let Groups::Indirect { buffer, .. } = groups {
                    *buffer = self.number(*buffer, at);
                }
            }
            Step::Raster(raster) => {
                for resource in raster.resources_mut() {
                    *resource = self.number(*resource, at);
                }
            }
            Step::ClearTexture { resource, .. }
            | Step::ClearBuffer { resource }
            | Step::Capture { resource, .. } => {
                *resource = self.number(*resource, at);
            }
            Step::CopyTexture { source, target } => {
                source.0 = self.number(source.0, at);
                target.0 = self.number(target.0, at);
            }
            Step::CopyBuffer { source, target } => {
                *source = self.number(*source, at);
                *target = self.number(*target, at);
            }
        }
    }

    /// The histories in use, sorted by name, which their resources then point to.
    fn histories(&mut self, live: &Live, steps: u32) -> Vec<PlannedHistory> {
        let mut used: Vec<u32> = live.histories.clone();
        used.sort_by(|a, b| {
            self.graph.histories[*a as usize]
                .name
                .cmp(&self.graph.histories[*b as usize].name)
        });
        let mut planned = Vec::with_capacity(used.len());
        for (index, history) in used.into_iter().enumerate() {
            let pair = &self.graph.histories[history as usize];
            let ResourceDesc::Texture(desc) = self.graph.resources[pair.previous as usize].desc
            else {
                continue;
            };
            let last = steps.saturating_sub(1);
            let (previous, current) = (
                self.number(pair.previous, 0),
                self.number(pair.current, last),
            );
            for (resource, kind) in [
                (previous, ResourceKind::HistoryPrevious(index as u32)),
                (current, ResourceKind::HistoryCurrent(index as u32)),
            ] {
                let resource = &mut self.resources[resource as usize];
                // At rest a history is sampled, whatever else the plan does with it.
                resource.usages = resource.usages.with(Usage::Sampled);
                resource.kind = kind;
            }
            planned.push(PlannedHistory {
                name: pair.name.clone(),
                desc,
                previous,
                current,
                initial: pair.initial,
            });
        }
        planned
    }

    /// Outputs outlive the plan, so they are not transient.
    fn outputs(&mut self, steps: u32) {
        for index in by_name(self.graph) {
            let output = &self.graph.outputs[index as usize];
            let number = self.number(output.resource, steps.saturating_sub(1));
            let resource = &mut self.resources[number as usize];
            let rest = match resource.desc {
                ResourceDesc::Texture(_) => Usage::Sampled,
                ResourceDesc::Buffer(_) => Usage::StorageRead,
            };
            match &mut resource.kind {
                ResourceKind::Output(names) => names.push(output.name.clone()),
                ResourceKind::Transient(_) => {
                    resource.usages = resource.usages.with(rest);
                    resource.kind = ResourceKind::Output(vec![output.name.clone()]);
                }
                // An import or a history asked for as it is stays what it is.
                _ => {}
            }
        }
    }
}
