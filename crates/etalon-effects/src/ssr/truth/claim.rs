//! Is what a march stored a reflection?
//!
//! A search that steps may miss what the exact one finds, and may find a crossing
//! behind it. What it does store has to be one: on the texel's mirror ray, within
//! the thickness of a cell that lies above the plane of the start, and as far along
//! the ray as it says. This asks nothing of how it was found.

use glam::DVec2;
use thiserror::Error;

use super::{Ray, Search, Ssr};
use crate::check::same_size;
use crate::ssr::HitStorage;
use crate::truth::Plane;
use crate::{CameraParams, EffectError};

/// Why a stored reflection is none.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
pub enum FalseHit {
    /// A coordinate or the visibility is no share.
    #[error("{0} is not in [0, 1]")]
    Range(f64),
    /// The texel shows nothing, or nothing that mirrors.
    #[error("the texel has no mirror ray")]
    NoRay,
    /// It is not where the ray passes.
    #[error("it is {texels:.3} texels from the ray, which ends after {end:.3}")]
    Beside {
        /// How far.
        texels: f64,
        /// Length of the ray in texels.
        end: f64,
    },
    /// There is no surface that the ray is inside of.
    #[error("the ray is {residue:e} behind what is there, of a thickness of {thickness:e}")]
    Outside {
        /// In view units; not a number where there is nothing.
        residue: f64,
        /// In view units.
        thickness: f64,
    },
    /// What is there lies below the plane that the ray leaves.
    #[error("what is there is {height:e} above the plane that the ray leaves")]
    Below {
        /// In view units.
        height: f64,
    },
    /// The ray is of another length.
    #[error("the ray is {stored:e} long, not {exact:e}")]
    Length {
        /// As stored, in view units.
        stored: f64,
        /// In view units.
        exact: f64,
    },
}

/// What a texel's ray may be said to hit.
pub struct Claims<'a> {
    search: Search<'a>,
    normals: &'a Plane,
}

impl std::fmt::Debug for Claims<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "Claims({}, {})", self.search.width, self.search.height)
    }
}

/// How far f32 may be off after the operations of a march, of which each rounds by
/// 2^-24: some ten of them one after the other.
const OFF: f64 = 1.0 / (1 << 20) as f64;

impl<'a> Claims<'a> {
    /// On the images that were searched, as [`hits`](super::hits) takes them.
    ///
    /// # Errors
    /// Those of [`hits`](super::hits).
    pub fn new(
        depth: &Plane,
        normal: &'a Plane,
        camera: &CameraParams,
        settings: &'a Ssr,
    ) -> Result<Self, EffectError> {
        settings.validate()?;
        camera.validate()?;
        same_size("ssr", ("depth", depth.size()), ("normal", normal.size()))?;
        Ok(Self {
            search: Search::new(depth, camera, settings)?,
            normals: normal,
        })
    }

    /// Looks at what is stored for a texel: u, v, visibility and length of the ray. All
    /// 0 says that nothing was hit, which is always allowed.
    ///
    /// # Errors
    /// The first thing that is not so.
    pub fn check(&self, [x, y]: [u32; 2], stored: [f64; 4]) -> Result<(), FalseHit> {
        if stored == [0.0; 4] {
            return Ok(());
        }
        let [u, v, visibility, length] = stored;
        let share = |value: f64| (0.0..=1.0).contains(&value);
        if let Some(&wrong) = [u, v, visibility].iter().find(|value| !share(**value)) {
            return Err(FalseHit::Range(wrong));
        }
        let search = &self.search;
        let (x, y) = (i64::from(x), i64::from(y));
        let ray = search.ray(x, y, self.normals.at(x, y));
        let ray = ray.ok_or(FalseHit::NoRay)?;
        let size = search.view.size;
        let pixel = DVec2::new(u, v) * size;
        // Places are known as well as their storage tells and f32 computes them.
        let rounding = match search.settings.storage {
            HitStorage::Full => OFF,
            HitStorage::Half => 1.0 / 4096.0,
        };
        let near = size.max_element() * (rounding + OFF);
        let place = if ray.step.x.abs() >= ray.step.y.abs() {
            (pixel.x - ray.origin.x) / ray.step.x
        } else {
            (pixel.y - ray.origin.y) / ray.step.y
        };
        let aside = (ray.origin + ray.step * place - pixel).abs().max_element();
        let beyond = (place - ray.end).max(-place);
        let texels = aside.max(beyond);
        // Written so that what is no number is wrong.
        let passes = texels <= 2.0 * near;
        if !passes {
            let end = ray.end;
            return Err(FalseHit::Beside { texels, end });
        }
        self.surface(&ray, (x, y), pixel, place, near)?;
        let at = |place: f64| {
            let pixel = ray.origin + ray.step * place;
            search.view.position(pixel, ray.distance(place))
        };
        let exact = at(place).distance(ray.start);
        let unsure = at(place + near).distance(at(place - near));
        // 2^-11 is also what a half float rounds by.
        let as_long = (length - exact).abs() <= unsure + exact / 1024.0;
        if !as_long {
            let stored = length;
            return Err(FalseHit::Length { stored, exact });
        }
        Ok(())
    }

    /// Whether any cell that the place may be in is hit there.
    fn surface(
        &self,
        ray: &Ray,
        own: (i64, i64),
        pixel: DVec2,
        place: f64,
        near: f64,
    ) -> Result<(), FalseHit> {
        let search = &self.search;
        let thickness = f64::from(search.settings.thickness);
        let distance = ray.distance(place);
        let unsure = (ray.distance(place + near) - distance)
            .abs()
            .max((ray.distance(place - near) - distance).abs())
            + distance * OFF;
        let cells = |at: f64, last: i64| {
            let cell = |at: f64| (at.floor() as i64).clamp(0, last - 1);
            cell(at - near)..=cell(at + near)
        };
        let mut wrong = FalseHit::Outside {
            residue: f64::NAN,
            thickness,
        };
        for y in cells(pixel.y, search.height) {
            for x in cells(pixel.x, search.width) {
                let Some(cell) = search.cell(x, y).filter(|cell| cell.front > 0.0) else {
                    continue;
                };
                let surface = 1.0 / cell.front;
                let residue = distance - surface;
                let unsure = unsure + surface * OFF;
                if !(residue > -unsure && residue < thickness + unsure) {
                    wrong = FalseHit::Outside { residue, thickness };
                    continue;
                }
                let centre = DVec2::new(x as f64 + 0.5, y as f64 + 0.5);
                let offset = search.view.position(centre, surface) - ray.start;
                let height = offset.dot(ray.normal);
                // The cell that the ray leaves is never above itself.
                let least = -(surface.max(1.0 / ray.inverse)) * OFF;
                if (x, y) == own || height <= least {
                    wrong = FalseHit::Below { height };
                    continue;
                }
                return Ok(());
            }
        }
        Err(wrong)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ssr::truth::hits;

    const SIZE: u32 = 24;

    /// A mirror below, seen at a slope, and a wall behind it.
    fn room(camera: &CameraParams) -> (Plane, Plane) {
        let seen = |_: u32, y: u32| {
            let ndc = 1.0 - 2.0 * (f64::from(y) + 0.5) / f64::from(SIZE);
            let slope = ndc / f64::from(camera.scale.y);
            let floor = -1.0 / slope;
            if slope < 0.0 && floor < 5.0 {
                (floor, [0.0, 1.0, 0.0, 0.0])
            } else {
                (5.0, [0.0, 0.0, 1.0, 0.0])
            }
        };
        let depth = Plane::from_fn(SIZE, SIZE, |x, y| {
            [f64::from(camera.near) / seen(x, y).0, 0.0, 0.0, 0.0]
        });
        let normal = Plane::from_fn(SIZE, SIZE, |x, y| seen(x, y).1);
        (depth.unwrap(), normal.unwrap())
    }

    #[test]
    fn exact_hits_are_claims_that_hold_and_moved_ones_are_not() {
        let camera = CameraParams::perspective(1.0, 1.0, 0.1);
        let settings = Ssr::default();
        let (depth, normal) = room(&camera);
        let claims = Claims::new(&depth, &normal, &camera, &settings).unwrap();
        let found = hits(&depth, &normal, &camera, &settings).unwrap();
        let mut checked = 0;
        for (index, hit) in (0_u32..).zip(&found) {
            let at = [index % SIZE, index / SIZE];
            assert_eq!(claims.check(at, [0.0; 4]), Ok(()));
            let Some(hit) = hit else {
                let claimed = claims.check(at, [0.5, 0.25, 1.0, 3.0]);
                assert!(claimed.is_err(), "{at:?}");
                continue;
            };
            checked += 1;
            let stored = [hit.uv.x, hit.uv.y, hit.visibility, hit.length];
            assert_eq!(claims.check(at, stored), Ok(()), "{at:?}: {hit:?}");
            let [u, v, visibility, length] = stored;
            let texel = 1.0 / f64::from(SIZE);
            for wrong in [
                [u + texel, v, visibility, length],
                [u, v + 4.0 * texel, visibility, length],
                [u, v, visibility, length * 1.01],
                [u, v, 1.5, length],
                [u, f64::NAN, visibility, length],
                // Half a texel on is a place on the ray that is in front of the wall or
                // another length.
                [u, v + 0.5 * texel, visibility, length],
                // The texel itself.
                [
                    (f64::from(at[0]) + 0.5) * texel,
                    (f64::from(at[1]) + 0.5) * texel,
                    visibility,
                    0.0,
                ],
            ] {
                assert!(claims.check(at, wrong).is_err(), "{at:?}: {wrong:?}");
            }
        }
        assert!(checked > 50, "{checked}");
    }
}
