//! `cargo xtask test-programs`: random programs on the interpreter and on
//! every driver, held to what they mean one invocation at a time.

mod execute;

use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::fmt::Write as _;
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};
use std::time::Duration;

use clap::Args;
use etalon_tests::programs::{Program, STEPS, Trial, evaluate, of_seed, shrink, statements};
use thiserror::Error;

use crate::drivers;
use crate::execute::Api;
use crate::execute::outcome::Device;
use crate::test_backends::model::{BackendKind, Executor, Target};
use crate::test_backends::{TestError, executors, supervise};

use execute::{Failure, Fault, Line};
pub use execute::{Job, LinesError, execute};

/// Name of the hidden command that [`execute`] serves.
pub const COMMAND: &str = "execute-programs";

/// Programs that one process tries; devices keep what they compiled.
const SHARE: u64 = 100;

/// Crashes of an executor after which it is given up.
const CRASHES: usize = 10;

/// Most programs tried to make one smaller that crashes its process.
const CRASH_TRIES: usize = 200;

/// Try random compute programs on the interpreter and on every driver.
///
/// Each program is evaluated one invocation at a time; the interpreter on every
/// tier, with 64 and 256 lanes, on one thread and on three, and wgpu and ash on
/// every Vulkan driver have to give the same bits, NaN payloads and subnormal
/// numbers aside. Programs that compute what WGSL leaves open, or that have what
/// naga gets wrong, are tried on the interpreter alone. What differs on a driver
/// that is known to do otherwise what the program does is counted apart; what else
/// goes wrong is made as small as it gets and kept.
/// Exit status 0 means that all required backends ran and nothing went wrong,
/// 1 that something did, 2 that the command line is wrong.
#[derive(Clone, Debug, Args)]
pub struct Options {
    /// How many programs
    #[arg(long, value_name = "N", default_value_t = 500)]
    pub count: u64,
    /// The first program's seed; the others' follow
    #[arg(long, value_name = "SEED", default_value_t = 1)]
    pub seed: u64,
    /// Drivers to use: `all`, or names like `lavapipe,swiftshader`
    #[arg(
        long,
        value_delimiter = ',',
        value_name = "all|NAMES",
        default_value = "all"
    )]
    pub drivers: Vec<String>,
    /// Backends that have to run
    #[arg(
        long,
        value_delimiter = ',',
        value_name = "BACKENDS",
        default_value = "cpu"
    )]
    pub require: Vec<BackendKind>,
    /// The folder where programs that go wrong are kept
    #[arg(long, value_name = "DIR", default_value = "out/programs")]
    pub keep: PathBuf,
    /// Processes at a time [default: as many as there are processors]
    #[arg(long, value_name = "N", default_value_t = 0, hide_default_value = true)]
    pub jobs: usize,
    /// Run ash under the Khronos validation layer, its messages being failures
    #[arg(long)]
    pub validate: bool,
    /// Seconds after which a process counts as crashed
    #[arg(long, value_name = "SECONDS", default_value_t = 900)]
    pub timeout: u64,
    /// Plant a fault into what one executor gets, as `ash/lavapipe:v1 + =>v1 - `,
    /// to see it found
    #[arg(long, value_name = "EXECUTOR:FROM=>TO", hide = true, value_parser = planted)]
    pub plant: Option<(String, Fault)>,
}

/// Reads `EXECUTOR:FROM=>TO`.
fn planted(text: &str) -> Result<(String, Fault), String> {
    let (executor, fault) = text.split_once(':').ok_or("as in EXECUTOR:FROM=>TO")?;
    Ok((executor.to_owned(), fault.parse()?))
}

/// Why there is no report.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum ProgramsError {
    /// A driver that is not there.
    #[error(transparent)]
    Drivers(#[from] TestError),
    /// A file cannot be written.
    #[error("{}: {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// Why.
        source: io::Error,
    },
}

/// Programs for one process.
#[derive(Clone, Copy, Debug)]
struct Task {
    executor: usize,
    seed: u64,
    count: u64,
}

/// How an executor did.
#[derive(Debug, Default)]
struct Account {
    device: Option<Device>,
    absent: Option<String>,
    agreed: u64,
    open: u64,
    /// Gave something else, as the driver is known to do at times.
    known: u64,
    /// By seed.
    failures: BTreeMap<u64, Failure>,
    crashes: usize,
    /// What went wrong with processes rather than programs.
    problems: BTreeSet<String>,
}

/// Runs the command and says whether all is well. `program` is this program
/// itself, for its hidden command.
///
/// # Errors
/// If no report could be made; what goes wrong with programs is in the report.
pub fn run(options: &Options, program: &Path) -> Result<bool, ProgramsError> {
    let found = drivers::find(&drivers::Environment::of_process());
    // OpenGL does not promise not to contract `a * b + c`.
    let mut asked = executors(&found.drivers, &options.drivers)?;
    asked.retain(|executor| executor.target != Target::Gl);
    let mut tasks = VecDeque::new();
    let mut done = 0;
    while done < options.count {
        let count = SHARE.min(options.count - done);
        for executor in 0..asked.len() {
            let seed = options.seed.wrapping_add(done);
            tasks.push_back(Task {
                executor,
                seed,
                count,
            });
        }
        done += count;
    }
    let accounts = asked.iter().map(|_| Account::default()).collect();
    let bench = Bench {
        options,
        program,
        executors: asked,
        tasks: Mutex::new(tasks),
        accounts: Mutex::new(accounts),
    };
    let jobs = match options.jobs {
        0 => std::thread::available_parallelism().map_or(1, usize::from),
        jobs => jobs,
    };
    std::thread::scope(|scope| {
        for _ in 0..jobs {
            scope.spawn(|| bench.work());
        }
    });
    let Bench {
        executors,
        accounts,
        ..
    } = bench;
    let accounts = accounts
        .into_inner()
        .unwrap_or_else(PoisonError::into_inner);
    keep(options, &executors, &accounts)?;
    let (text, ok) = report(options, &executors, &accounts);
    match io::stdout().lock().write_all(text.as_bytes()) {
        // Whoever reads may have read enough.
        Err(source) if source.kind() != io::ErrorKind::BrokenPipe => Err(ProgramsError::Io {
            path: "standard output".into(),
            source,
        }),
        _ => Ok(ok),
    }
}

/// A command under way.
struct Bench<'a> {
    options: &'a Options,
    program: &'a Path,
    executors: Vec<Executor>,
    tasks: Mutex<VecDeque<Task>>,
    accounts: Mutex<Vec<Account>>,
}

impl Bench<'_> {
    /// Changes an executor's account.
    fn account<R>(&self, executor: usize, change: impl FnOnce(&mut Account) -> R) -> R {
        let mut accounts = self.accounts.lock().unwrap_or_else(PoisonError::into_inner);
        change(&mut accounts[executor])
    }

    /// Takes tasks until there are none.
    fn work(&self) {
        loop {
            let task = {
                let mut tasks = self.tasks.lock().unwrap_or_else(PoisonError::into_inner);
                tasks.pop_front()
            };
            let Some(task) = task else { return };
            let given_up = self.account(task.executor, |account| {
                account.absent.is_some() || account.crashes >= CRASHES
            });
            if given_up {
                continue;
            }
            match tempfile::tempdir() {
                Ok(folder) => self.carry_out(task, folder.path()),
                Err(error) => self.problem(task.executor, format!("no folder: {error}")),
            }
        }
    }

    fn problem(&self, executor: usize, text: String) {
        self.account(executor, |account| account.problems.insert(text));
    }

    fn job(&self, executor: usize, folder: &Path) -> Job {
        let Executor { id, backend, .. } = &self.executors[executor];
        let plant = self.options.plant.as_ref();
        Job {
            backend: *backend,
            api: Api::Vulkan,
            validate: self.options.validate,
            seed: 0,
            count: 0,
            kept: None,
            plant: plant
                .filter(|(name, _)| name == id)
                .map(|(_, fault)| fault.clone()),
            out: folder.to_owned(),
        }
    }

    /// Runs a job in a process of its own.
    fn process(&self, executor: usize, job: &Job, folder: &Path) -> Result<(), String> {
        supervise::to_the_end(
            self.program,
            COMMAND,
            &job.arguments(),
            &self.executors[executor].target,
            Duration::from_secs(self.options.timeout),
            &folder.join("stderr.txt"),
        )
    }

    fn carry_out(&self, task: Task, folder: &Path) {
        let Task {
            executor,
            seed,
            count,
        } = task;
        let job = Job {
            seed,
            count,
            ..self.job(executor, folder)
        };
        let end = self.process(executor, &job, folder);
        let lines = match Line::read(folder) {
            Ok(lines) => lines,
            Err(error) => {
                let end = end.err().unwrap_or_else(|| error.to_string());
                return self.problem(executor, end);
            }
        };
        let mut running = None;
        self.account(executor, |account| {
            for line in lines {
                match line {
                    Line::Device(device) => account.device = Some(device),
                    Line::NoDevice { reason } => account.absent = Some(reason),
                    Line::Started { seed } => running = Some(seed),
                    Line::Agreed { .. } => account.agreed += 1,
                    Line::Open { .. } => account.open += 1,
                    Line::Known { .. } => account.known += 1,
                    Line::Failed(failure) => {
                        account.failures.insert(failure.seed, failure);
                    }
                }
            }
        });
        let Err(end) = end else { return };
        let Some(crashed) = running else {
            return self.problem(executor, end);
        };
        let failure = self.crash(executor, crashed, end, folder);
        self.account(executor, |account| {
            account.crashes += 1;
            account.failures.entry(crashed).or_insert(failure);
        });
        let done = crashed.wrapping_sub(seed) + 1;
        if done < count {
            let mut tasks = self.tasks.lock().unwrap_or_else(PoisonError::into_inner);
            tasks.push_front(Task {
                executor,
                seed: crashed.wrapping_add(1),
                count: count - done,
            });
        }
    }

    /// A program that takes its process along, made smaller in processes of
    /// their own.
    fn crash(&self, executor: usize, seed: u64, end: String, folder: &Path) -> Failure {
        let (program, evaluation) = of_seed(seed);
        let whole = Trial::new(&program, &evaluation.results);
        let kept = folder.join("candidate.wgsl");
        let job = Job {
            kept: Some(kept.clone()),
            ..self.job(executor, folder)
        };
        let crashes = |trial: &Trial| {
            std::fs::write(&kept, trial.to_string()).is_ok()
                && self.process(executor, &job, folder).is_err()
        };
        let of = |less: &Program| {
            let evaluation = evaluate(less, STEPS).ok()?;
            Some(Trial::new(less, &evaluation.results))
        };
        let less = shrink(&program, CRASH_TRIES, |less| {
            of(less).is_some_and(|trial| crashes(&trial))
        });
        let left = of(&less.program).unwrap_or_else(|| whole.clone());
        Failure {
            seed,
            reasons: vec![end],
            text: left.to_string(),
            statements: statements(&less.program),
            whole: whole.to_string(),
            tried: less.tried,
        }
    }
}

/// Keeps what went wrong: the program that is left, and the whole one.
fn keep(
    options: &Options,
    executors: &[Executor],
    accounts: &[Account],
) -> Result<(), ProgramsError> {
    for (executor, account) in executors.iter().zip(accounts) {
        for failure in account.failures.values() {
            std::fs::create_dir_all(&options.keep).map_err(|source| ProgramsError::Io {
                path: options.keep.clone(),
                source,
            })?;
            let name = format!("{}-{}", failure.seed, executor.id.replace('/', "-"));
            let mut heading = format!("// Seed {}, {}", failure.seed, executor.id);
            if let Some(device) = &account.device {
                let _ = write!(heading, " ({}, {})", device.device, device.driver);
            }
            heading.push('\n');
            for reason in failure.reasons.iter().flat_map(|reason| reason.lines()) {
                let _ = writeln!(heading, "// {reason}");
            }
            for (ending, text) in [("", &failure.text), ("-whole", &failure.whole)] {
                let path = options.keep.join(format!("{name}{ending}.wgsl"));
                std::fs::write(&path, format!("{heading}{text}"))
                    .map_err(|source| ProgramsError::Io { path, source })?;
            }
        }
    }
    Ok(())
}

/// The report, and whether all is well.
fn report(options: &Options, executors: &[Executor], accounts: &[Account]) -> (String, bool) {
    let mut text = format!("{} programs from seed {}\n", options.count, options.seed);
    let mut problems = Vec::new();
    for (executor, account) in executors.iter().zip(accounts) {
        let id = &executor.id;
        let _ = match (&account.absent, &account.device) {
            (Some(reason), _) => writeln!(text, "  {id}: no device: {reason}"),
            (None, device) => writeln!(
                text,
                "  {id}: {} agreed, {} left out, {} known to differ, {} failed ({})",
                account.agreed,
                account.open,
                account.known,
                account.failures.len(),
                device.as_ref().map_or_else(
                    || "never ran".to_owned(),
                    |device| format!("{}, {}, {}", device.device, device.api, device.driver)
                ),
            ),
        };
        problems.extend(account.problems.iter().map(|text| format!("{id}: {text}")));
        if account.crashes >= CRASHES {
            problems.push(format!("{id}: given up after {CRASHES} crashes"));
        }
        for failure in account.failures.values() {
            problems.push(format!(
                "{id}, seed {}, {} statements left after {} tries: {}",
                failure.seed,
                failure.statements,
                failure.tried,
                failure.reasons.first().map_or("", String::as_str)
            ));
        }
    }
    for required in &options.require {
        let ran = executors
            .iter()
            .zip(accounts)
            .any(|(executor, account)| executor.backend == *required && account.agreed > 0);
        if !ran {
            problems.push(format!("{required} is required and ran no program"));
        }
    }
    if problems.is_empty() {
        text.push_str("OK: what ran agrees.\n");
    } else {
        text.push_str("NOT OK\n");
        for problem in &problems {
            let _ = writeln!(text, "  {}", problem.trim_end().replace('\n', "\n    "));
        }
        if accounts.iter().any(|account| !account.failures.is_empty()) {
            let _ = writeln!(text, "Kept in {}", options.keep.display());
        }
    }
    (text, problems.is_empty())
}
