//! What is tolerated where, and why.
//!
//! *Strict arithmetic* admits one result, so nothing is tolerated, with one
//! exception: OpenGL takes no promise not to contract `a * b + c`, so an
//! executor on it is held to the tolerance of fast arithmetic.
//!
//! *Fast arithmetic* on ash and on wgpu hands one driver the same SPIR-V, so
//! between these two nothing is tolerated either. Against the interpreter each texel
//! may be as far off as perturbed executions of the interpreter move it
//! ([`etalon_stability::judge::spread`]). What is drawn is not perturbed, and neither is
//! OpenGL's strict arithmetic; there the tolerance follows from where roundings are free:
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
//!
//! *Models that backends draw themselves* add how they rasterise. lavapipe moves
//! corners to the interpreter's grid and computes depth by the same operations, so
//! with strict arithmetic coverage and depth are the same bits. Not so what is
//! interpolated over triangles, whose planes it takes to the corner of the target:
//! digits get lost for small triangles far from there. It also cuts digits off where
//! it blends into 16-bit floats. Both are less than two units of one per pass. Other
//! drivers have other grids: where an edge is as near to a pixel's centre as corners
//! are moved, the pixel may show something else. If the outlines are as long as ten
//! times the picture's and the grid has 4 bits, that is under one texel in a hundred.
//! With the corners, maps move by up to 1/32 of a pixel, which shows at the edges in
//! them. Together four in a hundred are tolerated, and where rays hit something else
//! or a blur has spread them four times as many as without.

use etalon_core::Format;

use super::evaluate::Finished;
use super::model::{BackendKind, Case, Target};
use crate::compare::{Limit, Tolerance};
use crate::execute::outcome::{Capture, Spread};

/// The unit of the last place of a 16-bit float, relative to the value.
const UNIT: f64 = 1.0 / 1024.0;

/// Share of texels where a decision may hang on a rounding.
const UNDECIDED: f64 = 0.01;

/// Models that a driver draws wrongly: the model, the driver, and what is wrong.
const WRONGLY_DRAWN: [(&str, &str, &str); 1] = [(
    "crossing",
    "swiftshader",
    "SwiftShader's depths of floors that reach behind the near plane are off by several per cent",
)];

/// How the pictures of a pair came to be.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Raster {
    /// From the same images.
    None,
    /// Drawn by the same rules.
    Same,
    /// Drawn on another grid.
    Other,
    /// Drawn wrongly by one of them.
    Wrong(&'static str),
}

/// The tolerances of a pair of executions in a case. `drawn` if the backends draw it
/// themselves.
pub(super) fn of(
    case: &Case,
    drawn: bool,
    (reference, subject): (Finished<'_>, Finished<'_>),
) -> impl Fn(&Capture, Option<Spread>) -> Tolerance {
    let exact = match subject.executor.target {
        Target::Gl => false,
        _ => case.arithmetic == "strict" || reference.executor.backend == BackendKind::Wgpu,
    };
    let driver = subject.executor.driver();
    let wrong = WRONGLY_DRAWN
        .iter()
        .find(|(model, by, _)| (*model, *by) == (case.scene.as_str(), driver));
    let raster = match wrong {
        _ if !drawn || reference.executor.driver() == driver => Raster::None,
        Some((_, _, what)) => Raster::Wrong(what),
        None if exact && driver == "lavapipe" => Raster::Same,
        None => Raster::Other,
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
    move |capture, spread| {
        let depth = capture.desc.format == Format::Depth32Float;
        if exact && (raster == Raster::None || raster == Raster::Same && depth) {
            return Tolerance::BitEqual;
        }
        if let Some(spread) = spread {
            return Tolerance::Spread {
                allowed: spread.allowed.into(),
                decided: spread.decided,
            };
        }
        let before = passes
            .iter()
            .position(|pass| *pass == capture.pass)
            .unwrap_or(passes.len());
        derived(capture, before as u64 + 1, largest, raster)
    }
}

/// The tolerance of what the `number`-th pass writes in fast arithmetic or of what was
/// drawn, the frame having so many texels.
fn derived(capture: &Capture, number: u64, frame: u64, raster: Raster) -> Tolerance {
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
    match raster {
        Raster::None | Raster::Same => {}
        // A list shifts with each tile that one has and the other has not.
        Raster::Other if kernel.starts_with("tiles/") => {
            outliers = 1.0;
            reason = "nothing is asked of lists: an edge drawn elsewhere is in other tiles, and shifts all that \
                      follow; what is made of them is compared"
                .to_owned();
        }
        Raster::Other => {
            outliers = 4.0 * UNDECIDED.max(outliers);
            reason += "; the texels left out may show something else, where an edge is as near as corners are moved";
        }
        Raster::Wrong(what) => {
            outliers = 1.0;
            reason = format!("nothing is asked: {what}");
        }
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
