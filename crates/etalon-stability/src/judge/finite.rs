//! Is everything a number?

use etalon_core::Format;
use serde::{Deserialize, Serialize};

use crate::observe::{Place, Store};

/// Channels that hold an infinity or NaN.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct NonFinite {
    /// How many.
    pub channels: u64,
    /// The first, in the order of the passes.
    pub first: Place,
}

/// Looks through what a frame's passes wrote, and adds what is no number to `found`.
/// `overflows` if light in 16-bit floats may be infinite: a target that adds layers up
/// asks nobody.
pub fn look(frame: usize, stores: &[Store], overflows: bool, found: &mut Option<NonFinite>) {
    for store in stores {
        let mut report = |index: usize, channel: usize| {
            found
                .get_or_insert_with(|| NonFinite {
                    channels: 0,
                    first: store.place(frame, index, channel),
                })
                .channels += 1;
        };
        if let Some(image) = &store.image {
            let format = image.desc.format;
            let texels = image.bytes.chunks_exact(format.texel_bytes() as usize);
            for (index, texel) in texels.enumerate() {
                let codes = format.codes(texel);
                for channel in 0..format.channels() as usize {
                    let infinite = || format.decode(texel).to_f64()[channel] == f64::INFINITY;
                    if overflows && format == Format::Rgba16Float && infinite() {
                        continue;
                    }
                    if format.is_non_finite(channel, codes.channels[channel]) {
                        report(index, channel);
                    }
                }
            }
            // Formats that clamp would hide it.
            for (index, texel) in store.wide.iter().flatten().enumerate() {
                for (channel, value) in texel.iter().enumerate() {
                    if !(value.is_finite() || overflows && *value == f64::INFINITY)
                        && channel < format.channels() as usize
                    {
                        report(index, channel);
                    }
                }
            }
        }
    }
}
