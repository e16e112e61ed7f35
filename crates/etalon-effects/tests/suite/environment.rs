//! The truth of radiance maps against closed forms, and two quadratures against each
//! other.

use std::f64::consts::PI;

use etalon_core::Format;
use etalon_core::image::ImageData;
use etalon_core::resource::TextureDesc;
use etalon_effects::EffectError;
use etalon_effects::environment::truth::{
    Light, averaged, directions, level, roughness, unblurred,
};
use etalon_effects::environment::{EnvironmentMap, Irradiance};
use etalon_effects::truth::Plane;
use glam::DVec3;

/// Of every map there can be, and the ends.
const ROUGHNESSES: [f64; 7] = [1.0 / 7.0, 0.2, 0.25, 0.5, 0.75, 6.0 / 7.0, 1.0];

/// Some unit directions, in all octants.
fn ways() -> impl Iterator<Item = DVec3> {
    (0..24).map(|k| {
        let k = f64::from(k);
        DVec3::new(
            (1.7 * k).sin(),
            (2.3 * k + 0.4).cos(),
            (0.9 * k + 2.0).sin(),
        )
        .normalize()
    })
}

/// The picture of a function of directions, texel by texel.
fn picture(width: u32, radiance: &dyn Fn(DVec3) -> DVec3) -> ImageData {
    let height = width / 2;
    let texel = |k: u32| {
        let turn = 2.0 * PI * ((f64::from(k % width) + 0.5) / f64::from(width) - 0.5);
        let tilt = PI * (f64::from(k / width) + 0.5) / f64::from(height);
        let across = tilt.sin();
        let at = DVec3::new(across * turn.sin(), tilt.cos(), -across * turn.cos());
        radiance(at).as_vec3().extend(1.0).to_array()
    };
    let texels: Vec<_> = (0..width * height).map(texel).collect();
    let desc = TextureDesc::d2(width, height, Format::Rgba32Float);
    ImageData::from_rgba_f32(desc, &texels).unwrap()
}

fn map(side: u32, radiance: &dyn Fn(DVec3) -> DVec3) -> Plane {
    let map = EnvironmentMap::of_equirectangular(&picture(3 * side, radiance), side).unwrap();
    Plane::of(map.image()).unwrap()
}

/// A soft lamp in a sky brighter to one side.
fn soft(at: DVec3) -> DVec3 {
    let lamp = at.dot(DVec3::new(0.6, 0.48, -0.64)).max(0.0).powi(24);
    DVec3::new(0.4, 0.5, 0.7) * (0.5 + 0.3 * at.y + 0.15 * at.x) + DVec3::splat(5.0) * lamp
}

#[test]
fn uniform_light_stays_as_it_is_at_every_roughness() {
    let uniform = DVec3::new(0.25, 1.0, 7.0);
    let light = Light::of_map(&map(32, &|_| uniform)).unwrap();
    let all: Vec<DVec3> = ways().collect();
    for rough in ROUGHNESSES.into_iter().chain([0.0, 1e-3]) {
        for &way in &all {
            let got = averaged(way, rough, &|_| uniform);
            assert!((got - uniform).length() < 1e-10, "{rough}: {got}");
        }
    }
    for rough in ROUGHNESSES {
        for got in light.averaged(&all, rough) {
            assert!((got - uniform).length() < 1e-10, "{rough}: {got}");
        }
    }
}

#[test]
fn without_roughness_it_is_the_map_itself() {
    for way in ways() {
        assert_eq!(averaged(way, 0.0, &soft), soft(way));
    }
    let side = 64;
    let map = map(side, &soft);
    let texels = level(&map, 0).unwrap();
    for (at, texel) in directions(side, 0)
        .unwrap()
        .into_iter()
        .zip(texels.texels())
    {
        let got = unblurred(&map, at).unwrap();
        let off = (got - DVec3::new(texel[0], texel[1], texel[2])).length();
        // Of places in texels, up to 64, a few roundings.
        assert!(off < 1e-10, "{at}: {off}");
    }
}

/// What is left of the first two bands, in closed form: integrals of c^k / r², where
/// c = A − B r is the cosine over D's root r from 1 − q to 1 − q / 2, q being 1 − α².
fn kept(roughness: f64) -> [f64; 2] {
    let q = 1.0 - roughness.powi(4);
    if q == 0.0 {
        return [2.0 / 3.0, 0.25];
    }
    let (a, b) = (2.0 / q - 1.0, 2.0 / q);
    let (low, high) = (1.0 - q, 1.0 - 0.5 * q);
    let (inverse, log) = (1.0 / low - 1.0 / high, (high / low).ln());
    let (first, second) = (high - low, 0.5 * (high * high - low * low));
    let i1 = a * inverse - b * log;
    let i2 = a * a * inverse - 2.0 * a * b * log + b * b * first;
    let i3 =
        a.powi(3) * inverse - 3.0 * a * a * b * log + 3.0 * a * b * b * first - b.powi(3) * second;
    [i2 / i1, 1.5 * i3 / i1 - 0.5]
}

/// Blurring is a convolution with what is symmetric around an axis, so of each band of
/// harmonics a factor is left.
#[test]
fn of_each_band_of_harmonics_its_factor_is_left() {
    let slope = DVec3::new(0.3, -0.7, 0.2);
    let square = |at: DVec3| at.x * at.y - 0.5 * at.z * at.x;
    let light = |at: DVec3| DVec3::splat(2.0) + DVec3::new(at.dot(slope), square(at), 0.0);
    for rough in ROUGHNESSES {
        let [first, second] = kept(rough);
        for way in ways() {
            let want =
                DVec3::splat(2.0) + DVec3::new(first * way.dot(slope), second * square(way), 0.0);
            let got = averaged(way, rough, &light);
            assert!((got - want).length() < 1e-10, "{rough}: {got}, not {want}");
        }
    }
}

#[test]
fn of_the_roughest_surface_it_is_irradiance() {
    let (above, below) = (DVec3::new(3.0, 1.0, 0.0), DVec3::new(0.5, 1.0, 2.0));
    let gradient = |at: DVec3| 0.5 * (above + below) + 0.5 * (above - below) * at.y;
    let irradiance = Irradiance::of_gradient(above, below);
    for way in ways() {
        let want = irradiance.at(way) / PI;
        let got = averaged(way, 1.0, &gradient);
        assert!((got - want).length() < 1e-10, "{got}, not {want}");
    }
}

/// No light is lost or made: the mean over all directions is what it was. Exact for
/// polynomials of the second degree at the corners of an octahedron and of a cube.
#[test]
fn the_mean_over_all_directions_is_kept() {
    let light = |at: DVec3| DVec3::new(1.0 + at.x * at.x, 2.0 - at.y, 1.0 + at.z * at.x);
    let mean = DVec3::new(4.0 / 3.0, 2.0, 1.0);
    let corners: Vec<DVec3> = [-1.0, 1.0]
        .into_iter()
        .flat_map(|sign| DVec3::AXES.map(|axis| axis * sign))
        .collect();
    for rough in ROUGHNESSES {
        let sum: DVec3 = corners
            .iter()
            .map(|&way| averaged(way, rough, &light))
            .sum();
        assert!((sum / 6.0 - mean).length() < 1e-10, "{rough}: {sum}");
    }
}

/// Midpoints are off by a 24th of the square of a piece's size times what bends: of
/// pieces of 2 / 124 on the octahedron's square, whose solid angle bends by up to 15
/// times itself (r³ at a face's middle, where r² is a third).
#[test]
fn pieces_cover_all_directions() {
    let side = 64;
    let pieces = Light::of_map(&map(side, &soft)).unwrap();
    let (mean, solid_angle) = pieces.mean();
    let step = 1.0 / f64::from(side - 2);
    let bound = 2.0 * 15.0 * step * step / 24.0;
    assert!(
        (solid_angle / (4.0 * PI) - 1.0).abs() < bound,
        "{solid_angle}"
    );
    // 24 powers of a cosine have a mean of 1 / 50; the gradients none.
    let want = DVec3::new(0.2, 0.25, 0.35) + 5.0 / 50.0;
    assert!(((mean - want) / want).abs().max_element() < 5e-3, "{mean}");
    let picture = Plane::of(&picture(192, &soft)).unwrap();
    let (mean, solid_angle) = Light::of_equirectangular(&picture).unwrap().mean();
    assert!((solid_angle - 4.0 * PI).abs() < 1e-10, "{solid_angle}");
    assert!(((mean - want) / want).abs().max_element() < 1e-3, "{mean}");
}

/// The sum over a map's pieces and rings around each direction see the same map, and
/// share nothing but the weight.
///
/// Within a piece the map is bilinear, for which its middle is exact. What bends is the
/// lobe, by 2 / α² at its middle, and the solid angle, by 15; a piece is seen under at
/// most √27 = 5.2 times its area on the square, at a face's middle.
#[test]
fn a_sum_over_pieces_is_the_sum_over_rings() {
    for side in [32, 64, 128] {
        let map = map(side, &soft);
        let light = Light::of_map(&map).unwrap();
        let all: Vec<DVec3> = ways().collect();
        let step = 1.0 / f64::from(side - 2);
        let rings = |way, rough| averaged(way, rough, &|at| unblurred(&map, at).unwrap());
        for number in 1..side.ilog2() - 3 {
            let rough = roughness(side, number).unwrap();
            let bound = 27_f64.sqrt() * step * step / 24.0 * (2.0 / rough.powi(4) + 15.0);
            let mut worst = 0_f64;
            for (&way, got) in all.iter().zip(light.averaged(&all, rough)) {
                let want = rings(way, rough);
                worst = worst.max(((got - want) / want).abs().max_element());
            }
            println!("{side}, {rough}: {worst:e} of {bound:e}");
            assert!(worst < bound, "{side}, {rough}: {worst} of {bound}");
            // A lobe a tenth narrower is another one.
            let lamp = DVec3::new(0.6, 0.48, -0.64);
            let other = rings(lamp, 0.9 * rough);
            let off = ((light.averaged(&[lamp], rough)[0] - other) / other).abs();
            assert!(off.max_element() > 2.0 * bound, "{side}, {rough}: {off}");
        }
    }
}

#[test]
fn what_is_no_map_is_refused() {
    let setting = |error: EffectError| matches!(error, EffectError::Setting(_));
    for size in [[48, 32], [96, 64]] {
        assert!(Light::of_map(&Plane::from_fn(size[0], size[1], |_, _| [1.0; 4]).unwrap()).is_ok());
    }
    for size in [[32, 32], [45, 30], [24, 16], [1, 1]] {
        let plane = Plane::from_fn(size[0], size[1], |_, _| [1.0; 4]).unwrap();
        assert!(setting(Light::of_map(&plane).unwrap_err()), "{size:?}");
        assert!(setting(level(&plane, 0).unwrap_err()), "{size:?}");
        assert!(
            setting(unblurred(&plane, DVec3::X).unwrap_err()),
            "{size:?}"
        );
    }
    assert!(setting(roughness(64, 3).unwrap_err()));
    assert!(setting(directions(63, 0).unwrap_err()));
    // NaN and what is negative count as no light.
    let bad = Plane::from_fn(48, 32, |x, _| [f64::NAN, -1.0, f64::from(x % 2), 1.0]).unwrap();
    for got in Light::of_map(&bad).unwrap().averaged(&[DVec3::Y], 1.0) {
        assert!(
            got.x == 0.0 && got.y == 0.0 && (got.z - 0.5).abs() < 0.1,
            "{got}"
        );
    }
}
