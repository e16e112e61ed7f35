//! A scene: objects, lights and what lies behind them.

use glam::DVec3;
use thiserror::Error;

use super::bvh::Bvh;
use super::check::{Check, split};
use super::material::Material;
use super::primitive::Primitive;
use super::ray::{Hit, Ray, SurfaceId};
use super::shape::Shape;

/// A shape of one material.
#[derive(Clone, Debug, PartialEq)]
pub struct Object {
    /// Its surface.
    pub shape: Shape,
    /// What it is made of.
    pub material: Material,
}

/// A source of light without extent; shadows are hard.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum Light {
    /// Light from infinitely far away.
    Directional {
        /// From where: any length but zero.
        towards: DVec3,
        /// Irradiance on a surface that faces the light.
        irradiance: DVec3,
    },
    /// Light from a point, falling off with the squared distance.
    Point {
        /// Where it is.
        position: DVec3,
        /// Irradiance at distance 1 on a surface that faces the light.
        intensity: DVec3,
        /// Nothing this near to the point casts a shadow, so that a lamp can
        /// have a visible, glowing body.
        body: f64,
    },
}

/// Light that comes from everywhere, and is not occluded.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Ambient {
    /// Radiance from above.
    pub above: DVec3,
    /// Radiance from below.
    pub below: DVec3,
}

/// What rays see that meet nothing: a vertical gradient.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Sky {
    /// Radiance at and below the horizon.
    pub horizon: DVec3,
    /// Radiance straight up.
    pub zenith: DVec3,
}

impl Sky {
    /// The radiance from a unit direction.
    #[must_use]
    pub fn at(&self, direction: DVec3) -> DVec3 {
        self.horizon.lerp(self.zenith, direction.y.max(0.0))
    }
}

/// Why a scene cannot be built.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum SceneError {
    /// A number in an object or light is no use.
    #[error("{what} of {which} {index} is {value}; it must be {need}")]
    Value {
        /// `object` or `light`.
        which: &'static str,
        /// Its place in the order they were added.
        index: usize,
        /// Which of its numbers.
        what: &'static str,
        /// As given.
        value: String,
        /// What would be right.
        need: &'static str,
    },
    /// A triangle refers to a corner its mesh does not have.
    #[error(
        "triangle {triangle} of object {object} refers to corner {corner}, but the mesh has {corners}"
    )]
    Corner {
        /// The object's place in the order they were added.
        object: usize,
        /// The triangle's place in the mesh.
        triangle: usize,
        /// As given.
        corner: u32,
        /// How many there are.
        corners: usize,
    },
    /// More primitives than can be numbered.
    #[error("the scene has over {0} primitives")]
    TooManyPrimitives(u32),
}

/// Collects what makes up a scene.
#[derive(Clone, Debug, Default)]
pub struct SceneBuilder {
    objects: Vec<Object>,
    lights: Vec<Light>,
    ambient: Ambient,
    sky: Sky,
}

impl SceneBuilder {
    /// Nothing yet: no object, no light, a black sky.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// Adds an object; its index is the number of objects added before it.
    pub fn object(&mut self, shape: Shape, material: Material) -> &mut Self {
        self.objects.push(Object { shape, material });
        self
    }

    /// Adds a light.
    pub fn light(&mut self, light: Light) -> &mut Self {
        self.lights.push(light);
        self
    }

    /// Adds a glowing sphere and the light it gives.
    ///
    /// A sphere of radiance `L` and radius `r` has the intensity `π r² L`.
    pub fn lamp(&mut self, center: DVec3, radius: f64, radiance: DVec3) -> &mut Self {
        self.object(Shape::Sphere { center, radius }, Material::light(radiance));
        let intensity = radiance * (std::f64::consts::PI * radius * radius);
        // A little more than the body, whose points are at the radius only up to rounding.
        self.light(Light::Point {
            position: center,
            intensity,
            body: radius * 1.001,
        })
    }

    /// Sets the light from everywhere.
    pub fn ambient(&mut self, ambient: Ambient) -> &mut Self {
        self.ambient = ambient;
        self
    }

    /// Sets what is behind everything.
    pub fn sky(&mut self, sky: Sky) -> &mut Self {
        self.sky = sky;
        self
    }

    /// Checks everything and prepares it for tracing.
    ///
    /// # Errors
    /// At the first number that is not finite, length that is not positive,
    /// edges that are not at right angles, or index out of range.
    pub fn build(&self) -> Result<Scene, SceneError> {
        let mut primitives = Vec::new();
        let mut owners = Vec::new();
        for (index, object) in self.objects.iter().enumerate() {
            split(index, &object.shape, &mut primitives)?;
            // Ids count up to u32::MAX − 1.
            if primitives.len() >= u32::MAX as usize {
                return Err(SceneError::TooManyPrimitives(u32::MAX));
            }
            owners.resize(primitives.len(), index as u32);
        }
        for (index, light) in self.lights.iter().enumerate() {
            let check = Check {
                which: "light",
                index,
            };
            match *light {
                Light::Directional {
                    towards,
                    irradiance,
                } => {
                    check.direction("direction", towards)?;
                    check.finite("irradiance", irradiance)?;
                }
                Light::Point {
                    position,
                    intensity,
                    body,
                } => {
                    check.finite("position", position)?;
                    check.finite("intensity", intensity)?;
                    check.number("body radius", body, "finite and not negative", |x| x >= 0.0)?;
                }
            }
        }
        let bounded = primitives
            .iter()
            .enumerate()
            .filter_map(|(index, primitive)| {
                let (low, high) = primitive.bounds()?;
                // Intersections are exact to some units in the last place of the
                // coordinates involved; boxes are wider than that by far.
                let margin =
                    DVec3::splat(1e-9 * (low.abs().max_element() + high.abs().max_element()));
                Some((index as u32, low - margin, high + margin))
            });
        let bvh = Bvh::new(bounded);
        let endless = (0_u32..)
            .zip(&primitives)
            .filter_map(|(index, primitive)| primitive.bounds().is_none().then_some(index))
            .collect();
        Ok(Scene {
            objects: self.objects.clone(),
            lights: self.lights.clone(),
            ambient: self.ambient,
            sky: self.sky,
            primitives,
            owners,
            bvh,
            endless,
        })
    }
}

/// A scene ready for tracing. It does not change any more.
#[derive(Clone, Debug)]
pub struct Scene {
    objects: Vec<Object>,
    lights: Vec<Light>,
    ambient: Ambient,
    sky: Sky,
    primitives: Vec<Primitive>,
    /// For each primitive, its object.
    owners: Vec<u32>,
    bvh: Bvh,
    /// Primitives without bounds, tried for every ray.
    endless: Vec<u32>,
}

impl Scene {
    /// The objects, in the order they were added.
    #[must_use]
    pub fn objects(&self) -> &[Object] {
        &self.objects
    }

    /// The lights, in the order they were added.
    #[must_use]
    pub fn lights(&self) -> &[Light] {
        &self.lights
    }

    /// The light from everywhere.
    #[must_use]
    pub const fn ambient(&self) -> Ambient {
        self.ambient
    }

    /// What is behind everything.
    #[must_use]
    pub const fn sky(&self) -> Sky {
        self.sky
    }

    /// The material of the object that was hit by a ray in this scene.
    pub(crate) fn material(&self, hit: &Hit) -> &Material {
        &self.objects[hit.object as usize].material
    }

    /// The nearest hit. Of several at the same parameter, the object added
    /// first.
    #[must_use]
    pub fn intersect(&self, ray: &Ray) -> Option<Hit> {
        let mut best = Nearest::default();
        for &index in &self.endless {
            best.offer(self, ray, index);
        }
        self.bvh.traverse(ray, best.limit(), |index, _| {
            best.offer(self, ray, index);
            best.limit()
        });
        best.hit
    }

    /// The nearest hit, found by trying every primitive: slow, and what
    /// [`Scene::intersect`] must agree with exactly.
    #[must_use]
    pub fn intersect_exhaustively(&self, ray: &Ray) -> Option<Hit> {
        let mut best = Nearest::default();
        for index in 0..self.primitives.len() {
            best.offer(self, ray, index as u32);
        }
        best.hit
    }

    /// Whether anything is hit before the parameter `end`.
    #[must_use]
    pub fn occluded(&self, ray: &Ray, end: f64) -> bool {
        let hits = |index: u32| {
            let left = ray.face_left(index);
            self.primitives[index as usize]
                .meet(ray, left, end)
                .is_some_and(|meeting| meeting.t < end)
        };
        if self.endless.iter().any(|&index| hits(index)) {
            return true;
        }
        let mut found = false;
        self.bvh.traverse(ray, end, |index, limit| {
            if found || hits(index) {
                found = true;
                // Nothing begins before this: the search ends.
                f64::NEG_INFINITY
            } else {
                limit
            }
        });
        found
    }
}

/// The best hit so far.
#[derive(Default)]
struct Nearest {
    hit: Option<Hit>,
}

impl Nearest {
    fn limit(&self) -> f64 {
        self.hit.map_or(f64::INFINITY, |hit| hit.t)
    }

    fn offer(&mut self, scene: &Scene, ray: &Ray, index: u32) {
        let Some(meeting) =
            scene.primitives[index as usize].meet(ray, ray.face_left(index), self.limit())
        else {
            return;
        };
        if self
            .hit
            .is_some_and(|hit| meeting.t == hit.t && hit.surface.primitive < index)
        {
            return;
        }
        let towards = if meeting.normal.dot(ray.direction()) > 0.0 {
            -1.0
        } else {
            1.0
        };
        self.hit = Some(Hit {
            t: meeting.t,
            position: meeting.position,
            normal: meeting.normal * towards,
            object: scene.owners[index as usize],
            surface: SurfaceId {
                primitive: index,
                face: meeting.face,
            },
        });
    }
}
