//! The same handlers, compiled for several instruction sets.
//!
//! Functions that may use an instruction set are called where the processor was
//! seen to have it.

use std::fmt;

use super::fused::{self, Fused};
use super::isa::{self, Isa};
use super::link::Instr;
use super::state::State;
use crate::num::Number;

/// An instruction set.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Tier {
    /// What every processor of the architecture has: SSE2 on x86-64.
    Baseline,
    /// AVX2 and F16C.
    Avx2,
    /// AVX-512 F, BW, DQ and VL.
    Avx512,
}

impl Tier {
    /// All, from the least on.
    pub const ALL: [Self; 3] = [Self::Baseline, Self::Avx2, Self::Avx512];

    /// Whether this processor has it.
    #[must_use]
    pub fn is_available(self) -> bool {
        match self {
            Self::Baseline => true,
            #[cfg(target_arch = "x86_64")]
            Self::Avx2 => {
                std::is_x86_feature_detected!("avx2") && std::is_x86_feature_detected!("f16c")
            }
            #[cfg(target_arch = "x86_64")]
            Self::Avx512 => {
                Self::Avx2.is_available()
                    && std::is_x86_feature_detected!("avx512f")
                    && std::is_x86_feature_detected!("avx512bw")
                    && std::is_x86_feature_detected!("avx512dq")
                    && std::is_x86_feature_detected!("avx512vl")
            }
            #[cfg(not(target_arch = "x86_64"))]
            Self::Avx2 | Self::Avx512 => false,
        }
    }

    /// The largest one this processor has.
    #[must_use]
    pub fn best() -> Self {
        Self::ALL
            .into_iter()
            .rev()
            .find(|tier| tier.is_available())
            .unwrap_or(Self::Baseline)
    }

    /// This one if the processor has it, the baseline otherwise.
    #[must_use]
    pub fn or_baseline(self) -> Self {
        if self.is_available() {
            self
        } else {
            Self::Baseline
        }
    }
}

impl fmt::Display for Tier {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Baseline => "baseline",
            Self::Avx2 => "avx2",
            Self::Avx512 => "avx512",
        })
    }
}

/// What an instruction does to a worker's state.
pub(super) trait Step<N: Number> {
    fn run(state: &mut State<'_, N>, instr: &Instr);
}

/// A [`Step`] that uses what the instruction sets have.
pub(super) trait TieredStep<N: Number> {
    fn run<I: Isa>(state: &mut State<'_, N>, instr: &Instr);
}

type Function<N> = unsafe fn(&mut State<'_, N>, &Instr);

/// A [`Step`] compiled for an instruction set that this processor has.
#[derive(Debug)]
pub(super) struct Handler<N: Number>(Function<N>);

impl<N: Number> Clone for Handler<N> {
    fn clone(&self) -> Self {
        *self
    }
}

impl<N: Number> Copy for Handler<N> {}

impl<N: Number> Handler<N> {
    /// The step for an instruction set, or for the baseline where it is not available.
    /// Steps that work on single numbers need only [`Handler::plain`].
    pub(super) fn new<S: Step<N>>(tier: Tier) -> Self {
        Self(match tier.or_baseline() {
            #[cfg(target_arch = "x86_64")]
            Tier::Avx512 => avx512::<N, S>,
            #[cfg(target_arch = "x86_64")]
            Tier::Avx2 => avx2::<N, S>,
            _ => S::run,
        })
    }

    /// [`Handler::new`] for a step that is told the instruction set.
    pub(super) fn tiered<S: TieredStep<N>>(tier: Tier) -> Self {
        Self(match tier.or_baseline() {
            #[cfg(target_arch = "x86_64")]
            Tier::Avx512 => avx512::<N, Told<S, isa::Avx512>>,
            #[cfg(target_arch = "x86_64")]
            Tier::Avx2 => avx2::<N, Told<S, isa::Avx2>>,
            _ => S::run::<isa::Baseline>,
        })
    }

    /// A step that is told the instruction set, for the baseline only.
    pub(super) fn portable<S: TieredStep<N>>() -> Self {
        Self(S::run::<isa::Baseline>)
    }

    /// The step for the baseline.
    pub(super) fn plain<S: Step<N>>() -> Self {
        Self(S::run)
    }

    #[inline(always)]
    pub(super) fn call(self, state: &mut State<'_, N>, instr: &Instr) {
        // SAFETY: of the constructors `plain` takes functions without target
        // features, the others take one with them only after the processor was
        // seen to have them.
        unsafe { (self.0)(state, instr) }
    }
}

/// A [`TieredStep`] that was told the instruction set.
struct Told<S, I>(std::marker::PhantomData<(S, I)>);

impl<N: Number, S: TieredStep<N>, I: Isa> Step<N> for Told<S, I> {
    #[inline(always)]
    fn run(state: &mut State<'_, N>, instr: &Instr) {
        S::run::<I>(state, instr);
    }
}

/// Work beside the bytecode that uses what instruction sets have.
pub(crate) trait Work {
    fn run<I: Isa, F: Fused>(&mut self);
}

/// Does work in the instructions of a tier, or of the baseline where the processor
/// has not all that is needed.
pub(crate) fn work<W: Work>(tier: Tier, work: &mut W) {
    #[cfg(target_arch = "x86_64")]
    if std::is_x86_feature_detected!("fma") {
        match tier.or_baseline() {
            // SAFETY: the processor was seen to have the instructions.
            Tier::Avx512 => return unsafe { avx512_work(work) },
            // SAFETY: likewise.
            Tier::Avx2 => return unsafe { avx2_work(work) },
            Tier::Baseline => {}
        }
    }
    let _ = tier;
    work.run::<isa::Baseline, fused::Software>();
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,f16c,fma")]
fn avx2_work<W: Work>(work: &mut W) {
    work.run::<isa::Avx2, fused::Hardware>();
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,f16c,fma,avx512f,avx512bw,avx512dq,avx512vl")]
fn avx512_work<W: Work>(work: &mut W) {
    work.run::<isa::Avx512, fused::Hardware>();
}

/// A clock that is cheap to read. Readings are not ordered against the
/// instructions around them, which is of no concern where handlers are called
/// through pointers.
pub(super) struct Ticks {
    start: std::time::Instant,
    first: u64,
}

impl Ticks {
    /// Begins to find out how long a tick is.
    pub(super) fn start() -> Self {
        Self {
            start: std::time::Instant::now(),
            first: Self::now(),
        }
    }

    /// A reading.
    #[cfg(target_arch = "x86_64")]
    #[inline(always)]
    pub(super) fn now() -> u64 {
        // SAFETY: every x86-64 processor has the instruction.
        unsafe { std::arch::x86_64::_rdtsc() }
    }

    /// A reading.
    #[cfg(not(target_arch = "x86_64"))]
    pub(super) fn now() -> u64 {
        static EPOCH: std::sync::OnceLock<std::time::Instant> = std::sync::OnceLock::new();
        let epoch = EPOCH.get_or_init(std::time::Instant::now);
        u64::try_from(epoch.elapsed().as_nanos()).unwrap_or(u64::MAX)
    }

    /// Nanoseconds of a tick, by the time since the start.
    pub(super) fn nanoseconds_per_tick(&self) -> f64 {
        let ticks = Self::now().saturating_sub(self.first).max(1);
        self.start.elapsed().as_nanos() as f64 / ticks as f64
    }
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,f16c")]
fn avx2<N: Number, S: Step<N>>(state: &mut State<'_, N>, instr: &Instr) {
    S::run(state, instr);
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,f16c,avx512f,avx512bw,avx512dq,avx512vl")]
fn avx512<N: Number, S: Step<N>>(state: &mut State<'_, N>, instr: &Instr) {
    S::run(state, instr);
}
