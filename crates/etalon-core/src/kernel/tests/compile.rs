//! Imports, features, constants, identity and the cache.

use super::*;

const LIB: &str = "
fn square(x: f32) -> f32 { return x * x; }
@if(strict) const MODE: f32 = 1.0;
@else const MODE: f32 = 2.0;
fn unused(x: f32) -> f32 { return square(x); }
override inner: f32 = 4.0;
";

pub(super) const KERNEL: &str = "
import package::test::lib::{square, MODE};
import super::lib as l;

@group(0) @binding(0) var<storage, read_write> output: array<f32>;
override factor: f32;
override count: u32 = 3;
override offset: i32 = -1;
override negate: bool = false;
override width = 8;

@compute @workgroup_size(width)
fn main() {
    var sum = square(factor) + MODE + l::inner;
    @if(extra) { sum += 100.0; }
    @else { sum += 200.0; }
    for (var i = 0u; i < count; i++) { sum += 1.0; }
    output[0] = select(sum, -sum, negate) + f32(offset);
}
";

pub(super) fn example() -> KernelLibrary {
    library(&[("test/lib", LIB), ("test/kernel", KERNEL)])
}

pub(super) fn request() -> KernelRequest {
    KernelRequest::new("test/kernel").constant("factor", 0.5)
}

#[test]
fn imports_and_features_decide_what_is_generated() {
    let library = example();
    let strict = library.get(&request(), Arithmetic::Strict).unwrap();
    let fast = library.get(&request(), Arithmetic::Fast).unwrap();
    let extra = library
        .get(&request().feature("extra", true), Arithmetic::Fast)
        .unwrap();
    assert!(strict.wgsl.contains("MODE: f32 = 1.0") && !strict.wgsl.contains("MODE: f32 = 2.0"));
    assert!(fast.wgsl.contains("MODE: f32 = 2.0") && !fast.wgsl.contains("MODE: f32 = 1.0"));
    assert!(fast.wgsl.contains("200.0") && !fast.wgsl.contains("100.0"));
    assert!(extra.wgsl.contains("100.0") && !extra.wgsl.contains("200.0"));
    for kernel in [&strict, &fast, &extra] {
        assert!(!kernel.wgsl.contains("unused"), "{}", kernel.wgsl);
        assert!(!kernel.wgsl.contains("import"), "{}", kernel.wgsl);
        assert_eq!(kernel.name, "test/kernel");
        assert_eq!(kernel.compute().unwrap().entry_point, "main");
        assert_eq!(kernel.compute().unwrap().workgroup_size, [8, 1, 1]);
        assert!(main(kernel).name.is_none() || main(kernel).name.as_deref() == Some("main"));
    }
    // `square` is only called with an override, so it is still a function.
    assert_eq!(strict.module.functions.len(), 1);
}

#[test]
fn constants_are_resolved_in_every_type() {
    let library = example();
    let request = request()
        .constant("width", 16.0)
        .constant("count", 4_294_967_295.0)
        .constant("offset", -2_147_483_648.0)
        .constant("negate", 1.0)
        .constant("inner", 0.1);
    let kernel = library.get(&request, Arithmetic::Strict).unwrap();
    assert_eq!(kernel.compute().unwrap().workgroup_size, [16, 1, 1]);
    assert!(kernel.module.overrides.is_empty());
    let literals: Vec<naga::Literal> = kernel
        .module
        .constants
        .iter()
        .filter_map(
            |(_, constant)| match kernel.module.global_expressions[constant.init] {
                naga::Expression::Literal(literal) => Some(literal),
                _ => None,
            },
        )
        .collect();
    for expected in [
        naga::Literal::F32(0.5),
        naga::Literal::U32(u32::MAX),
        naga::Literal::I32(i32::MIN),
        naga::Literal::Bool(true),
        // The nearest float to the double.
        naga::Literal::F32(0.1),
    ] {
        assert!(literals.contains(&expected), "{expected:?} in {literals:?}");
    }
    let names: Vec<_> = kernel
        .constants
        .iter()
        .map(|(name, _)| name.as_str())
        .collect();
    assert_eq!(
        names,
        ["count", "factor", "inner", "negate", "offset", "width"]
    );
}

/// Values that a decimal or hexadecimal literal may denote keep their bits
/// through WESL: strict kernels rely on it.
#[test]
fn literals_keep_their_bits() {
    let values = [
        1.0_f32,
        0.1,
        1.0 / 3.0,
        f32::MAX,
        f32::MIN_POSITIVE,
        f32::EPSILON,
        16_777_217.0,
        1.0e-30,
        1.234_567_9e20,
        f32::from_bits(0x3f7f_ffff),
        f32::from_bits(0x0123_4567),
        f32::from_bits(0x7e98_7654),
    ];
    for value in values {
        let bits = value.to_bits();
        // The definition of binary32: 1.mantissa × 2^(exponent - 127).
        let (exponent, mantissa) = ((bits >> 23) as i32 - 127, bits & 0x7f_ffff);
        for spelling in [
            format!("{value}f"),
            format!("{value:e}f"),
            format!("{value:e}"),
            format!("f32({:e})", f64::from(value)),
            format!("0x1.{:06x}p{exponent}f", mantissa << 1),
            format!("0x1.{:06x}p{exponent}", mantissa << 1),
            format!("0X{:x}P{}f", mantissa | 0x80_0000, exponent - 23),
            format!("bitcast<f32>({bits}u)"),
            format!("bitcast<f32>({bits:#x}u)"),
        ] {
            let kernel = compile_one(&evaluating(&spelling), Arithmetic::Strict)
                .unwrap_or_else(|error| panic!("{spelling}: {error}"));
            let found = main(&kernel).expressions.iter().any(|(_, expression)| {
                matches!(expression, naga::Expression::Literal(naga::Literal::F32(f))
                    if f.to_bits() == bits)
            });
            // The operand of a cast, or its result.
            let cast = kernel.wgsl.contains("bitcast");
            assert!(found || cast, "{spelling} of {bits:#x}:\n{}", kernel.wgsl);
            assert!(
                kernel.wgsl.contains(&spelling),
                "{spelling}:\n{}",
                kernel.wgsl
            );
        }
    }
}

/// What WESL would take for other operators.
#[test]
fn signs_in_a_row_stay_negations() {
    for (expression, printed) in [
        ("- -x", "- -x"),
        ("- - -x", "- - -x"),
        ("x - -x", "x - -x"),
        ("x --x", "x - -x"),
        ("x - - -x", "x - - -x"),
        ("-(-x)", "-(-x)"),
    ] {
        let text = evaluating(expression);
        let kernel = compile_one(&text, Arithmetic::Strict).unwrap_or_else(|e| panic!("{e}"));
        assert!(
            kernel.wgsl.contains(&format!("= {printed};")),
            "{}",
            kernel.wgsl
        );
    }
    let text = "@compute @workgroup_size(1) fn main() {
        var i = 3; i--; for (var j = 3; j > 0; j--) { i -= - -j; }
    }";
    let kernel = compile_one(text, Arithmetic::Strict).unwrap_or_else(|e| panic!("{e}"));
    assert!(
        kernel.wgsl.contains("i--;") && kernel.wgsl.contains("j--)"),
        "{}",
        kernel.wgsl
    );
}

#[test]
fn identity_is_of_what_is_compiled() {
    let (a, b) = (example(), example());
    let id = |library: &KernelLibrary, request: &KernelRequest, arithmetic| {
        library.get(request, arithmetic).unwrap().id
    };
    let base = id(&a, &request(), Arithmetic::Strict);
    assert_eq!(
        base,
        id(&b, &request(), Arithmetic::Strict),
        "another library"
    );
    // The order in which a request was put together does not matter.
    let mut reversed = request().constant("count", 5.0);
    reversed.constants.reverse();
    assert_eq!(
        id(&a, &reversed, Arithmetic::Strict),
        id(&a, &request().constant("count", 5.0), Arithmetic::Strict)
    );
    let others = [
        id(&a, &request(), Arithmetic::Fast),
        id(&a, &request().feature("extra", true), Arithmetic::Strict),
        id(&a, &request().constant("factor", 0.75), Arithmetic::Strict),
        id(&a, &request().constant("count", 5.0), Arithmetic::Strict),
    ];
    for (index, other) in others.iter().enumerate() {
        assert_ne!(base, *other);
        assert!(!others[..index].contains(other));
    }
    // A kernel that says nothing about `strict` still has two identities:
    // SPIR-V differs.
    let text = evaluating("x");
    assert_ne!(
        compile_one(&text, Arithmetic::Strict).unwrap().id,
        compile_one(&text, Arithmetic::Fast).unwrap().id
    );
}

/// FNV-1a as published: the identity must not change between versions of the
/// compiler, since plans and caches are stored under it.
#[test]
fn identity_does_not_change() {
    let kernel = compile_one(
        "@compute @workgroup_size(1) fn main() {}",
        Arithmetic::Strict,
    )
    .unwrap();
    let mut hash = 0xcbf2_9ce4_8422_2325_u64;
    for field in [kernel.wgsl.as_str(), "strict"] {
        let length = (field.len() as u64).to_le_bytes();
        for byte in field.bytes().chain(length) {
            hash ^= u64::from(byte);
            hash = hash.wrapping_mul(0x0000_0100_0000_01b3);
        }
    }
    assert_eq!(kernel.id, KernelId(hash));
}

#[test]
fn a_cached_kernel_is_not_parsed_again() {
    let mut library = example();
    assert_eq!(library.stats(), KernelStats::default());
    let first = library.get(&request(), Arithmetic::Strict).unwrap();
    let after = library.stats();
    assert_eq!((after.parsed, after.compiled, after.cached), (2, 1, 0));
    let second = library.get(&request(), Arithmetic::Strict).unwrap();
    assert!(Arc::ptr_eq(&first, &second));
    let cached = library.stats();
    assert_eq!((cached.parsed, cached.compiled, cached.cached), (2, 1, 1));
    library.get(&request(), Arithmetic::Fast).unwrap();
    assert_eq!(library.stats().parsed, 4);
    // A changed import is seen.
    library.add_source("test/lib", &LIB.replace("x * x", "x * x * x"));
    let third = library.get(&request(), Arithmetic::Strict).unwrap();
    assert_ne!(first.id, third.id);
    assert!(third.wgsl.contains("x * x * x"));
}

#[test]
fn threads_that_want_the_same_kernel_compile_it_once() {
    fn shared<T: Send + Sync>(value: T) -> T {
        value
    }
    let library = shared(example());
    let kernels: Vec<Arc<Kernel>> = std::thread::scope(|scope| {
        let threads: Vec<_> = (0..8)
            .map(|_| scope.spawn(|| library.get(&request(), Arithmetic::Strict).unwrap()))
            .collect();
        threads
            .into_iter()
            .map(|thread| thread.join().unwrap())
            .collect()
    });
    assert!(
        kernels
            .iter()
            .all(|kernel| Arc::ptr_eq(kernel, &kernels[0]))
    );
    let stats = library.stats();
    assert_eq!((stats.parsed, stats.compiled, stats.cached), (2, 1, 7));
}

/// A feature or constant of a part that this variant leaves out exists all the
/// same: fast and strict kernels are requested alike.
#[test]
fn features_and_constants_of_other_variants_may_be_set() {
    let library = library(&[
        (
            "test/lib",
            "override depth: u32 = 1; @if(deep) const D = 2u; @else const D = 1u; fn f() -> u32 { return depth + D; }",
        ),
        (
            "test/kernel",
            "import package::test::lib::f;
             @group(0) @binding(0) var<storage, read_write> output: array<u32>;
             @compute @workgroup_size(1) fn main() { @if(!strict) { output[0] = f(); } }",
        ),
    ]);
    let request = KernelRequest::new("test/kernel")
        .feature("deep", true)
        .constant("depth", 2.0);
    let fast = library.get(&request, Arithmetic::Fast).unwrap();
    assert_eq!(fast.constants, [("depth".to_owned(), 2.0)]);
    let strict = library.get(&request, Arithmetic::Strict).unwrap();
    assert!(strict.constants.is_empty());
    assert!(strict.bindings.is_empty());
    assert_eq!(strict.unused, ["output"]);
}

#[test]
fn names_of_two_files_do_not_clash() {
    let library = library(&[
        ("test/a", "fn value() -> u32 { return 1u; } const K = 10u;"),
        (
            "test/b",
            "fn value() -> u32 { return 2u + K; } const K = 20u;",
        ),
        (
            "test/kernel",
            "import package::test::a; import package::test::b::value as other;
             @group(0) @binding(0) var<storage, read_write> output: array<u32>;
             fn value() -> u32 { return 3u; }
             @compute @workgroup_size(1) fn main() {
                 let K = 4u;
                 output[0] = a::value() + other() + value() + K + a::K;
             }",
        ),
    ]);
    let kernel = library
        .get(&KernelRequest::new("test/kernel"), Arithmetic::Strict)
        .unwrap();
    assert_eq!(kernel.module.functions.len(), 3);
}
