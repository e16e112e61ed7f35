//! What a sweep found, in a file that a later run goes on with.

mod sound;

use std::io::ErrorKind;
use std::path::{Path, PathBuf};

use thiserror::Error;

use crate::model::Sweep;

/// The file's name, beside the report.
pub const FILE: &str = "sweep.json";

/// Why a sweep cannot be kept or read.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum StoreError {
    /// The file cannot be written or read.
    #[error("{}: {source}", path.display())]
    File {
        /// Which.
        path: PathBuf,
        /// Why not.
        source: std::io::Error,
    },
    /// The file is not what this program writes.
    #[error("{} is no sweep: {source}; move it away to begin anew", path.display())]
    Content {
        /// Which.
        path: PathBuf,
        /// Why not.
        source: serde_json::Error,
    },
}

/// Keeps a sweep in a folder, which is made if it is not there.
///
/// JSON has no infinity and no NaN: such numbers are left out, and the notes say so.
/// What was kept is returned.
///
/// # Errors
/// If the folder or the file cannot be written.
pub fn keep(sweep: &Sweep, folder: &Path) -> Result<Sweep, StoreError> {
    let sound = sound::sound(sweep);
    let text = serde_json::to_string_pretty(&sound).map_err(|source| StoreError::Content {
        path: folder.join(FILE),
        source,
    })?;
    replace(folder, FILE, &text)?;
    Ok(sound)
}

/// Writes a file into a folder, which is made if it is not there. Whoever stops the
/// program meanwhile finds the file as it was before.
///
/// # Errors
/// If the folder or the file cannot be written.
pub(crate) fn replace(folder: &Path, name: &str, text: &str) -> Result<PathBuf, StoreError> {
    let at = |path: &Path| {
        let path = path.to_owned();
        move |source| StoreError::File { path, source }
    };
    std::fs::create_dir_all(folder).map_err(at(folder))?;
    let path = folder.join(name);
    let part = folder.join(format!("{name}.part"));
    std::fs::write(&part, text).map_err(at(&part))?;
    std::fs::rename(&part, &path).map_err(at(&path))?;
    Ok(path)
}

/// The sweep kept in a folder, if one is.
///
/// # Errors
/// If the file cannot be read, or is something else.
pub fn read(folder: &Path) -> Result<Option<Sweep>, StoreError> {
    let path = folder.join(FILE);
    match std::fs::read(&path) {
        Ok(bytes) => serde_json::from_slice(&bytes)
            .map(Some)
            .map_err(|source| StoreError::Content { path, source }),
        Err(error) if error.kind() == ErrorKind::NotFound => Ok(None),
        Err(source) => Err(StoreError::File { path, source }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_kept_is_read_again() {
        let folder = tempfile::tempdir().unwrap();
        let below = folder.path().join("new");
        assert_eq!(read(&below).unwrap(), None);
        let mut sweep = Sweep {
            size: [640, 360],
            ..Sweep::default()
        };
        for note in ["one", "another"] {
            sweep.notes.push(note.to_owned());
            keep(&sweep, &below).unwrap();
            assert_eq!(read(&below).unwrap(), Some(sweep.clone()));
        }
        std::fs::write(below.join(FILE), "{").unwrap();
        let error = read(&below).unwrap_err();
        assert!(matches!(error, StoreError::Content { .. }), "{error}");
        assert!(matches!(
            keep(&sweep, &below.join(FILE)),
            Err(StoreError::File { .. })
        ));
    }
}
