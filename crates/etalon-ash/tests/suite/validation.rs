//! Synchronization validation hears of barriers that are missing: the checks
//! of the other tests can fail.

use crate::common;

use etalon_ash::{AshBackend, AshOptions, Validation};
use etalon_core::Format;
use etalon_core::backend::{Backend, BackendError, Inputs};
use etalon_core::graph::{ClearValue, Graph};
use etalon_core::plan::{Capture, Plan};
use etalon_core::resource::{BufferDesc, TextureDesc};

/// A kernel that reads a buffer which another has written.
fn buffers() -> Graph {
    let mut graph = Graph::new();
    let values = graph.buffer("values", BufferDesc { bytes: 4096 });
    let values = graph
        .compute("test/ramp")
        .write_buffer("values", values)
        .groups([16, 1, 1])
        .unwrap()
        .buffer("values")
        .unwrap();
    let result = graph.buffer("result", BufferDesc { bytes: 4096 });
    let result = graph
        .compute("test/copy_values")
        .read_buffer("source", values)
        .write_buffer("result", result)
        .groups([16, 1, 1])
        .unwrap()
        .buffer("result")
        .unwrap();
    graph.output_buffer("result", result).unwrap();
    graph
}

/// A kernel that reads a texture which another has written, in one layout.
///
/// (Two writes in a row would not do: the layer holds its tongue about writes
/// after writes through descriptors.)
fn textures() -> Graph {
    let desc = TextureDesc::d2(16, 16, Format::R32Float);
    let mut graph = Graph::new();
    let cleared = graph.texture("cleared", desc);
    let cleared = graph.clear(cleared, ClearValue::Float([0.0; 4])).unwrap();
    let image = graph.texture("image", desc);
    let image = graph
        .compute("test/add")
        .read("source", cleared)
        .write("result", image)
        .set("offset", 1.0_f32)
        .per_texel("result")
        .unwrap();
    let copy = graph.texture("copy", desc);
    let copy = graph
        .compute("test/copy_stored")
        .read("source", image)
        .write("result", copy)
        .per_texel("result")
        .unwrap();
    graph.output("copy", copy).unwrap();
    graph
}

/// A backend that is validated, if that is possible.
fn validated(device: &str, fails: bool) -> Option<AshBackend> {
    let made = AshBackend::new(AshOptions {
        device: Some(device.to_owned()),
        validation: Validation::Synchronization,
        validation_fails: fails,
        ..AshOptions::default()
    });
    match made {
        Ok(backend) => Some(backend),
        Err(error) => {
            assert!(!common::required("validation"), "{error}");
            println!("not tested: {error}");
            None
        }
    }
}

/// Takes away the barriers of the step of this name that are about a resource.
fn without_barriers(plan: &Plan, step: &str, resource: &str) -> Plan {
    let mut plan = plan.clone();
    let number = plan
        .resources
        .iter()
        .position(|planned| planned.name == resource)
        .unwrap() as u32;
    let step = plan
        .steps
        .iter_mut()
        .find(|planned| planned.name == step)
        .unwrap();
    let before = step.barriers.len();
    step.barriers.retain(|barrier| barrier.resource != number);
    assert_eq!(
        step.barriers.len() + 1,
        before,
        "one barrier is planted out"
    );
    plan
}

#[test]
fn a_missing_barrier_is_an_error() {
    for device in common::devices() {
        for (graph, step, resource) in [
            (buffers(), "test/copy_values", "values"),
            (textures(), "test/copy_stored", "image"),
        ] {
            let Some(mut backend) = validated(&device, true) else {
                return;
            };
            let good = common::plan(&backend, &graph, Capture::Outputs);
            let bad = without_barriers(&good, step, resource);
            backend.execute(&good, &Inputs::new()).unwrap();
            match backend.execute(&bad, &Inputs::new()) {
                Err(BackendError::Validation { messages }) => {
                    let found = messages.iter().any(|message| {
                        message.contains("SYNC-HAZARD-READ-AFTER-WRITE")
                            && message.contains(resource)
                    });
                    assert!(found, "{messages:?}");
                }
                other => panic!("{device}: the missing barrier of `{step}` gave {other:?}"),
            }
            // The next run is judged by its own messages.
            backend.execute(&good, &Inputs::new()).unwrap();
        }
    }
}

#[test]
fn messages_can_be_collected_instead() {
    for device in common::devices() {
        let Some(mut backend) = validated(&device, false) else {
            return;
        };
        let log = backend.validation_log().unwrap();
        let good = common::plan(&backend, &buffers(), Capture::Outputs);
        let bad = without_barriers(&good, "test/copy_values", "values");
        backend.execute(&bad, &Inputs::new()).unwrap();
        assert!(!log.is_empty());
        assert_eq!(log.len(), log.messages().len());
        let messages = log.take();
        assert!(messages.iter().any(|message| message.error
            && message.rule.contains("SYNC-HAZARD")
            && !message.text.is_empty()));
        assert!(log.is_empty());
    }
}

#[test]
fn without_validation_there_is_no_log() {
    for device in common::devices() {
        let options = AshOptions {
            device: Some(device),
            ..AshOptions::default()
        };
        let backend = AshBackend::new(options).unwrap();
        assert!(backend.validation_log().is_none());
    }
}

#[test]
fn a_device_that_is_not_there_is_named() {
    if common::devices().is_empty() {
        return;
    }
    let options = AshOptions {
        device: Some("no such device".to_owned()),
        ..AshOptions::default()
    };
    match AshBackend::new(options) {
        Err(BackendError::NoDevice { backend, reason }) => {
            assert_eq!(backend, "ash");
            assert!(reason.contains("no such device"), "{reason}");
            // And what there is instead.
            assert!(reason.contains(&common::devices()[0]), "{reason}");
        }
        other => panic!("{other:?}"),
    }
}

#[test]
fn devices_are_described() {
    for device in common::devices() {
        let backend = common::backend(&device);
        let info = backend.info();
        assert_eq!(info.backend, "ash");
        assert_eq!(info.device, device);
        assert!(info.api.starts_with("Vulkan 1."), "{info}");
        assert!(!info.driver.is_empty());
        let limits = backend.limits();
        // What Vulkan guarantees of every device ("Required Limits").
        assert!(limits.max_texture_2d >= 4096);
        assert!(limits.max_texture_3d >= 256);
        assert!(limits.max_texture_layers >= 256);
        assert!(limits.max_workgroups >= 65535);
        assert!(limits.max_workgroup_invocations >= 128);
        assert!(limits.max_workgroup_bytes >= 16384);
        assert!(limits.uniform_alignment.is_power_of_two());
        assert!(limits.uniform_alignment <= 256);
    }
}
