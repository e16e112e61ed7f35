//! Writes what rays see of a model as PNG files to look at.
//!
//! ```text
//! cargo run --release -p etalon-scenes --example model -- gallery out/ 1920 1080
//! cargo run --release -p etalon-scenes --example model -- helmet.gltf out/
//! ```
//!
//! Without arguments it lists the models. Files are seen from their first
//! camera, or else from before their bounds. It writes `depth.png`, `normal.png`,
//! `uv.png`, `velocity.png`, `triangles.png`: a colour for each triangle, and
//! `inner.png`: white where correct rasterisers agree.

use std::error::Error;
use std::path::Path;

use etalon_core::format::Format;
use etalon_core::image::ImageData;
use etalon_core::resource::TextureDesc;
use etalon_scenes::model::gltf::{GltfOptions, load_gltf};
use etalon_scenes::model::{Model, Snapshot};
use etalon_scenes::picture::{Look, write_png};
use etalon_scenes::trace::{SurfacePoint, TriangleScene, TruthOptions, TruthPixel};
use etalon_scenes::{Camera, FrameSize, Pose, model, models};
use glam::DVec3;

const USAGE: &str = "usage: model NAME-OR-FILE FOLDER [WIDTH HEIGHT [SECONDS]]";

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [name, folder, rest @ ..] = arguments.as_slice() else {
        println!("{USAGE}\n\nmodels:");
        for entry in models() {
            println!("  {:12} {}", entry.name, entry.description);
        }
        return Ok(());
    };
    let size = match rest {
        [width, height, ..] => FrameSize::new(width.parse()?, height.parse()?)?,
        _ => FrameSize::new(960, 540)?,
    };
    let time = rest.get(2).map_or(Ok(0.5), |time| time.parse())?;
    let model = match model(name) {
        Some(entry) => (entry.build)()?,
        None => load_gltf(Path::new(name), &GltfOptions::default())?,
    };
    let snapshot = model.at(time)?;
    let camera = match snapshot.cameras.first() {
        Some(camera) => *camera,
        None => before(&model, &snapshot)?,
    };
    let scene = TriangleScene::new(&model, &snapshot)?;
    let truth = scene.truth(&camera, size, &TruthOptions::default())?;

    let folder = Path::new(folder);
    std::fs::create_dir_all(folder)?;
    let write = |file: &str, look: Look, texel: &dyn Fn(&TruthPixel) -> [f32; 4]| {
        let texels: Vec<_> = truth.pixels.iter().map(texel).collect();
        let desc = TextureDesc::d2(size.width(), size.height(), Format::Rgba32Float);
        let image = ImageData::from_rgba_f32(desc, &texels)?;
        write_png(&image, look, &folder.join(file))?;
        Ok::<_, Box<dyn Error>>(())
    };
    let seen = |pixel: &TruthPixel, texel: fn(&SurfacePoint) -> [f32; 4]| {
        pixel.surface.as_ref().map_or([0.0; 4], texel)
    };
    write("depth.png", Look::Depth, &|pixel| {
        seen(pixel, |surface| [surface.depth as f32, 0.0, 0.0, 0.0])
    })?;
    write("normal.png", Look::Vectors, &|pixel| {
        seen(pixel, |surface| {
            surface.normal.as_vec3().extend(1.0).to_array()
        })
    })?;
    write("uv.png", Look::Plain, &|pixel| {
        seen(pixel, |surface| {
            let uv = surface.uv[0].as_vec2();
            [uv.x.rem_euclid(1.0), uv.y.rem_euclid(1.0), 0.0, 1.0]
        })
    })?;
    write("velocity.png", Look::Velocity { scale: 0.02 }, &|pixel| {
        seen(pixel, |surface| {
            let velocity = surface.velocity.as_vec2();
            [velocity.x, velocity.y, 0.0, 0.0]
        })
    })?;
    write("triangles.png", Look::Plain, &|pixel| {
        seen(pixel, |surface| {
            let mixed = (surface.triangle ^ surface.instance << 16).wrapping_mul(0x9e37_79b1);
            let channel = |shift: u32| 0.2 + 0.8 * ((mixed >> shift & 255) as f32 / 255.0);
            [channel(24), channel(16), channel(8), 1.0]
        })
    })?;
    write("inner.png", Look::Plain, &|pixel| {
        [f32::from(u8::from(pixel.inner)); 4]
    })?;
    println!(
        "wrote {name} at {}×{} to {}",
        size.width(),
        size.height(),
        folder.display()
    );
    Ok(())
}

/// A camera at rest that has all of the model before it.
fn before(model: &Model, snapshot: &Snapshot) -> Result<Camera, Box<dyn Error>> {
    let (mut low, mut high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    for instance in snapshot.instances.all() {
        let bounds = model.parts().meshes[instance.mesh].bounds();
        for corner in 0..8 {
            let corner = DVec3::from_array(std::array::from_fn(|axis| {
                f64::from(bounds[corner >> axis & 1][axis])
            }));
            let corner = instance.world.as_dmat4().transform_point3(corner);
            (low, high) = (low.min(corner), high.max(corner));
        }
    }
    let (middle, reach) = ((low + high) * 0.5, (high - low).length().max(1e-6));
    let eye = middle + DVec3::new(0.4, 0.3, 1.0).normalize() * (1.2 * reach);
    let camera = Camera::new(Pose::look_at(eye, middle, DVec3::Y)?, 0.8)?;
    Ok(camera.with_near(0.01 * reach)?)
}
