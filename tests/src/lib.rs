//! What the tests across backends share: executors, images compared, every
//! operation of WGSL with what it may give, and random programs.

#![forbid(unsafe_code)]

pub mod fuzz;
pub mod operations;
pub mod programs;

#[cfg(feature = "devices")]
use etalon::ash::{AshBackend, AshOptions, Validation};
use etalon::backend::{Backend, BackendError, CapturedData, Execution};
use etalon::graph::Graph;
use etalon::image::ImageData;
use etalon::kernel::{Arithmetic, KernelLibrary};
use etalon::plan::{Capture, Plan, PlanError, PlanOptions};

/// Whether `ETALON_REQUIRE` (a comma-separated list) names a backend: then its
/// absence is a failure and not a reason to skip.
#[must_use]
pub fn required(backend: &str) -> bool {
    std::env::var("ETALON_REQUIRE")
        .is_ok_and(|list| list.split(',').any(|name| name.trim() == backend))
}

/// The interpreter, wgpu on Vulkan, and Vulkan by ash, as far as there are
/// devices.
///
/// # Panics
/// If a backend that `ETALON_REQUIRE` names has no device.
#[must_use]
pub fn executors() -> Vec<Box<dyn Backend>> {
    let mut executors: Vec<Box<dyn Backend>> = Vec::new();
    let mut add = |name: &str, backend: Result<Box<dyn Backend>, BackendError>| match backend {
        Ok(backend) => executors.push(backend),
        Err(error) => {
            assert!(!required(name), "{name} is required: {error}");
            eprintln!("without {name}: {error}");
        }
    };
    add("cpu", cpu());
    #[cfg(feature = "devices")]
    {
        add("wgpu", wgpu());
        add("ash", ash());
    }
    executors
}

/// The interpreter.
///
/// # Errors
/// If it cannot be made.
pub fn cpu() -> Result<Box<dyn Backend>, BackendError> {
    Ok(Box::new(etalon::cpu::CpuBackend::new(
        &etalon::cpu::CpuOptions::default(),
    )?))
}

/// wgpu on the first Vulkan device.
///
/// # Errors
/// If there is none.
#[cfg(feature = "devices")]
pub fn wgpu() -> Result<Box<dyn Backend>, BackendError> {
    Ok(Box::new(etalon::wgpu::WgpuBackend::new(
        &etalon::wgpu::WgpuOptions::default(),
    )?))
}

/// ash on the first Vulkan device, under the validation layer where that is
/// installed: any message of it, hazards of synchronization included, is an
/// error of the execution.
///
/// # Errors
/// If there is no device, or no layer although `ETALON_REQUIRE` names
/// `validation`.
#[cfg(feature = "devices")]
pub fn ash() -> Result<Box<dyn Backend>, BackendError> {
    let with = |validation| {
        let options = AshOptions {
            validation,
            ..AshOptions::default()
        };
        Ok(Box::new(AshBackend::new(options)?) as Box<dyn Backend>)
    };
    match with(Validation::Synchronization) {
        Err(error) if !required("validation") => {
            eprintln!("without validation: {error}");
            with(Validation::Off)
        }
        result => result,
    }
}

/// Plans a graph for an executor.
///
/// # Errors
/// As [`Plan::new`].
pub fn plan_for(
    executor: &dyn Backend,
    graph: &Graph,
    kernels: &KernelLibrary,
    arithmetic: Arithmetic,
    capture: Capture,
) -> Result<Plan, PlanError> {
    let options = PlanOptions {
        arithmetic,
        limits: executor.limits(),
        capture,
        memory: executor.memory(),
    };
    Plan::new(graph, kernels, &options)
}

/// The first difference between two images beyond what flushing subnormal
/// numbers explains, in words.
#[must_use]
pub fn difference(a: &ImageData, b: &ImageData) -> Option<String> {
    if a.desc != b.desc {
        return Some(format!("{:?} against {:?}", a.desc, b.desc));
    }
    let format = a.desc.format;
    let size = format.texel_bytes() as usize;
    let texels = a
        .bytes
        .chunks_exact(size)
        .zip(b.bytes.chunks_exact(size))
        .enumerate();
    let mut differing = texels
        .filter(|(_, (a, b))| a != b && format.ulps(format.codes(a), format.codes(b)) != [0; 4]);
    let (index, (left, right)) = differing.next()?;
    let more = differing.count();
    let (x, y) = (
        index as u32 % a.desc.extent.width,
        index as u32 / a.desc.extent.width,
    );
    Some(format!(
        "texel ({x}, {y}) of {:?}: {:?} against {:?}, and {more} more",
        a.desc.extent,
        format.decode(left),
        format.decode(right)
    ))
}

/// The first difference between what two executions captured, in words.
#[must_use]
pub fn first_difference(a: &Execution, b: &Execution) -> Option<String> {
    if a.captures.len() != b.captures.len() {
        return Some(format!(
            "{} captures against {}",
            a.captures.len(),
            b.captures.len()
        ));
    }
    a.captures.iter().zip(&b.captures).find_map(|(a, b)| {
        let what = match (&a.data, &b.data) {
            (CapturedData::Texture(a), CapturedData::Texture(b)) => difference(a, b),
            (CapturedData::Buffer(a), CapturedData::Buffer(b)) => {
                (a != b).then(|| "buffers differ".to_owned())
            }
            _ => Some("a texture against a buffer".to_owned()),
        };
        what.map(|what| format!("pass `{}`, `{}`: {what}", a.pass, a.binding))
    })
}

/// How many channels of an image are infinite or NaN.
#[must_use]
pub fn non_finite(image: &ImageData) -> usize {
    let format = image.desc.format;
    let channels = 0..format.channels() as usize;
    let of_texel = |texel: &[u8]| {
        let codes = format.codes(texel);
        channels
            .clone()
            .filter(|&channel| format.is_non_finite(channel, codes.channels[channel]))
            .count()
    };
    image
        .bytes
        .chunks_exact(format.texel_bytes() as usize)
        .map(of_texel)
        .sum()
}
