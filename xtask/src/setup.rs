//! Installs what the comparison needs on systems of the Debian family.

use std::fmt;
use std::io;
use std::process::{Command, ExitStatus};

use thiserror::Error;

/// The packages, and what each brings.
pub const PACKAGES: [(&str, &str); 5] = [
    ("libvulkan1", "the Vulkan loader"),
    (
        "mesa-vulkan-drivers",
        "lavapipe, Vulkan on the processor, and drivers for AMD and Intel GPUs",
    ),
    (
        "vulkan-validationlayers",
        "the checks that the ash backend's tests run under",
    ),
    ("spirv-tools", "spirv-val, which checks generated SPIR-V"),
    ("chromium", "SwiftShader, a second Vulkan on the processor"),
];

/// Why nothing, or not everything, was installed.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum SetupError {
    /// Not of the Debian family.
    #[error(
        "there is no apt-get here, so this is no system of the Debian family; install a Vulkan loader and a driver \
         by its own means (Mesa's lavapipe runs on any processor)"
    )]
    NoAptGet,
    /// A command could not be started.
    #[error("`{command}` cannot be run: {source}")]
    Start {
        /// As a user would type it.
        command: String,
        /// Why.
        source: io::Error,
    },
    /// A command failed.
    #[error("`{command}` failed: {status}")]
    Failed {
        /// As a user would type it.
        command: String,
        /// How.
        status: ExitStatus,
    },
}

/// The command that installs a Vulkan driver, for messages.
#[must_use]
pub fn hint() -> String {
    "cargo xtask test-backends --setup   (or: sudo apt-get install mesa-vulkan-drivers libvulkan1)"
        .to_owned()
}

/// A command as data, so that it can be shown before it runs.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Invocation {
    program: String,
    arguments: Vec<String>,
}

impl fmt::Display for Invocation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.program)?;
        self.arguments
            .iter()
            .try_for_each(|argument| write!(f, " {argument}"))
    }
}

/// The commands that install everything: as they are for root, else by `sudo`.
#[must_use]
pub fn invocations(root: bool) -> Vec<Invocation> {
    let packages: Vec<&str> = PACKAGES.iter().map(|(name, _)| *name).collect();
    let install = [
        "install",
        "--yes",
        "--no-upgrade",
        "--no-install-recommends",
    ]
    .into_iter()
    .chain(packages)
    .collect();
    [vec!["update"], install]
        .into_iter()
        .map(|arguments: Vec<&str>| {
            let words = ["apt-get"].into_iter().chain(arguments).map(str::to_owned);
            let mut words = if root {
                words.collect::<Vec<_>>()
            } else {
                ["sudo".to_owned()].into_iter().chain(words).collect()
            };
            let program = words.remove(0);
            Invocation {
                program,
                arguments: words,
            }
        })
        .collect()
}

/// Installs the packages, saying what it does. Output of the commands goes to
/// standard error, where progress belongs.
///
/// # Errors
/// If this is no Debian-like system or a command fails.
pub fn run() -> Result<(), SetupError> {
    if Command::new("apt-get").arg("--version").output().is_err() {
        return Err(SetupError::NoAptGet);
    }
    eprintln!("Installing what the comparison of backends needs:");
    for (name, purpose) in PACKAGES {
        eprintln!("  {name}: {purpose}");
    }
    for invocation in invocations(is_root()) {
        eprintln!("$ {invocation}");
        let status = Command::new(&invocation.program)
            .args(&invocation.arguments)
            // No questions: this may run in CI.
            .env("DEBIAN_FRONTEND", "noninteractive")
            .stdout(io::stderr())
            .status()
            .map_err(|source| SetupError::Start {
                command: invocation.to_string(),
                source,
            })?;
        if !status.success() {
            return Err(SetupError::Failed {
                command: invocation.to_string(),
                status,
            });
        }
    }
    Ok(())
}

/// Whether this process is root's, by `id`: without it, assume not.
fn is_root() -> bool {
    Command::new("id")
        .arg("-u")
        .output()
        .is_ok_and(|output| output.stdout.trim_ascii() == b"0")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn root_needs_no_sudo_and_others_do() {
        let as_root: Vec<_> = invocations(true).iter().map(ToString::to_string).collect();
        assert_eq!(as_root[0], "apt-get update");
        assert!(as_root[1].starts_with("apt-get install --yes"));
        for (name, _) in PACKAGES {
            assert!(as_root[1].split(' ').any(|word| word == name), "{name}");
        }
        let as_user: Vec<_> = invocations(false).iter().map(ToString::to_string).collect();
        assert_eq!(
            as_user,
            as_root
                .iter()
                .map(|command| format!("sudo {command}"))
                .collect::<Vec<_>>()
        );
    }
}
