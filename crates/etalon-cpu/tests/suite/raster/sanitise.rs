//! The sanitiser and the number types in kernels that draw.

use crate::common;

use common::checks::place;
use common::raster::*;
use etalon_core::raster::DepthState;
use etalon_cpu::sanitise::{Fault, Role, Sanitised, Site};
use etalon_cpu::{DrawSanitised, Executor, NumberType};

/// Odd, so that quads reach over both edges.
const SIZE: [u32; 2] = [37, 23];
const PIXELS: u64 = 37 * 23;

/// Two triangles that share the picture's diagonal.
const WHOLE: [[f32; 4]; 6] = [
    [-1.0, -1.0, 0.5, 1.0],
    [1.0, -1.0, 0.5, 1.0],
    [-1.0, 1.0, 0.5, 1.0],
    [-1.0, 1.0, 0.5, 1.0],
    [1.0, -1.0, 0.5, 1.0],
    [1.0, 1.0, 0.5, 1.0],
];

const VERTEX: &str = "@vertex fn vertex(@location(0) position: vec4f) -> @builtin(position) vec4f {
    return position;
}
";

fn fragment(body: &str) -> String {
    format!(
        "{VERTEX}@fragment fn fragment(@builtin(position) at: vec4f) -> @location(0) vec4f {{\n{body}\n}}"
    )
}

/// What is found of a draw, the same in every way of drawing, of which none changes what
/// is drawn.
fn find(wgsl: &str) -> DrawSanitised {
    let mut scene = Scene::new(wgsl, SIZE, &WHOLE);
    let unwatched = scene.draw_once().bytes();
    scene.sanitise = true;
    let program = scene.program();
    let mut first: Option<DrawSanitised> = None;
    for (name, executor) in ways() {
        let executor = executor.with_number_type(NumberType::Shadow);
        let targets = scene.targets();
        let report = scene.try_draw(&program, &executor, &targets, &[]);
        let found = report.unwrap_or_else(|error| panic!("{error}")).sanitised;
        assert!(targets.bytes() == unwatched, "{name}");
        match &first {
            None => first = Some(found),
            // As text, in which a NaN is itself.
            Some(first) => assert_eq!(format!("{first:?}"), format!("{found:?}"), "{name}"),
        }
    }
    first.unwrap()
}

fn faults(found: &Sanitised) -> Vec<(Fault, u32)> {
    let sites = found.sites.iter();
    sites
        .flat_map(|site| {
            let line = site.location.line;
            let faults = site.faults().into_iter();
            faults.map(move |(fault, _)| (fault, line))
        })
        .collect()
}

fn at(found: &Sanitised, fault: Fault) -> &Site {
    let has = |site: &&Site| site.faults().iter().any(|(known, _)| *known == fault);
    let site = found.sites.iter().find(has);
    site.unwrap_or_else(|| panic!("no {fault}: {:?}", faults(found)))
}

#[test]
fn a_fragment_that_loses_its_digits_is_found_at_its_line_and_pixel() {
    let bad = fragment(
        "    let x = at.x * 1e-3;
    let small = /*!*/sqrt(1.0 + x * x) - 1.0;
    return vec4f(small, x, 0.0, 1.0);",
    );
    let found = find(&bad);
    assert_eq!(faults(&found.vertices), []);
    let line = place(&bad, 0).line;
    let lost = at(&found.fragments, Fault::Cancellation);
    assert_eq!(
        (lost.location.line, lost.operation.as_str()),
        (line, "sub.f")
    );
    // Each pixel once: neither helpers nor the other triangle count.
    assert_eq!(lost.executions, PIXELS);
    let [x, y, z] = lost.worst.invocation;
    assert!(x < SIZE[0] && y < SIZE[1] && z == 0);
    let near = (x as f32 + 0.5) * 1e-3;
    assert_eq!(lost.worst.value, (1.0 + near * near).sqrt() - 1.0);
    // Where every row is the same the first one is named.
    assert_eq!(y, 0);
    let stored = at(&found.fragments, Fault::Inaccurate);
    assert_eq!((stored.location.line, stored.role), (line + 1, Role::Store));
    assert_eq!(stored.operation, "give 0");
    // A map of the picture, in which columns are alike.
    assert_eq!(found.fragments.grid, SIZE);
    let rows: Vec<&[u8]> = lost.heat.chunks(SIZE[0] as usize).collect();
    assert_eq!(rows.len(), SIZE[1] as usize);
    assert!(rows.iter().all(|row| *row == rows[0]));
    assert!(rows[0][x as usize] > 100, "{:?}", rows[0]);
    let good = fragment(
        "    let x = at.x * 1e-3;
    let small = x * x / (sqrt(1.0 + x * x) + 1.0);
    return vec4f(small, x, 0.0, 1.0);",
    );
    assert_eq!(faults(&find(&good).fragments), []);
}

#[test]
fn a_nan_is_born_in_the_pixels_that_make_it() {
    let bad = fragment(
        "    let root = /*!*/sqrt(20.0 - at.x);
    return vec4f(max(root, 0.0), 0.0, 0.0, 1.0);",
    );
    let found = find(&bad).fragments;
    let born = at(&found, Fault::Birth);
    assert_eq!(born.location.line, place(&bad, 0).line);
    assert_eq!(born.births.times, 17 * 23);
    assert_eq!(born.births.first.invocation, [20, 0, 0]);
    assert_eq!(at(&found, Fault::Death).deaths.times, 17 * 23);
}

#[test]
fn what_is_discarded_gives_no_colour() {
    let found = find(&fragment(
        "    if (u32(at.x) + u32(at.y)) % 2u == 1u { discard; }
    return vec4f(sqrt(at.x), 0.0, 0.0, 1.0);",
    ));
    let given = found.fragments.sites.iter();
    let given: Vec<u64> = given
        .filter(|site| site.role == Role::Store)
        .map(|site| site.executions)
        .collect();
    assert_eq!(given, [PIXELS.div_ceil(2)]);
}

#[test]
fn a_vertex_that_loses_its_digits_is_found() {
    let bad = "@vertex fn vertex(@location(0) position: vec4f) -> @builtin(position) vec4f {
    let x = position.x * 1e-3;
    let small = /*!*/sqrt(1.0 + x * x) - 1.0;
    return vec4f(position.xy, small, 1.0);
}
@fragment fn fragment() -> @location(0) vec4f { return vec4f(1.0); }";
    let found = find(bad);
    let lost = at(&found.vertices, Fault::Cancellation);
    assert_eq!(lost.location.line, place(bad, 0).line);
    assert_eq!(lost.executions, 6);
    assert!(lost.worst.invocation[0] < 6);
    assert!(lost.heat.is_empty() && found.vertices.grid == [0, 0]);
}

/// Programs without probes find nothing, and kernels without faults have none.
#[test]
fn nothing_is_found_unless_it_is_asked_for() {
    let wgsl = fragment("    return vec4f(sqrt(1.0 + at.x * 1e-8) - 1.0);");
    let scene = Scene::new(&wgsl, SIZE, &WHOLE);
    let executor = Executor::new(2).unwrap();
    let executor = executor.with_number_type(NumberType::Shadow);
    let report = scene.try_draw(&scene.program(), &executor, &scene.targets(), &[]);
    assert_eq!(report.unwrap().sanitised, DrawSanitised::default());
}

/// Fragments of `f64` are rounded once; triangles are where those of `f32` are.
#[test]
fn fragments_compute_in_the_number_type_and_triangles_do_not() {
    let wgsl = "struct Corner { @builtin(position) place: vec4f, @location(0) part: f32 }
    @vertex fn vertex(@location(0) position: vec4f) -> Corner {
        return Corner(vec4f(position.xyz * 0.7, 1.0 + position.x * 0.1), position.y * 0.3);
    }
    @fragment fn fragment(in: Corner) -> @location(0) vec4f {
        return vec4f(sqrt(in.part * in.part + 1.0) - 1.0, in.part, exp(in.part), 1.0);
    }";
    let mut scene = Scene::new(wgsl, SIZE, &WHOLE);
    scene.depth = Some(etalon_core::Format::Depth32Float);
    scene.clear_depth = 0.0;
    scene.state.depth = Some(DepthState::REVERSED);
    let program = scene.program();
    let mut drawn = NumberType::ALL.map(|number_type| {
        let executor = Executor::new(2).unwrap();
        let executor = executor.with_number_type(number_type);
        let targets = scene.targets();
        let report = scene.try_draw(&program, &executor, &targets, &[]);
        assert!(report.unwrap().counters.quads > 50);
        targets
    });
    let [singles, doubles, shadowed] = &mut drawn;
    assert!(singles.bytes() == shadowed.bytes());
    assert_eq!(singles.depths(), doubles.depths());
    let (mut covered, mut differ) = (0, 0);
    for (single, double) in singles.colour(0).into_iter().zip(doubles.colour(0)) {
        // What is interpolated is of one type.
        assert_eq!(single[1], double[1]);
        let part = f64::from(double[1]);
        let (root, power) = (part.hypot(1.0) - 1.0, part.exp());
        if double[3] == 1.0 {
            covered += 1;
            // The digits that f64 has beyond f32 are lost where `part` is small.
            let slack = 1e-6 * root.abs() + 4.0 * f64::EPSILON;
            assert!(
                (f64::from(double[0]) - root).abs() <= slack,
                "{double:?} {root}"
            );
            assert!((f64::from(double[2]) - power).abs() <= 1e-7 * power);
            differ += u32::from(single[0] != double[0]);
        }
    }
    assert!(covered > 300 && differ > covered / 2, "{covered} {differ}");
}
