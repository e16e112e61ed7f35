//! The guards of `shaders/lib`: what they do with values that are no numbers,
//! and with numbers that mean nothing.

use crate::common;

use common::{Run, image, texels};
use etalon_core::Format;
use etalon_core::resource::TextureDesc;
use etalon_effects::{CameraParams, DepthRange};

const KERNEL: &str = "
import package::lib::camera::{Camera, distance_of, projected, view_position};
import package::lib::math::unit3_or;
import package::lib::sanitise::{finite_or, is_finite, radiance, unit_interval};

override FUNCTION: u32 = 0u;

struct Params {
    scale: vec2<f32>,
    centre: vec2<f32>,
    depth: vec2<f32>,
    range: vec2<f32>,
}

@group(0) @binding(0) var source: texture_2d<f32>;
@group(0) @binding(1) var result: texture_storage_2d<rgba32float, write>;
@group(0) @binding(2) var<uniform> params: Params;

fn value(v: vec4<f32>) -> vec4<f32> {
    let camera = Camera(params.scale, params.centre, params.depth, params.range);
    switch FUNCTION {
        case 0u: { return vec4<f32>(unit3_or(v.xyz, vec3<f32>(0.0, 0.0, -7.0)), 0.0); }
        case 1u: { return vec4<f32>(radiance(v.xyz), 0.0); }
        case 2u: { return vec4<f32>(unit_interval(v.x), finite_or(v.x, 9.0), select(0.0, 1.0, is_finite(v.x)), 0.0); }
        case 3u: { return vec4<f32>(distance_of(camera, v.x), 0.0, 0.0, 0.0); }
        default: {
            let position = view_position(camera, v.xy, v.z);
            return vec4<f32>(projected(camera, position), position.xy);
        }
    }
}

@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    let extent = textureDimensions(result);
    if (id.x >= extent.x || id.y >= extent.y) {
        return;
    }
    textureStore(result, id.xy, value(textureLoad(source, id.xy, 0)));
}
";

const UNIT: u32 = 0;
const RADIANCE: u32 = 1;
const SCALARS: u32 = 2;
const DISTANCE: u32 = 3;
const PROJECTION: u32 = 4;

fn evaluate(function: u32, camera: &CameraParams, points: &[[f32; 4]]) -> Vec<[f32; 4]> {
    let arguments = image(Format::Rgba32Float, points.len() as u32, 1, |x, _| {
        points[x as usize]
    });
    let mut run = Run::new();
    run.kernels.add_source("test/guard", KERNEL);
    let source = run.import("source", &arguments);
    let desc = TextureDesc::d2(points.len() as u32, 1, Format::Rgba32Float);
    let result = run.graph.texture("result", desc);
    let result = run
        .graph
        .compute("test/guard")
        .read("source", source)
        .write("result", result)
        .constant("FUNCTION", function.into())
        .set("scale", camera.scale)
        .set("centre", camera.centre)
        .set("depth", camera.depth_bias_slope())
        .set("range", camera.distance_range())
        .per_texel("result")
        .expect("a valid pass");
    texels(&run.output(result))
}

fn camera() -> CameraParams {
    CameraParams::perspective(1.0, 1.5, 0.125)
}

const INF: f32 = f32::INFINITY;
const NAN: f32 = f32::NAN;

#[test]
fn unit_vectors() {
    let fallback = [0.0, 0.0, -7.0, 0.0];
    let cases = [
        ([3.0, 0.0, -4.0], [0.6, 0.0, -0.8, 0.0]),
        ([0.0, 1e-14, 0.0], [0.0, 1.0, 0.0, 0.0]),
        ([0.0, 0.0, -9e14], [0.0, 0.0, -1.0, 0.0]),
        ([0.0, 0.0, 0.0], fallback),
        ([1e-16, 0.0, 0.0], fallback),
        ([0.0, 2e15, 0.0], fallback),
        ([1e30, 0.0, 0.0], fallback),
        ([NAN, 1.0, 0.0], fallback),
        ([0.0, -INF, 0.0], fallback),
        ([INF, NAN, -INF], fallback),
    ];
    let points: Vec<_> = cases
        .iter()
        .map(|case| [case.0[0], case.0[1], case.0[2], 0.0])
        .collect();
    for ((vector, expected), got) in cases.iter().zip(evaluate(UNIT, &camera(), &points)) {
        // Five roundings at most.
        let near = got
            .iter()
            .zip(expected)
            .all(|(a, b)| (a - b).abs() <= 3.0 * f32::EPSILON);
        assert!(near, "{vector:?}: {got:?}");
    }
}

#[test]
fn light_and_shares() {
    let values = [
        0.0,
        -0.0,
        0.25,
        1.0,
        7.0,
        65_504.0,
        65_520.0,
        f32::MAX,
        INF,
        -1e-30,
        -5.0,
        -INF,
        NAN,
        -NAN,
        1e-30,
    ];
    let points: Vec<_> = values.iter().map(|&x| [x, 0.5, x, 0.0]).collect();
    let light = evaluate(RADIANCE, &camera(), &points);
    let scalars = evaluate(SCALARS, &camera(), &points);
    for ((&x, light), scalars) in values.iter().zip(light).zip(scalars) {
        // `clamp` would keep a NaN.
        let within = |most: f32| if x.is_nan() { 0.0 } else { x.clamp(0.0, most) };
        assert_eq!(light, [within(65_504.0), 0.5, within(65_504.0), 0.0], "{x}");
        let finite = if x.is_finite() { x } else { 9.0 };
        assert_eq!(
            scalars[..3],
            [within(1.0), finite, f32::from(u8::from(x.is_finite()))],
            "{x}"
        );
    }
}

#[test]
fn distances() {
    let check = |depth: DepthRange, cases: &[(f32, f32)]| {
        let camera = CameraParams { depth, ..camera() };
        let points: Vec<_> = cases.iter().map(|case| [case.0, 0.0, 0.0, 0.0]).collect();
        for (&(depth, expected), got) in cases.iter().zip(evaluate(DISTANCE, &camera, &points)) {
            assert!(
                (got[0] - expected).abs() <= 1e-4 * expected,
                "{:?} {depth:e}: {} for {expected}",
                camera.depth,
                got[0]
            );
        }
    };
    let odd = [
        (NAN, 0.0),
        (-NAN, 0.0),
        (INF, 0.0),
        (-INF, 0.0),
        (f32::MAX, 0.0),
        (-f32::MAX, 0.0),
    ];
    let reversed = [
        (1.0, 0.125),
        (0.125, 1.0),
        (1e-3, 125.0),
        // The near plane itself, an ulp before it, and well before it.
        (1.0_f32.next_up(), 0.125),
        (1.01, 0.0),
        (0.0, 0.0),
        (-0.0, 0.0),
        (-0.5, 0.0),
        // 0.125 / 2^-42 is over the horizon of 2^40, 0.125 / 2^-43 … is not a place.
        (42_f32.exp2().recip(), 39_f32.exp2()),
        (44_f32.exp2().recip(), 0.0),
        (f32::MIN_POSITIVE, 0.0),
        (1e-45, 0.0),
    ];
    check(
        DepthRange::ReversedInfinite,
        &[&odd[..], &reversed].concat(),
    );
    // depth = (far / distance - 1) near / (far - near), and 1 less that.
    let at = |distance: f32| (100.0 / distance - 1.0) * 0.125 / 99.875;
    let finite: Vec<_> = [0.125, 1.0, 10.0, 90.0]
        .iter()
        .map(|&d| (at(d), d))
        .collect();
    let cleared = [(0.0, 0.0), (-0.01, 0.0), (1.1, 0.0)];
    check(
        DepthRange::Reversed { far: 100.0 },
        &[&odd[..], &finite, &cleared].concat(),
    );
    let mirrored: Vec<_> = finite
        .iter()
        .map(|&(depth, distance)| (1.0 - depth, distance))
        .take(3)
        .collect();
    let cleared = [(1.0, 0.0), (1.01, 0.0), (-0.1, 0.0)];
    check(
        DepthRange::Standard { far: 100.0 },
        &[&odd[..], &mirrored, &cleared].concat(),
    );
    check(
        DepthRange::StandardInfinite,
        &[&odd[..], &[(0.0, 0.125), (0.5, 0.25), (1.0, 0.0)]].concat(),
    );
}

#[test]
fn projecting_undoes_placing() {
    let camera = CameraParams {
        centre: glam::Vec2::new(0.25, -0.5),
        ..camera()
    };
    let points: Vec<[f32; 4]> = (0..64)
        .map(|i| {
            let random = |c: u32| common::hash(3 * i + c) as f32 / u32::MAX as f32;
            [random(0), random(1), 0.125 + 1000.0 * random(2), 0.0]
        })
        .collect();
    for (point, got) in points.iter().zip(evaluate(PROJECTION, &camera, &points)) {
        // Some ten roundings of values of about 1.
        assert!(
            (got[0] - point[0]).abs() <= 8.0 * f32::EPSILON,
            "{point:?}: {got:?}"
        );
        assert!(
            (got[1] - point[1]).abs() <= 8.0 * f32::EPSILON,
            "{point:?}: {got:?}"
        );
        // The position itself: u runs right and v down, y up.
        let x = (2.0 * point[0] - 1.0 - 0.25) / camera.scale.x * point[2];
        let y = (1.0 - 2.0 * point[1] + 0.5) / camera.scale.y * point[2];
        assert!((got[2] - x).abs() <= 1e-6 * point[2] && (got[3] - y).abs() <= 1e-6 * point[2]);
    }
}
