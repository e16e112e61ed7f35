//! The numerical sanitiser over the corpus: see [`etalon_cpu::sanitise`] for what it
//! follows in a kernel.

mod allow;
mod effect;
mod finding;
mod heat;
mod watch;

pub use allow::{AllowError, Allowances};
pub use effect::{Effect, effect};
pub use finding::{Finding, Findings, Found};
pub use heat::HeatMap;
pub use watch::{Counts, Watch};
