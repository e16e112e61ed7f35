//! Is what a function stored what it promises?

use super::table::Function;
use crate::judge::truth::Untrue;
use crate::observe::{Place, Store};

impl Function {
    /// Holds what was stored to the truth.
    pub(super) fn judge(&self, arguments: &[[f32; 4]], store: &Store) -> Option<Untrue> {
        let texels = store
            .image
            .as_ref()
            .and_then(|image| image.to_rgba_f32().ok());
        let texels = texels.unwrap_or_default();
        let mut found: Option<Untrue> = None;
        for (index, (v, stored)) in arguments.iter().zip(&texels).enumerate() {
            let exact = (self.truth)(v.map(f64::from));
            let wrong = (0..4).find(|&channel| {
                let (stored, exact) = (f64::from(stored[channel]), exact[channel]);
                let size = exact.abs().max(self.scale).max(f32::MIN_POSITIVE.into());
                let unit = f64::from(((size.to_bits() >> 52) as i32) - 1023 - 23).exp2();
                // Where nothing normal is left it may be flushed to zero.
                let flushed = exact.abs() <= f64::from(f32::MIN_POSITIVE) && stored == 0.0;
                // Written so that a NaN is wrong.
                let right = flushed || (stored - exact).abs() <= self.ulps * unit;
                !right
            });
            if let Some(channel) = wrong {
                let found = found.get_or_insert_with(|| Untrue {
                    texels: 0,
                    first: Place {
                        channel: channel as u32,
                        ..store.place(0, index, channel)
                    },
                    what: format!(
                        "{} of {:?}: {:e} in place of {:e}",
                        self.name, v, stored[channel], exact[channel]
                    ),
                });
                found.texels += 1;
            }
        }
        if texels.len() < arguments.len() {
            let what = format!("{} of {} results", texels.len(), arguments.len());
            return Some(Untrue {
                texels: (arguments.len() - texels.len()) as u64,
                what,
                ..Untrue::default()
            });
        }
        found
    }
}

#[cfg(test)]
mod tests {
    use etalon_core::Format;
    use etalon_core::image::ImageData;
    use etalon_core::resource::TextureDesc;

    use super::super::table::functions;
    use super::*;

    #[test]
    fn a_wrong_result_is_found_and_a_right_one_is_not() {
        let arguments = [[0.5, 1.0, 2.0, f32::NAN], [-3.0, 0.0, f32::INFINITY, 1.0]];
        let desc = TextureDesc::d2(2, 1, Format::Rgba32Float);
        let store = |texels: &[[f32; 4]]| Store {
            image: Some(ImageData::from_rgba_f32(desc, texels).unwrap()),
            ..Store::default()
        };
        let rounding = functions().find(|f| f.name == "f16_rounded").unwrap();
        let mut right = [[0.5, 1.0, 2.0, 0.0], [-3.0, 0.0, 65_504.0, 1.0]];
        assert_eq!(rounding.judge(&arguments, &store(&right)), None);
        right[1][2] = f32::INFINITY;
        let found = rounding.judge(&arguments, &store(&right)).unwrap();
        assert_eq!(
            (found.texels, found.first.x, found.first.channel),
            (1, 1, 2)
        );
        assert!(rounding.judge(&arguments, &Store::default()).is_some());
    }
}
