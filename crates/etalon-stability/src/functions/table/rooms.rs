//! Functions of boxes: `lib/box_projection`.

use etalon_effects::probes::truth::box_exit;
use glam::DVec3;

use super::{Function, Given};

/// Of the box in the calls.
const HALF: DVec3 = DVec3::new(2.0, 1.0, 0.5);
const CAPTURE: DVec3 = DVec3::new(1.0, 0.25, -0.25);

/// A point anywhere, and a way of some length.
fn ray(v: [f32; 4]) -> bool {
    let largest = v[1].abs().max(v[2].abs()).max(v[3].abs());
    let range = 2_f32.powi(-20)..=2_f32.powi(20);
    v.iter().all(|number| number.is_finite()) && range.contains(&largest)
}

/// Where `v.xyz` goes along `v.wzy`.
fn exit([x, y, z, w]: [f64; 4]) -> DVec3 {
    let parts = [w, z, y].map(|part| {
        if part.abs() > 2_f64.powi(-100) {
            part
        } else {
            0.0
        }
    });
    box_exit(DVec3::new(x, y, z), DVec3::from(parts), HALF)
}

pub(super) const FUNCTIONS: &[Function] = &[
    Function {
        name: "box_exit",
        module: "box_projection",
        call: "vec4<f32>(box_exit(v.xyz, v.wzy, vec3<f32>(2.0, 1.0, 0.5)), 0.0)",
        reason: "rays along an axis divide by 0, and points outside look away from every side",
        given: Given::Nothing,
        takes: ray,
        truth: |v| exit(v).extend(0.0).to_array(),
        ulps: 8.0,
        scale: 2.0,
    },
    Function {
        name: "box_projected",
        module: "box_projection",
        call: "vec4<f32>(box_projected(v.xyz, v.wzy, vec3<f32>(2.0, 1.0, 0.5), \
               vec3<f32>(1.0, 0.25, -0.25)), 0.0)",
        reason: "directions next to the point of capture have no digits but those of places",
        given: Given::Nothing,
        takes: ray,
        truth: |v| (exit(v) - CAPTURE).normalize().extend(0.0).to_array(),
        // 8 ulp of 2 on each axis, seen from a quarter away at least.
        ulps: 115.0,
        scale: 1.0,
    },
];
