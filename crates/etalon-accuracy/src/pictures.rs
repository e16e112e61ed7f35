//! Pictures of results and of how they differ from the truth, as PNG files.

use std::path::{Path, PathBuf};

use etalon_effects::truth::Plane;
use etalon_scenes::picture::Look;
use thiserror::Error;

use crate::judge::Judgement;
use crate::model::Point;

/// Why a picture cannot be written.
#[derive(Debug, Error)]
#[error("cannot write {}: {source}", path.display())]
pub struct PictureError {
    /// Which file.
    pub path: PathBuf,
    /// Why not.
    pub source: image::ImageError,
}

/// An 8-bit picture.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Picture {
    /// Pixels in x.
    pub width: u32,
    /// Pixels in y.
    pub height: u32,
    /// Red, green, blue; rows from top to bottom.
    pub rgb: Vec<u8>,
}

impl Picture {
    /// What a plane shows by a look.
    #[must_use]
    pub fn of(plane: &Plane, look: Look) -> Self {
        let shown = plane.texels().iter().flat_map(|texel| {
            let texel = texel.map(|value| value as f32);
            look.apply(texel).map(|share| (share * 255.0 + 0.5) as u8)
        });
        Self {
            width: plane.width(),
            height: plane.height(),
            rgb: shown.collect(),
        }
    }

    /// Shares of 1 as colours from black over violet and orange to pale yellow,
    /// brighter in equal steps; what is no number is cyan.
    #[must_use]
    pub fn heat(width: u32, height: u32, shares: impl IntoIterator<Item = f64>) -> Self {
        let rgb = shares.into_iter().flat_map(|share| {
            if share.is_nan() {
                return [0, 255, 255];
            }
            let place = share.clamp(0.0, 1.0) * (HEAT.len() - 1) as f64;
            let low = (place as usize).min(HEAT.len() - 2);
            let part = place - low as f64;
            std::array::from_fn(|channel| {
                let [a, b] = [low, low + 1].map(|index| f64::from(HEAT[index][channel]));
                (a + (b - a) * part + 0.5) as u8
            })
        });
        Self {
            width,
            height,
            rgb: rgb.collect(),
        }
    }
}

/// Colours of equal steps in lightness.
const HEAT: [[u8; 3]; 6] = [
    [0, 0, 0],
    [58, 15, 110],
    [137, 34, 107],
    [212, 72, 66],
    [249, 149, 20],
    [252, 255, 190],
];

/// Where pictures go.
#[derive(Clone, Debug, Default)]
pub struct Pictures {
    folder: Option<PathBuf>,
}

impl Pictures {
    /// The folder below a report's that they lie in.
    pub const FOLDER: &'static str = "pictures";

    /// None are written.
    #[must_use]
    pub const fn none() -> Self {
        Self { folder: None }
    }

    /// They are written beside the report in `report`.
    #[must_use]
    pub fn beside(report: &Path) -> Self {
        Self {
            folder: Some(report.to_owned()),
        }
    }

    /// Writes a result and its difference, and returns their names as the report
    /// links them.
    ///
    /// # Errors
    /// If a file cannot be written.
    pub fn write(
        &self,
        name: &str,
        judgement: &Judgement,
    ) -> Result<[Option<String>; 2], PictureError> {
        let one = |picture: &Option<Picture>, ending: &str| {
            let (Some(folder), Some(picture)) = (&self.folder, picture) else {
                return Ok(None);
            };
            let file = format!("{}/{name}{ending}.png", Self::FOLDER);
            let path = folder.join(&file);
            save(picture, &path).map_err(|source| PictureError { path, source })?;
            Ok(Some(file))
        };
        Ok([
            one(&judgement.picture, "")?,
            one(&judgement.difference, "-difference")?,
        ])
    }

    /// Whether the pictures of a point are where they would be written.
    #[must_use]
    pub fn has_all(&self, point: &Point) -> bool {
        let Some(folder) = &self.folder else {
            return true;
        };
        point.results.iter().all(|result| {
            let files = [&result.picture, &result.difference];
            files
                .into_iter()
                .flatten()
                .all(|file| folder.join(file).is_file())
        })
    }
}

fn save(picture: &Picture, path: &Path) -> image::ImageResult<()> {
    if let Some(folder) = path.parent() {
        std::fs::create_dir_all(folder)?;
    }
    image::save_buffer(
        path,
        &picture.rgb,
        picture.width,
        picture.height,
        image::ExtendedColorType::Rgb8,
    )
}
