//! What devices may draw otherwise than the interpreter, and how far.
//!
//! Kernels that run over the whole picture store the same bits under strict arithmetic;
//! what a target adds up it may truncate or round, a unit of 16-bit floats for each
//! layer. Drawn triangles add how they are rasterised, as in `test-backends`: on the
//! interpreter's grid coverage and depth are the same bits, and what is interpolated is
//! off by less than two units for each pass. On other grids corners move by up to 1/32 of
//! a pixel: a pixel whose centre is that near to an edge may show something else, and
//! what is interpolated is what it is that far beside.

use etalon_core::Format;
use etalon_core::format::Encoding;
use etalon_core::image::ImageData;
use etalon_scenes::cases::drawn::Stage;

use super::super::agreement::Difference;
use crate::observe::Store;
use crate::scene::{Drawing, Scene};

/// The unit of the last place of a 16-bit float, relative to the value.
const UNIT: f64 = 1.0 / 1024.0;

/// The least number of 16-bit floats.
const LEAST: f64 = 1.0 / 16_777_216.0;

/// The largest number of 16-bit floats. Where a sum is beyond it a device that cuts off
/// has it, another one infinity.
const MOST: f64 = 65_504.0;

/// Share of pixels that may show something else where corners are moved to another grid:
/// outlines as long as ten times the picture's, of which 1/16 of a pixel to either side
/// is undecided.
const UNDECIDED: f64 = 0.04;

/// Pixels by which another grid moves what is interpolated between corners, each of which
/// moves by 1/32.
const MOVED: f64 = 1.0 / 16.0;

/// The texels of a picture, to see how they change from one to the next.
struct Neighbours {
    width: usize,
    texels: Vec<[f32; 4]>,
}

impl Neighbours {
    fn of(image: &ImageData) -> Option<Self> {
        Some(Self {
            width: image.desc.extent.width.max(1) as usize,
            texels: image.to_rgba_f32().ok()?,
        })
    }

    /// The largest changes of a channel to a pixel beside and to one above or below,
    /// together. To what is no number nothing changes.
    fn slope(&self, index: usize, channel: usize) -> f64 {
        let at = |index: usize| {
            self.texels
                .get(index)
                .map(|texel| f64::from(texel[channel]))
        };
        let Some(own) = at(index) else { return 0.0 };
        let change = |other: Option<usize>| {
            let change = (other.and_then(at).unwrap_or(own) - own).abs();
            if change.is_finite() { change } else { 0.0 }
        };
        let column = index % self.width;
        let left = (column > 0).then(|| index - 1);
        let right = (column + 1 < self.width).then_some(index + 1);
        let above = index.checked_sub(self.width);
        let below = Some(index + self.width);
        change(left).max(change(right)) + change(above).max(change(below))
    }
}

/// How a device draws beside the interpreter.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Rules {
    /// What is drawn.
    pub drawing: Drawing,
    /// Whether corners are moved to the interpreter's grid.
    pub same_grid: bool,
    /// Whether arithmetic admits one result.
    pub strict: bool,
    /// How many layers a target blends at most.
    pub layers: u32,
}

/// How many layers a target blends at most for a scene.
#[must_use]
pub fn layers(scene: &Scene) -> u32 {
    match scene {
        Scene::Images(_) | Scene::Stage(Stage::LightMap(_)) => 0,
        Scene::Stage(Stage::Surfaces(surfaces)) => surfaces.lights.len() as u32 + 1,
        // Both sides of each pane.
        Scene::Stage(Stage::Solids(solids)) => {
            2 * solids.solids.iter().filter(|solid| solid.glass).count() as u32
        }
    }
}

impl Rules {
    /// The error allowed of the `number`-th store from 0: relative, and absolute.
    fn allowed(&self, format: Format, number: usize) -> [f64; 2] {
        let bits = matches!(format, Format::Depth32Float | Format::R32Float);
        let blended = f64::from(self.layers) * UNIT;
        if self.strict && (self.drawing == Drawing::Covering || bits && self.same_grid) {
            let blended = if bits { 0.0 } else { blended };
            return [
                blended,
                if bits {
                    0.0
                } else {
                    f64::from(self.layers) * LEAST
                },
            ];
        }
        let passes = 2.0 * (number as f64 + 1.0) * UNIT + blended;
        let code = match format.encoding() {
            Encoding::Unorm | Encoding::UnormSrgb => 1.0 / 255.0,
            _ => 0.0,
        };
        [passes, passes + code]
    }

    /// Compares what a frame's passes drew, and adds what is too far apart to `found`.
    pub fn compare(
        &self,
        frame: usize,
        reference: &[Store],
        subject: &[Store],
        found: &mut Option<Difference>,
    ) {
        let outlines = self.drawing == Drawing::Triangles && !self.same_grid;
        for (number, reference) in reference.iter().enumerate() {
            let same = subject.iter().find(|store| store.same_as(reference));
            let (Some(a), Some(b)) = (
                &reference.image,
                same.and_then(|store| store.image.as_ref()),
            ) else {
                continue;
            };
            let format = a.desc.format;
            let [relative, absolute] = self.allowed(format, number);
            let size = format.texel_bytes() as usize;
            let mut own: Option<Difference> = None;
            let neighbours = Neighbours::of(a).filter(|_| outlines);
            let texels = a.bytes.chunks_exact(size).zip(b.bytes.chunks_exact(size));
            for (index, (a, b)) in texels.enumerate() {
                if a == b {
                    continue;
                }
                let (a, b) = (format.decode(a).to_f64(), format.decode(b).to_f64());
                let beyond = (0..format.channels() as usize).find(|&channel| {
                    let moved = neighbours
                        .as_ref()
                        .map_or(0.0, |all| all.slope(index, channel) * MOVED);
                    let [a, b] = [a, b].map(|texel| match format {
                        Format::Rgba16Float => texel[channel].clamp(-MOST, MOST),
                        _ => texel[channel],
                    });
                    // Written so that a NaN is beyond.
                    let within = (a - b).abs() <= relative * a.abs() + absolute + moved;
                    !within
                });
                if let Some(channel) = beyond {
                    own.get_or_insert_with(|| Difference {
                        texels: 0,
                        first: reference.place(frame, index, channel),
                        ulps: 0,
                        reference: a[channel],
                        subject: b[channel],
                    })
                    .texels += 1;
                }
            }
            let texels = a.bytes.len() / size.max(1);
            let tolerated = match outlines {
                true => (UNDECIDED * texels as f64) as u64,
                false => 0,
            };
            if let Some(own) = own
                && own.texels > tolerated
                && found.is_none()
            {
                *found = Some(own);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use etalon_core::resource::TextureDesc;

    fn store(format: Format, values: &[f32]) -> Vec<Store> {
        let texels: Vec<[f32; 4]> = values.iter().map(|&v| [v, v, v, 1.0]).collect();
        let desc = TextureDesc::d2(values.len() as u32, 1, format);
        vec![Store {
            pass: "lighting/light map".to_owned(),
            image: Some(ImageData::from_rgba_f32(desc, &texels).unwrap()),
            ..Store::default()
        }]
    }

    fn found(rules: Rules, format: Format, pair: [&[f32]; 2]) -> Option<u64> {
        let mut found = None;
        let [reference, subject] = pair.map(|values| store(format, values));
        rules.compare(0, &reference, &subject, &mut found);
        found.map(|found| found.texels)
    }

    const STRICT: Rules = Rules {
        drawing: Drawing::Covering,
        same_grid: false,
        strict: true,
        layers: 2,
    };

    #[test]
    fn a_unit_for_each_layer_is_allowed_and_no_more() {
        let half = Format::Rgba16Float;
        let unit = 1.0 / 1024.0;
        assert_eq!(found(STRICT, half, [&[1.0], &[1.0 + 2.0 * unit]]), None);
        assert_eq!(found(STRICT, half, [&[1.0], &[1.0 + 3.0 * unit]]), Some(1));
        assert_eq!(found(STRICT, half, [&[65504.0], &[f32::INFINITY]]), None);
        assert_eq!(found(STRICT, half, [&[1.0], &[f32::NAN]]), Some(1));
    }

    #[test]
    fn depth_has_the_same_bits_on_the_same_grid() {
        let rules = Rules {
            drawing: Drawing::Triangles,
            same_grid: true,
            layers: 0,
            ..STRICT
        };
        let depth = Format::R32Float;
        let next = 0.5_f32.next_up();
        assert_eq!(found(rules, depth, [&[0.5], &[next]]), Some(1));
        let other = Rules {
            same_grid: false,
            ..rules
        };
        assert_eq!(found(other, depth, [&[0.5], &[next]]), None);
    }

    #[test]
    fn what_changes_from_pixel_to_pixel_may_be_that_of_a_place_beside() {
        let rules = Rules {
            drawing: Drawing::Triangles,
            layers: 0,
            ..STRICT
        };
        // Two units are allowed of one pass, relative and absolute; a sixteenth of a
        // change by 10 is 0.625.
        let half = Format::Rgba16Float;
        let slope: Vec<f32> = (0..20).map(|x| 10.0 * x as f32).collect();
        let by = |off: f32| slope.iter().map(|x| x + off).collect::<Vec<_>>();
        assert_eq!(found(rules, half, [&slope, &by(0.6)]), None);
        assert!(found(rules, half, [&slope, &by(2.0)]).is_some());
        let flat = vec![10.0; 20];
        let off: Vec<f32> = flat.iter().map(|x| x + 0.6).collect();
        assert_eq!(found(rules, half, [&flat, &off]), Some(20));
    }

    #[test]
    fn edges_may_be_elsewhere_on_another_grid_and_surfaces_may_not() {
        let rules = Rules {
            drawing: Drawing::Triangles,
            ..STRICT
        };
        let drawn = vec![1.0; 100];
        let mut other = drawn.clone();
        other[..4].fill(0.0);
        let half = Format::Rgba16Float;
        assert_eq!(found(rules, half, [&drawn, &other]), None);
        other[4] = 0.0;
        assert_eq!(found(rules, half, [&drawn, &other]), Some(5));
        let same = Rules {
            same_grid: true,
            ..rules
        };
        assert_eq!(found(same, half, [&drawn, &other]), Some(5));
    }
}
