//! Faults on purpose, to show that the comparison finds them and names the
//! right pass.

use std::fmt;
use std::str::FromStr;

use etalon_core::backend::{CapturedData, Execution};
use etalon_core::kernel::KernelLibrary;
use etalon_core::plan::{Plan, Step};
use thiserror::Error;

/// A fault.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Fault {
    /// `constant:KERNEL:FROM:TO`: a piece of a kernel's text is another.
    Constant {
        /// The kernel's path.
        kernel: String,
        /// What is replaced, at its first occurrence.
        from: String,
        /// By what.
        to: String,
    },
    /// `swap:PASS:A:B`: two bindings of a pass are given each other's resource.
    Swap {
        /// The pass.
        pass: String,
        /// One binding.
        a: String,
        /// The other.
        b: String,
    },
    /// `texel:PASS:BINDING`: the lowest bit of the texel in the middle of what
    /// a pass wrote is wrong.
    Texel {
        /// The pass.
        pass: String,
        /// The binding.
        binding: String,
    },
    /// `crash`: the process ends without a word.
    Crash,
}

impl fmt::Display for Fault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Constant { kernel, from, to } => write!(f, "constant:{kernel}:{from}:{to}"),
            Self::Swap { pass, a, b } => write!(f, "swap:{pass}:{a}:{b}"),
            Self::Texel { pass, binding } => write!(f, "texel:{pass}:{binding}"),
            Self::Crash => f.write_str("crash"),
        }
    }
}

/// A fault that cannot be planted.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error("the fault `{fault}` cannot be planted: {reason}")]
pub struct PlantError {
    fault: String,
    reason: String,
}

impl FromStr for Fault {
    type Err = PlantError;

    fn from_str(text: &str) -> Result<Self, PlantError> {
        let words: Vec<String> = text.split(':').map(str::to_owned).collect();
        match words.as_slice() {
            [kind, kernel, from, to] if kind == "constant" => {
                Ok(Self::Constant { kernel: kernel.clone(), from: from.clone(), to: to.clone() })
            }
            [kind, pass, a, b] if kind == "swap" => {
                Ok(Self::Swap { pass: pass.clone(), a: a.clone(), b: b.clone() })
            }
            [kind, pass, binding] if kind == "texel" => {
                Ok(Self::Texel { pass: pass.clone(), binding: binding.clone() })
            }
            [kind] if kind == "crash" => Ok(Self::Crash),
            _ => Err(PlantError {
                fault: text.to_owned(),
                reason: "it is none of constant:KERNEL:FROM:TO, swap:PASS:A:B, texel:PASS:BINDING, crash".to_owned(),
            }),
        }
    }
}

impl Fault {
    fn error(&self, reason: impl Into<String>) -> PlantError {
        PlantError {
            fault: self.to_string(),
            reason: reason.into(),
        }
    }

    /// Plants the faults that lie in a kernel's text.
    ///
    /// # Errors
    /// If the kernel or the text is not there.
    pub fn in_kernels(&self, kernels: &mut KernelLibrary) -> Result<(), PlantError> {
        let Self::Constant { kernel, from, to } = self else {
            return Ok(());
        };
        let source = kernels
            .source(kernel)
            .ok_or_else(|| self.error("there is no such kernel"))?;
        if from.is_empty() || !source.contains(from.as_str()) {
            return Err(self.error(format!("`{from}` is not in the kernel")));
        }
        kernels.add_source(kernel, &source.replacen(from.as_str(), to, 1));
        Ok(())
    }

    /// Plants the faults that lie in what a pass is given.
    ///
    /// # Errors
    /// If the pass or a binding is not there.
    pub fn in_plan(&self, plan: &mut Plan) -> Result<(), PlantError> {
        let Self::Swap { pass, a, b } = self else {
            return Ok(());
        };
        let step = plan.steps.iter_mut().find(|step| step.name == *pass);
        let step = step.ok_or_else(|| self.error("there is no such pass"))?;
        let Step::Dispatch {
            kernel, bindings, ..
        } = &mut step.step
        else {
            return Err(self.error("the pass runs no kernel"));
        };
        let place = |name: &str| {
            kernel
                .0
                .bindings
                .iter()
                .position(|binding| binding.name == name)
        };
        match (place(a), place(b)) {
            (Some(a), Some(b)) if a.max(b) < bindings.len() => {
                bindings.swap(a, b);
                Ok(())
            }
            _ => Err(self.error("the kernel has no such bindings")),
        }
    }

    /// Plants the faults that lie in what was captured.
    ///
    /// # Errors
    /// If the capture is not there.
    pub fn in_captures(&self, execution: &mut Execution) -> Result<(), PlantError> {
        let Self::Texel { pass, binding } = self else {
            return Ok(());
        };
        let captured = execution
            .captures
            .iter_mut()
            .find(|captured| captured.pass == *pass && captured.binding == *binding);
        let captured = captured.ok_or_else(|| self.error("nothing of that name was captured"))?;
        let (bytes, size) = match &mut captured.data {
            CapturedData::Texture(image) => {
                let size = image.desc.format.texel_bytes() as usize;
                (&mut image.bytes, size)
            }
            CapturedData::Buffer(bytes) => (bytes, 4),
        };
        let middle = bytes.len() / size / 2 * size;
        let byte = bytes
            .get_mut(middle)
            .ok_or_else(|| self.error("the capture is empty"))?;
        *byte ^= 1;
        Ok(())
    }

    /// Ends the process as a crash would, if that is the fault.
    pub fn at_the_start(&self) {
        if *self == Self::Crash {
            eprintln!("crashing on purpose");
            std::process::abort();
        }
    }
}

#[cfg(test)]
mod tests {
    use etalon_core::Format;
    use etalon_core::backend::Captured;
    use etalon_core::image::ImageData;
    use etalon_core::resource::TextureDesc;

    use super::*;

    #[test]
    fn faults_are_read_as_they_are_written() {
        for text in [
            "constant:bloom/threshold:0.5:0.25",
            "swap:ssr/mix:colour:reflection",
            "texel:a#2:b",
            "crash",
        ] {
            assert_eq!(text.parse::<Fault>().unwrap().to_string(), text);
        }
        for text in [
            "",
            "constant:a",
            "swap:a:b",
            "texel:a",
            "crash:now",
            "explode",
        ] {
            let error = text.parse::<Fault>().unwrap_err();
            assert!(error.to_string().contains("it is none of"), "{error}");
        }
    }

    #[test]
    fn a_kernel_that_is_not_there_or_lacks_the_text_is_refused() {
        let mut kernels = etalon::effects::kernels();
        kernels.add_source("test/kernel", "const A = 0.5;");
        let fault: Fault = "constant:test/kernel:0.5:0.25".parse().unwrap();
        fault.in_kernels(&mut kernels).unwrap();
        assert_eq!(kernels.source("test/kernel").unwrap(), "const A = 0.25;");
        assert!(
            fault
                .in_kernels(&mut kernels)
                .unwrap_err()
                .to_string()
                .contains("`0.5` is not in the kernel")
        );
        let fault: Fault = "constant:test/none:0.5:0.25".parse().unwrap();
        assert!(
            fault
                .in_kernels(&mut kernels)
                .unwrap_err()
                .to_string()
                .contains("no such kernel")
        );
    }

    #[test]
    fn one_bit_of_the_middle_texel_is_flipped() {
        let image = ImageData::zeroed(TextureDesc::d2(4, 2, Format::Rg16Float)).unwrap();
        let captured = Captured {
            pass: "p".into(),
            binding: "b".into(),
            resource: "r".into(),
            data: CapturedData::Texture(image),
        };
        let mut execution = Execution {
            captures: vec![captured],
            times: Vec::new(),
        };
        "texel:p:b"
            .parse::<Fault>()
            .unwrap()
            .in_captures(&mut execution)
            .unwrap();
        let image = execution.texture("p", "b").unwrap();
        let changed: Vec<_> = image
            .bytes
            .iter()
            .enumerate()
            .filter(|(_, byte)| **byte != 0)
            .collect();
        assert_eq!(changed, [(16, &1)]);
        assert!(
            "texel:p:c"
                .parse::<Fault>()
                .unwrap()
                .in_captures(&mut execution)
                .is_err()
        );
    }
}
