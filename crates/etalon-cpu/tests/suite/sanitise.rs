//! The sanitiser finds planted faults at their lines and nothing in the stable forms of
//! the same formulas.

use crate::common;

use common::checks::{MARK, place};
use common::*;
use etalon_core::Format;
use etalon_cpu::sanitise::{Fault, HEAT_BIRTH, HEAT_UNSTABLE, Role, Sanitised, Site};
use etalon_cpu::{BoundResource, Buffer, Executor, NumberType, Program, TranslateOptions};

fn sanitising(wgsl: &str) -> Program {
    let options = TranslateOptions {
        sanitise: true,
        ..TranslateOptions::default()
    };
    translate_as(wgsl, &options).unwrap_or_else(|error| panic!("{error}\n{wgsl}"))
}

/// [`kernel`] without functions of its own.
fn body(body: &str) -> String {
    kernel("", body)
}

/// The numbers of a buffer: NaN have no bits of their own.
fn numbers(buffer: &Buffer) -> Vec<f32> {
    words(buffer).into_iter().map(f32::from_bits).collect()
}

/// What is found of a kernel, the same in every way of running.
fn find(wgsl: &str, data: &[f32]) -> Sanitised {
    let program = sanitising(wgsl);
    let input = floats(data);
    let mut first: Option<(Sanitised, Vec<f32>)> = None;
    for (name, executor) in executors() {
        let executor = executor.with_number_type(NumberType::Shadow);
        let output = buffer(&vec![0; data.len()]);
        let bound: Vec<BoundResource<'_>> = program
            .bindings()
            .iter()
            .map(|binding| BoundResource::Buffer([&input, &output][binding.binding as usize]))
            .collect();
        let groups = [data.len() as u32 / 64, 1, 1];
        let report = program
            .dispatch(&executor, groups, &bound)
            .unwrap_or_else(|error| panic!("{error}\n{program}"));
        let found = (report.sanitised, numbers(&output));
        match &first {
            None => first = Some(found),
            // As text, in which a NaN is itself.
            Some(first) => assert_eq!(
                format!("{first:?}"),
                format!("{found:?}"),
                "differs on {name}\n{program}"
            ),
        }
    }
    let (found, results) = first.unwrap();
    // Watching does not change what is computed.
    let unwatched = run_buffers(
        wgsl,
        &data.iter().map(|x| x.to_bits()).collect::<Vec<_>>(),
        data.len(),
        data.len() as u32 / 64,
    );
    let unwatched: Vec<f32> = unwatched.into_iter().map(f32::from_bits).collect();
    assert_eq!(format!("{results:?}"), format!("{unwatched:?}"));
    found
}

/// The faults and the lines they are at.
fn faults(found: &Sanitised) -> Vec<(Fault, u32)> {
    let mut faults: Vec<(Fault, u32)> = found
        .sites
        .iter()
        .flat_map(|site| {
            let faults = site.faults().into_iter();
            faults.map(|(fault, _)| (fault, site.location.line))
        })
        .collect();
    faults.sort_unstable();
    faults.dedup();
    faults
}

fn at(found: &Sanitised, line: u32, fault: Fault) -> &Site {
    found
        .sites
        .iter()
        .find(|site| {
            site.location.line == line && site.faults().iter().any(|(known, _)| *known == fault)
        })
        .unwrap_or_else(|| panic!("no {fault} at line {line}: {:?}", faults(found)))
}

/// Data for 128 invocations.
fn data(f: impl Fn(usize) -> f64) -> Vec<f32> {
    (0..128).map(|i| f(i) as f32).collect()
}

/// That a kernel has a fault at its mark and its stable form has none at all.
#[track_caller]
fn blames(fault: Fault, bad: &str, good: &str, data: &[f32]) -> Sanitised {
    let bad = body(bad);
    let line = place(&bad, 0).line;
    let found = find(&bad, data);
    let site = at(&found, line, fault);
    assert!(site.executions >= 128, "{site:?}");
    // Only what follows from it is blamed beside it.
    for (other, at) in faults(&found) {
        assert!(
            at == line || at > line && matches!(other, Fault::Inaccurate | Fault::Death),
            "{other} at line {at}, not {line}"
        );
    }
    let good = find(&body(good), data);
    assert_eq!(faults(&good), [], "the stable form");
    found
}

#[test]
fn the_small_root_of_a_quadratic() {
    let found = blames(
        Fault::Cancellation,
        "    let root = sqrt(x * x - 4.0);
    let small = /*!*/x - root;
    result[i] = small / 2.0;",
        "    let root = sqrt(x * x - 4.0);
    result[i] = 2.0 / (x + root);",
        &data(|i| 300.0 + i as f64),
    );
    let site = found
        .sites
        .iter()
        .find(|site| site.operation == "sub.f" && site.cancelled_bits > 0)
        .unwrap();
    // x - sqrt(x² - 4) is 2 / x: over 2 log₂ x bits less one are gone.
    assert!((15..19).contains(&site.cancelled_bits), "{site:?}");
    // The difference of two numbers so near is exact: all of the error was given.
    assert_eq!(site.introduced_ulps, 0.0);
    assert!(site.max_ulps > 1000.0);
    assert!(at(&found, site.location.line + 1, Fault::Inaccurate).max_relative > 1e-3);
}

#[test]
fn one_less_a_cosine() {
    blames(
        Fault::Cancellation,
        "    let c = cos(x);
    result[i] = /*!*/1.0 - c;",
        "    let s = sin(0.5 * x);
    result[i] = 2.0 * s * s;",
        &data(|i| 1e-3 * (1.0 + i as f64 / 64.0)),
    );
}

#[test]
fn variance_as_a_difference_of_means() {
    let sums = |each: &str| {
        format!(
            "    var mean = 0.0;
    for (var k = 0u; k < 64u; k++) {{ mean += data[(i + k) % 128u]; }}
    mean /= 64.0;
    var sum = 0.0;
    for (var k = 0u; k < 64u; k++) {{
        let y = data[(i + k) % 128u];
        sum += {each};
    }}
"
        )
    };
    // The deviations from a mean that carries an error of 2⁻²⁴ of 200 are accurate to
    // 2⁻⁸ of a tenth where they are small, which is why the data are exact multiples:
    // so is the mean.
    let data = data(|i| 200.0 + if i % 2 == 0 { 0.125 } else { -0.125 });
    blames(
        Fault::Cancellation,
        &format!(
            "{}    result[i] = /*!*/sum / 64.0 - mean * mean;",
            sums("y * y * 1.1").replace("y * y * 1.1", "y * y")
        )
        .replace("y = data", "y = 1.1 * data")
        .replace("mean /= 64.0", "mean *= 1.1 / 64.0"),
        &format!(
            "{}    result[i] = sum / 64.0;",
            sums("(y - mean) * (y - mean)")
        ),
        &data,
    );
}

#[test]
fn a_sphere_the_size_of_a_planet() {
    // Straight down from two metres and more above the ground.
    blames(
        Fault::Cancellation,
        "    let r = 6371000.0;
    let p = vec3f(1000.5, r + x, 0.3);
    let c = /*!*/dot(p, p) - r * r;
    result[i] = c;",
        "    let r = 6371000.0;
    let h = x;
    let across = vec2f(1000.5, 0.3);
    let c = h * (2.0 * r + h) + dot(across, across);
    result[i] = c;",
        &data(|i| 2.0 + 0.5 * (i % 8) as f64),
    );
}

#[test]
fn a_nan_that_is_born_and_lost() {
    let bad = body(
        "    let s = /*!*/sqrt(x);
    let t = s + 1.0;
    result[i] = /*!*/max(t, 0.0);",
    );
    let values = data(|i| if i == 77 || i == 101 { -1.0 } else { i as f64 });
    let found = find(&bad, &values);
    let (born, lost) = (place(&bad, 0).line, place(&bad, 1).line);
    assert_eq!(faults(&found), [(Fault::Birth, born), (Fault::Death, lost)]);
    let site = at(&found, born, Fault::Birth);
    assert_eq!(
        (site.births.times, site.births.first.invocation),
        (2, [77, 0, 0])
    );
    assert!(site.births.first.value.is_nan());
    assert_eq!((site.heat[77], site.heat[64]), (HEAT_BIRTH, 0));
    let between = found.sites.iter().find(|site| site.propagated > 0).unwrap();
    assert_eq!((between.location.line, between.propagated), (born + 1, 2));
    assert_eq!(
        at(&found, lost, Fault::Death).deaths.first.invocation,
        [77, 0, 0]
    );
    let good = body("    result[i] = sqrt(max(x, 0.0)) + 1.0;");
    assert_eq!(faults(&find(&good, &values)), []);
}

#[test]
fn infinities_are_born_too() {
    let bad = body("    result[i] = 1.0 / (1.0 + /*!*/exp(x));");
    let found = find(&bad, &data(|i| i as f64));
    let line = place(&bad, 0).line;
    // 1 / ∞ is 0, and nobody knows any more.
    assert_eq!(faults(&found), [(Fault::Birth, line), (Fault::Death, line)]);
    assert_eq!(
        at(&found, line, Fault::Birth).births.first.invocation,
        [89, 0, 0]
    );
}

#[test]
fn a_loop_that_ends_a_step_too_early_or_late() {
    let found = blames(
        Fault::UnstableBranch,
        "    var t = 0.0;
    var steps = 0.0;
    while (/*!*/t < 1.0) {
        t += x;
        steps += 1.0;
    }
    result[i] = steps;",
        "    let count = u32(1.0 / x + 0.5);
    var steps = 0.0;
    for (var k = 0u; k < count; k++) { steps += 1.0; }
    result[i] = steps;",
        &data(|i| 1.0 / (3.0 + i as f64)),
    );
    let diverged = found.diverged.iter().filter(|&&diverged| diverged).count();
    let site = found
        .sites
        .iter()
        .find(|site| site.unstable.times > 0)
        .unwrap();
    assert_eq!(site.role, Role::Comparison);
    assert_eq!(diverged as u64, site.unstable.times, "each leaves once");
    assert!(diverged > 10 && diverged < 100, "{diverged}");
    assert!(site.unstable_margin > 0.0 && site.unstable_margin < 1e-5);
    let first = site.unstable.first.invocation[0] as usize;
    assert_eq!(site.heat[first], HEAT_UNSTABLE);
    assert!(found.diverged[first] && !found.diverged[..first].contains(&true));
    // What they do afterwards is counted apart.
    assert!(found.sites.iter().any(|site| site.after_divergence > 0));
}

#[test]
fn a_texel_that_may_be_its_neighbour() {
    blames(
        Fault::UnstableIndex,
        "    let u = f32(i) / 49.0;
    let texel = /*!*/u32(u * 49.0);
    result[i] = f32(texel) + x;",
        "    let u = (f32(i) + 0.5) / 49.0;
    let texel = u32(u * 49.0);
    result[i] = f32(texel) + x;",
        &data(|i| i as f64),
    );
    // And where the number stays one.
    blames(
        Fault::UnstableIndex,
        "    let u = f32(i) / 49.0;
    result[i] = /*!*/floor(u * 49.0) + x;",
        "    let u = (f32(i) + 0.5) / 49.0;
    result[i] = floor(u * 49.0) + x;",
        &data(|i| i as f64),
    );
}

#[test]
fn functions_that_blow_up_what_they_are_given() {
    blames(
        Fault::Amplification,
        "    let angle = x * 1.1;
    result[i] = /*!*/sin(angle);",
        "    let angle = x * 1e-6;
    result[i] = sin(angle);",
        &data(|i| 1e6 + i as f64),
    );
}

#[test]
fn branches_not_taken_are_not_looked_at() {
    let wgsl = body(
        "    var y = 1.0;
    if (x > 0.0) { y = 1.0 / x; }
    if (x > 1e30) { y = sqrt(-x); }
    result[i] = y;",
    );
    let found = find(&wgsl, &data(|i| if i % 3 == 0 { 0.0 } else { i as f64 }));
    assert_eq!(faults(&found), []);
    let division = found
        .sites
        .iter()
        .find(|site| site.operation == "div.f")
        .unwrap();
    assert_eq!(division.executions, 85);
    assert!(!found.sites.iter().any(|site| site.operation == "sqrt.f"));
}

#[test]
fn formats_say_what_is_visible() {
    let wgsl = "@group(0) @binding(0) var picture: texture_storage_2d<rgba16float, write>;
@compute @workgroup_size(8, 8) fn main(@builtin(global_invocation_id) id: vec3u) {
    let x = f32(id.x) * 0.1 + 1e-6;
    textureStore(picture, id.xy, vec4f(x, x * 1e-7, 70000.0 * f32(id.y), 1.0));
}
";
    let program = sanitising(wgsl);
    let picture = empty(24, 10, Format::Rgba16Float);
    let executor = Executor::new(2)
        .unwrap()
        .with_number_type(NumberType::Shadow);
    let bound = [BoundResource::Texture(picture.view())];
    let found = program
        .dispatch(&executor, [3, 2, 1], &bound)
        .unwrap()
        .sanitised;
    assert_eq!(found.grid, [24, 16]);
    let store = found
        .sites
        .iter()
        .find(|site| site.role == Role::Store)
        .unwrap();
    assert_eq!(store.operation, "store picture");
    assert_eq!(store.executions, 24 * 16);
    // The third channel beyond the format's range, the second below its least number.
    assert!((store.of_range - 70000.0 * 15.0 / 65504.0).abs() < 1e-6);
    assert_eq!(store.subnormal, 24 * 16 + 16, "of x at the left as well");
    assert_eq!(store.floor, 1.0 / 16384.0);
    // An error of a rounding or two in each product.
    assert!(
        store.max_ulps > 0.0 && store.max_relative < 4e-7,
        "{store:?}"
    );
    assert_eq!(faults(&found), []);
    assert_eq!(store.heat.len(), 24 * 16);
}

#[test]
fn errors_are_told_apart_as_made_and_given() {
    let wgsl = body(
        "    let a = x * 1.1;
    let b = a * 3.0;
    let c = b - a;
    result[i] = c;",
    );
    let found = find(&wgsl, &data(|i| 1.0 + i as f64 / 7.0));
    assert_eq!(faults(&found), []);
    let products: Vec<&Site> = found
        .sites
        .iter()
        .filter(|s| s.operation == "mul.f")
        .collect();
    let [first, second] = products[..] else {
        panic!("{products:?}");
    };
    assert!(first.introduced_ulps <= 0.5 && first.max_ulps == first.introduced_ulps);
    assert!(second.introduced_ulps <= 0.5 && second.max_ulps > second.introduced_ulps);
    for site in products {
        assert!(site.p99_ulps <= site.max_ulps && site.max_bits() < 1.5);
        assert!(f64::from(site.worst.value) != site.worst.exact);
    }
}

#[test]
fn other_programs_have_no_trace_of_it() {
    let wgsl = body("    result[i] = sqrt(x);");
    let listing = program(&wgsl).to_string();
    assert!(!listing.contains("probe"), "{listing}");
    assert!(sanitising(&wgsl).to_string().contains("probe"));
    assert_eq!(MARK.len(), 5);
}
