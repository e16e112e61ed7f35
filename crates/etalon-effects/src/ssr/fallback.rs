//! What reflections show where the screen has no answer.

use etalon_core::graph::ComputePass;

use crate::check::Settings;
use crate::environment::Around;
use crate::{EffectError, SceneInputs};

/// Light from beyond the screen, and the images that say where surfaces are.
#[derive(Clone, Copy)]
pub(super) struct Fallback<'a> {
    around: Around,
    view: glam::DMat4,
    inputs: &'a SceneInputs,
}

impl<'a> Fallback<'a> {
    /// Of a scene that says what is beyond the screen.
    pub(super) fn of(inputs: &'a SceneInputs) -> Result<Option<Self>, EffectError> {
        let Some(beyond) = &inputs.beyond else {
            return Ok(None);
        };
        beyond.surroundings.validate()?;
        let check = Settings("ssr");
        // A rotation's is 1; NaN and infinities fail as well.
        check.range("view", beyond.view.determinant().abs() as f32, 0.5, 2.0)?;
        Ok(Some(Self {
            around: beyond.surroundings.radiant(),
            view: beyond.view,
            inputs,
        }))
    }

    /// For a mix that knows no surfaces yet.
    pub(super) fn with_surfaces<'g>(&self, pass: ComputePass<'g>) -> ComputePass<'g> {
        let pass = self.inputs.camera.set(pass);
        self.set(pass)
            .read("depth", self.inputs.depth)
            .read("normal", self.inputs.normal)
    }

    /// For one that does.
    pub(super) fn set<'g>(&self, pass: ComputePass<'g>) -> ComputePass<'g> {
        self.around.reflect(pass, self.view)
    }
}
