//! Cubes: Vulkan 1.3, §16.5.4 (face selection) and the edges between faces.

/// The coordinates `s`, `t` and the length along a face's axis that a
/// direction has in the space of a face.
fn project(face: u32, [x, y, z]: [f32; 3]) -> [f32; 3] {
    match face {
        0 => [-z, -y, x],
        1 => [z, -y, -x],
        2 => [x, z, y],
        3 => [x, -z, -y],
        4 => [x, -y, z],
        _ => [-x, -y, -z],
    }
}

/// The face a direction meets: of equal components the last one decides.
fn face_of([x, y, z]: [f32; 3]) -> u32 {
    let (ax, ay, az) = (x.abs(), y.abs(), z.abs());
    if az >= ax && az >= ay {
        if z >= 0.0 { 4 } else { 5 }
    } else if ay >= ax {
        if y >= 0.0 { 2 } else { 3 }
    } else if x >= 0.0 {
        0
    } else {
        1
    }
}

/// The face a direction meets and where on it, in [0, 1].
pub(super) fn face(direction: [f32; 3]) -> (u32, [f32; 2]) {
    let face = face_of(direction);
    let [s, t, major] = project(face, direction);
    let major = major.abs();
    (face, [0.5 * (s / major + 1.0), 0.5 * (t / major + 1.0)])
}

/// How the place on the face changes when the direction does
/// (Vulkan 1.3, §16.5.4, transformation of derivatives).
pub(super) fn derivative(direction: [f32; 3], change: [f32; 3]) -> [f32; 2] {
    let face = face_of(direction);
    let [s, t, major] = project(face, direction);
    let [ds, dt, dmajor] = project(face, change);
    let square = major * major;
    [
        0.5 * (major * ds - s * dmajor) / square,
        0.5 * (major * dt - t * dmajor) / square,
    ]
}

/// A direction that meets a face at `s`, `t` in [-1, 1] or beyond.
fn direction(face: u32, s: f32, t: f32) -> [f32; 3] {
    match face {
        0 => [1.0, -t, -s],
        1 => [-1.0, -t, s],
        2 => [s, 1.0, t],
        3 => [s, -1.0, -t],
        4 => [s, -t, 1.0],
        _ => [-s, -t, -1.0],
    }
}

/// The texel next to a face's edge is on the neighbouring face. Beyond a
/// corner there is none: the result is then one of those around it.
pub(super) fn texel(face_at: u32, x: i32, y: i32, size: i32) -> (u32, u32, u32) {
    let inside = |at: i32| at.clamp(0, size - 1) as u32;
    if (0..size).contains(&x) && (0..size).contains(&y) {
        return (face_at, x as u32, y as u32);
    }
    let centre = |at: i32| 2.0 * (at.clamp(-1, size) as f32 + 0.5) / size as f32 - 1.0;
    let (face, [s, t]) = face(direction(face_at, centre(x), centre(y)));
    let texel = |at: f32| inside((at * size as f32).floor() as i32);
    (face, texel(s), texel(t))
}

/// Whether a position is beyond a corner, where no texel is.
pub(super) fn is_corner(x: i32, y: i32, size: i32) -> bool {
    !(0..size).contains(&x) && !(0..size).contains(&y)
}
