//! Sweeps, their report, and the page in a browser.

mod browser;
mod flip;
mod made_up;
mod report;
mod sweep;
