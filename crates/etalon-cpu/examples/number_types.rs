//! How long each pass of each effect takes in each number type.
//!
//! `cargo run --release -p etalon-cpu --example number_types -- [ROUNDS [WIDTHxHEIGHT [THREADS]]]`
//!
//! Types take turns; the shortest time of all rounds counts. Beside it is the shortest
//! time in which as many threads copy 128 bytes of each pixel, which is four `f64` read
//! four times; where a kernel that moves more takes no longer in `f64`, it is memory
//! that it waits for.

use std::collections::BTreeMap;
use std::sync::Barrier;
use std::time::{Duration, Instant};

use etalon_core::backend::Backend;
use etalon_core::graph::Graph;
use etalon_core::kernel::Arithmetic;
use etalon_core::plan::{Capture, Plan, PlanOptions};
use etalon_cpu::{CpuBackend, CpuOptions, NumberType, Tier};
use etalon_effects::registry::effects;
use etalon_scenes::{FrameSize, scene};

type Failure = Box<dyn std::error::Error>;

fn main() -> Result<(), Failure> {
    let mut arguments = std::env::args().skip(1);
    let rounds: u32 = arguments.next().map_or(Ok(20), |text| text.parse())?;
    let size = arguments.next().unwrap_or_else(|| "320x180".to_owned());
    let threads: usize = arguments.next().map_or(Ok(1), |text| text.parse())?;
    let (width, height) = size.split_once('x').ok_or("a size is WIDTHxHEIGHT")?;
    let (width, height): (u32, u32) = (width.parse()?, height.parse()?);
    let size = FrameSize::new(width, height)?;
    let frame = scene("wet-floor").ok_or("no scene")?.frame(size)?;
    let kernels = etalon_effects::kernels();
    println!("shortest of {rounds} rounds, microseconds, and ratios to f32");
    let bytes = 128 * (width * height) as usize;
    let time = copying(bytes, threads, rounds);
    println!(
        "copying {bytes} bytes: {:.1} microseconds, {:.1} GB/s read and as many written",
        time.as_secs_f64() * 1e6,
        bytes as f64 / time.as_secs_f64() / 1e9
    );
    for tier in Tier::ALL.into_iter().filter(|tier| tier.is_available()) {
        for arithmetic in [Arithmetic::Strict, Arithmetic::Fast] {
            println!("\n{tier}, {arithmetic:?}");
            for effect in effects().iter().filter(|effect| effect.name != "chain") {
                let mut backends = Vec::new();
                for number_type in NumberType::ALL {
                    backends.push(CpuBackend::new(&CpuOptions {
                        threads,
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

/// The shortest time in which threads copy so many bytes together, from and to what is
/// in no cache.
fn copying(bytes: usize, threads: usize, rounds: u32) -> Duration {
    /// Copied in turns, more than caches hold.
    const PLACES: usize = 8;
    let share = bytes / threads.max(1);
    let mut parts: Vec<(Vec<u8>, Vec<u8>)> = (0..threads.max(1))
        .map(|_| (vec![1; share * PLACES], vec![0; share * PLACES]))
        .collect();
    let mut shortest = Duration::MAX;
    for round in 0..rounds as usize {
        let place = round % PLACES * share;
        let barrier = Barrier::new(parts.len());
        let barrier = &barrier;
        // By the threads' own clocks: whoever waits for them may be woken late.
        let spans: Vec<(Instant, Instant)> = std::thread::scope(|scope| {
            let copies: Vec<_> = parts
                .iter_mut()
                .map(|(from, to)| {
                    scope.spawn(move || {
                        barrier.wait();
                        let start = Instant::now();
                        to[place..place + share].copy_from_slice(&from[place..place + share]);
                        std::hint::black_box(&to);
                        (start, Instant::now())
                    })
                })
                .collect();
            let spans = copies.into_iter().filter_map(|copy| copy.join().ok());
            spans.collect()
        });
        let first = spans.iter().map(|span| span.0).min();
        let last = spans.iter().map(|span| span.1).max();
        let time = match (first, last) {
            (Some(first), Some(last)) => last - first,
            _ => Duration::MAX,
        };
        shortest = shortest.min(time);
    }
    shortest
}
