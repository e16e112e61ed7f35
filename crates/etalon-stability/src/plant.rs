//! Faults planted into results, to see that they are found.

use std::fmt;
use std::str::FromStr;

use etalon_core::format::SampleKind;
use etalon_core::texel::Texel;

use crate::executors::Kind;
use crate::observe::Store;

/// What is done to a frame's results.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fault {
    /// A texel of the first pass that stores floats becomes NaN.
    Nan,
    /// A bit of a texel of the last pass is turned.
    Bit,
    /// The first texel of the first pass that stores no integers is off by a hundredth,
    /// and its shadow is not.
    Error,
}

/// A fault for an executor.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Plant {
    /// Whose results.
    pub executor: Kind,
    /// What is done to them.
    pub fault: Fault,
}

impl FromStr for Plant {
    type Err = String;

    /// `EXECUTOR:FAULT`.
    fn from_str(text: &str) -> Result<Self, String> {
        let (executor, fault) = text
            .split_once(':')
            .ok_or_else(|| format!("`{text}` is no fault like wgpu:nan"))?;
        Ok(Self {
            executor: executor.parse()?,
            fault: match fault {
                "nan" => Fault::Nan,
                "bit" => Fault::Bit,
                "error" => Fault::Error,
                _ => {
                    return Err(format!(
                        "there is no fault `{fault}`; there are nan, bit, error"
                    ));
                }
            },
        })
    }
}

impl fmt::Display for Plant {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let fault = match self.fault {
            Fault::Nan => "nan",
            Fault::Bit => "bit",
            Fault::Error => "error",
        };
        write!(f, "{}:{fault}", self.executor)
    }
}

impl Fault {
    /// Does it to a frame's results.
    pub fn strike(self, stores: &mut [Store]) {
        match self {
            Self::Nan => {
                let images = stores.iter_mut().filter_map(|store| store.image.as_mut());
                for image in images {
                    let format = image.desc.format;
                    let size = format.texel_bytes() as usize;
                    let Some(bytes) = image.bytes.get_mut(..size) else {
                        continue;
                    };
                    format.encode(Texel::Float([f32::NAN; 4]), bytes);
                    if format.is_non_finite(0, format.codes(bytes).channels[0]) {
                        return;
                    }
                }
            }
            Self::Bit => {
                let last = stores
                    .iter_mut()
                    .rev()
                    .find_map(|store| store.image.as_mut());
                if let Some(byte) = last.and_then(|image| image.bytes.first_mut()) {
                    *byte ^= 1;
                }
            }
            Self::Error => {
                let mut images = stores.iter_mut().filter_map(|store| store.image.as_mut());
                let integers = [SampleKind::Uint, SampleKind::Sint];
                let first =
                    images.find(|image| !integers.contains(&image.desc.format.sample_kind()));
                let Some(image) = first else { return };
                let format = image.desc.format;
                let size = format.texel_bytes() as usize;
                if let Some(bytes) = image.bytes.get_mut(..size) {
                    let mut texel = format.decode(bytes).to_f32();
                    texel[0] = texel[0] * 1.01 + 0.01;
                    format.encode(Texel::Float(texel), bytes);
                }
            }
        }
    }
}
