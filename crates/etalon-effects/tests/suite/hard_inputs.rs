//! Whatever the inputs hold, every pass of every effect writes numbers.

use crate::common;

use common::{Run, backend, texels};
use etalon_core::backend::CapturedData;
use etalon_core::kernel::Arithmetic;
use etalon_core::plan::Capture;
use etalon_effects::composite::{Composite, Output, ToneCurve};
use etalon_effects::{ChainSettings, chain};
use etalon_scenes::{FrameSize, scene};

/// Runs the chain on a scene for some frames and checks every pass's result.
fn check(name: &str, width: u32, height: u32, settings: &ChainSettings, arithmetic: Arithmetic) {
    let entry = scene(name).expect("registered");
    let frame = entry
        .frame(FrameSize::new(width, height).expect("small"))
        .expect("small");
    let mut backend = backend();
    for _ in 0..2 {
        let mut run = Run::new();
        run.arithmetic = arithmetic;
        let inputs = run.import_frame(&frame);
        let result = chain(&mut run.graph, &inputs, settings).expect("valid settings");
        run.graph
            .output("picture", result.picture)
            .expect("written");
        let execution = run.execute(backend.as_mut(), Capture::EveryPass);
        assert!(execution.captures.len() > 5);
        for captured in &execution.captures {
            let CapturedData::Texture(image) = &captured.data else {
                continue;
            };
            for (index, texel) in texels(image).iter().enumerate() {
                let numbers = texel.iter().all(|channel| channel.is_finite());
                assert!(
                    numbers,
                    "{name}, {}, texel {index}: {texel:?}",
                    captured.pass
                );
            }
        }
    }
}

#[test]
fn every_pass_writes_numbers_from_hard_inputs() {
    for (width, height) in [(1, 1), (1, 40), (40, 1), (33, 17), (96, 54)] {
        for arithmetic in [Arithmetic::Strict, Arithmetic::Fast] {
            check(
                "hard-inputs",
                width,
                height,
                &ChainSettings::full(),
                arithmetic,
            );
        }
    }
}

#[test]
fn every_curve_and_output_takes_hard_inputs() {
    let outputs = ToneCurve::ALL
        .map(Output::Sdr)
        .into_iter()
        .chain([Output::Hdr]);
    for output in outputs {
        let composite = Composite {
            output,
            ..Composite::default()
        };
        let settings = ChainSettings {
            composite,
            ..ChainSettings::full()
        };
        check("hard-inputs", 48, 27, &settings, Arithmetic::Strict);
    }
}

#[test]
fn ordinary_scenes_stay_numbers_too() {
    for name in ["wet-floor", "corridor-grazing", "dark-room-lights"] {
        check(name, 64, 36, &ChainSettings::full(), Arithmetic::Strict);
    }
}
