//! Comparison of two images: how far apart they are, where they differ most,
//! and whether that is within a stated tolerance.
//!
//! Distances are counted in units of the last place of the storage format
//! ([`Format::ulps`](etalon_core::Format::ulps)), so that one number means the
//! same for a depth buffer, a half-float colour and an index map.

mod figures;
mod flip;
#[cfg(test)]
mod tests;
mod tolerance;
mod view;

pub use figures::{
    Channel, CompareError, Comparison, Difference, Ulps, WorstTexel, compare, describe, texels_with,
};
pub use flip::{Flip, flip};
pub use tolerance::{Limit, Tolerance, Verdict};
pub use view::{Mapping, Picture, difference_picture, picture};
