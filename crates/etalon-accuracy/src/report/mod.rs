//! The report: a web page that needs nothing but itself and its pictures, the same
//! as a table for other programs, and the data it is made of.

mod csv;
mod data;
mod html;
mod presets;
mod settings;
mod subject;
mod verdict;

use std::path::{Path, PathBuf};

use crate::model::Sweep;
use crate::store::{self, StoreError};

pub use csv::csv;
pub use html::{STYLE, page, render};

pub use crate::text::escape;

/// The page's name in the folder of a report.
pub const PAGE: &str = "index.html";
/// The name of the table.
pub const TABLE: &str = "points.csv";

/// Writes the page, the data and the table into a folder, which is made if there is
/// none; the page's path. Pictures are looked for beside the page.
///
/// # Errors
/// If something cannot be written.
pub fn write(sweep: &Sweep, folder: &Path) -> Result<PathBuf, StoreError> {
    let kept = store::keep(sweep, folder)?;
    store::replace(folder, TABLE, &csv(sweep))?;
    // The page and the table show numbers that the data has not, under its notes.
    let shown = Sweep {
        notes: kept.notes,
        ..sweep.clone()
    };
    store::replace(folder, PAGE, &render(&shown))
}
