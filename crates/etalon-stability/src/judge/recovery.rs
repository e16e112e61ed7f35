//! Is a fault in one frame forgotten?

use etalon_core::format::Encoding;

use super::rounding::BOUND;
use crate::observe::{Place, Store};

/// Where a frame's result is not what it is without the fault in an earlier frame:
/// the first texel further off than rounding, 2⁻¹¹ of its value or one code of 8
/// bits, may make it. The two may differ by rounding since the eye that starts anew
/// is where the other one only arrives at.
#[must_use]
pub fn differs(frame: usize, faulty: &[Store], clean: &[Store]) -> Option<Place> {
    let (faulty, clean) = (faulty.last()?, clean.last()?);
    let (Some(a), Some(b)) = (&faulty.image, &clean.image) else {
        return None;
    };
    let format = a.desc.format;
    let size = format.texel_bytes() as usize;
    let texels = a.bytes.chunks_exact(size).zip(b.bytes.chunks_exact(size));
    for (index, (a, b)) in texels.enumerate() {
        let (a, b) = (format.decode(a).to_f64(), format.decode(b).to_f64());
        for channel in 0..format.channels() as usize {
            let allowed = match format.encoding() {
                Encoding::Unorm | Encoding::UnormSrgb => 1.001 / 255.0,
                _ => BOUND * b[channel].abs(),
            };
            let distance = (a[channel] - b[channel]).abs();
            if distance.is_nan() || distance > allowed {
                return Some(faulty.place(frame, index, channel));
            }
        }
    }
    None
}
