//! What searches along mirror rays cost for the places they find, and what a pyramid costs
//! that one of them goes over.
//!
//! ```text
//! cargo run --release -p etalon-accuracy --example searches -- 1280x720 wet-floor
//! ```

use std::error::Error;

use etalon_accuracy::executors::{Executor, Kind};
use etalon_accuracy::metric::hits::hits as compare;
use etalon_accuracy::{text, work};
use etalon_core::graph::{Graph, Texture};
use etalon_core::kernel::{Arithmetic, KernelLibrary};
use etalon_core::plan::Capture;
use etalon_effects::hiz::{Build, pyramid};
use etalon_effects::ssr::truth::hits;
use etalon_effects::ssr::{Search, Ssr, march};
use etalon_effects::truth::Plane;
use etalon_effects::{EffectError, SceneInputs};
use etalon_scenes::{Frame, FrameSize, scene};

/// Executors that are timed.
const EXECUTORS: [Kind; 2] = [Kind::Cpu, Kind::Ash];

/// Frames that are timed, one more being run before.
const ROUNDS: usize = 3;

type Declare = Box<dyn Fn(&mut Graph, &SceneInputs) -> Result<Texture, EffectError>>;

/// A thing to be measured.
struct Subject {
    name: String,
    declare: Declare,
    /// Milliseconds in each round, by executor.
    times: Vec<Vec<f64>>,
}

impl Subject {
    fn new(name: String, declare: Declare) -> Self {
        Self {
            name,
            declare,
            times: vec![Vec::new(); EXECUTORS.len()],
        }
    }

    fn graph(&self, frame: &Frame) -> Result<Graph, Box<dyn Error>> {
        let mut graph = Graph::new();
        let inputs = frame.import(&mut graph, 1.0 / 60.0)?;
        let result = (self.declare)(&mut graph, &inputs)?;
        graph.output("result", result)?;
        Ok(graph)
    }

    /// The median in milliseconds and its quartiles.
    fn time(&self, executor: usize) -> String {
        let mut times = self.times[executor].clone();
        times.sort_by(f64::total_cmp);
        let at = |share: f64| times[((times.len() - 1) as f64 * share) as usize];
        format!("{:.2} ({:.2}–{:.2})", at(0.5), at(0.25), at(0.75))
    }
}

/// Times all of them in turns, another one first in each round.
fn time(
    subjects: &mut [Subject],
    frame: &Frame,
    kernels: &KernelLibrary,
) -> Result<(), Box<dyn Error>> {
    for (number, kind) in EXECUTORS.into_iter().enumerate() {
        let mut executor = Executor::open(kind)?;
        let mut plans = Vec::new();
        for subject in subjects.iter() {
            let graph = subject.graph(frame)?;
            plans.push(executor.plan(&graph, kernels, Arithmetic::Strict, Capture::None)?);
        }
        for round in 0..=ROUNDS {
            for turn in 0..plans.len() {
                let index = (round + turn) % plans.len();
                let spent = executor.time(&plans[index], &frame.inputs())?;
                if round > 0 {
                    let spent = spent.ok_or("the device cannot tell the time")?;
                    subjects[index].times[number].push(spent * 1e-6);
                }
            }
        }
    }
    Ok(())
}

fn searching(search: Search, resolution: f32, steps: u32) -> Subject {
    let settings = Ssr {
        search,
        resolution,
        steps,
        ..Ssr::default()
    };
    let name = match search {
        Search::Linear => format!("linear, {resolution}"),
        Search::Refined => format!("refined, {resolution}, {steps} halvings"),
        Search::Dda => format!("dda, {resolution}"),
        Search::HiZ => "hi-z".to_owned(),
    };
    let declare = move |graph: &mut Graph, inputs: &SceneInputs| {
        march(
            graph,
            inputs.depth,
            inputs.normal,
            &inputs.camera,
            &settings,
        )
    };
    Subject::new(name, Box::new(declare))
}

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let size = arguments.next().unwrap_or_else(|| "1280x720".to_owned());
    let name = arguments.next().unwrap_or_else(|| "wet-floor".to_owned());
    let size: FrameSize = text::size(&size)?;
    let frame = scene(&name).ok_or("there is no such scene")?.frame(size)?;
    let kernels = etalon_effects::kernels();
    let extent = [size.width(), size.height()];

    let mut builds: Vec<Subject> = [
        ("per level", Build::PerLevel),
        ("single pass", Build::SinglePass),
    ]
    .into_iter()
    .map(|(name, build)| {
        let declare = move |graph: &mut Graph, inputs: &SceneInputs| {
            Ok(pyramid(graph, inputs.depth, &inputs.camera, build)?.texture)
        };
        Subject::new(name.to_owned(), Box::new(declare))
    })
    .collect();
    let plane = |image| Plane::of(image);
    let truth = hits(
        &plane(&frame.depth)?,
        &plane(&frame.normal)?,
        &frame.camera_params(),
        &Ssr::default(),
    )?;
    let truth: Vec<Option<[f64; 2]>> = truth
        .iter()
        .map(|hit| Some(hit.as_ref()?.uv.to_array()))
        .collect();
    let mut subjects = vec![searching(Search::HiZ, 1.0, 0)];
    subjects.push(searching(Search::Linear, 1.0, 0));
    for steps in [5, 12] {
        subjects.push(searching(Search::Refined, 1.0, steps));
    }
    for resolution in [1.0, 0.5] {
        subjects.push(searching(Search::Dda, resolution, 0));
    }
    println!("\nMarch, with its pyramid where it has one:\n");
    println!(
        "| search | texel fetches, 10⁶ | hit, median px | hit, 95 % px | recall | to a pixel |"
    );
    println!("|---|---|---|---|---|---|");
    let mut cpu = Executor::open(Kind::Cpu)?;
    for subject in &subjects {
        let graph = subject.graph(&frame)?;
        let plan = cpu.plan(&graph, &kernels, Arithmetic::Strict, Capture::Outputs)?;
        let run = cpu.backend().execute(&plan, &frame.inputs())?;
        let result = run.output("result").ok_or("not captured")?.to_rgba_f32()?;
        let places: Vec<Option<[f64; 2]>> = result
            .iter()
            .map(|&[u, v, _, length]| (length > 0.0).then_some([u.into(), v.into()]))
            .collect();
        let found = compare(&places, &truth, extent)?;
        let distance = found.all.distance.ok_or("nothing was hit")?;
        let work = work::count(&plan, &frame.inputs())?;
        println!(
            "| {} | {:.2} | {:.4} | {:.3} | {:.4} | {:.4} |",
            subject.name,
            work.texel_fetches as f64 * 1e-6,
            distance.median,
            distance.p95,
            found.all.recall().unwrap_or(0.0),
            found.all.located().unwrap_or(0.0),
        );
    }
    time(&mut subjects, &frame, &kernels)?;
    println!("\n| search | cpu, ms | ash, ms |\n|---|---|---|");
    for subject in &subjects {
        println!(
            "| {} | {} | {} |",
            subject.name,
            subject.time(0),
            subject.time(1)
        );
    }
    time(&mut builds, &frame, &kernels)?;
    println!("\nPyramid of {name} at {}×{}, ms:\n", extent[0], extent[1]);
    println!("| | cpu | ash |\n|---|---|---|");
    for build in &builds {
        let times = [0, 1].map(|executor| build.time(executor));
        println!("| {} | {} |", build.name, times.join(" | "));
    }
    Ok(())
}
