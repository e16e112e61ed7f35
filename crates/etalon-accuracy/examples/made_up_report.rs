//! Writes a report of made-up numbers, to work on the page:
//! `cargo run -p etalon-accuracy --example made_up_report -- FOLDER`.

use std::path::PathBuf;

use etalon_accuracy::chart::{Chart, Place};
use etalon_accuracy::report;

#[path = "../tests/suite/made_up/mod.rs"]
mod made_up;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let folder = std::env::args_os().nth(1).ok_or("where should it go?")?;
    let folder = PathBuf::from(folder);
    let sweep = made_up::sweep();
    let page = report::write(&sweep, &folder)?;
    made_up::draw(&sweep, &folder);
    let subject = &sweep.subjects[0];
    let chart = Chart::of(subject, &subject.metrics[1], &sweep.executors[2]);
    std::fs::write(folder.join("chart.svg"), chart.svg(Place::Alone))?;
    println!("{}", page.display());
    Ok(())
}
