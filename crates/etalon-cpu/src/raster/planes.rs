//! From clip space to pixels, and the planes that numbers of a triangle lie in.
//!
//! Everything here is `f32`, and the order of operations is llvmpipe's (Mesa's sources
//! of May 2023), so that depths can come out with the same bits as on lavapipe:
//!
//! * `draw_llvm.c`, `generate_viewport`: `1 / w` first, then `x · (1 / w)`, then a
//!   fused multiply-add with half of the viewport's size and its centre. Vulkan 1.3
//!   (§27.8, §27.9) divides by w, which is within an ulp of it.
//! * `lp_setup_tri.c`, `calc_fixed_position`: corners are moved to the nearest
//!   1/256 of a pixel, ties to even, after ½ was taken off.
//! * `lp_state_setup.c`, `init_args`, `calc_coef4`, `lp_do_offset_tri`: gradients
//!   come from the corners as they were *before* they were moved; sums and products
//!   are rounded one by one. The plane of depth is taken to the corner of the
//!   target, which costs digits for small triangles far from it.
//! * `lp_bld_interp.c`, `attribs_update_simple`: `a + dx · x` and `+ dy · y` are
//!   fused (`llvm.fmuladd`, on processors that have it); the depth bias is added
//!   last. What is interpolated with perspective is multiplied by `1 / (1 / w)`.
//!
//! Planes of everything but depth are kept around the first corner, as later versions
//! of Mesa do with all: no digits get lost that way.

use etalon_core::raster::{DepthBias, SUB_PIXEL_BITS, Viewport};

use crate::exec::Fused;

/// Units of fixed-point positions in a pixel.
pub(super) const SUB_PIXELS: i32 = 1 << SUB_PIXEL_BITS;

/// The largest target along an axis, in pixels.
pub(super) const MAX_TARGET: u32 = 16384;

/// Where clip space goes.
#[derive(Clone, Copy, Debug)]
pub(super) struct ViewportMap {
    pub(super) scale: [f32; 3],
    pub(super) offset: [f32; 3],
    pub(super) near: f32,
    pub(super) far: f32,
}

/// A corner in the picture.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Corner {
    /// Pixels from the left edge.
    pub(super) x: f32,
    /// Pixels from the top edge.
    pub(super) y: f32,
    /// Depth.
    pub(super) z: f32,
    /// 1 / w.
    pub(super) w: f32,
}

impl ViewportMap {
    pub(super) fn new(viewport: &Viewport) -> Self {
        let (half_x, half_y) = (viewport.width / 2.0, viewport.height / 2.0);
        Self {
            // Clip space has y up, pixels have it down.
            scale: [half_x, -half_y, viewport.far - viewport.near],
            offset: [viewport.x + half_x, viewport.y + half_y, viewport.near],
            near: viewport.near,
            far: viewport.far,
        }
    }

    /// The corner of a position in clip space.
    #[inline(always)]
    pub(super) fn corner<F: Fused>(&self, [x, y, z, w]: [f32; 4]) -> Corner {
        let w = 1.0 / w;
        Corner {
            x: F::mul_add(x * w, self.scale[0], self.offset[0]),
            y: F::mul_add(y * w, self.scale[1], self.offset[1]),
            z: F::mul_add(z * w, self.scale[2], self.offset[2]),
            w,
        }
    }

    /// The corner of a vertex that clipping made, whose products and sums llvmpipe does
    /// not fuse.
    pub(super) fn cut_corner(&self, [x, y, z, w]: [f32; 4]) -> Corner {
        let w = 1.0 / w;
        Corner {
            x: x * w * self.scale[0] + self.offset[0],
            y: y * w * self.scale[1] + self.offset[1],
            z: z * w * self.scale[2] + self.offset[2],
            w,
        }
    }

    /// Depth as it is compared and stored: within the viewport's range.
    #[inline(always)]
    pub(super) fn clamp(&self, z: f32) -> f32 {
        let z = if z > self.near { z } else { self.near };
        if z < self.far { z } else { self.far }
    }
}

/// A coordinate in [`SUB_PIXELS`] from the centre of the first pixel. What is not a
/// number gives 0.
#[inline(always)]
pub(super) fn snap(pixels: f32) -> i32 {
    ((pixels - 0.5) * SUB_PIXELS as f32).round_ties_even() as i32
}

/// A number's value at a place, and its differences to the right and down.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Plane {
    pub(super) a: f32,
    pub(super) dx: f32,
    pub(super) dy: f32,
}

impl Plane {
    /// The value so many pixels from where the plane's is.
    #[inline(always)]
    pub(super) fn at<F: Fused>(&self, x: f32, y: f32) -> f32 {
        F::mul_add(self.dy, y, F::mul_add(self.dx, x, self.a))
    }
}

/// What the gradients of a triangle's numbers are made of.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Gradients {
    /// The first corner, from the centre of the first pixel.
    pub(super) origin: [f32; 2],
    dx01: f32,
    dy01: f32,
    dx20: f32,
    dy20: f32,
}

/// The gradients of a triangle and 1 / (twice its area).
pub(super) struct Shape {
    pub(super) gradients: Gradients,
    inverse: f32,
    differences: [[f32; 2]; 2],
}

impl Shape {
    /// Of corners whose fixed-point positions, `snapped`, go round counter-clockwise.
    pub(super) fn new(corners: &[Corner; 3], snapped: &[[i32; 2]; 3]) -> Self {
        let given = corners.map(|corner| [corner.x, corner.y]);
        let shape = Self::of(given);
        // Slivers may have no area, or a negative one, before they were moved: then
        // what is drawn has none of their gradients.
        if shape.inverse > 0.0 && shape.inverse.is_finite() {
            return shape;
        }
        Self::of(snapped.map(|at| at.map(|axis| axis as f32 / SUB_PIXELS as f32 + 0.5)))
    }

    fn of([p0, p1, p2]: [[f32; 2]; 3]) -> Self {
        let [dx01, dy01] = [p0[0] - p1[0], p0[1] - p1[1]];
        let [dx20, dy20] = [p2[0] - p0[0], p2[1] - p0[1]];
        let inverse = 1.0 / (dx01 * dy20 - dy01 * dx20);
        Self {
            gradients: Gradients {
                origin: [p0[0] - 0.5, p0[1] - 0.5],
                dx01: dx01 * inverse,
                dy01: dy01 * inverse,
                dx20: dx20 * inverse,
                dy20: dy20 * inverse,
            },
            inverse,
            differences: [[dx01, dy01], [dx20, dy20]],
        }
    }

    /// What is added to the triangle's depths: Vulkan 1.3, §28.10.2, whose m and r
    /// are taken as [`DepthBias`] says. `fixed` for Depth16Unorm.
    pub(super) fn bias(&self, bias: &DepthBias, corners: &[Corner; 3], fixed: bool) -> f32 {
        if bias.is_none() {
            return 0.0;
        }
        let [c0, c1, c2] = corners;
        let [[dx01, dy01], [dx20, dy20]] = self.differences;
        let (dz01, dz20) = (c0.z - c1.z, c2.z - c0.z);
        let dzdx = ((dz20 * dy01 - dy20 * dz01) * self.inverse).abs();
        let dzdy = ((dx20 * dz01 - dz20 * dx01) * self.inverse).abs();
        let slope = if dzdx > dzdy { dzdx } else { dzdy } * bias.slope;
        let unit = if fixed {
            1.0 / 65535.0
        } else {
            let most = c0.z.abs().max(c1.z.abs()).max(c2.z.abs());
            // The power of two of the largest depth, and 23 bits down.
            let exponent = (most.to_bits() & 0x7f80_0000) as i32 - (23 << 23);
            f32::from_bits(exponent.max(0) as u32)
        };
        let sum = unit * bias.constant as f32 + slope;
        let sum = if bias.clamp > 0.0 {
            sum.min(bias.clamp)
        } else if bias.clamp < 0.0 {
            sum.max(bias.clamp)
        } else {
            sum
        };
        // Degenerate slopes must not make every depth NaN.
        if sum.is_nan() { 0.0 } else { sum }
    }
}

impl Gradients {
    /// The plane of numbers at the corners, around the first one.
    #[inline(always)]
    pub(super) fn around_corner(&self, [a0, a1, a2]: [f32; 3]) -> Plane {
        let (da01, da20) = (a0 - a1, a2 - a0);
        Plane {
            a: a0,
            dx: da01 * self.dy20 - da20 * self.dy01,
            dy: da20 * self.dx01 - da01 * self.dx20,
        }
    }

    /// The plane of numbers at the corners, around the first pixel's centre.
    #[inline(always)]
    pub(super) fn around_target(&self, values: [f32; 3]) -> Plane {
        let plane = self.around_corner(values);
        let [x, y] = self.origin;
        Plane {
            a: plane.a - (plane.dx * x + plane.dy * y),
            ..plane
        }
    }
}
