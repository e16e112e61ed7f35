//! Each kernel of each effect alone, at 1280×720, on every tier of the
//! interpreter and on a Vulkan device.
//!
//! Times are those of the dispatches by the device's own clock, without
//! uploads. Criterion measures one executor after the other; where a machine
//! does other things meanwhile, `cargo xtask bench-kernels` compares better,
//! round by round.

use std::time::Duration;

use criterion::{BenchmarkId, Criterion, criterion_group, criterion_main};
use etalon::ash::{AshBackend, AshOptions};
use etalon::backend::Backend;
use etalon::cpu::Tier;
use etalon::kernel::Arithmetic;
use etalon_measure::compare::interpreter;
use etalon_measure::subjects::{Size, frame, subjects};
use etalon_measure::work::Work;

/// The time of the dispatches of so many repetitions.
fn time(backend: &mut dyn Backend, work: &Work, repetitions: u64) -> Duration {
    /// Of one execution: more takes longer to upload than it is worth.
    const MOST: u64 = 64;
    let mut nanoseconds = 0;
    let mut left = repetitions;
    while left > 0 {
        let now = left.min(MOST);
        left -= now;
        // At most 64.
        let plan = work.repeated(now as usize);
        let execution = backend.execute(&plan, &work.inputs()).expect("a run");
        let times = execution.times.iter().map(|step| step.nanoseconds);
        nanoseconds += times.sum::<u64>();
    }
    Duration::from_nanos(nanoseconds)
}

fn kernels(criterion: &mut Criterion) {
    let mut executors: Vec<(String, Box<dyn Backend>)> = Vec::new();
    match AshBackend::new(AshOptions::default()) {
        Ok(backend) => executors.push((backend.info().device, Box::new(backend))),
        Err(error) => eprintln!("without a Vulkan device: {error}"),
    }
    for tier in Tier::ALL.into_iter().filter(|tier| tier.is_available()) {
        let backend = interpreter(Some(tier), 0).expect("threads");
        executors.push((tier.to_string(), Box::new(backend)));
    }
    let mut prober = interpreter(None, 0).expect("threads");
    let size = Size {
        width: 1280,
        height: 720,
    };
    let frame = frame(size).expect("a possible size");
    for arithmetic in [Arithmetic::Strict, Arithmetic::Fast] {
        let subjects = subjects().into_iter();
        for subject in subjects.filter(|subject| subject.has(arithmetic)) {
            let works = subject
                .works(&frame, arithmetic, &mut prober)
                .expect("default settings");
            for work in works {
                let name = format!("{} {arithmetic}", work.kernel);
                let mut group = criterion.benchmark_group(name);
                group.sample_size(10);
                for (name, backend) in &mut executors {
                    group.bench_function(BenchmarkId::from_parameter(name), |bencher| {
                        bencher
                            .iter_custom(|repetitions| time(backend.as_mut(), &work, repetitions));
                    });
                }
                group.finish();
            }
        }
    }
}

criterion_group!(benches, kernels);
criterion_main!(benches);
