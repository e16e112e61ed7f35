//! Draws a model with every effect, and writes what each step gave as PNG files:
//! lit by the G-buffer and lit as it is drawn, with glass over the latter.
//!
//! ```text
//! cargo run --release -p etalon-tests --example draw_model -- gallery out/ ash
//! cargo run --release -p etalon-tests --example draw_model -- helmet.gltf out/ wgpu 1280 720
//! ```

use std::error::Error;
use std::path::Path;

use etalon::Format;
use etalon::backend::Backend;
use etalon::effects::environment::{
    EnvironmentMap, Prefilter, Surroundings, environment, mirroring,
};
use etalon::effects::{ChainSettings, chain};
use etalon::graph::Graph;
use etalon::image::{ImageData, ImageError};
use etalon::kernel::Arithmetic;
use etalon::plan::Capture;
use etalon::resource::TextureDesc;
use etalon_scenes::model::gltf::{GltfOptions, load_gltf};
use etalon_scenes::model::{Drawn, Shot};
use etalon_scenes::picture::{Look, write_png};
use etalon_scenes::{FrameSize, model};
use etalon_tests::plan_for;
use glam::Vec3;

const USAGE: &str = "usage: draw_model NAME-OR-FILE FOLDER cpu|wgpu|ash [WIDTH HEIGHT [SECONDS]]";

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [name, folder, backend, rest @ ..] = arguments.as_slice() else {
        return Err(USAGE.into());
    };
    let size = match rest {
        [width, height, ..] => FrameSize::new(width.parse()?, height.parse()?)?,
        _ => FrameSize::new(960, 540)?,
    };
    let time = rest.get(2).map_or(Ok(0.5), |time| time.parse())?;
    let mut backend: Box<dyn Backend> = match backend.as_str() {
        "cpu" => etalon_tests::cpu()?,
        "wgpu" => etalon_tests::wgpu()?,
        "ash" => etalon_tests::ash()?,
        _ => return Err(USAGE.into()),
    };
    let model = match model(name) {
        Some(entry) => (entry.build)()?,
        None => load_gltf(Path::new(name), &GltfOptions::default())?,
    };
    let shot = Shot::new(model, time)?;
    let mut graph = Graph::new();
    let studio = EnvironmentMap::of_equirectangular(&studio()?, 256)?;
    let base = graph.import_texture("studio", studio.image().desc)?;
    let settings = Prefilter::default();
    let around = environment(&mut graph, base, studio.irradiance(), &settings)?;
    let surroundings = Surroundings {
        background: Vec3::new(0.05, 0.06, 0.08),
        environment: Some(around),
        mirroring: Some(mirroring(&mut graph)?),
        ..Surroundings::default()
    };
    let drawn = shot.draw(&mut graph, size, surroundings, 1.0 / 60.0)?;
    let Drawn {
        inputs, surfaces, ..
    } = drawn;
    let picture = chain(&mut graph, &inputs, &ChainSettings::full())?.picture;
    let outputs = [
        ("picture", picture, Look::Plain),
        ("deferred", drawn.deferred, Look::Colour { exposure: 1.0 }),
        ("forward", drawn.light, Look::Colour { exposure: 1.0 }),
        ("colour", surfaces.colour, Look::Colour { exposure: 1.0 }),
        ("normal", surfaces.normal, Look::Vectors),
        ("specular", surfaces.specular, Look::Plain),
    ];
    for (name, texture, _) in outputs {
        graph.output(name, texture)?;
    }
    let kernels = etalon::effects::kernels();
    let fast = Arithmetic::Fast;
    let plan = plan_for(backend.as_ref(), &graph, &kernels, fast, Capture::Outputs)?;
    let inputs = shot.inputs().texture("studio", studio.image());
    let execution = backend.execute(&plan, &inputs)?;
    let folder = Path::new(folder);
    std::fs::create_dir_all(folder)?;
    for (name, _, look) in outputs {
        let image = execution.output(name).ok_or("an output is missing")?;
        write_png(image, look, &folder.join(format!("{name}.png")))?;
    }
    for time in &execution.times {
        println!("{:10.3} ms  {}", time.nanoseconds as f64 * 1e-6, time.step);
    }
    Ok(())
}

/// All directions of a room with two windows: what polished things need to look
/// like polished things.
fn studio() -> Result<ImageData, ImageError> {
    let [width, height] = [256, 128];
    let texels: Vec<[f32; 4]> = (0..width * height)
        .map(|k| {
            let u = (k % width) as f32 / width as f32;
            let v = (k / width) as f32 / height as f32;
            let wall = Vec3::new(0.35, 0.38, 0.45).lerp(Vec3::new(0.12, 0.1, 0.09), v);
            let tall = (0.2..0.45).contains(&v);
            let light = match u {
                _ if tall && (0.86..0.96).contains(&u) => Vec3::new(6.0, 6.5, 7.0),
                _ if tall && (0.30..0.36).contains(&u) => Vec3::new(5.0, 4.0, 3.0),
                _ => wall,
            };
            light.extend(1.0).to_array()
        })
        .collect();
    ImageData::from_rgba_f32(TextureDesc::d2(width, height, Format::Rgba32Float), &texels)
}
