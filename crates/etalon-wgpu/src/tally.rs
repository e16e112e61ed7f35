//! Counting what is made, and what is held.

use std::ops::Deref;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use etalon_core::backend::Counters;

/// Running totals. Shared, because staging buffers come and go on whatever
/// thread polls the device.
#[derive(Debug, Default)]
pub(crate) struct Tally {
    pub(crate) kernels: Count,
    pub(crate) pipelines: Count,
    pub(crate) bind_groups: Count,
    pub(crate) textures: Count,
    pub(crate) buffers: Count,
    pub(crate) views: Count,
    pub(crate) passes: Count,
    pub(crate) dispatches: Count,
    pub(crate) draws: Count,
    pub(crate) barriers: Count,
    pub(crate) invocations: Count,
    bytes: AtomicU64,
    transient_bytes: AtomicU64,
}

impl Tally {
    /// The totals as of now.
    pub(crate) fn read(&self) -> Counters {
        let (textures, buffers) = (self.textures.get(), self.buffers.get());
        Counters {
            kernels: self.kernels.get(),
            pipelines: self.pipelines.get(),
            bind_groups: self.bind_groups.get(),
            textures,
            buffers,
            // wgpu allocates once for each, from blocks of its own.
            allocations: textures + buffers,
            bytes: self.bytes.load(Ordering::Relaxed),
            transient_bytes: self.transient_bytes.load(Ordering::Relaxed),
            passes: self.passes.get(),
            dispatches: self.dispatches.get(),
            draws: self.draws.get(),
            // wgpu's own, which do the same, are told to nobody.
            barriers: self.barriers.get(),
            invocations: self.invocations.get(),
            // Only the device knows.
            indirect_invocations: 0,
        }
    }

    /// Takes note of the transients of the plan that runs.
    pub(crate) fn runs_with(&self, transient_bytes: u64) {
        self.transient_bytes
            .store(transient_bytes, Ordering::Relaxed);
    }
}

/// A number that only grows.
#[derive(Debug, Default)]
pub(crate) struct Count(AtomicU64);

impl Count {
    pub(crate) fn add(&self, count: u64) {
        self.0.fetch_add(count, Ordering::Relaxed);
    }

    pub(crate) fn get(&self) -> u64 {
        self.0.load(Ordering::Relaxed)
    }
}

/// A texture or buffer of our own, whose bytes count as held until it is dropped.
#[derive(Debug)]
pub(crate) struct Owned<T> {
    inner: T,
    bytes: u64,
    tally: Arc<Tally>,
}

impl<T> Owned<T> {
    pub(crate) fn new(inner: T, bytes: u64, tally: &Arc<Tally>) -> Self {
        tally.bytes.fetch_add(bytes, Ordering::Relaxed);
        Self {
            inner,
            bytes,
            tally: tally.clone(),
        }
    }

    /// What it takes.
    pub(crate) const fn bytes(&self) -> u64 {
        self.bytes
    }
}

impl<T> Deref for Owned<T> {
    type Target = T;

    fn deref(&self) -> &T {
        &self.inner
    }
}

impl<T> Drop for Owned<T> {
    fn drop(&mut self) {
        self.tally.bytes.fetch_sub(self.bytes, Ordering::Relaxed);
    }
}
