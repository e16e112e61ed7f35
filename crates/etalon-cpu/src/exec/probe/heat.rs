//! Where in a dispatch something was found.

use std::sync::atomic::{AtomicU8, Ordering};

use crate::sanitise::HEAT_LIMIT;

/// A byte for each invocation and place in the source, and one more for each
/// invocation. Workers mark different invocations.
#[derive(Debug, Default)]
pub(crate) struct Heat {
    /// Which map each probe marks.
    maps: Vec<u32>,
    invocations: usize,
    marks: Vec<AtomicU8>,
    diverged: Vec<AtomicU8>,
}

impl Heat {
    /// For probes of which each marks the map of a number; none if there is no room.
    pub(crate) fn new(maps: Vec<u32>, invocations: u64) -> Self {
        let count = u64::from(maps.iter().max().map_or(0, |last| last + 1));
        let bytes = count
            .checked_add(1)
            .and_then(|count| count.checked_mul(invocations));
        if count == 0 || bytes.is_none_or(|bytes| bytes > HEAT_LIMIT) {
            return Self::default();
        }
        // Below the limit, which an address has.
        let (count, invocations) = (count as usize, invocations as usize);
        Self {
            maps,
            invocations,
            marks: zeros(count * invocations),
            diverged: zeros(invocations),
        }
    }

    pub(super) fn mark(&self, probe: usize, invocation: u64, heat: u8) {
        let map = self.maps.get(probe).copied().unwrap_or_default() as usize;
        let at = map * self.invocations + invocation as usize;
        if let Some(mark) = self.marks.get(at) {
            mark.fetch_max(heat, Ordering::Relaxed);
        }
    }

    pub(super) fn diverge(&self, invocation: u64) {
        if let Some(mark) = self.diverged.get(invocation as usize) {
            mark.store(1, Ordering::Relaxed);
        }
    }

    /// The map that a probe marks; empty without.
    pub(crate) fn of(&self, probe: usize) -> Vec<u8> {
        let Some(&map) = self.maps.get(probe) else {
            return Vec::new();
        };
        let start = map as usize * self.invocations;
        let marks = self.marks.get(start..start + self.invocations);
        marks.map_or_else(Vec::new, bytes)
    }

    /// Which invocations have diverged.
    pub(crate) fn diverged(&self) -> Vec<bool> {
        bytes(&self.diverged)
            .into_iter()
            .map(|byte| byte != 0)
            .collect()
    }
}

fn zeros(count: usize) -> Vec<AtomicU8> {
    (0..count).map(|_| AtomicU8::new(0)).collect()
}

fn bytes(marks: &[AtomicU8]) -> Vec<u8> {
    marks
        .iter()
        .map(|mark| mark.load(Ordering::Relaxed))
        .collect()
}
