//! Writes texts for the target `wgsl` to begin with, one per file, to a folder.

use std::io;
use std::path::PathBuf;

fn main() -> io::Result<()> {
    let folder = std::env::args_os()
        .nth(1)
        .map_or_else(|| PathBuf::from("corpus/wgsl"), PathBuf::from);
    std::fs::create_dir_all(&folder)?;
    for (number, text) in etalon_tests::fuzz::corpus().into_iter().enumerate() {
        std::fs::write(folder.join(format!("{number}.wgsl")), text)?;
    }
    Ok(())
}
