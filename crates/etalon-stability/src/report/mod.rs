//! The report: a web page that needs nothing but itself and the maps beside it.

mod html;
mod sites;

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
    /// A map cannot be drawn.
    #[error("{}: {source}", path.display())]
    Picture {
        /// The file.
        path: PathBuf,
        /// Why not.
        source: image::ImageError,
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

/// Writes the page, its data and maps into a folder, which is made if there is none; the
/// page's path.
///
/// # Errors
/// If something cannot be written.
pub fn write(report: &Report, folder: &Path) -> Result<PathBuf, ReportError> {
    std::fs::create_dir_all(folder).map_err(|source| ReportError::Io {
        path: folder.to_owned(),
        source,
    })?;
    let report = &with_maps(report, folder)?;
    write_text(&folder.join(DATA), &json(report)?)?;
    let page = folder.join(PAGE);
    write_text(&page, &render(report))?;
    Ok(page)
}

/// Most maps that are drawn: those of what is worst.
const MAPS: usize = 64;

/// Draws maps into the folder and says which is whose.
fn with_maps(report: &Report, folder: &Path) -> Result<Report, ReportError> {
    let mut report = report.clone();
    let maps = std::mem::take(&mut report.maps);
    let sites = report.sites.iter_mut().zip(&maps).enumerate();
    for (number, (site, map)) in sites.take(MAPS) {
        let Some(map) = map else { continue };
        let file = format!("heat-{number}.png");
        let path = folder.join(&file);
        let bytes = map.png().map_err(|source| ReportError::Picture {
            path: path.clone(),
            source,
        })?;
        std::fs::write(&path, bytes).map_err(|source| ReportError::Io { path, source })?;
        site.heat = Some(file);
    }
    Ok(report)
}
