//! Kernels from a folder, in place of those built in: a formula can be tried on all
//! hard cases without building anything.

use std::io;
use std::path::{Path, PathBuf};

use thiserror::Error;

/// Largest kernel file read, in bytes; those of Etalon have some thousand.
const LARGEST: u64 = 1 << 20;

/// Most files read.
const MOST: usize = 1024;

/// Why a folder's kernels cannot be had.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum KernelsError {
    /// A file or folder cannot be read.
    #[error("{}: {source}", path.display())]
    Io {
        /// Which.
        path: PathBuf,
        /// Why not.
        source: io::Error,
    },
    /// More or larger files than kernels are.
    #[error("{}: these are no kernels, as there are too many or too large files", path.display())]
    TooLarge {
        /// Where.
        path: PathBuf,
    },
}

/// The kernels below a folder, sorted: their paths without the extension, and their
/// text.
///
/// # Errors
/// If a file cannot be read, or there are more and larger ones than kernels are.
pub fn of_folder(folder: &Path) -> Result<Vec<(String, String)>, KernelsError> {
    let failed = |path: &Path, source| KernelsError::Io {
        path: path.to_owned(),
        source,
    };
    let too_large = |path: &Path| KernelsError::TooLarge {
        path: path.to_owned(),
    };
    let mut folders = vec![folder.to_owned()];
    let mut found = Vec::new();
    while let Some(next) = folders.pop() {
        for entry in std::fs::read_dir(&next).map_err(|error| failed(&next, error))? {
            let path = entry.map_err(|error| failed(&next, error))?.path();
            let kind = std::fs::symlink_metadata(&path).map_err(|error| failed(&path, error))?;
            if kind.is_dir() {
                folders.push(path);
                if folders.len() > MOST {
                    return Err(too_large(folder));
                }
                continue;
            }
            if path.extension().is_none_or(|extension| extension != "wesl") {
                continue;
            }
            if kind.len() > LARGEST || found.len() >= MOST {
                return Err(too_large(&path));
            }
            let text = std::fs::read_to_string(&path).map_err(|error| failed(&path, error))?;
            let name = path
                .strip_prefix(folder)
                .unwrap_or(&path)
                .with_extension("");
            found.push((name.to_string_lossy().replace('\\', "/"), text));
        }
    }
    found.sort();
    Ok(found)
}
