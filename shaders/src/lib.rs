//! The kernels of Etalon, embedded as WESL text.
//!
//! A published package cannot reach outside its own folder, so the folder of
//! kernels is itself a package. It knows nothing about what the text means;
//! compiling is `etalon_core::kernel`'s work.
//!
//! A kernel is named by its path below this package without the extension:
//! `bloom/threshold` is the file `bloom/threshold.wesl`.

#![forbid(unsafe_code)]

/// Every kernel and library file, sorted by path.
static SOURCES: &[(&str, &str)] = &include!(concat!(env!("OUT_DIR"), "/table.rs"));

/// The text of one file, e.g. `lib/colour`; `None` if there is no such file.
#[must_use]
pub fn source(path: &str) -> Option<&'static str> {
    let index = SOURCES
        .binary_search_by_key(&path, |&(path, _)| path)
        .ok()?;
    Some(SOURCES.get(index)?.1)
}

/// Every embedded file as (path, text), sorted by path.
pub fn sources() -> impl ExactSizeIterator<Item = (&'static str, &'static str)> {
    SOURCES.iter().copied()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The table is what is on disk, found here by other means than the build
    /// script's.
    #[test]
    fn holds_every_file_with_its_text() {
        let root = std::path::Path::new(env!("CARGO_MANIFEST_DIR"));
        let mut folders = vec![root.to_owned()];
        let mut files = Vec::new();
        while let Some(folder) = folders.pop() {
            for entry in std::fs::read_dir(folder).unwrap() {
                let path = entry.unwrap().path();
                if path.is_dir() && path != root.join("src") && path != root.join("target") {
                    folders.push(path);
                } else if path.to_string_lossy().ends_with(".wesl") {
                    files.push(path);
                }
            }
        }
        for file in &files {
            let below = file
                .strip_prefix(root)
                .unwrap()
                .to_string_lossy()
                .replace('\\', "/");
            let path = below.strip_suffix(".wesl").unwrap();
            assert_eq!(
                source(path),
                Some(std::fs::read_to_string(file).unwrap().as_str()),
                "{path}"
            );
        }
        assert_eq!(sources().len(), files.len());
    }

    #[test]
    fn is_sorted_and_finds_nothing_that_is_not_there() {
        assert!(sources().map(|(path, _)| path).is_sorted());
        assert_eq!(source("no/such/kernel"), None);
        assert_eq!(source(""), None);
    }
}
