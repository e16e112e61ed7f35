//! An engine's device, textures, encoder and submits.

mod draws;
mod refused;
mod steady;

use crate::common::{Route, copy_kernel, library, noise, open, plan, uints};
use etalon_core::Format;
use etalon_core::backend::{Backend, BackendError};
use etalon_core::graph::{ClearValue, Graph};
use etalon_core::image::ImageData;
use etalon_core::kernel::KernelLibrary;
use etalon_core::plan::{Capture, Plan};
use etalon_core::resource::TextureDesc;
use etalon_wgpu::{WgpuBackend, WgpuBindings, wgpu};

/// An engine that has opened its own device, with nothing enabled.
struct Engine {
    adapter: wgpu::Adapter,
    device: wgpu::Device,
    queue: wgpu::Queue,
}

impl Engine {
    fn new() -> Option<Self> {
        // Says why, if there is none.
        open(Route::Vulkan)?;
        let instance = wgpu::Instance::new(wgpu::InstanceDescriptor {
            backends: wgpu::Backends::VULKAN,
            ..wgpu::InstanceDescriptor::new_without_display_handle()
        });
        let adapter = pollster::block_on(instance.request_adapter(&Default::default())).ok()?;
        Self::on(adapter)
    }

    /// Another device of the same adapter.
    fn on(adapter: wgpu::Adapter) -> Option<Self> {
        let (device, queue) =
            pollster::block_on(adapter.request_device(&Default::default())).ok()?;
        Some(Self {
            adapter,
            device,
            queue,
        })
    }

    fn backend(&self) -> WgpuBackend {
        WgpuBackend::adopt(self.device.clone(), self.queue.clone(), Some(&self.adapter))
    }

    fn encoder(&self) -> wgpu::CommandEncoder {
        self.device.create_command_encoder(&Default::default())
    }

    fn texture(
        &self,
        size: (u32, u32, u32),
        mips: u32,
        usage: wgpu::TextureUsages,
    ) -> wgpu::Texture {
        self.device.create_texture(&wgpu::TextureDescriptor {
            label: None,
            size: wgpu::Extent3d {
                width: size.0,
                height: size.1,
                depth_or_array_layers: size.2,
            },
            mip_level_count: mips,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D2,
            format: wgpu::TextureFormat::R32Uint,
            usage,
            view_formats: &[],
        })
    }

    /// A texture of 32-bit integers, filled.
    fn filled(&self, image: &ImageData) -> wgpu::Texture {
        self.filled_for(image, wgpu::TextureUsages::TEXTURE_BINDING)
    }

    fn filled_for(&self, image: &ImageData, usage: wgpu::TextureUsages) -> wgpu::Texture {
        let size = image.desc.extent;
        let texture = self.texture(
            (size.width, size.height, 1),
            1,
            usage | wgpu::TextureUsages::COPY_DST,
        );
        self.queue.write_texture(
            texture.as_image_copy(),
            &image.bytes,
            wgpu::TexelCopyBufferLayout {
                offset: 0,
                bytes_per_row: Some(size.width * 4),
                rows_per_image: None,
            },
            texture.size(),
        );
        texture
    }

    /// Reads back a row of 64 32-bit texels.
    fn read_row(&self, texture: &wgpu::Texture, mip: u32, layer: u32) -> Vec<u32> {
        let buffer = self.device.create_buffer(&wgpu::BufferDescriptor {
            label: None,
            size: 256,
            usage: wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        });
        let mut encoder = self.encoder();
        encoder.copy_texture_to_buffer(
            wgpu::TexelCopyTextureInfo {
                texture,
                mip_level: mip,
                origin: wgpu::Origin3d {
                    x: 0,
                    y: 0,
                    z: layer,
                },
                aspect: wgpu::TextureAspect::All,
            },
            wgpu::TexelCopyBufferInfo {
                buffer: &buffer,
                layout: wgpu::TexelCopyBufferLayout {
                    offset: 0,
                    bytes_per_row: Some(256),
                    rows_per_image: None,
                },
            },
            wgpu::Extent3d {
                width: 64,
                height: 1,
                depth_or_array_layers: 1,
            },
        );
        self.queue.submit([encoder.finish()]);
        buffer.map_async(wgpu::MapMode::Read, .., |result| result.unwrap());
        self.wait();
        let view = buffer.get_mapped_range(..).unwrap();
        view.chunks_exact(4)
            .map(|bytes| u32::from_le_bytes(bytes.try_into().unwrap()))
            .collect()
    }

    fn wait(&self) {
        self.device
            .poll(wgpu::PollType::wait_indefinitely())
            .unwrap();
    }

    /// Device memory allocations that exist, if the device keeps count.
    fn allocations(&self) -> Option<usize> {
        self.device
            .generate_allocator_report()
            .map(|report| report.allocations.len())
    }
}

const ROW: TextureDesc = TextureDesc::d2(64, 1, Format::R32Uint);

fn row(seed: u32) -> ImageData {
    ImageData::from_bytes(ROW, noise(256, seed)).unwrap()
}

/// Adds a uniform to each texel, through a transient.
fn adder() -> KernelLibrary {
    let mut library = library("test/copy", &copy_kernel(Format::R32Uint));
    library.add_source(
        "test/add",
        "struct Settings { by: u32 }
         @group(0) @binding(0) var<uniform> settings: Settings;
         @group(0) @binding(1) var source: texture_2d<u32>;
         @group(0) @binding(2) var result: texture_storage_2d<r32uint, write>;
         @compute @workgroup_size(64)
         fn main(@builtin(global_invocation_id) id: vec3u) {
             if any(id.xy >= textureDimensions(result)) { return; }
             textureStore(result, id.xy, textureLoad(source, id.xy, 0) + settings.by);
         }",
    );
    library
}

fn add(backend: &WgpuBackend, library: &KernelLibrary, by: u32) -> Plan {
    let mut graph = Graph::new();
    let source = graph.import_texture("row", ROW).unwrap();
    let between = graph.texture("between", ROW);
    let between = graph
        .compute("test/add")
        .read("source", source)
        .write("result", between)
        .set("by", by)
        .per_texel("result")
        .unwrap();
    let result = graph.texture("result", ROW);
    let result = graph
        .compute("test/copy")
        .read("source", between)
        .write("result", result)
        .per_texel("result")
        .unwrap();
    graph.output("sum", result).unwrap();
    plan(backend, &graph, library, Capture::None)
}

fn sums(image: &ImageData, by: u32) -> Vec<u32> {
    uints(image)
        .into_iter()
        .map(|value| value.wrapping_add(by))
        .collect()
}

/// What an engine gives for an output.
const OUTPUT: wgpu::TextureUsages = wgpu::TextureUsages::STORAGE_BINDING
    .union(wgpu::TextureUsages::TEXTURE_BINDING)
    .union(wgpu::TextureUsages::COPY_SRC);

#[test]
fn a_plan_runs_in_the_engines_encoder_on_the_engines_textures() {
    let Some(engine) = Engine::new() else { return };
    let mut backend = engine.backend();
    let plan = add(&backend, &adder(), 1000);
    let image = row(1);
    let (source, result) = (engine.filled(&image), engine.texture((64, 1, 1), 1, OUTPUT));
    let mut encoder = engine.encoder();
    let bindings = WgpuBindings::new()
        .texture("row", &source)
        .texture("not in the plan", &source)
        .output("sum", &result);
    let outputs = backend.record(&mut encoder, &plan, &bindings).unwrap();
    assert_eq!(outputs.texture("sum"), Some(&result));
    assert_eq!(outputs.view("sum").unwrap().texture(), &result);
    assert_eq!(outputs.iter().count(), 1);
    engine.queue.submit([encoder.finish()]);
    assert_eq!(engine.read_row(&result, 0, 0), sums(&image, 1000));
}

#[test]
fn a_device_is_adopted_without_its_adapter_too() {
    let Some(engine) = Engine::new() else { return };
    let mut backend = WgpuBackend::adopt(engine.device.clone(), engine.queue.clone(), None);
    assert_eq!(backend.info(), engine.backend().info());
    assert_eq!(backend.limits(), engine.backend().limits());
    // Nothing beyond WebGPU was enabled.
    assert!(!backend.keeps_strict_arithmetic());
    assert!(!backend.limits().extended_storage_formats);
    let plan = add(&backend, &adder(), 3);
    let image = row(9);
    let (source, result) = (engine.filled(&image), engine.texture((64, 1, 1), 1, OUTPUT));
    let mut encoder = engine.encoder();
    let bindings = WgpuBindings::new()
        .texture("row", &source)
        .output("sum", &result);
    backend.record(&mut encoder, &plan, &bindings).unwrap();
    engine.queue.submit([encoder.finish()]);
    assert_eq!(engine.read_row(&result, 0, 0), sums(&image, 3));
}

#[test]
fn an_output_that_is_not_given_is_the_backends() {
    let Some(engine) = Engine::new() else { return };
    let mut backend = engine.backend();
    let mut graph = Graph::new();
    let source = graph.import_texture("row", ROW).unwrap();
    let result = graph.texture("result", ROW);
    let result = graph
        .compute("test/copy")
        .read("source", source)
        .write("result", result)
        .per_texel("result")
        .unwrap();
    graph.output("copy", result).unwrap();
    graph.output("the same", result).unwrap();
    // A pass that needs the output to be copied makes it copyable.
    let other = graph.texture("other", ROW);
    let other = graph.copy(result, other).unwrap();
    graph.output("other", other).unwrap();
    let plan = plan(&backend, &graph, &adder(), Capture::None);
    let image = row(2);
    let source = engine.filled(&image);
    let mut encoder = engine.encoder();
    let bindings = WgpuBindings::new().texture("row", &source);
    let outputs = backend.record(&mut encoder, &plan, &bindings).unwrap();
    assert_eq!(outputs.texture("copy"), outputs.texture("the same"));
    assert_ne!(outputs.texture("copy"), outputs.texture("other"));
    engine.queue.submit([encoder.finish()]);
    let copy = outputs.texture("copy").unwrap();
    assert_eq!(engine.read_row(copy, 0, 0), uints(&image));
}

#[test]
fn parts_of_textures_stand_for_imports_and_outputs() {
    let Some(engine) = Engine::new() else { return };
    let mut backend = engine.backend();
    let library = adder();
    let plan = add(&backend, &library, 7);
    let image = row(3);
    // The row is mip 1 of layer 2; the result goes to layer 1 of the same mip.
    let array = engine.texture((128, 1, 3), 2, OUTPUT | wgpu::TextureUsages::COPY_DST);
    engine.queue.write_texture(
        wgpu::TexelCopyTextureInfo {
            texture: &array,
            mip_level: 1,
            origin: wgpu::Origin3d { x: 0, y: 0, z: 2 },
            aspect: wgpu::TextureAspect::All,
        },
        &image.bytes,
        wgpu::TexelCopyBufferLayout::default(),
        wgpu::Extent3d {
            width: 64,
            height: 1,
            depth_or_array_layers: 1,
        },
    );
    let mut encoder = engine.encoder();
    let bindings = WgpuBindings::new()
        .texture_part("row", &array, 1, 2)
        .output_part("sum", &array, 1, 1);
    backend.record(&mut encoder, &plan, &bindings).unwrap();
    engine.queue.submit([encoder.finish()]);
    assert_eq!(engine.read_row(&array, 1, 1), sums(&image, 7));
    assert_eq!(engine.read_row(&array, 1, 2), uints(&image));
    assert_eq!(engine.read_row(&array, 1, 0), [0; 64]);
    // Onto itself it cannot go.
    let mut encoder = engine.encoder();
    let bindings = WgpuBindings::new()
        .texture_part("row", &array, 1, 2)
        .output_part("sum", &array, 1, 2);
    let error = backend.record(&mut encoder, &plan, &bindings).unwrap_err();
    assert!(
        matches!(error, BackendError::InputMismatch { .. }),
        "{error}"
    );
}

#[test]
fn recordings_before_one_submit_keep_their_uniforms() {
    let Some(engine) = Engine::new() else { return };
    let mut backend = engine.backend();
    let library = adder();
    let image = row(4);
    let source = engine.filled(&image);
    let results: Vec<_> = (0..20)
        .map(|_| engine.texture((64, 1, 1), 1, OUTPUT))
        .collect();
    let mut encoders = [engine.encoder(), engine.encoder()];
    for (by, result) in (0..).zip(&results) {
        let plan = add(&backend, &library, by * 3);
        let bindings = WgpuBindings::new()
            .texture("row", &source)
            .output("sum", result);
        let encoder = &mut encoders[usize::from(by >= 10)];
        backend.record(encoder, &plan, &bindings).unwrap();
    }
    engine
        .queue
        .submit(encoders.map(wgpu::CommandEncoder::finish));
    for (by, result) in (0..).zip(&results) {
        assert_eq!(engine.read_row(result, 0, 0), sums(&image, by * 3));
    }
}

/// A history that is added to each frame, and shown.
fn accumulate(backend: &WgpuBackend, library: &KernelLibrary, by: u32) -> Plan {
    let mut graph = Graph::new();
    let history = graph
        .history("sum", ROW, ClearValue::Uint([100, 0, 0, 0]))
        .unwrap();
    let current = graph
        .compute("test/add")
        .read("source", history.previous)
        .write("result", history.current)
        .set("by", by)
        .per_texel("result")
        .unwrap();
    let shown = graph.texture("shown", ROW);
    let shown = graph
        .compute("test/copy")
        .read("source", current)
        .write("result", shown)
        .per_texel("result")
        .unwrap();
    graph.output("shown", shown).unwrap();
    plan(backend, &graph, library, Capture::None)
}

#[test]
fn histories_advance_with_each_recording() {
    let Some(engine) = Engine::new() else { return };
    let mut backend = engine.backend();
    let library = adder();
    let shown: Vec<_> = (0..4)
        .map(|_| engine.texture((64, 1, 1), 1, OUTPUT))
        .collect();
    // Three frames in one submit, the fourth in another.
    let mut encoder = engine.encoder();
    for (by, texture) in [1, 10, 100].into_iter().zip(&shown) {
        let plan = accumulate(&backend, &library, by);
        let bindings = WgpuBindings::new().output("shown", texture);
        backend.record(&mut encoder, &plan, &bindings).unwrap();
    }
    engine.queue.submit([encoder.finish()]);
    let mut encoder = engine.encoder();
    let plan = accumulate(&backend, &library, 1000);
    let bindings = WgpuBindings::new().output("shown", &shown[3]);
    backend.record(&mut encoder, &plan, &bindings).unwrap();
    engine.queue.submit([encoder.finish()]);
    for (texture, wanted) in shown.iter().zip([101, 111, 211, 1211]) {
        assert_eq!(engine.read_row(texture, 0, 0), [wanted; 64]);
    }
}

#[test]
fn depth_buffers_of_engines_can_be_read() {
    let Some(engine) = Engine::new() else { return };
    let mut backend = engine.backend();
    let desc = TextureDesc::d2(64, 1, Format::Depth32Float);
    let library = library("test/depth", &copy_kernel(Format::R32Float));
    let mut graph = Graph::new();
    let depth = graph.import_texture("depth", desc).unwrap();
    let result = graph.texture("result", desc.with_format(Format::R32Float));
    let result = graph
        .compute("test/depth")
        .read("source", depth)
        .write("result", result)
        .per_texel("result")
        .unwrap();
    graph.output("loaded", result).unwrap();
    // Captured by another plan of the same backend, from the host.
    let plan = plan(&backend, &graph, &library, Capture::None);
    for format in [
        wgpu::TextureFormat::Depth32Float,
        wgpu::TextureFormat::Depth24Plus,
        wgpu::TextureFormat::Depth24PlusStencil8,
    ] {
        let texture = engine.device.create_texture(&wgpu::TextureDescriptor {
            label: None,
            size: wgpu::Extent3d {
                width: 64,
                height: 1,
                depth_or_array_layers: 1,
            },
            mip_level_count: 1,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D2,
            format,
            usage: wgpu::TextureUsages::RENDER_ATTACHMENT | wgpu::TextureUsages::TEXTURE_BINDING,
            view_formats: &[],
        });
        let result = engine.device.create_texture(&wgpu::TextureDescriptor {
            label: None,
            size: texture.size(),
            mip_level_count: 1,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D2,
            format: wgpu::TextureFormat::R32Float,
            usage: OUTPUT,
            view_formats: &[],
        });
        let mut encoder = engine.encoder();
        let view = texture.create_view(&Default::default());
        drop(encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            depth_stencil_attachment: Some(wgpu::RenderPassDepthStencilAttachment {
                view: &view,
                depth_ops: Some(wgpu::Operations {
                    load: wgpu::LoadOp::Clear(0.25),
                    store: wgpu::StoreOp::Store,
                }),
                stencil_ops: format.has_stencil_aspect().then_some(wgpu::Operations {
                    load: wgpu::LoadOp::Clear(3),
                    store: wgpu::StoreOp::Store,
                }),
            }),
            ..Default::default()
        }));
        let bindings = WgpuBindings::new()
            .texture("depth", &texture)
            .output("loaded", &result);
        backend.record(&mut encoder, &plan, &bindings).unwrap();
        engine.queue.submit([encoder.finish()]);
        for bits in engine.read_row(&result, 0, 0) {
            // A quarter is between two steps of 24-bit depth.
            let error = (f32::from_bits(bits) - 0.25).abs();
            assert!(error <= 1.0 / 16_777_215.0, "{format:?}: off by {error}");
        }
    }
}
