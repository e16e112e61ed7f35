//! Lights and surfaces whose light is hard to compute.

use std::f32::consts::FRAC_PI_2;

use etalon_effects::DepthRange;
use etalon_effects::lighting::{LightKind, PunctualLight};
use glam::{DVec3, Vec3};

use super::super::paint::{Canvas, Spot, Texel};
use super::{CaseError, DrawnCase, LightMap, Stage, Surfaces};

/// A light like those that cases change.
pub(super) const LAMP: PunctualLight = PunctualLight {
    kind: LightKind::Point,
    position: DVec3::new(0.5, 1.0, -2.5),
    direction: DVec3::new(-0.2, -0.8, -0.6),
    power: Vec3::new(6.0, 4.0, 2.0),
    reach: None,
};

pub(super) const fn point(position: DVec3) -> PunctualLight {
    PunctualLight { position, ..LAMP }
}

pub(super) const fn sun(direction: DVec3) -> PunctualLight {
    PunctualLight {
        kind: LightKind::Directional,
        direction,
        ..LAMP
    }
}

pub(super) const fn spot(inner: f32, outer: f32) -> PunctualLight {
    PunctualLight {
        kind: LightKind::Spot { inner, outer },
        ..LAMP
    }
}

/// A surface at a distance with a normal, of plastic.
fn surface(spot: &Spot, distance: f64, normal: [f32; 3]) -> Texel {
    let [x, y, z] = normal;
    Texel {
        normal: [x, y, z, 0.0],
        specular: [0.04, 0.04, 0.04, 0.5],
        ..spot.wall(distance).coloured([0.8, 0.4, 0.2])
    }
}

/// A wall four metres away.
fn wall(spot: &Spot) -> Texel {
    surface(spot, 4.0, [0.0, 0.0, 1.0])
}

/// A floor a metre below the eye, and nothing above the horizon.
fn floor(spot: &Spot) -> Texel {
    match spot.plane(DVec3::NEG_Y, DVec3::Y) {
        Some(distance) if distance < 1e4 => surface(spot, distance, [0.0, 1.0, 0.0]),
        _ => spot.sky(),
    }
}

/// What is painted, lit.
fn lit(paint: impl Fn(&Spot) -> Texel, lights: &[PunctualLight]) -> Result<Stage, CaseError> {
    Surfaces::painted(Canvas::small(), paint)?
        .lit(lights)
        .staged()
}

/// A wall with normals of a kind.
fn normal(normal: [f32; 3]) -> Result<Stage, CaseError> {
    let canvas = Canvas::small().wide();
    Surfaces::painted(canvas, |spot| surface(spot, 4.0, normal))?
        .lit(&[LAMP])
        .under(1.0, 0.25)
        .staged()
}

/// A wall with depths of a kind.
fn depth(depth: f32) -> Result<Stage, CaseError> {
    Surfaces::painted(Canvas::small(), |spot| Texel {
        depth,
        ..wall(spot)
    })?
    .lit(&[LAMP, sun(DVec3::NEG_Z)])
    .under(1.0, 0.25)
    .staged()
}

/// A wall of a roughness that mirrors so much, on which a sun is seen.
fn mirror(roughness: f32, mirrored: f32) -> Result<Stage, CaseError> {
    let paint = |spot: &Spot| Texel {
        specular: [mirrored, mirrored, mirrored, 1.0 - roughness],
        ..wall(spot)
    };
    Surfaces::painted(Canvas::small().wide(), paint)?
        .lit(&[sun(DVec3::new(0.1, 0.05, -1.0)), LAMP])
        .under(1.0, 0.25)
        .staged()
}

/// A wall, glowing as it scatters, whose every third texel has a colour of a kind.
fn colour(colour: [f32; 4]) -> Result<Stage, CaseError> {
    let paint = |spot: &Spot| match spot.index % 3 {
        0 => Texel {
            colour,
            ..wall(spot)
        },
        _ => wall(spot),
    };
    Surfaces::painted(Canvas::small().wide(), paint)?
        .glowing()
        .lit(&[LAMP])
        .under(1.0, 0.25)
        .staged()
}

/// Sums of half floats that a target adds up.
pub(super) const ADDED: &str =
    "the target adds layers of up to 65504 by itself; what reads it takes infinity for 65504";

pub(super) const CASES: &[DrawnCase] = &[
    DrawnCase::new(
        "lamp-on-the-surface",
        "a light at distance 0: 1 / d² and a direction of 0 / 0",
        "KHR_lights_punctual (limits of the inverse square); UE-216276 (rsqrt of 0)",
        || lit(wall, &[point(DVec3::new(0.0, 0.0, -4.0))]),
    ),
    DrawnCase::new(
        "lamp-a-tenth-of-a-millimetre-off",
        "1e-4 above the wall: 1 / d² is 1e8, and the place in f32 has a step of 2e-7",
        "S. Lagarde and C. de Rousiers, Moving Frostbite to PBR, 2014, §4.4",
        || lit(wall, &[point(DVec3::new(0.0, 0.0, -3.9999))]),
    ),
    DrawnCase::new(
        "lamp-at-the-eye",
        "the half vector is the view: h · v is 1 but for a rounding",
        "E. Heitz, Understanding the Masking-Shadowing Function, 2014",
        || lit(wall, &[point(DVec3::ZERO)]),
    ),
    DrawnCase::new(
        "lamp-behind-the-surface",
        "n · l is negative: a distribution without a surface to be on",
        "glTF 2.0, appendix B",
        || lit(wall, &[point(DVec3::new(0.0, 0.0, -6.0))]),
    ),
    DrawnCase::new(
        "lamp-in-the-surfaces-plane",
        "n · l is a rounding everywhere: light from a cancelled difference",
        "B. Walter et al., Microfacet Models for Refraction, 2007 (grazing)",
        || lit(floor, &[point(DVec3::new(0.3, -1.0, -5.0))]),
    ),
    DrawnCase::new(
        "lamp-of-most-power",
        "an intensity of 1e6 a metre off: beyond what half floats hold",
        "Filament #2362",
        || {
            lit(
                wall,
                &[PunctualLight {
                    power: Vec3::splat(1e6),
                    ..point(DVec3::new(0.0, 0.0, -3.0))
                }],
            )
        },
    ),
    DrawnCase::new(
        "lamps-beyond-the-targets-range",
        "two lights of 65504 and more on one surface: their sum is infinite as a half float",
        "Wicked Engine #1667 (sums of half floats)",
        || {
            let bright = PunctualLight {
                power: Vec3::splat(1e6),
                ..point(DVec3::new(0.0, 0.0, -3.0))
            };
            lit(wall, &[bright; 3])
        },
    )
    .overflowing(ADDED),
    DrawnCase::new(
        "lamp-of-no-power",
        "a light that is off is nothing, and no NaN of nothing times infinity",
        "IEEE 754 §7.2",
        || {
            lit(
                wall,
                &[PunctualLight {
                    power: Vec3::ZERO,
                    ..point(DVec3::new(0.0, 0.0, -4.0))
                }],
            )
        },
    ),
    DrawnCase::new(
        "lamp-a-billion-km-away",
        "1e12: its square is 1e24, its light 1e-18 of what it has",
        "KHR_lights_punctual",
        || lit(wall, &[point(DVec3::new(1e12, 1e12, 1e12))]),
    ),
    DrawnCase::new(
        "lamp-of-a-millimetres-reach",
        "a window that ends before the distance that is taken at least",
        "KHR_lights_punctual (range)",
        || {
            lit(
                wall,
                &[PunctualLight {
                    reach: Some(1e-3),
                    ..point(DVec3::new(0.0, 0.0, -4.0))
                }],
            )
        },
    ),
    DrawnCase::new(
        "lamp-of-a-thousand-kms-reach",
        "the fourth power of a reach of 1e6 is 1e24",
        "KHR_lights_punctual (range)",
        || {
            lit(
                wall,
                &[PunctualLight {
                    reach: Some(1e6),
                    ..LAMP
                }],
            )
        },
    ),
    DrawnCase::new(
        "lamp-at-its-reach",
        "1 - (d / r)⁴ next to 0: a difference that cancels, and must not be negative",
        "KHR_lights_punctual (range)",
        || {
            lit(
                wall,
                &[PunctualLight {
                    reach: Some(2.0),
                    ..point(DVec3::new(0.0, 0.0, -2.0))
                }],
            )
        },
    ),
    DrawnCase::new(
        "cone-with-nearly-equal-angles",
        "1 / (cos inner - cos outer): a step that is nearly one",
        "KHR_lights_punctual (spot angles; max(0.001, …) in its sample code)",
        || lit(wall, &[spot(0.5 * 0.9999, 0.5)]),
    ),
    DrawnCase::new(
        "cone-of-a-thousandth",
        "cosines of a milliradian are 1 - 5e-7: in f32 eight steps, of which 1 / difference is 1e6",
        "KHR_lights_punctual (spot angles); W. Kahan, on 1 - cos x",
        || {
            let far = PunctualLight {
                position: DVec3::new(0.0, 0.0, 1996.0),
                direction: DVec3::NEG_Z,
                power: Vec3::splat(1e6),
                ..spot(5e-4, 1e-3)
            };
            lit(wall, &[far])
        },
    ),
    DrawnCase::new(
        "cone-of-all-before-it",
        "an outer angle of a right angle and an inner of 0: cosines from 0 to 1",
        "KHR_lights_punctual (spot angles)",
        || lit(floor, &[spot(0.0, FRAC_PI_2)]),
    ),
    DrawnCase::new(
        "cone-at-the-surface",
        "its tip on the surface: no direction in which to be inside or outside",
        "KHR_lights_punctual",
        || {
            let tip = PunctualLight {
                position: DVec3::new(0.0, 0.0, -4.0),
                ..spot(0.2, 0.6)
            };
            lit(wall, &[tip])
        },
    ),
    DrawnCase::new(
        "cone-direction-of-a-million",
        "a direction nearly 1e6 long: of no other length than 1 is its cosine one",
        "glTF 2.0, node scales and KHR_lights_punctual",
        || {
            lit(
                floor,
                &[PunctualLight {
                    direction: LAMP.direction * 9e5,
                    ..spot(0.2, 0.6)
                }],
            )
        },
    ),
    DrawnCase::new(
        "sun-along-the-surface",
        "n · l = 0: light and masking are both nothing, 0 / 0 in their usual form",
        "E. Heitz, Understanding the Masking-Shadowing Function, 2014",
        || lit(floor, &[sun(DVec3::NEG_Z)]),
    ),
    DrawnCase::new(
        "sun-a-hair-above-the-surface",
        "n · l = 1e-4 on a floor that is seen at 1e-4 as well: masking by roots of small squares",
        "E. Heitz, Understanding the Masking-Shadowing Function, 2014",
        || lit(floor, &[sun(DVec3::new(0.0, -1e-4, 1.0))]),
    ),
    DrawnCase::new(
        "sun-straight-against-the-view",
        "light from behind what is seen: l + v is 0, and h has no direction",
        "B. Walter et al., Microfacet Models for Refraction, 2007 (half vectors)",
        || lit(floor, &[sun(DVec3::new(0.0, 0.2, 1.0))]),
    ),
    DrawnCase::new(
        "roughness-none-in-the-highlight",
        "a perfect mirror of a sun: the distribution's peak is 1 / (π α²), its width a texel",
        "Filament, Physically Based Rendering, §4.12.1 (1 - n · h² in f32)",
        || mirror(0.0, 1.0),
    ),
    DrawnCase::new(
        "roughness-least-code",
        "roughness 1/255: α² is 2e-10, below the last digit of 1",
        "Filament, Physically Based Rendering, §4.12.1",
        || mirror(1.0 / 255.0, 0.04),
    ),
    DrawnCase::new(
        "roughness-one-of-a-perfect-mirror",
        "roughness and f0 of 1: nothing is left to scatter",
        "glTF 2.0, appendix B",
        || mirror(1.0, 1.0),
    ),
    DrawnCase::new(
        "mirrored-none",
        "f0 of 0, an index of refraction of 1: what is left is Fresnel's edge",
        "glTF 2.0, KHR_materials_ior (ior 1)",
        || mirror(0.5, 0.0),
    ),
    DrawnCase::new(
        "specular-map-of-no-numbers",
        "NaN, infinite and negative reflectance, as an engine's own G-buffer may hold",
        "NVIDIA, on NaN in G-buffers; WGSL §15.7.2",
        || {
            let paint = |spot: &Spot| Texel {
                specular: match spot.index % 4 {
                    0 => [f32::NAN; 4],
                    1 => [f32::INFINITY; 4],
                    2 => [-3.0, 2.0, 0.5, -1.0],
                    _ => [0.04, 0.04, 0.04, 7.0],
                },
                ..wall(spot)
            };
            Surfaces::painted(Canvas::small().wide(), paint)?
                .lit(&[LAMP])
                .under(1.0, 0.25)
                .staged()
        },
    ),
    DrawnCase::new(
        "surface-normal-zero",
        "a normal of 0 under light: no direction to be lit from",
        "Blender T51979",
        || normal([0.0; 3]),
    ),
    DrawnCase::new(
        "surface-normal-nan",
        "a normal that is none under light from everywhere",
        "WGSL §15.7.2",
        || normal([f32::NAN; 3]),
    ),
    DrawnCase::new(
        "surface-normal-infinite",
        "an infinite normal under light from everywhere",
        "WGSL §15.7.2",
        || normal([f32::INFINITY, 0.0, 0.0]),
    ),
    DrawnCase::new(
        "surface-normal-of-65504",
        "a normal whose length nobody has taken away",
        "Blender T51979",
        || normal([65504.0, 0.0, 65504.0]),
    ),
    DrawnCase::new(
        "surface-normal-across-the-view",
        "n · v = 0 in the middle of the picture, and negative beside it",
        "Filament, Physically Based Rendering, §4.4.2",
        || normal([1.0, 0.0, 0.0]),
    ),
    DrawnCase::new(
        "surface-normal-away-from-the-eye",
        "a normal on the other side of a surface that is seen",
        "Filament, Physically Based Rendering, §4.4.2",
        || normal([0.0, 0.0, -1.0]),
    ),
    DrawnCase::new(
        "surface-without-depth",
        "the colour says that there is a surface, the depth that there is none",
        "Unity SRP, on decals over the sky",
        || depth(0.0),
    ),
    DrawnCase::new(
        "surface-depth-nan",
        "a depth that is none below a surface that is lit",
        "WGSL §15.7.2",
        || depth(f32::NAN),
    ),
    DrawnCase::new(
        "surface-depth-before-the-near-plane",
        "a depth of 2: nearer than anything that is drawn",
        "Vulkan 1.3, §26.5 (depth clamping)",
        || depth(2.0),
    ),
    DrawnCase::new(
        "surface-depth-infinite",
        "an infinite depth: a distance of 0",
        "WGSL §15.7.2",
        || depth(f32::INFINITY),
    ),
    DrawnCase::new(
        "surface-colour-nan",
        "scattered and given light that is none",
        "Godot #80992",
        || colour([f32::NAN, f32::NAN, f32::NAN, 1.0]),
    ),
    DrawnCase::new(
        "surface-colour-infinite",
        "scattered and given light without end: infinite times no light is NaN",
        "IEEE 754 §7.2",
        || colour([f32::INFINITY, f32::INFINITY, f32::INFINITY, 1.0]),
    )
    .overflowing(ADDED),
    DrawnCase::new(
        "surface-colour-negative",
        "scattered and given light below 0",
        "W. Jarosz, on negative filter lobes",
        || colour([-1.0, -100.0, -0.0, 1.0]),
    ),
    DrawnCase::new(
        "surface-colour-of-65504",
        "a surface that scatters more than it gets and gives all there is",
        "Filament #2362",
        || colour([65504.0, 65504.0, 65504.0, 1.0]),
    )
    .overflowing(ADDED),
    DrawnCase::new(
        "surface-alpha-nan",
        "whether there is a surface hangs on a number that is none",
        "IEEE 754 §5.11",
        || colour([0.5, 0.5, 0.5, f32::NAN]),
    ),
    DrawnCase::new(
        "lit-in-standard-depth",
        "positions from 1 - near / distance",
        "N. Reed, Depth Precision Visualized, 2015",
        || {
            let canvas = Canvas::small().range(DepthRange::Standard { far: 100.0 });
            Surfaces::painted(canvas, floor)?.lit(&[LAMP]).staged()
        },
    ),
    DrawnCase::new(
        "lit-in-standard-infinite-depth",
        "positions from 1 - near / distance without a far plane",
        "N. Reed, Depth Precision Visualized, 2015",
        || {
            let canvas = Canvas::small().range(DepthRange::StandardInfinite);
            Surfaces::painted(canvas, floor)?.lit(&[LAMP]).staged()
        },
    ),
    DrawnCase::new(
        "lit-10-km-away",
        "a lamp by a wall 10 km away: the way between them is a difference of numbers of 1e4",
        "Godot #58616",
        || {
            let far = |spot: &Spot| surface(spot, 1e4, [0.0, 0.0, 1.0]);
            let lamp = PunctualLight {
                power: Vec3::splat(1e6),
                ..point(DVec3::new(10.0, 20.0, -9900.0))
            };
            lit(far, &[lamp])
        },
    ),
    DrawnCase::new(
        "lit-10-km-from-the-origin",
        "eye and lamp at 1e4: lights are where the eye sees them, computed in f64",
        "n8ao #54, on positions far from the origin",
        || {
            Surfaces::painted(Canvas::small(), floor)?
                .lit(&[LAMP, spot(0.2, 0.6)])
                .moved(DVec3::new(1e4, -7e3, 1.3e4))
                .staged()
        },
    ),
    DrawnCase::new(
        "lit-picture-of-one-texel",
        "a picture of 1 × 1 under every kind of light",
        "Godot #96758 (sizes of 0 and 1)",
        || {
            Surfaces::painted(Canvas::new((1, 1)), wall)?
                .lit(&[LAMP, spot(0.2, 0.6), sun(DVec3::NEG_Z)])
                .staged()
        },
    ),
    DrawnCase::new(
        "lit-by-many",
        "sixty lights: each layer is rounded to a half float, and so is every sum",
        "N. J. Higham, The Accuracy of Floating Point Summation, 1993",
        || {
            let lamps: Vec<PunctualLight> = (0..60)
                .map(|k| PunctualLight {
                    power: Vec3::splat(0.1),
                    ..point(DVec3::new(f64::from(k) * 0.1 - 3.0, 0.5, -3.0))
                })
                .collect();
            lit(floor, &lamps)
        },
    ),
    DrawnCase::new(
        "around-all-65504",
        "the most light from above and below on a mirror and on white",
        "Filament #2362",
        || {
            let paint = |spot: &Spot| Texel {
                specular: if spot.x.is_multiple_of(2) {
                    [1.0; 4]
                } else {
                    [0.04, 0.04, 0.04, 0.0]
                },
                ..wall(spot).coloured([1.0; 3])
            };
            Surfaces::painted(Canvas::small(), paint)?
                .under(65504.0, 65504.0)
                .staged()
        },
    ),
    DrawnCase::new(
        "around-seen-along-the-surface",
        "a floor to the horizon under a sky: cosines of view from 1 to 1e-4 in the table's first column",
        "B. Karis, Real Shading in Unreal Engine 4, 2013",
        || {
            Surfaces::painted(Canvas::small(), floor)?
                .under(1.0, 0.0)
                .staged()
        },
    ),
    DrawnCase::new(
        "around-one-hot-texel",
        "a sun of one texel in a mirror and in rough surfaces: mips from none to the last",
        "J. Křivánek and M. Colbert, Real-time Shading with Filtered Importance Sampling, 2008",
        || {
            let map = LightMap::painted([64, 32], 32, |x, y| {
                if (x, y) == (0, 12) {
                    [65504.0; 3]
                } else {
                    [0.1; 3]
                }
            })?;
            let paint = |spot: &Spot| Texel {
                specular: [1.0, 1.0, 1.0, spot.uv.x as f32],
                ..wall(spot)
            };
            Surfaces::painted(Canvas::small(), paint)?
                .within(map)
                .staged()
        },
    ),
];
