//! How long each step takes.
//!
//! By the device's own clock where that can be trusted. Software devices run
//! commands as they please between two timestamps of wgpu, which have no barrier
//! about them: lavapipe reports microseconds for passes that take half a second.
//! There, and where there are no timestamps, each step is submitted on its own
//! and waited for, and the host's clock tells.

use std::cell::RefCell;
use std::time::Instant;

use etalon_core::backend::{BackendError, StepTime};
use etalon_core::plan::{PlannedStep, Step};

use crate::gpu::Gpu;
use crate::readback::Mapped;
use crate::tally::Owned;

/// Queries of one set: WebGPU's maximum.
const SET: u32 = wgpu::QUERY_SET_MAX_QUERIES;

/// How the steps of a plan are timed.
#[derive(Debug)]
pub(crate) enum Timing {
    /// By the device.
    Device(Queries),
    /// By the host.
    Host(Clock),
}

/// The host's clock around each step that does something on the device.
#[derive(Debug, Default)]
pub(crate) struct Clock(RefCell<Vec<StepTime>>);

impl Clock {
    /// Forgets the times of the last run.
    pub(crate) fn restart(&self) {
        self.0.borrow_mut().clear();
    }

    /// Runs everything recorded so far and then what `record` records, and
    /// keeps the time of the latter.
    pub(crate) fn time(
        &self,
        gpu: &Gpu,
        encoder: &mut wgpu::CommandEncoder,
        step: &PlannedStep,
        record: impl FnOnce(&mut wgpu::CommandEncoder),
    ) {
        gpu.flush(encoder);
        let start = Instant::now();
        record(encoder);
        if timed(step) {
            gpu.flush(encoder);
            self.0.borrow_mut().push(StepTime {
                step: step.name.clone(),
                nanoseconds: u64::try_from(start.elapsed().as_nanos()).unwrap_or(u64::MAX),
            });
        }
    }

    /// The times of the last run.
    pub(crate) fn read(&self) -> Vec<StepTime> {
        self.0.borrow().clone()
    }
}

/// Two timestamps for each step that does something on the device.
#[derive(Debug)]
pub(crate) struct Queries {
    sets: Vec<wgpu::QuerySet>,
    queries: u32,
    resolved: Owned<wgpu::Buffer>,
    readable: Owned<wgpu::Buffer>,
}

/// The place of a step's two timestamps.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Stamp<'a> {
    set: &'a wgpu::QuerySet,
    first: u32,
}

impl<'a> Stamp<'a> {
    /// Has a compute pass take both.
    pub(crate) fn of_pass(self) -> wgpu::ComputePassTimestampWrites<'a> {
        wgpu::ComputePassTimestampWrites {
            query_set: self.set,
            beginning_of_pass_write_index: Some(self.first),
            end_of_pass_write_index: Some(self.first + 1),
        }
    }

    /// Has a render pass take both.
    pub(crate) fn of_render_pass(self) -> wgpu::RenderPassTimestampWrites<'a> {
        wgpu::RenderPassTimestampWrites {
            query_set: self.set,
            beginning_of_pass_write_index: Some(self.first),
            end_of_pass_write_index: Some(self.first + 1),
        }
    }

    /// Takes the first here.
    pub(crate) fn begin(self, encoder: &mut wgpu::CommandEncoder) {
        encoder.write_timestamp(self.set, self.first);
    }

    /// Takes the second here.
    pub(crate) fn end(self, encoder: &mut wgpu::CommandEncoder) {
        encoder.write_timestamp(self.set, self.first + 1);
    }
}

/// Whether a step's time is told.
fn timed(step: &PlannedStep) -> bool {
    !matches!(step.step, Step::Capture { .. })
}

impl Timing {
    /// Prepares to time these steps.
    pub(crate) fn new(gpu: &Gpu, steps: &[PlannedStep]) -> Result<Self, BackendError> {
        let queries = if gpu.tells_time() {
            Queries::new(gpu, steps)?
        } else {
            None
        };
        Ok(queries.map_or_else(|| Self::Host(Clock::default()), Self::Device))
    }
}

impl Queries {
    /// Timestamps for these steps; `None` if there are none or too many.
    fn new(gpu: &Gpu, steps: &[PlannedStep]) -> Result<Option<Self>, BackendError> {
        let count = steps.iter().filter(|step| timed(step)).count();
        let Some(queries) = u32::try_from(count)
            .ok()
            .and_then(|count| count.checked_mul(2))
            .filter(|queries| *queries > 0)
        else {
            return Ok(None);
        };
        let sets = gpu
            .guarded(|| {
                (0..queries)
                    .step_by(SET as usize)
                    .map(|first| {
                        gpu.device.create_query_set(&wgpu::QuerySetDescriptor {
                            label: Some("etalon timestamps"),
                            ty: wgpu::QueryType::Timestamp,
                            count: SET.min(queries - first),
                        })
                    })
                    .collect()
            })
            .map_err(|fault| fault.of("create_query_set", "timestamps", 0))?;
        let bytes = u64::from(queries) * u64::from(wgpu::QUERY_SIZE);
        let buffer = |usage| gpu.buffer("etalon timestamps", bytes, usage, None);
        Ok(Some(Self {
            sets,
            queries,
            resolved: buffer(wgpu::BufferUsages::QUERY_RESOLVE | wgpu::BufferUsages::COPY_SRC)?,
            readable: buffer(wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST)?,
        }))
    }

    /// The stamps of each step, in the order of the plan.
    pub(crate) fn stamps<'a>(
        &'a self,
        steps: &'a [PlannedStep],
    ) -> impl Iterator<Item = Option<Stamp<'a>>> + 'a {
        let mut next = 0;
        steps.iter().map(move |step| {
            if !timed(step) {
                return None;
            }
            let query = next;
            next += 2;
            Some(Stamp {
                set: self.sets.get((query / SET) as usize)?,
                first: query % SET,
            })
        })
    }

    /// Records the copy of all timestamps to where they can be read.
    pub(crate) fn record(&self, encoder: &mut wgpu::CommandEncoder) {
        let size = u64::from(wgpu::QUERY_SIZE);
        for (index, set) in self.sets.iter().enumerate() {
            let first = index as u64 * u64::from(SET);
            encoder.resolve_query_set(set, 0..set.count(), &self.resolved, first * size);
        }
        let bytes = u64::from(self.queries) * size;
        encoder.copy_buffer_to_buffer(&self.resolved, 0, &self.readable, 0, bytes);
    }

    /// Asks for the timestamps; they can be read once the device was waited for.
    pub(crate) fn map<'a>(&'a self, gpu: &'a Gpu) -> Mapped<'a> {
        Mapped::new(gpu, &self.readable)
    }

    /// The time of each step.
    pub(crate) fn read(
        &self,
        gpu: &Gpu,
        steps: &[PlannedStep],
        mapped: Mapped<'_>,
    ) -> Result<Vec<StepTime>, BackendError> {
        let period = f64::from(gpu.queue.get_timestamp_period());
        mapped.read("timestamps", |bytes| {
            let ticks = bytes.chunks_exact(8).map(|bytes| {
                bytes
                    .iter()
                    .rev()
                    .fold(0, |sum, byte| sum << 8 | u64::from(*byte))
            });
            let (begins, ends) = (ticks.clone().step_by(2), ticks.skip(1).step_by(2));
            steps
                .iter()
                .filter(|step| timed(step))
                .zip(begins.zip(ends))
                .map(|(step, (begin, end))| StepTime {
                    step: step.name.clone(),
                    // Clocks may wrap or, on some devices, jump back.
                    nanoseconds: (end.saturating_sub(begin) as f64 * period) as u64,
                })
                .collect()
        })
    }
}
