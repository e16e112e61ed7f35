//! All that is told of a plan, as data.

use etalon::effects::demand::{Demands, Region};
use etalon_core::backend::{BackendInfo, Counters};
use etalon_core::plan::{MemoryAtStep, Plan, TransientMemory};
use serde::Serialize;
use serde_json::{Value, json};

/// A plan with what is told of it.
pub(super) struct Report {
    pub(super) scene: String,
    pub(super) size: [u32; 2],
    /// The preset's name.
    pub(super) preset: String,
    pub(super) demands: Demands,
    pub(super) memory: TransientMemory,
    pub(super) timeline: Vec<MemoryAtStep>,
    pub(super) counters: Counters,
    /// WESL files read for the plan's kernels.
    pub(super) parsed: u64,
    pub(super) measured: Vec<Measured>,
    pub(super) plan: Plan,
}

/// What a backend counted in one run.
#[derive(Serialize)]
pub(super) struct Measured {
    pub(super) backend: BackendInfo,
    pub(super) counters: Counters,
}

/// The counters with what they are called, in the order in which they are told.
pub(super) fn rows(counters: &Counters) -> [(&'static str, u64); 14] {
    [
        ("shader modules", counters.kernels),
        ("pipelines", counters.pipelines),
        ("bind groups", counters.bind_groups),
        ("textures", counters.textures),
        ("buffers", counters.buffers),
        ("allocations", counters.allocations),
        ("transient bytes", counters.transient_bytes),
        ("persistent bytes", counters.persistent_bytes()),
        ("passes", counters.passes),
        ("dispatches", counters.dispatches),
        ("draws", counters.draws),
        ("barriers", counters.barriers),
        ("invocations", counters.invocations),
        ("indirect invocations", counters.indirect_invocations),
    ]
}

/// What only a backend knows: the plan has nothing to say of it.
pub(super) fn is_backends(row: &str) -> bool {
    [
        "textures",
        "buffers",
        "allocations",
        "persistent bytes",
        "indirect invocations",
    ]
    .contains(&row)
}

/// What is on the screen, in words.
pub(super) fn on_screen(demands: &Demands) -> Vec<(&'static str, String)> {
    let nothing = || "nothing".to_owned();
    let region = |region: Option<Region>| region.map_or_else(nothing, |region| region.to_string());
    vec![
        ("surfaces", region(demands.surfaces)),
        (
            "mirrors",
            demands.reflective.map_or_else(nothing, |mirror| {
                let [smoothest, roughest] = mirror.roughness;
                format!(
                    "{}, of a roughness from {smoothest:.3} to {roughest:.3}, up to {:.3} of a colour",
                    mirror.region, mirror.specular
                )
            }),
        ),
        ("seen through", region(demands.transparent)),
        (
            "light",
            demands.bright.map_or_else(nothing, |light| {
                let (peak, floor) = (light.peak, light.floor);
                if peak > floor {
                    format!("up to {peak}, over {floor} on {}", light.region)
                } else {
                    format!("up to {peak}")
                }
            }),
        ),
        (
            "motion",
            demands.moving.map_or_else(nothing, |moving| {
                let objects = moving.objects.map(|region| format!("objects on {region}"));
                let camera = moving.camera.then(|| "the camera".to_owned());
                let all: Vec<String> = camera.into_iter().chain(objects).collect();
                all.join(", ")
            }),
        ),
    ]
}

fn region(region: Region) -> Value {
    json!({ "min": region.min(), "max": region.max(), "coverage": region.coverage() })
}

fn demands(demands: &Demands) -> Value {
    json!({
        "surfaces": demands.surfaces.map(region),
        "reflective": demands.reflective.map(|mirror| json!({
            "region": region(mirror.region),
            "roughness": mirror.roughness,
            "specular": mirror.specular,
        })),
        "transparent": demands.transparent.map(region),
        "bright": demands.bright.map(|light| json!({
            "region": region(light.region),
            "peak": light.peak,
            "floor": light.floor,
        })),
        "moving": demands.moving.map(|moving| json!({
            "camera": moving.camera,
            "objects": moving.objects.map(region),
        })),
    })
}

/// All of it, for other programs.
pub(super) fn json(report: &Report) -> String {
    let value = json!({
        "scene": report.scene,
        "size": report.size,
        "preset": report.preset,
        "demands": demands(&report.demands),
        "memory": report.memory,
        "memory_excess": report.memory.excess(),
        "timeline": report.timeline,
        "counters": report.counters,
        "files_parsed": report.parsed,
        "measured": report.measured,
        "plan": report.plan,
    });
    let mut text = serde_json::to_string_pretty(&value).unwrap_or_default();
    text.push('\n');
    text
}
