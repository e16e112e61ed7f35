//! Reflectance and shininess at the ends of their ranges.

use glam::DVec3;

use super::paint::{Canvas, Spot, Texel};
use super::{Case, CaseError, Step};

/// A wall to the left, mirrored to the right by what `specular` says.
fn shining(specular: impl Fn(&Spot) -> [f32; 4]) -> Result<Vec<Step>, CaseError> {
    painted(Canvas::small(), specular)
}

fn painted(canvas: Canvas, specular: impl Fn(&Spot) -> [f32; 4]) -> Result<Vec<Step>, CaseError> {
    canvas.paint(|spot| {
        if spot.uv.x < 0.5 {
            spot.wall(3.9).coloured([6.0, 2.0, 0.5])
        } else {
            Texel {
                specular: specular(spot),
                ..spot.mirror(4.0, DVec3::new(-1.0, 0.1, 0.0))
            }
        }
    })
}

pub(super) const CASES: &[Case] = &[
    Case::new(
        "material-mirror",
        "roughness 0 and f0 1: D is infinite at N·H = 1 for perceptual roughness up to 0.0131",
        "Filament, 4.4.1 (roughness clamped to 0.045; 1 - NH² as |N × H|²)",
        || shining(|_| [1.0, 1.0, 1.0, 1.0]),
    ),
    Case::new(
        "material-rough",
        "roughness 1: the reflection is all blur, and a cone's tangent is 9.95",
        "Unity HDRP and D. Lettier (roughness to mip)",
        || shining(|_| [1.0, 1.0, 1.0, 0.0]),
    ),
    Case::new(
        "material-of-no-reflectance",
        "f0 0: an index of refraction of 1, where the formula for it divides 0 by 0 in box mode",
        "Unity Graphics#3518; KhronosGroup/glTF#2292 (ior 0 is legal)",
        || shining(|_| [0.0, 0.0, 0.0, 1.0]),
    ),
    Case::new(
        "material-rough-of-no-reflectance",
        "nothing is mirrored and all of it is blurred: 0 times a blur that may hold anything",
        "KhronosGroup/glTF#2292",
        || shining(|_| [0.0; 4]),
    ),
    Case::new(
        "material-of-one-code-of-reflectance",
        "f0 1/255: 8 bits decode within ulps of k/255, each device in its own way",
        "Khronos Data Format Specification, 13 (UNORM)",
        || shining(|_| [1.0 / 255.0, 1.0 / 255.0, 1.0 / 255.0, 1.0]),
    ),
    Case::new(
        "material-of-one-code-of-roughness",
        "shininess 254/255: 1 - w cancels to a step that has only the decoding's digits",
        "Khronos Data Format Specification, 13 (UNORM)",
        || shining(|_| [1.0, 1.0, 1.0, 254.0 / 255.0]),
    ),
    Case::new(
        "material-of-every-code",
        "all 256 codes of reflectance and of shininess against each other",
        "Khronos Data Format Specification, 13 (UNORM)",
        || {
            painted(Canvas::new((64, 32)), |spot| {
                let code = (spot.index % 256) as f32 / 255.0;
                [
                    code,
                    1.0 - code,
                    code,
                    ((spot.index / 3) % 256) as f32 / 255.0,
                ]
            })
        },
    ),
    Case::new(
        "material-of-one-channel",
        "red alone is mirrored: the other channels may take nothing from it",
        "PlayCanvas engine#6911 (coloured f0 and index of refraction)",
        || shining(|_| [1.0, 0.0, 0.0, 0.5]),
    ),
    Case::new(
        "material-mirror-and-rough-in-turn",
        "mirror and felt texel by texel: sharp and blurred next to each other, with no ramp",
        "AMD FidelityFX SSSR classifier (tiles by roughness)",
        || {
            shining(|spot| {
                if (spot.x + spot.y) % 2 == 0 {
                    [1.0; 4]
                } else {
                    [1.0, 1.0, 1.0, 0.0]
                }
            })
        },
    ),
    Case::new(
        "material-nan",
        "a map in floats with NaN: 0 mirrored is the only answer that spreads nothing",
        "gpuweb/gpuweb#5192",
        || painted(Canvas::small().wide(), |_| [f32::NAN; 4]),
    ),
    Case::new(
        "material-nan-in-roughness",
        "NaN in shininess alone: sharp and blurred are mixed by it",
        "gpuweb/gpuweb#5192",
        || painted(Canvas::small().wide(), |_| [0.5, 0.5, 0.5, f32::NAN]),
    ),
    Case::new(
        "material-infinite",
        "an infinite reflectance times no reflection is NaN",
        "gpuweb/gpuweb#5192",
        || painted(Canvas::small().wide(), |_| [f32::INFINITY; 4]),
    ),
    Case::new(
        "material-brighter-than-its-light",
        "reflectance 2 and shininess 3: the mix extrapolates and light comes from nowhere",
        "Blender EEVEE (mix(low, high, mip) extrapolates)",
        || painted(Canvas::small().wide(), |_| [2.0, 2.0, 2.0, 3.0]),
    ),
    Case::new(
        "material-negative",
        "negative reflectance and shininess: light is taken away where some should come",
        "godotengine/godot#66462",
        || painted(Canvas::small().wide(), |_| [-1.0, -0.5, -0.0, -1.0]),
    ),
    Case::new(
        "material-denormal",
        "reflectance 1e-40: flushed or not, what it mirrors of 65504 is nothing",
        "WGSL §15.7.2",
        || painted(Canvas::small().wide(), |_| [1e-40, 1e-40, 1e-40, 1.0]),
    ),
];
