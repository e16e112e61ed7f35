//! Comparison and report on executions made up for the purpose.

mod browser;
mod conclusions;
mod pages;

use std::path::{Path, PathBuf};

use etalon_core::Format;
use etalon_core::image::ImageData;
use etalon_core::resource::TextureDesc;
use etalon_core::texel::Texel;

use super::evaluate::{Finished, compare_pair, conclude, pairs};
use super::gallery::Gallery;
use super::model::{BackendKind, Case, Executor, Report, RunReport, Settings, Status, Target};
use crate::compare::Tolerance;
use crate::drivers::Driver;
use crate::execute::outcome::{Capture, Device, Label, Run, Time};

/// The executors of a machine with one Vulkan driver.
fn executors() -> Vec<Executor> {
    let driver = Driver {
        name: "lavapipe".into(),
        manifest: "/icd.d/lvp.json".into(),
        library: "libvulkan_lvp.so".into(),
    };
    vec![
        Executor::new(BackendKind::Cpu, Target::Host),
        Executor::new(BackendKind::Wgpu, Target::Vulkan(driver.clone())),
        Executor::new(BackendKind::Ash, Target::Vulkan(driver)),
    ]
}

fn case() -> Case {
    Case {
        scene: "test <scene>".into(),
        effect: "chain".into(),
        arithmetic: "strict".into(),
    }
}

/// What the passes of the made-up plan write: a gradient and a small map.
fn images() -> Vec<(&'static str, &'static str, ImageData)> {
    let size = (96, 54);
    let texels: Vec<[f32; 4]> = (0..size.0 * size.1)
        .map(|index| {
            let (x, y) = (
                (index % size.0) as f32 / size.0 as f32,
                (index / size.0) as f32 / size.1 as f32,
            );
            [x * 3.0, y, (x * 20.0).sin().abs() * 0.5, 1.0]
        })
        .collect();
    let light = ImageData::from_rgba_f32(
        TextureDesc::d2(size.0, size.1, Format::Rgba16Float),
        &texels,
    )
    .unwrap();
    let mask: Vec<[f32; 4]> = (0..48)
        .map(|index| [index as f32 / 47.0, 0.0, 0.0, 1.0])
        .collect();
    let mask = ImageData::from_rgba_f32(TextureDesc::d2(8, 6, Format::R32Float), &mask).unwrap();
    vec![
        ("ssr/march", "hit", light.clone()),
        ("ssr/mix", "target", light),
        ("bloom/threshold", "mask", mask),
    ]
}

/// An execution on disk.
struct Fixture {
    folder: tempfile::TempDir,
    run: Run,
}

impl Fixture {
    fn new(images: &[(&str, &str, ImageData)]) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let captures = images
            .iter()
            .enumerate()
            .map(|(number, (pass, binding, image))| {
                let label = Label {
                    frame: 0,
                    pass,
                    binding,
                    resource: "r",
                    buffer: false,
                };
                Capture::write(folder.path(), label, number, image).unwrap()
            })
            .collect();
        let time = |step: &str, nanoseconds| Time {
            step: step.into(),
            nanoseconds,
        };
        let times = vec![
            time("ssr/march", 2_500_000),
            time("ssr/mix", 1_000_000),
            time("bloom/threshold", 4_000),
        ];
        let device = Device {
            backend: "ash".into(),
            api: "vulkan".into(),
            device: "a \"device\" & more".into(),
            driver: "driver 1.2".into(),
        };
        Self {
            folder,
            run: Run {
                device,
                captures,
                times,
                findings: Vec::new(),
            },
        }
    }

    fn status(&self) -> Status {
        Status::Ran {
            device: self.run.device.clone(),
            times: self.run.times.clone(),
            findings: self.run.findings.clone(),
        }
    }
}

/// The report on the executions of [`executors`], by position; `None` is one
/// that has no device.
fn report_of(fixtures: &[Option<&Fixture>], gallery: Option<&Path>) -> Report {
    let statuses = fixtures
        .iter()
        .map(|fixture| {
            fixture.map_or(
                Status::NoDevice {
                    reason: "none there".into(),
                },
                Fixture::status,
            )
        })
        .collect();
    report_with(fixtures, statuses, gallery)
}

fn report_with(
    fixtures: &[Option<&Fixture>],
    statuses: Vec<Status>,
    gallery: Option<&Path>,
) -> Report {
    let executors = executors();
    let mut gallery = gallery.map(|folder| Gallery::new(folder).unwrap());
    let finished: Vec<Finished<'_>> = executors
        .iter()
        .zip(fixtures)
        .filter_map(|(executor, fixture)| {
            fixture.map(|fixture| Finished {
                executor,
                run: &fixture.run,
                folder: fixture.folder.path(),
            })
        })
        .collect();
    let comparisons = pairs(&finished)
        .into_iter()
        .flat_map(|pair| {
            compare_pair(&case(), pair, |_, _| Tolerance::BitEqual, gallery.as_mut()).unwrap()
        })
        .collect();
    let runs = executors
        .iter()
        .zip(statuses)
        .map(|(executor, status)| RunReport {
            case: case(),
            executor: executor.id.clone(),
            status,
        })
        .collect();
    let mut report = Report {
        ok: false,
        problems: Vec::new(),
        notes: Vec::new(),
        settings: Settings {
            width: 96,
            height: 54,
            frames: 1,
            effects: vec!["chain".into()],
            scenes: vec![case().scene],
            arithmetic: vec!["strict".into()],
            required: vec![BackendKind::Cpu, BackendKind::Wgpu, BackendKind::Ash],
        },
        executors: executors.clone(),
        unusable_manifests: Vec::new(),
        runs,
        comparisons,
    };
    conclude(&mut report);
    report
}

/// The made-up images with one texel of one of them changed.
fn with_noise(pass: &str) -> Vec<(&'static str, &'static str, ImageData)> {
    let mut images = images();
    let (_, _, image) = images
        .iter_mut()
        .find(|(name, _, _)| *name == pass)
        .unwrap();
    image.set_texel(3, 2, 0, 0, Texel::Float([7.0; 4])).unwrap();
    images
}

/// A folder to look at pages in, kept if `XTASK_KEEP_PAGES` names one.
fn page_folder(name: &str) -> (Option<tempfile::TempDir>, PathBuf) {
    match std::env::var_os("XTASK_KEEP_PAGES") {
        Some(root) => {
            let folder = PathBuf::from(root).join(name);
            std::fs::create_dir_all(&folder).unwrap();
            (None, folder)
        }
        None => {
            let folder = tempfile::tempdir().unwrap();
            let path = folder.path().to_owned();
            (Some(folder), path)
        }
    }
}
