//! Shapes that turn around the y axis.

use glam::{DVec2, DVec3};

use super::{Corner, Shell, circle, counts, lengths, more};
use crate::model::error::{ModelError, Place};
use crate::model::mesh::Mesh;

/// A sphere around the origin of `segments` around and `rings` from pole to
/// pole. u goes around, v from the north pole (+Y) to the south pole; at the
/// poles each triangle has a vertex of its own, in the middle of its column.
///
/// # Errors
/// If the radius is not positive, there are under 3 segments, under 2 rings, or
/// too many.
pub fn uv_sphere(name: &str, radius: f32, segments: u32, rings: u32) -> Result<Mesh, ModelError> {
    let place = Place::loose("mesh", name);
    let [radius] = lengths(&place, [("radius", radius)])?;
    counts(&place, &[("segments", segments, 3), ("rings", rings, 2)])?;
    let mut shell = Shell::new(&place, more(segments).saturating_mul(more(rings)))?;
    let around = circle(segments);
    let corner = |i: u32, middle: f64, j: u32| {
        let u = (f64::from(i) + middle) / f64::from(segments);
        let v = f64::from(j) / f64::from(rings);
        let direction = if middle == 0.0 {
            around[(i % segments) as usize]
        } else {
            let (sin, cos) = (u * std::f64::consts::TAU).sin_cos();
            DVec2::new(sin, cos)
        };
        let (sin, cos) = (v * std::f64::consts::PI).sin_cos();
        // π is not exact: at the poles the sine is 0.
        let sin = if j == 0 || j == rings { 0.0 } else { sin };
        let normal = DVec3::new(direction.x * sin, cos, direction.y * sin);
        Corner {
            position: normal * radius,
            normal,
            tangent: DVec3::new(direction.y, 0.0, -direction.x),
            uv: DVec2::new(u, v),
        }
    };
    shell.patch(segments, rings - 2, |i, j| corner(i, 0.0, j + 1));
    let last = (rings - 2) * (segments + 1);
    for i in 0..segments {
        let north = shell.corner(corner(i, 0.5, 0));
        shell.triangles.push([north, i, i + 1]);
        let south = shell.corner(corner(i, 0.5, rings));
        shell.triangles.push([south, last + i + 1, last + i]);
    }
    shell.finish(&place)
}

/// A torus around the y axis: `major` from the axis to the middle of the tube,
/// `minor` the tube's radius; `segments` around the axis, `sides` around the
/// tube. u goes around the axis, v around the tube, over the outside downward.
///
/// # Errors
/// If a radius is not positive, the tube's is not under the other one, or there
/// are under 3 segments or sides, or too many.
pub fn torus(
    name: &str,
    major: f32,
    minor: f32,
    segments: u32,
    sides: u32,
) -> Result<Mesh, ModelError> {
    let place = Place::loose("mesh", name);
    let [major, minor] = lengths(&place, [("major radius", major), ("minor radius", minor)])?;
    super::Check(&place).value(
        "minor radius",
        minor,
        "under the major radius",
        minor < major,
    )?;
    counts(&place, &[("segments", segments, 3), ("sides", sides, 3)])?;
    let mut shell = Shell::new(&place, more(segments).saturating_mul(more(sides)))?;
    let (around, across) = (circle(segments), circle(sides));
    shell.patch(segments, sides, |i, j| {
        let a = around[(i % segments) as usize];
        let out = DVec3::new(a.x, 0.0, a.y);
        // From the top over the outside down.
        let b = across[(j % sides) as usize];
        let normal = out * b.x + DVec3::Y * b.y;
        Corner {
            position: out * major + normal * minor,
            normal,
            tangent: DVec3::new(a.y, 0.0, -a.x),
            uv: DVec2::new(
                f64::from(i) / f64::from(segments),
                f64::from(j) / f64::from(sides),
            ),
        }
    });
    shell.finish(&place)
}

/// A cylinder along the y axis around the origin with both ends closed. u goes
/// around, v down; the ends show a disc of the image.
///
/// # Errors
/// If a length is not positive, or there are under 3 segments or too many.
pub fn cylinder(name: &str, radius: f32, height: f32, segments: u32) -> Result<Mesh, ModelError> {
    let place = Place::loose("mesh", name);
    let [radius, height] = lengths(&place, [("radius", radius), ("height", height)])?;
    counts(&place, &[("segments", segments, 3)])?;
    let mut shell = Shell::new(&place, more(segments).saturating_mul(4))?;
    let around = circle(segments);
    shell.patch(segments, 1, |i, j| {
        let a = around[(i % segments) as usize];
        Corner {
            position: DVec3::new(a.x * radius, (0.5 - f64::from(j)) * height, a.y * radius),
            normal: DVec3::new(a.x, 0.0, a.y),
            tangent: DVec3::new(a.y, 0.0, -a.x),
            uv: DVec2::new(f64::from(i) / f64::from(segments), f64::from(j)),
        }
    });
    end(&mut shell, &around, radius, 0.5 * height, true);
    end(&mut shell, &around, radius, -0.5 * height, false);
    shell.finish(&place)
}

/// A cone along the y axis: its base, closed, at y = 0, its apex at `height`.
/// u goes around, v from the apex down; the base shows a disc of the image.
///
/// # Errors
/// If a length is not positive, or there are under 3 segments or too many.
pub fn cone(name: &str, radius: f32, height: f32, segments: u32) -> Result<Mesh, ModelError> {
    let place = Place::loose("mesh", name);
    let [radius, height] = lengths(&place, [("radius", radius), ("height", height)])?;
    counts(&place, &[("segments", segments, 3)])?;
    let mut shell = Shell::new(&place, more(segments).saturating_mul(3))?;
    let around = circle(segments);
    // The normal leans up by the slope of the side.
    let slant = DVec2::new(height, radius).normalize();
    let corner = |direction: DVec2, radius: f64, y: f64, uv: DVec2| Corner {
        position: DVec3::new(direction.x * radius, y, direction.y * radius),
        normal: DVec3::new(direction.x * slant.x, slant.y, direction.y * slant.x),
        tangent: DVec3::new(direction.y, 0.0, -direction.x),
        uv,
    };
    let part = |i: f64| i / f64::from(segments);
    for i in 0..=segments {
        let a = around[(i % segments) as usize];
        shell.corner(corner(a, radius, 0.0, DVec2::new(part(f64::from(i)), 1.0)));
    }
    for i in 0..segments {
        let u = part(f64::from(i) + 0.5);
        let (sin, cos) = (u * std::f64::consts::TAU).sin_cos();
        let apex = corner(DVec2::new(sin, cos), 0.0, height, DVec2::new(u, 0.0));
        let apex = shell.corner(apex);
        shell.triangles.push([apex, i, i + 1]);
    }
    end(&mut shell, &around, radius, 0.0, false);
    shell.finish(&place)
}

/// A disc at height `y`, facing up or down.
fn end(shell: &mut Shell, around: &[DVec2], radius: f64, y: f64, up: bool) {
    let side = if up { 1.0 } else { -1.0 };
    let corner = |at: DVec2| Corner {
        position: DVec3::new(at.x * radius, y, at.y * radius),
        normal: DVec3::Y * side,
        tangent: DVec3::X,
        // Upright as seen from outside: v grows with z above and against it below.
        uv: DVec2::new(0.5 + 0.5 * at.x, 0.5 + 0.5 * side * at.y),
    };
    let middle = shell.corner(corner(DVec2::ZERO));
    for &at in around {
        shell.corner(corner(at));
    }
    let count = around.len() as u32;
    for i in 0..count {
        let (a, b) = (middle + 1 + i, middle + 1 + (i + 1) % count);
        shell
            .triangles
            .push(if up { [middle, a, b] } else { [middle, b, a] });
    }
}
