//! Renders a scene and writes its images as PNG files to look at.
//!
//! ```text
//! cargo run --release -p etalon-scenes --example render -- wet-floor out/ 1920 1080
//! ```
//!
//! Without arguments it lists the scenes. Besides the frame's own images it
//! writes `mirror.png`: each pixel's true mirror reflection, `combined.png`: the
//! frame with those added by specular colour and shininess, and `reachable.png`:
//! green where the camera sees what is reflected, red where it does not, blue
//! where the reflection is of the sky.

use std::error::Error;
use std::path::Path;

use etalon_core::format::Format;
use etalon_core::image::ImageData;
use etalon_core::resource::TextureDesc;
use etalon_scenes::picture::{Look, write_png};
use etalon_scenes::trace::{MirrorRay, Reflection};
use etalon_scenes::{FrameSize, scene, scenes};

const USAGE: &str = "usage: render SCENE FOLDER [WIDTH HEIGHT [EXPOSURE]]";

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [name, folder, rest @ ..] = arguments.as_slice() else {
        println!("{USAGE}\n\nscenes:");
        for entry in scenes() {
            println!("  {:18} {}", entry.name, entry.description);
        }
        return Ok(());
    };
    let entry = scene(name).ok_or_else(|| format!("there is no scene {name:?}\n{USAGE}"))?;
    let size = match rest {
        [width, height, ..] => FrameSize::new(width.parse()?, height.parse()?)?,
        _ => FrameSize::new(960, 540)?,
    };
    let exposure = rest.get(2).map_or(Ok(1.0), |exposure| exposure.parse())?;
    let folder = Path::new(folder);
    std::fs::create_dir_all(folder)?;

    let frame = entry.frame(size)?;
    write_png(
        &frame.colour,
        Look::Colour { exposure },
        &folder.join("colour.png"),
    )?;
    write_png(&frame.depth, Look::Depth, &folder.join("depth.png"))?;
    write_png(&frame.normal, Look::Vectors, &folder.join("normal.png"))?;
    write_png(&frame.specular, Look::Plain, &folder.join("specular.png"))?;
    write_png(&frame.specular, Look::Alpha, &folder.join("shininess.png"))?;
    write_png(
        &frame.velocity,
        Look::Velocity { scale: 0.02 },
        &folder.join("velocity.png"),
    )?;

    let reflection = (entry.build)()?.reflection(size)?;
    let colour = frame.colour.to_rgba_f32()?;
    let specular = frame.specular.to_rgba_f32()?;
    let combined: Vec<_> = (colour.iter().zip(&specular).zip(&reflection.rays))
        .map(|((colour, specular), ray)| {
            let mirrored = mirrored(ray);
            std::array::from_fn(|i| {
                colour[i] + mirrored[i] * specular[i] * specular[3] * specular[3]
            })
        })
        .collect();
    let desc = TextureDesc::d2(size.width(), size.height(), Format::Rgba32Float);
    let combined = ImageData::from_rgba_f32(desc, &combined)?;
    write_png(
        &combined,
        Look::Colour { exposure },
        &folder.join("combined.png"),
    )?;
    let image = |texel: fn(&MirrorRay) -> [f32; 4]| picture(&reflection, texel);
    write_png(
        &image(mirrored)?,
        Look::Colour { exposure },
        &folder.join("mirror.png"),
    )?;
    write_png(
        &image(reachable)?,
        Look::Plain,
        &folder.join("reachable.png"),
    )?;
    println!(
        "wrote {name} at {}×{} to {}",
        size.width(),
        size.height(),
        folder.display()
    );
    Ok(())
}

fn picture(
    reflection: &Reflection,
    texel: fn(&MirrorRay) -> [f32; 4],
) -> Result<ImageData, Box<dyn Error>> {
    let texels: Vec<_> = reflection.rays.iter().map(texel).collect();
    let desc = TextureDesc::d2(
        reflection.size.width(),
        reflection.size.height(),
        Format::Rgba32Float,
    );
    Ok(ImageData::from_rgba_f32(desc, &texels)?)
}

fn mirrored(ray: &MirrorRay) -> [f32; 4] {
    match ray {
        MirrorRay::None => [0.0; 4],
        MirrorRay::Miss { colour, .. } => colour.as_vec3().extend(1.0).to_array(),
        MirrorRay::Hit(hit) => hit.colour.as_vec3().extend(1.0).to_array(),
    }
}

fn reachable(ray: &MirrorRay) -> [f32; 4] {
    match ray {
        MirrorRay::None => [0.0, 0.0, 0.0, 1.0],
        MirrorRay::Miss { .. } => [0.1, 0.2, 0.8, 1.0],
        MirrorRay::Hit(hit) if hit.visible => [0.1, 0.7, 0.2, 1.0],
        MirrorRay::Hit(_) => [0.8, 0.15, 0.1, 1.0],
    }
}
