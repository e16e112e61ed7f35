//! Running a plan and seeing what each of its passes wrote, as numbers.

use etalon_core::backend::{Backend, BackendError, CapturedData, Inputs};
use etalon_core::image::ImageError;
use etalon_core::plan::Plan;
use etalon_cpu::{CpuBackend, WideCapture};
use etalon_effects::truth::Plane;
use thiserror::Error;

/// Why nothing was seen.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum ObserveError {
    /// The plan cannot be run.
    #[error(transparent)]
    Backend(#[from] BackendError),
    /// What it wrote is no picture.
    #[error("pass `{pass}`, `{binding}`: {source}")]
    Image {
        /// The pass.
        pass: String,
        /// What it wrote.
        binding: String,
        /// Why not.
        source: ImageError,
    },
    /// It did not write what was looked for.
    #[error("no pass `{pass}` wrote a texture `{binding}`")]
    Missing {
        /// The pass.
        pass: &'static str,
        /// What was looked for.
        binding: &'static str,
    },
}

/// What passes wrote.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Observed {
    textures: Vec<(String, String, Plane)>,
}

impl Observed {
    /// What a plan's captures hold.
    ///
    /// # Errors
    /// If the plan cannot be run, or its captures cannot be held.
    pub fn of(
        backend: &mut dyn Backend,
        plan: &Plan,
        inputs: &Inputs<'_>,
    ) -> Result<Self, ObserveError> {
        backend.reset_histories();
        let mut textures = Vec::new();
        for captured in backend.execute(plan, inputs)?.captures {
            if let CapturedData::Texture(image) = &captured.data {
                let plane = Plane::of(image).map_err(|source| ObserveError::Image {
                    pass: captured.pass.clone(),
                    binding: captured.binding.clone(),
                    source,
                })?;
                textures.push((captured.pass, captured.binding, plane));
            }
        }
        Ok(Self { textures })
    }

    /// What a plan's captures hold before they are rounded to their formats, on an
    /// interpreter that computes in more digits.
    ///
    /// # Errors
    /// If the plan cannot be run.
    pub fn exact(
        backend: &mut CpuBackend,
        plan: &Plan,
        inputs: &Inputs<'_>,
    ) -> Result<Self, ObserveError> {
        backend.reset_histories();
        let wide = backend.execute_wide(plan, inputs)?;
        let mut textures = Vec::new();
        for (captured, wide) in wide.execution.captures.into_iter().zip(wide.captures) {
            if let (CapturedData::Texture(image), WideCapture::Texture(texels)) =
                (&captured.data, wide)
            {
                let extent = image.desc.extent;
                let plane = Plane::new(extent.width, extent.height, texels).map_err(|source| {
                    ObserveError::Image {
                        pass: captured.pass.clone(),
                        binding: captured.binding.clone(),
                        source,
                    }
                })?;
                textures.push((captured.pass, captured.binding, plane));
            }
        }
        Ok(Self { textures })
    }

    /// What a pass wrote last to a binding.
    ///
    /// # Errors
    /// If it wrote nothing there.
    pub fn texture(
        &self,
        pass: &'static str,
        binding: &'static str,
    ) -> Result<&Plane, ObserveError> {
        let mut textures = self.textures.iter().rev();
        textures
            .find(|(known, written, _)| known == pass && written == binding)
            .map(|(_, _, plane)| plane)
            .ok_or(ObserveError::Missing { pass, binding })
    }

    /// The effect's result.
    ///
    /// # Errors
    /// If there is no output of that name.
    pub fn result(&self) -> Result<&Plane, ObserveError> {
        self.textures
            .last()
            .map(|(_, _, plane)| plane)
            .ok_or(ObserveError::Missing {
                pass: "output",
                binding: "result",
            })
    }
}
