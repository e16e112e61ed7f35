//! Light captured nearby: where rays leave rooms, what is lit and mirrored by it, and how
//! it is captured, against f64 and on every backend.

mod captured;
mod lit;
mod projection;
mod reflected;
mod room;
