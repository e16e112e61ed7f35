//! Fast arithmetic against strict, on one executor: what differs is the
//! kernels' own choice of functions and filters.

use crate::common;

use common::{Run, backend, texels};
use etalon_core::backend::Execution;
use etalon_core::kernel::Arithmetic;
use etalon_core::plan::Capture;
use etalon_effects::bloom::Bloom;
use etalon_effects::composite::{Composite, Output, ToneCurve};
use etalon_effects::exposure::Exposure;
use etalon_effects::{ChainSettings, chain};
use etalon_scenes::{Frame, FrameSize, scene};

fn run(frame: &Frame, settings: &ChainSettings, arithmetic: Arithmetic) -> Execution {
    let mut run = Run::new();
    run.arithmetic = arithmetic;
    let inputs = run.import_frame(frame);
    let result = chain(&mut run.graph, &inputs, settings).expect("valid settings");
    run.graph
        .output("picture", result.picture)
        .expect("written");
    run.execute(backend().as_mut(), Capture::EveryPass)
}

/// The texels of one pass under both.
fn both(frame: &Frame, settings: &ChainSettings, passes: &[&str]) -> Vec<[Vec<[f32; 4]>; 2]> {
    let strict = run(frame, settings, Arithmetic::Strict);
    let fast = run(frame, settings, Arithmetic::Fast);
    let of =
        |execution: &Execution, pass: &str| texels(execution.texture(pass, "result").expect(pass));
    passes
        .iter()
        .map(|pass| [of(&strict, pass), of(&fast, pass)])
        .collect()
}

fn lit_frame() -> Frame {
    let size = FrameSize::new(101, 57).expect("small");
    scene("dark-room-lights")
        .expect("registered")
        .frame(size)
        .expect("small")
}

#[test]
fn exposure_bloom_and_composite_differ_by_rounding_only() {
    let frame = lit_frame();
    for curve in ToneCurve::ALL {
        let settings = ChainSettings {
            ssr: None,
            exposure: Some(Exposure::default()),
            bloom: Some(Bloom::default()),
            composite: Composite {
                output: Output::Sdr(curve),
                ..Composite::default()
            },
        };
        let results = both(
            &frame,
            &settings,
            &[
                "exposure/adapt",
                "bloom/threshold",
                "bloom/upsample#5",
                "composite/composite",
            ],
        );
        let [adaptation, threshold, bloom, picture] = &results[..] else {
            panic!("four passes")
        };
        // Logarithms and exponentials of this executor are within a few ulp, and
        // so are the sums.
        let near =
            |a: f32, b: f32, relative: f32| (a - b).abs() <= relative * a.abs().max(b.abs()) + 1e-6;
        assert!(
            near(adaptation[0][0][1], adaptation[1][0][1], 1e-5),
            "{adaptation:?}"
        );
        for (strict, fast) in threshold[0].iter().zip(&threshold[1]) {
            // One f16 step, where a last bit tips the rounding.
            assert!(
                (0..3).all(|c| near(strict[c], fast[c], 0.000_98)),
                "{strict:?} {fast:?}"
            );
        }
        for (strict, fast) in bloom[0].iter().zip(&bloom[1]) {
            // Six levels down and five up, an f16 step each at most.
            assert!(
                (0..3).all(|c| near(strict[c], fast[c], 11.0 * 0.000_98)),
                "{strict:?} {fast:?}"
            );
        }
        for (strict, fast) in picture[0].iter().zip(&picture[1]) {
            let code = |x: f32| (x * 255.0).round();
            assert!(
                (0..4).all(|c| (code(strict[c]) - code(fast[c])).abs() <= 1.0),
                "{curve:?} {strict:?} {fast:?}"
            );
        }
    }
}

#[test]
fn reflections_are_found_in_the_same_places() {
    let frame = lit_frame();
    let settings = ChainSettings {
        ssr: ChainSettings::full().ssr,
        ..ChainSettings::default()
    };
    let results = both(&frame, &settings, &["ssr/march"]);
    let [strict, fast] = &results[0];
    let found = strict.iter().filter(|texel| texel[2] > 0.0).count();
    assert!(found > 500, "{found}");
    let same = |a: &[f32; 4], b: &[f32; 4]| (0..3).all(|c| (a[c] - b[c]).abs() < 1e-3);
    let differ = strict.iter().zip(fast).filter(|(a, b)| !same(a, b)).count();
    // A last bit decides where a ray grazes an edge or the thickness; nowhere else.
    assert!(differ * 100 <= found, "{differ} of {found}");
}
