//! Tests of the whole way from text to kernel.

mod compile;
mod embedded;
mod half;
mod interface;
mod places;
mod raster;
mod refusals;
#[cfg(feature = "spirv")]
mod spirv;
mod strict;

use std::sync::Arc;

use super::*;

/// A library with files of the given paths and texts.
fn library(files: &[(&str, &str)]) -> KernelLibrary {
    let mut library = KernelLibrary::new();
    for (path, text) in files {
        library.add_source(path, text);
    }
    library
}

/// Compiles one file that needs no others.
fn compile_one(text: &str, arithmetic: Arithmetic) -> Result<Arc<Kernel>, KernelError> {
    library(&[("test/one", text)]).get(&KernelRequest::new("test/one"), arithmetic)
}

/// The function of the one entry point of a compute kernel.
fn main(kernel: &Kernel) -> &naga::Function {
    &kernel.module.entry_points[0].function
}

/// The error of a file that has one, under fast arithmetic.
fn error_of(text: &str) -> KernelError {
    match compile_one(text, Arithmetic::Fast) {
        Err(error) => error,
        Ok(kernel) => panic!("compiles:\n{}", kernel.wgsl),
    }
}

/// A kernel that writes `expression`, of type `f32`, with `x` a value only
/// known at run time, `v` a vector, `m` a matrix and `i` an integer of such
/// values.
fn evaluating(expression: &str) -> String {
    format!(
        "struct In {{ x: f32, i: i32, u: u32, v: vec4f, m: mat4x4f }}
         @group(0) @binding(0) var<uniform> input: In;
         @group(0) @binding(1) var<storage, read_write> output: array<f32>;
         @group(0) @binding(2) var image: texture_2d<f32>;
         @group(0) @binding(3) var filter_: sampler;
         @compute @workgroup_size(1) fn main() {{
             let x = input.x; let v = input.v; let m = input.m;
             let i = input.i; let u = input.u;
             output[0] = {expression};
         }}"
    )
}
