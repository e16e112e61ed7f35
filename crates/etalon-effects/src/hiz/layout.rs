//! Where the levels of a pyramid lie in its texture.

/// The levels of the pyramid of an image, and where they are; `shaders/lib/hiz.wesl` has
/// the same for kernels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Layout {
    size: [u32; 2],
}

impl Layout {
    /// Of an image of some width and height; one without texels counts as one of one.
    #[must_use]
    pub fn new(size: [u32; 2]) -> Self {
        Self {
            size: size.map(|side| side.max(1)),
        }
    }

    /// How many levels there are above the image: as many halvings as it takes to come
    /// to one texel, and at least one.
    #[must_use]
    pub fn levels(&self) -> u32 {
        let [width, height] = self.size;
        let halvings = u32::BITS - (width.max(height) - 1).leading_zeros();
        halvings.max(1)
    }

    /// Width and height of a level in texels; the image is level 0.
    #[must_use]
    pub fn level_size(&self, level: u32) -> [u32; 2] {
        let side = 1_u64 << level.min(32);
        // A quotient of 32 bits by at least 1.
        self.size
            .map(|texels| u64::from(texels).div_ceil(side) as u32)
    }

    /// The upper left corner in the texture of a level from 1 on.
    #[must_use]
    pub fn corner(&self, level: u32) -> [u32; 2] {
        let [width, height] = self.level_size(1);
        match level.checked_sub(2) {
            None => [0, 0],
            Some(further) => {
                let left = height.checked_shr(further).unwrap_or(0);
                [width, height - left + further]
            }
        }
    }

    /// Width and height of the texture.
    #[must_use]
    pub fn extent(&self) -> [u32; 2] {
        let [mut width, mut height] = self.level_size(1);
        let last = self.levels();
        if last > 1 {
            width += self.level_size(2)[0];
            height = height.max(self.corner(last)[1] + self.level_size(last)[1]);
        }
        [width, height]
    }

    /// Texels of the levels from `level` on.
    pub(super) fn texels_from(&self, level: u32) -> u64 {
        let texels = |level| {
            let [width, height] = self.level_size(level).map(u64::from);
            width * height
        };
        (level..=self.levels()).map(texels).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Sizes of every remainder, and long ones.
    fn sizes() -> impl Iterator<Item = [u32; 2]> {
        let small = (1..=70).flat_map(|width| (1..=70).map(move |height| [width, height]));
        let long = [
            [4097, 3],
            [3, 4097],
            [1, 16_384],
            [16_384, 1],
            [16_383, 16_383],
            [1280, 720],
            [1921, 1081],
        ];
        small.chain(long)
    }

    #[test]
    fn levels_end_at_one_texel_and_lie_apart_within_the_texture() {
        for size in sizes() {
            let layout = Layout::new(size);
            let last = layout.levels();
            assert_eq!(layout.level_size(0), size);
            assert_eq!(layout.level_size(last), [1, 1], "{size:?}");
            assert!(
                last == 1 || layout.level_size(last - 1) != [1, 1],
                "{size:?}"
            );
            let extent = layout.extent();
            let mut column = 0;
            for level in 1..=last {
                let [width, height] = layout.level_size(level);
                // Halving twice is dividing by four: rounding up does not add up.
                assert_eq!(
                    [width, height],
                    layout.level_size(level - 1).map(|side| side.div_ceil(2))
                );
                let [left, top] = layout.corner(level);
                assert!(
                    left + width <= extent[0] && top + height <= extent[1],
                    "{size:?}"
                );
                if level == 1 {
                    assert_eq!([left, top], [0, 0]);
                } else {
                    // Right of the first level, and below all others.
                    assert_eq!(left, layout.level_size(1)[0]);
                    assert!(
                        top >= column,
                        "{size:?}: level {level} at {top}, before {column}"
                    );
                    column = top + height;
                }
            }
        }
    }

    #[test]
    fn the_texture_is_hardly_larger_than_what_is_in_it() {
        for size in [[1280, 720], [1921, 1081], [16_383, 16_383]] {
            let layout = Layout::new(size);
            let [width, height] = layout.extent().map(u64::from);
            let used = layout.texels_from(1);
            // What is unused is a third of the column beside the first level, which is
            // half as wide: an eighth of both. And a row for each level.
            let spare = u64::from(layout.levels()) * width;
            assert!(
                (width * height - spare) * 7 <= used * 8,
                "{size:?}: {width}×{height}, {used}"
            );
        }
    }

    #[test]
    fn no_size_overflows() {
        for size in [[0, 0], [u32::MAX, u32::MAX], [u32::MAX, 1]] {
            let layout = Layout::new(size);
            assert_eq!(layout.level_size(layout.levels()), [1, 1]);
            let _ = layout.extent();
            assert_eq!(layout.level_size(99), [1, 1]);
        }
    }
}
