//! Images and views of them.

use std::collections::HashMap;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

use ash::vk;
use etalon_core::backend::BackendError;
use etalon_core::graph::Subresources;
use etalon_core::resource::{Dimension, TextureDesc};
use gpu_allocator::MemoryLocation;
use gpu_allocator::vulkan::AllocationScheme;

use crate::convert;
use crate::device::{Device, Remains, count};
use crate::error::{failed, refused};
use crate::memory::{Memory, Requirements};

/// A number that no other image or buffer of this process ever has, unlike a
/// Vulkan handle.
pub(crate) fn unique_id() -> u64 {
    static NEXT: AtomicU64 = AtomicU64::new(1);
    NEXT.fetch_add(1, Ordering::Relaxed)
}

/// An image, ours or an engine's, with the views of it made so far.
pub(crate) struct Image {
    pub(crate) id: u64,
    pub(crate) raw: vk::Image,
    pub(crate) desc: TextureDesc,
    pub(crate) usage: vk::ImageUsageFlags,
    device: Arc<Device>,
    views: Mutex<HashMap<(Subresources, vk::ImageViewType), vk::ImageView>>,
    /// What it is bound to; `None` for an engine's image, which is not ours to destroy.
    memory: Option<Arc<Memory>>,
}

/// How an image of this description is made, if this backend knows the format.
fn create_info(
    desc: &TextureDesc,
    usage: vk::ImageUsageFlags,
) -> Option<vk::ImageCreateInfo<'static>> {
    let (image_type, flags) = match desc.dimension {
        Dimension::D2 => (vk::ImageType::TYPE_2D, vk::ImageCreateFlags::empty()),
        Dimension::Cube => (
            vk::ImageType::TYPE_2D,
            vk::ImageCreateFlags::CUBE_COMPATIBLE,
        ),
        Dimension::D3 => (vk::ImageType::TYPE_3D, vk::ImageCreateFlags::empty()),
    };
    Some(
        vk::ImageCreateInfo::default()
            .flags(flags)
            .image_type(image_type)
            .format(convert::format(desc.format)?)
            .extent(convert::copy_extent(desc, 0))
            .mip_levels(desc.mips)
            .array_layers(desc.layers())
            .samples(vk::SampleCountFlags::TYPE_1)
            .tiling(vk::ImageTiling::OPTIMAL)
            .usage(usage)
            .sharing_mode(vk::SharingMode::EXCLUSIVE)
            .initial_layout(vk::ImageLayout::UNDEFINED),
    )
}

/// Whether the device can have such an image; if not, what it cannot do.
pub(crate) fn check(
    device: &Device,
    desc: &TextureDesc,
    usage: vk::ImageUsageFlags,
) -> Result<(), String> {
    desc.validate(&device.physical.limits(&device.features))
        .map_err(|error| format!("{}: {error}", convert::describe(desc)))?;
    let info = create_info(desc, usage).ok_or_else(|| format!("the format {}", desc.format))?;
    // SAFETY: the physical device is the instance's; the values are of the
    // enumerations' own names, and the usage is not empty.
    let properties = unsafe {
        device
            .instance
            .raw
            .get_physical_device_image_format_properties(
                device.physical.handle,
                info.format,
                info.image_type,
                info.tiling,
                info.usage,
                info.flags,
            )
    }
    .map_err(|_| format!("{} used as {usage:?}", convert::describe(desc)))?;
    let (extent, max) = (info.extent, properties.max_extent);
    let fits = extent.width <= max.width
        && extent.height <= max.height
        && extent.depth <= max.depth
        && info.mip_levels <= properties.max_mip_levels
        && info.array_layers <= properties.max_array_layers
        && desc
            .bytes()
            .is_some_and(|bytes| bytes <= properties.max_resource_size);
    if fits {
        Ok(())
    } else {
        Err(format!(
            "{}, where {}×{}×{} texels, {} layers and {} bytes are the most",
            convert::describe(desc),
            max.width,
            max.height,
            max.depth,
            properties.max_array_layers,
            properties.max_resource_size
        ))
    }
}

/// The memory an image would need.
pub(crate) fn requirements(
    device: &Device,
    desc: &TextureDesc,
    usage: vk::ImageUsageFlags,
) -> Result<Requirements, String> {
    check(device, desc, usage)?;
    let info = create_info(desc, usage).ok_or_else(|| format!("the format {}", desc.format))?;
    let query = vk::DeviceImageMemoryRequirements::default().create_info(&info);
    let mut dedicated = vk::MemoryDedicatedRequirements::default();
    let mut found = vk::MemoryRequirements2::default().push_next(&mut dedicated);
    // SAFETY: `check` has found that the device can have the image, and the
    // feature `maintenance4` is enabled.
    unsafe {
        device
            .raw
            .get_device_image_memory_requirements(&query, &mut found);
    }
    Ok(Requirements {
        memory: found.memory_requirements,
        dedicated: dedicated.requires_dedicated_allocation == vk::TRUE,
    })
}

/// An image without memory, destroyed at once if it does not get any.
struct Unbound<'a> {
    device: &'a Device,
    raw: vk::Image,
}

impl Unbound<'_> {
    fn bound(self) -> vk::Image {
        let raw = self.raw;
        std::mem::forget(self);
        raw
    }
}

impl Drop for Unbound<'_> {
    fn drop(&mut self) {
        self.device.bury(Remains::Image(self.raw));
    }
}

impl Image {
    fn unbound<'a>(
        device: &'a Arc<Device>,
        name: &str,
        desc: &TextureDesc,
        usage: vk::ImageUsageFlags,
    ) -> Result<Unbound<'a>, BackendError> {
        let info = create_info(desc, usage).ok_or_else(|| BackendError::Api {
            call: "vkCreateImage",
            reason: format!("no Vulkan format is known for {}", desc.format),
        })?;
        // SAFETY: plans are checked before anything is made for them: the
        // device can have an image of this description and usage.
        let raw = unsafe { device.raw.create_image(&info, None) }.map_err(refused(
            "vkCreateImage",
            name,
            desc.bytes().unwrap_or(u64::MAX),
        ))?;
        count(&device.tally.textures, 1);
        device.name(raw, name);
        Ok(Unbound { device, raw })
    }

    fn bound(
        device: &Arc<Device>,
        raw: vk::Image,
        desc: &TextureDesc,
        usage: vk::ImageUsageFlags,
        memory: Option<Arc<Memory>>,
    ) -> Arc<Self> {
        Arc::new(Self {
            id: unique_id(),
            raw,
            desc: *desc,
            usage,
            device: device.clone(),
            views: Mutex::default(),
            memory,
        })
    }

    /// An image at an offset of memory that is large enough and of a suitable type.
    pub(crate) fn placed(
        device: &Arc<Device>,
        name: &str,
        desc: &TextureDesc,
        usage: vk::ImageUsageFlags,
        memory: &Arc<Memory>,
        offset: u64,
    ) -> Result<Arc<Self>, BackendError> {
        let unbound = Self::unbound(device, name, desc, usage)?;
        memory.bind_image(unbound.raw, offset)?;
        Ok(Self::bound(
            device,
            unbound.bound(),
            desc,
            usage,
            Some(memory.clone()),
        ))
    }

    /// An image with memory of its own.
    pub(crate) fn new(
        device: &Arc<Device>,
        name: &str,
        desc: &TextureDesc,
        usage: vk::ImageUsageFlags,
    ) -> Result<Arc<Self>, BackendError> {
        let needed =
            requirements(device, desc, usage).map_err(|reason| BackendError::Unsupported {
                step: name.to_owned(),
                what: reason,
            })?;
        let unbound = Self::unbound(device, name, desc, usage)?;
        let scheme = if needed.dedicated {
            AllocationScheme::DedicatedImage(unbound.raw)
        } else {
            AllocationScheme::GpuAllocatorManaged
        };
        let memory = Memory::new(
            device,
            name,
            needed.memory,
            MemoryLocation::GpuOnly,
            false,
            scheme,
        )?;
        memory.bind_image(unbound.raw, 0)?;
        Ok(Self::bound(
            device,
            unbound.bound(),
            desc,
            usage,
            Some(memory),
        ))
    }

    /// An engine's image.
    pub(crate) fn adopted(
        device: &Arc<Device>,
        raw: vk::Image,
        desc: &TextureDesc,
        usage: vk::ImageUsageFlags,
    ) -> Arc<Self> {
        Self::bound(device, raw, desc, usage, None)
    }

    /// The view of a part, made when first asked for.
    pub(crate) fn view(
        &self,
        range: Subresources,
        view_type: vk::ImageViewType,
    ) -> Result<vk::ImageView, BackendError> {
        let mut views = self.views.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(view) = views.get(&(range, view_type)) {
            return Ok(*view);
        }
        let info = vk::ImageViewCreateInfo::default()
            .image(self.raw)
            .view_type(view_type)
            .format(convert::format(self.desc.format).unwrap_or_default())
            .subresource_range(convert::range(self.desc.format, range));
        // SAFETY: the image lives as long as `self`; the plan was checked for
        // ranges within the texture and for views that suit its shape.
        let view = unsafe { self.device.raw.create_image_view(&info, None) }
            .map_err(failed("vkCreateImageView"))?;
        views.insert((range, view_type), view);
        Ok(view)
    }
}

impl Drop for Image {
    fn drop(&mut self) {
        let views = self.views.get_mut().unwrap_or_else(PoisonError::into_inner);
        for (_, view) in views.drain() {
            self.device.bury(Remains::View(view));
        }
        if self.memory.is_some() {
            self.device.bury(Remains::Image(self.raw));
        }
        // The memory is a field: it is dropped, and buried, after this.
    }
}
