//! How long each pass of each effect takes in each number type.
//!
//! `cargo run --release -p etalon-cpu --example number_types -- [ROUNDS [WIDTHxHEIGHT]]`
//!
//! Types take turns, on one thread; the shortest time of all rounds counts.

use std::collections::BTreeMap;

use etalon_core::backend::Backend;
use etalon_core::graph::Graph;
use etalon_core::kernel::{Arithmetic, KernelLibrary};
use etalon_core::plan::{Capture, Plan, PlanOptions};
use etalon_cpu::{CpuBackend, CpuOptions, NumberType, Tier};
use etalon_effects::registry::effects;
use etalon_scenes::{FrameSize, scene};

type Failure = Box<dyn std::error::Error>;

fn main() -> Result<(), Failure> {
    let mut arguments = std::env::args().skip(1);
    let rounds: u32 = arguments.next().map_or(Ok(20), |text| text.parse())?;
    let size = arguments.next().unwrap_or_else(|| "320x180".to_owned());
    let (width, height) = size.split_once('x').ok_or("a size is WIDTHxHEIGHT")?;
    let size = FrameSize::new(width.parse()?, height.parse()?)?;
    let frame = scene("wet-floor").ok_or("no scene")?.frame(size)?;
    let kernels = KernelLibrary::new();
    println!("shortest of {rounds} rounds, microseconds, and ratios to f32");
    for tier in Tier::ALL.into_iter().filter(|tier| tier.is_available()) {
        for arithmetic in [Arithmetic::Strict, Arithmetic::Fast] {
            println!("\n{tier}, {arithmetic:?}");
            for effect in effects().iter().filter(|effect| effect.name != "chain") {
                let mut backends = Vec::new();
                for number_type in NumberType::ALL {
                    backends.push(CpuBackend::new(&CpuOptions {
                        threads: 1,
                        tier: Some(tier),
                        number_type,
                        ..CpuOptions::default()
                    })?);
                }
                let mut graph = Graph::new();
                let inputs = frame.import(&mut graph, 1.0 / 60.0)?;
                let result = effect.build(&mut graph, &inputs)?;
                graph.output("result", result)?;
                let options = PlanOptions {
                    arithmetic,
                    limits: backends[0].limits(),
                    capture: Capture::None,
                    memory: backends[0].memory(),
                };
                let plan = Plan::new(&graph, &kernels, &options)?;
                let mut shortest: BTreeMap<String, [u64; 3]> = BTreeMap::new();
                for _ in 0..rounds {
                    for (i, backend) in backends.iter_mut().enumerate() {
                        for time in backend.execute(&plan, &frame.inputs())?.times {
                            let times = shortest.entry(time.step).or_insert([u64::MAX; 3]);
                            times[i] = times[i].min(time.nanoseconds);
                        }
                    }
                }
                for (step, times) in shortest {
                    let [single, double, shadow] = times.map(|time| time as f64 / 1000.0);
                    println!(
                        "{step:32} {single:9.1} {double:9.1} {shadow:9.1}  {:5.2} {:5.2}",
                        double / single,
                        shadow / single
                    );
                }
            }
        }
    }
    Ok(())
}
