//! A device, what it can do, and calls into it that cannot panic.

use std::collections::BTreeMap;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

use etalon_core::Format;
use etalon_core::backend::{BackendError, BackendInfo};
use etalon_core::format::StorageSupport;
use etalon_core::resource::{Limits, TextureDesc};

use crate::convert;
use crate::fault::Fault;
use crate::probe;
use crate::tally::{Owned, Tally};

/// Why the device was lost, once it is.
type Loss = Arc<OnceLock<String>>;

/// A device and what it can do.
#[derive(Debug)]
pub(crate) struct Gpu {
    pub(crate) device: wgpu::Device,
    pub(crate) queue: wgpu::Queue,
    pub(crate) tally: Arc<Tally>,
    info: BackendInfo,
    api: wgpu::Backend,
    features: wgpu::Features,
    limits: wgpu::Limits,
    downlevel: wgpu::DownlevelFlags,
    /// In the order of [`Format::ALL`].
    formats: Vec<Option<wgpu::TextureFormatFeatures>>,
    /// Formats tried out so far, on OpenGL.
    copied: Mutex<BTreeMap<Format, bool>>,
    lost: Loss,
    /// Errors outside of any scope: a driver's that come late.
    stray: Arc<Mutex<Vec<String>>>,
}

/// What a tool wants to know of an adapter.
pub(crate) fn info_of(info: &wgpu::AdapterInfo) -> BackendInfo {
    let driver = format!("{} {}", info.driver, info.driver_info);
    BackendInfo {
        backend: "wgpu",
        api: info.backend.to_string(),
        device: info.name.clone(),
        driver: driver.trim().to_owned(),
    }
}

impl Gpu {
    /// Takes note of what a device can do. Without its adapter it is taken to
    /// have what WebGPU guarantees.
    pub(crate) fn new(
        device: wgpu::Device,
        queue: wgpu::Queue,
        adapter: Option<&wgpu::Adapter>,
    ) -> Self {
        let raw = device.adapter_info();
        let features = device.features();
        let downlevel = adapter.map_or_else(
            || match raw.backend {
                wgpu::Backend::Gl => {
                    wgpu::DownlevelFlags::COMPUTE_SHADERS | wgpu::DownlevelFlags::INDIRECT_EXECUTION
                }
                _ => wgpu::DownlevelFlags::compliant(),
            },
            |adapter| adapter.get_downlevel_capabilities().flags,
        );
        // The same choice that wgpu makes when it checks a texture.
        let specific = features.contains(wgpu::Features::TEXTURE_ADAPTER_SPECIFIC_FORMAT_FEATURES)
            || !downlevel.contains(wgpu::DownlevelFlags::WEBGPU_TEXTURE_FORMAT_SUPPORT);
        let support = |format: &Format| {
            let format = convert::format(*format)?;
            Some(match adapter {
                Some(adapter) if specific => adapter.get_texture_format_features(format),
                _ => format.guaranteed_format_features(features),
            })
        };
        Self {
            info: info_of(&raw),
            api: raw.backend,
            features,
            limits: device.limits(),
            downlevel,
            formats: Format::ALL.iter().map(support).collect(),
            copied: Mutex::default(),
            lost: Loss::default(),
            stray: Arc::default(),
            tally: Arc::default(),
            device,
            queue,
        }
    }

    /// Listens for the loss of the device and for errors outside of scopes. Not
    /// for an engine's device, whose callbacks are the engine's.
    pub(crate) fn watch(&self) {
        let lost = self.lost.clone();
        self.device
            .set_device_lost_callback(move |reason, message| {
                // Only the first reason counts.
                let _ = lost.set(format!("{reason:?}: {message}"));
            });
        let stray = self.stray.clone();
        self.device
            .on_uncaptured_error(Arc::new(move |error: wgpu::Error| {
                stray
                    .lock()
                    .unwrap_or_else(PoisonError::into_inner)
                    .push(error.to_string());
            }));
    }

    pub(crate) fn info(&self) -> &BackendInfo {
        &self.info
    }

    pub(crate) fn raw_limits(&self) -> &wgpu::Limits {
        &self.limits
    }

    pub(crate) fn has(&self, flags: wgpu::DownlevelFlags) -> bool {
        self.downlevel.contains(flags)
    }

    /// Whether this is OpenGL, which knows neither views nor readable formats
    /// as WebGPU does.
    pub(crate) fn is_gl(&self) -> bool {
        self.api == wgpu::Backend::Gl
    }

    /// Whether SPIR-V is handed through.
    pub(crate) fn passes_spirv(&self) -> bool {
        self.api == wgpu::Backend::Vulkan
            && self.features.contains(wgpu::Features::PASSTHROUGH_SHADERS)
    }

    /// Whether kernels may have `f16`, in buffers too.
    pub(crate) fn computes_f16(&self) -> bool {
        self.features.contains(wgpu::Features::SHADER_F16)
    }

    /// Whether the records of indirect draws may begin at any instance.
    pub(crate) fn draws_first_instances(&self) -> bool {
        self.features
            .contains(wgpu::Features::INDIRECT_FIRST_INSTANCE)
    }

    /// Whether the device's own clock tells the time around any command.
    pub(crate) fn tells_time(&self) -> bool {
        let queries =
            wgpu::Features::TIMESTAMP_QUERY | wgpu::Features::TIMESTAMP_QUERY_INSIDE_ENCODERS;
        self.features.contains(queries)
            && self.device.adapter_info().device_type != wgpu::DeviceType::Cpu
    }

    /// Runs what an encoder has recorded so far and waits for it; the encoder
    /// begins anew. What goes wrong shows in the error scope or the next wait.
    pub(crate) fn flush(&self, encoder: &mut wgpu::CommandEncoder) {
        let next = self
            .device
            .create_command_encoder(&wgpu::CommandEncoderDescriptor {
                label: Some("etalon"),
            });
        let recorded = std::mem::replace(encoder, next);
        self.queue.submit([recorded.finish()]);
        let _ = self.wait();
    }

    /// The loss of the device, if it has been noticed.
    pub(crate) fn lost(&self) -> Option<Fault> {
        self.lost.get().map(|reason| Fault::Lost(reason.clone()))
    }

    /// Errors that came outside of any scope since the last call.
    pub(crate) fn stray_errors(&self) -> Vec<String> {
        std::mem::take(&mut self.stray.lock().unwrap_or_else(PoisonError::into_inner))
    }

    /// How wgpu calls a format and what the device can do with it.
    pub(crate) fn format(
        &self,
        format: Format,
    ) -> Option<(wgpu::TextureFormat, wgpu::TextureFormatFeatures)> {
        let index = Format::ALL.iter().position(|other| *other == format)?;
        Some((
            convert::format(format)?,
            *self.formats.get(index)?.as_ref()?,
        ))
    }

    /// Whether textures of a format that can be copied from really are.
    pub(crate) fn copies(&self, format: Format) -> bool {
        if !self.is_gl() {
            return true;
        }
        let known = || self.copied.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(copies) = known().get(&format) {
            return *copies;
        }
        let copies = probe::copies(self, format);
        known().insert(format, copies);
        copies
    }

    /// What planning must know.
    pub(crate) fn limits(&self) -> Limits {
        let limits = &self.limits;
        let stores = |format: &Format| {
            // Blue-first textures have a feature of their own and stay an
            // exception that a step may run into.
            format.storage() != StorageSupport::Extended
                || *format == Format::Bgra8Unorm
                || self.format(*format).is_some_and(|(_, features)| {
                    features
                        .flags
                        .contains(wgpu::TextureFormatFeatureFlags::STORAGE_WRITE_ONLY)
                })
        };
        Limits {
            max_texture_2d: limits.max_texture_dimension_2d,
            max_texture_3d: limits.max_texture_dimension_3d,
            max_texture_layers: limits.max_texture_array_layers,
            // wgpu has no limit of its own; what does not fit into a buffer
            // could neither be filled nor read back.
            max_texture_bytes: limits.max_buffer_size,
            max_buffer_bytes: limits
                .max_buffer_size
                .min(limits.max_storage_buffer_binding_size),
            max_workgroups: limits.max_compute_workgroups_per_dimension,
            max_workgroup_invocations: limits.max_compute_invocations_per_workgroup,
            max_workgroup_bytes: limits.max_compute_workgroup_storage_size,
            uniform_alignment: limits.min_uniform_buffer_offset_alignment.max(16),
            extended_storage_formats: Format::ALL.iter().all(stores),
        }
    }

    /// Runs calls into wgpu and catches whatever error they report.
    pub(crate) fn guarded<T>(&self, calls: impl FnOnce() -> T) -> Result<T, Fault> {
        if let Some(lost) = self.lost() {
            return Err(lost);
        }
        let scopes = [
            wgpu::ErrorFilter::OutOfMemory,
            wgpu::ErrorFilter::Validation,
            wgpu::ErrorFilter::Internal,
        ]
        .map(|filter| self.device.push_error_scope(filter));
        let result = calls();
        // Scopes nest, so the last is popped first.
        let [memory, validation, internal] = scopes;
        let popped = [internal, validation, memory].map(|scope| pollster::block_on(scope.pop()));
        if let Some(lost) = self.lost() {
            return Err(lost);
        }
        match popped.into_iter().flatten().next() {
            Some(error) => Err(error.into()),
            None => Ok(result),
        }
    }

    /// Waits until everything submitted has run and its callbacks were called.
    pub(crate) fn wait(&self) -> Result<(), BackendError> {
        if let Some(lost) = self.lost() {
            return Err(lost.of("poll", "the device", 0));
        }
        // wgpu panics when a device is lost while it waits, and has no other
        // way of saying so; nothing of ours is half changed by then.
        let polled = catch_unwind(AssertUnwindSafe(|| {
            self.device.poll(wgpu::PollType::wait_indefinitely())
        }));
        match polled {
            Ok(Ok(_)) => match self.lost() {
                Some(lost) => Err(lost.of("poll", "the device", 0)),
                None => Ok(()),
            },
            Ok(Err(error)) => Err(BackendError::Api {
                call: "poll",
                reason: error.to_string(),
            }),
            Err(_) => {
                let reason = "the driver lost it while it was waited for".to_owned();
                let _ = self.lost.set(reason.clone());
                Err(BackendError::DeviceLost { reason })
            }
        }
    }

    /// A texture of our own. The description must have been checked.
    pub(crate) fn texture(
        &self,
        label: &str,
        desc: &TextureDesc,
        format: wgpu::TextureFormat,
        usage: wgpu::TextureUsages,
    ) -> Result<Owned<wgpu::Texture>, BackendError> {
        let bytes = desc.bytes().unwrap_or(u64::MAX);
        let texture = self
            .guarded(|| {
                self.device.create_texture(&wgpu::TextureDescriptor {
                    label: Some(label),
                    size: convert::extent(desc, 0),
                    mip_level_count: desc.mips,
                    sample_count: 1,
                    dimension: convert::texture_dimension(desc.dimension),
                    format,
                    usage,
                    view_formats: &[],
                })
            })
            .map_err(|fault| fault.of("create_texture", label, bytes))?;
        self.tally.textures.add(1);
        Ok(Owned::new(texture, bytes, &self.tally))
    }

    /// A buffer of our own, `bytes` rounded up to a multiple of 4. With
    /// `contents` it is filled with those, repeated.
    pub(crate) fn buffer(
        &self,
        label: &str,
        bytes: u64,
        usage: wgpu::BufferUsages,
        contents: Option<&[u8]>,
    ) -> Result<Owned<wgpu::Buffer>, BackendError> {
        let fault = |fault: Fault| fault.of("create_buffer", label, bytes);
        let size = match bytes.max(4).checked_next_multiple_of(4) {
            Some(size) if size <= self.limits.max_buffer_size => size,
            _ => return Err(fault(Fault::Memory)),
        };
        let buffer = self
            .guarded(|| {
                let buffer = self.device.create_buffer(&wgpu::BufferDescriptor {
                    label: Some(label),
                    size,
                    usage,
                    mapped_at_creation: contents.is_some(),
                });
                if let Some(contents) = contents.filter(|contents| !contents.is_empty()) {
                    // If the creation failed there is nothing to fill, and the
                    // scope knows why.
                    if let Ok(mut view) = buffer.get_mapped_range_mut(..) {
                        let (mut at, end) = (0, view.len());
                        while at < end {
                            let count = contents.len().min(end - at);
                            view.slice(at..at + count)
                                .copy_from_slice(&contents[..count]);
                            at += count;
                        }
                    }
                    buffer.unmap();
                }
                buffer
            })
            .map_err(fault)?;
        self.tally.buffers.add(1);
        Ok(Owned::new(buffer, size, &self.tally))
    }
}
