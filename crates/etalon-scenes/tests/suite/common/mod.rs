//! What several tests need.

pub(crate) mod exr_files;
pub(crate) mod gltf_files;
pub(crate) mod shapes;

use std::path::PathBuf;

use etalon_core::image::ImageData;
use etalon_scenes::{FrameSize, World, scene};
use glam::DVec2;

pub(crate) fn size(width: u32, height: u32) -> FrameSize {
    FrameSize::new(width, height).unwrap()
}

pub(crate) fn world(name: &str) -> World {
    (scene(name).unwrap().build)().unwrap()
}

pub(crate) fn texels(image: &ImageData) -> Vec<[f32; 4]> {
    image.to_rgba_f32().unwrap()
}

/// The uv of every pixel's centre, row by row.
pub(crate) fn centres(size: FrameSize) -> impl Iterator<Item = DVec2> {
    (0..size.height()).flat_map(move |y| {
        (0..size.width()).map(move |x| {
            DVec2::new(
                (f64::from(x) + 0.5) / f64::from(size.width()),
                (f64::from(y) + 0.5) / f64::from(size.height()),
            )
        })
    })
}

/// A small generator of random numbers (PCG-XSH-RR, O'Neill 2014), so that
/// tests are the same everywhere.
pub(crate) struct Random(u64);

impl Random {
    pub(crate) fn new(seed: u64) -> Self {
        let mut random = Self(seed);
        random.bits();
        random
    }

    pub(crate) fn bits(&mut self) -> u32 {
        let old = self.0;
        self.0 = old
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        let shifted = (((old >> 18) ^ old) >> 27) as u32;
        shifted.rotate_right((old >> 59) as u32)
    }

    /// In `[low, high)`.
    pub(crate) fn within(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * f64::from(self.bits()) / 4_294_967_296.0
    }

    /// In the cube of half edge `reach` around the origin.
    pub(crate) fn vector(&mut self, reach: f64) -> glam::DVec3 {
        glam::DVec3::new(
            self.within(-reach, reach),
            self.within(-reach, reach),
            self.within(-reach, reach),
        )
    }

    /// Of unit length.
    pub(crate) fn direction(&mut self) -> glam::DVec3 {
        loop {
            let vector = self.vector(1.0);
            if (0.01..1.0).contains(&vector.length_squared()) {
                return vector.normalize();
            }
        }
    }
}

/// The path of an input below the folder that `ETALON_INPUTS` names, if it is there.
pub(crate) fn input(name: &str) -> Option<PathBuf> {
    match std::env::var_os("ETALON_INPUTS").map(|folder| PathBuf::from(folder).join(name)) {
        Some(path) if path.exists() => Some(path),
        Some(path) => {
            println!("skipped: there is no {}", path.display());
            None
        }
        None => {
            println!("skipped: ETALON_INPUTS is not set");
            None
        }
    }
}
