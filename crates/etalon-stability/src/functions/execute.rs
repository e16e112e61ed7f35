//! A kernel around a function, and what it stores.

use etalon_core::Format;
use etalon_core::backend::Inputs;
use etalon_core::graph::{Graph, GraphError};
use etalon_core::image::{ImageData, ImageError};
use etalon_core::kernel::{Arithmetic, KernelLibrary};
use etalon_core::plan::{Capture, Plan, PlanError, PlanOptions};
use etalon_core::resource::TextureDesc;
use thiserror::Error;

use super::table::{Function, Given};
use super::truth::{PICTURE, PICTURE_SIZE, camera};
use crate::executors::Executor;
use crate::observe::{ObserveError, Store};

/// Why a function was not run.
#[derive(Debug, Error)]
pub(super) enum FunctionError {
    #[error(transparent)]
    Image(#[from] ImageError),
    #[error(transparent)]
    Graph(#[from] GraphError),
    #[error(transparent)]
    Plan(#[from] PlanError),
    #[error(transparent)]
    Observe(#[from] ObserveError),
}

impl Function {
    pub(super) fn path(&self) -> String {
        format!("functions/{}", self.name)
    }

    pub(super) fn kernel(&self) -> String {
        let Self {
            name, module, call, ..
        } = self;
        let given = self.given.declared();
        format!(
            "import package::lib::{module}::{name};
{given}
@group(0) @binding(0) var source: texture_2d<f32>;
@group(0) @binding(1) var result: texture_storage_2d<rgba32float, write>;

@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {{
    let extent = textureDimensions(result);
    if (id.x >= extent.x || id.y >= extent.y) {{
        return;
    }}
    let v = textureLoad(source, id.xy, 0);
    textureStore(result, id.xy, {call});
}}
"
        )
    }

    pub(super) fn run(
        &self,
        executor: &mut Executor,
        kernels: &KernelLibrary,
        arguments: &[[f32; 4]],
        desc: TextureDesc,
    ) -> Result<Store, FunctionError> {
        let arguments = &ImageData::from_rgba_f32(desc, arguments)?;
        let [width, height] = PICTURE_SIZE;
        let wide = |width, height| TextureDesc::d2(width, height, Format::Rgba32Float);
        let picture = ImageData::from_rgba_f32(wide(width, height), &PICTURE)?;
        let mut graph = Graph::new();
        let source = graph.import_texture("arguments", arguments.desc)?;
        let extent = arguments.desc.extent;
        let result = graph.texture("result", wide(extent.width, extent.height));
        let mut inputs = Inputs::new().texture("arguments", arguments);
        let given = match self.given {
            Given::Picture => {
                inputs = inputs.texture("picture", &picture);
                Some(graph.import_texture("picture", picture.desc)?)
            }
            _ => None,
        };
        let mut pass = graph
            .compute(self.path())
            .read("source", source)
            .write("result", result);
        if let Some(picture) = given {
            pass = pass.read("picture", picture);
        }
        if self.given == Given::Camera {
            let camera = camera();
            pass = pass
                .set("scale", camera.scale)
                .set("centre", camera.centre)
                .set("depth", camera.depth_bias_slope())
                .set("range", camera.distance_range());
        }
        let result = pass.per_texel("result")?;
        graph.output("result", result)?;
        let plan = Plan::new(
            &graph,
            kernels,
            &PlanOptions {
                arithmetic: Arithmetic::Strict,
                limits: executor.backend().limits(),
                capture: Capture::Outputs,
                memory: executor.backend().memory(),
            },
        )?;
        let mut stores = executor.run(&plan, &inputs)?;
        Ok(stores.pop().unwrap_or_default())
    }
}
