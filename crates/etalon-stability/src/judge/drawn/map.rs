//! Light that is the same from everywhere, blurred.

use etalon_scenes::cases::drawn::LightMap;

use super::super::rounding::BOUND;
use super::super::scale::half_step;
use super::super::truth::{Wrong, of};
use crate::observe::Store;

/// Every texel of every mip has the light that comes from everywhere. Texels between mips
/// have an alpha of 0.
pub(super) fn wrong<'a>(map: &LightMap, stores: &'a [Store]) -> Option<Vec<Wrong<'a>>> {
    let exact = map.uniform?.to_array();
    let (store, plane) = of(stores, "environment/prefilter")?;
    let format = store.image.as_ref()?.desc.format;
    let texels = plane.texels().iter().enumerate();
    let made = texels.filter(|(_, texel)| texel[3] != 0.0);
    let wrong = made.filter_map(|(index, texel)| {
        let channel = (0..3).find(|&channel| {
            let off = (texel[channel] - exact[channel]).abs();
            let step = half_step(format, channel, exact[channel]);
            // Written so that a NaN is wrong.
            let right = off <= step + BOUND * exact[channel];
            !right
        })?;
        Some(Wrong {
            store,
            index,
            what: format!("{:e} in place of {:e}", texel[channel], exact[channel]),
        })
    });
    Some(wrong.collect())
}
