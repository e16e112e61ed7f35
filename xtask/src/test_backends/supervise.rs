//! Runs jobs in processes of their own and finds out how they ended.

use std::ffi::OsString;
use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom};
use std::path::Path;
use std::process::{Command, ExitStatus, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant};

use super::model::{Status, Target};
use crate::execute::Job;
use crate::execute::outcome::{Outcome, Run};

/// Name of the hidden command that [`execute::run`](crate::execute::run) serves.
pub const COMMAND: &str = "execute";

/// Variables that choose Vulkan drivers; the second is the older name of the
/// first.
const DRIVER_VARIABLES: [&str; 2] = ["VK_DRIVER_FILES", "VK_ICD_FILENAMES"];

/// Runs a job on a target by starting `program` with the hidden command. Gives
/// its status and, if it completed, its result, whose texels lie in `job.out`.
///
/// A job that takes longer than `limit` is ended and counts as crashed.
#[must_use]
pub(super) fn run(
    program: &Path,
    job: &Job,
    target: &Target,
    limit: Duration,
) -> (Status, Option<Run>) {
    let log = job.out.join("stderr.txt");
    let crashed = |reason: String| (Status::Crashed { reason }, None);
    if let Err(reason) = to_the_end(program, COMMAND, &job.arguments(), target, limit, &log) {
        return crashed(reason);
    }
    match Outcome::read(&job.out) {
        Ok(Outcome::Ran(run)) => (
            Status::Ran {
                device: run.device.clone(),
                times: run.times.clone(),
                findings: run.findings.clone(),
            },
            Some(run),
        ),
        Ok(Outcome::NoDevice { reason }) => (Status::NoDevice { reason }, None),
        Ok(Outcome::Unsupported { reason }) => (Status::Unsupported { reason }, None),
        Ok(Outcome::Failed { reason }) => (Status::Failed { reason }, None),
        Err(error) => crashed(with_words(error.to_string(), &last_words(&log))),
    }
}

/// Runs a hidden command of `program` on a target, its standard error going to
/// `log`, and waits for it.
///
/// # Errors
/// How it ended, with the last words of the log, if it did not end well within
/// `limit`.
pub(crate) fn to_the_end(
    program: &Path,
    command: &str,
    arguments: &[OsString],
    target: &Target,
    limit: Duration,
    log: &Path,
) -> Result<(), String> {
    let end = match start_and_wait(program, command, arguments, target, limit, log) {
        Ok(End::Exited(status)) if status.success() => return Ok(()),
        Ok(End::Exited(status)) => status.to_string(),
        Ok(End::TooLong) => format!("no end after {} s", limit.as_secs()),
        Err(error) => return Err(format!("{}: {error}", program.display())),
    };
    Err(with_words(end, &last_words(log)))
}

/// How a process ended.
enum End {
    Exited(ExitStatus),
    TooLong,
}

fn start_and_wait(
    program: &Path,
    name: &str,
    arguments: &[OsString],
    target: &Target,
    limit: Duration,
    log: &Path,
) -> io::Result<End> {
    let mut command = Command::new(program);
    command
        .arg(name)
        .args(arguments)
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(File::create(log)?);
    if let Target::Vulkan(driver) = target {
        for variable in DRIVER_VARIABLES {
            command.env(variable, &driver.manifest);
        }
    }
    let mut child = command.spawn()?;
    let start = Instant::now();
    loop {
        if let Some(status) = child.try_wait()? {
            return Ok(End::Exited(status));
        }
        if start.elapsed() > limit {
            child.kill()?;
            child.wait()?;
            return Ok(End::TooLong);
        }
        sleep(Duration::from_millis(5));
    }
}

/// A description of an end with what was said before it.
fn with_words(end: String, said: &str) -> String {
    if said.is_empty() {
        format!("{end}, without a message")
    } else {
        format!("{end}; it wrote:\n{said}")
    }
}

/// The end of a log.
fn last_words(log: &Path) -> String {
    /// Enough for a panic message and a short back trace.
    const LENGTH: u64 = 2000;
    let read = || -> io::Result<Vec<u8>> {
        let mut file = File::open(log)?;
        let length = file.metadata()?.len();
        file.seek(SeekFrom::Start(length.saturating_sub(LENGTH)))?;
        let mut bytes = Vec::new();
        file.read_to_end(&mut bytes)?;
        Ok(bytes)
    };
    read()
        .map(|bytes| String::from_utf8_lossy(&bytes).trim().to_owned())
        .unwrap_or_default()
}

#[cfg(all(test, unix))]
mod tests {
    use std::os::unix::fs::PermissionsExt;

    use super::*;
    use crate::execute::{Api, ArithmeticName};
    use crate::size::Size;
    use crate::test_backends::model::BackendKind;

    /// Runs a shell script in place of this program.
    fn run_script(script: &str, limit: Duration) -> (Status, Option<Run>) {
        let folder = tempfile::tempdir().unwrap();
        let program = folder.path().join("program");
        std::fs::write(&program, format!("#!/bin/sh\n{script}\n")).unwrap();
        std::fs::set_permissions(&program, std::fs::Permissions::from_mode(0o755)).unwrap();
        let out = folder.path().join("out");
        std::fs::create_dir(&out).unwrap();
        let job = Job {
            backend: BackendKind::Ash,
            api: Api::Vulkan,
            scene: Some("wet-floor".into()),
            input: None,
            size: Size {
                width: 4,
                height: 2,
            },
            effect: "chain".into(),
            arithmetic: ArithmeticName::Strict,
            frames: 1,
            threads: 0,
            validate: true,
            checks: true,
            spread: true,
            plant: None,
            out,
        };
        let driver = crate::drivers::Driver {
            name: "test".into(),
            manifest: "/icd/test.json".into(),
            library: "libtest.so".into(),
        };
        run(&program, &job, &Target::Vulkan(driver), limit)
    }

    const LONG: Duration = Duration::from_secs(60);

    fn crash(script: &str, limit: Duration) -> String {
        match run_script(script, limit) {
            (Status::Crashed { reason }, None) => reason,
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn crashes_are_reported_with_the_last_words() {
        let reason = crash("echo 'driver says no' >&2; kill -SEGV $$", LONG);
        assert!(
            reason.contains("signal: 11") && reason.contains("driver says no"),
            "{reason}"
        );
        assert!(crash("exit 3", LONG).contains("exit status: 3, without a message"));
        assert!(crash("exit 0", LONG).contains("outcome.json"));
        assert!(
            crash("echo start >&2; exec sleep 60", Duration::from_millis(300))
                .contains("no end after 0 s; it wrote:\nstart")
        );
        // Only the end of a long story.
        let reason = crash(
            "i=0; while [ $i -lt 2000 ]; do echo line $i; i=$((i+1)); done >&2; exit 1",
            LONG,
        );
        assert!(
            reason.len() < 2200 && reason.ends_with("line 1999"),
            "{reason}"
        );
    }

    #[test]
    fn the_driver_and_the_job_reach_the_process() {
        let script = r#"while [ "$1" != --out ]; do all="$all $1"; shift; done; all="$all $3 $4"
            printf '{"status": "no-device", "reason": "%s|%s|%s"}' "$all" "$VK_DRIVER_FILES" "$VK_ICD_FILENAMES" > "$2/outcome.json""#;
        let (status, run) = run_script(script, LONG);
        assert!(run.is_none());
        let Status::NoDevice { reason } = status else {
            panic!("{status:?}")
        };
        assert_eq!(
            reason,
            " execute --backend ash --api vulkan --scene wet-floor --size 4x2 --effect chain --arithmetic strict \
             --frames 1 --threads 0 --validate --checks|/icd/test.json|/icd/test.json"
        );
    }
}
