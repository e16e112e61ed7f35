//! Instructions that were joined compute what they computed apart.
//!
//! The same kernel twice: once as it is, so that its two instructions become
//! one, and once with the result in between read from memory, so that they cannot.

use crate::common;

use common::*;
use etalon_cpu::{BoundResource, Executor, Program, Tier};

/// A type, a step, a step on its result `t`, and what the two become.
struct Pair {
    ty: &'static str,
    between: &'static str,
    first: &'static str,
    second: &'static str,
    /// How the instruction is listed.
    joined: &'static str,
}

const fn pair(
    ty: &'static str,
    between: &'static str,
    first: &'static str,
    second: &'static str,
    joined: &'static str,
) -> Pair {
    Pair {
        ty,
        between,
        first,
        second,
        joined,
    }
}

const PAIRS: &[Pair] = &[
    pair("f32", "f32", "a * b", "t + c", "muladd.f"),
    pair("f32", "f32", "a * b", "t - c", "mulsub.f"),
    pair("f32", "f32", "a * b", "c - t", "submul.f"),
    pair("f32", "f32", "a * b + c", "t + d", "muladdadd.f"),
    pair("f32", "f32", "a * b", "c * d + t", "mulmuladd.f"),
    pair("f32", "f32", "a + b", "t + c", "add3.f"),
    pair("f32", "f32", "a + b", "c + t", "add3.f"),
    pair("f32", "f32", "a + b", "t * c", "addmul.f"),
    pair("f32", "f32", "a - b", "c * t", "submulby.f"),
    pair("f32", "f32", "max(a, 0.0)", "min(t, 1.0)", "clamp.f"),
    pair("f32", "f32", "max(a, -0.0)", "min(t, 0.0)", "clamp.f"),
    pair("f32", "f32", "max(a, b)", "max(t, c)", "max3.f"),
    pair("f32", "f32", "a * b", "min(t, 65504.0)", "mulatmost.f"),
    pair("f32", "f32", "a + b", "max(t, 0.0)", "addatleast.f"),
    pair("f32", "f32", "max(a + b, 0.0)", "min(t, 1.0)", "addclamp.f"),
    pair(
        "f32",
        "f32",
        "max(a + b, 0.0)",
        "min(c, t)",
        "limitaddatleast.f",
    ),
    pair("f32", "f32", "a * b * c", "max(t, 0.25)", "mul3atleast.f"),
    pair("f32", "f32", "a * b + c", "d / t", "divbymuladd.f"),
    pair("f32", "f32", "a * b", "select(c, t, d < c)", "selectmul.f"),
    pair(
        "f32",
        "bool",
        "a < b",
        "select(a, b, t && bitcast<u32>(c) == bitcast<u32>(d))",
        "ltand.f",
    ),
    pair(
        "f32",
        "bool",
        "a <= b",
        "select(a, b, t && bitcast<u32>(c) == bitcast<u32>(d))",
        "leand.f",
    ),
    pair("f32", "f32", "a * b", "t * c", "mul3.f"),
    pair("f32", "f32", "a + b", "floor(t)", "addfloor.f"),
    pair("f32", "f32", "a * b + c", "floor(t)", "muladdfloor.f"),
    pair("f32", "f32", "a - b", "abs(t)", "abssub.f"),
    pair(
        "f32",
        "f32",
        "abs(a - b)",
        "select(c, d, t < c)",
        "ltabssub.f",
    ),
    pair("f32", "f32", "max(a, 0.25)", "max(t, 1.0)", "atleast2.f"),
    pair(
        "f32",
        "bool",
        "bitcast<u32>(a) <= 0x3f800000u",
        "select(b, c, t)",
        "selectle.u",
    ),
    pair(
        "u32",
        "bool",
        "a <= b",
        "select(a, b, t | (c == d))",
        "leor.u",
    ),
    pair(
        "u32",
        "bool",
        "(a <= b) | (c == d)",
        "select(a, b, !t)",
        "notleor.u",
    ),
    pair("u32", "u32", "a + b", "t << (c & 31u)", "addshl"),
    pair("u32", "u32", "a & b", "t + c", "andadd"),
    pair(
        "f32",
        "u32",
        "(bitcast<u32>(a) ^ bitcast<u32>(b)) + 127u",
        "bitcast<f32>(t << 23u)",
        "f.addshl",
    ),
    pair(
        "f32",
        "u32",
        "(bitcast<u32>(a) ^ bitcast<u32>(b)) & 0x7fffffu",
        "bitcast<f32>(t + 0x3f800000u)",
        "f.andadd",
    ),
    pair(
        "f32",
        "u32",
        "(bitcast<u32>(a) ^ bitcast<u32>(b)) & 0x7fffffu",
        "bitcast<f32>(t)",
        "f.and",
    ),
    pair(
        "f32",
        "u32",
        "bitcast<u32>(a)",
        "bitcast<f32>(t - 0x800000u)",
        "sub.f.bits",
    ),
    pair(
        "f32",
        "u32",
        "bitcast<u32>(a) & 0x7fffffu",
        "bitcast<f32>(t | 0x3f800000u)",
        "bitsandor",
    ),
    pair(
        "f32",
        "u32",
        "bitcast<u32>(a) & 0x80000000u",
        "bitcast<f32>((t | bitcast<u32>(b)) ^ 1u)",
        "mergebits",
    ),
    pair(
        "f32",
        "u32",
        "bitcast<u32>(a) & 0x80000000u",
        "bitcast<f32>(t | bitcast<u32>(b))",
        "f.mergebits",
    ),
    pair("i32", "i32", "max(a, b)", "min(t, c)", "clamp.s"),
    pair("u32", "u32", "a >> b", "t & c", "shrand"),
    pair("u32", "u32", "a & b", "t | c", "andor"),
    pair("u32", "u32", "a + b", "c + t", "add3.i"),
    pair("u32", "u32", "select(a, 0u, a > b)", "min(t, c)", "cap.u"),
    pair("u32", "bool", "a > b", "select(a, 0u, t)", "zeroabove.u"),
    pair("u32", "u32", "a & b", "select(a, b, t == c)", "eqand"),
    pair("u32", "u32", "a & b", "select(a, b, t != c)", "neand"),
    pair(
        "f32",
        "u32",
        "bitcast<u32>(a)",
        "bitcast<f32>(t & 0x7ffffff0u)",
        "and.f",
    ),
    pair(
        "f32",
        "u32",
        "bitcast<u32>(a) & 0x7f800000u",
        "select(b, c, t == 0x7f800000u)",
        "eqand.f",
    ),
    pair(
        "f32",
        "u32",
        "bitcast<u32>(a) & 0x7f800000u",
        "select(b, c, t != 0x7f800000u)",
        "neand.f",
    ),
    pair(
        "f32",
        "u32",
        "select(bitcast<u32>(a), 0u, bitcast<u32>(a) > 0x7f7fffffu)",
        "bitcast<f32>(min(t, 0x477fe000u))",
        "f.cap.f",
    ),
    // Limits of a number, though written on its bits.
    pair(
        "f32",
        "u32",
        "select(bitcast<u32>(a), 0u, bitcast<u32>(a) > 0x7f800000u)",
        "bitcast<f32>(min(t, 0x477fe000u))",
        "clamp.f",
    ),
    pair(
        "f32",
        "u32",
        "select(bitcast<u32>(a), 0u, bitcast<u32>(a) > 0x7f800000u)",
        "bitcast<f32>(min(t, 0x7f800000u))",
        "clamp.f",
    ),
];

const NAMES: [&str; 4] = ["a", "b", "c", "d"];

/// `uniform` has a bit for each operand that is the same in all invocations.
fn kernel(pair: &Pair, uniform: u32, apart: bool) -> String {
    let Pair {
        ty,
        between,
        first,
        second,
        ..
    } = pair;
    let operands: String = NAMES
        .iter()
        .enumerate()
        .map(|(k, name)| {
            if uniform >> k & 1 == 1 {
                format!("let {name} = bitcast<{ty}>(data[{}u]);\n", 7 * k + 3)
            } else {
                format!(
                    "let {name} = bitcast<{ty}>(data[(id.x * {}u + {k}u) % 64u]);\n",
                    2 * k + 3
                )
            }
        })
        .collect();
    let (stored, loaded) = match *between {
        "bool" => ("select(3u, 2u, first)", "result[id.x + 256u] == 2u"),
        "f32" => ("bitcast<u32>(first)", "bitcast<f32>(result[id.x + 256u])"),
        "i32" => ("u32(first)", "i32(result[id.x + 256u])"),
        _ => ("first", "result[id.x + 256u]"),
    };
    let through_memory = if apart {
        format!("result[id.x + 256u] = {stored};\nlet t = {loaded};\n")
    } else {
        "let t = first;\n".to_owned()
    };
    format!(
        "@group(0) @binding(0) var<storage> data: array<u32, 64>;
         @group(0) @binding(1) var<storage, read_write> result: array<u32, 512>;
         @compute @workgroup_size(64) fn main(@builtin(global_invocation_id) id: vec3<u32>) {{
             {operands}
             let first: {between} = {first};
             {through_memory}
             let r: {ty} = {second};
             result[id.x] = bitcast<u32>(r);
         }}"
    )
}

fn data() -> Vec<u32> {
    let special = [
        0.0,
        -0.0,
        1.0,
        -1.0,
        0.1,
        3.0,
        1e-40,
        -1e-40,
        f32::MAX,
        f32::MIN,
        f32::INFINITY,
        f32::NEG_INFINITY,
        f32::NAN,
        65504.0,
        16_777_216.0,
        1.000_000_1,
    ];
    (0..64_u32)
        .map(|i| match i % 4 {
            0 => special[(i / 4) as usize].to_bits(),
            1 => i,
            _ => (i * i + 1).wrapping_mul(0x9e37_79b1),
        })
        .collect()
}

fn run(program: &Program, executor: &Executor, data: &[u32]) -> Vec<u32> {
    let (data, result) = (buffer(data), buffer(&[0; 512]));
    let bound = [BoundResource::Buffer(&data), BoundResource::Buffer(&result)];
    let bound = &bound[..program.bindings().len()];
    program.dispatch(executor, [4, 1, 1], bound).unwrap();
    words(&result)[..256].to_vec()
}

#[test]
fn joined_instructions_compute_what_they_do_apart() {
    let data = data();
    let executors: Vec<Executor> = Tier::ALL
        .into_iter()
        .filter(|tier| tier.is_available())
        .flat_map(|tier| [64, 256].map(|lanes| (tier, lanes)))
        .map(|(tier, lanes)| Executor::new(1).unwrap().with_tier(tier).with_lanes(lanes))
        .collect();
    for pair in PAIRS {
        for uniform in 0..15 {
            let joined = program(&kernel(pair, uniform, false));
            let apart = program(&kernel(pair, uniform, true));
            if uniform == 0 {
                let has = |program: &Program| {
                    program
                        .to_string()
                        .lines()
                        .any(|line| line.split_whitespace().any(|word| word == pair.joined))
                };
                assert!(has(&joined), "no {} in\n{joined}", pair.joined);
                assert!(!has(&apart), "{} in\n{apart}", pair.joined);
            }
            let mut first = None;
            for executor in &executors {
                for program in [&joined, &apart] {
                    let got = run(program, executor, &data);
                    let want = first.get_or_insert_with(|| got.clone());
                    for (i, (got, want)) in got.iter().zip(want.iter()).enumerate() {
                        let nans = [*got, *want].map(|bits| f32::from_bits(bits).is_nan());
                        assert!(
                            got == want || pair.ty == "f32" && nans == [true; 2],
                            "{}, uniform {uniform:b}, {i}: {got:x}, not {want:x}\n{program}",
                            pair.joined
                        );
                    }
                }
            }
        }
    }
}

/// Steps, each a type, a name and an expression, on lanes `a` to `e` and on numbers `k0`
/// to `k3` that are the same in all; the last is the result. And what they become.
struct Steps {
    steps: &'static [(&'static str, &'static str, &'static str)],
    joined: &'static str,
}

const CHAINS: &[Steps] = &[
    Steps {
        steps: &[
            ("u32", "size", "bitcast<u32>(a) & 0x7fffffffu"),
            (
                "u32",
                "kept",
                "min(select(size, 0u, size > 0x7f800000u), 0x477fe000u)",
            ),
            ("u32", "odd", "(kept >> 13u) & 1u"),
            (
                "f32",
                "normal",
                "bitcast<f32>((kept + 0xfffu + odd) & 0xffffe000u)",
            ),
            ("f32", "raised", "bitcast<f32>(kept) + 0.5"),
            ("f32", "small", "raised - 0.5"),
            (
                "f32",
                "chosen",
                "select(small, normal, kept >= 0x38800000u)",
            ),
            (
                "f32",
                "r",
                "bitcast<f32>(bitcast<u32>(chosen) | (bitcast<u32>(a) & 0x80000000u))",
            ),
        ],
        joined: "roundbits.f",
    },
    Steps {
        steps: &[
            ("f32", "limited", "min(max(a, 0.0), 1.0)"),
            ("f32", "scaled", "limited * 255.0"),
            ("f32", "code", "floor(scaled + 0.5)"),
            (
                "f32",
                "exact",
                "code * 0.0039215087890625 + code * 5.983839e-8",
            ),
            (
                "f32",
                "r",
                "select(limited, exact, abs(scaled - code) < 0.000244140625)",
            ),
        ],
        joined: "snapfraction.f",
    },
    Steps {
        steps: &[
            ("f32", "limited", "min(max(a, 0.0), 1.0)"),
            ("f32", "code", "floor(limited * 255.0 + 0.5)"),
            ("f32", "r", "code * 0.0039215087890625 + code * 5.983839e-8"),
        ],
        joined: "roundfraction.f",
    },
    Steps {
        steps: &[
            ("u32", "offset", "bitcast<u32>(a) - 0x3f3504f3u"),
            ("i32", "exponent", "bitcast<i32>(offset) >> 23u"),
            (
                "f32",
                "f",
                "bitcast<f32>((offset & 0x007fffffu) + 0x3f3504f3u) - 1.0",
            ),
            ("f32", "s", "f / (2.0 + f)"),
            ("f32", "z", "s * s"),
            (
                "f32",
                "series",
                "0.6666677594184875 + z * (0.39977535605430603 + z * 0.2987186312675476)",
            ),
            ("f32", "h", "0.5 * f * f"),
            (
                "f32",
                "r",
                "f32(exponent) + ((f - h) + s * (h + z * series)) * 1.442695",
            ),
        ],
        joined: "logseries.f",
    },
    Steps {
        steps: &[
            ("f32", "n", "floor(a + 0.5)"),
            ("f32", "f", "a - n"),
            (
                "f32",
                "p4",
                "0.00015353361959569156 * f + 0.0013398875016719103",
            ),
            ("f32", "p3", "p4 * f + 0.00961843691766262"),
            ("f32", "p2", "p3 * f + 0.055503323674201965"),
            ("f32", "p1", "p2 * f + 0.24022647738456726"),
            ("f32", "p0", "p1 * f + 0.6931471824645996"),
            (
                "f32",
                "r",
                "(p0 * f + 1.0) * bitcast<f32>((i32(n) + 127) << 23u)",
            ),
        ],
        joined: "powerseries.f",
    },
    Steps {
        steps: &[
            ("f32", "over", "(b - 1.0) * 0.055"),
            ("f32", "curve", "b + over"),
            ("f32", "r", "select(curve, 12.92 * a, a <= 0.0031308)"),
        ],
        joined: "lineorcurve.f",
    },
    Steps {
        steps: &[
            ("f32", "over", "a - k0"),
            ("f32", "hard", "max(over, 0.0)"),
            ("f32", "rise", "min(k1, max(over + k2, 0.0))"),
            ("f32", "r", "max(rise * rise * k3, hard)"),
        ],
        joined: "knee.f",
    },
    Steps {
        steps: &[
            ("f32", "sum", "a * k0 + b * k1 + c * k2"),
            ("f32", "r", "1.0 / (d * sum + e)"),
        ],
        joined: "divbysum.f",
    },
    Steps {
        steps: &[
            ("f32", "two", "a * k0 + b * 0.5"),
            ("f32", "r", "two + c * k2"),
        ],
        joined: "weightedsum.f",
    },
    Steps {
        steps: &[
            ("f32", "limited", "min(max(a, 0.0), 65504.0)"),
            ("f32", "r", "min(limited * k0, 65504.0)"),
        ],
        joined: "clampmulatmost.f",
    },
];

/// `uniform` has a bit for each of the lanes' operands that is the same in all of
/// them after all; `twice` looks at what the last step but one gave, so that it is read
/// by more than the chain.
fn chain_kernel(chain: &Steps, uniform: u32, apart: bool, twice: bool) -> String {
    let mut text = String::new();
    for (k, name) in ["a", "b", "c", "d", "e"].iter().enumerate() {
        let at = if uniform >> k & 1 == 1 {
            format!("{}u", 7 * k + 3)
        } else {
            format!("(id.x * {}u + {k}u) % 64u", 2 * k + 3)
        };
        text += &format!("let {name} = bitcast<f32>(data[{at}]);\n");
    }
    for k in 0..4 {
        text += &format!("let k{k} = bitcast<f32>(data[{}u]);\n", 12 * k + 2);
    }
    for (ty, name, step) in chain.steps {
        text += &if apart {
            format!(
                "result[id.x + 256u] = bitcast<u32>({step});
                 let {name} = bitcast<{ty}>(result[id.x + 256u]);\n"
            )
        } else {
            format!("let {name}: {ty} = {step};\n")
        };
    }
    let extra = match (twice, chain.steps) {
        (true, [.., (_, name, _), _]) => {
            format!(" ^ select(0u, 1u, bitcast<u32>({name}) == 12345u)")
        }
        _ => String::new(),
    };
    format!(
        "@group(0) @binding(0) var<storage> data: array<u32, 64>;
         @group(0) @binding(1) var<storage, read_write> result: array<u32, 512>;
         @compute @workgroup_size(64) fn main(@builtin(global_invocation_id) id: vec3<u32>) {{
             {text}
             result[id.x] = bitcast<u32>(r){extra};
         }}"
    )
}

/// [`data`] with numbers of all sizes instead of whole ones.
fn chain_data() -> Vec<u32> {
    let mut data = data();
    for (k, word) in data.iter_mut().enumerate().filter(|(k, _)| k % 4 == 1) {
        *word = (1.7_f32.powi(k as i32 - 40)).to_bits();
    }
    data
}

#[test]
fn chains_compute_what_their_steps_do_apart() {
    let data = chain_data();
    let executors: Vec<Executor> = Tier::ALL
        .into_iter()
        .filter(|tier| tier.is_available())
        .flat_map(|tier| [64, 256].map(|lanes| (tier, lanes)))
        .map(|(tier, lanes)| Executor::new(1).unwrap().with_tier(tier).with_lanes(lanes))
        .collect();
    for chain in CHAINS {
        for (uniform, twice) in [(0, false), (0, true), (1, false), (2, false), (24, false)] {
            let joined = program(&chain_kernel(chain, uniform, false, twice));
            let apart = program(&chain_kernel(chain, uniform, true, twice));
            let has = |program: &Program| program.to_string().contains(chain.joined);
            assert!(!has(&apart), "{} in\n{apart}", chain.joined);
            if uniform == 0 {
                assert_eq!(has(&joined), !twice, "{} in\n{joined}", chain.joined);
            }
            let mut first = None;
            for executor in &executors {
                for program in [&joined, &apart] {
                    let got = run(program, executor, &data);
                    let want = first.get_or_insert_with(|| got.clone());
                    for (i, (got, want)) in got.iter().zip(want.iter()).enumerate() {
                        let nans = [*got, *want].map(|bits| f32::from_bits(bits).is_nan());
                        assert!(
                            got == want || nans == [true; 2],
                            "{}, uniform {uniform:b}, {i}: {got:x}, not {want:x}\n{program}",
                            chain.joined
                        );
                    }
                }
            }
        }
    }
}

/// A limit that is known to be a number, and the same one read from memory.
#[test]
fn known_limits_are_those_of_any_number() {
    let limits = [
        0.0_f32,
        -0.0,
        1.0,
        f32::INFINITY,
        f32::NEG_INFINITY,
        65504.0,
    ];
    let values: Vec<f32> = limits
        .into_iter()
        .chain([f32::NAN, -1.0, 2.0, 1e-40, f32::MAX, f32::MIN])
        .collect();
    for limit in limits.into_iter().filter(|limit| limit.is_finite()) {
        let wgsl = format!(
            "@group(0) @binding(0) var<storage> data: array<f32>;
             @group(0) @binding(1) var<storage, read_write> result: array<u32>;
             @compute @workgroup_size(64) fn main(@builtin(global_invocation_id) id: vec3<u32>) {{
                 let value = data[id.x % {count}u + 1u];
                 result[id.x * 4u] = bitcast<u32>(max(value, {limit:?}f));
                 result[id.x * 4u + 1u] = bitcast<u32>(max(value, data[0]));
                 result[id.x * 4u + 2u] = bitcast<u32>(min(value, {limit:?}f));
                 result[id.x * 4u + 3u] = bitcast<u32>(min(value, data[0]));
             }}",
            count = values.len()
        );
        let data: Vec<u32> = std::iter::once(&limit)
            .chain(&values)
            .map(|value| value.to_bits())
            .collect();
        let listing = program(&wgsl).to_string();
        assert!(
            listing.contains("atleast.f") && listing.contains("max.f"),
            "{listing}"
        );
        for (k, four) in run_buffers(&wgsl, &data, 256, 1).chunks(4).enumerate() {
            let value = values[k % values.len()];
            assert_eq!(four[0], four[1], "max({value:?}, {limit:?})");
            assert_eq!(four[2], four[3], "min({value:?}, {limit:?})");
            let expected = if value.is_nan() {
                limit
            } else {
                value.max(limit)
            };
            assert_eq!(
                f32::from_bits(four[0]),
                expected,
                "max({value:?}, {limit:?})"
            );
        }
    }
}

/// What is overwritten between two instructions keeps them apart: the first
/// reads the loop's `x` before it is doubled, the second after.
#[test]
fn operands_that_change_in_between_are_read_in_time() {
    let wgsl = "
        @group(0) @binding(0) var<storage> data: array<u32>;
        @group(0) @binding(1) var<storage, read_write> result: array<u32>;
        @compute @workgroup_size(64) fn main(@builtin(global_invocation_id) id: vec3<u32>) {
            var x = data[id.x];
            var sum = 0u;
            for (var i = 0u; i < 5u + data[id.x] % 3u; i++) {
                let masked = x & 0xffu;
                x = x * 2u + 1u;
                sum += (masked | x) + i;
            }
            result[id.x] = sum;
        }";
    let data: Vec<u32> = (0..128_u32).map(|i| i.wrapping_mul(0x9e37_79b1)).collect();
    let got = run_buffers(wgsl, &data, 128, 2);
    for (&value, got) in data.iter().zip(got) {
        let (mut x, mut sum) = (value, 0_u32);
        for i in 0..5 + value % 3 {
            let masked = x & 0xff;
            x = x.wrapping_mul(2).wrapping_add(1);
            sum = sum.wrapping_add((masked | x).wrapping_add(i));
        }
        assert_eq!(got, sum);
    }
}

/// What `max` gives, as `Number::max` says.
fn max(a: f32, b: f32) -> f32 {
    if a > b || b.is_nan() { a } else { b }
}

/// Results that cannot be NaN, whatever they are computed from, are limits that
/// need no care; others are not.
#[test]
fn computed_limits_need_care_only_where_they_may_be_nan() {
    let values = [
        0.0_f32,
        -0.0,
        1.0,
        -1.0,
        f32::INFINITY,
        f32::NEG_INFINITY,
        f32::NAN,
        -f32::NAN,
        1e-40,
        f32::MAX,
    ];
    let capped = |x: f32| f32::from_bits((x.to_bits() & 0x7fff_ffff).min(0x7f80_0000));
    type Limit = fn(f32) -> f32;
    let cases: [(&str, Option<Limit>); 8] = [
        ("min(b, 1.0)", Some(|b| if b < 1.0 { b } else { 1.0 })),
        (
            "-abs(min(b, 1.0))",
            Some(|b| -if b < 1.0 { b.abs() } else { 1.0 }),
        ),
        ("f32(i32(id.x) - 5)", None),
        (
            "bitcast<f32>(min(bitcast<u32>(b) & 0x7fffffffu, 0x7f800000u))",
            None,
        ),
        ("select(2.0, min(b, 1.0), a < 1.0)", None),
        ("b", Some(|b| b)),
        (
            "min(b, 1.0) * 0.0",
            Some(|b| if b < 1.0 { b * 0.0 } else { 0.0 }),
        ),
        ("select(b, 2.0, a < 1.0)", None),
    ];
    for (case, (limit, _)) in cases.iter().enumerate() {
        let wgsl = format!(
            "@group(0) @binding(0) var<storage> data: array<f32>;
             @group(0) @binding(1) var<storage, read_write> result: array<u32>;
             @compute @workgroup_size(64) fn main(@builtin(global_invocation_id) id: vec3<u32>) {{
                 let a = data[id.x / {count}u % {count}u];
                 let b = data[id.x % {count}u];
                 result[id.x] = bitcast<u32>(max(a, {limit}));
             }}",
            count = values.len()
        );
        let listing = program(&wgsl).to_string();
        let careful = listing.contains(" max.f");
        assert_eq!(careful, case >= 5, "{limit}:\n{listing}");
        let data = values.map(f32::to_bits);
        for (k, got) in run_buffers(&wgsl, &data, 128, 2).into_iter().enumerate() {
            let (a, b) = (
                values[k / values.len() % values.len()],
                values[k % values.len()],
            );
            let limit = match (case, cases[case].1) {
                (_, Some(limit)) => limit(b),
                (2, _) => k as f32 - 5.0,
                (3, _) => capped(b),
                (4, _) if a < 1.0 => {
                    if b < 1.0 {
                        b
                    } else {
                        1.0
                    }
                }
                (7, _) if a >= 1.0 || a.is_nan() => b,
                _ => 2.0,
            };
            let want = max(a, limit);
            let got = f32::from_bits(got);
            assert!(
                got.to_bits() == want.to_bits() || got.is_nan() && want.is_nan(),
                "{}: max({a:?}, {limit:?}) is {got:?}, not {want:?}",
                cases[case].0
            );
        }
    }
}
