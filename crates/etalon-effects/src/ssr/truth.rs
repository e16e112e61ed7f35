//! The truth of screen-space reflection: every ray against every cell of the
//! depth image that it passes.
//!
//! # Definition
//! A depth image says one distance for each texel, so the screen is made of
//! *cells*, each with a surface of constant distance. From the centre of a texel
//! leaves the mirror ray, a straight line in view space that is cut
//!
//! * `max_distance` from its start,
//! * at the near plane,
//! * at the edge of the picture.
//!
//! Its projection onto the picture is a straight line, too. It hits the first
//! cell in which, at some place of its way through,
//!
//! * it is behind the cell's surface by more than 0 and less than `thickness`
//!   (a cell without a surface is never hit),
//! * and the cell's surface, at the cell's centre, lies above the plane of the
//!   start.
//!
//! The hit is where this begins to be so. Along the projection 1/distance is
//! linear, so the place is the solution of a linear equation, and nothing is
//! stepped, bisected or missed between steps. Surfaces seen edge-on or from
//! behind reflect nothing, nor do rays that project onto half a texel or less.
//!
//! `resolution`, `search`, `steps`, `march_limit` and `storage` do not enter.
//!
//! A slope is a stair of cells in such an image, and its steps can be hit: a ray
//! toward the eye may be behind a cell's surface where it enters the cell, and
//! before it again at the cell's middle, where the effect looks. That is the
//! truth about the screen; what the scene would say is another question.

pub mod claim;

use glam::{DVec2, DVec3, DVec4, Vec4Swizzles as _};

use super::{Blend, Ssr};
use crate::check::same_size;
use crate::truth::{Plane, light, reserved, smooth, unit_interval};
use crate::{CameraParams, DepthRange, EffectError};

/// What the mirror ray of a texel hits.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct TrueHit {
    /// Where in the picture, `(0, 0)` its top left corner and `(1, 1)` its
    /// bottom right one.
    pub uv: DVec2,
    /// Of the ray from the view plane, in view units.
    pub distance: f64,
    /// How far behind the cell's surface that is, in view units, from 0 to
    /// `thickness`: 0 where the ray crosses the surface, `thickness` where it
    /// comes from behind, between them where it enters the cell from the side.
    pub residue: f64,
    /// Of the ray, in view units.
    pub length: f64,
    /// How much the fades leave of it, in `[0, 1]`.
    pub visibility: f64,
}

/// The images that are searched and mirrored, all of one size: those of
/// [`SceneInputs`](crate::SceneInputs).
#[derive(Clone, Debug, PartialEq)]
pub struct ScreenData {
    /// Linear light; made finite where it is read.
    pub colour: Plane,
    /// Device depth in the first channel.
    pub depth: Plane,
    /// View-space normals in the first three channels, of any length.
    pub normal: Plane,
    /// Share of each colour that is mirrored, and shininess in the fourth channel.
    pub specular: Plane,
}

/// The projection, in f64.
struct View {
    scale: DVec2,
    centre: DVec2,
    /// `depth = bias + slope / distance`.
    bias: f64,
    slope: f64,
    near: f64,
    /// From where on there is no surface.
    background: f64,
    /// Of the picture, in texels.
    size: DVec2,
}

impl View {
    fn new(camera: &CameraParams, [width, height]: [u32; 2]) -> Self {
        let near = f64::from(camera.near);
        // The projection matrix's third row: depths of `near` and `far` are 1 and
        // 0 for a reversed range, 0 and 1 for a standard one.
        let finite = |far: f32, at_near: f64, at_far: f64| {
            let slope = (at_near - at_far) / (1.0 / near - 1.0 / f64::from(far));
            (at_near - slope / near, slope)
        };
        let (bias, slope) = match camera.depth {
            DepthRange::ReversedInfinite => (0.0, near),
            DepthRange::StandardInfinite => (1.0, -near),
            DepthRange::Reversed { far } => finite(far, 1.0, 0.0),
            DepthRange::Standard { far } => finite(far, 0.0, 1.0),
        };
        Self {
            scale: camera.scale.as_dvec2(),
            centre: camera.centre.as_dvec2(),
            bias,
            slope,
            near,
            background: camera.distance_range().y.into(),
            size: DVec2::new(width.into(), height.into()),
        }
    }

    /// Distance of a device depth; `None` where there is no surface.
    fn distance(&self, depth: f64) -> Option<f64> {
        let distance = self.slope / (depth - self.bias);
        // A surface on the near plane may have been rounded to before it.
        let first = self.near * (1.0 - 1.0 / f64::from(1 << 20));
        (first..self.background)
            .contains(&distance)
            .then_some(distance)
    }

    /// View position of what is seen at a place in texels.
    fn position(&self, pixel: DVec2, distance: f64) -> DVec3 {
        let uv = pixel / self.size;
        let ndc = DVec2::new(2.0 * uv.x - 1.0, 1.0 - 2.0 * uv.y);
        ((ndc - self.centre) / self.scale * distance).extend(-distance)
    }

    /// Where a view position at a distance is seen, in texels.
    fn pixel(&self, position: DVec3, distance: f64) -> DVec2 {
        let ndc = self.scale * position.truncate() / distance + self.centre;
        DVec2::new(0.5 + 0.5 * ndc.x, 0.5 - 0.5 * ndc.y) * self.size
    }
}

/// A cell's surface: reciprocals of its distance and of that at which its
/// thickness ends, both 0 where there is none.
#[derive(Clone, Copy, Default)]
struct Cell {
    front: f64,
    back: f64,
}

/// A mirror ray on the picture. Places along it are counted in texels of the
/// axis along which it gets further.
struct Ray {
    /// View position and unit normal of the start.
    start: DVec3,
    normal: DVec3,
    /// Cosine between the ray and the direction back to the eye.
    back: f64,
    /// In texels, and its change along the ray.
    origin: DVec2,
    step: DVec2,
    /// 1/distance at the start, and its change along the ray.
    inverse: f64,
    slope: f64,
    /// Where the ray is cut.
    end: f64,
}

impl Ray {
    /// From the view plane, at a place.
    fn distance(&self, place: f64) -> f64 {
        1.0 / (self.inverse + self.slope * place)
    }
}

/// A cell passed for less than this, in texels, is touched at a corner, which
/// rounding decides.
const TOUCH: f64 = 1e-9;

/// A height above a plane that is none, as a share of the distance at which it is:
/// some thousand roundings of f64.
const ROUNDING: f64 = 1e-12;

struct Search<'a> {
    view: View,
    settings: &'a Ssr,
    cells: Vec<Cell>,
    width: i64,
    height: i64,
}

impl<'a> Search<'a> {
    fn new(depth: &Plane, camera: &CameraParams, settings: &'a Ssr) -> Result<Self, EffectError> {
        let view = View::new(camera, depth.size());
        let mut cells = reserved(depth.texels().len())?;
        cells.extend(depth.texels().iter().map(|texel| {
            let Some(distance) = view.distance(texel[0]) else {
                return Cell::default();
            };
            Cell {
                front: 1.0 / distance,
                back: 1.0 / (distance + f64::from(settings.thickness)),
            }
        }));
        Ok(Self {
            view,
            settings,
            cells,
            width: depth.width().into(),
            height: depth.height().into(),
        })
    }

    fn cell(&self, x: i64, y: i64) -> Option<Cell> {
        let inside = (0..self.width).contains(&x) && (0..self.height).contains(&y);
        inside.then(|| self.cells[(y * self.width + x) as usize])
    }

    /// The mirror ray of a texel; `None` if nothing can be met on it.
    fn ray(&self, x: i64, y: i64, normal: [f64; 4]) -> Option<Ray> {
        let view = &self.view;
        let cell = self.cell(x, y).filter(|cell| cell.front > 0.0)?;
        let distance = 1.0 / cell.front;
        let normal = unit(DVec4::from(normal).xyz())?;
        let origin = DVec2::new(x as f64 + 0.5, y as f64 + 0.5);
        let start = view.position(origin, distance);
        let incident = start.normalize();
        if incident.dot(normal) >= 0.0 {
            return None;
        }
        let direction = incident - 2.0 * incident.dot(normal) * normal;

        let mut reach = f64::from(self.settings.max_distance);
        if direction.z > 0.0 {
            reach = reach.min((distance - view.near).max(0.0) / direction.z);
        }
        let tip = start + direction * reach;
        let tip_distance = distance - direction.z * reach;
        let way = view.pixel(tip, tip_distance) - origin;
        let texels = way.abs().max_element();
        // Written so that what is no number is none, too.
        if !(texels > 0.5 && texels.is_finite()) {
            return None;
        }
        let step = way / texels;
        let room = |origin: f64, step: f64, size: f64| {
            if step > 0.0 {
                (size - origin) / step
            } else if step < 0.0 {
                origin / -step
            } else {
                f64::INFINITY
            }
        };
        Some(Ray {
            start,
            normal,
            back: -incident.dot(direction),
            origin,
            step,
            inverse: cell.front,
            slope: (1.0 / tip_distance - cell.front) / texels,
            end: texels.min(room(origin.x, step.x, view.size.x)).min(room(
                origin.y,
                step.y,
                view.size.y,
            )),
        })
    }

    /// The first hit of a ray that leaves from a texel.
    fn first(&self, mut x: i64, mut y: i64, ray: &Ray) -> Option<TrueHit> {
        // Where the ray leaves a column or row of cells.
        let leaves = |cell: i64, origin: f64, step: f64| {
            let edge = if step > 0.0 { cell + 1 } else { cell };
            if step == 0.0 {
                f64::INFINITY
            } else {
                (edge as f64 - origin) / step
            }
        };
        let mut entry = 0.0;
        // The first cell is the start's own, whose surface lies in its plane and
        // not above it.
        let mut own = true;
        loop {
            let out_x = leaves(x, ray.origin.x, ray.step.x);
            let out_y = leaves(y, ray.origin.y, ray.step.y);
            let exit = out_x.min(out_y).min(ray.end);
            let cell = self.cell(x, y)?;
            if !own
                && exit - entry > TOUCH
                && let Some(place) = crossing(ray, cell, entry, exit)
                && self.above(ray, x, y, cell)
            {
                return Some(self.hit(ray, cell, place));
            }
            if exit >= ray.end {
                return None;
            }
            own = false;
            // Through a corner both change.
            if out_x <= exit {
                x += if ray.step.x > 0.0 { 1 } else { -1 };
            }
            if out_y <= exit {
                y += if ray.step.y > 0.0 { 1 } else { -1 };
            }
            entry = exit;
        }
    }

    /// Whether a cell's surface lies above the plane that the ray leaves.
    fn above(&self, ray: &Ray, x: i64, y: i64, cell: Cell) -> bool {
        let centre = DVec2::new(x as f64 + 0.5, y as f64 + 0.5);
        let point = self.view.position(centre, 1.0 / cell.front);
        // Of one plane's own cells rounding makes a trace more than nothing.
        (point - ray.start).dot(ray.normal) > ROUNDING / cell.front
    }

    fn hit(&self, ray: &Ray, cell: Cell, place: f64) -> TrueHit {
        let thickness = f64::from(self.settings.thickness);
        let pixel = ray.origin + ray.step * place;
        let distance = ray.distance(place);
        let residue = (distance - 1.0 / cell.front).clamp(0.0, thickness);
        let length = self.view.position(pixel, distance).distance(ray.start);
        let uv = pixel / self.view.size;
        TrueHit {
            uv,
            distance,
            residue,
            length,
            visibility: self.visibility(ray.back, residue, length, uv),
        }
    }

    /// The product of the fades that [`Ssr`] documents.
    fn visibility(&self, back: f64, residue: f64, length: f64, uv: DVec2) -> f64 {
        let settings = self.settings;
        let fade = |amount: f64, strength: f32| 1.0 - f64::from(strength) * smooth(amount);
        let border = f64::from(settings.border);
        let edge = if border > 0.0 {
            smooth(uv.min(1.0 - uv).min_element() / border)
        } else {
            1.0
        };
        fade(back, settings.camera_fade)
            * fade(residue / f64::from(settings.thickness), settings.depth_fade)
            * fade(
                length / f64::from(settings.max_distance),
                settings.distance_fade,
            )
            * edge
    }
}

/// The direction of a vector, if it has one that f32 can tell: squares of
/// lengths beyond 1e±30 leave its range of full precision.
fn unit(vector: DVec3) -> Option<DVec3> {
    let squared = vector.length_squared();
    (1e-30..=1e30)
        .contains(&squared)
        .then(|| vector / squared.sqrt())
}

/// Where between `entry` and `exit` the ray begins to be within a cell's
/// thickness.
fn crossing(ray: &Ray, cell: Cell, entry: f64, exit: f64) -> Option<f64> {
    let within = |inverse: f64| cell.back < inverse && inverse < cell.front;
    if ray.slope == 0.0 {
        return within(ray.inverse).then_some(entry);
    }
    let front = (cell.front - ray.inverse) / ray.slope;
    let back = (cell.back - ray.inverse) / ray.slope;
    // A ray toward the eye comes from behind.
    let begin = entry.max(front.min(back));
    let end = exit.min(front.max(back));
    (begin < end).then_some(begin)
}

/// What each texel mirrors: the exact first crossing of its mirror ray, or
/// `None`, row by row from the top.
///
/// `depth` holds device depth in its first channel, `normal` view-space normals
/// in its first three. What is no depth is no surface, and a normal that is no
/// direction reflects nothing.
///
/// # Errors
/// If a setting or the camera is out of range, the images differ in size, or
/// memory runs out.
pub fn hits(
    depth: &Plane,
    normal: &Plane,
    camera: &CameraParams,
    settings: &Ssr,
) -> Result<Vec<Option<TrueHit>>, EffectError> {
    settings.validate()?;
    camera.validate()?;
    same_size("ssr", ("depth", depth.size()), ("normal", normal.size()))?;
    let search = Search::new(depth, camera, settings)?;
    let mut found = reserved(depth.texels().len())?;
    let mut normals = normal.texels().iter();
    for y in 0..search.height {
        for (x, &normal) in (0..search.width).zip(&mut normals) {
            let ray = search.ray(x, y, normal);
            found.push(ray.and_then(|ray| search.first(x, y, &ray)));
        }
    }
    Ok(found)
}

/// Mean over `2 radius + 1` texels in each axis, the edge repeated.
fn blurred(picture: &Plane, radius: u32) -> Result<Plane, EffectError> {
    let reach = i64::from(radius);
    let along = |picture: &Plane, dx: i64, dy: i64| {
        Plane::from_fn(picture.width(), picture.height(), |x, y| {
            let sum: DVec4 = (-reach..=reach)
                .map(|i| DVec4::from(picture.at(i64::from(x) + dx * i, i64::from(y) + dy * i)))
                .sum();
            (sum / (2 * reach + 1) as f64).to_array()
        })
    };
    Ok(along(&along(picture, 1, 0)?, 0, 1)?)
}

/// The scene with its reflections: the result of [`ssr`](fn@super::ssr) with true
/// hits.
///
/// The colour at each hit, interpolated between texels, counts by the hit's
/// visibility; a box blur of that is mixed in by roughness; and the specular map
/// says how much of it the scene gets, in the way of `settings.blend`. Of the
/// size of the inputs, with the scene's alpha, and not limited at the top.
///
/// # Errors
/// If a setting or the camera is out of range, the images differ in size, or
/// memory runs out.
pub fn picture(
    screen: &ScreenData,
    camera: &CameraParams,
    settings: &Ssr,
) -> Result<Plane, EffectError> {
    let found = hits(&screen.depth, &screen.normal, camera, settings)?;
    let size = screen.depth.size();
    for (name, image) in [("colour", &screen.colour), ("specular", &screen.specular)] {
        same_size("ssr", ("depth", size), (name, image.size()))?;
    }
    let scene = screen.colour.clone().sanitised();
    let extent = DVec2::new(size[0].into(), size[1].into());
    let mut mirrored = found.iter();
    let sharp = Plane::from_fn(size[0], size[1], |_, _| {
        mirrored.next().copied().flatten().map_or([0.0; 4], |hit| {
            let colour = scene.bilinear(hit.uv * extent).xyz();
            (colour.extend(1.0) * hit.visibility).to_array()
        })
    })?;
    let soft = if settings.blur_radius > 0 {
        Some(blurred(&sharp, settings.blur_radius)?)
    } else {
        None
    };
    let soft = soft.as_ref().unwrap_or(&sharp).texels().iter();
    let mut inputs = screen
        .specular
        .texels()
        .iter()
        .zip(sharp.texels())
        .zip(soft);
    Ok(scene.map(|texel| {
        let Some(((specular, sharp), soft)) = inputs.next() else {
            return texel;
        };
        let material = DVec4::from(specular.map(unit_interval));
        let amount = material.xyz();
        let reflection = DVec4::from(*sharp).lerp(DVec4::from(*soft), 1.0 - material.w);
        let kept = match settings.blend {
            Blend::Add => DVec3::ONE,
            Blend::Replace => (1.0 - amount * reflection.w).clamp(DVec3::ZERO, DVec3::ONE),
        };
        let colour = light(texel) * kept + reflection.xyz() * amount;
        colour.extend(texel[3]).to_array()
    }))
}
