//! Models: what backends draw themselves, by vertices and fragments.
//!
//! [`ModelParts`] is written down freely; [`Model::new`] checks it as a whole,
//! and from then on every index in it has its element and every number is in
//! its range. [`Model::at`] poses it: a [`Snapshot`] has the [`Instances`] with
//! their matrices in this frame and in the one before, lights and cameras.
//! Positions, matrices and directions are right-handed with +Y up, in metres.
//!
//! * [`shapes`]: meshes by closed forms.
//! * [`gltf`]: models from glTF 2.0 files.
//! * [`Drawable`]: what backends draw them from.
//! * [`Shot`]: a model before a camera, with the passes that draw it.
//! * [`flat_normals`], [`tangents`]: what meshes may come without.
//! * [`crate::trace::TriangleScene`]: what rays see of a snapshot.
//!
//! ```
//! use etalon_scenes::model::{Material, Model, ModelParts, Node, Transform, shapes};
//!
//! # fn main() -> Result<(), etalon_scenes::model::ModelError> {
//! let mut parts = ModelParts::default();
//! let ball = parts.mesh(shapes::icosphere("ball", 0.5, 3)?);
//! let gold = parts.material(Material::metal("gold", [1.0, 0.77, 0.34], 0.3));
//! parts.node(Node::with_part("ball", Transform::at([0.0, 1.0, -3.0]), ball, gold));
//! let snapshot = Model::new(parts)?.at(0.0)?;
//! assert_eq!(snapshot.instances.all()[0].world.w_axis.z, -3.0);
//! # Ok(())
//! # }
//! ```

mod animation;
mod derive;
mod drawable;
mod error;
pub mod gltf;
mod light;
mod material;
mod mesh;
mod moment;
mod node;
mod parts;
pub mod shapes;
mod shot;
mod texture;

pub use animation::{Animation, Interpolation, Track, Values};
pub use derive::{flat_normals, tangents};
pub(crate) use drawable::is_blended;
pub use drawable::{Drawable, Imported, lights, view};
pub use error::{ModelError, Place};
pub use etalon_effects::geometry::DrawClass;
pub use light::{Light, LightKind};
pub use material::{AlphaMode, Material, TextureUse, UvTransform, Volume};
pub use mesh::{MAX_TRIANGLES, MAX_VERTICES, Mesh, Vertices};
pub use moment::{Instance, Instances, Moment, PlacedLight, Snapshot};
pub use node::{MAX_JOINTS, Node, Part, Skin, Transform};
pub use parts::{MAX_INSTANCES, Model, ModelParts, Viewpoint};
pub use shot::{Drawn, Shot, ShotError};
pub use texture::{Filter, Image, MAX_IMAGE_SIDE, Sampler, Texture, Wrap};
