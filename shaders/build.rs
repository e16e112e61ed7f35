//! Writes the table of embedded kernels: every `*.wesl` file below this
//! package, sorted by path, so that adding a kernel means adding a file.

use std::error::Error;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::{env, fs};

fn main() -> Result<(), Box<dyn Error>> {
    // A directory is watched with all it contains, so new and removed files
    // are seen as well as changed ones.
    println!("cargo::rerun-if-changed=.");

    let root = PathBuf::from(env::var("CARGO_MANIFEST_DIR")?);
    let mut kernels = Vec::new();
    find(&root, &root, &mut kernels)?;
    kernels.sort();

    let mut table = String::from("[\n");
    for (path, file) in &kernels {
        writeln!(table, "    ({path:?}, include_str!({file:?})),")?;
    }
    table.push_str("]\n");
    fs::write(Path::new(&env::var("OUT_DIR")?).join("table.rs"), table)?;
    Ok(())
}

/// Collects (path below `root` without extension, absolute file name).
fn find(
    root: &Path,
    folder: &Path,
    kernels: &mut Vec<(String, String)>,
) -> Result<(), Box<dyn Error>> {
    for entry in fs::read_dir(folder)? {
        let path = entry?.path();
        let text = path
            .to_str()
            .ok_or_else(|| format!("{} is not UTF-8", path.display()))?;
        if path.is_dir() {
            let name = path
                .file_name()
                .and_then(|name| name.to_str())
                .unwrap_or_default();
            let code = folder == root && matches!(name, "src" | "target");
            if !code && !name.starts_with('.') {
                find(root, &path, kernels)?;
            }
        } else if path
            .extension()
            .is_some_and(|extension| extension == "wesl")
        {
            let below = path.strip_prefix(root)?.with_extension("");
            let parts: Vec<_> = below.iter().map(|part| part.to_string_lossy()).collect();
            kernels.push((parts.join("/"), text.to_owned()));
        }
    }
    Ok(())
}
