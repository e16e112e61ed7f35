//! Which Vulkan drivers this machine has.
//!
//! The Vulkan loader finds drivers by their manifests, small JSON files, and
//! reads its environment once per process. To run every driver, each gets a
//! process of its own in which `VK_DRIVER_FILES` names its manifest alone;
//! this module finds the manifests. Whether there is a device behind one, only
//! the driver itself can tell.

use std::collections::BTreeSet;
use std::ffi::OsString;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use thiserror::Error;

/// A Vulkan driver's manifest.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Driver {
    /// Short name, unique among the drivers found: `lavapipe`, `radv`.
    pub name: String,
    /// The manifest, for `VK_DRIVER_FILES`.
    pub manifest: PathBuf,
    /// The library it names.
    pub library: PathBuf,
}

/// A manifest that is no use.
#[derive(Clone, Debug, PartialEq, Eq, Error, Serialize)]
#[error("{}: {reason}", manifest.display())]
pub struct BadManifest {
    /// The manifest.
    pub manifest: PathBuf,
    /// What is wrong.
    pub reason: String,
}

/// The result of a search.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Found {
    /// Usable manifests, in the loader's order of precedence.
    pub drivers: Vec<Driver>,
    /// The others.
    pub bad: Vec<BadManifest>,
}

/// The environment variables that decide where drivers are looked for.
#[derive(Clone, Debug, Default)]
pub struct Environment {
    /// `VK_DRIVER_FILES`, or the older `VK_ICD_FILENAMES`: if set, these
    /// manifests (or folders of them) and no others.
    pub driver_files: Option<OsString>,
    /// `HOME`.
    pub home: Option<OsString>,
    /// `XDG_CONFIG_HOME`.
    pub config_home: Option<OsString>,
    /// `XDG_CONFIG_DIRS`.
    pub config_dirs: Option<OsString>,
    /// `XDG_DATA_HOME`.
    pub data_home: Option<OsString>,
    /// `XDG_DATA_DIRS`.
    pub data_dirs: Option<OsString>,
}

impl Environment {
    /// Of this process. Empty variables count as not set.
    #[must_use]
    pub fn of_process() -> Self {
        let get = |name| std::env::var_os(name).filter(|value| !value.is_empty());
        Self {
            driver_files: get("VK_DRIVER_FILES").or_else(|| get("VK_ICD_FILENAMES")),
            home: get("HOME"),
            config_home: get("XDG_CONFIG_HOME"),
            config_dirs: get("XDG_CONFIG_DIRS"),
            data_home: get("XDG_DATA_HOME"),
            data_dirs: get("XDG_DATA_DIRS"),
        }
    }

    /// The folders the loader reads manifests from, in its order ("Driver
    /// discovery on Linux" in the Vulkan loader's documentation).
    fn folders(&self) -> Vec<PathBuf> {
        let in_home = |variable: &Option<OsString>, below: &str| {
            variable
                .as_ref()
                .map(PathBuf::from)
                .or_else(|| self.home.as_ref().map(|home| Path::new(home).join(below)))
        };
        let list = |variable: &Option<OsString>, default: &str| {
            let value = variable.clone().unwrap_or_else(|| default.into());
            std::env::split_paths(&value).collect::<Vec<_>>()
        };
        let mut roots = Vec::new();
        roots.extend(in_home(&self.config_home, ".config"));
        roots.extend(list(&self.config_dirs, "/etc/xdg"));
        roots.push("/etc".into());
        roots.extend(in_home(&self.data_home, ".local/share"));
        roots.extend(list(&self.data_dirs, "/usr/local/share:/usr/share"));
        roots
            .into_iter()
            .map(|root| root.join("vulkan/icd.d"))
            .collect()
    }
}

/// Manifests outside the loader's folders: browsers bring SwiftShader along.
const BROWSER_MANIFESTS: [&str; 4] = [
    "/usr/lib/chromium/vk_swiftshader_icd.json",
    "/usr/lib/chromium-browser/vk_swiftshader_icd.json",
    "/usr/lib64/chromium-browser/vk_swiftshader_icd.json",
    "/opt/google/chrome/vk_swiftshader_icd.json",
];

/// Looks for drivers as the Vulkan loader does, and for SwiftShader in
/// browsers.
#[must_use]
pub fn find(environment: &Environment) -> Found {
    let manifests = match &environment.driver_files {
        Some(files) => std::env::split_paths(files)
            .flat_map(|path| manifests_at(&path))
            .collect(),
        None => {
            let mut manifests: Vec<_> = environment
                .folders()
                .iter()
                .flat_map(|folder| manifests_at(folder))
                .collect();
            manifests.extend(
                BROWSER_MANIFESTS
                    .iter()
                    .map(PathBuf::from)
                    .filter(|path| path.is_file()),
            );
            manifests
        }
    };
    let mut found = Found::default();
    let (mut seen, mut names) = (BTreeSet::new(), BTreeSet::new());
    for manifest in manifests {
        // The same file may be reached by several ways.
        if !seen.insert(manifest.canonicalize().unwrap_or_else(|_| manifest.clone())) {
            continue;
        }
        match read(&manifest) {
            Ok(None) => {}
            Ok(Some(library)) => {
                let base = short_name(&manifest);
                let name = (1..)
                    .map(|count| {
                        if count == 1 {
                            base.clone()
                        } else {
                            format!("{base}-{count}")
                        }
                    })
                    .find(|name| names.insert(name.clone()))
                    .unwrap_or(base);
                found.drivers.push(Driver {
                    name,
                    manifest,
                    library,
                });
            }
            Err(reason) => found.bad.push(BadManifest { manifest, reason }),
        }
    }
    found
}

/// A file itself, or the manifests of a folder sorted by name.
fn manifests_at(path: &Path) -> Vec<PathBuf> {
    let Ok(entries) = std::fs::read_dir(path) else {
        // Not a folder. One that does not exist is empty; a manifest that the
        // user named and that does not exist is reported when it is read.
        let named = path
            .extension()
            .is_some_and(|extension| extension == "json");
        return if named {
            vec![path.to_owned()]
        } else {
            Vec::new()
        };
    };
    let mut manifests: Vec<_> = entries
        .filter_map(|entry| Some(entry.ok()?.path()))
        .filter(|path| {
            path.extension()
                .is_some_and(|extension| extension == "json")
        })
        .collect();
    manifests.sort();
    manifests
}

/// The parts of a manifest that matter here.
#[derive(Deserialize)]
struct Manifest {
    #[serde(rename = "ICD")]
    icd: Icd,
}

#[derive(Deserialize)]
struct Icd {
    library_path: PathBuf,
    /// `"32"` or `"64"`, since version 1.0.1 of the file format.
    library_arch: Option<String>,
}

/// The library of a manifest; `None` if it is for another width of pointer.
fn read(manifest: &Path) -> Result<Option<PathBuf>, String> {
    /// Manifests have some hundred bytes.
    const LARGEST: u64 = 1 << 20;
    let size = std::fs::metadata(manifest)
        .map_err(|error| error.to_string())?
        .len();
    if size > LARGEST {
        return Err(format!("{size} bytes are no driver manifest"));
    }
    let text = std::fs::read_to_string(manifest).map_err(|error| error.to_string())?;
    let Manifest { icd } =
        serde_json::from_str(&text).map_err(|error| format!("not a driver manifest: {error}"))?;
    let bits = usize::BITS.to_string();
    let stem = manifest.file_stem().unwrap_or_default().to_string_lossy();
    let other_by_name =
        stem.ends_with(".i686") || stem.ends_with(".i386") || stem.ends_with(".armhf");
    if icd.library_arch.is_some_and(|arch| arch != bits) || (other_by_name && bits == "64") {
        return Ok(None);
    }
    // Relative with a slash means relative to the manifest; without, the
    // system's search path.
    let library = if icd.library_path.is_relative() && icd.library_path.components().count() > 1 {
        manifest
            .parent()
            .unwrap_or(Path::new("."))
            .join(icd.library_path)
    } else {
        icd.library_path
    };
    if library.is_absolute() && !library.exists() {
        return Err(format!("its library {} does not exist", library.display()));
    }
    Ok(Some(library))
}

/// What people call the driver of a manifest.
fn short_name(manifest: &Path) -> String {
    let stem = manifest.file_name().unwrap_or_default().to_string_lossy();
    let stem = stem.split('.').next().unwrap_or_default();
    let stem = stem.strip_suffix("_icd").unwrap_or(stem);
    match stem.strip_prefix("vk_").unwrap_or(stem) {
        "lvp" => "lavapipe",
        "radeon" => "radv",
        "intel" => "anv",
        "intel_hasvk" => "hasvk",
        "nouveau" => "nvk",
        other => other,
    }
    .to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A folder with manifests, as the user's only data folder.
    struct Machine {
        root: tempfile::TempDir,
    }

    impl Machine {
        fn new() -> Self {
            let root = tempfile::tempdir().unwrap();
            std::fs::create_dir_all(root.path().join("vulkan/icd.d")).unwrap();
            Self { root }
        }

        fn manifest(&self, name: &str, text: &str) -> PathBuf {
            let path = self.root.path().join("vulkan/icd.d").join(name);
            std::fs::write(&path, text).unwrap();
            path
        }

        fn environment(&self) -> Environment {
            let nowhere = || Some(self.root.path().join("nowhere").into());
            Environment {
                driver_files: None,
                home: nowhere(),
                config_home: nowhere(),
                config_dirs: nowhere(),
                data_home: nowhere(),
                data_dirs: Some(self.root.path().into()),
            }
        }

        /// What is found in this machine's folder.
        fn find(&self) -> Found {
            let mut found = find(&self.environment());
            found
                .drivers
                .retain(|driver| driver.manifest.starts_with(self.root.path()));
            found
                .bad
                .retain(|bad| bad.manifest.starts_with(self.root.path()));
            found
        }
    }

    const GOOD: &str = r#"{"ICD": {"library_path": "libvulkan_test.so", "api_version": "1.3.0"}}"#;

    #[test]
    fn drivers_are_found_named_and_sorted() {
        let machine = Machine::new();
        machine.manifest("radeon_icd.x86_64.json", GOOD);
        machine.manifest("lvp_icd.x86_64.json", GOOD);
        machine.manifest("vk_swiftshader_icd.json", GOOD);
        machine.manifest("readme.txt", "no manifest");
        let found = machine.find();
        let names: Vec<_> = found
            .drivers
            .iter()
            .map(|driver| driver.name.as_str())
            .collect();
        assert_eq!(names, ["lavapipe", "radv", "swiftshader"]);
        assert_eq!(found.bad, []);
        assert_eq!(found.drivers[0].library, Path::new("libvulkan_test.so"));
    }

    #[test]
    fn drivers_of_another_pointer_width_are_left_out() {
        let machine = Machine::new();
        machine.manifest("lvp_icd.i686.json", GOOD);
        let other = if usize::BITS == 64 { "32" } else { "64" };
        let text =
            format!(r#"{{"ICD": {{"library_path": "libx.so", "library_arch": "{other}"}}}}"#);
        machine.manifest("other_icd.json", &text);
        assert_eq!(machine.find(), Found::default());
    }

    #[test]
    fn broken_manifests_are_named_with_their_fault() {
        let machine = Machine::new();
        machine.manifest("a.json", "{");
        machine.manifest("b.json", r#"{"layers": []}"#);
        machine.manifest(
            "c.json",
            r#"{"ICD": {"library_path": "/nowhere/libvulkan_none.so"}}"#,
        );
        machine.manifest(
            "d.json",
            r#"{"ICD": {"library_path": "./libvulkan_none.so"}}"#,
        );
        let found = machine.find();
        assert_eq!(found.drivers, []);
        let texts: Vec<_> = found.bad.iter().map(ToString::to_string).collect();
        assert_eq!(texts.len(), 4);
        assert!(
            texts[0].contains("a.json: not a driver manifest"),
            "{texts:?}"
        );
        assert!(texts[1].contains("missing field `ICD`"), "{texts:?}");
        assert!(
            texts[2].contains("/nowhere/libvulkan_none.so does not exist"),
            "{texts:?}"
        );
        assert!(
            texts[3].contains("libvulkan_none.so does not exist"),
            "{texts:?}"
        );
    }

    #[test]
    fn the_users_choice_replaces_the_search() {
        let machine = Machine::new();
        machine.manifest("lvp_icd.json", GOOD);
        let chosen = tempfile::tempdir().unwrap();
        let file = chosen.path().join("my_icd.json");
        std::fs::write(&file, GOOD).unwrap();
        let missing = chosen.path().join("missing.json");
        let files = std::env::join_paths([&file, &missing, &file]).unwrap();
        let found = find(&Environment {
            driver_files: Some(files),
            ..machine.environment()
        });
        assert_eq!(found.drivers.len(), 1);
        assert_eq!(
            (found.drivers[0].name.as_str(), &found.drivers[0].manifest),
            ("my", &file)
        );
        assert_eq!(found.bad.len(), 1);
        assert_eq!(found.bad[0].manifest, missing);
    }

    #[test]
    fn equal_names_are_told_apart() {
        let machine = Machine::new();
        machine.manifest("lvp_icd.json", GOOD);
        machine.manifest("lvp_icd.x86_64.json", GOOD);
        let names: Vec<_> = machine
            .find()
            .drivers
            .into_iter()
            .map(|driver| driver.name)
            .collect();
        assert_eq!(names, ["lavapipe", "lavapipe-2"]);
    }
}
