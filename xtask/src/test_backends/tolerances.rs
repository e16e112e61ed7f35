//! What is tolerated where, and why.
//!
//! *Strict arithmetic* admits one result, so nothing is tolerated, with one
//! exception: OpenGL takes no promise not to contract `a * b + c`, so an
//! executor on it is held to the tolerance of fast arithmetic.
//!
//! *Fast arithmetic* on ash and on wgpu hands one driver the same SPIR-V, so
//! between these two nothing is tolerated either. Against the interpreter the
//! tolerance follows from where roundings are free:
//!
//! * A store to a 16-bit float may truncate or round to nearest: one unit of
//!   the last place, at most u = 2⁻¹⁰ of the value. Built-in functions and
//!   contractions are wrong by some units of `f32` (WGSL, "Accuracy of concrete
//!   floating point expressions"), which is 2⁻¹³ u each; hundreds of them in one
//!   pass stay below u as well. So one pass adds a relative error of at most 2 u.
//! * Passes are sums of non-negative values with non-negative weights, which
//!   keep relative errors as they are. After n passes it is at most 2 n u.
//! * Where a pass subtracts (a threshold, a fade from 1), the error of operands
//!   of the order of 1 stays as it is while the value shrinks: the same figure
//!   once more, absolute.
//! * Sums of logarithms turn a relative error r into r / ln 2 per texel summed.
//! * The last pass quantises to 8 bits: one code more, 1/255.
//! * Where a rounded depth decides between hit and miss, texels may come out
//!   entirely different. How many, no formula says: one in a hundred is
//!   tolerated, four where a blur has spread them.

use etalon_core::Format;

use super::evaluate::Finished;
use super::model::{BackendKind, Case, Target};
use crate::compare::{Limit, Tolerance};
use crate::execute::outcome::Capture;

/// The unit of the last place of a 16-bit float, relative to the value.
const UNIT: f64 = 1.0 / 1024.0;

/// Share of texels where a decision may hang on a rounding.
const UNDECIDED: f64 = 0.01;

/// The tolerances of a pair of executions in a case.
pub(super) fn of(
    case: &Case,
    drawn: bool,
    (reference, subject): (Finished<'_>, Finished<'_>),
) -> impl Fn(&Capture) -> Tolerance {
    let exact = match subject.executor.target {
        Target::Gl => false,
        _ if reference.executor.backend == BackendKind::Wgpu => true,
        _ => case.arithmetic == "strict" && !drawn,
    };
    // The passes in the order of execution, each once, and the size of the frame.
    let mut passes: Vec<String> = Vec::new();
    let mut largest = 1;
    for capture in &reference.run.captures {
        if !passes.contains(&capture.pass) {
            passes.push(capture.pass.clone());
        }
        largest = largest.max(texels(capture));
    }
    move |capture| {
        if exact {
            return Tolerance::BitEqual;
        }
        let before = passes
            .iter()
            .position(|pass| *pass == capture.pass)
            .unwrap_or(passes.len());
        derived(capture, before as u64 + 1, largest)
    }
}

/// The tolerance of what the `number`-th pass writes in fast arithmetic, the
/// frame having so many texels.
fn derived(capture: &Capture, number: u64, frame: u64) -> Tolerance {
    let kernel = capture.pass.split('#').next().unwrap_or_default();
    let relative = 2.0 * number as f64 * UNIT;
    let mut absolute = relative;
    let mut reason = format!(
        "{number} passes so far, each wrong by at most 2 units of a 16-bit float, 2^-10 of the value: one for the \
         store, which may truncate, one for built-in functions and contractions"
    );
    let mut outliers = 0.0;
    if kernel == "exposure/luminance" || kernel == "exposure/reduce" {
        let summed = frame.div_ceil(texels(capture)) as f64;
        absolute *= summed / std::f64::consts::LN_2;
        reason += &format!("; sums of logarithms over {summed} texels");
    }
    if capture.desc.format == Format::Rgba8Unorm {
        absolute += 1.0 / 255.0;
        reason += "; one 8-bit code for the last rounding";
    }
    if kernel.starts_with("ssr/") {
        // A blur mixes a texel that was decided otherwise into its neighbours,
        // and the last pass mixes the blurred picture in.
        outliers = match kernel {
            "ssr/march" | "ssr/resolve" => UNDECIDED,
            _ => 4.0 * UNDECIDED,
        };
        reason += "; the texels left out may hit something else, where a rounded depth decides";
    }
    Tolerance::Within {
        limit: Limit::Relative { relative, absolute },
        outliers,
        reason: reason.into(),
    }
}

/// Texels of one mip and layer.
fn texels(capture: &Capture) -> u64 {
    (u64::from(capture.desc.extent.width) * u64::from(capture.desc.extent.height)).max(1)
}
