//! The corpus of hard cases, the sanitiser's findings, and planted faults.

mod browser;
mod corpus;
mod planted;
mod sanitiser;
