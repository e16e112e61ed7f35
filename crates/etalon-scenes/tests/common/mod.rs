//! What several tests need.

/// A small generator of random numbers (PCG-XSH-RR, O'Neill 2014), so that
/// tests are the same everywhere.
pub(crate) struct Random(u64);

#[allow(dead_code, reason = "each test uses its own part")]
impl Random {
    pub(crate) fn new(seed: u64) -> Self {
        let mut random = Self(seed);
        random.bits();
        random
    }

    pub(crate) fn bits(&mut self) -> u32 {
        let old = self.0;
        self.0 = old.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        let shifted = (((old >> 18) ^ old) >> 27) as u32;
        shifted.rotate_right((old >> 59) as u32)
    }

    /// In `[low, high)`.
    pub(crate) fn within(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * f64::from(self.bits()) / 4_294_967_296.0
    }

    /// In the cube of half edge `reach` around the origin.
    pub(crate) fn vector(&mut self, reach: f64) -> glam::DVec3 {
        glam::DVec3::new(self.within(-reach, reach), self.within(-reach, reach), self.within(-reach, reach))
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
