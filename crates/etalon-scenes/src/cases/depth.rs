//! Depths at and beyond the ends of their range, of every kind of projection, and
//! scenes as large as f32 hardly holds.

use etalon_effects::DepthRange;
use glam::{DVec3, Vec2};

use super::paint::{Canvas, FRAME_TIME, SMALL, Spot, Texel};
use super::{Case, CaseError, Expected, Step};
use crate::camera::{Camera, Pose};
use crate::frame::FrameSize;
use crate::scenes::{World, WorldError};
use crate::trace::{Ambient, Material, SceneBuilder, Shape, Sky};

/// The room, with the depth of every third texel replaced.
fn replaced(depth: impl Fn(&Spot) -> f32) -> Result<Vec<Step>, CaseError> {
    Canvas::small().paint(|spot| {
        let room = spot.room();
        if spot.index.is_multiple_of(3) {
            Texel {
                depth: depth(spot),
                ..room
            }
        } else {
            room
        }
    })
}

/// One depth everywhere, on mirrors whose rays go to the right.
fn flat(canvas: Canvas, depth: f32) -> Result<Vec<Step>, CaseError> {
    canvas.paint(|spot| Texel {
        depth,
        ..spot.mirror(4.0, DVec3::X)
    })
}

/// A mirror and a wall at `unit` times their usual distances.
fn scaled(canvas: Canvas, unit: f64) -> Result<Vec<Step>, CaseError> {
    canvas.paint(|spot| {
        if spot.uv.x < 0.5 {
            spot.wall(2.0 * unit)
        } else if spot.uv.y < 0.1 {
            spot.sky()
        } else {
            spot.mirror(4.0 * unit, DVec3::new(-0.6, 0.05, 0.8))
        }
    })
}

/// Mirrors in a room, both as far from the origin of the world as asked, in f64.
fn world_at(origin: DVec3) -> Result<Vec<Step>, CaseError> {
    let camera = |position: DVec3| -> Result<Pose, WorldError> {
        let at = origin + position;
        Ok(Pose::look_at(
            at,
            origin + DVec3::new(0.0, 0.2, -1.0),
            DVec3::Y,
        )?)
    };
    let build = || -> Result<World, WorldError> {
        let mut scene = SceneBuilder::new();
        scene.sky(Sky {
            horizon: DVec3::new(0.4, 0.5, 0.7),
            zenith: DVec3::new(0.1, 0.2, 0.5),
        });
        scene.ambient(Ambient {
            above: DVec3::ONE,
            below: DVec3::ONE,
        });
        let plane = |point: DVec3, normal: DVec3| Shape::Plane {
            point: origin + point,
            normal,
        };
        let mirror = Material::metal(DVec3::ONE, 0.0);
        scene.object(plane(DVec3::NEG_Y * 0.25, DVec3::Y), mirror);
        let red = crate::trace::Property::Constant(DVec3::new(0.9, 0.3, 0.1));
        scene.object(plane(DVec3::NEG_Z * 6.0, DVec3::Z), Material::matte(red));
        let before = camera(DVec3::new(0.0, 1.0, 1.05))?;
        let now = camera(DVec3::new(0.0, 1.0, 1.0))?;
        Ok(World {
            scene: scene.build()?,
            camera: Camera::new(now, 1.0)?.moved_from(before),
        })
    };
    let frame = build()?.frame(FrameSize::new(SMALL.0, SMALL.1)?)?;
    Ok(vec![Step {
        camera: frame.camera_params(),
        frame,
        delta_time: FRAME_TIME,
    }])
}

const FAR: f32 = 100.0;

pub(super) const CASES: &[Case] = &[
    Case::new(
        "depth-at-the-near-plane",
        "device depth 1: the distance is the near plane's, from where no ray may turn back",
        "N. Reed, Depth Precision Visualized, 2015",
        || flat(Canvas::small(), 1.0),
    ),
    Case::new(
        "depth-an-ulp-before-the-near-plane",
        "a rasteriser's rounding puts a surface on the near plane before it",
        "Khronos Vulkan 1.3, 26.9 (depth clamping and rounding)",
        || flat(Canvas::small(), 1.000_000_1),
    ),
    Case::new(
        "depth-before-the-near-plane",
        "twice the depth that the projection can make: half the near plane's distance",
        "Khronos Vulkan 1.3, VK_EXT_depth_range_unrestricted",
        || replaced(|_| 2.0),
    ),
    Case::new(
        "depth-zero",
        "cleared, reversed: the distance is near / 0, and the sky has no position",
        "N. Reed, Depth Precision Visualized, 2015 (reversed, infinite)",
        || flat(Canvas::small(), 0.0),
    ),
    Case::new(
        "depth-zero-here-and-there",
        "holes in a surface: bilinear neighbours at infinity weigh into what is near",
        "godotengine/godot#73420",
        || replaced(|_| 0.0),
    ),
    Case::new(
        "depth-minus-zero",
        "a negative zero compares equal to the sky and divides to minus infinity",
        "IEEE 754, 6.3",
        || replaced(|_| -0.0),
    ),
    Case::new(
        "depth-negative",
        "behind the eye: no projection makes it, a fault of a depth copy does",
        "Khronos Vulkan 1.3, VK_EXT_depth_range_unrestricted",
        || replaced(|_| -0.5),
    ),
    Case::new(
        "depth-nan",
        "a NaN in depth: every comparison with it is false, the one that would end the march too",
        "gpuweb/gpuweb#5192",
        || replaced(|_| f32::NAN),
    ),
    Case::new(
        "depth-infinite",
        "an infinity in depth: the distance is 0, at the eye",
        "gpuweb/gpuweb#5192",
        || {
            replaced(|spot| {
                if spot.index.is_multiple_of(2) {
                    f32::INFINITY
                } else {
                    f32::NEG_INFINITY
                }
            })
        },
    ),
    Case::new(
        "depth-largest",
        "3.4e38: no infinity, but its product with any distance is one",
        "N. Higham, Accuracy and Stability of Numerical Algorithms, 27.5",
        || replaced(|_| f32::MAX),
    ),
    Case::new(
        "depth-denormal",
        "1e-40: near / depth overflows to infinity, and a device may take it for the sky",
        "WGSL §15.7.2 (subnormal values may be flushed)",
        || replaced(|_| 1e-40),
    ),
    Case::new(
        "depth-least-normal",
        "2^-126: a distance of 1e37, finite, whose square is not",
        "N. Higham, Accuracy and Stability of Numerical Algorithms, 27.5",
        || replaced(|_| f32::MIN_POSITIVE),
    ),
    Case::new(
        "depth-at-the-horizon",
        "around 2^40 view units, where surface ends and background begins",
        "etalon: lib/camera, distance_of",
        || {
            replaced(|spot| {
                let horizon = 0.1 / 1_099_511_627_776.0_f32;
                [horizon.next_down(), horizon, horizon.next_up()][spot.index as usize % 3]
            })
        },
    ),
    Case::new(
        "depth-one-surface-in-the-sky",
        "a single texel with a surface: all rays but its own start nowhere, and its own meets nothing",
        "godotengine/godot#73420",
        || {
            Canvas::new((33, 17)).paint(|spot| {
                if (spot.x, spot.y) == (16, 8) {
                    spot.mirror(4.0, DVec3::X)
                } else {
                    spot.sky()
                }
            })
        },
    ),
    Case::new(
        "depth-one-hole-in-a-wall",
        "a single texel of sky in a mirror that looks along itself",
        "godotengine/godot#73420",
        || {
            Canvas::new((33, 17)).paint(|spot| {
                if (spot.x, spot.y) == (16, 8) {
                    spot.sky()
                } else {
                    spot.mirror(4.0, DVec3::X)
                }
            })
        },
    ),
    Case::new(
        "depth-nothing-but-sky",
        "no surface at all: no ray, and still a picture",
        "bevyengine/bevy#13446 (empty frames)",
        || Canvas::small().paint(Spot::sky),
    ),
    Case::new(
        "depth-two-surfaces-an-ulp-apart",
        "as near to each other as depth can tell: which is in front hangs on one rounding",
        "N. Reed, Depth Precision Visualized, 2015",
        || {
            Canvas::small().paint(|spot| {
                let mirror = spot.mirror(4.0, DVec3::X);
                let nearer = f32::from_bits(mirror.depth.to_bits() + u32::from(spot.x % 2 == 1));
                Texel {
                    depth: nearer,
                    ..mirror
                }
            })
        },
    )
    .expecting_of_searches(&[Expected {
        effect: "ssr",
        bound: 1.0,
        reason: "where a ray goes along a surface within an ulp, it meets it anywhere in the texel",
    }]),
    Case::new(
        "depth-stored-in-half-floats",
        "steps of 0.5 m at 1 km: a smooth floor becomes a staircase that mirrors its own steps",
        "godotengine/godot#58616; wickedengine/WickedEngine#31",
        || {
            Canvas::small().paint(|spot| {
                let room = spot.room();
                Texel {
                    depth: half::f16::from_f32(room.depth).to_f32(),
                    ..room
                }
            })
        },
    ),
    Case::new(
        "depth-reversed-finite",
        "0 at a far plane of 100: bias is the small difference of two terms",
        "N. Reed, Depth Precision Visualized, 2015",
        || {
            scaled(
                Canvas::small().range(DepthRange::Reversed { far: FAR }),
                1.0,
            )
        },
    ),
    Case::new(
        "depth-reversed-finite-at-the-far-plane",
        "a cleared depth of 0 is the far plane itself, and one step more is a surface",
        "etalon: CameraParams::distance_range",
        || {
            Canvas::small()
                .range(DepthRange::Reversed { far: FAR })
                .paint(|spot| Texel {
                    depth: [0.0, 1e-9, 1e-7, 1e-5][spot.index as usize % 4],
                    ..spot.mirror(4.0, DVec3::X)
                })
        },
    ),
    Case::new(
        "depth-standard",
        "0 near and 1 far: most of f32's codes are where no surface is",
        "N. Reed, Depth Precision Visualized, 2015",
        || {
            scaled(
                Canvas::small().range(DepthRange::Standard { far: FAR }),
                1.0,
            )
        },
    ),
    Case::new(
        "depth-standard-at-the-far-plane",
        "codes next to 1 are metres apart: cleared and far differ by one rounding of the bias",
        "N. Reed, Depth Precision Visualized, 2015; etalon: CameraParams::distance_range",
        || {
            Canvas::small()
                .range(DepthRange::Standard { far: FAR })
                .paint(|spot| Texel {
                    depth: [1.0, 1.0_f32.next_down(), 1.0 - 1e-6, 1.0 - 1e-4]
                        [spot.index as usize % 4],
                    ..spot.mirror(4.0, DVec3::X)
                })
        },
    ),
    Case::new(
        "depth-standard-at-the-near-plane",
        "device depth 0 is the near plane here, not the sky",
        "Khronos Vulkan 1.3, 27.9 (depth range)",
        || {
            flat(
                Canvas::small().range(DepthRange::Standard { far: FAR }),
                0.0,
            )
        },
    ),
    Case::new(
        "depth-standard-infinite",
        "1 at infinity: the step below 1 is a distance of a million",
        "P. Upchurch and M. Desbrun, Tightening the Precision of Perspective Rendering, 2012",
        || {
            Canvas::small()
                .range(DepthRange::StandardInfinite)
                .paint(|spot| match spot.index % 4 {
                    0 => Texel {
                        depth: 1.0_f32.next_down(),
                        ..spot.mirror(4.0, DVec3::X)
                    },
                    1 => spot.sky(),
                    _ => spot.mirror(4.0 + spot.uv.x, DVec3::X),
                })
        },
    ),
    Case::new(
        "depth-far-just-behind-near",
        "a range of one part in a thousand: bias and slope are a thousand times near, and cancel",
        "P. Upchurch and M. Desbrun, 2012",
        || {
            Canvas::small()
                .camera(|camera| camera.near = 4.0)
                .range(DepthRange::Reversed { far: 4.01 })
                .paint(|spot| {
                    if spot.uv.x < 0.5 {
                        spot.wall(4.002)
                    } else {
                        spot.mirror(4.004, DVec3::NEG_X)
                    }
                })
        },
    ),
    Case::new(
        "depth-scene-of-10-km",
        "everything 10 km away: positions keep a millimetre, and biases in depth are kilometres",
        "bevyengine/bevy SSAO (depth += 1e-5: 50 % at 10 km); wickedengine/WickedEngine#31",
        || scaled(Canvas::small(), 2_500.0),
    ),
    Case::new(
        "depth-scene-of-100-km-behind-a-near-plane-of-a-micrometre",
        "eleven decimal orders in one depth buffer: near / depth keeps seven digits of each",
        "N. Reed, Depth Precision Visualized, 2015",
        || {
            scaled(
                Canvas::small().camera(|camera| camera.near = 1e-6),
                25_000.0,
            )
        },
    ),
    Case::new(
        "depth-scene-of-a-millimetre",
        "smaller than the thickness and the shortest ray allowed: everything is inside of everything",
        "etalon: Ssr::thickness",
        || scaled(Canvas::small().camera(|camera| camera.near = 1e-5), 1e-4),
    ),
    Case::new(
        "depth-near-plane-at-1000-km",
        "the largest near plane allowed: distances of 1e6, whose products are 1e12",
        "etalon: CameraParams::near",
        || scaled(Canvas::small().camera(|camera| camera.near = 1e6), 1e6),
    ),
    Case::new(
        "depth-a-thousand-kilometres-to-the-side",
        "a field of view of 179.9°: the position is a thousand times the distance",
        "godotengine/godot#96758",
        || {
            scaled(
                Canvas::small().camera(|camera| camera.scale = Vec2::new(0.001, 0.001)),
                1.0,
            )
        },
    ),
    Case::new(
        "world-10-km-from-the-origin",
        "world positions lose 11 bits: what is not relative to the camera jitters by a millimetre",
        "n8ao#54 (view and world mixed up far from the origin)",
        || world_at(DVec3::new(10_000.0, -500.0, 7_000.0)),
    ),
    Case::new(
        "world-at-the-radius-of-the-earth",
        "6371 km from the origin: f32 world positions have steps of half a metre",
        "E. Bruneton, precomputed_atmospheric_scattering#21",
        || world_at(DVec3::new(0.0, 6_371_000.0, 0.0)),
    ),
    Case::new(
        "depth-of-random-order",
        "any distance from 0.1 to 1e9, texel by texel: eight decimal orders along every ray",
        "M. McGuire and M. Mara, JCGT 3(4), 2014",
        || {
            Canvas::small().paint(|spot| {
                let distance = 0.1 * 10_f64.powf(10.0 * spot.share(1));
                let z = 2.0 * spot.share(2) - 1.0;
                spot.mirror(
                    distance,
                    DVec3::new(spot.share(3) - 0.5, spot.share(4) - 0.5, z),
                )
            })
        },
    ),
];
