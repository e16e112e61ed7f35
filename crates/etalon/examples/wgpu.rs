//! An engine with a wgpu device of its own: its G-buffer goes in, every effect
//! is recorded into its encoder, and the picture is in its own texture.
//!
//! ```sh
//! cargo run --example wgpu --features wgpu
//! ```

use etalon::Format;
use etalon::backend::Backend;
use etalon::effects::{ChainSettings, chain};
use etalon::graph::Graph;
use etalon::image::ImageData;
use etalon::plan::{Plan, PlanOptions};
use etalon::wgpu::{WgpuBackend, WgpuBindings, wgpu};
use etalon_scenes::{FrameSize, scene};

type Result<T> = std::result::Result<T, Box<dyn std::error::Error>>;

/// What an engine has anyway.
struct Engine {
    device: wgpu::Device,
    queue: wgpu::Queue,
    adapter: wgpu::Adapter,
}

impl Engine {
    fn new() -> Result<Self> {
        let instance = wgpu::Instance::new(wgpu::InstanceDescriptor::new_without_display_handle());
        let adapter = pollster::block_on(instance.request_adapter(&Default::default()))?;
        let (device, queue) =
            pollster::block_on(adapter.request_device(&wgpu::DeviceDescriptor {
                required_limits: adapter.limits(),
                ..Default::default()
            }))?;
        Ok(Self {
            device,
            queue,
            adapter,
        })
    }

    fn texture(
        &self,
        width: u32,
        height: u32,
        format: Format,
        usage: wgpu::TextureUsages,
    ) -> Result<wgpu::Texture> {
        let format = match format {
            Format::R32Float => wgpu::TextureFormat::R32Float,
            Format::Rgba16Float => wgpu::TextureFormat::Rgba16Float,
            Format::Rgba8Unorm => wgpu::TextureFormat::Rgba8Unorm,
            other => return Err(format!("this engine has no {other}").into()),
        };
        Ok(self.device.create_texture(&wgpu::TextureDescriptor {
            label: None,
            size: wgpu::Extent3d {
                width,
                height,
                depth_or_array_layers: 1,
            },
            mip_level_count: 1,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D2,
            format,
            usage,
            view_formats: &[],
        }))
    }

    /// Stands for drawing the G-buffer.
    fn draw(&self, image: &ImageData) -> Result<wgpu::Texture> {
        let (extent, format) = (image.desc.extent, image.desc.format);
        let usage = wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::COPY_DST;
        let texture = self.texture(extent.width, extent.height, format, usage)?;
        let layout = wgpu::TexelCopyBufferLayout {
            offset: 0,
            bytes_per_row: Some(extent.width * format.texel_bytes()),
            rows_per_image: None,
        };
        self.queue.write_texture(
            texture.as_image_copy(),
            &image.bytes,
            layout,
            texture.size(),
        );
        Ok(texture)
    }
}

fn main() -> Result<()> {
    let engine = Engine::new()?;
    let frame = scene("wet-floor")
        .ok_or("a known scene")?
        .frame(FrameSize::new(640, 360)?)?;
    let colour = engine.draw(&frame.colour)?;
    let depth = engine.draw(&frame.depth)?;
    let normal = engine.draw(&frame.normal)?;
    let specular = engine.draw(&frame.specular)?;
    let usage = wgpu::TextureUsages::STORAGE_BINDING | wgpu::TextureUsages::TEXTURE_BINDING;
    let picture = engine.texture(640, 360, Format::Rgba8Unorm, usage)?;

    let kernels = etalon::effects::kernels();
    let mut effects = WgpuBackend::adopt(
        engine.device.clone(),
        engine.queue.clone(),
        Some(&engine.adapter),
    );
    for number in 0..3 {
        let mut graph = Graph::new();
        let inputs = frame.import(&mut graph, 1.0 / 60.0)?;
        let result = chain(&mut graph, &inputs, &ChainSettings::full())?;
        graph.output("picture", result.picture)?;
        let options = PlanOptions {
            limits: effects.limits(),
            ..PlanOptions::default()
        };
        let plan = Plan::new(&graph, &kernels, &options)?;
        let bindings = WgpuBindings::new()
            .texture("colour", &colour)
            .texture("depth", &depth)
            .texture("normal", &normal)
            .texture("specular", &specular)
            .output("picture", &picture);

        let mut encoder = engine.device.create_command_encoder(&Default::default());
        effects.record(&mut encoder, &plan, &bindings)?;
        engine.queue.submit([encoder.finish()]);
        let counters = effects.counters();
        println!(
            "frame {number}: {} dispatches, {} pipelines, {} bind groups, {} textures so far",
            counters.dispatches, counters.pipelines, counters.bind_groups, counters.textures
        );
    }
    engine.device.poll(wgpu::PollType::wait_indefinitely())?;
    Ok(())
}
