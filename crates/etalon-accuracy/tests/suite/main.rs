//! Sweeps, their report, and the page in a browser.

mod browser;
mod made_up;
mod report;
mod sweep;
