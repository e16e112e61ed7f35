//! The Vulkan instance: loader, layers and messenger.

use std::ffi::CStr;
use std::sync::Arc;

use ash::{ext, khr, vk};
use etalon_core::backend::BackendError;

use crate::error::{failed, no_device};
use crate::validation::{self, Validation, ValidationLog};

/// The newest version this backend uses, and the oldest it runs on.
pub(crate) const VERSION: u32 = vk::API_VERSION_1_3;

const LAYER: &CStr = c"VK_LAYER_KHRONOS_validation";

/// An instance of our own, or an engine's.
pub(crate) struct Instance {
    pub(crate) raw: ash::Instance,
    /// Whether `VK_EXT_debug_utils` may be used for names and labels.
    pub(crate) debug_utils: bool,
    pub(crate) log: Option<Arc<ValidationLog>>,
    /// Present if the instance is ours to destroy.
    owned: Option<Owned>,
}

struct Owned {
    messenger: Option<(ext::debug_utils::Instance, vk::DebugUtilsMessengerEXT)>,
    /// Keeps the loader's library open.
    _entry: ash::Entry,
}

impl Instance {
    /// An instance of our own.
    pub(crate) fn new(validation: Validation) -> Result<Self, BackendError> {
        // SAFETY: loading the Vulkan loader runs its initialisers, which have
        // no preconditions.
        let entry = unsafe { ash::Entry::load() }.map_err(|error| {
            no_device(format!("there is no Vulkan loader to load ({error}); install one, such as the package `libvulkan1`"))
        })?;
        // SAFETY: no preconditions.
        let version = unsafe { entry.try_enumerate_instance_version() }
            .map_err(failed("vkEnumerateInstanceVersion"))?
            .unwrap_or(vk::API_VERSION_1_0);
        if version < VERSION {
            return Err(no_device(format!(
                "the Vulkan loader is of version {}, this backend needs 1.3",
                version_text(version)
            )));
        }
        let extensions = offered(&entry, None)?;
        let has = |list: &[vk::ExtensionProperties], name: &CStr| {
            list.iter()
                .any(|extension| extension.extension_name_as_c_str() == Ok(name))
        };
        let mut layers = Vec::new();
        let mut enabled = Vec::new();
        let mut debug_utils = has(&extensions, ext::debug_utils::NAME);
        let log = match validation {
            Validation::Off => None,
            Validation::Core | Validation::Synchronization => {
                let of_layer = layer_extensions(&entry)?;
                if validation == Validation::Synchronization {
                    if !has(&of_layer, ext::validation_features::NAME) {
                        return Err(no_device(
                            "the validation layer offers no VK_EXT_validation_features, by which synchronization validation is switched on",
                        ));
                    }
                    enabled.push(ext::validation_features::NAME.as_ptr());
                }
                debug_utils |= has(&of_layer, ext::debug_utils::NAME);
                layers.push(LAYER.as_ptr());
                Some(Arc::new(ValidationLog::default()))
            }
        };
        if debug_utils {
            enabled.push(ext::debug_utils::NAME.as_ptr());
        } else if log.is_some() {
            return Err(no_device(
                "VK_EXT_debug_utils is missing, by which the validation layer reports",
            ));
        }
        let mut flags = vk::InstanceCreateFlags::empty();
        if has(&extensions, khr::portability_enumeration::NAME) {
            enabled.push(khr::portability_enumeration::NAME.as_ptr());
            flags |= vk::InstanceCreateFlags::ENUMERATE_PORTABILITY_KHR;
        }
        let application = vk::ApplicationInfo::default()
            .application_name(c"etalon")
            .engine_name(c"etalon")
            .api_version(VERSION);
        let mut info = vk::InstanceCreateInfo::default()
            .flags(flags)
            .application_info(&application)
            .enabled_layer_names(&layers)
            .enabled_extension_names(&enabled);
        let checks = [vk::ValidationFeatureEnableEXT::SYNCHRONIZATION_VALIDATION];
        let mut features =
            vk::ValidationFeaturesEXT::default().enabled_validation_features(&checks);
        if validation == Validation::Synchronization {
            info = info.push_next(&mut features);
        }
        let mut messenger_info;
        if let Some(log) = &log {
            // Also hears what is said while the instance is made and destroyed.
            messenger_info = validation::messenger(log);
            info = info.push_next(&mut messenger_info);
        }
        // SAFETY: layers and extensions are offered, the structures chained
        // live until the call returns, and the log lives as long as the
        // instance: both are fields of `Instance`, whose `drop` destroys the
        // latter first.
        let raw = unsafe { entry.create_instance(&info, None) }.map_err(|result| match result {
            vk::Result::ERROR_INCOMPATIBLE_DRIVER => {
                no_device("the loader finds no driver; install one, or check VK_DRIVER_FILES")
            }
            other => failed("vkCreateInstance")(other),
        })?;
        let mut instance = Self {
            raw,
            debug_utils,
            log,
            owned: None,
        };
        let mut messenger = None;
        if let Some(log) = &instance.log {
            let utils = ext::debug_utils::Instance::new(&entry, &instance.raw);
            // SAFETY: the extension is enabled; the log outlives the messenger,
            // which `drop` destroys before the log goes.
            let created =
                unsafe { utils.create_debug_utils_messenger(&validation::messenger(log), None) };
            match created {
                Ok(handle) => messenger = Some((utils, handle)),
                Err(result) => {
                    instance.owned = Some(Owned {
                        messenger: None,
                        _entry: entry,
                    });
                    return Err(failed("vkCreateDebugUtilsMessengerEXT")(result));
                }
            }
        }
        instance.owned = Some(Owned {
            messenger,
            _entry: entry,
        });
        Ok(instance)
    }

    /// An engine's instance, which stays the engine's.
    pub(crate) fn adopted(raw: ash::Instance, debug_utils: bool) -> Self {
        Self {
            raw,
            debug_utils,
            log: None,
            owned: None,
        }
    }
}

impl Drop for Instance {
    fn drop(&mut self) {
        let Some(owned) = self.owned.take() else {
            return;
        };
        if let Some((utils, messenger)) = owned.messenger {
            // SAFETY: made from this instance, destroyed once, and no other
            // thread has it.
            unsafe { utils.destroy_debug_utils_messenger(messenger, None) };
        }
        // SAFETY: whatever was made from the instance holds an `Arc` of what
        // holds this, so it is gone.
        unsafe { self.raw.destroy_instance(None) };
    }
}

/// The extensions a layer offers, or the loader and its drivers.
fn offered(
    entry: &ash::Entry,
    layer: Option<&CStr>,
) -> Result<Vec<vk::ExtensionProperties>, BackendError> {
    // SAFETY: the layer's name, if any, is a string that ends with a NUL.
    unsafe { entry.enumerate_instance_extension_properties(layer) }
        .map_err(failed("vkEnumerateInstanceExtensionProperties"))
}

/// The extensions of the validation layer, if it is installed.
fn layer_extensions(entry: &ash::Entry) -> Result<Vec<vk::ExtensionProperties>, BackendError> {
    // SAFETY: no preconditions.
    let layers = unsafe { entry.enumerate_instance_layer_properties() }
        .map_err(failed("vkEnumerateInstanceLayerProperties"))?;
    if !layers
        .iter()
        .any(|layer| layer.layer_name_as_c_str() == Ok(LAYER))
    {
        return Err(no_device(
            "the Khronos validation layer is not installed; install it, such as the package `vulkan-validationlayers`, or switch validation off",
        ));
    }
    offered(entry, Some(LAYER))
}

/// `1.3.239`
pub(crate) fn version_text(version: u32) -> String {
    format!(
        "{}.{}.{}",
        vk::api_version_major(version),
        vk::api_version_minor(version),
        vk::api_version_patch(version)
    )
}
