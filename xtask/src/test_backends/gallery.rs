//! The report's pictures, as PNG files that are stored once however many
//! executions gave the same one.

use std::collections::BTreeSet;
use std::hash::{DefaultHasher, Hash, Hasher};
use std::path::{Path, PathBuf};

use etalon_core::image::ImageData;
use image::{ExtendedColorType, ImageError};
use thiserror::Error;

use super::model::Pictures;
use crate::compare::{Mapping, Picture, difference_picture, picture};

/// Pictures that cannot be written.
#[derive(Debug, Error)]
#[error("{}: {source}", path.display())]
pub struct GalleryError {
    path: PathBuf,
    source: ImageError,
}

/// The folder of a report's pictures.
#[derive(Debug)]
pub(super) struct Gallery {
    folder: PathBuf,
    written: BTreeSet<PathBuf>,
}

impl Gallery {
    /// Name of the folder below the report's.
    const FOLDER: &str = "images";

    /// A gallery below a report's folder.
    ///
    /// # Errors
    /// If the folder cannot be made.
    pub(super) fn new(report: &Path) -> Result<Self, GalleryError> {
        let folder = report.join(Self::FOLDER);
        std::fs::create_dir_all(&folder).map_err(|source| GalleryError {
            path: folder.clone(),
            source: ImageError::IoError(source),
        })?;
        Ok(Self {
            folder,
            written: BTreeSet::new(),
        })
    }

    /// Adds the pictures of a comparison.
    ///
    /// # Errors
    /// If one cannot be written.
    pub(super) fn add(
        &mut self,
        reference: &ImageData,
        subject: &ImageData,
    ) -> Result<Pictures, GalleryError> {
        let mapping = Mapping::of(reference);
        let shown = self.store(&picture(reference, mapping))?;
        // Images of equal bits differ in nothing, those of 0 ULPs neither, but
        // the former are the rule and need no second look.
        let same = reference.bytes == subject.bytes;
        Ok(Pictures {
            subject: if same {
                shown.clone()
            } else {
                self.store(&picture(subject, mapping))?
            },
            difference: if same {
                None
            } else {
                Some(self.store(&difference_picture(reference, subject))?)
            },
            reference: shown,
        })
    }

    /// Writes a picture, unless it is there already. Gives its path relative to
    /// the report.
    fn store(&mut self, picture: &Picture) -> Result<PathBuf, GalleryError> {
        let mut hasher = DefaultHasher::new();
        (picture.width, picture.height, &picture.rgb).hash(&mut hasher);
        let name = PathBuf::from(format!("{:016x}.png", hasher.finish()));
        if self.written.insert(name.clone()) {
            let path = self.folder.join(&name);
            image::save_buffer(
                &path,
                &picture.rgb,
                picture.width,
                picture.height,
                ExtendedColorType::Rgb8,
            )
            .map_err(|source| GalleryError { path, source })?;
        }
        Ok(Path::new(Self::FOLDER).join(name))
    }
}

#[cfg(test)]
mod tests {
    use etalon_core::Format;
    use etalon_core::resource::TextureDesc;
    use etalon_core::texel::Texel;

    use super::*;

    #[test]
    fn equal_pictures_are_stored_once_and_read_back() {
        let folder = tempfile::tempdir().unwrap();
        let mut gallery = Gallery::new(folder.path()).unwrap();
        let desc = TextureDesc::d2(4, 2, Format::Rgba8Unorm);
        let reference = ImageData::from_rgba_f32(desc, &[[0.5, 0.25, 1.0, 1.0]; 8]).unwrap();
        let same = gallery.add(&reference, &reference).unwrap();
        assert_eq!((&same.reference, &same.difference), (&same.subject, &None));
        let mut other = reference.clone();
        other.set_texel(3, 1, 0, 0, Texel::Float([1.0; 4])).unwrap();
        let different = gallery.add(&reference, &other).unwrap();
        assert_eq!(different.reference, same.reference);
        assert_ne!(different.subject, different.reference);
        assert_eq!(
            std::fs::read_dir(folder.path().join("images"))
                .unwrap()
                .count(),
            3
        );
        let difference = image::open(folder.path().join(different.difference.unwrap()))
            .unwrap()
            .into_rgb8();
        assert_eq!(difference.dimensions(), (4, 2));
        let lit: Vec<_> = difference
            .enumerate_pixels()
            .filter(|pixel| pixel.2.0 != [0; 3])
            .map(|pixel| (pixel.0, pixel.1))
            .collect();
        assert_eq!(lit, [(3, 1)]);
    }
}
