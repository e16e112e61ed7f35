//! An exact ray caster in f64: the truth that screen-space effects are measured
//! against.
//!
//! [`trace`] renders what an engine's geometry pass would hand to the effects;
//! [`true_reflection`] answers, for each of its pixels, what a perfect mirror
//! ray really meets and whether the screen could have known.
//!
//! [`TriangleScene`] casts rays at the triangles of a [model](mod@crate::model)
//! instead, and [`TriangleScene::truth`] says what a rasteriser should draw.

mod bvh;
mod check;
mod material;
mod primitive;
mod ray;
mod reflect;
mod render;
mod scene;
mod shade;
mod shape;
mod triangles;
mod watertight;

pub(crate) use material::hash;
pub use material::{Material, Pattern, Property};
pub use ray::{Hit, Ray, SurfaceId};
pub use reflect::{MirrorHit, MirrorRay, Reflection, true_reflection};
pub use render::trace;
pub use scene::{Ambient, Light, Object, Scene, SceneBuilder, SceneError, Sky};
pub use shape::{Mesh, Shape};
pub use triangles::{
    Faces, MAX_SCENE_TRIANGLES, SurfacePoint, TriangleHit, TriangleScene, TriangleSceneError,
    Truth, TruthOptions, TruthPixel,
};
