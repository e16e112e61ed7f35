//! Where in a picture something was found.

use image::{ImageBuffer, ImageError, Rgb};

use etalon_cpu::sanitise::{HEAT_BIRTH, HEAT_UNSTABLE};

/// A byte for each invocation: see [`etalon_cpu::sanitise::Site::heat`].
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct HeatMap {
    width: u32,
    height: u32,
    heat: Vec<u8>,
}

/// Colours from nothing wrong to every bit, evenly spaced: black body, light where it is
/// bad.
const RAMP: [[f32; 3]; 5] = [
    [12.0, 10.0, 30.0],
    [80.0, 18.0, 110.0],
    [185.0, 55.0, 85.0],
    [245.0, 140.0, 35.0],
    [252.0, 250.0, 170.0],
];

/// All bits of an `f32`, in eighths.
const ALL_BITS: f32 = 192.0;

impl HeatMap {
    /// `None` if there is no byte for each place of the grid.
    #[must_use]
    pub fn new([width, height]: [u32; 2], heat: &[u8]) -> Option<Self> {
        let places = u64::from(width) * u64::from(height);
        (places > 0 && heat.len() as u64 == places).then(|| Self {
            width,
            height,
            heat: heat.to_vec(),
        })
    }

    /// The colour of a byte: a ramp for errors, cyan where a twin would have decided
    /// otherwise, red where a NaN or infinity was born.
    #[must_use]
    pub fn colour(heat: u8) -> [u8; 3] {
        match heat {
            HEAT_BIRTH => [255, 30, 30],
            HEAT_UNSTABLE => [40, 220, 230],
            0 => [0, 0, 0],
            _ => {
                let at = (f32::from(heat) / ALL_BITS).min(1.0) * (RAMP.len() - 1) as f32;
                let index = (at as usize).min(RAMP.len() - 2);
                let part = at - index as f32;
                let (low, high) = (RAMP[index], RAMP[index + 1]);
                let mut colour = [0; 3];
                for channel in 0..3 {
                    let mixed = low[channel] + (high[channel] - low[channel]) * part;
                    colour[channel] = mixed.round() as u8;
                }
                colour
            }
        }
    }

    /// As a picture, with whole numbers of pixels for each place so that small ones can
    /// be seen.
    ///
    /// # Errors
    /// If it cannot be encoded.
    pub fn png(&self) -> Result<Vec<u8>, ImageError> {
        let scale = (320 / self.width.max(self.height)).clamp(1, 16);
        // The grid's texels are in memory, and the scale makes 320 pixels at most.
        let picture = ImageBuffer::from_fn(self.width * scale, self.height * scale, |x, y| {
            let at = (y / scale) as usize * self.width as usize + (x / scale) as usize;
            Rgb(Self::colour(self.heat.get(at).copied().unwrap_or_default()))
        });
        let mut bytes = std::io::Cursor::new(Vec::new());
        picture.write_to(&mut bytes, image::ImageFormat::Png)?;
        Ok(bytes.into_inner())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn more_wrong_is_lighter_and_decisions_stand_out() {
        let light = |heat| {
            HeatMap::colour(heat)
                .iter()
                .map(|&c| u32::from(c))
                .sum::<u32>()
        };
        assert!((1..192).all(|heat| light(heat) <= light(heat + 1) + 12));
        assert!(light(192) > light(8) + 300);
        let [unstable, born] = [HEAT_UNSTABLE, HEAT_BIRTH].map(HeatMap::colour);
        assert!((1..=253).all(|heat| HeatMap::colour(heat) != unstable));
        assert!((1..=253).all(|heat| HeatMap::colour(heat) != born));
    }

    #[test]
    fn maps_are_of_their_grid() {
        assert_eq!(HeatMap::new([2, 2], &[0; 3]), None);
        assert_eq!(HeatMap::new([0, 2], &[]), None);
        let map = HeatMap::new([3, 2], &[0, 255, 0, 0, 0, 254]).unwrap();
        let png = map.png().unwrap();
        let back = image::load_from_memory(&png).unwrap().to_rgb8();
        assert_eq!((back.width(), back.height()), (48, 32));
        assert_eq!(back.get_pixel(20, 3).0, HeatMap::colour(255));
        assert_eq!(back.get_pixel(40, 20).0, HeatMap::colour(254));
    }
}
