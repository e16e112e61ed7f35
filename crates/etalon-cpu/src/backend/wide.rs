//! Results in `f64`.

use etalon_core::backend::Execution;

/// A captured resource in `f64`.
#[derive(Clone, Debug, PartialEq)]
pub enum WideCapture {
    /// The channels of the texels, in the order of the image's; channels that
    /// the format has not are 0, 0, 1.
    Texture(Vec<[f64; 4]>),
    /// For each word what it was last written as, if that was a floating-point
    /// number.
    Buffer(Vec<Option<f64>>),
    /// A texture of integers.
    None,
}

/// The result of running a plan in a wider number type.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct WideExecution {
    /// What other backends give as well.
    pub execution: Execution,
    /// One for each of the execution's captures.
    pub captures: Vec<WideCapture>,
}

impl WideExecution {
    /// The texture captured as this output.
    #[must_use]
    pub fn output(&self, name: &str) -> Option<&[[f64; 4]]> {
        self.texture("output", name)
    }

    /// The texture captured from this pass's binding.
    #[must_use]
    pub fn texture(&self, pass: &str, binding: &str) -> Option<&[[f64; 4]]> {
        let captured = self.execution.captures.iter().zip(&self.captures);
        captured
            .filter(|(captured, _)| captured.pass == pass && captured.binding == binding)
            .find_map(|(_, wide)| match wide {
                WideCapture::Texture(texels) => Some(texels.as_slice()),
                WideCapture::Buffer(_) | WideCapture::None => None,
            })
    }
}
