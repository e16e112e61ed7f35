//! Pyramids of distances ("hierarchical Z"): over ever larger squares of texels, how far
//! the nearest surface is and how far the farthest.
//!
//! Whoever follows a ray across the screen can pass a whole square of texels at once where
//! the ray stays in front of all that is there, or behind all of it; whoever asks whether
//! something is hidden needs to look at a few texels only, however large it is.
//!
//! # What the levels hold
//! [`Layout`] says where they are; level 0 is the depth image itself and not stored again.
//! Each texel of level k has, in `rg32float`, the *nearest* and the *farthest* distance
//! from the view plane, in view units, over the 2^k × 2^k texels of the image that it
//! covers, as far as they are in it. Distances grow away from the eye whatever the
//! [`DepthRange`](crate::DepthRange): standard and reversed depth give the same pyramid.
//!
//! Texels where there is nothing — a cleared depth, the background, what is no depth the
//! projection can make — do not count. A square that has nothing else holds ([`NOTHING`],
//! 0): a ray is in front of the one and behind the other, so it passes.
//!
//! # Sizes
//! Levels are halved and *rounded up*, so a texel of the image lies in exactly one texel of
//! each level, whose coordinates are its own shifted right by k. Nothing is folded in or
//! left over at an odd edge: the last square reaches over it. Mips of a texture are rounded
//! down and cannot do that, and a device may let a kernel write four of them at a time;
//! the levels therefore lie beside each other in one texture.
//!
//! # Cost
//! One look at each texel of the image, and 8/3 bytes for each. [`Build`] says in how many
//! passes.
//!
//! # Source
//! N. Greene, M. Kass, G. Miller, "Hierarchical Z-Buffer Visibility", SIGGRAPH 1993; Y.
//! Uludag, "Hi-Z Screen-Space Cone-Traced Reflections", GPU Pro 5, 2014; the idea of a
//! single pass is that of AMD's FidelityFX Single Pass Downsampler, 2020.

mod layout;
pub mod truth;

use etalon_core::Format;
use etalon_core::graph::{Graph, Texture};
use etalon_core::resource::{BufferDesc, TextureDesc};
use glam::UVec2;

pub use layout::Layout;

use crate::check::size;
use crate::knob::choices;
use crate::{CameraParams, EffectError};

/// The nearest distance where there is nothing, 2^60: beyond every distance there is.
pub const NOTHING: f32 = (1_u64 << 60) as f32;

/// The level that one workgroup makes one texel of in a single pass.
const TILE_LEVEL: u32 = 6;

/// In how many passes a pyramid is made. The pyramid is the same, bit for bit.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Build {
    /// One for each level, which each wait for the one before, and a texture for each.
    /// The faster way on the two software devices that were measured.
    #[default]
    PerLevel,
    /// One, and a clear of a few bytes before it: for devices on which passes that wait
    /// for each other take longer than one that has barriers.
    SinglePass,
}

choices!(Build {
    PerLevel => "per-level",
    SinglePass => "single-pass",
});

/// A pyramid in a graph.
#[derive(Clone, Copy, Debug)]
pub struct Pyramid {
    /// `rg32float`, with the levels where [`Layout`] says.
    pub texture: Texture,
    /// Where they are.
    pub layout: Layout,
}

/// Makes the pyramid of a depth image.
///
/// `depth` holds device depth in its first channel, as `camera.depth` says.
///
/// # Errors
/// If the camera is out of range, or the graph refuses the image.
pub fn pyramid(
    graph: &mut Graph,
    depth: Texture,
    camera: &CameraParams,
    build: Build,
) -> Result<Pyramid, EffectError> {
    camera.validate()?;
    let layout = Layout::new(size(graph, depth));
    let [width, height] = layout.extent();
    let pyramid = graph.texture(
        "hiz.pyramid",
        TextureDesc::d2(width, height, Format::Rg32Float),
    );
    let texture = match build {
        Build::PerLevel => per_level(graph, depth, camera, layout, pyramid)?,
        Build::SinglePass => single_pass(graph, depth, camera, layout, pyramid)?,
    };
    Ok(Pyramid { texture, layout })
}

fn per_level(
    graph: &mut Graph,
    depth: Texture,
    camera: &CameraParams,
    layout: Layout,
    mut pyramid: Texture,
) -> Result<Texture, EffectError> {
    let mut finer = depth;
    for number in 1..=layout.levels() {
        let [width, height] = layout.level_size(number);
        let level = graph.texture(
            format!("hiz.level {number}"),
            TextureDesc::d2(width, height, Format::Rg32Float),
        );
        let mut pass = graph
            .compute("hiz/level")
            .named(format!("hiz/level {number}"))
            .read("finer", finer)
            .write("level", level)
            .write_part("pyramid", pyramid)
            .set("size", UVec2::from(layout.level_size(0)))
            .set("number", number);
        if number == 1 {
            pass = camera.set(pass).feature("first", true);
        }
        let written = pass.per_texel_of("level")?;
        finer = written.texture("level")?;
        pyramid = written.texture("pyramid")?;
    }
    Ok(pyramid)
}

fn single_pass(
    graph: &mut Graph,
    depth: Texture,
    camera: &CameraParams,
    layout: Layout,
    pyramid: Texture,
) -> Result<Texture, EffectError> {
    // A count, and two words for each texel of the levels that workgroups tell of.
    let words = 1 + 2 * layout.texels_from(TILE_LEVEL);
    let words = graph.buffer("hiz.words", BufferDesc { bytes: 4 * words });
    let words = graph.clear_buffer(words)?;
    let [columns, rows] = layout.level_size(TILE_LEVEL);
    let pass = graph
        .compute("hiz/single")
        .read("depth", depth)
        .write_part("pyramid", pyramid)
        .update_buffer("shared_words", words)
        .set("levels", layout.levels());
    let written = camera.set(pass).groups([columns, rows, 1])?;
    Ok(written.texture("pyramid")?)
}
