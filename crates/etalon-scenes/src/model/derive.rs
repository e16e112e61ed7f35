//! Normals and tangents of meshes that come without.

use glam::{DVec2, DVec3, DVec4};

use super::mesh::Vertices;

/// Gives every triangle vertices of its own with the triangle's normal, as
/// glTF 2.0 (section 3.7.2.1) wants it for meshes without normals. Tangents are
/// dropped: they belong to other normals. Indices that have no vertex, and
/// triangles without area, get the normal +Y; streams of another length than
/// the positions are dropped.
///
/// Returns the new vertices and triangles.
#[must_use]
pub fn flat_normals(vertices: &Vertices, triangles: &[[u32; 3]]) -> (Vertices, Vec<[u32; 3]>) {
    fn spread<T: Copy + Default>(stream: &[T], count: usize, triangles: &[[u32; 3]]) -> Vec<T> {
        if stream.len() != count {
            return Vec::new();
        }
        triangles
            .iter()
            .flatten()
            .map(|&i| stream.get(i as usize).copied().unwrap_or_default())
            .collect()
    }
    let count = vertices.positions.len();
    let positions = spread(&vertices.positions, count, triangles);
    let normals = positions
        .as_chunks::<3>()
        .0
        .iter()
        .flat_map(|&[a, b, c]| {
            let normal = area_vector(a, b, c).try_normalize().unwrap_or(DVec3::Y);
            [normal.as_vec3().to_array(); 3]
        })
        .collect();
    let flat = Vertices {
        normals,
        tangents: Vec::new(),
        uv: [
            spread(&vertices.uv[0], count, triangles),
            spread(&vertices.uv[1], count, triangles),
        ],
        colours: spread(&vertices.colours, count, triangles),
        joints: spread(&vertices.joints, count, triangles),
        weights: spread(&vertices.weights, count, triangles),
        positions,
    };
    let triangles = (0..triangles.len() as u32)
        .map(|i| [3 * i, 3 * i + 1, 3 * i + 2])
        .collect();
    (flat, triangles)
}

/// Tangents from a set of texture coordinates.
///
/// As MikkTSpace does (Mikkelsen, “Simulation of Wrinkled Surfaces Revisited”,
/// 2008), a vertex gets the mean of the directions of growing u on its
/// triangles, each projected into the vertex's tangent plane, made of unit
/// length and weighted by the triangle's angle at the vertex. Unlike there no
/// vertex is split: where triangles of both orientations of the texture meet in
/// one vertex, the orientation with the larger sum of angles counts, and only
/// its triangles. Triangles whose texture coordinates span no area count for
/// nothing; a vertex without any other gets an arbitrary tangent at a right
/// angle to its normal.
///
/// `w` is +1 where the image is not mirrored, seen from outside: the green axis
/// of a normal map points up the image, against growing v (glTF 2.0, sections
/// 3.7.2.1 and 3.9.3).
///
/// Empty if the streams do not have one normal and one texture coordinate per
/// position.
#[must_use]
pub fn tangents(vertices: &Vertices, triangles: &[[u32; 3]], set: usize) -> Vec<[f32; 4]> {
    let count = vertices.positions.len();
    let Some(uv) = vertices.uv.get(set) else {
        return Vec::new();
    };
    if vertices.normals.len() != count || uv.len() != count {
        return Vec::new();
    }
    // By orientation: sums of weighted tangents, with the sum of weights in w.
    let mut sums = vec![[DVec4::ZERO; 2]; count];
    for corners in triangles {
        let corners = corners.map(|i| i as usize);
        if corners.iter().any(|&i| i >= count) {
            continue;
        }
        let p = corners.map(|i| vec3(vertices.positions[i]));
        let t = corners.map(|i| DVec2::from_array(uv[i].map(f64::from)));
        let (e1, e2) = (p[1] - p[0], p[2] - p[0]);
        let (d1, d2) = (t[1] - t[0], t[2] - t[0]);
        let det = d1.perp_dot(d2);
        // v grows down the image: an image seen unmirrored has a negative area.
        let side = usize::from(det > 0.0);
        let Some(along) = ((e1 * d2.y - e2 * d1.y) * det.signum()).try_normalize() else {
            continue;
        };
        if det == 0.0 || !det.is_finite() {
            continue;
        }
        for i in 0..3 {
            let normal = vec3(vertices.normals[corners[i]]);
            let (next, last) = (p[(i + 1) % 3] - p[i], p[(i + 2) % 3] - p[i]);
            let angle = next.angle_between(last);
            let tangent = along - normal * normal.dot(along);
            if let Some(tangent) = tangent.try_normalize()
                && angle.is_finite()
            {
                sums[corners[i]][side] += tangent.extend(1.0) * angle;
            }
        }
    }
    let normals = vertices.normals.iter();
    (normals.zip(&sums))
        .map(|(&normal, sums)| {
            let normal = vec3(normal).normalize_or(DVec3::Y);
            let (sum, sign) = if sums[1].w > sums[0].w {
                (sums[1], -1.0)
            } else {
                (sums[0], 1.0)
            };
            let tangent = sum.truncate();
            let tangent = (tangent - normal * normal.dot(tangent))
                .try_normalize()
                .unwrap_or_else(|| normal.any_orthonormal_vector());
            tangent.extend(sign).as_vec4().to_array()
        })
        .collect()
}

/// Twice the area of a triangle, along its normal.
pub(crate) fn area_vector(a: [f32; 3], b: [f32; 3], c: [f32; 3]) -> DVec3 {
    let [a, b, c] = [a, b, c].map(vec3);
    (b - a).cross(c - a)
}

pub(crate) fn vec3(v: [f32; 3]) -> DVec3 {
    DVec3::from_array(v.map(f64::from))
}

/// Makes normals of unit length; those of length 0 become the mean of the
/// triangles around, by area, or +Y. What is not finite stays for
/// [`Mesh::new`](super::Mesh::new) to refuse.
pub(crate) fn mend_normals(vertices: &mut Vertices, triangles: &[[u32; 3]]) {
    let zero = |n: &[f32; 3]| vec3(*n).length_squared() == 0.0;
    let mut around = Vec::new();
    if vertices.normals.iter().any(zero) {
        around.resize(vertices.positions.len(), DVec3::ZERO);
        for &triangle in triangles {
            let [a, b, c] = triangle.map(|i| vertices.positions[i as usize]);
            let area = area_vector(a, b, c);
            for i in triangle {
                around[i as usize] += area;
            }
        }
    }
    for (i, normal) in vertices.normals.iter_mut().enumerate() {
        let n = vec3(*normal);
        if !n.is_finite() {
            continue;
        }
        let mended = n.try_normalize().unwrap_or_else(|| {
            let mean = around.get(i).copied().unwrap_or(DVec3::ZERO);
            mean.normalize_or(DVec3::Y)
        });
        *normal = mended.as_vec3().to_array();
    }
}

/// Makes tangents of unit length; those of length 0 become any at a right angle
/// to the normal. What is not finite, and `w`, stays.
pub(crate) fn mend_tangents(vertices: &mut Vertices) {
    for (tangent, normal) in vertices.tangents.iter_mut().zip(&vertices.normals) {
        let [x, y, z, w] = *tangent;
        let t = vec3([x, y, z]);
        if !t.is_finite() {
            continue;
        }
        let mended = t.try_normalize().unwrap_or_else(|| {
            let normal = vec3(*normal).normalize_or(DVec3::Y);
            normal.any_orthonormal_vector()
        });
        *tangent = mended.as_vec3().extend(w).to_array();
    }
}
