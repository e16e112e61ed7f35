//! From Vulkan's result codes to [`BackendError`].

use ash::vk;
use etalon_core::backend::BackendError;
use gpu_allocator::AllocationError;

/// The name this backend goes by in errors and reports.
pub(crate) const NAME: &str = "ash";

/// What a failed call means. For calls that allocate a known number of bytes
/// use [`refused`].
pub(crate) fn failed(call: &'static str) -> impl Fn(vk::Result) -> BackendError {
    move |result| match result {
        vk::Result::ERROR_OUT_OF_HOST_MEMORY
        | vk::Result::ERROR_OUT_OF_DEVICE_MEMORY
        | vk::Result::ERROR_OUT_OF_POOL_MEMORY => BackendError::OutOfMemory {
            what: format!("what {call} needs"),
            bytes: 0,
        },
        vk::Result::ERROR_DEVICE_LOST => BackendError::DeviceLost {
            reason: format!("{call}: {result}"),
        },
        _ => BackendError::Api {
            call,
            reason: result.to_string(),
        },
    }
}

/// What a failed creation of something of a known size means.
pub(crate) fn refused(
    call: &'static str,
    what: &str,
    bytes: u64,
) -> impl Fn(vk::Result) -> BackendError {
    move |result| match failed(call)(result) {
        BackendError::OutOfMemory { .. } => BackendError::OutOfMemory {
            what: what.to_owned(),
            bytes,
        },
        other => other,
    }
}

/// What a failed allocation of memory means.
pub(crate) fn unallocated(what: &str, bytes: u64) -> impl Fn(AllocationError) -> BackendError {
    move |error| match error {
        AllocationError::OutOfMemory => BackendError::OutOfMemory {
            what: what.to_owned(),
            bytes,
        },
        other => BackendError::Api {
            call: "vkAllocateMemory",
            reason: format!("{other}, for {what}"),
        },
    }
}

/// No device, and why.
pub(crate) fn no_device(reason: impl Into<String>) -> BackendError {
    BackendError::NoDevice {
        backend: NAME,
        reason: reason.into(),
    }
}

/// A plan that contradicts itself. Planning makes none; a plan is plain data
/// that can be changed afterwards.
pub(crate) fn malformed(reason: impl Into<String>) -> BackendError {
    BackendError::Api {
        call: "checking the plan",
        reason: reason.into(),
    }
}

/// A step that this device cannot run.
pub(crate) fn unsupported(step: &str, what: impl Into<String>) -> BackendError {
    BackendError::Unsupported {
        step: step.to_owned(),
        what: what.into(),
    }
}
