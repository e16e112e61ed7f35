//! Time between frames, and faults that histories may keep.

use super::paint::{Canvas, Spot, Texel};
use super::{Case, CaseError, Step};

/// Only what has a history, and what contains it.
const HISTORY: &[&str] = &["exposure", "chain"];

const EULER: &str = "bevyengine/bevy auto exposure (explicit Euler overshoots at dt > 0.5 s)";
const POISON: &str = "godotengine/godot#80992, #87136 (NaN kept by reprojection)";

/// The room, so much brighter.
fn lit(canvas: Canvas, factor: f32) -> Result<Step, CaseError> {
    canvas.step(|spot| {
        let room = spot.room();
        let [r, g, b, a] = room.colour;
        Texel {
            colour: [r * factor, g * factor, b * factor, a],
            ..room
        }
    })
}

/// Dark, then bright for two frames, so many seconds apart.
fn brighter(seconds: f32) -> Result<Vec<Step>, CaseError> {
    let canvas = Canvas::new((24, 16)).after(seconds);
    Ok(vec![
        lit(canvas, 0.02)?,
        lit(canvas, 20.0)?,
        lit(canvas, 20.0)?,
    ])
}

/// Bright, then dark for two frames.
fn darker(seconds: f32) -> Result<Vec<Step>, CaseError> {
    let canvas = Canvas::new((24, 16)).after(seconds);
    Ok(vec![
        lit(canvas, 20.0)?,
        lit(canvas, 0.02)?,
        lit(canvas, 0.02)?,
    ])
}

/// The room, with a fault in one of five frames.
fn poisoned(at: usize, fault: fn(&Spot, Texel) -> Texel) -> Result<Vec<Step>, CaseError> {
    let canvas = Canvas::new((24, 16));
    (0..5)
        .map(|number| {
            canvas.step(|spot| {
                let room = spot.room();
                if number == at {
                    fault(spot, room)
                } else {
                    room
                }
            })
        })
        .collect()
}

pub(super) const CASES: &[Case] = &[
    Case::new(
        "time-none-brighter",
        "no time has passed: a lag that divides by it is 0/0",
        EULER,
        || brighter(0.0),
    )
    .on(HISTORY),
    Case::new(
        "time-none-darker",
        "no time has passed while it gets darker: nothing may change",
        EULER,
        || darker(0.0),
    )
    .on(HISTORY),
    Case::new(
        "time-denormal",
        "1e-40 s: k dt is flushed, or underflows in 1 - exp",
        "WGSL §15.7.2; W. Kahan (expm1)",
        || brighter(1e-40),
    )
    .on(HISTORY),
    Case::new(
        "time-a-nanosecond",
        "1 - exp(-3e-9) in f32 is 0 as written: the eye would never adapt",
        "W. Kahan (expm1)",
        || brighter(1e-9),
    )
    .on(HISTORY),
    Case::new(
        "time-a-frame",
        "a sixtieth of a second, three times brighter and darker",
        EULER,
        || brighter(1.0 / 60.0),
    )
    .on(HISTORY),
    Case::new(
        "time-half-a-second",
        "from here on an explicit Euler step overshoots the target",
        EULER,
        || brighter(0.5),
    )
    .on(HISTORY),
    Case::new(
        "time-ten-seconds",
        "a spike: Euler would step thirty times too far, to negative luminance",
        EULER,
        || brighter(10.0),
    )
    .on(HISTORY),
    Case::new(
        "time-ten-seconds-darker",
        "the same towards the dark, where the step has the other speed",
        EULER,
        || darker(10.0),
    )
    .on(HISTORY),
    Case::new(
        "time-eleven-days",
        "1e6 s, the longest allowed: exp underflows and the lag has to arrive",
        EULER,
        || darker(1e6),
    )
    .on(HISTORY),
    Case::new(
        "time-from-black",
        "black, then light: from the darkest luminance adapted to, by 23 stops",
        "bevyengine/bevy#13446, #25798 (all-black frames)",
        || {
            let canvas = Canvas::new((24, 16));
            Ok(vec![
                lit(canvas, 0.0)?,
                lit(canvas, 1000.0)?,
                lit(canvas, 1000.0)?,
            ])
        },
    )
    .on(HISTORY),
    Case::new(
        "time-to-black",
        "light, then black: the average has no logarithm any more",
        "bevyengine/bevy#13446 (NaN into a bin index)",
        || {
            let canvas = Canvas::new((24, 16));
            Ok(vec![
                lit(canvas, 1000.0)?,
                lit(canvas, 0.0)?,
                lit(canvas, 0.0)?,
            ])
        },
    )
    .on(HISTORY),
    Case::new(
        "poison-first-frame-nan",
        "the first frame is all NaN: nothing is known of the scene, and nothing may be kept",
        POISON,
        || {
            poisoned(0, |_, room| Texel {
                colour: [f32::NAN; 4],
                ..room
            })
        },
    )
    .on(HISTORY)
    .recovering(0, 1),
    Case::new(
        "poison-first-frame-infinite",
        "the first frame is all infinite: no average, and none of it kept",
        POISON,
        || {
            poisoned(0, |_, room| Texel {
                colour: [f32::INFINITY; 4],
                ..room
            })
        },
    )
    .on(HISTORY)
    .recovering(0, 1),
    Case::new(
        "poison-later-frame-nan",
        "a frame of NaN after good ones: the history has to outlive it",
        POISON,
        || {
            poisoned(2, |_, room| Texel {
                colour: [f32::NAN; 4],
                ..room
            })
        },
    )
    .on(HISTORY)
    .recovering(2, 1),
    Case::new(
        "poison-later-frame-infinite",
        "a frame of infinities after good ones: a sum of them never comes back",
        POISON,
        || {
            poisoned(2, |_, room| Texel {
                colour: [f32::INFINITY; 4],
                ..room
            })
        },
    )
    .on(HISTORY)
    .recovering(2, 1),
    Case::new(
        "poison-one-texel-nan",
        "one texel of NaN: it may not take the average with it",
        "bevyengine/bevy#25798; godotengine/godot#80992",
        || {
            poisoned(2, |spot, room| {
                if (spot.x, spot.y) == (3, 9) {
                    Texel {
                        colour: [f32::NAN; 4],
                        ..room
                    }
                } else {
                    room
                }
            })
        },
    )
    .on(HISTORY),
    Case::new(
        "poison-depth-and-normal",
        "a frame of NaN in depth and normals: no history may have read them",
        POISON,
        || {
            poisoned(2, |_, room| Texel {
                depth: f32::NAN,
                normal: [f32::NAN; 4],
                velocity: [f32::NAN; 2],
                ..room
            })
        },
    )
    .on(HISTORY),
];
