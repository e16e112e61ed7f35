//! Forward light and the light map of deferred lighting.

use etalon::backend::Execution;
use etalon::effects::forward::lamp_bytes;
use etalon::kernel::Arithmetic;
use etalon_scenes::FrameSize;
use etalon_tests::executors;
use glam::DVec3;

use super::by_normal;
use super::scene::{Scene, With, pixels, scenes, texel};
use crate::shading::Point;

/// Forward light and light map differ by what the G-buffer and the layers lose: half
/// a step of each format, times what the model makes of it.
#[test]
fn light_as_drawn_is_that_of_the_light_map() {
    let size = FrameSize::new(200, 112).unwrap();
    for scene in &scenes(size) {
        for executor in &mut executors() {
            let drawn = scene.draw(executor.as_mut(), &scene.lamps);
            let (count, worst) = apart(scene, &drawn);
            let who = format!("{} on {}: {count}, {worst}", scene.name, executor.info());
            println!("{who}");
            assert!(count > 100 && worst <= 1.0, "{who}");
        }
    }
}

/// The comparison must be able to fail: a hundredth of what is scattered left out.
#[test]
fn a_light_map_of_other_light_is_told_apart() {
    let size = FrameSize::new(100, 56).unwrap();
    let scene = &scenes(size)[0];
    let mut kernels = etalon::effects::kernels();
    let shade = kernels.source("forward/shade").unwrap().to_string();
    let changed = shade.replacen(
        "seen.emission + scattered +",
        "seen.emission + 0.99 * scattered +",
        1,
    );
    assert_ne!(shade, changed);
    kernels.add_source("forward/shade", &changed);
    let bytes = lamp_bytes(&scene.view(), &scene.lamps).unwrap();
    let mut executors = executors();
    let Some(executor) = executors.first_mut() else {
        return;
    };
    let with = With {
        lamps: &scene.lamps,
        bytes: &bytes,
        arithmetic: Arithmetic::Strict,
        kernels: &kernels,
    };
    let (_, worst) = apart(scene, &scene.draw_with(executor.as_mut(), &with));
    assert!(worst > 1.2, "{worst}");
}

/// How many pixels of surfaces are compared, and the largest distance between light
/// map and forward light, in units of what is allowed.
fn apart(scene: &Scene, drawn: &Execution) -> (usize, f64) {
    let (mut count, mut worst) = (0, 0_f64);
    for (x, y) in pixels(scene.size) {
        let [a, b] = ["light map", "light"].map(|name| texel(drawn, name, x, y));
        let colour = texel(drawn, "colour", x, y);
        if colour.w == 0.0 {
            // Both show what is behind everything.
            assert_eq!(a, b, "{x}, {y}");
            continue;
        }
        if (x + 3 * y) % 37 != 0 {
            continue;
        }
        let allowed = of_storage(scene, drawn, x, y);
        let off = (a - b).truncate().abs() / allowed;
        worst = worst.max(off.max_element());
        count += 1;
    }
    (count, worst)
}

/// How far a pixel's light may move by the rounding of what the G-buffer holds of it.
fn of_storage(scene: &Scene, drawn: &Execution, x: u32, y: u32) -> DVec3 {
    let camera = scene.view().camera;
    let distance = f64::from(camera.near) / texel(drawn, "depth", x, y).x;
    let ndc_x = (f64::from(x) + 0.5) / f64::from(scene.size.width()) * 2.0 - 1.0;
    let ndc_y = 1.0 - (f64::from(y) + 0.5) / f64::from(scene.size.height()) * 2.0;
    let scale = camera.scale.as_dvec2();
    let specular = texel(drawn, "specular", x, y);
    let point = Point {
        place: DVec3::new(ndc_x / scale.x, ndc_y / scale.y, -1.0) * distance,
        normal: texel(drawn, "normal", x, y).truncate().normalize(),
        colour: texel(drawn, "colour", x, y).truncate(),
        mirrored: specular.truncate(),
        roughness: 1.0 - specular.w,
    };
    let light = scene.model_of(&point).sum();
    let change = |changed: Point| (scene.model_of(&changed).sum() - light).abs();
    let either = |f: &dyn Fn(f64) -> Point| change(f(1.0)).max(change(f(-1.0)));
    let half = 0.5 / 255.0;
    let by_roughness = either(&|sign| Point {
        roughness: (point.roughness + sign * half).clamp(0.0, 1.0),
        ..point
    });
    let by_mirrored = either(&|sign| Point {
        mirrored: (point.mirrored + sign * half).clamp(DVec3::ZERO, DVec3::ONE),
        ..point
    });
    let by_colour = either(&|sign| Point {
        colour: point.colour * (1.0 + sign / 2048.0),
        ..point
    });
    // Where the surface is drawn may be off by the grid's half 256th of a pixel.
    let grid = distance / f64::from(scene.size.height()) / scale.y / 256.0;
    let by_place = either(&|sign| Point {
        place: point.place + DVec3::splat(sign * grid),
        ..point
    });
    // Half a step of f16 below 1 in each of three components.
    let by_normal = by_normal(scene, &point, 3_f64.sqrt() / 4096.0);
    let own = texel(drawn, "emission", x, y).truncate();
    let layers = scene.lamps.len() as f64 + 2.0;
    // The linear bounds add up; a tenth is for what is not linear in them.
    1.1 * (by_roughness + by_mirrored + by_colour + by_normal + by_place)
        + (light + own) * (layers / 1024.0)
        + 1e-5
}
