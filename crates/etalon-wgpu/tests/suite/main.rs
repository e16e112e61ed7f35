//! Plans on devices: Vulkan with SPIR-V handed through, Vulkan with kernels
//! translated by wgpu, and OpenGL.
//!
//! Without a Vulkan driver the tests that need one say so and pass, unless the
//! environment variable `ETALON_REQUIRE` lists `wgpu`. `VK_DRIVER_FILES`
//! chooses the driver.

mod common;
mod engine;
mod frames;
mod kernels;
mod raster;
mod refusals;
mod transfers;
mod views;
