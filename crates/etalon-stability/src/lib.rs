//! What effects make of hard inputs.
//!
//! Every effect is run on every case of a corpus ([`etalon_scenes::cases`], and the
//! ends of every knob's range) by the interpreter in `f32`, in `f64` and in `f32`
//! with an `f64` shadow, by wgpu and by Vulkan. Of what each pass wrote is asked:
//!
//! * are all numbers finite?
//! * are wgpu's and Vulkan's bits the interpreter's, under strict arithmetic?
//! * how far is `f32` from the `f64` that takes the same decisions?
//! * is it what the effect's truth says, where it has one?
//! * and at which operation of which kernel did it lose its digits, or decide what
//!   `f64` would not?
//!
//! * [`subject`], [`scene`]: what is run: the corpus, and [`knobs`] at and beyond their
//!   ends;
//! * [`functions`]: the kernels' library by itself;
//! * [`executors`], [`observe`]: who runs it, and what its passes wrote;
//! * [`kernels`]: kernels of a folder, to try a formula;
//! * [`judge`]: what is asked of that, a module for each question;
//! * [`exceptions`]: what of that drivers are known for;
//! * [`sanitise`]: what is found inside of kernels, and what comments in them allow;
//! * [`mutate`]: whether anything is found where a kernel's guard is missing;
//! * [`run`](mod@run): all of it, into a [`model::Report`];
//! * [`per_driver`]: the same on every Vulkan driver that [`drivers`] finds, a process
//!   for each;
//! * [`table`](mod@table), [`report`]: the findings for a terminal and as a page.
//!
//! ```
//! use etalon_stability::executors::Kind;
//! use etalon_stability::run::{Options, run};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let options = Options {
//!     cases: vec!["size-3x3".to_owned()],
//!     effects: vec!["bloom".to_owned()],
//!     executors: vec![Kind::Cpu, Kind::Double, Kind::Shadow],
//!     ..Options::default()
//! };
//! let report = run(&options, &mut ())?;
//! assert!(report.is_sound(), "{:?}", report.findings().next());
//! # Ok(())
//! # }
//! ```

#![forbid(unsafe_code)]

pub mod drivers;
pub mod exceptions;
pub mod executors;
pub mod functions;
pub mod judge;
pub mod kernels;
pub mod knobs;
pub mod model;
pub mod mutate;
mod number;
pub mod observe;
pub mod per_driver;
pub mod plant;
pub mod report;
pub mod run;
pub mod sanitise;
pub mod scene;
pub mod subject;
pub mod table;
mod text;
