//! Running operations on executors.

use etalon::backend::{Backend, BackendError, BackendInfo, CapturedData, Inputs};
use etalon::graph::{Graph, GraphError};
use etalon::kernel::{Arithmetic, KernelLibrary};
use etalon::plan::{Capture, PlanError};
use etalon::resource::BufferDesc;

use super::kernel;
use super::operation::Operation;

/// Why there are no results.
#[derive(Debug)]
#[non_exhaustive]
pub enum RunError {
    /// The graph contradicts itself.
    Graph(GraphError),
    /// The kernel does not compile, or cannot be planned.
    Plan(PlanError),
    /// The executor cannot run it.
    Backend(BackendError),
    /// The executor gave back something else than was asked for.
    Results,
}

impl RunError {
    /// The feature that the executor's device lacks and the kernel needs, if
    /// that is the reason.
    #[must_use]
    pub const fn lacking(&self) -> Option<&'static str> {
        match self {
            Self::Backend(BackendError::Lacking { feature, .. }) => Some(*feature),
            _ => None,
        }
    }
}

impl std::fmt::Display for RunError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Graph(error) => error.fmt(f),
            Self::Plan(error) => error.fmt(f),
            Self::Backend(error) => error.fmt(f),
            Self::Results => f.write_str("the executor did not give back the results"),
        }
    }
}

impl std::error::Error for RunError {}

/// The kernels of operations, each compiled when it is first run.
#[must_use]
pub fn library(operations: &[Operation]) -> KernelLibrary {
    let mut library = KernelLibrary::new();
    for (index, operation) in operations.iter().enumerate() {
        library.add_source(&path(index), &kernel::wgsl(operation));
    }
    library
}

fn path(index: usize) -> String {
    format!("operations/number_{index}")
}

/// The results of the operation at `index` on all its cases, as words in the
/// order of [`kernel::position`].
///
/// # Errors
/// If the executor cannot run it.
pub fn run(
    executor: &mut dyn Backend,
    kernels: &KernelLibrary,
    operations: &[Operation],
    index: usize,
    arithmetic: Arithmetic,
) -> Result<Vec<u32>, RunError> {
    let operation = &operations[index];
    let words = kernel::result_words(operation);
    let data = kernel::data(operation);
    let mut graph = Graph::new();
    let input = graph
        .import_buffer(
            "data",
            BufferDesc {
                bytes: data.len() as u64,
            },
        )
        .map_err(RunError::Graph)?;
    let result = graph.buffer(
        "result",
        BufferDesc {
            bytes: 4 * words as u64,
        },
    );
    let mut pass = graph.compute(path(index));
    for (name, is_read) in ["data", "halves"].into_iter().zip(kernel::reads(operation)) {
        if is_read {
            pass = pass.read_buffer(name, input);
        }
    }
    let written = pass
        .write_buffer("result", result)
        .groups([kernel::workgroups(operation), 1, 1])
        .and_then(|written| written.buffer("result"))
        .map_err(RunError::Graph)?;
    graph
        .output_buffer("result", written)
        .map_err(RunError::Graph)?;
    let plan = crate::plan_for(executor, &graph, kernels, arithmetic, Capture::Outputs)
        .map_err(RunError::Plan)?;
    let execution = executor
        .execute(&plan, &Inputs::new().buffer("data", &data))
        .map_err(RunError::Backend)?;
    match execution
        .captures
        .into_iter()
        .next()
        .map(|captured| captured.data)
    {
        Some(CapturedData::Buffer(bytes)) if bytes.len() == 4 * words => {
            // The upper halves are nobody's.
            let mask = if kernel::gives_halves(operation) {
                0xffff
            } else {
                u32::MAX
            };
            Ok(bytes
                .chunks_exact(4)
                .map(|word| u32::from_le_bytes([word[0], word[1], word[2], word[3]]) & mask)
                .collect())
        }
        _ => Err(RunError::Results),
    }
}

/// What exceptions call an executor: `cpu`, or its backend and its driver, as
/// in `ash/lavapipe`.
#[must_use]
pub fn executor_name(info: &BackendInfo) -> String {
    if info.backend == "cpu" {
        return "cpu".to_owned();
    }
    let driver = if info.device.contains("llvmpipe") {
        "lavapipe".to_owned()
    } else if info.device.contains("SwiftShader") {
        "swiftshader".to_owned()
    } else {
        info.device.to_lowercase().replace([' ', ';'], "-")
    };
    format!("{}/{driver}", info.backend)
}
