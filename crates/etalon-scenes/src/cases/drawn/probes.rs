//! Rooms that are hard to look up light in.

use etalon_core::Format;
use etalon_effects::probes::{Probe, Room};
use glam::{DQuat, DVec3};

use super::super::paint::{Canvas, Spot, Texel};
use super::{CaseError, DrawnCase, LightMap, Stage, Surfaces};

/// A room around the eye and the wall four metres away.
const ROOM: Probe = Probe {
    position: DVec3::new(0.5, 0.25, -1.0),
    room: Room {
        centre: DVec3::new(0.0, 0.0, -2.0),
        turn: DQuat::IDENTITY,
        half: DVec3::new(4.0, 3.0, 3.0),
    },
    influence: DVec3::new(3.5, 2.75, 2.75),
    falloff: 1.0,
    layer: 0,
};

/// A room of a size around the same place.
fn sized(half: DVec3) -> Probe {
    Probe {
        position: ROOM.room.centre,
        room: Room { half, ..ROOM.room },
        influence: half,
        falloff: half.min_element() as f32,
        ..ROOM
    }
}

/// Walls that mirror, smooth to the left and rough to the right, and a floor below.
fn mirrors(spot: &Spot) -> Texel {
    let below = spot.plane(DVec3::NEG_Y, DVec3::Y).unwrap_or(1e9);
    let (distance, normal) = match below < 4.0 {
        true => (below, [0.0, 1.0, 0.0, 0.0]),
        false => (4.0, [0.0, 0.0, 1.0, 0.0]),
    };
    Texel {
        normal,
        specular: [0.9, 0.8, 0.7, 1.0 - spot.uv.x as f32],
        ..spot.wall(distance).coloured([0.8, 0.4, 0.2])
    }
}

/// A map brighter on one side, black on the other.
fn captured() -> Result<LightMap, CaseError> {
    LightMap::painted([48, 24], 32, |x, y| {
        [
            x as f32 / 12.0,
            y as f32 / 8.0,
            if x < 24 { 0.0 } else { 3.0 },
        ]
    })
}

/// The mirrors among rooms, under a dim sky.
fn among(probes: &[Probe]) -> Result<Stage, CaseError> {
    Surfaces::painted(Canvas::small(), mirrors)?
        .under(0.25, 0.125)
        .around(probes, captured()?)
        .staged()
}

/// The same with the light of a map.
fn of_light(map: LightMap) -> Result<Stage, CaseError> {
    Surfaces::painted(Canvas::small(), mirrors)?
        .under(0.25, 0.125)
        .around(&[ROOM], map)
        .staged()
}

pub(super) const CASES: &[DrawnCase] = &[
    DrawnCase::new(
        "probe-wall-on-the-rooms-side",
        "surfaces exactly on a side of the room: times of 0, and of 0 / 0 along it",
        "S. Lagarde and A. Zanuttini, Local Image-based Lighting with Parallax-corrected Cubemaps, 2012",
        || {
            among(&[Probe {
                room: Room {
                    half: DVec3::new(4.0, 1.0, 2.0),
                    ..ROOM.room
                },
                position: ROOM.room.centre,
                influence: DVec3::splat(6.0),
                ..ROOM
            }])
        },
    ),
    DrawnCase::new(
        "probe-seen-from-outside",
        "a room behind which the surfaces are, and which counts there: every side is behind the ray",
        "Bevy, environment maps (boxes: every t is rejected outside, facing away)",
        || {
            among(&[Probe {
                room: Room {
                    half: DVec3::splat(0.5),
                    ..ROOM.room
                },
                position: ROOM.room.centre,
                influence: DVec3::splat(10.0),
                ..ROOM
            }])
        },
    ),
    DrawnCase::new(
        "probe-off-centre",
        "a room whose map was captured far from its middle: bounds around the capture are other ones",
        "three.js #34006 (wrong bounds where the box is off-centre)",
        || {
            among(&[Probe {
                position: ROOM.room.centre + DVec3::new(3.9, -2.9, 2.9),
                ..ROOM
            }])
        },
    ),
    DrawnCase::new(
        "probe-captured-on-its-wall",
        "a map captured on the very wall that it is looked up on: a direction of no length",
        "S. Lagarde and A. Zanuttini, 2012 (the point of capture has no direction)",
        || {
            among(&[Probe {
                position: ROOM.room.centre + DVec3::new(0.0, 0.0, 3.0),
                ..ROOM
            }])
        },
    ),
    DrawnCase::new(
        "probe-in-a-thin-room",
        "a room two millimetres deep: rays leave it after no way at all",
        "WGSL §15.7.2 (quotients of small numbers)",
        || {
            among(&[Probe {
                influence: DVec3::splat(8.0),
                ..sized(DVec3::new(8.0, 8.0, 1e-3))
            }])
        },
    ),
    DrawnCase::new(
        "probe-in-the-largest-room",
        "walls a thousand kilometres off: no parallax is left but its rounding",
        "ebruneton/precomputed_atmospheric_scattering #21 (metres beside megametres)",
        || among(&[sized(DVec3::splat(1e6))]),
    ),
    DrawnCase::new(
        "probe-far-from-the-origin",
        "everything ten thousand kilometres away: places in f32 have steps of a metre",
        "n8ao #54 (far from the origin)",
        || {
            Surfaces::painted(Canvas::small(), mirrors)?
                .under(0.25, 0.125)
                .around(&[ROOM], captured()?)
                .moved(DVec3::new(1e7, -1e7, 1e7))
                .staged()
        },
    ),
    DrawnCase::new(
        "probe-rays-along-axes",
        "mirrors that send every ray along an axis: two of three quotients are by 0",
        "lettier, screen-space reflection (0 / 0 in the branch that is not taken)",
        || {
            let paint = |spot: &Spot| {
                let out = [DVec3::Z, DVec3::X, DVec3::Y, DVec3::NEG_X][(spot.x % 4) as usize];
                spot.mirror(4.0, out)
            };
            Surfaces::painted(Canvas::small().wide(), paint)?
                .around(&[ROOM], captured()?)
                .staged()
        },
    ),
    DrawnCase::new(
        "probe-turned",
        "a room turned about all axes: no ray is along one of its own",
        "S. Lagarde and A. Zanuttini, 2012 (oriented boxes)",
        || {
            among(&[Probe {
                room: Room {
                    turn: DQuat::from_xyzw(0.5, -0.5, 0.1, 0.7).normalize(),
                    half: DVec3::splat(6.0),
                    ..ROOM.room
                },
                ..ROOM
            }])
        },
    ),
    DrawnCase::new(
        "probes-as-many-as-there-can-be",
        "sixteen rooms, each with a part of what the others leave: shares down to 2^-16",
        "T. Porter and T. Duff, Compositing Digital Images, 1984 (over)",
        || {
            let probe = |k: u32| Probe {
                influence: DVec3::splat(6.0 + 0.25 * f64::from(k)),
                falloff: 6.0,
                ..ROOM
            };
            let probes: Vec<Probe> = (0..16).map(probe).collect();
            among(&probes)
        },
    ),
    DrawnCase::new(
        "probe-ending-on-the-wall",
        "a room that ends to count exactly where the wall is, within a millimetre: 1 beside 0",
        "WGSL §17.5, smoothstep (of a width of 0 it is indeterminate)",
        || {
            among(&[Probe {
                influence: DVec3::new(3.5, 2.75, 2.0),
                falloff: 1e-3,
                ..ROOM
            }])
        },
    ),
    DrawnCase::new(
        "probe-of-all-65504",
        "the most light from every wall, blended with a sky: sums of shares beyond half floats",
        "Filament #2362",
        || of_light(LightMap::uniform([65504.0; 3])?),
    ),
    DrawnCase::new(
        "probe-with-nan-in-its-image",
        "a map that no host has looked at: NaN and infinite texels, in sums of all directions",
        "WGSL §15.7.2 (implementations may assume that there are none)",
        || {
            of_light(LightMap::raw(32, Format::Rgba32Float, |index| {
                match index % 7 {
                    0 => [f32::NAN; 4],
                    2 => [f32::INFINITY; 4],
                    4 => [f32::NEG_INFINITY, -1.0, -0.0, 1.0],
                    _ => [1.0, 0.5, 0.25, 1.0],
                }
            })?)
        },
    ),
];
