//! Work to count instructions of.
//!
//! Under `valgrind --tool=callgrind --dump-before='*count::mark*'` every call of
//! [`mark`] writes what was counted since the last. Each kernel's work is done
//! once and then twice, each between two marks, after everything has been made
//! ready: the difference is the work alone.

use std::hint::black_box;

use etalon_core::backend::{Backend, BackendError};
use etalon_core::kernel::Arithmetic;
use etalon_cpu::Tier;
use thiserror::Error;

use crate::compare::interpreter;
use crate::subjects::{Size, SubjectError, frame, subjects};

/// Why there is nothing to count.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum CountError {
    /// There is nothing to measure.
    #[error(transparent)]
    Subject(#[from] SubjectError),
    /// The interpreter cannot be had, or fails.
    #[error(transparent)]
    Backend(#[from] BackendError),
    /// The processor, or what imitates it, has no AVX2.
    #[error("instructions are counted on the AVX2 tier, which this processor has not")]
    NoTier,
}

/// The size counted on: small, since counting takes some fifty times as long.
pub const SIZE: Size = Size {
    width: 128,
    height: 72,
};

/// A call that the counting tool sees.
#[inline(never)]
pub fn mark(number: usize) -> usize {
    black_box(number)
}

/// Does the work of every kernel in both arithmetics. Returns their names in
/// order; to each belong two counts, of the work done once and done twice.
///
/// # Errors
/// If the interpreter fails, or has no AVX2.
pub fn count() -> Result<Vec<String>, CountError> {
    if !Tier::Avx2.is_available() {
        return Err(CountError::NoTier);
    }
    let frame = frame(SIZE)?;
    let mut backend = interpreter(Some(Tier::Avx2), 1)?;
    let mut names = Vec::new();
    for arithmetic in [Arithmetic::Strict, Arithmetic::Fast] {
        for subject in subjects().iter().filter(|subject| subject.has(arithmetic)) {
            for work in subject.works(&frame, arithmetic, &mut backend)? {
                let inputs = work.inputs();
                let plans = [work.repeated(1), work.repeated(2)];
                backend.execute(&plans[1], &inputs)?;
                for (number, plan) in plans.iter().enumerate() {
                    mark(number);
                    backend.execute(plan, &inputs)?;
                    mark(number);
                }
                names.push(format!("{arithmetic} {} {}", subject.name, work.kernel));
            }
        }
    }
    Ok(names)
}
