//! Functions of what images hold and of where it is: `lib/sanitise`, `lib/storage`,
//! `lib/sampling`, `lib/camera`.

use super::super::truth::{distance, first, half, interpolated, radiance, unit_interval};
use super::{Function, Given, any};

pub(super) const FUNCTIONS: &[Function] = &[
    Function {
        name: "finite_or",
        module: "sanitise",
        call: "vec4<f32>(finite_or(v.x, 9.0), 0.0, 0.0, 0.0)",
        reason: "WGSL may assume that NaN does not occur: bits tell",
        given: Given::Nothing,
        takes: any,
        truth: |v| first(if v[0].is_finite() { v[0] } else { 9.0 }),
        ulps: 0.0,
        scale: 0.0,
    },
    Function {
        name: "radiance",
        module: "sanitise",
        call: "vec4<f32>(radiance(v.xyz), 0.0)",
        reason: "light that is negative, infinite or none at all",
        given: Given::Nothing,
        takes: any,
        truth: |v| [radiance(v[0]), radiance(v[1]), radiance(v[2]), 0.0],
        ulps: 0.0,
        scale: 0.0,
    },
    Function {
        name: "unit_interval",
        module: "sanitise",
        call: "vec4<f32>(unit_interval(v.x), 0.0, 0.0, 0.0)",
        reason: "shares that are none: minima and maxima let a NaN through",
        given: Given::Nothing,
        takes: any,
        truth: |v| first(unit_interval(v[0])),
        ulps: 0.0,
        scale: 0.0,
    },
    Function {
        name: "f16_rounded",
        module: "storage",
        call: "f16_rounded(v)",
        reason: "ties, subnormal half floats, and numbers that would become infinite",
        given: Given::Nothing,
        takes: any,
        truth: |v| v.map(half),
        ulps: 0.0,
        scale: 0.0,
    },
    Function {
        name: "bilinear",
        module: "sampling",
        call: "bilinear(picture, v.xy)",
        reason: "coordinates far beyond what an integer holds",
        given: Given::Picture,
        takes: |v| v[0].is_finite() && v[1].is_finite(),
        truth: interpolated,
        // Of a place in texels, of which there are 3, and the weights made of it.
        ulps: 16.0,
        scale: 1.0,
    },
    Function {
        name: "distance_of",
        module: "camera",
        call: "vec4<f32>(distance_of(Camera(params.scale, params.centre, params.depth, params.range), v.x), \
               0.0, 0.0, 0.0)",
        reason: "depths that no projection makes: behind, before, infinite and none",
        given: Given::Camera,
        takes: any,
        truth: |v| first(distance(v[0])),
        ulps: 2.0,
        scale: 0.0,
    },
];
