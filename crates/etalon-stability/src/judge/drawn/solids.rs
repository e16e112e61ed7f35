//! What a ray through a pixel meets of the triangles.
//!
//! Every triangle is met by itself, in view space and in `f64`. A pixel is judged where
//! rays beside its centre, by more than corners are moved, meet the same triangle, and
//! where no other one is so near to it in depth that rounding decides between them. What
//! it shows may differ from the truth by what the truth changes by between these rays.

use etalon_core::Format;
use etalon_effects::geometry::DrawClass;
use etalon_effects::{CameraParams, DepthRange};
use etalon_scenes::cases::drawn::{Solid, Solids};
use glam::{DMat3, DMat4, DVec2, DVec3};

use super::super::rounding::BOUND;
use super::super::scale::half_step;
use super::super::truth::{Wrong, of};
use crate::observe::Store;

/// How far beside a pixel's centre rays are sent, in pixels: eight times as far as the
/// interpreter's grid moves corners.
const BESIDE: f64 = 1.0 / 64.0;

/// Surfaces nearer to each other than this, relative to their distance, are one as far as
/// rounded depths can tell.
const APART: f64 = 1e-5;

/// Corners farther away are not judged: products of such numbers leave no digits of what
/// is near.
const FARTHEST: f64 = 1e6;

/// Positions have errors of some units of `f32`.
const OFF: f64 = 1.0 / 1_048_576.0;

/// A triangle that a ray meets.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Met {
    solid: usize,
    triangle: usize,
    distance: f64,
    front: bool,
    /// In the solid's own space.
    place: DVec3,
}

/// What a pixel shows: names of images with their channels.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Shown {
    depth: f64,
    normal: DVec3,
    velocity: DVec2,
}

/// Device depth of a distance.
fn depth(camera: &CameraParams, distance: f64) -> f64 {
    let [bias, slope] = camera.depth_bias_slope().as_dvec2().to_array();
    bias + slope / distance
}

/// Where a view position with z < 0 is seen, in uv.
fn projected(camera: &CameraParams, place: DVec3) -> DVec2 {
    let ndc = camera.scale.as_dvec2() * place.truncate() / -place.z + camera.centre.as_dvec2();
    ndc * DVec2::new(0.5, -0.5) + 0.5
}

/// The direction in view space seen at uv, with z = −1.
fn ray(camera: &CameraParams, uv: DVec2) -> DVec3 {
    let ndc = (uv - 0.5) * DVec2::new(2.0, -2.0);
    ((ndc - camera.centre.as_dvec2()) / camera.scale.as_dvec2()).extend(-1.0)
}

struct Scene<'a> {
    solids: &'a Solids,
    /// Every triangle in view space that has a place there.
    triangles: Vec<(usize, usize, [DVec3; 3])>,
}

impl<'a> Scene<'a> {
    /// `None` if it is not to be judged.
    fn new(solids: &'a Solids) -> Option<Self> {
        let mut triangles = Vec::new();
        for (number, solid) in solids.solids.iter().enumerate() {
            // Glass is drawn over what is seen, and leaves neither depth nor normal.
            if solid.glass || solid.surface.base.w < solid.surface.cutoff {
                continue;
            }
            let to_view = solids.view.view * solid.world;
            for (triangle, corners) in solid.triangles.iter().enumerate() {
                let corners = corners.map(|corner| DVec3::from(corner.map(f64::from)));
                // What has a corner that is nowhere is not drawn.
                if corners.iter().all(|corner| corner.is_finite()) {
                    let placed = corners.map(|corner| to_view.transform_point3(corner));
                    if placed.iter().any(|corner| corner.length() > FARTHEST) {
                        return None;
                    }
                    triangles.push((number, triangle, placed));
                }
            }
        }
        Some(Self { solids, triangles })
    }

    fn far(&self) -> f64 {
        match self.solids.view.camera.depth {
            DepthRange::Reversed { far } | DepthRange::Standard { far } => far.into(),
            DepthRange::ReversedInfinite | DepthRange::StandardInfinite => f64::INFINITY,
        }
    }

    /// The nearest triangle on a ray, and the distance of the next.
    fn nearest(&self, ray: DVec3) -> (Option<Met>, f64) {
        let (mut nearest, mut next): (Option<Met>, f64) = (None, f64::INFINITY);
        let drawn = f64::from(self.solids.view.camera.near)..=self.far();
        for &(number, triangle, [a, b, c]) in &self.triangles {
            let solid = &self.solids.solids[number];
            // T. Möller and B. Trumbore, Fast, Minimum Storage Ray/Triangle
            // Intersection, 1997.
            let (u, v) = (b - a, c - a);
            let across = ray.cross(v);
            let det = u.dot(across);
            let beta = -a.dot(across) / det;
            let gamma = ray.dot((-a).cross(u)) / det;
            let distance = v.dot((-a).cross(u)) / det;
            let inside = beta >= 0.0 && gamma >= 0.0 && beta + gamma <= 1.0;
            let mirrored = (self.solids.view.view * solid.world).determinant() < 0.0;
            let front = (det > 0.0) != mirrored;
            let seen = front || solid.surface.two_sided;
            if !(inside && seen && drawn.contains(&distance)) {
                continue;
            }
            let corners =
                solid.triangles[triangle].map(|corner| DVec3::from(corner.map(f64::from)));
            let place =
                corners[0] + (corners[1] - corners[0]) * beta + (corners[2] - corners[0]) * gamma;
            let met = Met {
                solid: number,
                triangle,
                distance,
                front,
                place,
            };
            match nearest {
                Some(before) if before.distance <= distance => next = next.min(distance),
                before => {
                    next = before.map_or(next, |before| next.min(before.distance));
                    nearest = Some(met);
                }
            }
        }
        (nearest, next)
    }

    fn shown(&self, uv: DVec2, met: Option<&Met>) -> Shown {
        let view = &self.solids.view;
        let camera = &view.camera;
        let ray = ray(camera, uv);
        let to_previous = view.previous * view.view.inverse();
        let limited = |before: DVec3, most: f64| {
            if before.z < 0.0 {
                (uv - projected(camera, before)).clamp(DVec2::splat(-most), DVec2::splat(most))
            } else {
                DVec2::ZERO
            }
        };
        let Some(met) = met else {
            return Shown {
                depth: match camera.depth {
                    DepthRange::Reversed { .. } | DepthRange::ReversedInfinite => 0.0,
                    DepthRange::Standard { .. } | DepthRange::StandardInfinite => 1.0,
                },
                normal: DVec3::ZERO,
                velocity: limited(to_previous.transform_vector3(ray), ALONE),
            };
        };
        let solid = &self.solids.solids[met.solid];
        let velocity = if solid.class == DrawClass::Static {
            limited(to_previous.transform_point3(ray * met.distance), ALONE)
        } else {
            let before = view.previous * solid.previous;
            limited(before.transform_point3(met.place), DRAWN)
        };
        Shown {
            depth: depth(camera, met.distance),
            normal: normal(view.view * solid.world, solid, met.front),
            velocity,
        }
    }
}

/// The largest velocity that the camera alone makes, and that drawn things have, in
/// pictures.
const ALONE: f64 = 1.5;
const DRAWN: f64 = 32_768.0;

/// The normal in view space on the side that is seen; +z of what has none.
fn normal(to_view: DMat4, solid: &Solid, front: bool) -> DVec3 {
    let linear = DMat3::from_mat4(to_view);
    let (x, y, z) = (linear.x_axis, linear.y_axis, linear.z_axis);
    let cofactors = DMat3::from_cols(y.cross(z), z.cross(x), x.cross(y));
    let largest = cofactors
        .to_cols_array()
        .into_iter()
        .map(f64::abs)
        .fold(0.0, f64::max);
    let size = if largest > 0.0 { largest } else { 1.0 };
    let sign = linear.determinant().signum();
    let turned = cofactors * DVec3::from(solid.normal.map(f64::from)) * (sign / size);
    let most = turned.abs().max_element();
    // Beyond these squares leave the range of f32 (lib/math, unit3_or).
    let known = !turned.is_nan() && (2_f64.powi(-50)..=2_f64.powi(50)).contains(&most);
    let unit = if known { turned.normalize() } else { DVec3::Z };
    if front { unit } else { -unit }
}

/// The texels that show something else.
pub(super) fn wrong<'a>(solids: &Solids, stores: &'a [Store]) -> Option<Vec<Wrong<'a>>> {
    let scene = Scene::new(solids)?;
    let size = DVec2::new(solids.size.width().into(), solids.size.height().into());
    let store = |pass: &str, binding: &str| {
        let store = stores
            .iter()
            .find(|store| store.pass == pass && store.binding == binding)?;
        let image = store.image.as_ref()?;
        Some((store, image))
    };
    let images = [
        store("geometry/prepass", "depth").or_else(|| store("forward/opaque", "depth")),
        store("geometry/gbuffer", "normal").or_else(|| store("forward/opaque", "normal")),
        of(stores, "geometry/camera velocity")
            .and_then(|(store, _)| Some((store, store.image.as_ref()?))),
    ];
    let mut wrong = Vec::new();
    for index in 0..solids.size.pixels() {
        let width = solids.size.width() as usize;
        let (x, y) = ((index % width) as u32, (index / width) as u32);
        let centre = DVec2::new(x.into(), y.into()) + 0.5;
        let steps = [-BESIDE, 0.0, BESIDE];
        let around = steps
            .iter()
            .flat_map(|dy| steps.map(|dx| DVec2::new(dx, *dy)));
        let uvs = around.map(|off| (centre + off) / size);
        let met: Vec<_> = uvs
            .map(|uv| (uv, scene.nearest(ray(&solids.view.camera, uv))))
            .collect();
        let key = |met: &Option<Met>| met.map(|met| (met.solid, met.triangle, met.front));
        let same = met.iter().all(|(_, (one, _))| key(one) == key(&met[4].1.0));
        let apart = met.iter().all(|(_, (one, next))| {
            one.is_none_or(|one| next - one.distance > APART * one.distance)
        });
        if !(same && apart) {
            continue;
        }
        let shown: Vec<Shown> = met
            .iter()
            .map(|(uv, (met, _))| scene.shown(*uv, met.as_ref()))
            .collect();
        let channels = |shown: &Shown| {
            [
                vec![shown.depth],
                shown.normal.to_array().to_vec(),
                shown.velocity.to_array().to_vec(),
            ]
        };
        let exact = channels(&shown[4]);
        for (which, image) in images.iter().enumerate() {
            let Some((store, image)) = image else {
                continue;
            };
            let Some(texel) = image.texel(x, y, 0, 0) else {
                continue;
            };
            let stored = texel.to_f64();
            let format = image.desc.format;
            for (channel, &exact) in exact[which].iter().enumerate() {
                let others = shown.iter().map(|shown| channels(shown)[which][channel]);
                let spread = others
                    .map(|other| (other - exact).abs())
                    .fold(0.0, f64::max);
                // Interpolated over triangles that reach far, depth has some units of 1.
                let step = match format {
                    Format::Depth32Float => OFF * exact.abs(),
                    _ => half_step(format, channel, exact) + OFF + BOUND * exact.abs(),
                };
                // Written so that a NaN is wrong.
                let right = (stored[channel] - exact).abs() <= step + 2.0 * spread;
                if !right {
                    wrong.push(Wrong {
                        store,
                        index,
                        what: format!(
                            "{:e} in place of {exact:e} in channel {channel}",
                            stored[channel]
                        ),
                    });
                    break;
                }
            }
        }
    }
    Some(wrong)
}
