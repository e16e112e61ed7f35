//! Frames from a function of the pixel.

use etalon_core::format::Format;
use etalon_core::image::ImageData;
use etalon_core::resource::TextureDesc;
use etalon_effects::{CameraParams, DepthRange};
use glam::{DMat4, DVec2, DVec3};

use super::{CaseError, Step};
use crate::camera::Projection;
use crate::frame::{Frame, FrameCamera, FrameSize};
use crate::trace::hash;

/// Seconds between frames where the case is not about them.
pub(super) const FRAME_TIME: f32 = 1.0 / 60.0;

/// The size of cases that are not about sizes.
pub(super) const SMALL: (u32, u32) = (48, 32);

/// A pixel to be painted.
#[derive(Clone, Copy, Debug)]
pub(super) struct Spot {
    pub(super) x: u32,
    pub(super) y: u32,
    /// Of its centre.
    pub(super) uv: DVec2,
    /// The view position at distance 1 that is seen there: z = −1.
    pub(super) ray: DVec3,
    /// Its number, row by row.
    pub(super) index: u32,
    near: f64,
    range: DepthRange,
}

impl Spot {
    /// The device depth of a distance from the view plane.
    pub(super) fn depth(&self, distance: f64) -> f32 {
        let near = self.near;
        (match self.range {
            DepthRange::ReversedInfinite => near / distance,
            DepthRange::StandardInfinite => 1.0 - near / distance,
            DepthRange::Reversed { far } => {
                let far = f64::from(far);
                near * (far - distance) / (distance * (far - near))
            }
            DepthRange::Standard { far } => {
                let far = f64::from(far);
                far * (distance - near) / (distance * (far - near))
            }
        }) as f32
    }

    /// Device depth of nothing.
    pub(super) const fn cleared(&self) -> f32 {
        match self.range {
            DepthRange::ReversedInfinite | DepthRange::Reversed { .. } => 0.0,
            DepthRange::Standard { .. } | DepthRange::StandardInfinite => 1.0,
        }
    }

    /// The distance at which the ray meets a plane; `None` beside or behind it.
    pub(super) fn plane(&self, point: DVec3, normal: DVec3) -> Option<f64> {
        let distance = point.dot(normal) / self.ray.dot(normal);
        (distance.is_finite() && distance > 0.0).then_some(distance)
    }

    /// A matte surface at a distance, facing the eye.
    pub(super) fn wall(&self, distance: f64) -> Texel {
        Texel {
            depth: self.depth(distance),
            normal: [0.0, 0.0, 1.0, 1.0],
            specular: [0.04, 0.04, 0.04, 0.5],
            ..Texel::of(self.chequer())
        }
    }

    /// A perfect mirror at a distance whose ray leaves towards `out`.
    pub(super) fn mirror(&self, distance: f64, out: DVec3) -> Texel {
        let normal = (out.normalize() - self.ray.normalize()).normalize_or_zero();
        self.mirror_with(distance, normal)
    }

    /// A perfect mirror with a normal of any kind.
    pub(super) fn mirror_with(&self, distance: f64, normal: DVec3) -> Texel {
        let [x, y, z] = normal.to_array();
        Texel {
            depth: self.depth(distance),
            normal: [x as f32, y as f32, z as f32, 1.0],
            specular: [1.0; 4],
            ..Texel::of([0.1, 0.1, 0.12])
        }
    }

    /// Nothing.
    pub(super) fn sky(&self) -> Texel {
        Texel {
            colour: [0.3, 0.5, 0.9, 0.0],
            depth: self.cleared(),
            ..Texel::of([0.0; 3])
        }
    }

    /// A room with a polished floor, a wall behind it and one to the left: what a
    /// case shows that is about something else.
    pub(super) fn room(&self) -> Texel {
        let floor = (DVec3::new(0.0, -1.0, 0.0), DVec3::Y);
        let back = (DVec3::new(0.0, 0.0, -8.0), DVec3::Z);
        let side = (DVec3::new(-3.0, 0.0, 0.0), DVec3::X);
        let seen = [floor, back, side]
            .into_iter()
            .filter_map(|(point, normal)| Some((self.plane(point, normal)?, normal)))
            .min_by(|a, b| a.0.total_cmp(&b.0));
        let Some((distance, normal)) = seen else {
            return self.sky();
        };
        let point = self.ray * distance;
        let tile = |value: f64| (value * 1.5).floor() as i64 as u32;
        let odd = (tile(point.x) ^ tile(point.y) ^ tile(point.z)) & 1;
        let polished = normal == DVec3::Y;
        Texel {
            depth: self.depth(distance),
            normal: [normal.x as f32, normal.y as f32, normal.z as f32, 1.0],
            specular: if polished {
                [0.5, 0.5, 0.5, 0.75]
            } else {
                [0.04, 0.04, 0.04, 0.25]
            },
            velocity: [0.01, -0.005],
            ..Texel::of(if odd == 1 {
                [0.8, 0.35, 0.1]
            } else {
                [0.1, 0.25, 1.6]
            })
        }
    }

    /// Two colours in turn, all that a reflection needs to be told from another.
    pub(super) fn chequer(&self) -> [f32; 3] {
        if (self.x / 4 + self.y / 4).is_multiple_of(2) {
            [0.9, 0.4, 0.1]
        } else {
            [0.1, 0.3, 1.2]
        }
    }

    /// A number that looks random, for each pixel and `seed` another.
    pub(super) fn random(&self, seed: u32) -> u32 {
        hash(self.index ^ seed.wrapping_mul(0x9e37_79b9))
    }

    /// The same in `[0, 1)`.
    pub(super) fn share(&self, seed: u32) -> f64 {
        f64::from(self.random(seed) >> 8) / f64::from(1 << 24)
    }
}

/// What a pixel holds.
#[derive(Clone, Copy, Debug)]
pub(super) struct Texel {
    pub(super) colour: [f32; 4],
    pub(super) depth: f32,
    pub(super) normal: [f32; 4],
    pub(super) specular: [f32; 4],
    pub(super) velocity: [f32; 2],
}

impl Texel {
    /// A colour, and nothing else.
    pub(super) const fn of([r, g, b]: [f32; 3]) -> Self {
        Self {
            colour: [r, g, b, 1.0],
            depth: 0.0,
            normal: [0.0; 4],
            specular: [0.0; 4],
            velocity: [0.0; 2],
        }
    }

    /// The same surface, of another colour.
    pub(super) const fn coloured(self, [r, g, b]: [f32; 3]) -> Self {
        Self {
            colour: [r, g, b, 1.0],
            ..self
        }
    }
}

/// A size, a projection and the formats of the images.
#[derive(Clone, Copy, Debug)]
pub(super) struct Canvas {
    width: u32,
    height: u32,
    camera: CameraParams,
    formats: [Format; 5],
    delta_time: f32,
}

impl Canvas {
    /// Of a camera with 60° between its upper and lower edge and the near plane at
    /// 0.1. Pixels of pictures that are very wide are high, since a projection's
    /// scale is at least 1e-3.
    pub(super) fn new((width, height): (u32, u32)) -> Self {
        let aspect = (width as f32 / height as f32).min(1000.0);
        Self {
            width,
            height,
            camera: CameraParams::perspective(60_f32.to_radians(), aspect, 0.1),
            formats: Frame::IMAGES.map(|(_, format)| format),
            delta_time: FRAME_TIME,
        }
    }

    /// Of the usual size.
    pub(super) fn small() -> Self {
        Self::new(SMALL)
    }

    /// With the camera changed.
    pub(super) fn camera(mut self, change: impl FnOnce(&mut CameraParams)) -> Self {
        change(&mut self.camera);
        self
    }

    /// With depth of another kind.
    pub(super) fn range(self, range: DepthRange) -> Self {
        self.camera(|camera| camera.depth = range)
    }

    /// With 32 bits for each channel of everything.
    pub(super) const fn wide(mut self) -> Self {
        self.formats = [
            Format::Rgba32Float,
            Format::R32Float,
            Format::Rgba32Float,
            Format::Rgba32Float,
            Format::Rgba32Float,
        ];
        self
    }

    /// With so many seconds since the frame before.
    pub(super) const fn after(mut self, seconds: f32) -> Self {
        self.delta_time = seconds;
        self
    }

    /// Paints every pixel.
    pub(super) fn step(self, paint: impl Fn(&Spot) -> Texel) -> Result<Step, CaseError> {
        let size = FrameSize::new(self.width, self.height)?;
        let camera = self.camera;
        let scale = camera.scale.as_dvec2();
        let centre = camera.centre.as_dvec2();
        let near = f64::from(camera.near);
        let spots = (0..self.height).flat_map(|y| (0..self.width).map(move |x| (x, y)));
        let texels: Vec<Texel> = spots
            .map(|(x, y)| {
                let sides = DVec2::new(self.width.into(), self.height.into());
                let uv = (DVec2::new(x.into(), y.into()) + 0.5) / sides;
                let ndc = DVec2::new(2.0 * uv.x - 1.0, 1.0 - 2.0 * uv.y);
                paint(&Spot {
                    x,
                    y,
                    uv,
                    ray: ((ndc - centre) / scale).extend(-1.0),
                    index: y * self.width + x,
                    near,
                    range: camera.depth,
                })
            })
            .collect();
        let image = |index: usize, channels: fn(&Texel) -> [f32; 4]| {
            let desc = TextureDesc::d2(self.width, self.height, self.formats[index]);
            let values: Vec<[f32; 4]> = texels.iter().map(channels).collect();
            ImageData::from_rgba_f32(desc, &values)
        };
        let projection = Projection::new(scale, near)?;
        debug_assert_eq!(size.pixels(), texels.len());
        Ok(Step {
            frame: Frame {
                camera: FrameCamera {
                    projection,
                    view: DMat4::IDENTITY,
                    previous_view: DMat4::IDENTITY,
                },
                colour: image(0, |texel| texel.colour)?,
                depth: image(1, |texel| [texel.depth, 0.0, 0.0, 0.0])?,
                normal: image(2, |texel| texel.normal)?,
                specular: image(3, |texel| texel.specular)?,
                velocity: image(4, |texel| [texel.velocity[0], texel.velocity[1], 0.0, 0.0])?,
            },
            camera,
            delta_time: self.delta_time,
        })
    }

    /// The only frame of a case.
    pub(super) fn paint(self, paint: impl Fn(&Spot) -> Texel) -> Result<Vec<Step>, CaseError> {
        Ok(vec![self.step(paint)?])
    }
}
