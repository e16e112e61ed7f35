//! The report: a web page that needs nothing but itself and its pictures, the same
//! as a table for other programs, and the data it is made of.

mod csv;
mod data;
mod html;
mod presets;
mod settings;
mod sound;
mod subject;
mod verdict;

use std::io;
use std::path::{Path, PathBuf};

use thiserror::Error;

use crate::model::Sweep;

pub use csv::csv;
pub use html::render;

/// The page's name in the folder of a report.
pub const PAGE: &str = "index.html";
/// The name of the data, from which a sweep can go on.
pub const DATA: &str = "sweep.json";
/// The name of the table.
pub const TABLE: &str = "points.csv";

/// Why a report could not be written.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum ReportError {
    /// A file or folder could not be written.
    #[error("cannot write {}", path.display())]
    Write {
        /// Which.
        path: PathBuf,
        /// Why not.
        source: io::Error,
    },
    /// The data has no JSON.
    #[error("what was found cannot be written as JSON")]
    Json(#[from] serde_json::Error),
}

/// Writes the page, the data and the table into a folder, which is made if there is
/// none; the page's path. Pictures are looked for beside the page.
///
/// JSON has no infinity and no NaN: such numbers are left out of the data, and the
/// notes say so. Each file is there whole or as it was before.
///
/// # Errors
/// If something cannot be written.
pub fn write(sweep: &Sweep, folder: &Path) -> Result<PathBuf, ReportError> {
    let sound = sound::sound(sweep);
    // The page and the table show such numbers, under the same notes.
    let shown = Sweep {
        notes: sound.notes.clone(),
        ..sweep.clone()
    };
    let at = |path: &Path| {
        let path = path.to_owned();
        move |source| ReportError::Write { path, source }
    };
    std::fs::create_dir_all(folder).map_err(at(folder))?;
    let write = |name: &str, text: &str| {
        let path = folder.join(name);
        let part = folder.join(format!("{name}.part"));
        std::fs::write(&part, text).map_err(at(&part))?;
        std::fs::rename(&part, &path).map_err(at(&path))?;
        Ok::<_, ReportError>(path)
    };
    write(DATA, &serde_json::to_string_pretty(&sound)?)?;
    write(TABLE, &csv(sweep))?;
    write(PAGE, &render(&shown))
}
