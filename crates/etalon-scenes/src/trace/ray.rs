//! Rays and what they hit.

use glam::DVec3;

/// A half-line `origin + t · direction` on which hits count where `t > start`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ray {
    origin: DVec3,
    direction: DVec3,
    start: f64,
    from: Option<SurfaceId>,
}

impl Ray {
    /// A ray in any direction; parameters `t` are in units of its length.
    #[must_use]
    pub const fn new(origin: DVec3, direction: DVec3) -> Self {
        Self {
            origin,
            direction,
            start: 0.0,
            from: None,
        }
    }

    /// The same ray with hits only beyond `t`.
    #[must_use]
    pub const fn starting_at(self, t: f64) -> Self {
        Self { start: t, ..self }
    }

    /// The same ray, known to leave a surface that therefore cannot be hit again.
    ///
    /// Every primitive is convex and a planar one has no inside, so a ray that
    /// starts *on* a surface meets the same surface again only at its start —
    /// in exact arithmetic. Leaving that surface out is exact; it needs no
    /// distance by which to move the origin, so it works equally well at any
    /// scale and at any distance from the world's origin. A ray into a sphere
    /// or box meets its far side: that is a different root or face and is kept.
    #[must_use]
    pub const fn leaving(self, surface: SurfaceId) -> Self {
        Self {
            from: Some(surface),
            ..self
        }
    }

    /// Where it starts.
    #[must_use]
    pub const fn origin(&self) -> DVec3 {
        self.origin
    }

    /// Where it goes.
    #[must_use]
    pub const fn direction(&self) -> DVec3 {
        self.direction
    }

    /// From which parameter on hits count.
    #[must_use]
    pub const fn start(&self) -> f64 {
        self.start
    }

    /// The point at a parameter.
    #[must_use]
    pub fn at(&self, t: f64) -> DVec3 {
        self.origin + self.direction * t
    }

    /// The face of `primitive` that the ray leaves, if it leaves that one.
    pub(crate) fn face_left(&self, primitive: u32) -> Option<u8> {
        self.from
            .filter(|from| from.primitive == primitive)
            .map(|from| from.face)
    }
}

/// A smooth piece of surface: a primitive, and for boxes which of its faces.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SurfaceId {
    pub(crate) primitive: u32,
    /// Boxes: twice the axis, plus one on the positive side. Others: 0.
    pub(crate) face: u8,
}

/// Where a ray meets a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// Ray parameter.
    pub t: f64,
    /// The point, moved onto the surface as closely as rounding allows.
    pub position: DVec3,
    /// Unit normal on the side the ray comes from.
    pub normal: DVec3,
    /// Index of the object in the scene.
    pub object: u32,
    /// For rays that continue from here: see [`Ray::leaving`].
    pub surface: SurfaceId,
}

impl Hit {
    /// A ray in `direction` from this point.
    #[must_use]
    pub const fn ray(&self, direction: DVec3) -> Ray {
        Ray::new(self.position, direction).leaving(self.surface)
    }
}
