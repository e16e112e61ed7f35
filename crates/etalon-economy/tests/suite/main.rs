//! What is measured, and how it is shown.

mod arguments;
mod browser;
mod made_up;
mod report;
mod sweep;
