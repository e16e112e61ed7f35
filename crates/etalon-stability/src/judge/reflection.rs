//! Where a reflection was decided otherwise, and what has read it since.
//!
//! A mirror ray that two precisions let end in different texels has two colours, of
//! which either is right; a blur then spreads the difference over all texels that
//! it averages. Where a rounded place lies between two texels of different light,
//! they differ by the same decision, in parts: of the place's error in texels as
//! much, times the light. None of this is an error of the passes that read it.

use super::rounding::{BOUND, Shown};

/// Which texels of the reflection's passes to leave out.
#[derive(Clone, Debug)]
pub(super) struct Reflection {
    width: usize,
    height: usize,
    radius: usize,
    /// Texels left out of the last pass.
    out: Vec<bool>,
}

impl Reflection {
    pub(super) fn new(shown: &Shown) -> Self {
        let [width, height] = shown.size.map(|side| side as usize);
        Self {
            width,
            height,
            radius: shown.blur as usize,
            out: vec![false; width * height],
        }
    }

    /// Whether a texel of a pass is left out: `otherwise` if the two `f64` runs differ
    /// there, or if the pass reads what was left out.
    pub(super) fn leaves_out(
        &mut self,
        pass: &str,
        index: usize,
        otherwise: bool,
        stored: &[f64; 4],
        exact: &[f64; 4],
    ) -> bool {
        // The composite shows each texel where it is.
        let reads = pass.starts_with("ssr/") || pass.starts_with("composite/");
        let Some(out) = self.out.get_mut(index).filter(|_| reads) else {
            return otherwise;
        };
        // A place that is off by more than a coordinate's rounding, by less than what
        // counts as an error of it: looked up there is something else.
        let sides = [self.width as f64, self.height as f64];
        let off = (0..2).any(|axis| {
            pass == "ssr/march" && (stored[axis] - exact[axis]).abs() * sides[axis] > BOUND
        });
        *out |= otherwise || off;
        // The place itself is judged all the same.
        if pass == "ssr/march" { otherwise } else { *out }
    }

    /// A pass has been looked at: which texels does the next one read?
    pub(super) fn next(&mut self, pass: &str) {
        // The first blur reads what the look-up stored, the second what the first did.
        let (step, count) = match pass {
            "ssr/resolve" => (1, self.width),
            "ssr/blur x" => (self.width, self.height),
            _ => return,
        };
        let before = self.out.clone();
        for (index, out) in self.out.iter_mut().enumerate() {
            let at = index / step % count;
            let first = at - at.min(self.radius);
            let last = (at + self.radius).min(count - 1);
            let start = index - at * step;
            *out = (first..=last).any(|place| before[start + place * step]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_a_blur_reads_is_left_out_with_it() {
        let shown = Shown {
            brightest: 1.0,
            side: 9,
            size: [9, 5],
            blur: 2,
        };
        let mut reflection = Reflection::new(&shown);
        let same = [0.5; 4];
        let middle = 2 * 9 + 4;
        assert!(reflection.leaves_out("ssr/resolve", middle, true, &same, &same));
        assert!(!reflection.leaves_out("ssr/resolve", middle + 1, false, &same, &same));
        reflection.next("ssr/resolve");
        let row: Vec<bool> = (0..9)
            .map(|x| reflection.leaves_out("ssr/blur x", 18 + x, false, &same, &same))
            .collect();
        let expected = [false, false, true, true, true, true, true, false, false];
        assert_eq!(row, expected);
        reflection.next("ssr/blur x");
        assert!(reflection.leaves_out("ssr/blur y", 4, false, &same, &same));
        assert!(!reflection.leaves_out("ssr/blur y", 1, false, &same, &same));
        // What has another size is judged by itself.
        assert!(!reflection.leaves_out("bloom/threshold", 4, false, &same, &same));
    }

    #[test]
    fn a_place_off_by_a_part_of_a_texel_is_judged_but_not_what_is_there() {
        let shown = Shown {
            brightest: 1.0,
            side: 64,
            size: [64, 64],
            blur: 0,
        };
        let mut reflection = Reflection::new(&shown);
        let (exact, stored) = ([0.5; 4], [0.5001, 0.5, 0.5, 0.5]);
        assert!(!reflection.leaves_out("ssr/march", 7, false, &stored, &exact));
        reflection.next("ssr/march");
        assert!(reflection.leaves_out("ssr/resolve", 7, false, &exact, &exact));
        assert!(!reflection.leaves_out("ssr/resolve", 8, false, &exact, &exact));
    }
}
