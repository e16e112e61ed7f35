//! Four faults that published reference code for these effects has, each in a small
//! kernel of our own that is caught at it, beside one that has it not.
//!
//! The first is found by the sanitiser; the others compute finite numbers without any
//! loss of digits, which are wrong: an independent truth tells.

use crate::common;

use common::*;
use etalon_cpu::sanitise::Fault;
use etalon_cpu::{BoundResource, Executor, NumberType, TranslateOptions};

fn run(wgsl: &str, data: &[f32]) -> Vec<f32> {
    let bits: Vec<u32> = data.iter().map(|x| x.to_bits()).collect();
    let words = run_buffers(wgsl, &bits, data.len(), data.len() as u32 / 64);
    words.into_iter().map(f32::from_bits).collect()
}

/// Lines at which a kernel gives birth to NaN or infinity.
fn births(wgsl: &str, data: &[f32]) -> Vec<u32> {
    let options = TranslateOptions {
        sanitise: true,
        ..TranslateOptions::default()
    };
    let program = translate_as(wgsl, &options).unwrap();
    let (input, output) = (floats(data), buffer(&vec![0; data.len()]));
    let bound: Vec<BoundResource<'_>> = program
        .bindings()
        .iter()
        .map(|binding| BoundResource::Buffer([&input, &output][binding.binding as usize]))
        .collect();
    let executor = Executor::new(1)
        .unwrap()
        .with_number_type(NumberType::Shadow);
    let groups = [data.len() as u32 / 64, 1, 1];
    let found = program.dispatch(&executor, groups, &bound).unwrap();
    let mut lines: Vec<u32> = found
        .sanitised
        .sites
        .iter()
        .filter(|site| {
            site.faults()
                .iter()
                .any(|(fault, _)| *fault == Fault::Birth)
        })
        .map(|site| site.location.line)
        .collect();
    lines.dedup();
    lines
}

fn data(f: impl Fn(usize) -> f64) -> Vec<f32> {
    (0..128).map(|i| f(i) as f32).collect()
}

/// A ray along a row of the screen has no height to divide by. `mix` computes both of
/// its operands, and 0 times the invalid one is no 0 (D. Lettier, "3D Game Shaders For
/// Beginners", screen-space reflection).
#[test]
fn the_invalid_side_of_a_mix() {
    let place = |along: &str| {
        kernel(
            "",
            &format!(
                "    let start = vec2f(0.25, 0.5);
    let delta = vec2f(x, 0.0);
    let at = start + delta * 0.75;
    let is_wide = abs(delta.x) >= abs(delta.y);
{along}
    result[i] = along;"
            ),
        )
    };
    let data = data(|i| 1.0 + i as f64);
    let faulty = place(
        "    let along = mix((at.y - start.y) / delta.y, (at.x - start.x) / delta.x,
        select(0.0, 1.0, is_wide));",
    );
    assert_eq!(births(&faulty, &data), [11]);
    assert!(run(&faulty, &data).iter().all(|along| along.is_nan()));
    let ours = place(
        "    let way = select(at.y - start.y, at.x - start.x, is_wide);
    let along = way / select(delta.y, delta.x, is_wide);",
    );
    assert!(births(&ours, &data).is_empty());
    for along in run(&ours, &data) {
        assert!((along - 0.75).abs() <= 1e-6, "{along}");
    }
}

/// A refinement that steps on by half a step after a miss loses the hit it had: it may
/// end beyond a thin surface, where nothing is (the same source). Bisection keeps a hit
/// at one end of its bracket and halves it with each step.
#[test]
fn a_bracket_that_is_lost() {
    // A surface at x, a hundredth thick; `end` is a hit somewhere in it.
    let functions = "fn hits(t: f32, x: f32) -> bool { return t >= x && t < x + 0.01; }";
    let search = |step: &str| {
        kernel(
            functions,
            &format!(
                "    var miss = 0.0;
    var end = x + 0.005;
    var best = end;
    for (var k = 0u; k < 10u; k++) {{
{step}
    }}
    result[i] = best;"
            ),
        )
    };
    let surfaces = data(|i| 0.013 + 0.0071 * i as f64);
    let bound = |x: f32| (x + 0.005) / 1024.0;
    let wrong = |found: &[f32]| {
        let pairs = found.iter().zip(&surfaces);
        pairs
            .filter(|&(&t, &x)| !(t >= x && t <= x + bound(x)))
            .count()
    };
    let faulty = search(
        "        if (hits(best, x)) {
            end = best;
            best = miss + (best - miss) / 2.0;
        } else {
            let here = best;
            best = best + (best - miss) / 2.0;
            miss = here;
        }",
    );
    let lost = wrong(&run(&faulty, &surfaces));
    assert!(lost > 32, "only {lost} of 128 are lost");
    let ours = search(
        "        let middle = 0.5 * (miss + end);
        if (hits(middle, x)) { end = middle; } else { miss = middle; }
        best = end;",
    );
    assert_eq!(wrong(&run(&ours, &surfaces)), 0);
}

/// `i <= most` after `while (i < most)` is always true, so that a march whose steps are
/// spent has hit whatever was there (FidelityFX SSSR's and DiligentFX's intersection).
#[test]
fn a_hit_after_the_last_step() {
    let march = |valid: &str| {
        kernel(
            "",
            &format!(
                "    let most = 64u;
    var k = 0u;
    var t = 0.0;
    var hit = false;
    while (k < most) {{
        t = t + 0.125;
        hit = t >= x;
        if (hit) {{ break; }}
        k++;
    }}
    result[i] = select(0.0, 1.0, {valid});"
            ),
        )
    };
    // Those up to 8 are within reach of 64 steps of an eighth.
    let surfaces = data(|i| 0.1 + 0.2 * i as f64);
    let wrong = |found: &[f32]| {
        let pairs = found.iter().zip(&surfaces);
        pairs
            .filter(|&(&hit, &x)| (hit == 1.0) != (x <= 8.0))
            .count()
    };
    let unreached = surfaces.iter().filter(|&&x| x > 8.0).count();
    assert_eq!(wrong(&run(&march("k <= most"), &surfaces)), unreached);
    assert!(unreached > 64);
    assert_eq!(wrong(&run(&march("hit"), &surfaces)), 0);
}

/// A ratio of indices that depends on the side is computed, and not the one that is
/// used; and a mip level's whole part stays in the weight of two levels (Blender's
/// legacy screen-space refraction, and shaders made after it).
#[test]
fn the_ratio_not_used_and_the_level_not_a_part() {
    // Sines of the angle in the glass: what leaves it turns away from the normal.
    let leaving = |ratio: &str| {
        kernel(
            "",
            &format!(
                "    let ior = 1.5;
    let inside = true;
    let eta = select(1.0 / ior, ior, inside);
    let direction = vec3f(x, 0.0, -sqrt(1.0 - x * x));
    result[i] = refract(direction, vec3f(0.0, 0.0, 1.0), {ratio}).x;"
            ),
        )
    };
    let sines = data(|i| 0.66 * i as f64 / 128.0);
    let wrong = |found: &[f32]| {
        let pairs = found.iter().zip(&sines);
        // Snell: n sin is the same on both sides.
        pairs
            .filter(|&(&sine, &x)| (sine - 1.5 * x).abs() > 1e-6)
            .count()
    };
    assert!(wrong(&run(&leaving("1.0 / ior"), &sines)) > 120);
    assert_eq!(wrong(&run(&leaving("eta"), &sines)), 0);

    // Levels hold their own number; between them it is the level itself.
    let levels = |weight: &str| {
        kernel(
            "",
            &format!(
                "    let low = floor(x);
    result[i] = mix(low, low + 1.0, {weight});"
            ),
        )
    };
    let asked = data(|i| i as f64 / 16.0);
    let far = |found: &[f32]| {
        let pairs = found.iter().zip(&asked);
        pairs
            .filter(|&(&level, &x)| (level - x).abs() > 1e-5)
            .count()
    };
    assert!(far(&run(&levels("x"), &asked)) > 100);
    assert_eq!(far(&run(&levels("x - low"), &asked)), 0);
}
