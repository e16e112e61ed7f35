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
use etalon::effects::forward::{Lamps, Lighting, forward, glass, lamp_bytes};
use etalon::effects::geometry::{Geometry, gbuffer, prepass};
use etalon::effects::lighting::{LightKind, PunctualLight, lighting};
use etalon::effects::{ChainSettings, SceneInputs, chain};
use etalon::graph::Graph;
use etalon::image::{ImageData, ImageError};
use etalon::kernel::{Arithmetic, KernelLibrary};
use etalon::plan::Capture;
use etalon::resource::TextureDesc;
use etalon_scenes::model::gltf::{GltfOptions, load_gltf};
use etalon_scenes::model::{Drawable, Model, Snapshot, lights, view};
use etalon_scenes::picture::{Look, write_png};
use etalon_scenes::{Camera, FrameSize, Pose, model};
use etalon_tests::plan_for;
use glam::{DVec3, Vec3};

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
    let snapshot = model.at(time)?;
    let camera = match snapshot.cameras.first() {
        Some(camera) => *camera,
        None => before(&model, &snapshot)?,
    };
    let view = view(&camera, size)?;
    let drawable = Drawable::new(&model)?;
    let mut graph = Graph::new();
    let imported = drawable.import(&mut graph)?;
    let items = imported.opaque_items(&model, &snapshot);
    let blended = imported.blended_items(&model, &snapshot, camera.pose().position());
    let geometry = Geometry {
        items: &items,
        view,
        size: [size.width(), size.height()],
    };
    let pre = prepass(&mut graph, &geometry, true)?;
    let surfaces = gbuffer(&mut graph, &geometry, Some(&pre))?;
    let mut lamps = lights(&model, &snapshot, 100.0);
    if lamps.is_empty() {
        lamps.push(PunctualLight {
            kind: LightKind::Directional,
            position: DVec3::ZERO,
            direction: DVec3::new(-0.5, -1.0, -0.8),
            power: Vec3::splat(3.0),
            reach: None,
        });
    }
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
    let light = lighting(&mut graph, &view, &surfaces, &lamps, &surroundings)?;
    let lamp_list = lamp_bytes(&view, &lamps)?;
    let lit = Lighting {
        lamps: Lamps::import(&mut graph, "lamps", lamps.len() as u32)?,
        surroundings,
    };
    let shaded = forward(&mut graph, &geometry, Some(&pre), &lit, false)?;
    // Glass is drawn over it.
    let copy = graph.texture("opaque", graph.desc(shaded.light));
    let opaque = graph.copy(shaded.light, copy)?;
    let panes = Geometry {
        items: &blended,
        ..geometry
    };
    let whole = glass(&mut graph, &panes, shaded.light, shaded.depth, &lit)?;
    let inputs = SceneInputs {
        colour: whole,
        depth: surfaces.depth,
        normal: surfaces.normal,
        specular: surfaces.specular,
        velocity: pre.velocity,
        camera: view.camera,
        delta_time: 1.0 / 60.0,
    };
    let picture = chain(&mut graph, &inputs, &ChainSettings::full())?.picture;
    let outputs = [
        ("picture", picture, Look::Plain),
        ("light", light, Look::Colour { exposure: 1.0 }),
        ("forward", opaque, Look::Colour { exposure: 1.0 }),
        ("glass", whole, Look::Colour { exposure: 1.0 }),
        ("colour", surfaces.colour, Look::Colour { exposure: 1.0 }),
        ("normal", surfaces.normal, Look::Vectors),
        ("specular", surfaces.specular, Look::Plain),
    ];
    for (name, texture, _) in outputs {
        graph.output(name, texture)?;
    }
    let kernels = KernelLibrary::new();
    let fast = Arithmetic::Fast;
    let plan = plan_for(backend.as_ref(), &graph, &kernels, fast, Capture::Outputs)?;
    let inputs = drawable.inputs().texture("studio", studio.image());
    let execution = backend.execute(&plan, &inputs.buffer("lamps", &lamp_list))?;
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

/// A camera before all of a model.
fn before(model: &Model, snapshot: &Snapshot) -> Result<Camera, Box<dyn Error>> {
    let (mut low, mut high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    for instance in snapshot.instances.all() {
        let [near, far] = model.parts().meshes[instance.mesh].bounds();
        for corner in 0..8 {
            let pick = |axis: usize| {
                f64::from(if corner >> axis & 1 == 0 {
                    near[axis]
                } else {
                    far[axis]
                })
            };
            let corner = DVec3::new(pick(0), pick(1), pick(2));
            let placed = instance.world.as_dmat4().transform_point3(corner);
            (low, high) = (low.min(placed), high.max(placed));
        }
    }
    let (centre, radius) = (0.5 * (low + high), 0.5 * (high - low).length());
    let eye = centre + DVec3::new(0.5, 0.3, 1.0).normalize() * 2.2 * radius;
    Ok(Camera::new(
        Pose::look_at(eye, centre, DVec3::Y)?,
        45_f64.to_radians(),
    )?)
}
