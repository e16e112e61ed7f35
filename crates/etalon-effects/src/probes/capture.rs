//! Drawing the light around a point: six views of 90°.
//!
//! [`views`] are who looks, [`faces`] draws what they see with
//! [`forward`](mod@crate::forward) shading, [`of_faces`] makes a map of that, and
//! [`probe_map`](super::probe_map) a layer of a probe's maps.

use etalon_core::Format;
use etalon_core::graph::{Graph, Texture};
use etalon_core::resource::TextureDesc;
use glam::{DMat3, DMat4, DVec2, DVec3, Vec2};

use crate::check::Settings;
use crate::environment::{
    FACES, MAX_FACE, Mirrored, Prefilter, Surroundings, check_side, face_direction, mirroring,
    of_faces,
};
use crate::forward::{Lamps, Lighting, forward_into};
use crate::geometry::{Geometry, Item, View};
use crate::knob::{Tunable, knobs};
use crate::{CameraParams, DepthRange, EffectError, SettingError};

/// How finely light around a point is captured.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Capture {
    /// Texels of a face's side, in `[16, 4096]`. The cost is six pictures of that size.
    pub face: u32,
    /// Texels of the map's height, a power of two in `[32, 2048]`: see
    /// [`EnvironmentMap`](crate::environment::EnvironmentMap). Those of the maps it
    /// becomes a layer of.
    pub side: u32,
    /// Directions for each texel of the blurred map: see
    /// [`Prefilter::samples`].
    pub samples: u32,
}

knobs!(Capture, "probes" {
    count face [16, 4096] "texels", Accuracy [32, 64, 128, 256, 512], "side of a captured face";
    count side [32, 2048] "texels", Accuracy [32, 64, 128, 256], "height of the map, a power of two";
    count samples [16, 1024] "directions", Accuracy [16, 64, 256, 1024], "directions for each texel, a power of two";
});

impl Default for Capture {
    /// Faces of 128 texels, a map of as many, 64 directions.
    fn default() -> Self {
        Self {
            face: 128,
            side: 128,
            samples: 64,
        }
    }
}

impl Capture {
    /// Checks every number against its range.
    ///
    /// # Errors
    /// The first outside of it.
    pub fn validate(&self) -> Result<(), SettingError> {
        self.check_knobs()?;
        check_side(self.side)?;
        self.prefilter().validate()
    }

    /// How the map is blurred.
    #[must_use]
    pub const fn prefilter(&self) -> Prefilter {
        Prefilter {
            samples: self.samples,
        }
    }
}

/// What is captured.
#[derive(Clone, Copy, Debug)]
pub struct Captured<'a> {
    /// What is opaque, in any order. Glass is not captured.
    pub items: &'a [Item],
    /// From where, in the world.
    pub position: DVec3,
    /// Nothing nearer is seen, in `[1e-6, 1e6]`: less than what the position is away
    /// from any surface.
    pub near: f32,
    /// The lights, [packed](crate::forward::lamp_bytes) for each of the [`views`].
    pub lamps: [Option<Lamps>; FACES as usize],
    /// Light from everywhere and what is behind everything. Its probes light nothing
    /// here, as their list is of another view: light that was captured is mirrored once.
    pub surroundings: Surroundings,
}

/// Who looks from a point at each face of a cube, in the order of
/// [`of_faces`].
#[must_use]
pub fn views(position: DVec3, near: f32) -> [View; FACES as usize] {
    std::array::from_fn(|face| {
        let ahead = face_direction(face as u32, DVec2::ZERO);
        let up = face_direction(face as u32, DVec2::NEG_Y) - ahead;
        let axes = DMat3::from_cols(ahead.cross(up), up, -ahead);
        let view = DMat4::from_mat3(axes.transpose()) * DMat4::from_translation(-position);
        View {
            camera: CameraParams {
                scale: Vec2::ONE,
                centre: Vec2::ZERO,
                near,
                depth: DepthRange::ReversedInfinite,
            },
            view,
            previous: view,
        }
    })
}

/// Draws what is seen from a point: `rgba16float` in six layers of `face × face` texels.
///
/// # Errors
/// If a number is out of its range, or the graph refuses a pass.
pub fn faces(
    graph: &mut Graph,
    captured: &Captured<'_>,
    face: u32,
) -> Result<Texture, EffectError> {
    Settings("probes").count("face", face, 16, MAX_FACE)?;
    let mut desc = TextureDesc::d2(face, face, Format::Rgba16Float);
    desc.extent.depth_or_layers = FACES;
    let mut faces = graph.texture("captured faces", desc);
    let mut surroundings = Surroundings {
        probes: None,
        mirrored: Mirrored::Lit,
        ..captured.surroundings
    };
    if surroundings.shine() && surroundings.mirroring.is_none() {
        // Once for all of them.
        surroundings.mirroring = Some(mirroring(graph)?);
    }
    let all = views(captured.position, captured.near);
    for ((layer, view), lamps) in (0..).zip(all).zip(captured.lamps) {
        let geometry = Geometry {
            items: captured.items,
            view,
            size: [face; 2],
        };
        let lighting = Lighting {
            lamps,
            surroundings,
        };
        faces = forward_into(graph, &geometry, &lighting, faces.layer(layer))?;
    }
    Ok(faces)
}

/// Draws what is seen from a point and makes a map of it, as
/// [`probe_map`](super::probe_map) takes it.
///
/// # Errors
/// As [`faces`].
pub fn capture(
    graph: &mut Graph,
    captured: &Captured<'_>,
    settings: &Capture,
) -> Result<Texture, EffectError> {
    settings.validate()?;
    let faces = faces(graph, captured, settings.face)?;
    of_faces(graph, faces, settings.side)
}
