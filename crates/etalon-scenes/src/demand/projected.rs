//! Where on the screen a box is.

use etalon_effects::demand::Region;
use etalon_effects::geometry::View;
use glam::{DMat4, DVec3};

/// Where on the screen something is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Seen {
    /// Holds all texels that it can cover.
    pub region: Region,
    /// Distance along the view axis below which nothing of it is.
    pub nearest: f32,
}

impl Seen {
    /// Anywhere.
    pub(super) const FULL: Self = Self {
        region: Region::FULL,
        nearest: 0.0,
    };
}

/// Where triangles within a box can be seen.
///
/// The part of the box in front of the near plane is projected corner by corner: what
/// is within it is seen within the hull of those. Corners are where f32 can put them,
/// and the region has a border of one texel, since rasterisers move vertices by up to
/// a 512th of one and cover texels whose centres are in.
pub(super) fn seen(bounds: [DVec3; 2], world: DMat4, view: &View, size: [u32; 2]) -> Option<Seen> {
    let world_view = view.view * world;
    let near = f64::from(view.camera.near);
    let corners: [DVec3; 8] = std::array::from_fn(|corner| {
        let pick = |axis: usize| bounds[corner >> axis & 1][axis];
        DVec3::new(pick(0), pick(1), pick(2))
    });
    let placed = corners.map(|corner| world_view.transform_point3(corner));
    let errors = corners.map(|corner| error(&world_view, corner));
    let slack = errors.iter().fold(0.0, |most: f64, error| most.max(*error));
    // Where f32 may see the near plane.
    let near = (near - slack).max(0.5 * near);
    let mut seen: Vec<(DVec3, f64)> = Vec::with_capacity(20);
    for (place, error) in placed.iter().zip(errors) {
        if !place.is_finite() {
            return Some(Seen::FULL);
        }
        if -place.z >= near {
            seen.push((*place, error));
        }
    }
    for axis in 0..3 {
        for corner in (0..8_usize).filter(|corner| corner >> axis & 1 == 0) {
            let (from, to) = (placed[corner], placed[corner | 1 << axis]);
            let (a, b) = (-from.z - near, -to.z - near);
            if (a < 0.0) != (b < 0.0) {
                let cut = from + (to - from) * (a / (a - b));
                seen.push((DVec3::new(cut.x, cut.y, -near), slack));
            }
        }
    }
    let scale = view.camera.scale.as_dvec2();
    let centre = view.camera.centre.as_dvec2();
    let mut rectangle: Option<[[f64; 2]; 2]> = None;
    let mut nearest = f64::INFINITY;
    for (place, error) in seen {
        let distance = -place.z;
        nearest = nearest.min(distance - error);
        let at = [
            0.5 + 0.5 * (scale.x * place.x / distance + centre.x),
            0.5 - 0.5 * (scale.y * place.y / distance + centre.y),
        ];
        // Of the quotient, from errors of what is divided and of the divisor.
        let off = |scale: f64, place: f64| {
            let least = (distance - error).max(0.5 * near);
            0.5 * scale * (error + place.abs() * error / least) / least
        };
        let off = [off(scale.x, place.x), off(scale.y, place.y)];
        let [min, max] = rectangle.unwrap_or([[f64::INFINITY; 2], [f64::NEG_INFINITY; 2]]);
        rectangle = Some([
            [0, 1].map(|axis| min[axis].min(at[axis] - off[axis])),
            [0, 1].map(|axis| max[axis].max(at[axis] + off[axis])),
        ]);
    }
    let [min, max] = rectangle?;
    // The border first: what is beside the screen by less than it may be on it.
    let border = size.map(|side| 1.0 / f64::from(side.max(1)));
    let low = [0, 1].map(|axis| (min[axis] - border[axis]) as f32);
    let high = [0, 1].map(|axis| (max[axis] + border[axis]) as f32);
    Some(Seen {
        region: Region::new(low, high)?,
        // Depth is stored in f32, a fragment's from rounded ones of its corners.
        nearest: ((1.0 - 1e-5) * nearest).max(0.0) as f32,
    })
}

/// How far off f32 can be where it places a corner: some roundings of each product.
fn error(world_view: &DMat4, corner: DVec3) -> f64 {
    let largest = |of: DVec3| of.abs().max_element();
    let sum = largest(world_view.x_axis.truncate()) * corner.x.abs()
        + largest(world_view.y_axis.truncate()) * corner.y.abs()
        + largest(world_view.z_axis.truncate()) * corner.z.abs()
        + largest(world_view.w_axis.truncate());
    8.0 * f64::from(f32::EPSILON) * sum
}

#[cfg(test)]
mod tests {
    use etalon_effects::CameraParams;

    use super::*;

    const SIZE: [u32; 2] = [200, 100];

    fn view() -> View {
        View {
            // Half the height is seen at as large a distance.
            camera: CameraParams::perspective(std::f32::consts::FRAC_PI_2, 2.0, 0.1),
            view: DMat4::IDENTITY,
            previous: DMat4::IDENTITY,
        }
    }

    fn region(low: [f64; 3], high: [f64; 3]) -> Option<Region> {
        let bounds = [low.into(), high.into()];
        Some(seen(bounds, DMat4::IDENTITY, &view(), SIZE)?.region)
    }

    #[test]
    fn the_nearest_is_a_corner_or_where_the_near_plane_cuts() {
        let nearest = |low: [f64; 3], high: [f64; 3]| {
            let bounds = [low.into(), high.into()];
            seen(bounds, DMat4::IDENTITY, &view(), SIZE)
                .unwrap()
                .nearest
        };
        let close = |found: f32, exact: f32| found <= exact && found > exact * 0.999;
        assert!(close(nearest([-0.5, -0.25, -3.0], [0.5, 0.25, -1.0]), 1.0));
        assert!(close(nearest([-0.5, -0.25, -3e6], [0.5, 0.25, -2e6]), 2e6));
        assert!(close(nearest([-1.0, -1.0, -3.0], [1.0, 1.0, 3.0]), 0.1));
    }

    #[test]
    fn a_box_in_front_is_where_its_nearest_face_is_region() {
        let region = region([-0.5, -0.25, -3.0], [0.5, 0.25, -1.0]).unwrap();
        // u = ½ + ½ · ½ x / d, v = ½ − ½ y / d, and a texel around it.
        let texels = region.texels(SIZE);
        // The border's edge is on a texel's edge up to rounding.
        let near = |found: u32, wanted: u32| found.abs_diff(wanted) <= 1;
        for (found, wanted) in texels.as_flattened().iter().zip([74, 36, 126, 64]) {
            assert!(near(*found, wanted), "{texels:?}");
        }
    }

    #[test]
    fn what_is_behind_or_beside_is_not_region() {
        assert_eq!(region([-1.0, -1.0, 1.0], [1.0, 1.0, 3.0]), None);
        assert_eq!(region([-1.0, -1.0, -0.05], [1.0, 1.0, 3.0]), None);
        assert_eq!(region([90.0, -1.0, -3.0], [99.0, 1.0, -2.0]), None);
        // Up to a texel beside it may be.
        assert!(region([4.01, -1.0, -2.1], [9.0, 1.0, -2.0]).is_some());
    }

    #[test]
    fn what_reaches_behind_the_camera_is_cut_at_the_near_plane() {
        assert_eq!(
            region([-1.0, -1.0, -3.0], [1.0, 1.0, 3.0]),
            Some(Region::FULL)
        );
        // A wall to the right, from far ahead to far behind.
        let region = region([1.0, -1.0, -1e4], [1.5, 1.0, 1e4]).unwrap();
        assert!(region.min()[0] > 0.49 && region.min()[0] <= 0.5);
        assert_eq!(region.max()[0], 1.0);
    }
}
