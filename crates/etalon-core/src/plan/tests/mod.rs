//! Tests of planning. The random-graph tests hold whole plans against models
//! written independently of the phases.

mod bind;
mod count;
mod independence;
mod part;
mod random;
mod raster;
mod shape;

use crate::Format;
use crate::kernel::{Arithmetic, KernelLibrary};
use crate::plan::{Capture, Plan, PlanError, PlanOptions};
use crate::{graph::Graph, resource::TextureDesc};

pub(super) const R32: TextureDesc = TextureDesc::d2(16, 16, Format::R32Float);

/// Kernels that read 0 to 3 textures and write, or update, one.
pub(super) fn library() -> KernelLibrary {
    let mut library = KernelLibrary::new();
    for reads in 0..4_u32 {
        for (kind, access) in [("write", "write"), ("update", "read_write")] {
            let mut source = String::new();
            for read in 0..reads {
                source += &format!("@group(0) @binding({read}) var in{read}: texture_2d<f32>;\n");
            }
            source += &format!(
                "@group(0) @binding(9) var result: texture_storage_2d<r32float, {access}>;\n\
                 @compute @workgroup_size(8, 8) fn main(@builtin(global_invocation_id) id: vec3<u32>) {{\n\
                 var sum = 0.0;\n"
            );
            for read in 0..reads {
                source += &format!("sum = sum + textureLoad(in{read}, id.xy, 0).x;\n");
            }
            if kind == "update" {
                source += "sum = sum + textureLoad(result, id.xy).x;\n";
            }
            source += "textureStore(result, id.xy, vec4f(sum)); }\n";
            library.add_source(&format!("test/{kind}{reads}"), &source);
        }
    }
    library
}

pub(super) fn plan_with(
    graph: &Graph,
    library: &KernelLibrary,
    capture: Capture,
) -> Result<Plan, PlanError> {
    let options = PlanOptions {
        arithmetic: Arithmetic::Strict,
        capture,
        ..PlanOptions::default()
    };
    Plan::new(graph, library, &options)
}

pub(super) fn plan(graph: &Graph) -> Result<Plan, PlanError> {
    plan_with(graph, &library(), Capture::None)
}
