//! Are they the same bits?
//!
//! Strict arithmetic admits one result (decision 2), so nothing is tolerated but
//! what WGSL leaves open of subnormal numbers in `f32` (§15.7.2), and the payloads
//! of NaNs.

use serde::{Deserialize, Serialize};

use crate::observe::{Place, Store};

/// Where two executors differ.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Difference {
    /// Texels that do, of all passes.
    pub texels: u64,
    /// The first, in the order of the passes: the others may follow from it.
    pub first: Place,
    /// Units of the last place of the format between the two there; as large as
    /// possible for a number against none.
    pub ulps: u64,
    /// What the interpreter has there.
    #[serde(with = "crate::number")]
    pub reference: f64,
    /// What the device has there.
    #[serde(with = "crate::number")]
    pub subject: f64,
}

/// Compares what a frame's passes wrote on two executors, and adds what differs to
/// `found`.
pub fn compare(
    frame: usize,
    reference: &[Store],
    subject: &[Store],
    found: &mut Option<Difference>,
) {
    if reference.len() != subject.len() {
        let add = found.get_or_insert_with(Difference::default);
        add.texels += 1;
        add.ulps = u64::MAX;
        return;
    }
    for (reference, subject) in reference.iter().zip(subject) {
        let (Some(a), Some(b)) = (&reference.image, &subject.image) else {
            if reference.buffer != subject.buffer {
                count(found, || Difference {
                    first: reference.place(frame, 0, 0),
                    ulps: u64::MAX,
                    ..Difference::default()
                });
            }
            continue;
        };
        if a.desc != b.desc || a.bytes.len() != b.bytes.len() || !reference.same_as(subject) {
            count(found, || Difference {
                first: reference.place(frame, 0, 0),
                ulps: u64::MAX,
                ..Difference::default()
            });
            continue;
        }
        let format = a.desc.format;
        let size = format.texel_bytes() as usize;
        let texels = a.bytes.chunks_exact(size).zip(b.bytes.chunks_exact(size));
        for (index, (a, b)) in texels.enumerate() {
            if a == b {
                continue;
            }
            let ulps = format.ulps(format.codes(a), format.codes(b));
            let Some((channel, &distance)) = ulps.iter().enumerate().max_by_key(|(_, ulps)| **ulps)
            else {
                continue;
            };
            if distance > 0 {
                count(found, || Difference {
                    texels: 0,
                    first: reference.place(frame, index, channel),
                    ulps: distance,
                    reference: format.decode(a).to_f64()[channel],
                    subject: format.decode(b).to_f64()[channel],
                });
            }
        }
    }
}

fn count(found: &mut Option<Difference>, first: impl FnOnce() -> Difference) {
    found.get_or_insert_with(first).texels += 1;
}
