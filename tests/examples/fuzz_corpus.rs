//! Writes texts for the target `wgsl` to begin with, one per file: to the
//! fuzzer's folder, or the one given.

use std::io;
use std::path::PathBuf;

const FOLDER: &str = concat!(
    env!("CARGO_MANIFEST_DIR"),
    "/../crates/etalon-cpu/fuzz/corpus/wgsl"
);

fn main() -> io::Result<()> {
    let folder = std::env::args_os()
        .nth(1)
        .map_or_else(|| PathBuf::from(FOLDER), PathBuf::from);
    std::fs::create_dir_all(&folder)?;
    for (number, text) in etalon_tests::fuzz::corpus().into_iter().enumerate() {
        std::fs::write(folder.join(format!("{number}.wgsl")), text)?;
    }
    Ok(())
}
