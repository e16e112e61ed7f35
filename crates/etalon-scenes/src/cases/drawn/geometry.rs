//! Triangles that are hard to draw, and movement that is hard to tell.

use etalon_effects::DepthRange;
use etalon_effects::geometry::DrawClass;
use glam::{DMat4, DQuat, DVec3, Vec2, Vec3};

use super::solids::{Solid, Solids, Triangle};
use super::{CaseError, DrawnCase, Stage};

/// A triangle that everything else is drawn beside: in the left half of the picture.
const BESIDE: Triangle = [[-2.0, -1.0, -4.0], [-0.5, -1.0, -4.0], [-1.5, 1.0, -4.0]];

/// Two corners in the right half, to go with a third.
const OTHERS: [[f32; 3]; 2] = [[0.5, -1.0, -4.0], [2.0, 1.0, -4.0]];

/// Triangles beside a good one.
fn beside(triangles: &[Triangle]) -> Result<Stage, CaseError> {
    let mut all = vec![BESIDE];
    all.extend(triangles);
    Solids::new(vec![Solid::new(&all)])?.staged()
}

/// A corner of a kind at each place of a triangle, and at all three.
fn with_corner(corner: [f32; 3]) -> Result<Stage, CaseError> {
    let [a, b] = OTHERS;
    beside(&[[corner, a, b], [a, corner, b], [a, b, corner], [corner; 3]])
}

/// A wall with a normal.
fn normal(normal: [f32; 3]) -> Result<Stage, CaseError> {
    Solids::new(vec![Solid::wall(4.0, 2.0).normal(normal)])?.staged()
}

/// A floor a metre below the eye, from behind it to far ahead.
fn floor(far: f32) -> Solid {
    let corners = [[-far, -1.0, far], [far, -1.0, far], [0.0, -1.0, -far]];
    Solid::new(&[corners]).normal([0.0, 1.0, 0.0])
}

/// A wall and a floor in depth of a kind.
fn depth(range: DepthRange) -> Result<Stage, CaseError> {
    Solids::new(vec![floor(50.0), Solid::wall(4.0, 1.0)])?
        .seen(|view| view.camera.depth = range)
        .staged()
}

/// A wall that was elsewhere a frame ago.
fn from(previous: DMat4) -> Result<Stage, CaseError> {
    Solids::new(vec![Solid::wall(4.0, 1.5).moving_from(previous)])?.staged()
}

/// A floor and a wall seen by an eye that was elsewhere a frame ago.
fn seen_from(previous: DMat4) -> Result<Stage, CaseError> {
    Solids::new(vec![floor(50.0), Solid::wall(4.0, 1.0)])?
        .seen(|view| view.previous = previous)
        .staged()
}

fn at(x: f64, y: f64, z: f64) -> DMat4 {
    DMat4::from_translation(DVec3::new(x, y, z))
}

pub(super) const CASES: &[DrawnCase] = &[
    DrawnCase::new(
        "triangle-across-the-near-plane",
        "two corners before and one behind the near plane: w goes through 0 between them",
        "J. F. Blinn and M. E. Newell, Clipping Using Homogeneous Coordinates, 1978",
        || beside(&[[[0.5, -1.0, -4.0], [2.0, -0.5, -4.0], [0.3, 0.2, 2.0]]]),
    ),
    DrawnCase::new(
        "triangle-around-the-eye",
        "a floor from behind the eye to the horizon: its corner has w < 0, its picture is bounded by none",
        "M. Olano and T. Greer, Triangle Scan Conversion Using 2D Homogeneous Coordinates, 1997",
        || Solids::new(vec![floor(50.0)])?.staged(),
    ),
    DrawnCase::new(
        "triangle-with-a-corner-at-the-eye",
        "a corner at which x = y = w = 0: 0 / 0 in the projection",
        "M. Olano and T. Greer, Triangle Scan Conversion Using 2D Homogeneous Coordinates, 1997",
        || with_corner([0.0; 3]),
    ),
    DrawnCase::new(
        "triangle-with-a-corner-in-the-eyes-plane",
        "w = 0 away from the eye: an infinite place on the screen",
        "Vulkan 1.3, §26.5 Primitive Clipping",
        || with_corner([1.0, 0.5, 0.0]),
    ),
    DrawnCase::new(
        "triangle-behind-the-eye",
        "all corners have w < 0: divided by it they are in the picture, mirrored",
        "Vulkan 1.3, §26.5 Primitive Clipping",
        || beside(&[[[0.5, 0.0, 4.0], [2.0, 0.0, 4.0], [1.0, 1.0, 4.0]]]),
    ),
    DrawnCase::new(
        "triangle-seen-edge-on",
        "its plane contains the eye: no area, and planes of attributes without end",
        "T. Akenine-Möller et al., Real-Time Rendering, 4th ed., §23.1",
        || beside(&[[[0.5, 0.0, -2.0], [2.0, 0.0, -8.0], [0.2, 0.0, -8.0]]]),
    ),
    DrawnCase::new(
        "triangle-without-area",
        "three corners in one place, two, and three on a line: division by an area of 0",
        "Vulkan 1.3, §28.11 Polygons: degenerate polygons produce no fragments",
        || {
            let [a, b] = OTHERS;
            let middle = [1.25, 0.0, -4.0];
            beside(&[[a; 3], [a, a, b], [a, b, b], [a, middle, b]])
        },
    ),
    DrawnCase::new(
        "triangle-thinner-than-a-rounding",
        "a sliver 1e-6 wide: its area is a difference of products that are equal in f32",
        "J. R. Shewchuk, Adaptive Precision Floating-Point Arithmetic, 1997 (orientation)",
        || beside(&[[[0.5, -1.0, -4.0], [2.0, 1.0, -4.0], [1.25, 1e-6, -4.0]]]),
    ),
    DrawnCase::new(
        "triangles-smaller-than-a-pixel",
        "four hundred triangles a pixel and less apart: each covers one centre or none",
        "D3D11 functional specification, §3.4.2 (top-left rule)",
        || {
            let corner = |x: u32, y: u32| [x as f32 * 0.07 - 0.7, y as f32 * 0.06 - 0.6, -4.0];
            let cells = (0..20).flat_map(|y| (0..20).map(move |x| (x, y)));
            let triangles: Vec<Triangle> = cells
                .map(|(x, y)| [corner(x, y), corner(x + 1, y), corner(x, y + 1)])
                .collect();
            Solids::new(vec![Solid::new(&triangles)])?.staged()
        },
    ),
    DrawnCase::new(
        "corner-nan",
        "a place that is none: no comparison holds, so that no test throws it out",
        "IEEE 754 §5.11",
        || with_corner([f32::NAN, 0.5, -4.0]),
    ),
    DrawnCase::new(
        "corner-infinite",
        "an infinite place: infinity less infinity in every edge and plane",
        "IEEE 754 §7.2",
        || with_corner([f32::INFINITY, 0.5, -4.0]),
    ),
    DrawnCase::new(
        "corner-infinitely-far-ahead",
        "w is infinite: an infinite place over an infinite w",
        "IEEE 754 §7.2",
        || with_corner([1.0, 0.5, f32::NEG_INFINITY]),
    ),
    DrawnCase::new(
        "corners-of-the-largest-numbers",
        "3e38: sums and products of corners overflow before anything is cut",
        "IEEE 754 §7.4",
        || with_corner([3e38, 3e38, -3e38]),
    ),
    DrawnCase::new(
        "corners-of-subnormal-numbers",
        "1e-40: flushed on one device and not on the next, and a place at the eye either way",
        "WGSL §15.7.2",
        || with_corner([1e-40, -1e-40, -1e-40]),
    ),
    DrawnCase::new(
        "floor-to-the-horizon",
        "corners 10 km away and behind: cuts at the near plane lose the digits of what is near",
        "Vulkan 1.3, §26.5 Primitive Clipping",
        || Solids::new(vec![floor(1e4)])?.staged(),
    ),
    DrawnCase::new(
        "geometry-10-km-from-the-origin",
        "positions of 10 km in f32 have steps of a millimetre; only their difference from the eye's counts",
        "n8ao #54, on positions far from the origin",
        || {
            Solids::new(vec![floor(50.0), Solid::wall(4.0, 1.0)])?
                .moved(DVec3::new(1e4, -7e3, 1.3e4))
                .staged()
        },
    ),
    DrawnCase::new(
        "geometry-a-million-km-from-the-origin",
        "positions of 1e9: in f32 nothing of a scene of metres would be left",
        "C. Thorne, Using a Floating Origin to Improve Fidelity, 2005",
        || {
            Solids::new(vec![floor(50.0), Solid::wall(4.0, 1.0)])?
                .moved(DVec3::splat(1e9))
                .staged()
        },
    ),
    DrawnCase::new(
        "scale-tiny",
        "a scale of 1e-6 that the transform undoes: the normal's matrix has entries of 1e12",
        "E. Lengyel, Foundations of Game Engine Development 1, §3.2 (normals by cofactors)",
        || {
            let wall = Solid::wall(4e6, 1.5e6).placed(DMat4::from_scale(DVec3::splat(1e-6)));
            Solids::new(vec![wall])?.staged()
        },
    ),
    DrawnCase::new(
        "scale-huge",
        "a scale of 1e9 of something of a nanometre: cofactors of 1e18",
        "E. Lengyel, Foundations of Game Engine Development 1, §3.2",
        || {
            let wall = Solid::wall(4e-9, 1.5e-9).placed(DMat4::from_scale(DVec3::splat(1e9)));
            Solids::new(vec![wall])?.staged()
        },
    ),
    DrawnCase::new(
        "scale-none-along-the-normal",
        "flattened to its own plane: the inverse of its transform does not exist",
        "glTF 2.0, §3.5.3 (scales of 0)",
        || {
            let wall = Solid::wall(0.0, 1.5)
                .placed(at(0.0, 0.0, -4.0) * DMat4::from_scale(DVec3::new(1.0, 1.0, 0.0)));
            Solids::new(vec![wall])?.staged()
        },
    ),
    DrawnCase::new(
        "transform-that-mirrors",
        "a determinant below 0 turns winding around: one side drawn would be the other",
        "glTF 2.0, §3.7.4 (determinants and winding)",
        || {
            let wall = Solid::wall(4.0, 1.5)
                .placed(DMat4::from_scale(DVec3::new(-1.0, 1.0, 1.0)))
                .made_of(|surface| surface.two_sided = false);
            Solids::new(vec![wall])?.staged()
        },
    ),
    DrawnCase::new(
        "transform-to-a-point",
        "a scale of 0: every corner in one place, and a normal matrix of zeros",
        "glTF 2.0, §3.5.3 (scales of 0)",
        || {
            let point =
                Solid::wall(0.0, 1.0).placed(at(1.0, 0.0, -4.0) * DMat4::from_scale(DVec3::ZERO));
            Solids::new(vec![Solid::new(&[BESIDE]), point])?.staged()
        },
    ),
    DrawnCase::new(
        "surfaces-in-one-plane",
        "two walls at the same depth: which is seen must not hang on a rounding",
        "Vulkan 1.3, §8.1 and appendix on invariance",
        || {
            let other = Solid::wall(4.0, 1.0)
                .made_of(|surface| surface.base = glam::Vec4::new(0.1, 0.2, 0.9, 1.0));
            Solids::new(vec![Solid::wall(4.0, 1.5), other])?.staged()
        },
    ),
    DrawnCase::new(
        "vertex-normal-zero",
        "a normal of 0 has no direction: 0 / 0",
        "Blender T51979; Bevy #10905",
        || normal([0.0; 3]),
    ),
    DrawnCase::new(
        "vertex-normal-nan",
        "a normal that is none, in a G-buffer that others trust",
        "glTF validator, ACCESSOR_INVALID_FLOAT",
        || normal([f32::NAN, 0.0, 1.0]),
    ),
    DrawnCase::new(
        "vertex-normal-infinite",
        "a normal with an infinite component, which is no direction either",
        "glTF validator, ACCESSOR_INVALID_FLOAT",
        || normal([0.0, f32::NEG_INFINITY, 1.0]),
    ),
    DrawnCase::new(
        "vertex-normal-1e30",
        "a normal of 1e30: its square is infinite, its direction is not",
        "W. Kahan, on hypot; the Handbook of Floating-Point Arithmetic, §11",
        || normal([1e30, 0.0, 1e30]),
    ),
    DrawnCase::new(
        "vertex-normal-1e-30",
        "a normal of 1e-30: its square is 0, its direction is not",
        "W. Kahan, on hypot; the Handbook of Floating-Point Arithmetic, §11",
        || normal([1e-30, 1e-30, 1e-30]),
    ),
    DrawnCase::new(
        "vertex-normal-away-from-the-eye",
        "a normal on the side that is not seen, as interpolation makes them",
        "Filament, Physically Based Rendering, §4.4",
        || normal([0.3, 0.0, -1.0]),
    ),
    DrawnCase::new(
        "depth-drawn-standard",
        "0 at the near plane: 0.6 m from step to step at 1 km",
        "N. Reed, Depth Precision Visualized, 2015",
        || depth(DepthRange::Standard { far: 1000.0 }),
    ),
    DrawnCase::new(
        "depth-drawn-standard-infinite",
        "1 - near / distance cancels all digits of what is far",
        "N. Reed, Depth Precision Visualized, 2015",
        || depth(DepthRange::StandardInfinite),
    ),
    DrawnCase::new(
        "depth-drawn-reversed-finite",
        "a far plane that cuts what it crosses at depth 0",
        "N. Reed, Depth Precision Visualized, 2015",
        || depth(DepthRange::Reversed { far: 20.0 }),
    ),
    DrawnCase::new(
        "depth-drawn-between-planes-that-nearly-meet",
        "far = 1.01 near: slopes of a hundred near, and all of depth in a hundredth",
        "N. Reed, Depth Precision Visualized, 2015",
        || {
            Solids::new(vec![Solid::wall(4.0, 1.5)])?
                .seen(|view| {
                    view.camera.near = 3.98;
                    view.camera.depth = DepthRange::Standard { far: 4.02 };
                })
                .staged()
        },
    ),
    DrawnCase::new(
        "near-plane-of-a-micrometre",
        "depths of 1e-7 and less beside 1",
        "N. Reed, Depth Precision Visualized, 2015",
        || {
            Solids::new(vec![floor(50.0), Solid::wall(4.0, 1.0)])?
                .seen(|view| view.camera.near = 1e-6)
                .staged()
        },
    ),
    DrawnCase::new(
        "projection-far-off-centre",
        "a frustum wholly to one side, as tiles of large pictures have: ndc of 4 and scales of 4",
        "OpenGL glFrustum, asymmetric frusta",
        || {
            let wall = Solid::wall(4.0, 3.0).placed(at(-3.0, 3.0, 0.0));
            Solids::new(vec![wall])?
                .seen(|view| {
                    view.camera.centre = Vec2::new(4.0, -4.0);
                    view.camera.scale = Vec2::splat(4.0);
                })
                .staged()
        },
    ),
    DrawnCase::new(
        "picture-of-one-pixel",
        "one pixel: its centre is that of the picture, and 1 / size is 1",
        "Godot #96758 (sizes of 0 and 1)",
        || Solids::sized((1, 1), vec![Solid::wall(4.0, 1.0)])?.staged(),
    ),
    DrawnCase::new(
        "velocity-from-behind-the-eye",
        "w was negative: its quotient is a place in the picture that it never was at",
        "Bevy motion blur (clip w of the previous frame)",
        || from(at(0.0, 0.0, 8.0)),
    ),
    DrawnCase::new(
        "velocity-from-the-eyes-plane",
        "w was 0: division by 0",
        "Bevy motion blur (clip w of the previous frame)",
        || from(at(0.3, 0.0, 4.0)),
    ),
    DrawnCase::new(
        "velocity-from-next-to-the-eyes-plane",
        "w was 1e-6: a place a million pictures away, which no mark for other velocities may equal",
        "Bevy motion blur (clip w of the previous frame)",
        || from(at(2.0, 1.0, 4.0 - 1e-6)),
    ),
    DrawnCase::new(
        "velocity-through-the-eyes-plane",
        "w changes its sign within the triangle: a tiny one somewhere, and quotients without bound",
        "Bevy motion blur (clip w of the previous frame)",
        || from(at(0.0, 0.0, 4.0) * DMat4::from_rotation_y(0.7) * at(0.0, 0.0, 4.0)),
    ),
    DrawnCase::new(
        "velocity-of-half-a-pixel-in-a-thousand",
        "a move by 1e-5 of the picture: the difference of two numbers near 1/2",
        "J. Jimenez, Next Generation Post Processing in Call of Duty, 2014",
        || from(at(1e-4, 0.0, 0.0)),
    ),
    DrawnCase::new(
        "velocity-from-1e9-away",
        "a jump: velocities of many pictures, which half floats round to whole ones",
        "B. Karis, High Quality Temporal Supersampling, 2014 (history off the screen)",
        || from(at(1e9, -1e9, -4.0)),
    ),
    DrawnCase::new(
        "velocity-from-a-point",
        "it had no size a frame ago: every texel comes from one place",
        "glTF 2.0, §3.5.3 (animated scales)",
        || from(at(0.5, 0.2, -4.0) * DMat4::from_scale(DVec3::ZERO)),
    ),
    DrawnCase::new(
        "camera-turned-around",
        "what is seen was behind: the place before has z > 0, the sky's direction as well",
        "Bevy motion blur (clip w of the previous frame)",
        || seen_from(DMat4::from_rotation_y(std::f64::consts::PI)),
    ),
    DrawnCase::new(
        "camera-turned-by-a-right-angle",
        "directions that were in the eye's plane: z is 0 but for a rounding",
        "Bevy motion blur (clip w of the previous frame)",
        || seen_from(DMat4::from_rotation_y(std::f64::consts::FRAC_PI_2)),
    ),
    DrawnCase::new(
        "camera-jumped-a-thousand-km",
        "all that is near was far, the sky where it is",
        "B. Karis, High Quality Temporal Supersampling, 2014",
        || seen_from(at(1e6, 0.0, -1e6)),
    ),
    DrawnCase::new(
        "camera-turned-by-a-microradian",
        "velocities of 1e-6: digits of the difference of two places",
        "J. Jimenez, Next Generation Post Processing in Call of Duty, 2014",
        || seen_from(DMat4::from_quat(DQuat::from_rotation_y(1e-6))),
    ),
    DrawnCase::new(
        "weapon-across-the-near-plane",
        "what is held reaches through the near plane, moves, and is drawn first",
        "A. Courrèges, Doom (2016) Graphics Study",
        || {
            let mut weapon =
                Solid::new(&[[[0.05, -0.2, 0.1], [0.6, -0.5, -1.0], [0.2, 0.3, -1.5]]])
                    .moving_from(at(0.02, 0.01, 0.0));
            weapon.class = DrawClass::Weapon;
            Solids::new(vec![Solid::wall(4.0, 1.5), weapon])?.staged()
        },
    ),
    DrawnCase::new(
        "surface-at-the-ends-of-its-numbers",
        "black metal, white plastic, roughness 0 and 1, light of 65504: what each format holds last",
        "glTF 2.0, §3.9.2",
        || {
            let wall = |x: f64| Solid::wall(4.0, 0.5).placed(at(x, 0.0, 0.0));
            Solids::new(vec![
                wall(-1.0).made_of(|surface| {
                    surface.base = glam::Vec4::new(0.0, 0.0, 0.0, 1.0);
                    surface.metalness = 1.0;
                    surface.roughness = 0.0;
                }),
                wall(0.0).made_of(|surface| {
                    surface.base = glam::Vec4::ONE;
                    surface.mirrored = 1.0;
                    surface.roughness = 1.0;
                }),
                wall(1.0).made_of(|surface| surface.emission = Vec3::splat(65504.0)),
            ])?
            .staged()
        },
    ),
    DrawnCase::new(
        "opacity-at-its-cutoff",
        "an opacity that equals the cutoff is drawn, the next one below is not",
        "glTF 2.0, §3.9.4 (alpha mode MASK)",
        || {
            let wall = |x: f64, opacity: f32| {
                let wall = Solid::wall(4.0, 0.5).placed(at(x, 0.0, 0.0));
                wall.made_of(|surface| {
                    surface.base.w = opacity;
                    surface.cutoff = 0.5;
                })
            };
            Solids::new(vec![wall(-0.7, 0.5), wall(0.7, 0.5_f32.next_down())])?.staged()
        },
    ),
];
