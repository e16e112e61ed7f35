//! What is made and done to run plans, counted alike by every executor.

use serde::Serialize;

/// What a backend has made and done since it was created, or what a plan says will
/// be: see [`Plan::counters`](crate::plan::Plan::counters).
///
/// Every field means the same everywhere, or says where it does not. What is made
/// stays made, so of two frames with the same plan only the first makes anything; what
/// is done is done in each.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Counters {
    /// Made: shader modules parsed for this backend, one for each variant of a kernel,
    /// whatever its stages (as bytecode on the interpreter).
    pub kernels: u64,
    /// Made: pipelines, one for each variant of a kernel that is dispatched, and for
    /// each that is drawn with, state and targets.
    pub pipelines: u64,
    /// Made: descriptor sets, or bind groups, one for each dispatch or draw that binds
    /// something. The interpreter has none: it hands resources over.
    pub bind_groups: u64,
    /// Made: textures.
    pub textures: u64,
    /// Made: buffers.
    pub buffers: u64,
    /// Made: allocations of device memory. wgpu's are one for each texture and buffer.
    pub allocations: u64,
    /// Held now: bytes behind all textures and buffers, those that were not made for
    /// it, as an engine's, left out.
    pub bytes: u64,
    /// Held now, of these: bytes behind the transients of the plan that ran last. The
    /// rest persists: histories, outputs, imports, uniforms, staging, and what is kept
    /// for other plans.
    pub transient_bytes: u64,
    /// Done: steps of plans but captures: dispatches, passes of draws, clears and
    /// copies. A dispatch of no workgroups is none.
    pub passes: u64,
    /// Done: dispatches, those of no workgroups left out where the plan says so.
    pub dispatches: u64,
    /// Done: draws of all passes, those of nothing left out where the plan says so. The
    /// records of an indirect draw are one draw.
    pub draws: u64,
    /// Done: barriers of plans. ash records them, wgpu leaves them to its own tracking,
    /// the interpreter ends a step before the next.
    pub barriers: u64,
    /// Done: compute invocations of dispatches whose workgroups the plan tells.
    pub invocations: u64,
    /// Done: compute invocations of indirect dispatches, which the interpreter alone
    /// knows; 0 elsewhere.
    pub indirect_invocations: u64,
}

impl Counters {
    /// Bytes that persist from frame to frame.
    #[must_use]
    pub const fn persistent_bytes(&self) -> u64 {
        self.bytes.saturating_sub(self.transient_bytes)
    }

    /// What was made and is held, without what was done: a steady frame leaves it as
    /// it is.
    #[must_use]
    pub const fn made(&self) -> Self {
        Self {
            passes: 0,
            dispatches: 0,
            draws: 0,
            barriers: 0,
            invocations: 0,
            indirect_invocations: 0,
            ..*self
        }
    }

    /// What was made and done since an earlier reading; bytes are those held now.
    #[must_use]
    pub const fn since(&self, earlier: &Self) -> Self {
        Self {
            kernels: self.kernels.saturating_sub(earlier.kernels),
            pipelines: self.pipelines.saturating_sub(earlier.pipelines),
            bind_groups: self.bind_groups.saturating_sub(earlier.bind_groups),
            textures: self.textures.saturating_sub(earlier.textures),
            buffers: self.buffers.saturating_sub(earlier.buffers),
            allocations: self.allocations.saturating_sub(earlier.allocations),
            bytes: self.bytes,
            transient_bytes: self.transient_bytes,
            passes: self.passes.saturating_sub(earlier.passes),
            dispatches: self.dispatches.saturating_sub(earlier.dispatches),
            draws: self.draws.saturating_sub(earlier.draws),
            barriers: self.barriers.saturating_sub(earlier.barriers),
            invocations: self.invocations.saturating_sub(earlier.invocations),
            indirect_invocations: self
                .indirect_invocations
                .saturating_sub(earlier.indirect_invocations),
        }
    }
}
