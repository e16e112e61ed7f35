//! Where on the screen something is.

use std::fmt;

/// A rectangle of the screen in uv: `[0, 0]` is its upper left corner, `[1, 1]` the
/// lower right one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Region {
    min: [f32; 2],
    max: [f32; 2],
}

impl Region {
    /// All of the screen.
    pub const FULL: Self = Self {
        min: [0.0; 2],
        max: [1.0; 2],
    };

    /// The part on the screen of a rectangle from `min` to `max`; `None` if that is
    /// empty. NaN, which could be anywhere, counts as the screen's edge.
    #[must_use]
    pub fn new(min: [f32; 2], max: [f32; 2]) -> Option<Self> {
        // `max` and `min` of floats take what is no NaN.
        let region = Self {
            min: min.map(|x| x.max(0.0)),
            max: max.map(|x| x.min(1.0)),
        };
        let within = |axis: usize| region.min[axis] < region.max[axis];
        (within(0) && within(1)).then_some(region)
    }

    /// The texels from `min` on up to and without `max` of a picture of `size`; `None`
    /// if there are none.
    #[must_use]
    pub fn of_texels(min: [u32; 2], max: [u32; 2], size: [u32; 2]) -> Option<Self> {
        if min[0] >= max[0] || min[1] >= max[1] {
            return None;
        }
        let share = |texels: [u32; 2], axis: usize, outward: f64| {
            // One rounding is less than 2⁻²⁴; the texel that it might take away is
            // given back by going outward by more.
            let uv = f64::from(texels[axis]) / f64::from(size[axis].max(1));
            (uv + outward * f64::from(f32::EPSILON)) as f32
        };
        Self::new(
            [share(min, 0, -1.0), share(min, 1, -1.0)],
            [share(max, 0, 1.0), share(max, 1, 1.0)],
        )
    }

    /// The upper left corner, each coordinate in `[0, 1]`.
    #[must_use]
    pub const fn min(&self) -> [f32; 2] {
        self.min
    }

    /// The lower right corner, each coordinate in `[0, 1]` and over that of `min`.
    #[must_use]
    pub const fn max(&self) -> [f32; 2] {
        self.max
    }

    /// The smallest region with both in it.
    #[must_use]
    pub fn union(self, other: Self) -> Self {
        let pick =
            |axis: usize, of: fn(f32, f32) -> f32, a: [f32; 2], b: [f32; 2]| of(a[axis], b[axis]);
        Self {
            min: [0, 1].map(|axis| pick(axis, f32::min, self.min, other.min)),
            max: [0, 1].map(|axis| pick(axis, f32::max, self.max, other.max)),
        }
    }

    /// The region with a border of so many texels of a picture of `size` around it.
    #[must_use]
    pub fn grown(self, texels: f32, size: [u32; 2]) -> Self {
        let by = size.map(|side| texels / side.max(1) as f32);
        Self {
            min: [0, 1].map(|axis| (self.min[axis] - by[axis]).max(0.0)),
            max: [0, 1].map(|axis| (self.max[axis] + by[axis]).min(1.0)),
        }
    }

    /// How much of the screen it is, in `(0, 1]`: an upper bound on how much of it has
    /// what the region bounds.
    #[must_use]
    pub fn coverage(&self) -> f32 {
        (self.max[0] - self.min[0]) * (self.max[1] - self.min[1])
    }

    /// The first texel that it touches in x and y, and the one after the last, in a
    /// picture of `size`.
    #[must_use]
    pub fn texels(&self, size: [u32; 2]) -> [[u32; 2]; 2] {
        let texel = |uv: [f32; 2], axis: usize, round: fn(f64) -> f64| {
            let at = round(f64::from(uv[axis]) * f64::from(size[axis]));
            (at.max(0.0) as u32).min(size[axis])
        };
        [
            [0, 1].map(|axis| texel(self.min, axis, f64::floor)),
            [0, 1].map(|axis| texel(self.max, axis, f64::ceil)),
        ]
    }
}

impl fmt::Display for Region {
    /// As the share of the screen that it is at most.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let percent = 100.0 * self.coverage();
        if *self == Self::FULL {
            f.write_str("all of the screen")
        } else if percent < 1.0 {
            write!(f, "at most {percent:.2} % of the screen")
        } else {
            write!(f, "at most {percent:.0} % of the screen")
        }
    }
}

/// The union of regions that may not be there.
#[must_use]
pub(crate) fn either(a: Option<Region>, b: Option<Region>) -> Option<Region> {
    match (a, b) {
        (Some(a), Some(b)) => Some(a.union(b)),
        (a, b) => a.or(b),
    }
}
