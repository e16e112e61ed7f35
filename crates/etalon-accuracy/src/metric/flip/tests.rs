use super::*;

const SIZE: [u32; 2] = [32, 24];
const PIXELS: usize = 32 * 24;

fn mean(values: &[f32]) -> f64 {
    values.iter().map(|&value| f64::from(value)).sum::<f64>() / values.len() as f64
}

#[test]
fn equal_pictures_do_not_differ() {
    let picture: Vec<u8> = (0..PIXELS * 3).map(|byte| (byte * 7) as u8).collect();
    let map = ldr(&picture, &picture, SIZE).unwrap();
    assert_eq!((map.values.len(), map.mean()), (PIXELS, 0.0));
    let light: Vec<[f64; 4]> = (0..PIXELS)
        .map(|pixel| [pixel as f64, 1.0, 1e-3, 0.0])
        .collect();
    let flip = hdr(&light, &light, SIZE).unwrap();
    assert_eq!((flip.map.mean(), flip.non_finite), (0.0, 0));
}

#[test]
fn black_against_white_is_the_largest_difference() {
    // The one number that the paper's definition fixes by itself: of uniform
    // pictures no feature differs, and the Hunt-adjusted HyAB distance from black to
    // white is so far beyond 0.4 of the largest that the error is close to 1.
    let map = ldr(&[0; PIXELS * 3], &[255; PIXELS * 3], SIZE).unwrap();
    assert!(
        map.values.iter().all(|&value| value > 0.95 && value <= 1.0),
        "{}",
        map.mean()
    );
    // A single step of 8 bits is hardly seen.
    let map = ldr(&[128; PIXELS * 3], &[129; PIXELS * 3], SIZE).unwrap();
    assert!(map.mean() > 0.0 && map.mean() < 0.05, "{}", map.mean());
}

#[test]
fn the_tone_mapper_is_the_papers() {
    assert_eq!(tone_map(0.0), 0.0);
    assert_eq!(tone_map(f64::INFINITY), 1.0);
    // By hand: 0.16002 x² − 0.2829 x − 0.119 = 0.
    assert!((brightest_shown() - 2.118_87).abs() < 1e-4);
    assert!((tone_map(brightest_shown()) - 0.85).abs() < 1e-12);
    // 0.9036 + 0.018 over 0.8748 + 0.354 + 0.14.
    assert!((tone_map(1.0) - 0.9216 / 1.3688).abs() < 1e-12);
}

#[test]
fn exposures_reach_from_the_brightest_to_the_median() {
    let shown = brightest_shown().log2();
    // The median of an even number is the upper of the middle two.
    let exposures = Exposures::of([1.0, 0.25, 0.5, 64.0]);
    assert!((exposures.start - (shown - 6.0)).abs() < 1e-12);
    assert!((exposures.stop - shown).abs() < 1e-12);
    assert_eq!(exposures.count, 6);
    let all: Vec<f64> = exposures.iter().collect();
    assert_eq!(all.len(), 6);
    assert_eq!(all[0], exposures.start);
    assert!((all[5] - exposures.stop).abs() < 1e-12);
    // Less than two stops are two exposures all the same.
    assert_eq!(Exposures::of([1.0, 1.0, 1.5]).count, 2);
}

#[test]
fn exposures_exist_whatever_the_median() {
    let shown = brightest_shown().log2();
    // Mostly black: of what is not, the median is 4 and the largest 16.
    let sparse = Exposures::of([0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 4.0, 16.0]);
    assert!((sparse.stop - (shown - 2.0)).abs() < 1e-12, "{sparse:?}");
    assert!((sparse.start - (shown - 4.0)).abs() < 1e-12, "{sparse:?}");
    let black = Exposures::of([0.0; 4]);
    assert_eq!((black.start, black.stop, black.count), (0.0, 0.0, 1));
    assert_eq!(Exposures::of([]), black);
    assert_eq!(Exposures::of([2.0; 4]).count, 1);
    let wide = Exposures::of([5e-324, 5e-324, f64::INFINITY]);
    assert!(wide.start.is_finite() && wide.stop.is_finite());
    assert_eq!(wide.count, MOST_EXPOSURES);
}

#[test]
fn uniform_light_is_what_ldr_flip_says_of_its_shades() {
    // Luminance 1 is shown as 0.85 at the only exposure, twice the light as
    // 0.93967, by hand: 16.3035 over 17.3502 at 2 × 2.11887; in sRGB 237 and 248.
    let truth = vec![[1.0; 3]; PIXELS];
    let found = vec![[2.0; 3]; PIXELS];
    let flip = hdr(&found, &truth, SIZE).unwrap();
    assert_eq!(flip.exposures.count, 1);
    let known = ldr(&[248; PIXELS * 3], &[237; PIXELS * 3], SIZE).unwrap();
    assert!(flip.map == known, "{} {}", flip.map.mean(), known.mean());
    assert!(flip.map.mean() > 0.0);
    // The scale of all light changes nothing.
    let dim = |pixels: &[[f64; 3]]| -> Vec<[f64; 3]> {
        pixels
            .iter()
            .map(|pixel| pixel.map(|value| value / 1024.0))
            .collect()
    };
    assert!(hdr(&dim(&found), &dim(&truth), SIZE).unwrap().map == known);
}

#[test]
fn a_fault_in_the_dark_is_seen_beside_bright_light() {
    // One pixel of 1000 hides, at its exposure, a fault at 0.001. At the median's
    // exposure it is seen.
    let mut truth = vec![[0.01; 3]; PIXELS];
    truth[0] = [1000.0; 3];
    let mut found = truth.clone();
    let fault = 12 * 32 + 20;
    found[fault] = [0.002; 3];
    let flip = hdr(&found, &truth, SIZE).unwrap();
    let worst = (0..PIXELS)
        .max_by(|&a, &b| flip.map.values[a].total_cmp(&flip.map.values[b]))
        .unwrap();
    let apart = |pixel: usize| (pixel % 32).abs_diff(20).max((pixel / 32).abs_diff(12));
    assert!(apart(worst) <= 1, "{worst}");
    let seen = flip.map.values[worst];
    assert!(seen > 0.01, "{seen}");
    // Beyond the filters' reach nothing differs.
    for pixel in (0..PIXELS).filter(|&pixel| apart(pixel) > 12) {
        assert!(
            flip.map.values[pixel] < 1e-3,
            "{pixel}: {}",
            flip.map.values[pixel]
        );
    }
    let bright = flip.exposures.start;
    assert_eq!(
        ldr(
            &super::shown(&found, bright),
            &super::shown(&truth, bright),
            SIZE
        )
        .unwrap()
        .mean(),
        0.0
    );
}

#[test]
fn pixels_that_are_not_finite_are_as_wrong_as_can_be() {
    let truth = vec![[0.5; 3]; PIXELS];
    let mut found = truth.clone();
    found[3] = [f64::NAN, 0.5, 0.5];
    found[70] = [0.5, f64::INFINITY, 0.5];
    let flip = hdr(&found, &truth, SIZE).unwrap();
    assert_eq!(flip.non_finite, 2);
    assert_eq!((flip.map.values[3], flip.map.values[70]), (1.0, 1.0));
    assert!((flip.map.mean() - 2.0 / PIXELS as f64).abs() < 1e-9);
    assert_eq!(flip.map.mean(), mean(&flip.map.values));
    assert_eq!(
        hdr(&truth, &found, SIZE),
        Err(MetricError::TruthNotFinite { count: 2 })
    );
}

#[test]
fn odd_light_has_an_answer() {
    let truth = vec![[0.0; 3]; PIXELS];
    let mut found = truth.clone();
    found[40] = [-5.0; 3];
    assert_eq!(hdr(&found, &truth, SIZE).unwrap().map.mean(), 0.0);
    found[40] = [f64::MAX; 3];
    assert!(hdr(&found, &truth, SIZE).unwrap().map.mean() > 0.0);
    // One channel is grey.
    let grey = hdr(&vec![[2.0]; PIXELS], &vec![[1.0]; PIXELS], SIZE).unwrap();
    let same = hdr(&vec![[2.0; 3]; PIXELS], &vec![[1.0; 3]; PIXELS], SIZE).unwrap();
    assert!(grey == same);
}

#[test]
fn sizes_have_to_agree() {
    assert!(matches!(
        ldr(&[0; 12], &[0; 12], [2, 2]),
        Err(MetricError::TooSmall { .. })
    ));
    assert!(matches!(
        ldr(&[0; 12], &[0; 12], [8, 8]),
        Err(MetricError::Size { .. })
    ));
    assert!(matches!(
        ldr(&[], &[], [u32::MAX, u32::MAX]),
        Err(MetricError::TooLarge { .. })
    ));
    assert!(matches!(
        ldr(&[], &[], [1 << 15, 1 << 15]),
        Err(MetricError::TooLarge { .. })
    ));
    assert_eq!(hdr::<3>(&[], &[], [0, 0]), Err(MetricError::Empty));
    assert!(matches!(
        hdr(&[[0.0; 3]; 4], &[[0.0; 3]; 4], [2, 2]),
        Err(MetricError::TooSmall { .. })
    ));
    assert!(matches!(
        hdr(&[[0.0; 3]; 4], &[[0.0; 3]; 4], [8, 8]),
        Err(MetricError::Size { .. })
    ));
    assert!(matches!(
        hdr(&[[0.0; 3]; 4], &[[0.0; 3]; 5], [2, 2]),
        Err(MetricError::Lengths { .. })
    ));
}
