//! What running a plan makes and does, counted from the plan alone.

use std::collections::HashSet;

use crate::counters::Counters;
use crate::kernel::KernelId;
use crate::plan::{DrawExtent, DrawForm, Groups, Plan, Step};

impl Groups {
    /// Whether these are known to be none.
    #[must_use]
    pub fn is_none(&self) -> bool {
        matches!(self, Self::Direct(groups) if groups.contains(&0))
    }

    /// Invocations of a kernel with workgroups of `size`; `None` if only the device
    /// knows.
    #[must_use]
    pub fn invocations(&self, size: [u32; 3]) -> Option<u64> {
        match self {
            Self::Direct(groups) => {
                let factors = groups.iter().chain(&size);
                Some(factors.fold(1_u64, |product, &factor| {
                    product.saturating_mul(u64::from(factor))
                }))
            }
            Self::Indirect { .. } => None,
        }
    }
}

impl DrawExtent {
    /// Whether nothing is drawn, as far as the plan tells.
    #[must_use]
    pub fn is_none(&self) -> bool {
        match self {
            Self::Direct {
                elements,
                instances,
                ..
            } => elements.is_empty() || instances.is_empty(),
            Self::Indirect { draws, .. } => *draws == 0,
        }
    }
}

impl Step {
    /// Whether it does some work in a frame: what captures do is done for whoever
    /// watches, and a dispatch of no workgroups does nothing.
    #[must_use]
    pub fn works(&self) -> bool {
        match self {
            Self::Capture { .. } => false,
            Self::Dispatch { groups, .. } => !groups.is_none(),
            _ => true,
        }
    }

    /// Compute invocations, if it dispatches and the plan tells how many.
    #[must_use]
    pub fn invocations(&self) -> Option<u64> {
        match self {
            Self::Dispatch { kernel, groups, .. } => {
                groups.invocations(kernel.0.compute()?.workgroup_size)
            }
            _ => None,
        }
    }
}

impl Plan {
    /// Barriers of the whole plan.
    #[must_use]
    pub fn barrier_count(&self) -> usize {
        self.steps
            .iter()
            .map(|step| step.barriers.len())
            .sum::<usize>()
            + self.final_barriers.len()
    }

    /// Steps that run a kernel.
    #[must_use]
    pub fn dispatch_count(&self) -> usize {
        self.steps
            .iter()
            .filter(|step| matches!(step.step, Step::Dispatch { .. }))
            .count()
    }

    /// Draws of all steps.
    #[must_use]
    pub fn draw_count(&self) -> usize {
        let draws = self.steps.iter().map(|step| match &step.step {
            Step::Raster(raster) => raster.draws.len(),
            _ => 0,
        });
        draws.sum()
    }

    /// What a new backend makes and does to run this plan once.
    ///
    /// Of what is made, this has what every backend needs: kernels, pipelines, bind
    /// groups where there are such. How many textures, buffers and allocations hold the
    /// resources is the backend's affair, so those and the bytes are 0 here, but for
    /// the transient ones: those of [both heaps](crate::plan::TransientMemory::planned).
    #[must_use]
    pub fn counters(&self) -> Counters {
        let mut counters = Counters {
            barriers: self.barrier_count() as u64,
            transient_bytes: self.transient_memory().planned,
            ..Counters::default()
        };
        let mut dispatched: HashSet<KernelId> = HashSet::new();
        let mut drawn: HashSet<KernelId> = HashSet::new();
        let mut forms: HashSet<DrawForm> = HashSet::new();
        for step in &self.steps {
            counters.passes += u64::from(step.step.works());
            match &step.step {
                Step::Dispatch {
                    kernel,
                    bindings,
                    groups,
                } => {
                    dispatched.insert(kernel.0.id);
                    if !groups.is_none() {
                        counters.dispatches += 1;
                        counters.bind_groups += u64::from(!bindings.is_empty());
                        counters.invocations += step.step.invocations().unwrap_or(0);
                    }
                }
                Step::Raster(raster) => {
                    for draw in &raster.draws {
                        drawn.insert(draw.kernel.0.id);
                        forms.extend(DrawForm::new(self, raster, draw));
                        let runs = !draw.extent.is_none();
                        counters.draws += u64::from(runs);
                        counters.bind_groups += u64::from(runs && !draw.bindings.is_empty());
                    }
                }
                _ => {}
            }
        }
        counters.kernels = (dispatched.len() + drawn.len()) as u64;
        counters.pipelines = (dispatched.len() + forms.len()) as u64;
        counters
    }
}
