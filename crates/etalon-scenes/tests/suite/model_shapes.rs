//! Procedural meshes against what is known of the shapes.

use std::collections::{BTreeMap, BTreeSet};
use std::f64::consts::PI;

use etalon_scenes::model::{Mesh, ModelError, shapes, tangents};
use glam::{DVec2, DVec3};

fn vec3(v: [f32; 3]) -> DVec3 {
    DVec3::from_array(v.map(f64::from))
}

fn corners(mesh: &Mesh) -> impl Iterator<Item = [DVec3; 3]> {
    let positions = &mesh.vertices().positions;
    (mesh.triangles().iter()).map(|t| t.map(|i| vec3(positions[i as usize])))
}

fn area(mesh: &Mesh) -> f64 {
    corners(mesh)
        .map(|[a, b, c]| 0.5 * (b - a).cross(c - a).length())
        .sum()
}

/// By the divergence theorem; negative if the faces wind inward.
fn volume(mesh: &Mesh) -> f64 {
    corners(mesh).map(|[a, b, c]| a.dot(b.cross(c)) / 6.0).sum()
}

/// Vertices − edges + faces after welding by position, and whether every edge
/// has exactly one triangle on either side.
fn topology(mesh: &Mesh) -> (i64, bool) {
    let mut welded = BTreeMap::new();
    let key = |p: [f32; 3]| p.map(|x| (x + 0.0).to_bits());
    let ids: Vec<usize> = (mesh.vertices().positions.iter())
        .map(|&p| {
            let next = welded.len();
            *welded.entry(key(p)).or_insert(next)
        })
        .collect();
    let mut used = BTreeSet::new();
    let mut edges: BTreeMap<(usize, usize), [u32; 2]> = BTreeMap::new();
    for triangle in mesh.triangles() {
        let t = triangle.map(|i| ids[i as usize]);
        assert!(t[0] != t[1] && t[1] != t[2] && t[2] != t[0], "no slivers");
        for i in 0..3 {
            let (a, b) = (t[i], t[(i + 1) % 3]);
            used.insert(a);
            edges.entry((a.min(b), a.max(b))).or_default()[usize::from(a < b)] += 1;
        }
    }
    let closed = edges.values().all(|&sides| sides == [1, 1]);
    let characteristic = used.len() as i64 - edges.len() as i64 + mesh.triangles().len() as i64;
    (characteristic, closed)
}

fn closed_shapes() -> Vec<(Mesh, i64, f64, f64)> {
    // Name, Euler characteristic, area, volume of the ideal shape.
    let ball = (4.0 * PI * 0.7 * 0.7, 4.0 / 3.0 * PI * 0.7_f64.powi(3));
    let slant = (0.5_f64 * 0.5 + 1.5 * 1.5).sqrt();
    vec![
        (
            shapes::cuboid("box", [0.5, 1.0, 2.0]).unwrap(),
            2,
            28.0,
            8.0,
        ),
        (
            shapes::uv_sphere("ball", 0.7, 192, 96).unwrap(),
            2,
            ball.0,
            ball.1,
        ),
        (
            shapes::icosphere("ball", 0.7, 6).unwrap(),
            2,
            ball.0,
            ball.1,
        ),
        (
            shapes::cylinder("drum", 0.5, 2.0, 256).unwrap(),
            2,
            2.0 * PI * 0.5 * 2.0 + 2.0 * PI * 0.25,
            PI * 0.25 * 2.0,
        ),
        (
            shapes::cone("cone", 0.5, 1.5, 256).unwrap(),
            2,
            PI * 0.25 + PI * 0.5 * slant,
            PI * 0.25 * 1.5 / 3.0,
        ),
        (
            shapes::torus("ring", 1.0, 0.25, 256, 128).unwrap(),
            0,
            4.0 * PI * PI * 0.25,
            2.0 * PI * PI * 0.25 * 0.25,
        ),
    ]
}

#[test]
fn closed_shapes_are_closed_and_wind_outward() {
    for (mesh, characteristic, area_of, volume_of) in closed_shapes() {
        assert_eq!(topology(&mesh), (characteristic, true), "{}", mesh.name());
        // Inscribed: a chord over an angle h is short by h²/24, at the coarsest
        // 2π/128 here, in two directions, and areas fall short by as much twice.
        let tolerance = 4.0 * (2.0 * PI / 96.0_f64).powi(2) / 24.0 * 2.0;
        let (a, v) = (area(&mesh) / area_of, volume(&mesh) / volume_of);
        assert!((a - 1.0).abs() < tolerance, "{}: area {a}", mesh.name());
        assert!((v - 1.0).abs() < tolerance, "{}: volume {v}", mesh.name());
    }
}

#[test]
fn areas_and_volumes_converge_quadratically() {
    type Make = fn(u32) -> Result<Mesh, ModelError>;
    let cases: [(Make, f64, f64); 4] = [
        (
            |n| shapes::uv_sphere("", 1.0, 2 * n, n),
            4.0 * PI,
            4.0 / 3.0 * PI,
        ),
        (
            |n| shapes::icosphere("", 1.0, n.ilog2() - 1),
            4.0 * PI,
            4.0 / 3.0 * PI,
        ),
        (
            |n| shapes::torus("", 1.0, 0.5, 2 * n, n),
            2.0 * PI * PI,
            PI * PI * 0.5,
        ),
        (|n| shapes::cylinder("", 1.0, 1.0, n), 4.0 * PI, PI),
    ];
    for (case, (make, area_of, volume_of)) in cases.into_iter().enumerate() {
        let errors = |n| {
            let mesh = make(n).unwrap();
            [1.0 - area(&mesh) / area_of, 1.0 - volume(&mesh) / volume_of]
        };
        let (coarse, fine) = (errors(16), errors(32));
        for i in 0..2 {
            // Halving the edges quarters the error, up to terms of fourth order.
            let ratio = coarse[i] / fine[i];
            assert!((3.7..4.3).contains(&ratio), "case {case}, {i}: {ratio}");
        }
    }
}

fn all_shapes() -> Vec<Mesh> {
    let mut all: Vec<_> = closed_shapes().into_iter().map(|(mesh, ..)| mesh).collect();
    all.push(shapes::grid("floor", [4.0, 2.0], [5, 7]).unwrap());
    all.push(shapes::panes("panes", 2.0, 6, [1.0, 1.5]).unwrap());
    all.push(shapes::icosphere("gem", 1.0, 0).unwrap());
    all.push(shapes::icosphere("gem", 1.0, 1).unwrap());
    all
}

#[test]
fn normals_and_tangents_are_orthonormal_and_outward() {
    for mesh in all_shapes() {
        let v = mesh.vertices();
        for (n, t) in v.normals.iter().zip(&v.tangents) {
            let (n, w, t) = (vec3(*n), t[3], vec3([t[0], t[1], t[2]]));
            // Three components, each rounded to f32.
            assert!((n.length() - 1.0).abs() < 2e-7 && (t.length() - 1.0).abs() < 2e-7);
            assert!(n.dot(t).abs() < 3e-7, "{}: {n} {t}", mesh.name());
            assert_eq!(w, 1.0);
        }
        for (triangle, [a, b, c]) in mesh.triangles().iter().zip(corners(&mesh)) {
            let face = (b - a).cross(c - a).normalize();
            for &i in triangle {
                // The coarsest shape is the icosahedron: 37.4° from face to vertex.
                let cosine = face.dot(vec3(v.normals[i as usize]));
                assert!(cosine > 0.79, "{}: {cosine}", mesh.name());
            }
        }
    }
}

#[test]
fn texture_coordinates_lie_upright_outside() {
    for mesh in all_shapes() {
        let v = mesh.vertices();
        for (triangle, [a, b, c]) in mesh.triangles().iter().zip(corners(&mesh)) {
            let [ta, tb, tc] =
                triangle.map(|i| DVec2::from_array(v.uv[0][i as usize].map(f64::from)));
            // v grows downward, so an image that is not mirrored has a negative area.
            let det = (tb - ta).perp_dot(tc - ta);
            assert!(det < 0.0, "{}: {ta} {tb} {tc}", mesh.name());
            let along = ((b - a) * (tc - ta).y - (c - a) * (tb - ta).y) / det;
            for &i in triangle {
                let t = v.tangents[i as usize];
                let cosine = along.normalize().dot(vec3([t[0], t[1], t[2]]));
                // Poles have half a column between triangle and vertex, and the
                // triangles of gems are too large to say anything.
                assert!(
                    cosine > 0.5 || mesh.name() == "gem",
                    "{}: {cosine}",
                    mesh.name()
                );
            }
        }
    }
}

#[test]
fn computed_tangents_agree_with_the_closed_forms() {
    for mesh in all_shapes() {
        // At the poles of the icospheres triangles are too large to agree.
        if mesh.name() == "gem" {
            continue;
        }
        let v = mesh.vertices();
        let computed = tangents(v, mesh.triangles(), 0);
        let mut worst = 1.0_f64;
        for ((made, known), p) in computed.iter().zip(&v.tangents).zip(&v.positions) {
            assert_eq!(made[3], known[3], "{}", mesh.name());
            let cosine =
                vec3([made[0], made[1], made[2]]).dot(vec3([known[0], known[1], known[2]]));
            if (vec3(*p) * DVec3::new(1.0, 0.0, 1.0)).length() > 0.1 {
                worst = worst.min(cosine);
            }
        }
        assert!(worst > 0.99, "{}: {worst}", mesh.name());
    }
}

#[test]
fn impossible_shapes_are_refused() {
    let refused = |result: Result<Mesh, ModelError>, text: &str| {
        let error = result.unwrap_err().to_string();
        assert!(error.contains(text), "{error}");
    };
    for bad in [0.0, -1.0, f32::NAN, f32::INFINITY] {
        refused(
            shapes::cuboid("c", [1.0, bad, 1.0]),
            "half edge along y of mesh \"c\"",
        );
        refused(shapes::grid("g", [bad, 1.0], [1, 1]), "width");
        refused(shapes::uv_sphere("s", bad, 8, 8), "radius");
        refused(shapes::icosphere("s", bad, 1), "radius");
        refused(shapes::cylinder("s", 1.0, bad, 8), "height");
        refused(shapes::cone("s", bad, 1.0, 8), "radius");
        refused(shapes::torus("s", 1.0, bad, 8, 8), "minor radius");
        refused(shapes::panes("s", 1.0, 3, [1.0, bad]), "height");
    }
    refused(shapes::uv_sphere("s", 1.0, 2, 8), "at least 3");
    refused(shapes::uv_sphere("s", 1.0, 8, 1), "at least 2");
    refused(shapes::grid("g", [1.0; 2], [0, 1]), "at least 1");
    refused(shapes::torus("t", 1.0, 1.0, 8, 8), "under the major radius");
    refused(shapes::icosphere("s", 1.0, 10), "at most 9");
    // Vertices without number: refused before any are made.
    let most = u32::MAX;
    refused(shapes::grid("g", [1.0; 2], [most, most]), "at most 4194304");
    refused(shapes::uv_sphere("s", 1.0, most, most), "at most 4194304");
    refused(shapes::torus("s", 1.0, 0.5, most, most), "at most 4194304");
    refused(shapes::cylinder("s", 1.0, 1.0, most), "at most 4194304");
    refused(shapes::cone("s", 1.0, 1.0, most), "at most 4194304");
    refused(shapes::panes("s", 1.0, most, [1.0; 2]), "at most 4194304");
    // A radius in range whose positions are not.
    refused(shapes::torus("s", 3e38, 2e38, 3, 4), "position");
}
