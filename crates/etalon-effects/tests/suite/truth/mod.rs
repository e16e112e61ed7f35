//! The truths of the effects against closed forms and brute force.

mod bloom;
mod composite;
mod exposure;
mod ssr;
mod ssr_kernel;
