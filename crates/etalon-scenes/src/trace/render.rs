//! Rendering a scene to a frame.

use etalon_core::format::Format;
use etalon_core::texel::Texel;
use glam::{DVec2, DVec3};
use rayon::prelude::*;

use super::ray::Hit;
use super::scene::Scene;
use super::shade::{self, Surface};
use crate::camera::{Camera, Projection};
use crate::frame::{Frame, FrameCamera, FrameError, FrameSize};

/// Largest finite half float: radiances above are stored as this.
const HALF_MAX: f64 = 65_504.0;

/// Renders what the camera sees, one ray through each pixel's centre.
///
/// Reflections of the scene in itself are left out: adding them is the effects'
/// task. The result does not depend on the number of threads.
///
/// # Errors
/// If the camera has no projection for the size, or memory runs out.
pub fn trace(scene: &Scene, camera: &Camera, size: FrameSize) -> Result<Frame, FrameError> {
    let parameters = FrameCamera::new(camera, size)?;
    let mut frame = Frame::empty(parameters, size)?;
    let width = size.width() as usize;
    let view = View {
        scene,
        camera,
        projection: parameters.projection,
    };
    let row = |format: Format| width * format.texel_bytes() as usize;
    (
        frame
            .colour
            .bytes
            .par_chunks_exact_mut(row(frame.colour.desc.format)),
        frame
            .depth
            .bytes
            .par_chunks_exact_mut(row(frame.depth.desc.format)),
        frame
            .normal
            .bytes
            .par_chunks_exact_mut(row(frame.normal.desc.format)),
        frame
            .specular
            .bytes
            .par_chunks_exact_mut(row(frame.specular.desc.format)),
        frame
            .velocity
            .bytes
            .par_chunks_exact_mut(row(frame.velocity.desc.format)),
    )
        .into_par_iter()
        .enumerate()
        .for_each(|(y, (colour, depth, normal, specular, velocity))| {
            for x in 0..width {
                let pixel = view.pixel(pixel_centre(x as u32, y as u32, size));
                store(Format::Rgba16Float, colour, x, pixel.colour);
                store(Format::R32Float, depth, x, [pixel.depth, 0.0, 0.0, 0.0]);
                store(Format::Rgba16Float, normal, x, pixel.normal);
                store(Format::Rgba8Unorm, specular, x, pixel.specular);
                store(
                    Format::Rg16Float,
                    velocity,
                    x,
                    [pixel.velocity.x, pixel.velocity.y, 0.0, 0.0],
                );
            }
        });
    Ok(frame)
}

/// The uv of a pixel's centre.
pub(crate) fn pixel_centre(x: u32, y: u32, size: FrameSize) -> DVec2 {
    DVec2::new(
        (f64::from(x) + 0.5) / f64::from(size.width()),
        (f64::from(y) + 0.5) / f64::from(size.height()),
    )
}

fn store(format: Format, row: &mut [u8], x: usize, value: [f64; 4]) {
    let bytes = format.texel_bytes() as usize;
    format.encode(
        Texel::Float(value.map(|channel| channel as f32)),
        &mut row[x * bytes..][..bytes],
    );
}

/// All that one pixel of a frame holds.
#[derive(Default)]
struct Pixel {
    colour: [f64; 4],
    depth: f64,
    normal: [f64; 4],
    specular: [f64; 4],
    velocity: DVec2,
}

/// A scene seen by a camera.
struct View<'a> {
    scene: &'a Scene,
    camera: &'a Camera,
    projection: Projection,
}

impl View<'_> {
    fn pixel(&self, uv: DVec2) -> Pixel {
        let ray = self.camera.ray(&self.projection, uv);
        match self.scene.intersect(&ray) {
            Some(hit) => self.surface(uv, &hit, -ray.direction()),
            None => Pixel {
                colour: stored(self.scene.sky().at(ray.direction()))
                    .extend(0.0)
                    .to_array(),
                velocity: self.velocity(
                    uv,
                    self.camera
                        .previous_pose()
                        .direction_to_view(ray.direction()),
                ),
                ..Pixel::default()
            },
        }
    }

    fn surface(&self, uv: DVec2, hit: &Hit, out: DVec3) -> Pixel {
        let surface = Surface::new(self.scene.material(hit), hit.position);
        let view = self.camera.pose().to_view(hit.position);
        Pixel {
            colour: stored(shade::radiance(self.scene, hit, &surface, out))
                .extend(1.0)
                .to_array(),
            depth: self.projection.near() / -view.z,
            normal: self
                .camera
                .pose()
                .direction_to_view(hit.normal)
                .extend(1.0)
                .to_array(),
            specular: surface.specular.extend(1.0 - surface.roughness).to_array(),
            velocity: self.velocity(uv, self.camera.previous_pose().to_view(hit.position)),
        }
    }

    /// How far the picture moved at `uv` since the view position, or direction,
    /// was at `previous`. 0 for what was behind the eye: it was not in the picture.
    fn velocity(&self, uv: DVec2, previous: DVec3) -> DVec2 {
        self.projection
            .project(previous)
            .map_or(DVec2::ZERO, |before| uv - before.uv)
    }
}

fn stored(radiance: DVec3) -> DVec3 {
    radiance.clamp(DVec3::ZERO, DVec3::splat(HALF_MAX))
}
