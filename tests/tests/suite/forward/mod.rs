//! Surfaces lit as they are drawn are what the reflection model says, computed here
//! in f64 where exact rays meet them, and what the light map has of them.

mod deferred;
mod scene;
use crate::shading;
mod white;

use etalon::backend::Execution;
use etalon::effects::forward::lamp_bytes;
use etalon::kernel::Arithmetic;
use etalon_scenes::{FrameSize, models};
use etalon_tests::{executors, non_finite};
use glam::DVec3;
use scene::{Scene, With, pixels, scenes, texel};
use shading::Point;

/// How much a point's light changes with its normal turned by an angle.
pub(crate) fn by_normal(scene: &Scene, point: &Point, angle: f64) -> DVec3 {
    let light = scene.model_of(point).sum();
    let (u, v) = point.normal.any_orthonormal_pair();
    let turned = [u, -u, v, -v].map(|to| {
        let normal = (point.normal + to * angle).normalize();
        (scene.model_of(&Point { normal, ..*point }).sum() - light).abs()
    });
    turned.into_iter().fold(DVec3::ZERO, DVec3::max)
}

/// What kernels are off in light from everywhere: the table's two numbers by 0.002
/// of it at most, and the map by a hundredth, half way between the roughnesses of two
/// mips.
pub(crate) fn of_table_and_map(scene: &Scene, point: &Point) -> DVec3 {
    let Some(around) = scene.around() else {
        return DVec3::ZERO;
    };
    let parts = point.surrounded(&around);
    let bright = around.middle + DVec3::splat(around.slope.abs().x_axis.length());
    bright * (point.mirrored + 1.0) * 0.002 + parts.mirrored * 0.01 + parts.scattered * 1e-3
}

/// The light of a pixel, and how far from it is allowed.
struct Expected {
    pixel: [u32; 2],
    light: DVec3,
    allowed: DVec3,
}

/// The model's light where one triangle of a surface without maps is seen: of every
/// seventh pixel, as the model sums thousands of directions for each.
fn expected(scene: &Scene) -> Vec<Expected> {
    let truth = scene.truth();
    let to_view = scene.camera.pose().view_matrix();
    let mut all = Vec::new();
    for (x, y) in pixels(scene.size).step_by(7) {
        let pixel = truth.at(x, y).unwrap();
        let (true, Some(surface)) = (pixel.inner, &pixel.surface) else {
            continue;
        };
        let material = scene.snapshot.instances.all()[surface.instance as usize].material;
        let material = &scene.model.parts().materials[material];
        if material.textures().next().is_some() {
            continue;
        }
        let [r, g, b, _] = material.base_colour.map(f64::from);
        let (base, metal) = (DVec3::new(r, g, b), f64::from(material.metallic));
        let f0 = f64::from((material.ior - 1.0) / (material.ior + 1.0)).powi(2);
        let side = if surface.front { 1.0 } else { -1.0 };
        let point = Point {
            place: surface.view,
            normal: to_view.transform_vector3(surface.normal * side),
            colour: base * (1.0 - metal),
            mirrored: DVec3::splat(f0).lerp(base, metal),
            roughness: f64::from(material.roughness),
        };
        let emission = DVec3::from(material.emissive.map(f64::from));
        let own = emission * f64::from(material.emissive_strength);
        let light = own + scene.model_of(&point).sum();
        // Corners move by half a 256th of a pixel at most, over which no normal of
        // these models turns by more than this angle; the result is rounded to f16,
        // and f32 loses some ulps in differences of numbers around 1.
        let allowed = by_normal(scene, &point, 3e-4)
            + of_table_and_map(scene, &point)
            + light.abs() * (1.0 / 2048.0 + 1e-4)
            + 1e-5;
        all.push(Expected {
            pixel: [x, y],
            light,
            allowed,
        });
    }
    all
}

/// The largest distance of light drawn, in units of what is allowed.
fn worst(expected: &[Expected], drawn: &Execution) -> f64 {
    let off = expected.iter().map(|expected| {
        let [x, y] = expected.pixel;
        let got = texel(drawn, "light", x, y).truncate();
        ((got - expected.light).abs() / expected.allowed).max_element()
    });
    off.fold(0.0, f64::max)
}

#[test]
fn surfaces_are_lit_as_the_model_says() {
    let size = FrameSize::new(240, 135).unwrap();
    for scene in &scenes(size) {
        let expected = expected(scene);
        assert!(expected.len() > 100, "{}: {}", scene.name, expected.len());
        for executor in &mut executors() {
            let drawn = scene.draw(executor.as_mut(), &scene.lamps);
            let worst = worst(&expected, &drawn);
            let who = format!("{} on {}: {worst}", scene.name, executor.info());
            println!("{who}");
            assert!(worst <= 1.0, "{who}");
        }
    }
}

/// Fast kernels filter with the device's weights, of eight bits: a 256th of what two
/// texels of the table or the map differ by, which is less than what those are off.
#[test]
fn fast_kernels_light_alike() {
    let size = FrameSize::new(120, 68).unwrap();
    let scene = &scenes(size)[0];
    let expected = expected(scene);
    let bytes = lamp_bytes(&scene.view(), &scene.lamps).unwrap();
    for executor in &mut executors() {
        let with = With {
            lamps: &scene.lamps,
            bytes: &bytes,
            arithmetic: Arithmetic::Fast,
            kernels: &etalon::effects::kernels(),
        };
        let worst = worst(&expected, &scene.draw_with(executor.as_mut(), &with));
        assert!(worst <= 1.0, "{worst} on {}", executor.info());
    }
}

/// Whatever bits a list of lamps has, light is finite. With glass over it the sum may
/// be beyond what the target holds, but it is a number.
#[test]
fn no_lamp_makes_light_that_is_no_number() {
    let size = FrameSize::new(64, 36).unwrap();
    let scene = &scenes(size)[0];
    let patterns = [
        0xffff_ffff_u32,
        0x7f80_0000,
        0xff7f_ffff,
        0x7fc0_0001,
        0x0000_0001,
    ];
    for executor in &mut executors() {
        for (arithmetic, pattern) in [Arithmetic::Strict, Arithmetic::Fast]
            .into_iter()
            .flat_map(|arithmetic| patterns.map(|pattern| (arithmetic, pattern)))
        {
            let count = scene.lamps.len();
            let bytes: Vec<u8> = (0..16 * count as u32)
                .flat_map(|word| {
                    if word % 3 == 0 {
                        1.0_f32.to_bits()
                    } else {
                        pattern
                    }
                    .to_le_bytes()
                })
                .collect();
            let with = With {
                lamps: &scene.lamps,
                bytes: &bytes,
                arithmetic,
                kernels: &etalon::effects::kernels(),
            };
            let drawn = scene.draw_with(executor.as_mut(), &with);
            let who = format!("{pattern:x} on {}", executor.info());
            assert_eq!(non_finite(drawn.output("light").unwrap()), 0, "{who}");
            let glass = drawn.output("glass").unwrap();
            for (x, y) in (0..36).flat_map(|y| (0..64).map(move |x| (x, y))) {
                let light = glass.texel(x, y, 0, 0).unwrap().to_f64();
                assert!(light.iter().all(|value| !value.is_nan()), "{who}");
            }
        }
    }
}

/// The comparison must be able to fail: a sky a little darker, and a lamp moved by
/// two centimetres.
#[test]
fn another_light_is_told_apart() {
    let size = FrameSize::new(120, 68).unwrap();
    let mut scene = scenes(size).swap_remove(0);
    let mut executors = executors();
    let Some(executor) = executors.first_mut() else {
        return;
    };
    let dim = expected(&scene);
    let mut darker = Scene::of("dark", (models()[0].build)().unwrap(), size);
    darker.sky.as_mut().unwrap().above *= 0.95;
    let bad = worst(&dim, &darker.draw(executor.as_mut(), &scene.lamps));
    assert!(bad > 1.5, "{bad}");

    scene.sky = None;
    let expected = expected(&scene);
    let mut moved = scene.lamps.clone();
    moved.last_mut().unwrap().position.x += 0.02;
    let good = worst(&expected, &scene.draw(executor.as_mut(), &scene.lamps));
    let bad = worst(&expected, &scene.draw(executor.as_mut(), &moved));
    assert!(good <= 1.0 && bad > 1.5, "{good}, {bad}");
}

/// A prepass only decides which fragments are shaded, and the thin G-buffer is that
/// of the whole one.
#[test]
fn what_is_beside_the_light_is_as_elsewhere() {
    let size = FrameSize::new(160, 90).unwrap();
    let scenes = scenes(size);
    let scene = scenes.iter().find(|scene| scene.name == "stairs").unwrap();
    for executor in &mut executors() {
        let drawn = scene.draw(executor.as_mut(), &scene.lamps);
        let bytes = |name: &str| &drawn.output(name).unwrap().bytes;
        assert_eq!(bytes("normal"), bytes("thin normal"));
        assert_eq!(bytes("specular"), bytes("thin specular"));
        // There is no glass in it, so that this is what is drawn without prepass.
        assert_eq!(bytes("light"), bytes("glass"));
    }
}
