//! The work of one kernel, cut out of a plan.
//!
//! An effect's plan runs a kernel once or several times (a pyramid's levels),
//! between other kernels. Here each kernel of it becomes a plan of its own: its
//! dispatches in their order with the same uniforms, and everything they bind
//! imported, with the contents it has in the effect at that time. Such a plan
//! can be repeated within one execution, so that neither uploading nor
//! submitting is measured.

use std::collections::BTreeMap;

use etalon_core::backend::{Backend, BackendError, CapturedData, Inputs};
use etalon_core::graph::{Graph, ResourceDesc, Subresources};
use etalon_core::image::ImageData;
use etalon_core::kernel::{Access, Arithmetic, BindingKind, Kernel, KernelLibrary};
use etalon_core::plan::{
    Barrier, Bound, Groups, Plan, PlanError, PlanOptions, PlannedResource, PlannedStep,
    ResourceKind, Step, Usage, UsageSet,
};
use etalon_core::resource::Limits;
use thiserror::Error;

/// Why a plan cannot be taken apart.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum WorkError {
    /// The graph cannot be planned.
    #[error(transparent)]
    Plan(#[from] PlanError),
    /// The plan cannot be run to see what its resources hold.
    #[error(transparent)]
    Backend(#[from] BackendError),
    /// A step binds what its plan or its kernel does not have.
    #[error("step `{step}`: {what}")]
    Malformed {
        /// The step.
        step: String,
        /// What is wrong.
        what: &'static str,
    },
}

/// What one kernel does within a plan.
#[derive(Clone, Debug)]
pub struct Work {
    /// The kernel's path.
    pub kernel: String,
    /// Names of the steps that run it, in order.
    pub steps: Vec<String>,
    plan: Plan,
    uses: Vec<Vec<Use>>,
    textures: Vec<(String, ImageData)>,
    buffers: Vec<(String, Vec<u8>)>,
}

/// How a step uses one mip and layer of a texture, or a buffer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Use {
    resource: u32,
    mip: u32,
    layer: u32,
    usage: Usage,
}

impl Work {
    /// A plan that does the work a number of times.
    #[must_use]
    pub fn repeated(&self, times: usize) -> Plan {
        let mut plan = self.plan.clone();
        let rest = |resource: u32| match plan.resources[resource as usize].desc {
            ResourceDesc::Texture(_) => Usage::Sampled,
            ResourceDesc::Buffer(_) => Usage::StorageRead,
        };
        let mut states = BTreeMap::new();
        let mut steps = Vec::with_capacity(times * plan.steps.len());
        for time in 0..times {
            for (step, uses) in plan.steps.iter().zip(&self.uses) {
                let mut step = step.clone();
                step.name = format!("{} {time}", step.name);
                for used in uses {
                    let state = states
                        .entry((used.resource, used.mip, used.layer))
                        .or_insert_with(|| rest(used.resource));
                    if *state != used.usage || used.usage.writes() {
                        step.barriers.push(barrier(used, *state, used.usage));
                    }
                    *state = used.usage;
                }
                steps.push(step);
            }
        }
        let final_barriers = states
            .iter()
            .filter_map(|(&(resource, mip, layer), &state)| {
                let usage = rest(resource);
                let used = Use {
                    resource,
                    mip,
                    layer,
                    usage,
                };
                (state != usage).then(|| barrier(&used, state, usage))
            })
            .collect();
        plan.steps = steps;
        plan.final_barriers = final_barriers;
        plan
    }

    /// What the plan imports.
    #[must_use]
    pub fn inputs(&self) -> Inputs<'_> {
        let mut inputs = Inputs::new();
        for (name, image) in &self.textures {
            inputs = inputs.texture(name.as_str(), image);
        }
        for (name, bytes) in &self.buffers {
            inputs = inputs.buffer(name.as_str(), bytes);
        }
        inputs
    }

    /// Bytes of everything bound, uniforms apart.
    #[must_use]
    pub fn bytes(&self) -> usize {
        let textures = self.textures.iter().map(|(_, image)| image.bytes.len());
        let buffers = self.buffers.iter().map(|(_, bytes)| bytes.len());
        textures.chain(buffers).sum()
    }
}

fn barrier(used: &Use, from: Usage, to: Usage) -> Barrier {
    Barrier {
        resource: used.resource,
        range: Subresources {
            mip: used.mip,
            mips: 1,
            layer: used.layer,
            layers: 1,
        },
        from: from.into(),
        layout: Some(from),
        to,
    }
}

/// Takes a graph's plan apart into the works of its kernels, in order of first
/// use. `backend` runs the plan twice, so that histories hold what a frame
/// leaves in them.
///
/// # Errors
/// A [`WorkError`] if the graph cannot be planned or run.
pub fn works(
    graph: &Graph,
    kernels: &KernelLibrary,
    arithmetic: Arithmetic,
    limits: Limits,
    backend: &mut dyn Backend,
    inputs: &Inputs<'_>,
) -> Result<Vec<Work>, WorkError> {
    let options = PlanOptions {
        arithmetic,
        limits,
        ..PlanOptions::default()
    };
    let plan = Plan::new(graph, kernels, &options)?;
    backend.reset_histories();
    backend.execute(&plan, inputs)?;
    let mut order = Vec::new();
    for step in &plan.steps {
        if let Step::Dispatch { kernel, .. } = &step.step
            && !order.contains(&kernel.0.id)
        {
            order.push(kernel.0.id);
        }
    }
    let mut works = Vec::with_capacity(order.len());
    for id in order {
        let runs = |step: &PlannedStep| matches!(&step.step, Step::Dispatch { kernel, .. } if kernel.0.id == id);
        works.push(work(&plan, runs, backend, inputs)?);
    }
    backend.reset_histories();
    Ok(works)
}

/// The steps of `plan` that `runs` is true of, as a work.
fn work(
    plan: &Plan,
    runs: impl Fn(&PlannedStep) -> bool,
    backend: &mut dyn Backend,
    inputs: &Inputs<'_>,
) -> Result<Work, WorkError> {
    // Numbers in the plan, in the order of numbers in the work.
    let mut resources: Vec<u32> = Vec::new();
    let mut prefix = plan.clone();
    prefix.steps.clear();
    prefix.final_barriers.clear();
    let (mut steps, mut uses) = (Vec::new(), Vec::new());
    let mut kernel = String::new();
    for step in &plan.steps {
        if runs(step)
            && let Step::Dispatch {
                kernel: reference,
                bindings,
                groups,
            } = &step.step
        {
            kernel.clone_from(&reference.0.name);
            let mut bindings = bindings.clone();
            let mut groups = *groups;
            let numbers = bindings.iter_mut().filter_map(|bound| match bound {
                Bound::Texture { resource, .. } | Bound::Buffer { resource } => Some(resource),
                Bound::Uniform(_) | Bound::Sampler(_) => None,
            });
            let arguments = match &mut groups {
                Groups::Indirect { buffer, .. } => Some(buffer),
                Groups::Direct(_) => None,
            };
            for number in numbers.chain(arguments) {
                let known = resources.iter().position(|known| known == number);
                let index = known.unwrap_or_else(|| {
                    prefix.steps.push(capture(plan, *number));
                    resources.push(*number);
                    resources.len() - 1
                });
                *number = index as u32;
            }
            uses.push(uses_of(&reference.0, &bindings, groups).map_err(|what| {
                WorkError::Malformed {
                    step: step.name.clone(),
                    what,
                }
            })?);
            steps.push(PlannedStep {
                name: step.name.clone(),
                effect: step.effect.clone(),
                reason: step.reason.clone(),
                goal: step.goal.clone(),
                barriers: Vec::new(),
                step: Step::Dispatch {
                    kernel: reference.clone(),
                    bindings,
                    groups,
                },
            });
        }
        let mut step = step.clone();
        step.barriers.clear();
        prefix.steps.push(step);
    }
    let captured = backend.execute(&prefix, inputs)?.captures;
    let (mut textures, mut buffers) = (Vec::new(), Vec::new());
    for (index, captured) in captured.into_iter().enumerate() {
        match captured.data {
            CapturedData::Texture(image) => textures.push((import_name(index), image)),
            CapturedData::Buffer(bytes) => buffers.push((import_name(index), bytes)),
        }
    }
    let last = steps.len().saturating_sub(1) as u32;
    let planned = resources.iter().enumerate().map(|(index, &number)| {
        let original = &plan.resources[number as usize];
        let usages = uses
            .iter()
            .flatten()
            .filter(|used: &&Use| used.resource as usize == index)
            .fold(UsageSet::EMPTY, |set, used| set.with(used.usage));
        PlannedResource {
            name: original.name.clone(),
            desc: original.desc,
            kind: ResourceKind::Import(import_name(index)),
            usages,
            first: 0,
            last,
        }
    });
    Ok(Work {
        kernel,
        steps: steps.iter().map(|step| step.name.clone()).collect(),
        plan: Plan {
            arithmetic: plan.arithmetic,
            resources: planned.collect(),
            steps,
            final_barriers: Vec::new(),
            histories: Vec::new(),
            texture_heap: 0,
            buffer_heap: 0,
            heap_alignment: plan.heap_alignment,
            unaliased_bytes: 0,
            culled: Vec::new(),
            effects: Vec::new(),
            uniforms: plan.uniforms.clone(),
        },
        uses,
        textures,
        buffers,
    })
}

fn import_name(index: usize) -> String {
    format!("r{index}")
}

/// Copies all of a resource to the host.
fn capture(plan: &Plan, resource: u32) -> PlannedStep {
    let planned = &plan.resources[resource as usize];
    let (mips, layers) = match &planned.desc {
        ResourceDesc::Texture(desc) => (desc.mips, desc.layers()),
        ResourceDesc::Buffer(_) => (1, 1),
    };
    let range = Subresources {
        mip: 0,
        mips,
        layer: 0,
        layers,
    };
    PlannedStep {
        name: format!("capture {}", planned.name),
        effect: String::new(),
        reason: "to run what follows alone".to_owned(),
        goal: String::new(),
        barriers: Vec::new(),
        step: Step::Capture {
            resource,
            range,
            pass: String::new(),
            binding: String::new(),
        },
    }
}

/// How a dispatch uses what it binds, each subresource once.
fn uses_of(kernel: &Kernel, bindings: &[Bound], groups: Groups) -> Result<Vec<Use>, &'static str> {
    let storage = |access: Access| match access {
        Access::Read => Usage::StorageRead,
        Access::Write => Usage::StorageWrite,
        Access::ReadWrite => Usage::StorageUpdate,
    };
    if kernel.bindings.len() != bindings.len() {
        return Err("it does not bind what its kernel wants");
    }
    let mut uses = Vec::new();
    let mut add = |used: Use| {
        if !uses.contains(&used) {
            uses.push(used);
        }
    };
    for (binding, bound) in kernel.bindings.iter().zip(bindings) {
        let usage = match &binding.kind {
            BindingKind::Texture { .. } => Usage::Sampled,
            BindingKind::StorageTexture { access, .. }
            | BindingKind::StorageBuffer { access, .. } => storage(*access),
            BindingKind::Uniform(_) | BindingKind::Sampler { .. } => continue,
        };
        match *bound {
            Bound::Texture { resource, range } => {
                for mip in range.mip..range.mip + range.mips {
                    for layer in range.layer..range.layer + range.layers {
                        add(Use {
                            resource,
                            mip,
                            layer,
                            usage,
                        });
                    }
                }
            }
            Bound::Buffer { resource } => add(Use {
                resource,
                mip: 0,
                layer: 0,
                usage,
            }),
            Bound::Uniform(_) | Bound::Sampler(_) => {
                return Err("it does not bind what its kernel wants");
            }
        }
    }
    if let Groups::Indirect { buffer, .. } = groups {
        add(Use {
            resource: buffer,
            mip: 0,
            layer: 0,
            usage: Usage::Indirect,
        });
    }
    Ok(uses)
}
