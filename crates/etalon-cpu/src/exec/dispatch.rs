//! Dispatching: workgroups over workers.

use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};

use rayon::prelude::*;

use super::check::{Checker, Collector, Shadow};
use super::link::Linked;
use super::probe::{Heat, Prober, Tally, append_tallies};
use super::profile::{Recorder, Recording, Unwatched, Watch};
use super::state::{Failure, LocalIds, Resource, StageLanes, State};
use super::subgroup::MAX_SUBGROUP;
use super::tier::Tier;
use crate::code::Code;
use crate::error::RunError;
use crate::num::{Number, NumberType};
use crate::registers::{LANES, Lanes, Registers};

/// Workers and what they run with.
#[derive(Debug)]
pub struct Executor {
    pool: rayon::ThreadPool,
    tier: Tier,
    number_type: NumberType,
    lanes: Option<u32>,
    max_trips: u32,
    profile: bool,
    subgroup_size: u32,
    perturbation: Option<u64>,
}

/// What a dispatch did.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct DispatchCounters {
    /// Workgroups run.
    pub workgroups: u64,
    /// Invocations run.
    pub invocations: u64,
}

impl Executor {
    /// Default for [`Executor::with_max_trips`]: more than any loop over the
    /// texels of a 4096² image, and minutes rather than hours of work.
    pub const DEFAULT_MAX_TRIPS: u32 = 1 << 24;

    /// Lanes that run together by default: enough to make calling an instruction
    /// cheap beside its work, and the registers of most kernels still fit a
    /// core's nearest cache.
    pub const DEFAULT_LANES: u32 = 256;

    /// The same for kernels with loops that invocations may leave at different
    /// times: there all lanes wait for the last.
    pub const LANES_OF_DIVERGENT_LOOPS: u32 = 128;

    /// Default for [`Executor::with_subgroup_size`].
    pub const DEFAULT_SUBGROUP_SIZE: u32 = 32;

    /// An executor with a number of threads; 0 for one per processor.
    ///
    /// # Errors
    /// [`RunError::Threads`] if the system does not give them.
    pub fn new(threads: usize) -> Result<Self, RunError> {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .thread_name(|index| format!("etalon-cpu-{index}"))
            .build()
            .map_err(|error| RunError::Threads {
                reason: error.to_string(),
            })?;
        Ok(Self {
            pool,
            tier: Tier::best(),
            number_type: NumberType::F32,
            lanes: None,
            max_trips: Self::DEFAULT_MAX_TRIPS,
            profile: false,
            subgroup_size: Self::DEFAULT_SUBGROUP_SIZE,
            perturbation: None,
        })
    }

    /// Runs on the given instruction set, or the baseline if the processor has it not.
    #[must_use]
    pub fn with_tier(mut self, tier: Tier) -> Self {
        self.tier = tier.or_baseline();
        self
    }

    /// Computes in the given number type.
    #[must_use]
    pub fn with_number_type(mut self, number_type: NumberType) -> Self {
        self.number_type = number_type;
        self
    }

    /// The most lanes that run together, rounded up to a multiple of 64: a part
    /// of a workgroup, or several workgroups. Workgroups whose invocations share
    /// memory or meet at barriers always run whole, and one at a time. Without
    /// this it is [`Executor::DEFAULT_LANES`], or
    /// [`Executor::LANES_OF_DIVERGENT_LOOPS`]. Results do not depend on it.
    #[must_use]
    pub fn with_lanes(mut self, lanes: u32) -> Self {
        self.lanes = Some(lanes.clamp(1, 1 << 16).next_multiple_of(LANES as u32));
        self
    }

    /// How often a loop may repeat before the dispatch fails with
    /// [`RunError::EndlessLoop`].
    #[must_use]
    pub fn with_max_trips(mut self, max_trips: u32) -> Self {
        self.max_trips = max_trips.max(1);
        self
    }

    /// Whether dispatches record what each instruction costs, for
    /// [`Program::profile`](crate::Program::profile). They take about twice as
    /// long then; otherwise it costs nothing.
    #[must_use]
    pub fn with_profile(mut self, profile: bool) -> Self {
        self.profile = profile;
        self
    }

    /// Whether dispatches are profiled.
    #[must_use]
    pub fn profiles(&self) -> bool {
        self.profile
    }

    /// Invocations in a subgroup: consecutive ones by `local_invocation_index`.
    /// Rounded up to a power of two from 4 to 128, the sizes that WGSL knows.
    #[must_use]
    pub fn with_subgroup_size(mut self, size: u32) -> Self {
        self.subgroup_size = size.clamp(4, MAX_SUBGROUP as u32).next_power_of_two();
        self
    }

    /// Invocations in a subgroup.
    #[must_use]
    pub fn subgroup_size(&self) -> u32 {
        self.subgroup_size
    }

    /// Moves the results of programs translated with
    /// [`TranslateOptions::perturb`](crate::TranslateOptions::perturb) within what WGSL
    /// allows a device (§15.7.4): roundings go either way, sums of products may be fused,
    /// subnormal numbers may be flushed to zero, functions are off by up to what their
    /// accuracy says. Each seed is another such device; the same seed is the same one. Of
    /// seed 0 and 1 it has habits: all towards 0, and all away from it. The others do
    /// this or that.
    /// What several of them make of a picture says how much of it is not determined by
    /// the kernel, as Verrou does for programs (F. Févotte and B. Lathuilière, 2016): it
    /// is a sample, and no bound. Orders of summation are not changed. In `f32`; other
    /// number types lose what they have beyond it.
    #[must_use]
    pub fn with_perturbation(mut self, seed: Option<u64>) -> Self {
        self.set_perturbation(seed);
        self
    }

    /// See [`Executor::with_perturbation`].
    pub(crate) fn set_perturbation(&mut self, seed: Option<u64>) {
        self.perturbation = seed;
    }

    /// The instruction set in use.
    #[must_use]
    pub fn tier(&self) -> Tier {
        self.tier
    }

    /// The number type in use.
    #[must_use]
    pub fn number_type(&self) -> NumberType {
        self.number_type
    }

    /// What [`Executor::with_max_trips`] said.
    pub(crate) fn max_trips(&self) -> u32 {
        self.max_trips
    }

    /// Lanes of the batches of vertex and fragment kernels, which have no more than
    /// a few chunks: what lies between stages should stay in the nearest cache.
    pub(crate) fn stage_lanes(&self) -> u32 {
        self.lanes.unwrap_or(Self::DEFAULT_LANES).min(1024)
    }

    /// Runs `work` on every worker and waits for all.
    pub(crate) fn everywhere(&self, threads: usize, work: impl Fn() + Sync) {
        if threads <= 1 {
            self.pool.install(&work);
        } else {
            self.pool.install(|| {
                (0..threads)
                    .into_par_iter()
                    .with_max_len(1)
                    .for_each(|_| work());
            });
        }
    }

    /// Number of threads.
    #[must_use]
    pub fn threads(&self) -> usize {
        self.pool.current_num_threads()
    }
}

/// What a failed dispatch says; [`crate::Program`] adds the names.
#[derive(Debug)]
pub(crate) enum DispatchFailure {
    /// In which workgroup, x first, and after how many trips of a loop.
    Failed(Failure, u64, u32),
    TooManyWorkgroups,
    OutOfMemory(u64),
}

/// A kernel ready to be dispatched.
pub(crate) struct Job<'a, N: Number> {
    pub(crate) code: &'a Code,
    pub(crate) linked: &'a Linked<N>,
    pub(crate) resources: &'a [Resource<'a>],
    pub(crate) local_ids: &'a LocalIds,
    pub(crate) invocations: u32,
    /// What is known of the resources' contents, for checks.
    pub(crate) shadows: &'a [Shadow<'a>],
    /// Where to mark what probes see; none for programs without.
    pub(crate) heat: Option<&'a Heat>,
    /// Invocations of a workgroup along each axis.
    pub(crate) workgroup_size: [u32; 3],
    /// Where to record what instructions cost, if that is wanted.
    pub(crate) recording: Option<&'a Mutex<Recording>>,
}

impl<'a, N: Number> Job<'a, N> {
    pub(crate) fn run(
        &self,
        executor: &Executor,
        workgroups: [u32; 3],
    ) -> Result<(DispatchCounters, Found), DispatchFailure> {
        let total = workgroups
            .iter()
            .try_fold(1_u64, |total, &count| total.checked_mul(count.into()))
            .ok_or(DispatchFailure::TooManyWorkgroups)?;
        if total == 0 {
            return Ok(Default::default());
        }
        // Small enough shares that no worker is left alone with the rest, large
        // enough that neighbours share cache lines of what they read.
        let threads = if self.code.depends_on_order() {
            1
        } else {
            executor.threads()
        };
        let shared = Shared {
            total,
            share: (total / (threads as u64 * 16)).clamp(1, 64),
            next: AtomicU64::new(0),
            failed: AtomicU64::new(u64::MAX),
            failure: Mutex::new(None),
            found: Mutex::new(Found::default()),
        };
        let work = || {
            let result = match self.recording {
                None => self.work(executor, workgroups, &shared, &mut Unwatched),
                Some(recording) => {
                    let mut recorder = Recorder::new(self.code);
                    let result = self.work(executor, workgroups, &shared, &mut recorder);
                    lock(recording).add(recorder);
                    result
                }
            };
            if let Err(failure) = result {
                shared.fail(failure);
            }
        };
        if threads == 1 {
            executor.pool.install(work);
        } else {
            executor.pool.install(|| {
                (0..threads)
                    .into_par_iter()
                    .with_max_len(1)
                    .for_each(|_| work())
            });
        }
        match into_inner(shared.failure) {
            Some(failure) => Err(failure),
            None => Ok((
                DispatchCounters {
                    workgroups: total,
                    invocations: total.saturating_mul(self.invocations.into()),
                },
                into_inner(shared.found),
            )),
        }
    }

    /// What one worker does: takes shares of the workgroups until none is left.
    fn work(
        &self,
        executor: &Executor,
        workgroups: [u32; 3],
        shared: &Shared,
        watch: &mut impl Watch<N>,
    ) -> Result<(), DispatchFailure> {
        let &Shared { total, share, .. } = shared;
        // A batch is a part of a workgroup, or several of them.
        let all_chunks = self.local_ids.active.len();
        let lanes = executor.lanes.unwrap_or_else(|| {
            if self.code.has_divergent_loop() {
                Executor::LANES_OF_DIVERGENT_LOOPS
            } else {
                Executor::DEFAULT_LANES
            }
        });
        let batch = lanes as usize / LANES;
        let (most, together) = if !self.code.independent {
            (all_chunks, 1)
        } else if all_chunks >= batch {
            (batch, 1)
        } else {
            let together = batch / all_chunks;
            (together * all_chunks, together as u64)
        };
        let mut state: Option<State<'_, N>> = None;
        let [x, y, _] = workgroups.map(u64::from);
        loop {
            let first = shared.next.fetch_add(share, Ordering::Relaxed);
            // Workgroups before one that failed still run: which failure is
            // reported must not depend on the workers' speed.
            if first >= total.min(shared.failed.load(Ordering::Relaxed)) {
                if let Some(state) = state {
                    lock(&shared.found).append(state);
                }
                return Ok(());
            }
            let state = match &mut state {
                Some(state) => state,
                empty => empty.insert(self.state(executor, most, workgroups)?),
            };
            let end = (first + share).min(total);
            let mut index = first;
            while index < end {
                let groups = together.min(end - index).min(x - index % x);
                // Each is below its count, which is 32 bits.
                state.workgroup = [
                    (index % x) as u32,
                    (index / x % y) as u32,
                    (index / (x * y)) as u32,
                ];
                state.workgroup_floats.fill(N::default());
                state.workgroup_ints.fill(0);
                let chunks = groups as usize * all_chunks;
                if let Some(checker) = &mut state.checker {
                    checker.begin(index);
                }
                let mut chunk = 0;
                while chunk < chunks {
                    state.first_chunk = chunk;
                    state.chunks = most.min(chunks - chunk);
                    chunk += state.chunks;
                    if let Some(prober) = &mut state.prober {
                        prober.begin();
                    }
                    self.linked
                        .run(state, executor.max_trips, watch)
                        .map_err(|failure| {
                            let after = match failure {
                                Failure::EndlessLoop { workgroup, .. } => workgroup.into(),
                                Failure::DivergentBarrier { .. } => 0,
                            };
                            DispatchFailure::Failed(failure, index + after, executor.max_trips)
                        })?;
                }
                index += groups;
            }
        }
    }

    pub(super) fn state(
        &self,
        executor: &Executor,
        chunks: usize,
        workgroups: [u32; 3],
    ) -> Result<State<'a, N>, DispatchFailure> {
        let [vf, vi, uf, ui] = self.code.files.map(|size| size as usize);
        let stride = vf.max(vi);
        let resources = &self.code.resources;
        let mut state = State {
            registers: Registers {
                floats: allocate(stride.saturating_mul(chunks))?,
                ints: allocate(stride.saturating_mul(chunks))?,
                uniform_floats: allocate(uf)?,
                uniform_ints: allocate(ui)?,
                stride,
            },
            chunks,
            private_floats: allocate::<N::Lanes>(
                (resources.private.float as usize).saturating_mul(chunks),
            )?,
            private_ints: allocate::<Lanes<u32>>(
                (resources.private.int as usize).saturating_mul(chunks),
            )?,
            workgroup_floats: allocate(resources.workgroup.float as usize)?,
            workgroup_ints: allocate(resources.workgroup.int as usize)?,
            code: self.code,
            resources: self.resources,
            local_ids: self.local_ids,
            first_chunk: 0,
            workgroup: [0; 3],
            workgroups,
            any: false,
            subgroup_size: executor.subgroup_size,
            failure: None,
            trips: vec![0; self.code.loops.len()],
            stage: StageLanes {
                inputs: allocate(resources.stage.inputs.len().saturating_mul(chunks))?,
                outputs: allocate(resources.stage.outputs.len().saturating_mul(chunks))?,
                chunks,
                ..StageLanes::default()
            },
            checker: Checker::new(self.code, chunks, self.shadows),
            prober: self
                .heat
                .and_then(|heat| Prober::new(self.code, chunks, self.workgroup_size, heat)),
            perturbation: executor.perturbation,
        };
        for &(slot, bits) in &self.code.constants {
            state.set_bits(slot, 0, &[bits]);
        }
        self.linked.run_prologue(&mut state);
        Ok(state)
    }
}

/// What the workers of a dispatch have in common.
struct Shared {
    /// Workgroups.
    total: u64,
    /// How many a worker takes at a time.
    share: u64,
    /// First workgroup that nobody has taken.
    next: AtomicU64,
    /// The first workgroup that is known to have failed.
    failed: AtomicU64,
    failure: Mutex<Option<DispatchFailure>>,
    found: Mutex<Found>,
}

/// What the workers of a dispatch found.
#[derive(Debug, Default)]
pub(crate) struct Found {
    pub(crate) checks: Collector,
    /// By probe; none if the program has none, or nothing ran.
    pub(crate) tallies: Vec<Tally>,
}

impl Found {
    fn append<N: Number>(&mut self, state: State<'_, N>) {
        if let Some(checker) = state.checker {
            self.checks.append(checker.collector);
        }
        let tallies = state
            .prober
            .map(|prober| prober.tallies)
            .unwrap_or_default();
        append_tallies(&mut self.tallies, tallies);
    }
}

impl Shared {
    /// Keeps the failure of the lowest workgroup; one without a workgroup comes first.
    fn fail(&self, new: DispatchFailure) {
        let workgroup = |failure: &DispatchFailure| match failure {
            DispatchFailure::Failed(_, workgroup, _) => *workgroup,
            _ => 0,
        };
        self.failed.fetch_min(workgroup(&new), Ordering::Relaxed);
        let mut failure = lock(&self.failure);
        if failure
            .as_ref()
            .is_none_or(|old| workgroup(&new) < workgroup(old))
        {
            *failure = Some(new);
        }
    }
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

fn into_inner<T>(mutex: Mutex<T>) -> T {
    mutex.into_inner().unwrap_or_else(PoisonError::into_inner)
}

fn allocate<T: Clone + Default>(count: usize) -> Result<Vec<T>, DispatchFailure> {
    let mut vec = Vec::new();
    vec.try_reserve_exact(count).map_err(|_| {
        DispatchFailure::OutOfMemory((count as u64).saturating_mul(size_of::<T>() as u64))
    })?;
    vec.resize(count, T::default());
    Ok(vec)
}
