//! What a rasteriser should have drawn, pixel by pixel.

use glam::{DVec2, DVec3};
use rayon::prelude::*;

use super::clearance::Pyramid;
use super::{Faces, TriangleScene};
use crate::camera::{Camera, Projection};
use crate::frame::{FrameError, FrameSize};
use crate::trace::render::pixel_centre;

/// How truth is found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TruthOptions {
    /// Which sides of triangles are seen.
    pub faces: Faces,
    /// How far from its centre a pixel has to show one triangle alone to be
    /// [`inner`](TruthPixel::inner): half the side of a square, in pixels.
    /// A hundredth counts for anything below it.
    pub clearance: f64,
    /// A surface that is behind another one by less than this part of its
    /// distance may show through where depths are rounded: such pixels are not
    /// inner. Values that are not positive numbers count as 0.
    pub separation: f64,
}

impl Default for TruthOptions {
    /// Back faces culled, half a pixel, and a hundredth of a thousandth of the
    /// distance: some hundred roundings of a depth in f32.
    fn default() -> Self {
        Self {
            faces: Faces::Drawn,
            clearance: 0.5,
            separation: 1e-5,
        }
    }
}

/// What is seen at the centre of a pixel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfacePoint {
    /// Device depth, `near / −z_view`.
    pub depth: f64,
    /// World position.
    pub world: DVec3,
    /// View position.
    pub view: DVec3,
    /// Where the point was one frame earlier, in the world.
    pub previous: DVec3,
    /// uv now minus uv one frame earlier; 0 for what was behind the eye then.
    pub velocity: DVec2,
    /// Interpolated unit normal in the world, on the triangle's front side.
    pub normal: DVec3,
    /// Unit normal of the triangle in the world, on its front side.
    pub geometric_normal: DVec3,
    /// Interpolated texture coordinates; 0 for a set that the mesh lacks.
    pub uv: [DVec2; 2],
    /// The instance's place among the snapshot's instances.
    pub instance: u32,
    /// The triangle's place in its mesh.
    pub triangle: u32,
    /// Weights of the triangle's corners.
    pub weights: [f64; 3],
    /// Whether the front face is seen.
    pub front: bool,
}

/// One pixel of [`Truth`].
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct TruthPixel {
    /// What is seen at its centre; `None` for nothing.
    pub surface: Option<SurfacePoint>,
    /// Whether the same triangle, or nothing, is all that is seen of the
    /// [square](TruthOptions::clearance) around its centre. Found by clipping
    /// triangles, so that nothing is too thin to count. Pixels that are not
    /// inner may differ between correct rasterisers.
    pub inner: bool,
}

/// What a camera sees of a [`TriangleScene`].
#[derive(Clone, Debug, PartialEq)]
pub struct Truth {
    /// Of the picture.
    pub size: FrameSize,
    /// Row by row from the top.
    pub pixels: Vec<TruthPixel>,
}

impl Truth {
    /// The pixel in column `x` and row `y`; `None` outside.
    #[must_use]
    pub fn at(&self, x: u32, y: u32) -> Option<&TruthPixel> {
        if x >= self.size.width() || y >= self.size.height() {
            return None;
        }
        self.pixels
            .get(y as usize * self.size.width() as usize + x as usize)
    }
}

impl TriangleScene<'_> {
    /// What the camera sees, exactly: nothing before the near plane, no far
    /// plane. The result does not depend on the number of threads.
    ///
    /// # Errors
    /// If the camera has no projection for the size, or memory runs out.
    pub fn truth(
        &self,
        camera: &Camera,
        size: FrameSize,
        options: &TruthOptions,
    ) -> Result<Truth, FrameError> {
        let view = View {
            scene: self,
            camera,
            projection: camera.projection(size)?,
            size,
            options,
        };
        let mut pixels = Vec::new();
        pixels
            .try_reserve_exact(size.pixels())
            .map_err(|_| FrameError::OutOfMemory {
                what: "truth",
                bytes: size.pixels() as u64 * size_of::<TruthPixel>() as u64,
            })?;
        pixels.resize(size.pixels(), TruthPixel::default());
        pixels
            .par_chunks_exact_mut(size.width() as usize)
            .enumerate()
            .for_each(|(y, row)| {
                for (x, pixel) in row.iter_mut().enumerate() {
                    *pixel = view.pixel(pixel_centre(x as u32, y as u32, size));
                }
            });
        Ok(Truth { size, pixels })
    }
}

struct View<'a> {
    scene: &'a TriangleScene<'a>,
    camera: &'a Camera,
    projection: Projection,
    size: FrameSize,
    options: &'a TruthOptions,
}

impl View<'_> {
    fn pixel(&self, uv: DVec2) -> TruthPixel {
        let TruthOptions {
            faces,
            clearance,
            separation,
        } = *self.options;
        let ray = self.camera.ray(&self.projection, uv);
        let nearest = self.scene.nearest(&ray, faces);
        // `max` also takes the other number instead of NaN.
        let pixel = DVec2::new(
            1.0 / f64::from(self.size.width()),
            1.0 / f64::from(self.size.height()),
        );
        let reach = pixel * clearance.max(0.01);
        let pyramid = Pyramid::new(self.camera, &self.projection, uv, reach);
        let seen = nearest.map(|(index, _)| index);
        let inner = (self.scene).is_clear(&pyramid, seen, separation.max(0.0), faces);
        let surface = nearest.map(|(index, crossing)| {
            let hit = self.scene.hit(index, &crossing);
            let view = self.camera.pose().to_view(hit.position);
            let previous = self.scene.previous_position(&hit);
            let before = self.camera.previous_pose().to_view(previous);
            SurfacePoint {
                depth: self.projection.near() / -view.z,
                world: hit.position,
                view,
                previous,
                velocity: (self.projection.project(before))
                    .map_or(DVec2::ZERO, |before| uv - before.uv),
                normal: hit.normal,
                geometric_normal: hit.geometric_normal,
                uv: hit.uv,
                instance: hit.instance,
                triangle: hit.triangle,
                weights: hit.weights,
                front: hit.front,
            }
        });
        TruthPixel { surface, inner }
    }
}
