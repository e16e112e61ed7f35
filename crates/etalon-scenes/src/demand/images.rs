//! The demands of images: every texel is looked at.

use etalon_core::image::ImageData;
use etalon_core::texel::Texel;
use etalon_effects::demand::{Bright, Demands, Moving, Reflective, Region};

use super::DIM;
use crate::Frame;

/// Grows around texels.
#[derive(Clone, Copy, Default)]
struct Bounds(Option<[[u32; 2]; 2]>);

impl Bounds {
    fn add(&mut self, x: u32, y: u32) {
        self.0 = Some(match self.0 {
            Some([min, max]) => [
                [min[0].min(x), min[1].min(y)],
                [max[0].max(x + 1), max[1].max(y + 1)],
            ],
            None => [[x, y], [x + 1, y + 1]],
        });
    }

    fn region(self, size: [u32; 2]) -> Option<Region> {
        let [min, max] = self.0?;
        Region::of_texels(min, max, size)
    }
}

/// Light as kernels read it: no number is none, and infinity is the largest half float.
fn radiance(channel: f32) -> f32 {
    if channel > 0.0 {
        channel.min(65_504.0)
    } else {
        0.0
    }
}

/// Calls `see` with the place and the channels of every texel.
fn each(image: &ImageData, mut see: impl FnMut(u32, u32, [f32; 4])) {
    let format = image.desc.format;
    let width = image.desc.extent.width.max(1);
    let texels = image.bytes.chunks_exact(format.texel_bytes() as usize);
    for (index, bytes) in (0_u32..).zip(texels) {
        if let Texel::Float(channels) = format.decode(bytes) {
            see(index % width, index / width, channels);
        }
    }
}

impl Frame {
    /// What is on the images, exactly: surfaces where depth is not 0, mirrors where
    /// specular colour is not, motion where velocity is not. A camera that moved is said
    /// to move whatever velocity says. Light that passes through surfaces is in the
    /// colour already.
    #[must_use]
    pub fn demands(&self) -> Demands {
        let size = [self.size().width(), self.size().height()];
        let mut demands = Demands::default();

        let mut surfaces = Bounds::default();
        let mut depths = Vec::with_capacity(self.size().pixels());
        each(&self.depth, |x, y, [depth, ..]| {
            depths.push(depth);
            if depth != 0.0 {
                surfaces.add(x, y);
            }
        });
        if let Some(region) = surfaces.region(size) {
            demands = demands.with_surfaces(region);
        }

        let mut mirrors = Bounds::default();
        let (mut smoothest, mut roughest, mut most) = (1.0_f32, 0.0_f32, 0.0_f32);
        let mut depth = 0.0_f32;
        let mut places = depths.into_iter();
        each(&self.specular, |x, y, [r, g, b, shininess]| {
            let specular = r.max(g).max(b);
            let own = places.next().unwrap_or(0.0);
            if specular > 0.0 {
                // Other depths are of no surface, see `distance_of` in lib/camera.
                if own > 0.0 && own.is_finite() {
                    depth = depth.max(own);
                }
                mirrors.add(x, y);
                let roughness = 1.0 - shininess;
                smoothest = smoothest.min(roughness);
                roughest = roughest.max(roughness);
                most = most.max(specular);
            }
        });
        if let Some(region) = mirrors.region(size) {
            demands = demands.with_reflective(Reflective {
                region,
                roughness: [smoothest, roughest],
                specular: most,
                nearest: self.camera.projection.near() as f32 / depth,
            });
        }

        let mut lit = Bounds::default();
        let (mut peak, mut floor) = (0.0_f32, 0.0_f32);
        each(&self.colour, |x, y, [r, g, b, _]| {
            let brightest = radiance(r).max(radiance(g)).max(radiance(b));
            peak = peak.max(brightest);
            if brightest > DIM {
                lit.add(x, y);
            } else {
                floor = floor.max(brightest);
            }
        });
        if peak > 0.0 {
            // Where nothing is over the floor, any region bounds it.
            let region = lit.region(size).unwrap_or(Region::FULL);
            demands = demands.with_bright(Bright {
                peak,
                floor,
                region,
            });
        }

        let mut moved = Bounds::default();
        each(&self.velocity, |x, y, [u, v, ..]| {
            // NaN as well.
            if !(u == 0.0 && v == 0.0) {
                moved.add(x, y);
            }
        });
        demands.with_moving(Moving {
            camera: self.camera.view != self.camera.previous_view,
            objects: moved.region(size),
        })
    }
}
