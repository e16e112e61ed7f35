//! What effects cost by the share of the screen that they concern.
//!
//! Reflections are drawn on tiles of a scene of which a share mirrors, from none of the
//! screen to all of it, and on the whole picture for comparison. Over the share, the
//! time on tiles is nearly a line: where it begins is the tax on a scene that has nothing
//! to reflect, and where it meets the time without tiles it is better to do without.
//!
//! * [`mask`](mod@mask): which texels mirror;
//! * [`sweep`](mod@sweep): timing in turns, on every backend;
//! * [`lacking`]: whole frames of scenes that lack something;
//! * [`fit`]: a line through times;
//! * [`model`]: what was found, as data;
//! * [`chart`], [`report`], [`table`](mod@table): the same for people.

#![forbid(unsafe_code)]

pub mod chart;
pub mod fit;
pub mod lacking;
pub mod mask;
pub mod model;
pub mod report;
pub mod sweep;
pub mod table;
