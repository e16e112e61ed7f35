//! HDR-FLIP against the program of its authors.

use etalon_accuracy::metric::flip::{hdr, ldr};

const SIZE: [u32; 2] = [64, 48];

/// Eight stops from left to right with checks on them, the first picture with brighter
/// dots and a dark square. Every number is rounded to `f32`.
fn pictures() -> [Vec<[f64; 3]>; 2] {
    let mut pictures = [Vec::new(), Vec::new()];
    for (y, x) in (0..SIZE[1]).flat_map(|y| (0..SIZE[0]).map(move |x| (y, x))) {
        let base = ((f64::from(x) - 40.0) / 8.0).exp2();
        let check = 1.0 + 0.5 * f64::from((x / 4 + y / 4) % 2);
        let truth = [base * check, base, base * (0.5 + f64::from(y) / 96.0)];
        let factor = if (20..28).contains(&x) && (10..18).contains(&y) {
            0.5
        } else if (x * 7 + y * 13) % 11 == 0 {
            1.25
        } else {
            1.0
        };
        pictures[0].push(truth.map(|value| f64::from((value * factor) as f32)));
        pictures[1].push(truth.map(|value| f64::from(value as f32)));
    }
    pictures
}

/// What `flip-evaluator` 1.7, which never rounds light to 8 bits, says of these pictures.
const START: f64 = -1.932_533_3;
const STOP: f64 = 2.099_665_2;
const MEAN: f64 = 0.060_097_8;
const PIXELS: [([usize; 2], f32); 6] = [
    ([24, 14], 0.619_146),
    ([0, 0], 0.169_376),
    ([33, 0], 0.117_953),
    ([50, 40], 0.015_043),
    ([60, 45], 0.025_801),
    ([10, 30], 0.068_739),
];

/// The most that one step of 8 bits is seen as, over all greys. Rounding moves both
/// pictures by half a step at most, and an error grows by no more than that of what is
/// added to a difference, as it grows ever slower.
fn step() -> f64 {
    let uniform = |shade: u8| vec![shade; 16 * 16 * 3];
    let seen = |shade| ldr(&uniform(shade), &uniform(shade + 1), [16, 16]).unwrap();
    (0..255).map(|shade| seen(shade).mean()).fold(0.0, f64::max)
}

#[test]
fn it_is_what_the_authors_program_says() {
    let [found, truth] = pictures();
    let flip = hdr(&found, &truth, SIZE).unwrap();
    // To what `f32` holds of the largest light and the median.
    assert!((flip.exposures.start - START).abs() < 1e-5);
    assert!((flip.exposures.stop - STOP).abs() < 1e-5);
    assert_eq!(flip.exposures.count, 5);
    let step = step();
    for ([x, y], want) in PIXELS {
        let got = flip.map.values[y * SIZE[0] as usize + x];
        assert!(
            f64::from((got - want).abs()) < step,
            "{x}, {y}: {got}, not {want}"
        );
    }
    // Over 3072 pixels rounding up and down evens out; a tenth is left for what does not.
    let off = (flip.map.mean() - MEAN).abs();
    println!("{off} of {step}");
    assert!(off < 0.1 * step, "{}", flip.map.mean());
    // The dark square alone is another error.
    let mut spotless = found;
    for (k, (found, truth)) in spotless.iter_mut().zip(&truth).enumerate() {
        if found[1] > truth[1] {
            *found = truth.map(|value| value * if k % 2 == 0 { 1.1 } else { 1.0 });
        }
    }
    let other = hdr(&spotless, &truth, SIZE).unwrap().map.mean();
    assert!((other - MEAN).abs() > 0.2 * step, "{other}");
}
