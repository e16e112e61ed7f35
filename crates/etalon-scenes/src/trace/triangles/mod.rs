//! Rays through a model's triangles: the same f32 data that a renderer draws,
//! in f64.

mod clearance;
mod truth;

use glam::{DMat3, DMat4, DVec2, DVec3};
use thiserror::Error;

use super::bvh::Bvh;
use super::ray::Ray;
use super::watertight::{Crossing, cross};
use crate::model::{Instance, Material, Mesh, Model, Snapshot};

pub use truth::{SurfacePoint, Truth, TruthOptions, TruthPixel};

/// Most triangles of a scene, over all its instances.
pub const MAX_SCENE_TRIANGLES: u64 = 1 << 25;

/// Why a model cannot be traced.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum TriangleSceneError {
    /// More triangles than can be kept.
    #[error("the instances have {count} triangles together; there must be at most {limit}")]
    TooMany {
        /// Over all instances.
        count: u64,
        /// [`MAX_SCENE_TRIANGLES`].
        limit: u64,
    },
    /// The host has not that much memory to give.
    #[error("the triangles take {bytes} bytes, which do not fit into memory")]
    OutOfMemory {
        /// Bytes asked for.
        bytes: u64,
    },
    /// The snapshot is of another model.
    #[error("instance {instance} refers to {what} {index}, but the model has {count}")]
    Foreign {
        /// Its place among the snapshot's instances.
        instance: usize,
        /// `mesh` or `material`.
        what: &'static str,
        /// As given.
        index: usize,
        /// How many there are.
        count: usize,
    },
}

/// Which sides of triangles count.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Faces {
    /// Front faces, and back faces of materials that are double sided: what is
    /// left after back-face culling.
    #[default]
    Drawn,
    /// All.
    Both,
}

/// Where a ray meets a triangle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TriangleHit {
    /// Ray parameter: the distance, for directions of unit length.
    pub t: f64,
    /// World position, by the weights of the corners.
    pub position: DVec3,
    /// The instance's place among the snapshot's instances.
    pub instance: u32,
    /// The triangle's place in its mesh.
    pub triangle: u32,
    /// Weights of the triangle's corners: not negative, of sum 1.
    pub weights: [f64; 3],
    /// Unit normal of the triangle in the world, on its front side.
    pub geometric_normal: DVec3,
    /// Unit normal in the world: the vertices' normals interpolated in the
    /// mesh's space, then transformed and made of unit length. On the front side
    /// as the mesh has it: not turned around for hits of the back face.
    pub normal: DVec3,
    /// Interpolated texture coordinates; 0 for a set that the mesh lacks.
    pub uv: [DVec2; 2],
    /// Whether the front face was hit.
    pub front: bool,
}

struct Triangle {
    corners: [DVec3; 3],
    instance: u32,
    /// In its mesh.
    index: u32,
}

/// An instance, with its matrices in f64.
struct Placed<'a> {
    instance: Instance,
    mesh: &'a Mesh,
    material: &'a Material,
    previous: DMat4,
    /// Takes normals to the world, up to their length.
    normals: DMat3,
    mirrored: bool,
}

/// The triangles of a snapshot's instances in the world.
///
/// Corners are `world · position`, both as a renderer gets them in f32, computed
/// in f64. Triangles without area are left out: no ray hits them. Surfaces are
/// opaque whatever their alpha, and skins do not move them: leave such instances
/// out where that matters.
pub struct TriangleScene<'a> {
    placed: Vec<Placed<'a>>,
    triangles: Vec<Triangle>,
    degenerate: usize,
    bvh: Bvh,
}

impl<'a> TriangleScene<'a> {
    /// All instances of a snapshot.
    ///
    /// # Errors
    /// As [`TriangleScene::of`].
    pub fn new(model: &'a Model, snapshot: &Snapshot) -> Result<Self, TriangleSceneError> {
        Self::of(model, snapshot, |_| true)
    }

    /// Those instances of a snapshot that `keep` says yes to, as those of
    /// opaque materials. They are known by their places in the snapshot all the
    /// same.
    ///
    /// # Errors
    /// If the snapshot is not of this model, there are too many triangles, or
    /// memory runs out.
    pub fn of(
        model: &'a Model,
        snapshot: &Snapshot,
        keep: impl Fn(&Instance) -> bool,
    ) -> Result<Self, TriangleSceneError> {
        let parts = model.parts();
        let mut placed = Vec::new();
        let mut count = 0_u64;
        let mut kept = Vec::new();
        for (place, instance) in snapshot.instances.all().iter().enumerate() {
            let foreign = |what, index, count| TriangleSceneError::Foreign {
                instance: place,
                what,
                index,
                count,
            };
            let meshes = parts.meshes.len();
            let mesh = (parts.meshes.get(instance.mesh))
                .ok_or_else(|| foreign("mesh", instance.mesh, meshes))?;
            let materials = parts.materials.len();
            let material = (parts.materials.get(instance.material))
                .ok_or_else(|| foreign("material", instance.material, materials))?;
            let keep = keep(instance);
            kept.push(keep);
            if keep {
                count = count.saturating_add(mesh.triangles().len() as u64);
            }
            placed.push(Placed::new(*instance, mesh, material));
        }
        if count > MAX_SCENE_TRIANGLES {
            return Err(TriangleSceneError::TooMany {
                count,
                limit: MAX_SCENE_TRIANGLES,
            });
        }
        let mut triangles = Vec::new();
        triangles.try_reserve_exact(count as usize).map_err(|_| {
            TriangleSceneError::OutOfMemory {
                bytes: count * size_of::<Triangle>() as u64,
            }
        })?;
        let mut degenerate = 0;
        for (instance, placed) in placed.iter().enumerate().filter(|(i, _)| kept[*i]) {
            let world = placed.instance.world.as_dmat4();
            for (index, corners) in placed.mesh.triangles().iter().enumerate() {
                let corners = corners.map(|i| world.transform_point3(placed.position(i)));
                if area_vector(&corners).try_normalize().is_none() {
                    degenerate += 1;
                    continue;
                }
                triangles.push(Triangle {
                    corners,
                    instance: instance as u32,
                    index: index as u32,
                });
            }
        }
        let bvh = Bvh::new((0_u32..).zip(&triangles).map(|(i, triangle)| {
            let [a, b, c] = triangle.corners;
            let (low, high) = (a.min(b).min(c), a.max(b).max(c));
            // As for other primitives: far more than intersections are off.
            let margin = DVec3::splat(1e-9 * (low.abs().max_element() + high.abs().max_element()));
            (i, low - margin, high + margin)
        }));
        Ok(Self {
            placed,
            triangles,
            degenerate,
            bvh,
        })
    }

    /// Triangles that can be hit.
    #[must_use]
    pub fn triangles(&self) -> usize {
        self.triangles.len()
    }

    /// Triangles that were left out because they have no area.
    #[must_use]
    pub const fn degenerate(&self) -> usize {
        self.degenerate
    }

    /// The nearest hit. Of several at the same parameter, that of the first
    /// instance, and of its first triangle.
    #[must_use]
    pub fn intersect(&self, ray: &Ray, faces: Faces) -> Option<TriangleHit> {
        let (index, crossing) = self.nearest(ray, faces)?;
        Some(self.hit(index, &crossing))
    }

    /// The nearest hit, found by trying every triangle: slow, and what
    /// [`TriangleScene::intersect`] must agree with exactly.
    #[must_use]
    pub fn intersect_exhaustively(&self, ray: &Ray, faces: Faces) -> Option<TriangleHit> {
        let mut best = Nearest(None);
        for index in 0..self.triangles.len() {
            best.offer(self, ray, faces, index as u32);
        }
        let (index, crossing) = best.0?;
        Some(self.hit(index, &crossing))
    }

    /// Where the point that was hit was one frame earlier.
    #[must_use]
    pub fn previous_position(&self, hit: &TriangleHit) -> DVec3 {
        let placed = &self.placed[hit.instance as usize];
        let corners = placed.mesh.triangles()[hit.triangle as usize];
        let at = mix(corners.map(|i| placed.position(i)), hit.weights);
        placed.previous.transform_point3(at)
    }

    fn nearest(&self, ray: &Ray, faces: Faces) -> Option<(u32, Crossing)> {
        let mut best = Nearest(None);
        self.bvh.traverse(ray, f64::INFINITY, |index, _| {
            best.offer(self, ray, faces, index);
            best.limit()
        });
        best.0
    }

    /// Whether a side of a triangle counts.
    fn counts(&self, triangle: &Triangle, counter_clockwise: bool, faces: Faces) -> bool {
        let placed = &self.placed[triangle.instance as usize];
        faces == Faces::Both || placed.material.double_sided || placed.is_front(counter_clockwise)
    }

    fn hit(&self, index: u32, crossing: &Crossing) -> TriangleHit {
        let triangle = &self.triangles[index as usize];
        let placed = &self.placed[triangle.instance as usize];
        let weights = crossing.weights;
        let side = if placed.mirrored { -1.0 } else { 1.0 };
        let geometric_normal = area_vector(&triangle.corners).normalize_or(DVec3::Y) * side;
        let vertices = placed.mesh.vertices();
        let corners = placed.mesh.triangles()[triangle.index as usize];
        let normals = corners.map(|i| wide(vertices.normals[i as usize]));
        let uv = [0, 1].map(|set| {
            let uv = &vertices.uv[set];
            let at = |i: u32| {
                uv.get(i as usize)
                    .map_or(DVec2::ZERO, |uv| DVec2::from_array(uv.map(f64::from)))
            };
            let [a, b, c] = corners.map(at);
            a * weights[0] + b * weights[1] + c * weights[2]
        });
        TriangleHit {
            t: crossing.t,
            position: mix(triangle.corners, weights),
            instance: triangle.instance,
            triangle: triangle.index,
            weights,
            geometric_normal,
            // Normals that cancel, or that a flattened instance has none of.
            normal: (placed.normals * mix(normals, weights))
                .try_normalize()
                .unwrap_or(geometric_normal),
            uv,
            front: placed.is_front(crossing.counter_clockwise),
        }
    }
}

impl<'a> Placed<'a> {
    fn new(instance: Instance, mesh: &'a Mesh, material: &'a Material) -> Self {
        let linear = DMat3::from_mat4(instance.world.as_dmat4());
        let (x, y, z) = (linear.x_axis, linear.y_axis, linear.z_axis);
        let mirrored = linear.determinant() < 0.0;
        let side = if mirrored { -1.0 } else { 1.0 };
        Self {
            instance,
            mesh,
            material,
            previous: instance.previous.as_dmat4(),
            // The matrix of cofactors: the transposed inverse times the
            // determinant, and there is one even where there is no inverse.
            normals: DMat3::from_cols(y.cross(z), z.cross(x), x.cross(y)) * side,
            mirrored,
        }
    }

    fn position(&self, vertex: u32) -> DVec3 {
        wide(self.mesh.vertices().positions[vertex as usize])
    }

    const fn is_front(&self, counter_clockwise: bool) -> bool {
        counter_clockwise != self.mirrored
    }
}

/// The best hit so far.
struct Nearest(Option<(u32, Crossing)>);

impl Nearest {
    fn limit(&self) -> f64 {
        self.0.map_or(f64::INFINITY, |(_, crossing)| crossing.t)
    }

    fn offer(&mut self, scene: &TriangleScene<'_>, ray: &Ray, faces: Faces, index: u32) {
        let triangle = &scene.triangles[index as usize];
        let Some(crossing) = cross(ray, &triangle.corners) else {
            return;
        };
        let nearer = match &self.0 {
            None => true,
            Some((known, best)) => crossing.t < best.t || (crossing.t == best.t && index < *known),
        };
        if nearer && scene.counts(triangle, crossing.counter_clockwise, faces) {
            self.0 = Some((index, crossing));
        }
    }
}

/// Twice the area, along the normal of corners that wind counter-clockwise.
fn area_vector(corners: &[DVec3; 3]) -> DVec3 {
    let [a, b, c] = *corners;
    (b - a).cross(c - a)
}

fn mix([a, b, c]: [DVec3; 3], [u, v, w]: [f64; 3]) -> DVec3 {
    a * u + b * v + c * w
}

fn wide(v: [f32; 3]) -> DVec3 {
    DVec3::from_array(v.map(f64::from))
}
