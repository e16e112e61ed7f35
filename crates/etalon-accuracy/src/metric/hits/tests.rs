use super::*;

/// Each pixel hits the point that a function gives, in pixels.
fn field(
    [width, height]: [u32; 2],
    hit: impl Fn(f64, f64) -> Option<[f64; 2]>,
) -> Vec<Option<[f64; 2]>> {
    let mut field = Vec::new();
    for y in 0..height {
        for x in 0..width {
            let hit = hit(f64::from(x), f64::from(y));
            field.push(hit.map(|[u, v]| [u / f64::from(width), v / f64::from(height)]));
        }
    }
    field
}

#[test]
fn the_truth_itself_is_found_whole() {
    let size = [8, 4];
    let truth = field(size, |x, y| (x < 5.0).then_some([7.0 - x, y]));
    let found = hits(&truth, &truth, size).unwrap();
    assert_eq!(found.all.precision(), Some(1.0));
    assert_eq!(found.all.recall(), Some(1.0));
    assert_eq!(found.all.located(), Some(1.0));
    let distance = found.all.distance.unwrap();
    assert_eq!(
        (distance.median, distance.p95, distance.largest),
        (0.0, 0.0, 0.0)
    );
    // The columns at either side of where hits end.
    assert_eq!(found.silhouette.pixels, 2 * 4);
    assert_eq!(
        found.interior.pixels + found.silhouette.pixels,
        found.all.pixels
    );
    assert_eq!(found.non_finite, NonFinite::default());
}

#[test]
fn planted_faults_are_counted_where_they_are() {
    let size = [10, 10];
    let truth = field(size, |x, y| (x < 8.0).then_some([x, y]));
    let mut found = truth.clone();
    // Two hits lost, three hits made up, one hit 3-4-5 pixels off.
    found[0] = None;
    found[1] = None;
    for y in 0..3 {
        found[y * 10 + 9] = Some([0.5, 0.5]);
    }
    let [u, v] = truth[55].unwrap();
    found[55] = Some([u + 0.3, v + 0.4]);
    let measured = hits(&found, &truth, size).unwrap();
    let all = measured.all;
    assert_eq!((all.true_hits, all.found_hits, all.both), (80, 81, 78));
    assert_eq!(all.precision(), Some(78.0 / 81.0));
    assert_eq!(all.recall(), Some(78.0 / 80.0));
    assert_eq!(all.located(), Some(77.0 / 80.0));
    let distance = all.distance.unwrap();
    assert_eq!((distance.median, distance.p95), (0.0, 0.0));
    assert!((distance.largest - 5.0).abs() < 1e-9, "{distance:?}");
    // Column 9 is no neighbour of a hit; the lost ones are in the interior.
    assert_eq!(measured.silhouette.both, measured.silhouette.true_hits);
    assert_eq!(measured.interior.both, measured.interior.true_hits - 2);
}

#[test]
fn distances_are_in_pixels_of_either_axis() {
    let truth = [Some([0.5, 0.5]); 8];
    let found = truth.map(|_| Some([0.75, 0.5]));
    let wide = hits(&found, &truth, [8, 1]).unwrap();
    assert_eq!(wide.all.distance.unwrap().median, 2.0);
    let tall = hits(&found, &truth, [1, 8]).unwrap();
    assert_eq!(tall.all.distance.unwrap().median, 0.25);
}

#[test]
fn smooth_change_is_no_silhouette_however_steep() {
    // Steps of 3 pixels, which grow by a hundredth of a pixel.
    let size = [40, 12];
    let smooth = field(size, |x, y| Some([3.0 * x + 0.005 * x * x, y]));
    assert!(silhouette(&smooth, size).unwrap().iter().all(|&edge| !edge));
    // A crease: steps of 3 pixels, then of 8.
    let crease = field(size, |x, y| {
        Some([if x < 20.0 { 3.0 * x } else { 8.0 * x - 100.0 }, y])
    });
    assert!(silhouette(&crease, size).unwrap().iter().all(|&edge| !edge));
}

#[test]
fn a_jump_is_a_silhouette_on_both_sides() {
    let size = [12, 3];
    // The other surface begins 5 pixels beyond.
    let jump = field(size, |x, y| Some([x + if x < 6.0 { 0.0 } else { 5.0 }, y]));
    let edges = silhouette(&jump, size).unwrap();
    let columns: Vec<usize> = (0..12).filter(|&x| edges[12 + x]).collect();
    assert_eq!(columns, [5, 6]);
    // Less than the stated jump beyond smooth change is none.
    let small = field(size, |x, y| Some([x + if x < 6.0 { 0.0 } else { 0.9 }, y]));
    assert!(silhouette(&small, size).unwrap().iter().all(|&edge| !edge));
    // Down a column as well.
    let turned = field([3, 12], |x, y| {
        Some([x, y + if y < 6.0 { 0.0 } else { 5.0 }])
    });
    let edges = silhouette(&turned, [3, 12]).unwrap();
    let rows: Vec<usize> = (0..12).filter(|&y| edges[y * 3 + 1]).collect();
    assert_eq!(rows, [5, 6]);
    // Two pixels have nothing beside them that explains their step.
    assert_eq!(
        silhouette(&[Some([0.0, 0.0]), Some([1.0, 0.0])], [2, 1]),
        Ok(vec![true, true])
    );
}

#[test]
fn hits_without_a_position_are_wrong_and_counted() {
    let size = [5, 1];
    let truth = [
        Some([0.0, 0.0]),
        Some([0.2, 0.0]),
        Some([0.4, 0.0]),
        Some([f64::NAN, 0.0]),
        Some([0.8, 0.0]),
    ];
    let mut found = truth;
    found[1] = Some([f64::INFINITY, 0.0]);
    found[3] = Some([0.6, 0.0]);
    let measured = hits(&found, &truth, size).unwrap();
    assert_eq!(measured.non_finite, NonFinite { found: 1, truth: 1 });
    assert_eq!(measured.all.pixels, 4);
    assert_eq!(measured.all.precision(), Some(0.75));
    assert_eq!(measured.all.recall(), Some(0.75));
    assert_eq!(measured.all.distance.unwrap().largest, 0.0);
}

#[test]
fn nothing_found_and_nothing_there_have_no_share() {
    let none = [None; 4];
    let hit = [Some([0.5, 0.5]); 4];
    let lost = hits(&none, &hit, [2, 2]).unwrap().all;
    assert_eq!((lost.precision(), lost.recall()), (None, Some(0.0)));
    assert_eq!(lost.distance, None);
    let made_up = hits(&hit, &none, [2, 2]).unwrap().all;
    assert_eq!((made_up.precision(), made_up.recall()), (Some(0.0), None));
}

#[test]
fn sizes_have_to_agree() {
    let one = [Some([0.0, 0.0])];
    assert_eq!(hits(&[], &[], [0, 0]), Err(MetricError::Empty));
    assert!(matches!(
        hits(&one, &[], [1, 1]),
        Err(MetricError::Lengths { .. })
    ));
    assert!(matches!(
        hits(&one, &one, [2, 1]),
        Err(MetricError::Size { .. })
    ));
    assert!(silhouette(&one, [1, 1]).is_ok());
}
