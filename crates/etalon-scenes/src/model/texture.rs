//! Images and how they are sampled.

use super::error::{Check, ModelError, Place};

/// Largest width and height of an image.
pub const MAX_IMAGE_SIDE: u32 = 16_384;

/// An image of 8-bit RGBA. Whether its colour channels are sRGB or linear is up
/// to the use: base colour and emissive are sRGB, everything else is linear
/// (glTF 2.0, section 3.9.2). Alpha is always linear.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Image {
    name: String,
    width: u32,
    height: u32,
    rgba: Vec<u8>,
}

impl Image {
    /// An image from its rows, top row first, four bytes a texel.
    ///
    /// # Errors
    /// If a side is 0 or over [`MAX_IMAGE_SIDE`], or there are not
    /// `4 · width · height` bytes.
    pub fn new(
        name: impl Into<String>,
        width: u32,
        height: u32,
        rgba: Vec<u8>,
    ) -> Result<Self, ModelError> {
        let name = name.into();
        let place = Place::loose("image", &name);
        let check = Check(&place);
        for (what, side) in [("width", width), ("height", height)] {
            check.value(
                what,
                side,
                "from 1 to 16384",
                (1..=MAX_IMAGE_SIDE).contains(&side),
            )?;
        }
        let bytes = 4 * width as usize * height as usize;
        check.count(
            "bytes",
            rgba.len(),
            format!("{bytes} for {width}×{height} texels"),
            rgba.len() == bytes,
        )?;
        Ok(Self {
            name,
            width,
            height,
            rgba,
        })
    }

    /// Its name; may be empty.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Texels in x.
    #[must_use]
    pub const fn width(&self) -> u32 {
        self.width
    }

    /// Texels in y.
    #[must_use]
    pub const fn height(&self) -> u32 {
        self.height
    }

    /// The texels, top row first, four bytes each.
    #[must_use]
    pub fn rgba(&self) -> &[u8] {
        &self.rgba
    }
}

/// What is outside of an image.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Wrap {
    /// The image again.
    #[default]
    Repeat,
    /// The image mirrored, then again.
    Mirror,
    /// Its outermost texels.
    Clamp,
}

/// How texels become a value between them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Filter {
    /// The nearest texel or level.
    Nearest,
    /// Linear between neighbours.
    #[default]
    Linear,
}

/// How an image is sampled.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Sampler {
    /// Outside of \[0, 1\] in u.
    pub wrap_u: Wrap,
    /// Outside of \[0, 1\] in v.
    pub wrap_v: Wrap,
    /// Where texels are larger than pixels.
    pub magnify: Filter,
    /// Where texels are smaller than pixels.
    pub minify: Filter,
    /// Between mip levels; `None` uses the first only.
    pub mip: Option<Filter>,
}

impl Default for Sampler {
    /// Repeating, with linear filters throughout.
    fn default() -> Self {
        Self {
            wrap_u: Wrap::Repeat,
            wrap_v: Wrap::Repeat,
            magnify: Filter::Linear,
            minify: Filter::Linear,
            mip: Some(Filter::Linear),
        }
    }
}

/// An image with a sampler.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Texture {
    /// Index of the model's image.
    pub image: usize,
    /// How it is sampled.
    pub sampler: Sampler,
}
