//! What accuracy costs in time.
//!
//! An effect's knobs are turned through their ladders; of every setting the error
//! against independent truths, the time on every backend and the work in counters
//! that depend on no hardware are kept, and drawn as charts to decide from.
//!
//! * [`sweep`](mod@sweep): trying settings, errors first, then times in turns;
//! * [`ladder`]: which settings are tried;
//! * [`trial`]: effects, and what each is tried on;
//! * [`stage`], [`sky`]: a scene, and a sky, as effects and truths take it;
//! * [`executors`], [`observe`], [`work`]: running a setting, seeing what it wrote,
//!   counting what it did;
//! * [`judge`](mod@judge): which truths an effect is held to, and by what measure;
//! * [`metric`]: measures of error;
//! * [`model`], [`store`], [`pictures`]: what a sweep found, as data and in files;
//! * [`front`](mod@front): what costs least for its error;
//! * [`chart`]: error against time, drawn;
//! * [`report`]: the charts with all about every point, as a web page and a table;
//! * [`text`]: numbers and names as people read them;
//! * [`table`](mod@table), [`profile`](mod@profile): the fronts for a terminal, and
//!   for settings that fit a budget.

#![forbid(unsafe_code)]

pub mod chart;
pub mod executors;
pub mod front;
pub mod judge;
pub mod ladder;
pub mod metric;
pub mod model;
pub mod observe;
pub mod pictures;
pub mod profile;
pub mod report;
pub mod sky;
pub mod stage;
pub mod store;
pub mod sweep;
pub mod table;
pub mod text;
pub mod trial;
pub mod work;
