//! Number types wider than `f32`: against the same computation in `f64`, and
//! what storage keeps of it.

use crate::common;

use common::*;
use etalon_core::Format;
use etalon_cpu::{BoundResource, Buffer, Executor, NumberType, Program, Texture, Tier};

/// Every way of running a number type that must give the same bits.
fn executors_of(number_type: NumberType) -> Vec<(String, Executor)> {
    let all = executors().into_iter();
    all.map(|(name, executor)| {
        (
            format!("{number_type}, {name}"),
            executor.with_number_type(number_type),
        )
    })
    .collect()
}

fn executor(number_type: NumberType) -> Executor {
    Executor::new(1).unwrap().with_number_type(number_type)
}

/// What a kernel over `data` (binding 0) leaves in `result` (binding 1): the
/// words, and what they are in the wide plane.
#[derive(Clone, Debug)]
struct Run {
    words: Vec<u32>,
    wide: Vec<Option<f64>>,
}

fn bits(values: &[Option<f64>]) -> Vec<Option<u64>> {
    // The payload of a NaN is nobody's promise.
    let canonical = |value: f64| if value.is_nan() { f64::NAN } else { value };
    values
        .iter()
        .map(|value| value.map(|value| canonical(value).to_bits()))
        .collect()
}

fn dispatch(
    program: &Program,
    executor: &Executor,
    data: &Buffer,
    results: usize,
    workgroups: u32,
) -> Run {
    let result = buffer(&vec![0; results]).widen().unwrap();
    let bound: Vec<BoundResource<'_>> = program
        .bindings()
        .iter()
        .map(|binding| BoundResource::Buffer([data, &result][binding.binding as usize]))
        .collect();
    program
        .dispatch(executor, [workgroups, 1, 1], &bound)
        .unwrap_or_else(|error| panic!("{error}\n{program}"));
    Run {
        words: words(&result),
        wide: result.to_f64().unwrap(),
    }
}

/// Runs in every way and checks that all agree.
fn run(wgsl: &str, number_type: NumberType, data: &[f32], results: usize, workgroups: u32) -> Run {
    let program = program(wgsl);
    let data = floats(data);
    let mut first: Option<Run> = None;
    for (name, executor) in executors_of(number_type) {
        let got = dispatch(&program, &executor, &data, results, workgroups);
        match &first {
            None => first = Some(got),
            Some(first) => {
                let single = |word: &u32| f32::from_bits(*word);
                assert!(
                    first
                        .words
                        .iter()
                        .zip(&got.words)
                        .all(|(a, b)| a == b || single(a).is_nan() && single(b).is_nan()),
                    "{name}: words differ\n{program}"
                );
                assert_eq!(bits(&first.wide), bits(&got.wide), "{name}\n{program}");
            }
        }
    }
    first.unwrap()
}

/// A kernel of one expression in `x`, over all data.
fn expression(body: &str) -> String {
    format!(
        "@group(0) @binding(0) var<storage, read> data: array<f32>;
         @group(0) @binding(1) var<storage, read_write> result: array<f32>;
         @compute @workgroup_size(64)
         fn main(@builtin(global_invocation_id) id: vec3<u32>) {{
             let x = data[id.x];
             {body}
         }}"
    )
}

fn inputs() -> Vec<f32> {
    (0..128).map(|i| 0.013 + i as f32 * 0.37).collect()
}

#[test]
fn arithmetic_is_that_of_f64() {
    let wgsl = expression(
        "var sum = 0.0;
         for (var i = 0; i < 20; i++) {
             let t = f32(i) + x;
             sum += (t * t - 0.1) / (sqrt(t) + 3.0) - floor(t * 1.7) * 0.3 + abs(sum) % 0.7;
         }
         result[id.x] = min(max(sum, -40.5), 1.0e6) + 0.1;",
    );
    let data = inputs();
    let got = run(&wgsl, NumberType::F64, &data, 128, 2);
    for (i, &x) in data.iter().enumerate() {
        let x = f64::from(x);
        let literal = |value: f32| f64::from(value);
        let mut sum = 0.0_f64;
        for i in 0..20 {
            let t = f64::from(i) + x;
            let rest = {
                let (a, b) = (sum.abs(), literal(0.7));
                a - b * (a / b).trunc()
            };
            sum += (t * t - literal(0.1)) / (t.sqrt() + 3.0)
                - (t * literal(1.7)).floor() * literal(0.3)
                + rest;
        }
        let expected = sum.clamp(-40.5, 1.0e6) + literal(0.1);
        assert_eq!(got.wide[i], Some(expected), "{i}");
        assert_eq!(got.words[i], (expected as f32).to_bits(), "{i}");
    }
}

#[test]
fn functions_are_those_of_f64() {
    type Function = (&'static str, fn(f64) -> f64);
    let functions: [Function; 16] = [
        ("exp(-x)", |x| (-x).exp()),
        ("exp2(x)", f64::exp2),
        ("log(x)", f64::ln),
        ("log2(x)", f64::log2),
        ("sin(x)", f64::sin),
        ("cos(x)", f64::cos),
        ("tan(x)", f64::tan),
        ("asin(x / 64.0)", |x| (x / 64.0).asin()),
        ("acos(x / 64.0)", |x| (x / 64.0).acos()),
        ("atan(x)", f64::atan),
        ("atan2(x, 3.0 - x)", |x| x.atan2(3.0 - x)),
        ("sinh(x)", f64::sinh),
        ("tanh(x / 16.0)", |x| (x / 16.0).tanh()),
        ("asinh(x)", f64::asinh),
        ("pow(x, 2.5)", |x| x.powf(2.5)),
        ("inverseSqrt(x)", |x| 1.0 / x.sqrt()),
    ];
    let data = inputs();
    for (text, function) in functions {
        let wgsl = expression(&format!("result[id.x] = {text};"));
        let got = run(&wgsl, NumberType::F64, &data, 128, 2);
        for (i, &x) in data.iter().enumerate() {
            let want = function(x.into());
            let value = got.wide[i].unwrap();
            // The functions are within 4 units (pow here: 3.25), the platform's
            // within 1, and a unit is at most 2^-52 of the value.
            assert!(
                (value - want).abs() <= 5.0 * f64::EPSILON * want.abs(),
                "{text} at {x}: {value:e}, not {want:e}"
            );
        }
    }
}

/// Textbook cancellation: the shadow shows how far the `f32` is off, and the
/// `f32` is what it always was.
#[test]
fn the_shadow_shows_cancellation() {
    let cosine = "result[id.x] = (1.0 - cos(x)) / (x * x);";
    // The smaller root of t² - 1000 (1 + x) t + 1.
    let root = "let b = 1000.0 * (1.0 + x); result[id.x] = (b - sqrt(b * b - 4.0)) / 2.0;";
    let data: Vec<f32> = (0..64).map(|i| 1.0e-3 * (1.0 + i as f32 / 64.0)).collect();
    let exact_cosine = |x: f64| 2.0 * (x / 2.0).sin().powi(2) / (x * x);
    let exact_root = |x: f64| {
        let b = 1000.0 * (1.0 + x);
        2.0 / (b + (b * b - 4.0).sqrt())
    };
    let cases: [(&str, &dyn Fn(f64) -> f64); 2] = [(cosine, &exact_cosine), (root, &exact_root)];
    for (body, exact) in cases {
        let wgsl = expression(body);
        let single = run(&wgsl, NumberType::F32, &data, 64, 1);
        let shadow = run(&wgsl, NumberType::Shadow, &data, 64, 1);
        let double = run(&wgsl, NumberType::F64, &data, 64, 1);
        assert_eq!(single.words, shadow.words);
        assert_eq!(bits(&shadow.wide), bits(&double.wide));
        let mut worst = 0.0_f64;
        for (i, &x) in data.iter().enumerate() {
            let want = exact(x.into());
            // What is lost here is 2^-53 of operands 10^6 times the result,
            // and a few times that for the operations around it.
            let value = shadow.wide[i].unwrap();
            assert!(
                (value / want - 1.0).abs() < 4.0e6 * f64::EPSILON,
                "{body} at {x}"
            );
            let seen = f64::from(f32::from_bits(shadow.words[i]));
            worst = worst.max((seen / value - 1.0).abs());
        }
        // In f32 nothing is left of it: the operands' unit is 6e-8, the results
        // are 5e-7 and 1e-3 (of a thousand).
        assert!(worst > 0.01, "{body}: {worst}");
    }
}

#[test]
fn the_shadow_goes_where_the_f32_goes() {
    // In f64 the small number survives, and all conditions turn out otherwise.
    let wgsl = expression(
        "let left = (1.0 + x) - 1.0;
         var value = 0.0;
         if (left == 0.0) { value = 1.0 + x; } else { value = 2.0 + x; }
         for (var i = 0; f32(i) < 3.0 + left * 0.5e9; i++) { value += 10.0; }
         value += select(100.0, 200.0, left > 0.0);
         var table = array<f32, 2>(1000.0, 2000.0);
         value += table[i32(left * 1.5e9)];
         result[id.x] = value;",
    );
    let x = 1.0e-9_f32;
    let data = vec![x; 64];
    let single = run(&wgsl, NumberType::F32, &data, 64, 1);
    let shadow = run(&wgsl, NumberType::Shadow, &data, 64, 1);
    let double = run(&wgsl, NumberType::F64, &data, 64, 1);
    assert_eq!(f32::from_bits(single.words[0]), 1131.0);
    assert_eq!(single.words, shadow.words);
    let x = f64::from(x);
    let along_f32 = 1.0 + x + 10.0 + 10.0 + 10.0 + 100.0 + 1000.0;
    let along_f64 = 2.0 + x + 10.0 + 10.0 + 10.0 + 10.0 + 200.0 + 2000.0;
    assert_eq!(shadow.wide[7], Some(along_f32));
    assert_eq!(double.wide[7], Some(along_f64));
}

/// A small generator of numbers.
struct Random(u64);

impl Random {
    fn below(&mut self, limit: u32) -> u32 {
        self.0 = self
            .0
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 33) as u32 % limit
    }
}

/// A straight line of operations on values by number, each exact to IEEE 754.
#[derive(Clone, Copy, Debug)]
enum Line {
    Constant(f32),
    Unary(u32, usize),
    Binary(u32, usize, usize),
}

type Unary = (&'static str, fn(f64) -> f64);

const UNARY: [Unary; 5] = [
    ("abs(A)", f64::abs),
    ("sqrt(abs(A))", |a| a.abs().sqrt()),
    ("floor(A)", f64::floor),
    ("round(A)", f64::round_ties_even),
    ("(-A)", |a| -a),
];
type Binary = (&'static str, fn(f64, f64) -> f64);

const BINARY: [Binary; 6] = [
    ("(A + B)", |a, b| a + b),
    ("(A - B)", |a, b| a - b),
    ("(A * B)", |a, b| a * b),
    ("(A / (abs(B) + 0.5))", |a, b| a / (b.abs() + 0.5)),
    ("min(A, B)", |a, b| if a < b { a } else { b }),
    ("max(A, B)", |a, b| if a > b { a } else { b }),
];

fn random_lines(seed: u64) -> Vec<Line> {
    let mut random = Random(seed);
    // Values 0 and 1 are `x` and the index.
    (2..26)
        .map(|known| {
            let mut value = || random.below(known) as usize;
            let (a, b) = (value(), value());
            match random.below(8) {
                0 => Line::Constant(random.below(2000) as f32 / 7.0 - 140.0),
                1 | 2 => Line::Unary(random.below(UNARY.len() as u32), a),
                _ => Line::Binary(random.below(BINARY.len() as u32), a, b),
            }
        })
        .collect()
}

fn text_of(lines: &[Line]) -> String {
    let mut text = "let v0 = x; let v1 = f32(id.x);\n".to_owned();
    for (i, line) in lines.iter().enumerate() {
        let value = match *line {
            // Not a constant to the translator, which folds those as f32.
            Line::Constant(value) => format!("(f32({value:?}) + (x - x))"),
            Line::Unary(op, a) => UNARY[op as usize].0.replace('A', &format!("v{a}")),
            Line::Binary(op, a, b) => {
                let text = BINARY[op as usize].0.replace('A', &format!("v{a}"));
                text.replace('B', &format!("v{b}"))
            }
        };
        text += &format!("let v{} = {value};\n", i + 2);
    }
    text + &format!("result[id.x] = v{};", lines.len() + 1)
}

fn evaluate(lines: &[Line], x: f64, index: f64) -> f64 {
    let mut values = vec![x, index];
    for line in lines {
        values.push(match *line {
            Line::Constant(value) => value.into(),
            Line::Unary(op, a) => UNARY[op as usize].1(values[a]),
            Line::Binary(op, a, b) => BINARY[op as usize].1(values[a], values[b]),
        });
    }
    values[values.len() - 1]
}

#[test]
fn random_straight_lines_are_those_of_f64_in_both_wide_types() {
    let data = inputs();
    let mut rounded = 0;
    for seed in 0..60 {
        let lines = random_lines(seed);
        let wgsl = expression(&text_of(&lines));
        let single = run(&wgsl, NumberType::F32, &data, 128, 2);
        let double = run(&wgsl, NumberType::F64, &data, 128, 2);
        let shadow = run(&wgsl, NumberType::Shadow, &data, 128, 2);
        assert_eq!(single.words, shadow.words, "seed {seed}: {wgsl}");
        assert_eq!(
            bits(&double.wide),
            bits(&shadow.wide),
            "seed {seed}: {wgsl}"
        );
        for (i, &x) in data.iter().enumerate() {
            let want = evaluate(&lines, x.into(), i as f64);
            assert_eq!(
                bits(&[double.wide[i]]),
                bits(&[Some(want)]),
                "seed {seed}, {i}: {:?}, not {want}: {wgsl}",
                double.wide[i]
            );
            rounded += usize::from(f64::from(f32::from_bits(single.words[i])) != want);
        }
    }
    // Programs that f32 computes exactly would not tell the types apart.
    assert!(rounded > 1000, "{rounded}");
}

#[test]
fn variables_and_workgroup_memory_hold_the_number_type() {
    let wgsl = "
        @group(0) @binding(0) var<storage, read> data: array<f32>;
        @group(0) @binding(1) var<storage, read_write> result: array<f32>;
        var<workgroup> shared_values: array<f32, 64>;
        @compute @workgroup_size(64)
        fn main(@builtin(local_invocation_index) lane: u32) {
            var own = array<f32, 3>(0.0, 0.0, 0.0);
            for (var i = 0u; i < 3u; i++) { own[(i + lane) % 3u] = data[lane] / (3.0 + f32(i)); }
            shared_values[lane] = own[lane % 3u];
            workgroupBarrier();
            result[lane] = shared_values[63u - lane] * 3.0;
        }";
    let data = inputs();
    for number_type in [NumberType::F64, NumberType::Shadow] {
        let got = run(wgsl, number_type, &data, 64, 1);
        for lane in 0..64 {
            let want = f64::from(data[63 - lane]) / 3.0 * 3.0;
            assert_eq!(got.wide[lane], Some(want), "{number_type}, {lane}");
        }
    }
}

#[test]
fn bits_are_those_of_the_nearest_f32() {
    // A third has more digits in f64; through bits only those of f32 are left.
    let wgsl = "
        @group(0) @binding(0) var<storage, read> data: array<f32>;
        @group(0) @binding(1) var<storage, read_write> result: array<vec4<f32>>;
        @compute @workgroup_size(64)
        fn main(@builtin(local_invocation_index) lane: u32) {
            let third = data[lane] / 3.0;
            let bits = bitcast<u32>(third);
            result[lane] = vec4<f32>(
                third,
                bitcast<f32>(bits),
                unpack2x16float(pack2x16float(vec2<f32>(third, 0.0))).x,
                f32(bits >> 16u),
            );
        }";
    let data = inputs();
    for number_type in [NumberType::F64, NumberType::Shadow] {
        let got = run(wgsl, number_type, &data, 256, 1);
        for (lane, &x) in data.iter().enumerate().take(64) {
            let third = f64::from(x) / 3.0;
            // Dividing 24-bit numbers by 3 rounds alike once and twice.
            let single = x / 3.0;
            assert_eq!(single, third as f32);
            let want = [
                third,
                single.into(),
                half::f16::from_f32(single).to_f64(),
                (single.to_bits() >> 16).into(),
            ];
            for (k, want) in want.into_iter().enumerate() {
                assert_eq!(
                    got.wide[4 * lane + k],
                    Some(want),
                    "{number_type}, {lane}, {k}"
                );
            }
        }
    }
}

/// Two passes over textures: a third, and three times what that is less one.
fn two_passes(number_type: NumberType, format: &str, wide: bool) -> Vec<[f64; 4]> {
    let third = program(&format!(
        "@group(0) @binding(0) var result: texture_storage_2d<{format}, write>;
         @compute @workgroup_size(8, 8)
         fn main(@builtin(global_invocation_id) id: vec3<u32>) {{
             let value = (1.0 + f32(id.x)) / 30.0;
             textureStore(result, id.xy, vec4<f32>(value, -value, 2.0 * value, 40.0 * value));
         }}"
    ));
    let thrice = program(
        "@group(0) @binding(0) var source: texture_2d<f32>;
         @group(0) @binding(1) var result: texture_storage_2d<rgba32float, write>;
         @compute @workgroup_size(8, 8)
         fn main(@builtin(global_invocation_id) id: vec3<u32>) {
             textureStore(result, id.xy, textureLoad(source, id.xy, 0) * 30.0);
         }",
    );
    let format = Format::from_name(format).unwrap();
    let mut first: Option<Vec<[f64; 4]>> = None;
    for (name, executor) in executors_of(number_type) {
        let between = empty(10, 9, format);
        let between = if wide {
            between.widen().unwrap()
        } else {
            between
        };
        let last = empty(10, 9, Format::Rgba32Float).widen().unwrap();
        third
            .dispatch(
                &executor,
                [2, 2, 1],
                &[BoundResource::Texture(between.view())],
            )
            .unwrap();
        let bound = [
            BoundResource::Texture(between.view()),
            BoundResource::Texture(last.view()),
        ];
        thrice.dispatch(&executor, [2, 2, 1], &bound).unwrap();
        let got = last.view().to_f64().unwrap().unwrap();
        match &first {
            None => first = Some(got),
            Some(first) => assert!(*first == got, "{name}"),
        }
    }
    first.unwrap()
}

#[test]
fn nothing_is_rounded_between_passes() {
    for (format, unit) in [
        ("r32float", 6.0e-8),
        ("rgba16float", 5.0e-4),
        ("rg16float", 5.0e-4),
        ("rg11b10ufloat", 1.0e-2),
        ("rgba8unorm", 2.0e-3),
        ("rgba8snorm", 4.0e-3),
        ("rgb10a2unorm", 5.0e-4),
    ] {
        let channels = Format::from_name(format).unwrap().channels() as usize;
        let normalised = format.ends_with("norm");
        for number_type in [NumberType::F64, NumberType::Shadow] {
            let kept = two_passes(number_type, format, true);
            let lost = two_passes(number_type, format, false);
            let mut worst = 0.0_f64;
            for (i, (kept, lost)) in kept.iter().zip(&lost).enumerate() {
                let value = (1.0 + (i % 10) as f64) / 30.0;
                let written = [value, -value, 2.0 * value, 40.0 * value];
                for c in 0..4 {
                    let absent = if c == 3 { 1.0 } else { 0.0 };
                    let low = match format {
                        "rgba8snorm" => -1.0,
                        _ if normalised || format == "rg11b10ufloat" => 0.0,
                        _ => f64::NEG_INFINITY,
                    };
                    let high = if normalised { 1.0 } else { f64::INFINITY };
                    let held = if c < channels {
                        written[c].clamp(low, high)
                    } else {
                        absent
                    };
                    assert_eq!(kept[c], held * 30.0, "{number_type}, {format}, {i}, {c}");
                    worst = worst.max((lost[c] - kept[c]).abs() / 30.0);
                }
            }
            // Without a wide plane the format rounds, by up to its unit.
            assert!(worst > unit / 10.0, "{format}: {worst:e}");
        }
    }
}

#[test]
fn texels_are_what_they_are_without_a_wide_plane() {
    let wgsl = "
        @group(0) @binding(0) var result: texture_storage_2d<rgba16float, write>;
        @compute @workgroup_size(8, 8)
        fn main(@builtin(global_invocation_id) id: vec3<u32>) {
            let value = vec4<f32>(id.xyxy) / 7.0;
            textureStore(result, id.xy, value);
        }";
    let program = program(wgsl);
    let image = |number_type: NumberType, wide: bool| {
        let texture = empty(11, 5, Format::Rgba16Float);
        let texture = if wide {
            texture.widen().unwrap()
        } else {
            texture
        };
        let bound = [BoundResource::Texture(texture.view())];
        program
            .dispatch(&executor(number_type), [2, 1, 1], &bound)
            .unwrap();
        texture.to_image().unwrap()
    };
    let expected = image(NumberType::F32, false);
    assert!(expected.bytes.iter().any(|byte| *byte != 0));
    assert_eq!(image(NumberType::Shadow, true), expected);
    assert_eq!(image(NumberType::Shadow, false), expected);
    // Sevenths round alike through f64 and f32 here.
    assert_eq!(image(NumberType::F64, true), expected);
    assert_eq!(image(NumberType::F64, false), expected);
}

#[test]
fn every_mip_and_layer_has_its_own_part_of_the_plane() {
    use etalon_core::graph::Subresources;
    use etalon_core::resource::{Dimension, Extent, TextureDesc};
    use etalon_core::texel::Texel;
    let desc = TextureDesc {
        dimension: Dimension::D2,
        extent: Extent {
            width: 8,
            height: 8,
            depth_or_layers: 3,
        },
        mips: 2,
        format: Format::Rg16Float,
    };
    let texture = Texture::zeroed(desc).unwrap().widen().unwrap();
    let program = program(
        "@group(0) @binding(0) var result: texture_storage_2d<rg16float, write>;
         @compute @workgroup_size(4, 4)
         fn main(@builtin(global_invocation_id) id: vec3<u32>) {
             textureStore(result, id.xy, vec4<f32>(f32(id.y) + 1.0, f32(id.x), 0.0, 0.0) / 3.0);
         }",
    );
    let range = |mip, layer| Subresources {
        mip,
        mips: 1,
        layer,
        layers: 1,
    };
    let whole = texture.view();
    whole.fill(Texel::Float([0.1, 0.2, 0.3, 0.4]));
    let part = texture.part(range(1, 2)).unwrap();
    let bound = [BoundResource::Texture(part.clone())];
    program
        .dispatch(&executor(NumberType::F64), [1, 1, 1], &bound)
        .unwrap();
    let written = part.to_f64().unwrap().unwrap();
    assert_eq!(written.len(), 16);
    for (i, texel) in written.iter().enumerate() {
        let (x, y) = ((i % 4) as f64, (i / 4) as f64);
        assert_eq!(*texel, [(y + 1.0) / 3.0, x / 3.0, 0.0, 1.0]);
    }
    // Cleared with what the clear said, not what the format made of it.
    let cleared = [f64::from(0.1_f32), f64::from(0.2_f32), 0.0, 1.0];
    let others = [(0, 0), (0, 1), (0, 2), (1, 0), (1, 1)];
    for (mip, layer) in others {
        let texels = texture.part(range(mip, layer)).unwrap().to_f64().unwrap();
        assert!(texels.unwrap().iter().all(|texel| *texel == cleared));
    }
    // Copies take the plane along, or what the texels hold where there is none.
    let copy = Texture::zeroed(desc).unwrap().widen().unwrap();
    assert!(copy.view().copy_from(&texture.view()));
    assert_eq!(copy.view().to_f64(), texture.view().to_f64());
    let narrow = Texture::zeroed(desc).unwrap();
    assert!(narrow.view().copy_from(&texture.view()));
    assert!(copy.view().copy_from(&narrow.view()));
    let rounded = half::f16::from_f32(0.1).to_f64();
    assert_eq!(copy.view().to_f64().unwrap().unwrap()[0][0], rounded);
    // Integers have no plane.
    let integers = empty(4, 4, Format::Rgba8Uint).widen().unwrap();
    assert!(!integers.is_wide());
    assert_eq!(integers.view().to_f64(), Ok(None));
    // What is written from outside is the texels'.
    let mut overwritten = empty(1, 1, Format::R32Float).widen().unwrap();
    overwritten.view().fill(Texel::Float([0.7, 0.0, 0.0, 0.0]));
    overwritten.write(&0.25_f32.to_le_bytes());
    let texels = overwritten.view().to_f64().unwrap().unwrap();
    assert_eq!(texels, [[0.25, 0.0, 0.0, 1.0]]);
}

#[test]
fn words_written_as_integers_are_numbers_no_more() {
    let write = program(
        "@group(0) @binding(0) var<storage, read_write> words: array<f32>;
         @compute @workgroup_size(64)
         fn main(@builtin(local_invocation_index) lane: u32) {
             words[lane] = 1.0 / 3.0 * f32(lane);
         }",
    );
    let overwrite = program(
        "struct Words { first: u32, others: array<atomic<u32>, 63> }
         @group(0) @binding(0) var<storage, read_write> words: Words;
         @compute @workgroup_size(1)
         fn main() {
             words.first = 0x3f800000u;
             atomicAdd(&words.others[0], 0u);
         }",
    );
    let read = program(
        "@group(0) @binding(0) var<storage, read_write> words: array<f32>;
         @compute @workgroup_size(64)
         fn main(@builtin(local_invocation_index) lane: u32) {
             words[lane] = words[lane] * 3.0;
         }",
    );
    for number_type in [NumberType::F64, NumberType::Shadow] {
        for (name, executor) in executors_of(number_type) {
            let buffer = Buffer::zeroed(256).unwrap().widen().unwrap();
            let bound = [BoundResource::Buffer(&buffer)];
            let run = |program: &Program| program.dispatch(&executor, [1, 1, 1], &bound).unwrap();
            run(&write);
            // The literals divide to an f32 when the module is made.
            let third = f64::from(1.0_f32 / 3.0);
            let wide = buffer.to_f64().unwrap();
            assert_eq!(wide[7], Some(third * 7.0), "{name}");
            run(&overwrite);
            let wide = buffer.to_f64().unwrap();
            assert_eq!(wide[..2], [None, None], "{name}");
            assert_eq!(wide[2], Some(third * 2.0), "{name}");
            run(&read);
            let wide = buffer.to_f64().unwrap();
            let single = f64::from((third * 1.0) as f32);
            assert_eq!(wide[..2], [Some(3.0), Some(single * 3.0)], "{name}");
            assert_eq!(wide[7], Some(third * 7.0 * 3.0), "{name}");
            let copy = Buffer::zeroed(256).unwrap().widen().unwrap();
            copy.copy_from(&buffer);
            assert_eq!(copy.to_f64(), buffer.to_f64());
            buffer.clear();
            assert!(buffer.to_f64().unwrap().iter().all(Option::is_none));
        }
    }
}

#[test]
fn uniforms_are_f32_in_every_type() {
    let wgsl = "
        @group(0) @binding(0) var<uniform> value: vec4<f32>;
        @group(0) @binding(1) var<storage, read_write> result: array<f32>;
        @compute @workgroup_size(64)
        fn main(@builtin(local_invocation_index) lane: u32) {
            result[lane] = value.x / f32(lane + 1u);
        }";
    let got = run(wgsl, NumberType::F64, &[0.1, 0.0, 0.0, 0.0], 64, 1);
    for lane in 0..64 {
        let want = f64::from(0.1_f32) / (lane + 1) as f64;
        assert_eq!(got.wide[lane], Some(want));
    }
}

#[test]
fn number_types_have_names_and_a_default() {
    assert_eq!(NumberType::default(), NumberType::F32);
    assert_eq!(
        executor(NumberType::Shadow).number_type(),
        NumberType::Shadow
    );
    let names = NumberType::ALL.map(|number_type| number_type.to_string());
    assert_eq!(names, ["f32", "f64", "f32 with f64 shadow"]);
    assert!(Tier::Baseline.is_available());
}
