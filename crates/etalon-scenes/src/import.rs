//! A frame as the effects take it.

use etalon_core::backend::Inputs;
use etalon_core::graph::{Graph, GraphError};
use etalon_effects::{CameraParams, DepthRange, SceneInputs};
use glam::Vec2;

use crate::Frame;

impl Frame {
    /// Imports the frame's images into a graph, each under its name in
    /// [`Frame::IMAGES`]. `delta_time` is the seconds since the frame before.
    ///
    /// # Errors
    /// If the graph has imports of these names already.
    pub fn import(&self, graph: &mut Graph, delta_time: f32) -> Result<SceneInputs, GraphError> {
        Ok(SceneInputs {
            colour: graph.import_texture("colour", self.colour.desc)?,
            depth: graph.import_texture("depth", self.depth.desc)?,
            normal: graph.import_texture("normal", self.normal.desc)?,
            specular: graph.import_texture("specular", self.specular.desc)?,
            velocity: Some(graph.import_texture("velocity", self.velocity.desc)?),
            camera: self.camera_params(),
            delta_time,
            beyond: None,
        })
    }

    /// The frame's projection as effects take it.
    #[must_use]
    pub fn camera_params(&self) -> CameraParams {
        let projection = self.camera.projection;
        CameraParams {
            scale: projection.scale().as_vec2(),
            centre: Vec2::ZERO,
            near: projection.near() as f32,
            depth: DepthRange::ReversedInfinite,
        }
    }

    /// The frame's images under the names that [`import`](Self::import) uses.
    #[must_use]
    pub fn inputs(&self) -> Inputs<'_> {
        let images = self.images().into_iter();
        images.fold(Inputs::new(), |inputs, (name, image)| {
            inputs.texture(name, image)
        })
    }
}
