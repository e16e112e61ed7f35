//! What is hard to light as it is drawn, and glass.

use glam::{DMat4, DVec3, Vec3, Vec4};

use super::lighting::{LAMP, point, spot, sun};
use super::solids::{Solid, Solids};
use super::{CaseError, DrawnCase, LightMap, Stage};

/// Solids under a lamp and a sky.
fn lit(solids: Vec<Solid>) -> Result<Stage, CaseError> {
    Solids::new(solids)?.lit(&[LAMP]).under(1.0, 0.25).staged()
}

fn wall() -> Solid {
    Solid::wall(4.0, 2.0)
}

/// A pane before the wall.
fn pane(opacity: f32) -> Solid {
    Solid::wall(3.0, 1.0).glass(opacity)
}

fn at(x: f64, y: f64, z: f64) -> DMat4 {
    DMat4::from_translation(DVec3::new(x, y, z))
}

/// Light over light in a target.
const OVER: &str =
    "the target blends light of up to 65504 over light; what reads it takes infinity for 65504";

pub(super) const CASES: &[DrawnCase] = &[
    DrawnCase::new(
        "drawn-lamp-on-the-surface",
        "a fragment at a lamp's place: a way of no length, interpolated",
        "UE-216276 (rsqrt of 0)",
        || {
            Solids::new(vec![wall()])?
                .lit(&[point(DVec3::new(0.0, 0.0, -4.0))])
                .staged()
        },
    ),
    DrawnCase::new(
        "drawn-lamps-of-most-power",
        "three lamps of 1e6 a metre off: each more than half floats hold",
        "Filament #2362",
        || {
            let bright = point(DVec3::new(0.0, 0.0, -3.0));
            let bright = etalon_effects::lighting::PunctualLight {
                power: Vec3::splat(1e6),
                ..bright
            };
            Solids::new(vec![wall()])?.lit(&[bright; 3]).staged()
        },
    ),
    DrawnCase::new(
        "drawn-in-a-thin-cone",
        "the cosines of a milliradian once more, of a lamp from a buffer",
        "KHR_lights_punctual (spot angles); W. Kahan, on 1 - cos x",
        || {
            let far = etalon_effects::lighting::PunctualLight {
                position: DVec3::new(0.0, 0.0, 1996.0),
                direction: DVec3::NEG_Z,
                power: Vec3::splat(1e6),
                ..spot(5e-4, 1e-3)
            };
            Solids::new(vec![wall()])?.lit(&[far]).staged()
        },
    ),
    DrawnCase::new(
        "drawn-around-the-eye",
        "a lit floor across the near plane: places interpolated over w that changes by 1e3",
        "J. F. Blinn, Hyperbolic Interpolation, 1992",
        || {
            let far = 50.0;
            let floor = [[-far, -1.0, far], [far, -1.0, far], [0.0, -1.0, -far]];
            lit(vec![Solid::new(&[floor]).normal([0.0, 1.0, 0.0])])
        },
    ),
    DrawnCase::new(
        "drawn-normal-zero",
        "a vertex normal of 0 that is lit at once",
        "Bevy #10905",
        || lit(vec![wall().normal([0.0; 3])]),
    ),
    DrawnCase::new(
        "drawn-normal-nan",
        "a vertex normal that is none, lit at once",
        "glTF validator, ACCESSOR_INVALID_FLOAT",
        || lit(vec![wall().normal([f32::NAN; 3])]),
    ),
    DrawnCase::new(
        "drawn-normal-across-the-view",
        "normals at a right angle to the view, mirrored to where nothing is",
        "Filament, Physically Based Rendering, §4.4.2",
        || lit(vec![wall().normal([1.0, 0.0, 0.0])]),
    ),
    DrawnCase::new(
        "drawn-corner-nan",
        "a corner that is none beside good ones, with its place handed to fragments",
        "IEEE 754 §5.11",
        || {
            let bad = Solid::new(&[[[f32::NAN, 0.5, -3.0], [0.5, -1.0, -3.0], [2.0, 1.0, -3.0]]]);
            lit(vec![wall(), bad])
        },
    ),
    DrawnCase::new(
        "drawn-mirror-of-no-roughness",
        "a perfect mirror that shows a sun and a sky",
        "Filament, Physically Based Rendering, §4.12.1",
        || {
            let mirror = wall().made_of(|surface| {
                surface.base = Vec4::ONE;
                surface.metalness = 1.0;
                surface.roughness = 0.0;
            });
            Solids::new(vec![mirror])?
                .lit(&[sun(DVec3::new(0.1, 0.05, -1.0))])
                .under(1.0, 0.25)
                .staged()
        },
    ),
    DrawnCase::new(
        "drawn-rough-and-black",
        "nothing scattered, nothing mirrored, roughness 1",
        "glTF 2.0, appendix B",
        || {
            lit(vec![wall().made_of(|surface| {
                surface.base = Vec4::new(0.0, 0.0, 0.0, 1.0);
                surface.mirrored = 0.0;
                surface.roughness = 1.0;
            })])
        },
    ),
    DrawnCase::new(
        "drawn-10-km-from-the-origin",
        "eye, walls and lamps at 1e4, light from a map that is nowhere",
        "n8ao #54, on positions far from the origin",
        || {
            let map = LightMap::painted([16, 8], 32, |x, y| [x as f32, y as f32, 1.0])?;
            Solids::new(vec![wall(), pane(0.5)])?
                .lit(&[LAMP, spot(0.2, 0.6)])
                .within(map)
                .moved(DVec3::new(1e4, -7e3, 1.3e4))
                .staged()
        },
    ),
    DrawnCase::new(
        "drawn-under-a-map-of-65504",
        "all the light there is from everywhere, and light that a surface gives as well",
        "Filament #2362",
        || {
            let map = LightMap::uniform([65504.0; 3])?;
            let white = wall().made_of(|surface| {
                surface.base = Vec4::ONE;
                surface.emission = Vec3::splat(65504.0);
            });
            Solids::new(vec![white])?.within(map).staged()
        },
    ),
    DrawnCase::new(
        "drawn-by-a-thousand-lamps",
        "as many lamps as a list may hold: a thousand terms in one sum",
        "N. J. Higham, The Accuracy of Floating Point Summation, 1993",
        || {
            let lamps: Vec<_> = (0..1024)
                .map(|k| etalon_effects::lighting::PunctualLight {
                    power: Vec3::splat(0.01),
                    ..point(DVec3::new(
                        f64::from(k % 32) * 0.1 - 1.6,
                        f64::from(k / 32) * 0.1 - 1.6,
                        -3.0,
                    ))
                })
                .collect();
            Solids::new(vec![wall()])?.lit(&lamps).staged()
        },
    ),
    DrawnCase::new(
        "glass-of-no-opacity",
        "nothing scattered, and all of what is mirrored",
        "T. Porter and T. Duff, Compositing Digital Images, 1984",
        || lit(vec![wall(), pane(0.0)]),
    ),
    DrawnCase::new(
        "glass-of-all-opacity",
        "1 - (1 - opacity) (1 - mirrored) is 1, and nothing is left of what is behind",
        "T. Porter and T. Duff, Compositing Digital Images, 1984",
        || lit(vec![wall(), pane(1.0)]),
    ),
    DrawnCase::new(
        "glass-that-mirrors-all",
        "f0 of 1: nothing passes, whatever the opacity",
        "glTF 2.0, KHR_materials_ior (ior 0)",
        || {
            lit(vec![
                wall(),
                pane(0.2).made_of(|surface| surface.mirrored = 1.0),
            ])
        },
    ),
    DrawnCase::new(
        "glass-that-mirrors-nothing",
        "f0 of 0, an index of refraction of 1: a pane that is seen from the side alone",
        "Unity SRP #3518 (ior 1)",
        || {
            lit(vec![
                wall(),
                pane(0.0).made_of(|surface| surface.mirrored = 0.0),
            ])
        },
    ),
    DrawnCase::new(
        "glass-seen-edge-on",
        "a pane whose plane contains the eye, from both sides",
        "T. Akenine-Möller et al., Real-Time Rendering, 4th ed., §23.1",
        || {
            let edge = Solid::new(&[[[0.0, -1.0, -2.0], [0.0, -1.0, -3.5], [0.0, 1.0, -3.0]]])
                .normal([1.0, 0.0, 0.0])
                .glass(0.5);
            lit(vec![wall(), edge])
        },
    ),
    DrawnCase::new(
        "glass-across-the-near-plane",
        "a pane through the eye's own plane, blended where it is cut",
        "J. F. Blinn and M. E. Newell, Clipping Using Homogeneous Coordinates, 1978",
        || {
            let through = Solid::new(&[[[-0.3, -0.5, 1.0], [1.5, -0.5, -3.0], [0.2, 1.0, -3.0]]])
                .normal([-0.6, 0.0, 0.8])
                .glass(0.5);
            lit(vec![wall(), through])
        },
    ),
    DrawnCase::new(
        "glass-in-the-plane-of-a-wall",
        "the same depth as what is behind it: drawn or not, and not in between",
        "Vulkan 1.3, appendix on invariance",
        || lit(vec![wall(), Solid::wall(4.0, 1.0).glass(0.5)]),
    ),
    DrawnCase::new(
        "glass-before-the-brightest-light",
        "a pane that mirrors 65504 over 65504 behind it: their sum is infinite",
        "Wicked Engine #1667 (sums of half floats)",
        || {
            let glowing = wall().made_of(|surface| surface.emission = Vec3::splat(65504.0));
            let bright = pane(0.5).made_of(|surface| surface.emission = Vec3::splat(65504.0));
            Solids::new(vec![glowing, bright])?
                .under(65504.0, 65504.0)
                .staged()
        },
    )
    .overflowing(OVER),
    DrawnCase::new(
        "glass-in-many-layers",
        "sixteen panes, one before the other: each rounds what is behind it once more",
        "T. Porter and T. Duff, Compositing Digital Images, 1984",
        || {
            let mut solids = vec![wall()];
            solids.extend((0..16).map(|k| {
                Solid::wall(3.5, 1.0)
                    .glass(0.1)
                    .placed(at(0.0, 0.0, 0.15 * f64::from(k)))
            }));
            lit(solids)
        },
    ),
    DrawnCase::new(
        "glass-alone-before-nothing",
        "glass over the background: a depth of nothing behind it",
        "A. Courrèges, Doom (2016) Graphics Study",
        || Solids::new(vec![pane(0.5)])?.lit(&[LAMP]).staged(),
    ),
];
