//! Where mirror rays go: along an axis of the screen, along the view plane, at the
//! eye, past it, nowhere.

use std::f64::consts::FRAC_1_SQRT_2;

use etalon_effects::knob::KnobValue::{Choice, Count, Real};
use glam::{DVec2, DVec3, Vec2};

use super::paint::{Canvas, SMALL, Spot, Texel};
use super::{Case, CaseError, Expected, Step};

const SSR: &[&str] = &["ssr", "chain"];

/// A mirror in the middle of the picture, 4 away, whose rays leave towards `out`,
/// and around it a wall that is nearer by less than the usual thickness.
fn framed(out: DVec3) -> Result<Vec<Step>, CaseError> {
    Canvas::small().paint(|spot| framed_spot(spot, |spot| spot.mirror(4.0, out)))
}

fn framed_spot(spot: &Spot, mirror: impl Fn(&Spot) -> Texel) -> Texel {
    let inside = |share: f64| (0.33..0.67).contains(&share);
    if inside(spot.uv.x) && inside(spot.uv.y) {
        mirror(spot)
    } else {
        spot.wall(3.9)
    }
}

/// A mirror in the right half and a wall, half as far, in the left one.
fn beside_a_wall(out: impl Fn(&Spot) -> DVec3) -> Result<Vec<Step>, CaseError> {
    Canvas::small().paint(|spot| {
        if spot.uv.x < 0.5 {
            spot.wall(2.0)
        } else {
            spot.mirror(4.0, out(spot))
        }
    })
}

/// One row or column of mirrors that look along it, with a wall at its end.
fn long(size: (u32, u32), out: DVec3) -> Result<Vec<Step>, CaseError> {
    Canvas::new(size)
        // Square pixels would make the picture a line without width.
        .camera(|camera| camera.scale = Vec2::ONE)
        .paint(|spot| {
            let end = spot.uv.x.max(spot.uv.y) > 0.99;
            if end {
                spot.wall(3.9)
            } else {
                spot.mirror(4.0, out)
            }
        })
}

pub(super) const CASES: &[Case] = &[
    Case::new(
        "ray-back-to-a-near-plane-at-the-eye",
        "cut at a near plane 10⁸ times nearer than its start, a ray ends there or, by a rounding, at the eye, where \
         nothing is projected",
        "M. McGuire and M. Mara, Efficient GPU Screen-Space Ray Tracing, 2014 (clipping at the near plane)",
        || {
            Canvas::small()
                .camera(|camera| camera.near = 1e-6)
                .paint(|spot| {
                    framed_spot(spot, |spot| spot.mirror(100.0, DVec3::new(0.2, 0.1, 1.0)))
                })
        },
    )
    .on(&["ssr"])
    .with(&[("max_distance", Real(1000.0))]),
    Case::new(
        "ray-parallel-to-view-plane",
        "dir.z is 0: a sign of it is 0, the step becomes zero and length(0) divides",
        "Blender EEVEE raytrace_lib.glsl (z_sign); eevee_ray_trace_screen_lib.glsl",
        || framed(DVec3::X),
    ),
    Case::new(
        "ray-axis-aligned-left",
        "dY is 0: mix() over the unselected branch 0/0 gives NaN times 0",
        "D. Lettier, 3D Game Shaders For Beginners, screen-space-reflection.frag",
        || framed(DVec3::NEG_X),
    ),
    Case::new(
        "ray-axis-aligned-up",
        "dX is 0: mix() over the unselected branch 0/0 gives NaN times 0",
        "D. Lettier, 3D Game Shaders For Beginners, screen-space-reflection.frag",
        || framed(DVec3::Y),
    ),
    Case::new(
        "ray-axis-aligned-down",
        "uv's y runs against the view's y: a sign lost here marches up instead",
        "D. Lettier, 3D Game Shaders For Beginners, screen-space-reflection.frag",
        || framed(DVec3::NEG_Y),
    ),
    Case::new(
        "ray-exactly-diagonal",
        "both axes are crossed equally: neither may be taken for the longer one twice",
        "M. McGuire and M. Mara, Efficient GPU Screen-Space Ray Tracing, JCGT 3(4), 2014",
        || {
            let side = SMALL.1;
            Canvas::new((side, side))
                .paint(|spot| framed_spot(spot, |spot| spot.mirror(4.0, DVec3::new(1.0, 1.0, 0.0))))
        },
    ),
    Case::new(
        "ray-off-axis-by-one-ulp",
        "dY is smaller than any step of f32: the ratio of the two overflows if divided the wrong way",
        "D. Lettier, 3D Game Shaders For Beginners, screen-space-reflection.frag",
        || framed(DVec3::new(1.0, 1.2e-7, 0.0)),
    ),
    Case::new(
        "ray-toward-eye",
        "the ray comes straight back: zero length on screen, and a division by it",
        "Blender EEVEE raytrace_lib.glsl (degenerate branch at 1e-4)",
        || Canvas::small().paint(|spot| spot.mirror(4.0, -spot.ray)),
    ),
    Case::new(
        "ray-toward-eye-almost",
        "the screen delta is around half a texel, where a march of one step begins",
        "Blender EEVEE eevee_ray_trace_screen_lib.glsl (degenerate branch at 1e-5)",
        || {
            Canvas::small().paint(|spot| {
                let aside = DVec3::new(2e-3 * (spot.share(1) - 0.5), 2e-3 * (spot.share(2) - 0.5), 0.0);
                spot.mirror(4.0, aside - spot.ray)
            })
        },
    ),
    Case::new(
        "ray-away-from-eye",
        "the ray goes on as it came, in a surface seen edge-on: no mirror, and zero length on screen",
        "AMD FidelityFX SSSR, ffx_sssr_intersect.h",
        || {
            Canvas::small().paint(|spot| {
                let across = spot.ray.cross(DVec3::Y).normalize();
                spot.mirror_with(4.0, across)
            })
        },
    ),
    Case::new(
        "ray-past-the-eye",
        "the ray crosses the eye plane, w goes through 0 and the end point mirrors",
        "bevyengine/bevy raymarch.wgsl (|w| >= 1e-10); lettier's start*end/mix(end, start, t)",
        || beside_a_wall(|spot| DVec3::new(-0.4, 0.0, 1.0) - 0.1 * spot.ray),
    ),
    Case::new(
        "ray-into-the-near-plane",
        "the ray ends exactly where it is cut: the tip is on the near plane, give or take rounding",
        "M. McGuire and M. Mara, JCGT 3(4), 2014 (clipping to the near plane)",
        || beside_a_wall(|_| DVec3::new(-0.2, 0.1, 0.97)),
    ),
    Case::new(
        "ray-from-the-near-plane",
        "no headroom before the near plane: a quotient of 0 by the ray's slope, a ray of no length",
        "M. McGuire and M. Mara, JCGT 3(4), 2014 (clipping to the near plane)",
        || {
            Canvas::small().paint(|spot| {
                if spot.uv.x < 0.5 {
                    spot.wall(2.0)
                } else {
                    spot.mirror(0.1, DVec3::new(-0.5, 0.0, 0.8))
                }
            })
        },
    ),
    Case::new(
        "ray-away-from-the-near-plane",
        "from distance 0.1 to 20: 1/distance falls by 200 along one ray, most of it in its first texels",
        "hacksoflife.blogspot.com 2020-10 (parametrise in t, not in reversed depth)",
        || {
            Canvas::small().paint(|spot| {
                if spot.uv.x > 0.6 {
                    spot.wall(5.0)
                } else {
                    spot.mirror(0.1, DVec3::new(0.8, 0.0, -0.6))
                }
            })
        },
    ),
    Case::new(
        "ray-budget-exhausted-in-a-row",
        "8192 texels to the only hit and 4096 steps allowed: a spent budget is no hit",
        "FFX ffx_sssr_intersect.h and DiligentFX SSR_ComputeIntersection.fx (i <= max after while i < max)",
        || long((8192, 1), DVec3::X),
    )
    .on(SSR),
    Case::new(
        "ray-budget-of-one-step",
        "one step and then the end: a hit that was not looked at must not be reported",
        "FFX ffx_sssr_intersect.h and DiligentFX SSR_ComputeIntersection.fx (valid_hit)",
        || framed(DVec3::X),
    )
    .on(&["ssr"])
    .with(&[("march_limit", Count(1))]),
    Case::new(
        "ray-through-a-corner",
        "the ray leaves over two edges of the picture at once: two cuts of the same length",
        "M. McGuire and M. Mara, JCGT 3(4), 2014",
        || {
            Canvas::new((32, 32)).paint(|spot| {
                let toward = DVec2::new(spot.uv.x - 0.5, 0.5 - spot.uv.y);
                spot.mirror(4.0, toward.extend(-0.05))
            })
        },
    ),
    Case::new(
        "ray-out-of-the-picture-at-once",
        "from the outermost texels outward: half a texel of room, and no texel to look at",
        "M. McGuire and M. Mara, JCGT 3(4), 2014",
        || {
            Canvas::new((9, 9)).paint(|spot| {
                let toward = DVec2::new(spot.uv.x - 0.5, 0.5 - spot.uv.y);
                spot.mirror(4.0, (toward * 100.0).extend(-0.01))
            })
        },
    ),
    Case::new(
        "ray-along-its-own-floor",
        "a floor seen at grazing angles mirrors itself if a texel's one depth counts as its surface",
        "godotengine/godot#58616 (depth precision of reflections)",
        || {
            Canvas::small().paint(|spot| {
                let floor = spot.plane(DVec3::new(0.0, -0.05, 0.0), DVec3::Y);
                floor.map_or_else(
                    || spot.sky(),
                    |distance| spot.mirror_with(distance, DVec3::Y),
                )
            })
        },
    ),
    Case::new(
        "ray-in-a-depth-plateau",
        "ray and surface are equally far all along: the residue is 0 everywhere, secant refinement 0/0",
        "Blender EEVEE and bevyengine/bevy (d0 / (d0 - d1))",
        || {
            Canvas::small().paint(|spot| {
                if spot.uv.x < 0.5 {
                    spot.mirror(4.0, DVec3::X)
                } else {
                    spot.wall(4.0)
                }
            })
        },
    ),
    Case::new(
        "ray-behind-by-exactly-the-thickness",
        "the residue is the thickness itself: hit or miss hangs on the last bit",
        "DiligentGraphics/DiligentFX SSR_ComputeIntersection.fx (thickness test)",
        || {
            Canvas::small().paint(|spot| {
                if spot.uv.x < 0.5 {
                    spot.mirror(4.0, DVec3::X)
                } else {
                    spot.wall(3.75)
                }
            })
        },
    ),
    Case::new(
        "ray-past-a-thin-pole",
        "one texel wide: a stride over it, or bisection away from it, misses what is there",
        "D. Lettier, screen-space-reflection.frag (a miss extrapolates past the bracket)",
        || {
            Canvas::small().paint(|spot| {
                if spot.x == 36 {
                    spot.wall(3.9).coloured([9.0, 8.0, 2.0])
                } else if spot.uv.x < 0.5 {
                    spot.mirror(4.0, DVec3::X)
                } else {
                    spot.wall(9.0)
                }
            })
        },
    ),
    Case::new(
        "ray-past-a-thin-pole-in-strides",
        "the same with every sixteenth texel looked at: from in front of the pole to behind it in a step",
        "D. Lettier, screen-space-reflection.frag (resolution)",
        || {
            Canvas::small().paint(|spot| {
                if spot.x == 36 {
                    spot.wall(3.9).coloured([9.0, 8.0, 2.0])
                } else if spot.uv.x < 0.5 {
                    spot.mirror(4.0, DVec3::X)
                } else {
                    spot.wall(3.0)
                }
            })
        },
    )
    .on(&["ssr"])
    .with(&[("resolution", Real(1.0 / 16.0))]),
    Case::new(
        "ray-into-the-sky",
        "nothing to be met: a cleared depth must not read as a surface at infinity",
        "godotengine/godot#73420 (reflections of the cleared depth)",
        || {
            Canvas::small().paint(|spot| {
                if spot.uv.x < 0.3 {
                    spot.mirror(4.0, DVec3::X)
                } else {
                    spot.sky()
                }
            })
        },
    ),
    Case::new(
        "ray-to-its-longest",
        "the hit lies within rounding of max_distance, where the fade by distance ends at 0",
        "D. Lettier, screen-space-reflection.frag (maxDistance)",
        || {
            Canvas::small().paint(|spot| {
                if spot.uv.y > 0.6 {
                    // Down at a floor that is far away, and on from there.
                    spot.mirror(4.0, DVec3::new(0.0, 0.18, -1.0))
                } else {
                    spot.wall(23.6)
                }
            })
        },
    ),
    Case::new(
        "ray-meets-a-chequer-of-depths",
        "near and far in turn, texel by texel: every step changes sides and no bracket is unique",
        "M. McGuire and M. Mara, JCGT 3(4), 2014 (the depth buffer is no continuous surface)",
        || {
            Canvas::small().paint(|spot| {
                if spot.uv.x < 0.4 {
                    spot.mirror(4.0, DVec3::new(1.0, 0.07, 0.0))
                } else {
                    spot.wall(if (spot.x + spot.y) % 2 == 0 { 3.9 } else { 40.0 })
                }
            })
        },
    ),
    Case::new(
        "ray-behind-a-long-wall",
        "far behind a near wall, and then into a small step: squares of the nearest depth alone never say that \
         there is nothing to be met, squares of the farthest do",
        "Y. Uludag, Hi-Z Screen-Space Cone-Traced Reflections, GPU Pro 5, 2014 (rays behind objects)",
        || {
            Canvas::small().paint(|spot| match spot.x {
                0..8 => spot.mirror(4.0, DVec3::X),
                8..43 => spot.wall(2.0),
                _ => spot.wall(3.9).coloured([9.0, 8.0, 2.0]),
            })
        },
    )
    .on(&["ssr"]),
    Case::new(
        "ray-to-an-odd-last-column",
        "what there is to be met is in the last of 129 columns and 67 rows: squares that are halved and rounded \
         down, of 2 × 2 parents each, do not have it",
        "bevyengine/bevy#22603 and godotengine/godot#73420 (pyramids of odd sizes)",
        || {
            Canvas::new((129, 67)).paint(|spot| {
                if spot.x == 128 || spot.y == 66 {
                    spot.wall(3.9).coloured([9.0, 8.0, 2.0])
                } else if (spot.x / 8 + spot.y / 8) % 2 == 0 {
                    spot.mirror(4.0, DVec3::X)
                } else {
                    spot.mirror(4.0, DVec3::NEG_Y)
                }
            })
        },
    )
    .on(&["ssr"]),
    Case::new(
        "ray-through-corners-of-squares",
        "rays along a diagonal of texels leave every square of a pyramid at its corner, over both borders at \
         once: a step into either neighbour is in a square that the ray does not pass",
        "M. McGuire and M. Mara, JCGT 3(4), 2014; Y. Uludag, GPU Pro 5, 2014 (crossing cells)",
        || {
            let side = 64;
            Canvas::new((side, side))
                .camera(|camera| camera.scale = Vec2::ONE)
                .paint(|spot| {
                    // A wall on one side of the main diagonal, at every corner.
                    let beside = spot.x == spot.y + 1 || spot.y == spot.x + 1;
                    if beside && spot.x > 20 || spot.x > 60 {
                        spot.wall(3.9)
                    } else {
                        spot.mirror(4.0, DVec3::new(1.0, -1.0, 0.0))
                    }
                })
        },
    )
    .on(&["ssr"]),
    Case::new(
        "ray-over-a-gap-to-a-single-texel",
        "nothing at all over whole squares, and in the last one a single texel: what nothing stands for must \
         neither be met nor hide that",
        "godotengine/godot#73420 (reflections of the cleared depth)",
        || {
            Canvas::small().paint(|spot| {
                if spot.x < 8 {
                    spot.mirror(4.0, DVec3::X)
                } else if spot.x == 45 {
                    spot.wall(3.9).coloured([9.0, 8.0, 2.0])
                } else {
                    spot.sky()
                }
            })
        },
    )
    .on(&["ssr"]),
    Case::new(
        "ray-into-a-hole-of-one-texel",
        "behind all that a square shows but for one texel, where the ray is just behind what is seen through \
         the hole: a square's nearest and farthest surfaces lie on both sides of the ray",
        "OloEngine#284 (nearest and farthest depth of a pyramid)",
        || {
            Canvas::small().paint(|spot| {
                if spot.x < 8 {
                    spot.mirror(4.0, DVec3::X)
                } else if spot.x == 29 {
                    spot.wall(3.9).coloured([9.0, 8.0, 2.0])
                } else {
                    spot.wall(1.5)
                }
            })
        },
    )
    .on(&["ssr"]),
    Case::new(
        "ray-in-a-concave-corner",
        "the hit is the next texel: the bracket is one texel wide from the start",
        "M. McGuire and M. Mara, JCGT 3(4), 2014",
        || {
            Canvas::small().paint(|spot| {
                let left = spot.plane(DVec3::new(0.0, 0.0, -4.0), DVec3::new(0.8, 0.0, 0.6));
                let right = spot.plane(DVec3::new(0.0, 0.0, -4.0), DVec3::new(-0.8, 0.0, 0.6));
                match (left, right) {
                    (Some(a), Some(b)) if a < b => spot.mirror_with(a, DVec3::new(0.8, 0.0, 0.6)),
                    (_, Some(b)) => spot.mirror_with(b, DVec3::new(-0.8, 0.0, 0.6)),
                    (Some(a), None) => spot.mirror_with(a, DVec3::new(0.8, 0.0, 0.6)),
                    (None, None) => spot.sky(),
                }
            })
        },
    ),
    Case::new(
        "ray-every-which-way",
        "directions over the whole sphere, at the same time all signs and all ratios of the three axes",
        "AMD FidelityFX SSSR, ffx_sssr_intersect.h",
        || {
            Canvas::small().paint(|spot| {
                let z = 2.0 * spot.share(1) - 1.0;
                let turn = std::f64::consts::TAU * spot.share(2);
                let flat = (1.0 - z * z).sqrt();
                let out = DVec3::new(flat * turn.cos(), flat * turn.sin(), z);
                spot.mirror(2.0 + 4.0 * spot.share(3), out)
            })
        },
    ),
    Case::new(
        "ray-under-a-field-of-view-of-179-degrees",
        "view rays lean by a factor of 115: positions at the edge are far longer than their distance",
        "godotengine/godot#96758 (extreme projections)",
        || {
            Canvas::small()
                .camera(|camera| camera.scale = Vec2::new(0.0058, 0.0087))
                .paint(|spot| {
                    if spot.uv.x < 0.5 {
                        spot.wall(2.0)
                    } else {
                        spot.mirror(4.0, DVec3::new(-1.0, 0.0, 0.2))
                    }
                })
        },
    )
    .on(SSR),
    Case::new(
        "ray-under-a-field-of-view-of-a-second-of-arc",
        "a telescope: a texel is 1e-7 wide at distance 1, and the longest ray crosses all of the picture at once",
        "godotengine/godot#96758 (extreme projections)",
        || {
            Canvas::small()
                .camera(|camera| camera.scale = Vec2::new(275_000.0, 412_000.0))
                .paint(|spot| {
                    if spot.uv.x < 0.5 {
                        spot.wall(2.0)
                    } else {
                        spot.mirror(4.0, DVec3::new(-1.0, 0.0, 0.2))
                    }
                })
        },
    )
    .on(SSR),
    Case::new(
        "ray-under-an-off-centre-projection",
        "the view axis is seen at a corner, as with jitter or a tiled picture: ndc is no longer symmetric",
        "Khronos, glTF 2.0 and OpenXR (asymmetric frusta)",
        || {
            Canvas::small()
                .camera(|camera| camera.centre = Vec2::new(0.9, -0.8))
                .paint(|spot| framed_spot(spot, |spot| spot.mirror(4.0, DVec3::new(1.0, 0.3, -0.2))))
        },
    )
    .on(SSR),
    Case::new(
        "ray-under-an-anisotropic-projection",
        "scales of 1e-3 and 1e3 in the two axes: the longer axis on screen is the shorter one in space",
        "AMD FidelityFX SSSR, ffx_sssr_intersect.h",
        || {
            Canvas::small()
                .camera(|camera| camera.scale = Vec2::new(1e-3, 1e3))
                .paint(|spot| framed_spot(spot, |spot| spot.mirror(4.0, DVec3::new(FRAC_1_SQRT_2, FRAC_1_SQRT_2, -0.1))))
        },
    )
    .on(SSR),
    Case::new(
        "ray-hit-beside-its-start-10-km-away",
        "the ray's length as a difference of positions of 10 km: 0.2 m of it keep eight bits",
        "wickedengine/WickedEngine#31 (stripes beyond 5 km)",
        || {
            Canvas::small()
                .camera(|camera| camera.scale = Vec2::new(40_000.0, 60_000.0))
                .paint(|spot| {
                    if spot.uv.x < 0.5 {
                        spot.mirror(10_000.0, DVec3::X)
                    } else {
                        spot.wall(9_999.9)
                    }
                })
        },
    )
    .on(SSR)
    .expecting(TEN_KM),
    Case::new(
        "ray-places-in-half-floats",
        "u and v rounded to 2^-12 look up another texel than the one that was hit",
        "godotengine/godot#58616 (16-bit reflections)",
        || framed(DVec3::new(1.0, 0.21, 0.0)),
    )
    .on(&["ssr"])
    .with(&[("storage", Choice("rgba16float"))]),
];

/// What is left of a difference of two distances of 10 km.
const TEN_KM: &[Expected] = &[
    Expected {
        effect: "ssr",
        bound: 1.0 / 256.0,
        reason: TEN_KM_REASON,
    },
    Expected {
        effect: "chain",
        bound: 1.0 / 256.0,
        reason: TEN_KM_REASON,
    },
];

const TEN_KM_REASON: &str = "distances of 10 km have steps of 2^-10 m in f32, which is 2^-8 of the thickness of 0.25 \
     that the fade by depth divides by; the depth given has no more digits";
