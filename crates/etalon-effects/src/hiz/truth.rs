//! The truth of a pyramid: for every texel of every level, all texels of the image that it
//! covers are looked at.

use super::{Layout, NOTHING};
use crate::EffectError;
use crate::truth::reserved;

/// The nearest and the farthest distance over some texels, as the pyramid has them.
pub type Bounds = [f32; 2];

/// Each level from 1 on, row by row from the top, of an image of some size with a surface
/// at `distance(x, y)` from the view plane, or none.
///
/// # Errors
/// If memory runs out.
pub fn levels(
    size: [u32; 2],
    distance: impl Fn(u32, u32) -> Option<f32>,
) -> Result<Vec<Vec<Bounds>>, EffectError> {
    let layout = Layout::new(size);
    let mut levels = reserved(layout.levels() as usize)?;
    for level in 1..=layout.levels() {
        let [columns, rows] = layout.level_size(level);
        let mut texels = reserved(columns as usize * rows as usize)?;
        // The texels of the image from the first on, in one axis.
        let covered = |texel: u32, side: u32| {
            let first = u64::from(texel) << level;
            let end = (first + (1_u64 << level)).min(side.into());
            // Below the end, which is a width.
            first as u32..end as u32
        };
        for row in 0..rows {
            for column in 0..columns {
                let mut bounds = [NOTHING, 0.0];
                for y in covered(row, size[1]) {
                    for x in covered(column, size[0]) {
                        if let Some(distance) = distance(x, y) {
                            bounds = [bounds[0].min(distance), bounds[1].max(distance)];
                        }
                    }
                }
                texels.push(bounds);
            }
        }
        levels.push(texels);
    }
    Ok(levels)
}
