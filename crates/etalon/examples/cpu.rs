//! Renders a scene with every effect on the CPU and writes the picture:
//!
//! ```sh
//! cargo run --example cpu -- wet-floor picture.png
//! ```

use std::path::Path;

use etalon::backend::Backend;
use etalon::cpu::{CpuBackend, CpuOptions};
use etalon::effects::{ChainSettings, chain};
use etalon::graph::Graph;
use etalon::plan::{Capture, Plan, PlanOptions};
use etalon_scenes::picture::{Look, write_png};
use etalon_scenes::{FrameSize, scene};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut arguments = std::env::args().skip(1);
    let name = arguments.next().unwrap_or_else(|| "wet-floor".to_owned());
    let path = arguments.next().unwrap_or_else(|| "picture.png".to_owned());
    let scene = scene(&name).ok_or_else(|| format!("there is no scene `{name}`"))?;
    let frame = scene.frame(FrameSize::new(1280, 720)?)?;

    let mut graph = Graph::new();
    let inputs = frame.import(&mut graph, 1.0 / 60.0)?;
    let result = chain(&mut graph, &inputs, &ChainSettings::full())?;
    graph.output("picture", result.picture)?;

    let mut cpu = CpuBackend::new(&CpuOptions::default())?;
    let options = PlanOptions {
        limits: cpu.limits(),
        capture: Capture::Outputs,
        ..PlanOptions::default()
    };
    let plan = Plan::new(&graph, &etalon::effects::kernels(), &options)?;
    print!("{plan}");

    let execution = cpu.execute(&plan, &frame.inputs())?;
    let picture = execution
        .output("picture")
        .ok_or("the picture was captured")?;
    write_png(picture, Look::Plain, Path::new(&path))?;
    println!("wrote {path}");
    Ok(())
}
