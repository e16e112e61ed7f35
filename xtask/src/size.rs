//! Sizes of pictures on the command line.

use std::fmt;
use std::str::FromStr;

/// Pixels in x and y, written `640x360`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Size {
    /// Pixels in x, at least 1.
    pub width: u32,
    /// Pixels in y, at least 1.
    pub height: u32,
}

impl fmt::Display for Size {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}x{}", self.width, self.height)
    }
}

impl FromStr for Size {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let side = |text: &str| text.parse().ok().filter(|side| *side > 0);
        text.split_once(['x', '×'])
            .and_then(|(width, height)| {
                Some(Self {
                    width: side(width)?,
                    height: side(height)?,
                })
            })
            .ok_or_else(|| "a size is a width and a height of at least 1, as in 640x360".to_owned())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_are_read_as_they_are_written() {
        assert_eq!(
            "640x360".parse(),
            Ok(Size {
                width: 640,
                height: 360
            })
        );
        assert_eq!("1×4096".parse::<Size>().unwrap().to_string(), "1x4096");
        for text in [
            "",
            "640",
            "x",
            "640x",
            "0x1",
            "1x0",
            "-1x2",
            "1x2x3",
            "99999999999x1",
        ] {
            assert!(text.parse::<Size>().is_err(), "{text}");
        }
    }
}
