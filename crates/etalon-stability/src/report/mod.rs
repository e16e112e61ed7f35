//! The report: a web page that needs nothing but itself.

mod html;

use std::io;
use std::path::{Path, PathBuf};

use thiserror::Error;

use crate::model::Report;

pub use html::render;

/// The page's name in the folder of a report.
pub const PAGE: &str = "index.html";
/// The name of the data beside it.
pub const DATA: &str = "stability.json";

/// Why nothing was written.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum ReportError {
    /// A file cannot be written.
    #[error("{}: {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// Why not.
        source: io::Error,
    },
    /// The data cannot be put into words.
    #[error(transparent)]
    Json(#[from] serde_json::Error),
}

/// The report as JSON: `totals`, `executors`, `cases`, `refusals` and `notes`, as
/// [`Report`] has them.
///
/// # Errors
/// If a number is none that JSON has.
pub fn json(report: &Report) -> Result<String, ReportError> {
    let mut text = serde_json::to_string_pretty(report)?;
    text.push('\n');
    Ok(text)
}

/// Writes text to a file.
///
/// # Errors
/// If it cannot be written.
pub fn write_text(path: &Path, text: &str) -> Result<(), ReportError> {
    std::fs::write(path, text).map_err(|source| ReportError::Io {
        path: path.to_owned(),
        source,
    })
}

/// Writes the page and its data into a folder, which is made if there is none; the
/// page's path.
///
/// # Errors
/// If something cannot be written.
pub fn write(report: &Report, folder: &Path) -> Result<PathBuf, ReportError> {
    std::fs::create_dir_all(folder).map_err(|source| ReportError::Io {
        path: folder.to_owned(),
        source,
    })?;
    write_text(&folder.join(DATA), &json(report)?)?;
    let page = folder.join(PAGE);
    write_text(&page, &render(report))?;
    Ok(page)
}
