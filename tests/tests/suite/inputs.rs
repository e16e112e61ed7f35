//! Sizes, and images that no renderer should have made.

use etalon::Format;
use etalon::backend::CapturedData;
use etalon::effects::bloom::Bloom;
use etalon::effects::composite::Composite;
use etalon::effects::exposure::Exposure;
use etalon::effects::{ChainSettings, chain};
use etalon::graph::{ClearValue, Graph};
use etalon::image::ImageData;
use etalon::kernel::Arithmetic;
use etalon::plan::{Capture, PlanError};
use etalon::resource::TextureDesc;
use etalon_scenes::{Frame, FrameSize, scene};
use etalon_tests::{executors, first_difference, non_finite, plan_for};

/// Runs the whole chain twice on every backend, in strict arithmetic, and checks
/// that all agree and nothing is infinite or NaN.
fn check(frame: &Frame, settings: &ChainSettings, what: &str) {
    let kernels = etalon::effects::kernels();
    let mut reference = Vec::new();
    for executor in &mut executors() {
        let mut graph = Graph::new();
        let inputs = frame.import(&mut graph, 1.0 / 60.0).unwrap();
        let result = chain(&mut graph, &inputs, settings).unwrap();
        graph.output("picture", result.picture).unwrap();
        let plan = plan_for(
            executor.as_ref(),
            &graph,
            &kernels,
            Arithmetic::Strict,
            Capture::EveryPass,
        )
        .unwrap();
        for number in 0..2 {
            let execution = executor.execute(&plan, &frame.inputs()).unwrap();
            for captured in &execution.captures {
                if let CapturedData::Texture(image) = &captured.data {
                    assert_eq!(
                        non_finite(image),
                        0,
                        "{what}, {}: pass `{}` writes infinities or NaNs in frame {number}",
                        executor.info(),
                        captured.pass
                    );
                }
            }
            match reference.get(number) {
                None => reference.push(execution),
                Some(reference) => {
                    assert_eq!(
                        first_difference(reference, &execution),
                        None,
                        "{what}, {}",
                        executor.info()
                    );
                }
            }
        }
    }
}

#[test]
fn odd_sizes_work_and_agree_everywhere() {
    for (width, height) in [(1, 1), (1, 4096), (7, 13), (257, 129)] {
        let frame = scene("wet-floor")
            .unwrap()
            .frame(FrameSize::new(width, height).unwrap())
            .unwrap();
        check(&frame, &ChainSettings::full(), &format!("{width}×{height}"));
    }
}

#[test]
fn full_hd_works_and_agrees_everywhere() {
    let frame = scene("wet-floor")
        .unwrap()
        .frame(FrameSize::new(1920, 1080).unwrap())
        .unwrap();
    check(&frame, &ChainSettings::full(), "1920×1080");
}

#[test]
fn nothing_that_an_image_can_hold_gets_through() {
    let frame = scene("hard-inputs")
        .unwrap()
        .frame(FrameSize::new(128, 72).unwrap())
        .unwrap();
    let dirty: usize = [&frame.colour, &frame.depth, &frame.normal]
        .into_iter()
        .map(non_finite)
        .sum();
    assert!(
        dirty > 100,
        "the scene must hold what it is made for, not {dirty} bad channels"
    );
    check(&frame, &ChainSettings::full(), "hard inputs");
}

#[test]
fn a_frame_with_nan_and_infinite_pixels_leaves_no_trace_in_this_frame_or_the_next() {
    let Ok(folder) = std::env::var("ETALON_INPUTS") else {
        eprintln!("skipped: ETALON_INPUTS is not set");
        return;
    };
    let path = std::path::Path::new(&folder).join("exr/bright-rings-nan-inf.exr");
    let loaded = etalon_scenes::exr_frame::load_exr(&path, &Default::default()).unwrap();
    assert!(non_finite(&loaded.frame.colour) > 0);
    let settings = ChainSettings {
        ssr: None,
        exposure: Some(Exposure::default()),
        bloom: Some(Bloom::default()),
        composite: Composite::default(),
    };
    check(&loaded.frame, &settings, "bright rings");
}

/// An image of `desc`, as an output that a clear has written.
fn cleared(desc: TextureDesc) -> Graph {
    let mut graph = Graph::new();
    let target = graph.texture("target", desc);
    let target = graph.clear(target, ClearValue::Float([1.0; 4])).unwrap();
    graph.output("target", target).unwrap();
    graph
}

#[test]
fn impossible_sizes_are_refused_before_anything_is_allocated() {
    let kernels = etalon::effects::kernels();
    for executor in &mut executors() {
        let before = executor.counters();
        let limit = executor.limits().max_texture_2d;
        for (width, height) in [(0, 0), (0, 5), (limit + 1, 1), (u32::MAX, u32::MAX)] {
            let graph = cleared(TextureDesc::d2(width, height, Format::Rgba32Float));
            let plan = plan_for(
                executor.as_ref(),
                &graph,
                &kernels,
                Arithmetic::Strict,
                Capture::Outputs,
            );
            assert!(
                matches!(plan, Err(PlanError::Resource { .. })),
                "{width}×{height}"
            );
        }
        assert_eq!(executor.counters(), before, "{}", executor.info());
    }
    assert!(FrameSize::new(0, 0).is_err());
    assert!(ImageData::zeroed(TextureDesc::d2(u32::MAX, u32::MAX, Format::Rgba32Float)).is_err());
}
