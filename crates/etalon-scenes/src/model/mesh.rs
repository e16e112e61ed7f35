//! Indexed triangles.

use super::error::{Check, ModelError, Place, finite};

/// Most vertices of a mesh, so that every index fits into `u32` and the value
/// that restarts strips is none of them.
pub const MAX_VERTICES: usize = 1 << 28;
/// Most triangles of a mesh.
pub const MAX_TRIANGLES: usize = 1 << 28;

/// Vertex streams, one element per vertex. Positions and normals there must be;
/// the others are empty where a mesh has none. Right-handed, metres, +Y up.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Vertices {
    /// Positions in the mesh's own space.
    pub positions: Vec<[f32; 3]>,
    /// Unit normals: outward where triangles wind counter-clockwise.
    pub normals: Vec<[f32; 3]>,
    /// xyz: unit tangent along growing u. w: ±1, so that the direction in which
    /// a normal map's green axis points is `w · cross(normal, tangent)`.
    pub tangents: Vec<[f32; 4]>,
    /// Two sets of texture coordinates; (0, 0) is the image's first texel's
    /// outer corner, v grows down the image's rows (glTF 2.0, section 3.8.1).
    pub uv: [Vec<[f32; 2]>; 2],
    /// Linear RGBA that multiplies the material's base colour.
    pub colours: Vec<[f32; 4]>,
    /// Indices into the joints of the skin, with `weights`.
    pub joints: Vec<[u16; 4]>,
    /// How much each joint moves the vertex; not negative, of sum 1.
    pub weights: Vec<[f32; 4]>,
}

/// A mesh: one draw's triangles. Its contents were checked when it was made.
#[derive(Clone, Debug, PartialEq)]
pub struct Mesh {
    name: String,
    vertices: Vertices,
    triangles: Vec<[u32; 3]>,
    bounds: [[f32; 3]; 2],
    /// One more than the largest joint a vertex refers to.
    joints: usize,
}

impl Mesh {
    /// A mesh of `triangles`: three indices into the vertices each,
    /// counter-clockwise as seen from the front.
    ///
    /// Triangles without area are allowed: files have them, and rasterisers
    /// draw nothing for them.
    ///
    /// # Errors
    /// If there are no vertices or too many, a stream has another length than
    /// the positions, an index has no vertex, a number is NaN or infinite, a
    /// normal's or tangent's length is further than 1 % from 1, a tangent's w is
    /// not ±1, joints come without weights, or weights do not add up to 1
    /// within 1 %.
    pub fn new(
        name: impl Into<String>,
        vertices: Vertices,
        triangles: Vec<[u32; 3]>,
    ) -> Result<Self, ModelError> {
        let name = name.into();
        let place = Place::loose("mesh", &name);
        let check = Check(&place);
        let count = vertices.positions.len();
        check.count(
            "positions",
            count,
            format!("from 1 to {MAX_VERTICES}"),
            (1..=MAX_VERTICES).contains(&count),
        )?;
        check.count(
            "triangles",
            triangles.len(),
            format!("at most {MAX_TRIANGLES}"),
            triangles.len() <= MAX_TRIANGLES,
        )?;
        let Vertices {
            positions,
            normals,
            tangents,
            uv,
            colours,
            joints,
            weights,
        } = &vertices;
        check.count(
            "normals",
            normals.len(),
            format!("{count}, as positions"),
            normals.len() == count,
        )?;
        for (what, length) in [
            ("tangents", tangents.len()),
            ("texture coordinates of set 0", uv[0].len()),
            ("texture coordinates of set 1", uv[1].len()),
            ("colours", colours.len()),
            ("joints", joints.len()),
            ("weights", weights.len()),
        ] {
            let need = || format!("none or {count}, as positions");
            check.count(what, length, need(), length == 0 || length == count)?;
        }
        check.count(
            "weights",
            weights.len(),
            format!("{}, as joints", joints.len()),
            weights.len() == joints.len(),
        )?;
        check.each("position", positions, "finite", finite)?;
        check.each("normal", normals, "of length 1", unit)?;
        check.each("tangent", tangents, "of length 1, with w = ±1", |t| {
            unit(&[t[0], t[1], t[2]]) && t[3].abs() == 1.0
        })?;
        for set in uv {
            check.each("texture coordinate", set, "finite", finite)?;
        }
        check.each("colour", colours, "finite and not negative", |c| {
            finite(c) && c.iter().all(|&x| x >= 0.0)
        })?;
        check.each("weights", weights, "not negative, of sum 1", |w| {
            let sum: f32 = w.iter().sum();
            w.iter().all(|&x| x >= 0.0) && (sum - 1.0).abs() <= 0.01
        })?;
        for (i, triangle) in triangles.iter().enumerate() {
            for &corner in triangle {
                if corner as usize >= count {
                    check.index(format!("triangle {i}"), "vertex", corner as usize, count)?;
                }
            }
        }
        let mut bounds = [positions[0]; 2];
        for position in positions {
            for axis in 0..3 {
                bounds[0][axis] = bounds[0][axis].min(position[axis]);
                bounds[1][axis] = bounds[1][axis].max(position[axis]);
            }
        }
        // A joint without weight is never looked at.
        let used = joints.iter().zip(weights).flat_map(|(j, w)| {
            (0..4)
                .filter(|&i| w[i] > 0.0)
                .map(|i| usize::from(j[i]) + 1)
        });
        let joints = used.max().unwrap_or(0);
        Ok(Self {
            name,
            vertices,
            triangles,
            bounds,
            joints,
        })
    }

    /// Its name; may be empty.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.name
    }

    /// The vertex streams.
    #[must_use]
    pub const fn vertices(&self) -> &Vertices {
        &self.vertices
    }

    /// Three vertex indices each.
    #[must_use]
    pub fn triangles(&self) -> &[[u32; 3]] {
        &self.triangles
    }

    /// How many joints a skin needs for this mesh; 0 if it has none.
    #[must_use]
    pub const fn joints(&self) -> usize {
        self.joints
    }

    /// Low and high corner of the box around all vertices.
    #[must_use]
    pub const fn bounds(&self) -> [[f32; 3]; 2] {
        self.bounds
    }
}

fn unit(v: &[f32; 3]) -> bool {
    let length = v.iter().map(|x| x * x).sum::<f32>().sqrt();
    // False for NaN as well.
    (length - 1.0).abs() <= 0.01
}
