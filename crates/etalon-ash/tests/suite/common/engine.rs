//! A small engine with a Vulkan device of its own.

use std::ffi::{CStr, c_void};
use std::sync::Mutex;

use ash::{ext, vk};
use etalon_ash::{AdoptedDevice, AdoptedTexture, Features};
use etalon_core::Format;
use etalon_core::resource::TextureDesc;

type Log = Mutex<Vec<String>>;

/// Collects what the validation layer says.
unsafe extern "system" fn receive(
    _: vk::DebugUtilsMessageSeverityFlagsEXT,
    _: vk::DebugUtilsMessageTypeFlagsEXT,
    data: *const vk::DebugUtilsMessengerCallbackDataEXT<'_>,
    user: *mut c_void,
) -> vk::Bool32 {
    // SAFETY: the layer passes a structure that lives during the call, and
    // `user` is the engine's log, which outlives its instance.
    let (data, log) = unsafe { (&*data, &*user.cast::<Log>()) };
    // SAFETY: a string that ends with a NUL and lives during the call.
    let message = unsafe { CStr::from_ptr(data.p_message) };
    log.lock()
        .unwrap()
        .push(message.to_string_lossy().into_owned());
    vk::FALSE
}

/// An image, whose memory goes with the device.
pub(crate) struct EngineImage {
    pub(crate) image: vk::Image,
    pub(crate) desc: TextureDesc,
    pub(crate) usage: vk::ImageUsageFlags,
}

impl EngineImage {
    pub(crate) fn adopted(&self) -> AdoptedTexture {
        AdoptedTexture {
            image: self.image,
            desc: self.desc,
            usage: self.usage,
        }
    }
}

/// A buffer that the host sees, and its memory.
pub(crate) struct EngineBuffer {
    pub(crate) buffer: vk::Buffer,
    pub(crate) memory: vk::DeviceMemory,
    pub(crate) bytes: u64,
}

/// The features that every lent device must have.
pub(crate) const REQUIRED: Features = Features {
    synchronization2: true,
    maintenance4: true,
    robust_image_access: false,
    image_cube_array: false,
    storage_image_extended_formats: false,
    storage_image_write_without_format: false,
    shader_float16: false,
    storage_buffer_16bit_access: false,
    dynamic_rendering: false,
    robust_buffer_access: false,
    robust_buffer_access2: false,
    full_draw_index_uint32: false,
    independent_blend: false,
    depth_bias_clamp: false,
    draw_indirect_first_instance: false,
    multi_draw_indirect: false,
};

/// Those, and what draws make use of.
pub(crate) const DRAWING: Features = Features {
    dynamic_rendering: true,
    robust_buffer_access: true,
    full_draw_index_uint32: true,
    independent_blend: true,
    depth_bias_clamp: true,
    draw_indirect_first_instance: true,
    multi_draw_indirect: true,
    ..REQUIRED
};

/// An instance, a device and a queue.
pub(crate) struct Engine {
    _entry: ash::Entry,
    pub(crate) instance: ash::Instance,
    pub(crate) physical: vk::PhysicalDevice,
    pub(crate) device: ash::Device,
    pub(crate) queue: vk::Queue,
    pub(crate) family: u32,
    pub(crate) pool: vk::CommandPool,
    features: Features,
    messenger: Option<(ext::debug_utils::Instance, vk::DebugUtilsMessengerEXT)>,
    log: Box<Log>,
    images: Mutex<Vec<(vk::Image, vk::DeviceMemory)>>,
    buffers: Mutex<Vec<(vk::Buffer, vk::DeviceMemory)>>,
}

const LAYER: &CStr = c"VK_LAYER_KHRONOS_validation";

impl Engine {
    /// An engine on the named device, validated if the layer is installed.
    pub(crate) fn new(name: &str) -> Self {
        Self::with(name, REQUIRED)
    }

    /// An engine whose device has these features, of those for draws.
    pub(crate) fn with(name: &str, features: Features) -> Self {
        // SAFETY: loading the loader has no preconditions.
        let entry = unsafe { ash::Entry::load() }.unwrap();
        // SAFETY: none either.
        let layers = unsafe { entry.enumerate_instance_layer_properties() }.unwrap();
        let validated = layers
            .iter()
            .any(|layer| layer.layer_name_as_c_str() == Ok(LAYER));
        assert!(validated || !super::required("validation"));
        let log: Box<Log> = Box::default();
        let application = vk::ApplicationInfo::default().api_version(vk::API_VERSION_1_3);
        let layers = [LAYER.as_ptr()];
        let extensions = [
            ext::debug_utils::NAME.as_ptr(),
            ext::validation_features::NAME.as_ptr(),
        ];
        let checks = [vk::ValidationFeatureEnableEXT::SYNCHRONIZATION_VALIDATION];
        let mut validation =
            vk::ValidationFeaturesEXT::default().enabled_validation_features(&checks);
        let messenger_info = vk::DebugUtilsMessengerCreateInfoEXT::default()
            .message_severity(
                vk::DebugUtilsMessageSeverityFlagsEXT::WARNING
                    | vk::DebugUtilsMessageSeverityFlagsEXT::ERROR,
            )
            .message_type(vk::DebugUtilsMessageTypeFlagsEXT::VALIDATION)
            .pfn_user_callback(Some(receive))
            .user_data(std::ptr::from_ref(&*log).cast_mut().cast());
        let mut info = vk::InstanceCreateInfo::default().application_info(&application);
        if validated {
            info = info
                .enabled_layer_names(&layers)
                .enabled_extension_names(&extensions)
                .push_next(&mut validation);
        }
        // SAFETY: layer and extensions are there, and the chain lives.
        let instance = unsafe { entry.create_instance(&info, None) }.unwrap();
        let messenger = validated.then(|| {
            let utils = ext::debug_utils::Instance::new(&entry, &instance);
            // SAFETY: the extension is enabled, and the log outlives it.
            let messenger =
                unsafe { utils.create_debug_utils_messenger(&messenger_info, None) }.unwrap();
            (utils, messenger)
        });
        // SAFETY: the instance is live.
        let devices = unsafe { instance.enumerate_physical_devices() }.unwrap();
        let physical = devices
            .into_iter()
            .find(|device| {
                // SAFETY: the device is the instance's.
                let properties = unsafe { instance.get_physical_device_properties(*device) };
                properties.device_name_as_c_str().unwrap().to_str() == Ok(name)
            })
            .unwrap();
        // SAFETY: as above.
        let families = unsafe { instance.get_physical_device_queue_family_properties(physical) };
        let family = families
            .iter()
            .position(|family| family.queue_flags.contains(vk::QueueFlags::COMPUTE))
            .unwrap() as u32;
        let mut vulkan13 = vk::PhysicalDeviceVulkan13Features::default()
            .synchronization2(true)
            .maintenance4(true)
            .dynamic_rendering(features.dynamic_rendering);
        let core = vk::PhysicalDeviceFeatures::default()
            .robust_buffer_access(features.robust_buffer_access)
            .full_draw_index_uint32(features.full_draw_index_uint32)
            .independent_blend(features.independent_blend)
            .depth_bias_clamp(features.depth_bias_clamp)
            .draw_indirect_first_instance(features.draw_indirect_first_instance)
            .multi_draw_indirect(features.multi_draw_indirect);
        let queues = [vk::DeviceQueueCreateInfo::default()
            .queue_family_index(family)
            .queue_priorities(&[1.0])];
        let info = vk::DeviceCreateInfo::default()
            .queue_create_infos(&queues)
            .enabled_features(&core)
            .push_next(&mut vulkan13);
        // SAFETY: the family exists, and the devices that are tested have the
        // features.
        let device = unsafe { instance.create_device(physical, &info, None) }.unwrap();
        // SAFETY: made with one queue of the family.
        let queue = unsafe { device.get_device_queue(family, 0) };
        let info = vk::CommandPoolCreateInfo::default().queue_family_index(family);
        // SAFETY: the family is the device's.
        let pool = unsafe { device.create_command_pool(&info, None) }.unwrap();
        Self {
            _entry: entry,
            instance,
            physical,
            device,
            queue,
            family,
            pool,
            features,
            messenger,
            log,
            images: Mutex::default(),
            buffers: Mutex::default(),
        }
    }

    /// What the engine lends.
    pub(crate) fn lend(&self) -> AdoptedDevice {
        AdoptedDevice {
            instance: self.instance.clone(),
            physical_device: self.physical,
            device: self.device.clone(),
            queue: self.queue,
            queue_family: self.family,
            features: self.features,
            debug_utils: self.messenger.is_some(),
        }
    }

    fn memory(
        &self,
        needed: vk::MemoryRequirements,
        flags: vk::MemoryPropertyFlags,
    ) -> vk::DeviceMemory {
        // SAFETY: the device is the instance's.
        let properties = unsafe {
            self.instance
                .get_physical_device_memory_properties(self.physical)
        };
        let index = properties
            .memory_types_as_slice()
            .iter()
            .enumerate()
            .position(|(index, kind)| {
                needed.memory_type_bits & 1 << index != 0 && kind.property_flags.contains(flags)
            })
            .unwrap() as u32;
        let info = vk::MemoryAllocateInfo::default()
            .allocation_size(needed.size)
            .memory_type_index(index);
        // SAFETY: the type exists and the size is not zero.
        unsafe { self.device.allocate_memory(&info, None) }.unwrap()
    }

    /// A 2D image of one mip, in no layout yet.
    pub(crate) fn image(&self, desc: TextureDesc, usage: vk::ImageUsageFlags) -> EngineImage {
        assert_eq!(desc.format, Format::R32Float);
        let info = vk::ImageCreateInfo::default()
            .image_type(vk::ImageType::TYPE_2D)
            .format(vk::Format::R32_SFLOAT)
            .extent(vk::Extent3D {
                width: desc.extent.width,
                height: desc.extent.height,
                depth: 1,
            })
            .mip_levels(1)
            .array_layers(1)
            .samples(vk::SampleCountFlags::TYPE_1)
            .tiling(vk::ImageTiling::OPTIMAL)
            .usage(usage);
        // SAFETY: every device has such images.
        let image = unsafe { self.device.create_image(&info, None) }.unwrap();
        // SAFETY: the image was just made.
        let needed = unsafe { self.device.get_image_memory_requirements(image) };
        let memory = self.memory(needed, vk::MemoryPropertyFlags::DEVICE_LOCAL);
        // SAFETY: the memory was made for it.
        unsafe { self.device.bind_image_memory(image, memory, 0) }.unwrap();
        self.images.lock().unwrap().push((image, memory));
        EngineImage { image, desc, usage }
    }

    /// A buffer for copies, storage and draws that the host sees.
    pub(crate) fn buffer(&self, bytes: u64) -> EngineBuffer {
        let info = vk::BufferCreateInfo::default().size(bytes).usage(
            vk::BufferUsageFlags::TRANSFER_DST
                | vk::BufferUsageFlags::TRANSFER_SRC
                | vk::BufferUsageFlags::STORAGE_BUFFER
                | vk::BufferUsageFlags::VERTEX_BUFFER
                | vk::BufferUsageFlags::INDIRECT_BUFFER,
        );
        // SAFETY: the size is not zero.
        let buffer = unsafe { self.device.create_buffer(&info, None) }.unwrap();
        // SAFETY: the buffer was just made.
        let needed = unsafe { self.device.get_buffer_memory_requirements(buffer) };
        let memory = self.memory(
            needed,
            vk::MemoryPropertyFlags::HOST_VISIBLE | vk::MemoryPropertyFlags::HOST_COHERENT,
        );
        // SAFETY: the memory was made for it.
        unsafe { self.device.bind_buffer_memory(buffer, memory, 0) }.unwrap();
        self.buffers.lock().unwrap().push((buffer, memory));
        EngineBuffer {
            buffer,
            memory,
            bytes,
        }
    }

    /// What a buffer holds, after the GPU has been waited for.
    pub(crate) fn read(&self, buffer: &EngineBuffer) -> Vec<u8> {
        // SAFETY: the memory is host-visible and not mapped, and the GPU has
        // finished with it.
        unsafe {
            let start = self
                .device
                .map_memory(buffer.memory, 0, buffer.bytes, vk::MemoryMapFlags::empty())
                .unwrap();
            let bytes =
                std::slice::from_raw_parts(start.cast::<u8>(), buffer.bytes as usize).to_vec();
            self.device.unmap_memory(buffer.memory);
            bytes
        }
    }

    /// As [`read`](Self::read), as floats.
    pub(crate) fn floats(&self, buffer: &EngineBuffer) -> Vec<f32> {
        self.read(buffer)
            .chunks_exact(4)
            .map(|bytes| f32::from_le_bytes(bytes.try_into().unwrap()))
            .collect()
    }

    /// A command buffer in the recording state.
    pub(crate) fn begin(&self) -> vk::CommandBuffer {
        let info = vk::CommandBufferAllocateInfo::default()
            .command_pool(self.pool)
            .command_buffer_count(1);
        // SAFETY: the pool is the engine's, used by one thread.
        let commands = unsafe { self.device.allocate_command_buffers(&info) }.unwrap()[0];
        // SAFETY: it was just allocated.
        unsafe {
            self.device
                .begin_command_buffer(commands, &vk::CommandBufferBeginInfo::default())
        }
        .unwrap();
        commands
    }

    /// Fills an image, which is left as the target of a clear.
    pub(crate) fn fill(&self, commands: vk::CommandBuffer, image: &EngineImage, value: f32) {
        self.barrier(
            commands,
            image.image,
            (
                vk::ImageLayout::UNDEFINED,
                vk::ImageLayout::TRANSFER_DST_OPTIMAL,
            ),
            (
                vk::PipelineStageFlags2::ALL_COMMANDS,
                vk::AccessFlags2::MEMORY_WRITE,
            ),
            (
                vk::PipelineStageFlags2::CLEAR,
                vk::AccessFlags2::TRANSFER_WRITE,
            ),
        );
        let value = vk::ClearColorValue {
            float32: [value; 4],
        };
        // SAFETY: the barrier has put the image into this layout.
        unsafe {
            self.device.cmd_clear_color_image(
                commands,
                image.image,
                vk::ImageLayout::TRANSFER_DST_OPTIMAL,
                &value,
                &[ALL],
            );
        }
    }

    /// Copies an image, which is the source of copies, to a buffer and shows
    /// that to the host.
    pub(crate) fn download(
        &self,
        commands: vk::CommandBuffer,
        image: vk::Image,
        desc: TextureDesc,
        buffer: &EngineBuffer,
    ) {
        let region = vk::BufferImageCopy::default()
            .image_subresource(vk::ImageSubresourceLayers {
                aspect_mask: vk::ImageAspectFlags::COLOR,
                mip_level: 0,
                base_array_layer: 0,
                layer_count: 1,
            })
            .image_extent(vk::Extent3D {
                width: desc.extent.width,
                height: desc.extent.height,
                depth: 1,
            });
        let barrier = [vk::MemoryBarrier2::default()
            .src_stage_mask(vk::PipelineStageFlags2::COPY)
            .src_access_mask(vk::AccessFlags2::TRANSFER_WRITE)
            .dst_stage_mask(vk::PipelineStageFlags2::HOST)
            .dst_access_mask(vk::AccessFlags2::HOST_READ)];
        // SAFETY: the image is in this layout, and the buffer is large enough.
        unsafe {
            self.device.cmd_copy_image_to_buffer(
                commands,
                image,
                vk::ImageLayout::TRANSFER_SRC_OPTIMAL,
                buffer.buffer,
                &[region],
            );
            self.device.cmd_pipeline_barrier2(
                commands,
                &vk::DependencyInfo::default().memory_barriers(&barrier),
            );
        }
    }

    /// Takes an image from one use to the next.
    pub(crate) fn barrier(
        &self,
        commands: vk::CommandBuffer,
        image: vk::Image,
        layouts: (vk::ImageLayout, vk::ImageLayout),
        from: (vk::PipelineStageFlags2, vk::AccessFlags2),
        to: (vk::PipelineStageFlags2, vk::AccessFlags2),
    ) {
        let barrier = [vk::ImageMemoryBarrier2::default()
            .src_stage_mask(from.0)
            .src_access_mask(from.1)
            .dst_stage_mask(to.0)
            .dst_access_mask(to.1)
            .old_layout(layouts.0)
            .new_layout(layouts.1)
            .src_queue_family_index(vk::QUEUE_FAMILY_IGNORED)
            .dst_queue_family_index(vk::QUEUE_FAMILY_IGNORED)
            .image(image)
            .subresource_range(ALL)];
        // SAFETY: the command buffer is being recorded.
        unsafe {
            self.device.cmd_pipeline_barrier2(
                commands,
                &vk::DependencyInfo::default().image_memory_barriers(&barrier),
            );
        }
    }

    /// Ends and submits a command buffer; the fence says when it has run.
    pub(crate) fn submit(&self, commands: vk::CommandBuffer) -> vk::Fence {
        // SAFETY: the command buffer is being recorded and is submitted once.
        unsafe {
            self.device.end_command_buffer(commands).unwrap();
            let fence = self
                .device
                .create_fence(&vk::FenceCreateInfo::default(), None)
                .unwrap();
            let buffers = [vk::CommandBufferSubmitInfo::default().command_buffer(commands)];
            let info = [vk::SubmitInfo2::default().command_buffer_infos(&buffers)];
            self.device.queue_submit2(self.queue, &info, fence).unwrap();
            fence
        }
    }

    /// Waits for a submission.
    pub(crate) fn wait(&self, fence: vk::Fence) {
        // SAFETY: the fence was submitted, and nobody needs it afterwards.
        unsafe {
            self.device
                .wait_for_fences(&[fence], true, u64::MAX)
                .unwrap();
            self.device.destroy_fence(fence, None);
        }
    }

    /// Destroys everything, and returns what the validation layer has said.
    pub(crate) fn finish(mut self) -> Vec<String> {
        // SAFETY: everything is the engine's, and nothing is in use: the tests
        // wait for what they submit.
        unsafe {
            self.device.device_wait_idle().unwrap();
            for (image, memory) in self.images.lock().unwrap().drain(..) {
                self.device.destroy_image(image, None);
                self.device.free_memory(memory, None);
            }
            for (buffer, memory) in self.buffers.lock().unwrap().drain(..) {
                self.device.destroy_buffer(buffer, None);
                self.device.free_memory(memory, None);
            }
            self.device.destroy_command_pool(self.pool, None);
            self.device.destroy_device(None);
            if let Some((utils, messenger)) = self.messenger.take() {
                utils.destroy_debug_utils_messenger(messenger, None);
            }
            self.instance.destroy_instance(None);
        }
        std::mem::take(&mut *self.log.lock().unwrap())
    }
}

/// All of a 2D image of one mip.
const ALL: vk::ImageSubresourceRange = vk::ImageSubresourceRange {
    aspect_mask: vk::ImageAspectFlags::COLOR,
    base_mip_level: 0,
    level_count: 1,
    base_array_layer: 0,
    layer_count: 1,
};
