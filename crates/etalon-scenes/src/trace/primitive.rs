//! Exact intersection of rays with convex primitives, in f64.
//!
//! Every function answers with the nearest parameter beyond the ray's start and
//! treats the surface the ray leaves as [`Ray::leaving`] describes.

use glam::{DMat3, DVec3};

use super::ray::Ray;
use super::watertight::cross;

/// One convex piece of a scene.
#[derive(Clone, Debug)]
pub(crate) enum Primitive {
    Plane {
        point: DVec3,
        normal: DVec3,
    },
    /// `inverse_u`, `inverse_v`: `half / |half|²`, so that dot products with
    /// them are coordinates in `[-1, 1]`.
    Rectangle {
        center: DVec3,
        half_u: DVec3,
        half_v: DVec3,
        inverse_u: DVec3,
        inverse_v: DVec3,
        normal: DVec3,
    },
    Disc {
        center: DVec3,
        normal: DVec3,
        radius: f64,
    },
    Sphere {
        center: DVec3,
        radius: f64,
    },
    Box {
        center: DVec3,
        half: DVec3,
        orientation: DMat3,
    },
    Triangle {
        corners: [DVec3; 3],
        normal: DVec3,
    },
}

/// Where a ray meets a primitive.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Meeting {
    pub(crate) t: f64,
    pub(crate) position: DVec3,
    /// Of unit length, on either side.
    pub(crate) normal: DVec3,
    pub(crate) face: u8,
}

impl Primitive {
    /// Corners of the smallest axis-aligned box around it; `None` if it has no end.
    pub(crate) fn bounds(&self) -> Option<(DVec3, DVec3)> {
        let around = |center: DVec3, reach: DVec3| Some((center - reach, center + reach));
        match *self {
            Self::Plane { .. } => None,
            Self::Rectangle {
                center,
                half_u,
                half_v,
                ..
            } => around(center, half_u.abs() + half_v.abs()),
            // The extent of a disc along an axis is the sine of the angle between axis and normal.
            Self::Disc {
                center,
                normal,
                radius,
            } => {
                let sine = (DVec3::ONE - normal * normal)
                    .max(DVec3::ZERO)
                    .map(f64::sqrt);
                around(center, sine * radius)
            }
            Self::Sphere { center, radius } => around(center, DVec3::splat(radius)),
            Self::Box {
                center,
                half,
                orientation: r,
            } => around(
                center,
                r.x_axis.abs() * half.x + r.y_axis.abs() * half.y + r.z_axis.abs() * half.z,
            ),
            Self::Triangle {
                corners: [a, b, c], ..
            } => Some((a.min(b).min(c), a.max(b).max(c))),
        }
    }

    /// The first meeting with `t` beyond the start and not beyond `limit`.
    pub(crate) fn meet(&self, ray: &Ray, left: Option<u8>, limit: f64) -> Option<Meeting> {
        let meeting = match *self {
            Self::Sphere { center, radius } => sphere(ray, left.is_some(), center, radius),
            Self::Box {
                center,
                half,
                orientation,
            } => oriented_box(ray, left, center, half, &orientation),
            // A ray that starts on a plane never meets it again.
            _ if left.is_some() => None,
            Self::Plane { point, normal } => plane(ray, point, normal),
            Self::Rectangle {
                center,
                inverse_u,
                inverse_v,
                normal,
                ..
            } => plane(ray, center, normal).filter(|meeting| {
                let offset = meeting.position - center;
                offset.dot(inverse_u).abs() <= 1.0 && offset.dot(inverse_v).abs() <= 1.0
            }),
            Self::Disc {
                center,
                normal,
                radius,
            } => plane(ray, center, normal)
                .filter(|meeting| meeting.position.distance_squared(center) <= radius * radius),
            Self::Triangle { corners, normal } => triangle(ray, &corners, normal),
        }?;
        (meeting.t <= limit).then_some(meeting)
    }
}

fn plane(ray: &Ray, point: DVec3, normal: DVec3) -> Option<Meeting> {
    let slope = normal.dot(ray.direction());
    let t = normal.dot(point - ray.origin()) / slope;
    // Also false for NaN: a ray within the plane does not meet it.
    if !(t > ray.start() && t.is_finite()) {
        return None;
    }
    let reached = ray.at(t);
    // The rounding error of `reached` grows with t; take out its part across the plane.
    let position = reached - normal * normal.dot(reached - point);
    Some(Meeting {
        t,
        position,
        normal,
        face: 0,
    })
}

/// The roots after Haines, Günther and Akenine-Möller, “Precision Improvements
/// for Ray/Sphere Intersection”, Ray Tracing Gems (2019), chapter 7: the
/// discriminant from the distance of the centre to the ray, the second root
/// from the product of both, and `c = (|f| − r)(|f| + r)`, none of which
/// subtracts large squares.
fn sphere(ray: &Ray, on_surface: bool, center: DVec3, radius: f64) -> Option<Meeting> {
    let f = ray.origin() - center;
    let d = ray.direction();
    let a = d.length_squared();
    let b = -f.dot(d);
    // On the surface one root is 0, exactly; rounding must not decide on its sign.
    let (near, far) = if on_surface {
        (0.0, 2.0 * b / a)
    } else {
        let closest = f + d * (b / a);
        let offset = closest.length();
        let discriminant = (radius - offset) * (radius + offset);
        // A NaN goes on to the test of t below.
        if discriminant < 0.0 {
            return None;
        }
        let distance = f.length();
        let c = (distance - radius) * (distance + radius);
        let q = b + (a * discriminant).sqrt().copysign(b);
        let (t0, t1) = (c / q, q / a);
        if t0 < t1 { (t0, t1) } else { (t1, t0) }
    };
    let t = if near > ray.start() { near } else { far };
    if !(t > ray.start() && t.is_finite()) {
        return None;
    }
    let normal = (ray.at(t) - center).try_normalize()?;
    Some(Meeting {
        t,
        position: center + normal * radius,
        normal,
        face: 0,
    })
}

/// Slabs in the box's own axes (Kay and Kajiya 1986).
fn oriented_box(
    ray: &Ray,
    left: Option<u8>,
    center: DVec3,
    half: DVec3,
    orientation: &DMat3,
) -> Option<Meeting> {
    let origin = orientation.transpose_mul_vec3(ray.origin() - center);
    let direction = orientation.transpose_mul_vec3(ray.direction());
    let (mut enter, mut enter_axis) = (f64::NEG_INFINITY, 0);
    let (mut leave, mut leave_axis) = (f64::INFINITY, 0);
    for axis in 0..3 {
        let (o, d, h) = (origin[axis], direction[axis], half[axis]);
        let on_this = left.filter(|face| usize::from(face / 2) == axis);
        if d == 0.0 {
            // Within a face's plane there is nothing more to meet.
            if on_this.is_some() || o.abs() > h {
                return None;
            }
            continue;
        }
        let mut low = (-h - o) / d;
        let mut high = (h - o) / d;
        match on_this {
            Some(face) if face % 2 == 0 => low = 0.0,
            Some(_) => high = 0.0,
            None => {}
        }
        if low > high {
            std::mem::swap(&mut low, &mut high);
        }
        if low > enter {
            (enter, enter_axis) = (low, axis);
        }
        if high < leave {
            (leave, leave_axis) = (high, axis);
        }
    }
    if enter > leave {
        return None;
    }
    let (t, axis, positive) = if enter > ray.start() {
        (enter, enter_axis, direction[enter_axis] < 0.0)
    } else {
        (leave, leave_axis, direction[leave_axis] > 0.0)
    };
    if !(t > ray.start() && t.is_finite()) {
        return None;
    }
    let sign = if positive { 1.0 } else { -1.0 };
    let mut local = origin + direction * t;
    local[axis] = sign * half[axis];
    Some(Meeting {
        t,
        position: center + *orientation * local,
        normal: orientation.col(axis) * sign,
        face: 2 * axis as u8 + u8::from(positive),
    })
}

fn triangle(ray: &Ray, corners: &[DVec3; 3], normal: DVec3) -> Option<Meeting> {
    let crossing = cross(ray, corners)?;
    let [u, v, w] = crossing.weights;
    Some(Meeting {
        t: crossing.t,
        position: corners[0] * u + corners[1] * v + corners[2] * w,
        normal,
        face: 0,
    })
}
