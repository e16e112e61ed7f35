//! What the Khronos validation layer has to say.

use std::ffi::{CStr, c_void};
use std::fmt;
use std::sync::{Mutex, PoisonError};

use ash::vk;

/// How much the validation layer checks.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Validation {
    /// Nothing; the layer is not loaded.
    #[default]
    Off,
    /// Use of the API.
    Core,
    /// Use of the API, and hazards between commands: whether every barrier
    /// that is needed is there.
    Synchronization,
}

/// One message of the validation layer.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ValidationMessage {
    /// Whether it is an error; otherwise a warning.
    pub error: bool,
    /// The rule, e.g. `SYNC-HAZARD-READ-AFTER-WRITE` or a `VUID-…`.
    pub rule: String,
    /// What the layer says.
    pub text: String,
}

impl fmt::Display for ValidationMessage {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let severity = if self.error { "error" } else { "warning" };
        write!(f, "{severity} {}: {}", self.rule, self.text)
    }
}

/// Messages collected since a backend was made. It outlives the backend, so
/// that what the layer says about leaks at the very end is not lost.
#[derive(Debug, Default)]
pub struct ValidationLog {
    messages: Mutex<Vec<ValidationMessage>>,
}

impl ValidationLog {
    /// All messages so far.
    #[must_use]
    pub fn messages(&self) -> Vec<ValidationMessage> {
        self.lock().clone()
    }

    /// How many messages there are so far.
    #[must_use]
    pub fn len(&self) -> usize {
        self.lock().len()
    }

    /// Whether there is none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.lock().is_empty()
    }

    /// All messages so far, which are forgotten.
    pub fn take(&self) -> Vec<ValidationMessage> {
        std::mem::take(&mut *self.lock())
    }

    fn lock(&self) -> std::sync::MutexGuard<'_, Vec<ValidationMessage>> {
        // Pushing and taking leave nothing half-done.
        self.messages.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// What a messenger needs to know to write into a log.
///
/// The caller keeps the log alive for as long as the messenger, or the
/// instance made with it, exists.
pub(crate) fn messenger(log: &ValidationLog) -> vk::DebugUtilsMessengerCreateInfoEXT<'_> {
    use vk::{
        DebugUtilsMessageSeverityFlagsEXT as Severity, DebugUtilsMessageTypeFlagsEXT as Type,
    };
    vk::DebugUtilsMessengerCreateInfoEXT::default()
        .message_severity(Severity::WARNING | Severity::ERROR)
        // General messages are the loader's, about drivers this process does not use.
        .message_type(Type::VALIDATION | Type::PERFORMANCE)
        .pfn_user_callback(Some(receive))
        .user_data(std::ptr::from_ref(log).cast_mut().cast())
}

/// Called by the layer, on whatever thread made the call it complains about.
unsafe extern "system" fn receive(
    severity: vk::DebugUtilsMessageSeverityFlagsEXT,
    _: vk::DebugUtilsMessageTypeFlagsEXT,
    data: *const vk::DebugUtilsMessengerCallbackDataEXT<'_>,
    user: *mut c_void,
) -> vk::Bool32 {
    // SAFETY: the layer passes a pointer to a structure that lives during the
    // call (Vulkan §4.1, PFN_vkDebugUtilsMessengerCallbackEXT), or null.
    let Some(data) = (unsafe { data.as_ref() }) else {
        return vk::FALSE;
    };
    // SAFETY: `messenger` set this pointer, from a reference to a log that its
    // caller keeps alive; the log's methods take `&self` and lock.
    let Some(log) = (unsafe { user.cast::<ValidationLog>().as_ref() }) else {
        return vk::FALSE;
    };
    let text = |pointer: *const std::ffi::c_char| {
        if pointer.is_null() {
            String::new()
        } else {
            // SAFETY: not null, so a string that ends with a NUL and lives
            // during the call.
            unsafe { CStr::from_ptr(pointer) }
                .to_string_lossy()
                .into_owned()
        }
    };
    log.lock().push(ValidationMessage {
        error: severity.contains(vk::DebugUtilsMessageSeverityFlagsEXT::ERROR),
        rule: text(data.p_message_id_name),
        text: text(data.p_message),
    });
    // The call that is complained about goes on (the specification reserves
    // any other answer for layer development).
    vk::FALSE
}
