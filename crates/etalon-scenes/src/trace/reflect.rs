//! The true mirror reflection of every pixel.

use glam::{DVec2, DVec3};
use rayon::prelude::*;

use super::ray::Hit;
use super::render::pixel_centre;
use super::scene::Scene;
use super::shade::{self, Surface};
use crate::camera::{Camera, Projection};
use crate::frame::{FrameError, FrameSize};

/// What the mirror ray of one pixel meets.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum MirrorRay {
    /// The pixel shows the sky, or a surface that reflects nothing.
    #[default]
    None,
    /// The ray leaves the scene.
    Miss {
        /// Where to, in view space; a unit vector.
        direction: DVec3,
        /// The sky's radiance there.
        colour: DVec3,
    },
    /// The ray meets a surface.
    Hit(MirrorHit),
}

/// A surface that is seen in a reflection.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MirrorHit {
    /// The reflecting point in view space.
    pub from: DVec3,
    /// The point seen in the reflection, in view space.
    pub position: DVec3,
    /// Where in the picture that point is; `None` if it is outside or nearer
    /// than the near plane.
    pub uv: Option<DVec2>,
    /// Whether the camera sees the point, and from the same side: in the
    /// picture and not hidden. Only then can a screen-space method be right.
    pub visible: bool,
    /// Radiance from the point along the mirror ray: the true answer.
    pub colour: DVec3,
    /// Radiance from the point towards the camera: what the frame holds there
    /// if the point is visible. Differs from `colour` by highlights only.
    pub colour_to_camera: DVec3,
}

/// The mirror reflections of a frame.
#[derive(Clone, Debug, PartialEq)]
pub struct Reflection {
    /// Width and height.
    pub size: FrameSize,
    /// Row by row from the top.
    pub rays: Vec<MirrorRay>,
}

impl Reflection {
    /// The reflection at a pixel; `None` outside the picture.
    #[must_use]
    pub fn at(&self, x: u32, y: u32) -> Option<&MirrorRay> {
        if x >= self.size.width() || y >= self.size.height() {
            return None;
        }
        self.rays
            .get(y as usize * self.size.width() as usize + x as usize)
    }
}

/// Follows the mirror ray from every pixel whose material reflects.
///
/// Rays are reflected about the true f64 normal, not the one rounded into the
/// frame. The result does not depend on the number of threads.
///
/// # Errors
/// If the camera has no projection for the size, or memory runs out.
pub fn true_reflection(
    scene: &Scene,
    camera: &Camera,
    size: FrameSize,
) -> Result<Reflection, FrameError> {
    let mirror = Mirror {
        scene,
        camera,
        projection: camera.projection(size)?,
    };
    let mut rays = Vec::new();
    rays.try_reserve_exact(size.pixels())
        .map_err(|_| FrameError::OutOfMemory {
            what: "reflection",
            bytes: size.pixels() as u64 * size_of::<MirrorRay>() as u64,
        })?;
    rays.resize(size.pixels(), MirrorRay::None);
    rays.par_chunks_exact_mut(size.width() as usize)
        .enumerate()
        .for_each(|(y, row)| {
            for (x, ray) in row.iter_mut().enumerate() {
                *ray = mirror.ray(pixel_centre(x as u32, y as u32, size));
            }
        });
    Ok(Reflection { size, rays })
}

struct Mirror<'a> {
    scene: &'a Scene,
    camera: &'a Camera,
    projection: Projection,
}

impl Mirror<'_> {
    fn ray(&self, uv: DVec2) -> MirrorRay {
        let ray = self.camera.ray(&self.projection, uv);
        let Some(first) = self.scene.intersect(&ray) else {
            return MirrorRay::None;
        };
        if !Surface::new(self.scene.material(&first), first.position).reflects() {
            return MirrorRay::None;
        }
        let direction = reflect(ray.direction(), first.normal);
        let Some(hit) = self.scene.intersect(&first.ray(direction)) else {
            return MirrorRay::Miss {
                direction: self.camera.pose().direction_to_view(direction),
                colour: self.scene.sky().at(direction),
            };
        };
        let surface = Surface::new(self.scene.material(&hit), hit.position);
        let position = self.camera.pose().to_view(hit.position);
        let uv = self
            .projection
            .project(position)
            .filter(|seen| {
                seen.depth <= 1.0
                    && seen.uv.cmpge(DVec2::ZERO).all()
                    && seen.uv.cmple(DVec2::ONE).all()
            })
            .map(|seen| seen.uv);
        let to_camera = self.camera.pose().position() - hit.position;
        let distance = to_camera.length();
        let to_camera = to_camera / distance;
        MirrorRay::Hit(MirrorHit {
            from: self.camera.pose().to_view(first.position),
            position,
            uv,
            visible: uv.is_some() && self.visible(&hit, to_camera, distance, -position.z),
            colour: shade::radiance(self.scene, &hit, &surface, -direction),
            colour_to_camera: shade::radiance(self.scene, &hit, &surface, to_camera),
        })
    }

    /// Whether the camera sees the side of the surface that was hit. What lies
    /// between eye and near plane hides nothing.
    fn visible(&self, hit: &Hit, to_camera: DVec3, distance: f64, depth: f64) -> bool {
        let end = distance * (1.0 - self.projection.near() / depth);
        hit.normal.dot(to_camera) > 0.0 && !self.scene.occluded(&hit.ray(to_camera), end)
    }
}

/// The mirror image of a direction about a unit normal.
fn reflect(direction: DVec3, normal: DVec3) -> DVec3 {
    direction - normal * (2.0 * normal.dot(direction))
}
