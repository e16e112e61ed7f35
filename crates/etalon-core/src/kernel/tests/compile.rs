//! Imports, features, constants, identity, the cache, and bad input.

use super::*;

const LIB: &str = "
fn square(x: f32) -> f32 { return x * x; }
@if(strict) const MODE: f32 = 1.0;
@else const MODE: f32 = 2.0;
fn unused(x: f32) -> f32 { return square(x); }
override inner: f32 = 4.0;
";

const KERNEL: &str = "
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

fn example() -> KernelLibrary {
    library(&[("test/lib", LIB), ("test/kernel", KERNEL)])
}

fn request() -> KernelRequest {
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
        assert_eq!(kernel.entry_point, "main");
        assert_eq!(kernel.workgroup_size, [8, 1, 1]);
        assert!(kernel.main().name.is_none() || kernel.main().name.as_deref() == Some("main"));
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
    assert_eq!(kernel.workgroup_size, [16, 1, 1]);
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
            let found = kernel.main().expressions.iter().any(|(_, expression)| {
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

#[test]
fn an_unknown_kernel_is_told_with_similar_ones() {
    let library = example();
    let error = library
        .get(&KernelRequest::new("test/kernal"), Arithmetic::Strict)
        .unwrap_err();
    assert_eq!(
        error,
        KernelError::UnknownKernel {
            path: "test/kernal".to_owned(),
            similar: vec!["test/kernel".to_owned()]
        }
    );
    for path in [
        "",
        "/",
        "..",
        "test",
        "test/kernel.wesl",
        "package::test::kernel",
        "\0",
    ] {
        let request = KernelRequest::new(path.to_owned());
        let error = library.get(&request, Arithmetic::Strict).unwrap_err();
        assert!(
            matches!(error, KernelError::UnknownKernel { .. }),
            "{path}: {error}"
        );
    }
}

#[test]
fn unknown_features_and_constants_list_what_exists() {
    let library = example();
    let get = |request: KernelRequest| library.get(&request, Arithmetic::Strict).unwrap_err();
    assert_eq!(
        get(request().feature("extar", true)).to_string(),
        "kernel `test/kernel` has no feature `extar`; it has `extra`"
    );
    assert_eq!(
        get(request().feature("strict", true)).to_string(),
        "kernel `test/kernel`: the feature `strict` is set by the arithmetic, not by the request"
    );
    let error = get(request().constant("radius", 1.0));
    assert_eq!(
        error.to_string(),
        "kernel `test/kernel` has no override `radius`; it has `count`, `factor`, `inner`, \
         `negate`, `offset`, `width`"
    );
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
fn constants_must_fit_their_type() {
    let library = example();
    for (name, value, ty) in [
        ("factor", f64::NAN, "f32"),
        ("factor", f64::INFINITY, "f32"),
        ("factor", 1.0e39, "f32"),
        ("count", -1.0, "u32"),
        ("count", 4_294_967_296.0, "u32"),
        ("count", 0.5, "u32"),
        ("offset", 2_147_483_648.0, "i32"),
        ("offset", f64::NAN, "i32"),
        ("negate", 2.0, "bool"),
        ("width", 1.5, "i32"),
    ] {
        let error = library
            .get(&request().constant(name, value), Arithmetic::Strict)
            .unwrap_err();
        match &error {
            KernelError::ConstantValue {
                location,
                name: n,
                ty: t,
                value: v,
                ..
            } => {
                assert_eq!((n.as_str(), *t, v.to_bits()), (name, ty, value.to_bits()));
                let line = KERNEL
                    .lines()
                    .position(|line| line.contains(&format!("override {name}")));
                assert_eq!(location.line as usize, line.unwrap() + 1, "{error}");
                assert_eq!(location.file, "test/kernel.wesl");
            }
            _ => panic!("{name} = {value}: {error}"),
        }
    }
    let error = library
        .get(&KernelRequest::new("test/kernel"), Arithmetic::Strict)
        .unwrap_err();
    assert_eq!(
        error.to_string(),
        "test/kernel.wesl:6:1: override `factor` has no initial value, so the request must set it"
    );
    // A workgroup of nothing, by way of a constant.
    let error = library
        .get(&request().constant("width", 0.0), Arithmetic::Strict)
        .unwrap_err();
    assert!(matches!(error, KernelError::Wgsl(_)), "{error}");
}

#[test]
fn a_kernel_has_one_entry_point_called_main() {
    let none = error_of("fn main() {}");
    assert!(none.to_string().ends_with("but has none"), "{none}");
    for (text, found) in [
        (
            "@compute @workgroup_size(1) fn blur() {}",
            "but has `@compute fn blur` (test/one.wesl:1:29)",
        ),
        (
            "@compute @workgroup_size(1) fn main() {}\n@compute @workgroup_size(1) fn other() {}",
            "but has `@compute fn main` (test/one.wesl:1:29), `@compute fn other` (test/one.wesl:2:29)",
        ),
        (
            "@fragment fn main() {}",
            "but has `@fragment fn main` (test/one.wesl:1:11)",
        ),
    ] {
        let error = error_of(text);
        assert!(matches!(error, KernelError::EntryPoint { .. }), "{error}");
        assert!(error.to_string().ends_with(found), "{error}");
    }
}

#[test]
fn bad_text_is_an_error_with_its_place() {
    for (text, place, says) in [
        (
            "fn main() {\n    let x = ;\n}",
            "2:13",
            "unexpected token `;`",
        ),
        ("fn main() {\n", "1:12", "unexpected end of file"),
        ("var target: f32;", "1:5", "reserved word `target`"),
        ("\n\n  $", "3:3", "`$` means nothing"),
        (
            "fn main() { let x = 3 - 4294967296u; }",
            "1:25",
            "out of range",
        ),
        ("fn main() {} /* open", "1:14", "not closed"),
        (
            "import package::nowhere::x;\n@compute @workgroup_size(1)\nfn main() { x(); }",
            "1:17",
            "there is no file `nowhere.wesl`",
        ),
        (
            "import other_package::x;\n@compute @workgroup_size(1)\nfn main() { x(); }",
            "1:1",
            "`package::` or `super::`",
        ),
        (
            "@compute @workgroup_size(1)\nfn main() { package::nowhere::x(); }",
            "2:22",
            "there is no file",
        ),
        (
            "@compute @workgroup_size(1)\nfn main() {\n  @else { }\n}",
            "3:3",
            "preceded by a @if",
        ),
        (
            "@compute @workgroup_size(1)\nfn main() {\n  let a = 1 + // comment\n    missing;\n}",
            "4:5",
            "`missing`",
        ),
        (
            "@compute @workgroup_size(1)\nfn main() {\n  let a: u32 = 1.5;\n}",
            "3:7",
            "u32",
        ),
        (
            "@compute @workgroup_size(1) fn main() {}\nfn main() {}",
            "2:4",
            "redefinition of `main`",
        ),
        (
            "enable f16;\n@compute @workgroup_size(1) fn main() { let x = 1.0h; }",
            "1:8",
            "f16",
        ),
    ] {
        let error = error_of(text);
        let shown = error.to_string();
        assert!(
            shown.starts_with(&format!("test/one.wesl:{place}: ")),
            "{text}\n{shown}"
        );
        assert!(shown.contains(says), "{text}\n{shown}");
        let line = text
            .lines()
            .nth(error.location().unwrap().line as usize - 1);
        let line = line.unwrap_or_default().trim_end();
        assert!(line.is_empty() || shown.contains(line), "{text}\n{shown}");
    }
}

#[test]
fn an_error_is_shown_below_its_line() {
    let error = error_of("// é\nfn main() {\n\tlet /* é */ a = ;\n}");
    assert_eq!(
        error.to_string().lines().skip(1).collect::<Vec<_>>(),
        ["3 | \tlet /* é */ a = ;", "  | \t                ^"]
    );
}

#[test]
fn imports_may_be_cyclic_but_not_the_functions() {
    let kernel = "import package::test::a::a;
        @group(0) @binding(0) var<storage, read_write> output: array<u32>;
        @compute @workgroup_size(1) fn main() { output[0] = a(1u); }";
    let fine = library(&[
        ("test/kernel", kernel),
        (
            "test/a",
            "import package::test::b::b; fn a(x: u32) -> u32 { return b(x); } const A = 5u;",
        ),
        (
            "test/b",
            "import package::test::a::A; fn b(x: u32) -> u32 { return x + A; }",
        ),
    ]);
    fine.get(&KernelRequest::new("test/kernel"), Arithmetic::Strict)
        .unwrap();
    let recursive = library(&[
        ("test/kernel", kernel),
        (
            "test/a",
            "import package::test::b::b; fn a(x: u32) -> u32 { return b(x); }",
        ),
        (
            "test/b",
            "import package::test::a::a;\nfn b(x: u32) -> u32 { return a(x); }",
        ),
    ]);
    let error = recursive
        .get(&KernelRequest::new("test/kernel"), Arithmetic::Strict)
        .unwrap_err();
    assert!(matches!(error, KernelError::Wgsl(_)), "{error}");
    assert!(error.to_string().contains("cyclic"), "{error}");
    // A file that imports itself, and a constant of itself.
    let error = error_of("const A = A; @compute @workgroup_size(A) fn main() {}");
    assert!(matches!(error, KernelError::Wgsl(_)), "{error}");
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

#[test]
fn what_devices_may_lack_is_refused() {
    for text in [
        "@compute @workgroup_size(1) fn main(@builtin(subgroup_size) s: u32) {}",
        "@group(0) @binding(0) var t: texture_storage_2d<rgba16unorm, write>;
         @compute @workgroup_size(1) fn main() { textureStore(t, vec2u(0), vec4f()); }",
        "@group(0) @binding(0) var<storage, read_write> b: array<f64>;
         @compute @workgroup_size(1) fn main() { b[0] = b[1]; }",
    ] {
        let error = error_of(text);
        assert!(matches!(error, KernelError::Wgsl(_)), "{error}");
        assert_eq!(error.location().unwrap().file, "test/one.wesl");
    }
}

/// The limit on nesting holds back what would exhaust a stack, and what is
/// just within the limit does not: this test would not end well otherwise.
#[test]
fn deep_nesting_is_refused_before_it_exhausts_the_stack() {
    let nested = |depth: usize, open: &str, close: &str| {
        evaluating(&format!("{}x{}", open.repeat(depth), close.repeat(depth)))
    };
    for (open, close) in [
        ("(", ")"),
        ("-(", ")"),
        ("f32(", ")"),
        ("1.0 + ", ""),
        ("1.0 < ", ""),
        ("!", ""),
        ("- ", ""),
        ("v[u32(", ")]"),
        ("array<", ">"),
        ("", ".x"),
    ] {
        let deep = error_of(&nested(100_000, open, close));
        assert!(deep.to_string().contains("more than"), "{deep}");
        let fits = |depth: &usize| check::check_nesting(&nested(*depth, open, close)).is_ok();
        let most = (0..=check::MAX_NESTING).take_while(fits).last().unwrap();
        assert!(most >= 8, "{open}: {most}");
        // It may be wrong in other ways.
        if let Err(error) = compile_one(&nested(most, open, close), Arithmetic::Fast) {
            assert!(!matches!(error, KernelError::Internal { .. }), "{error}");
        }
    }
    for block in [
        "{",
        "if true {",
        "loop { break; ",
        "switch 1 { default {",
        "while true {",
    ] {
        let close = "}".repeat(block.matches('{').count());
        let blocks = |depth: usize| {
            format!(
                "@compute @workgroup_size(1) fn main() {{ {} {} }}",
                block.repeat(depth),
                close.repeat(depth)
            )
        };
        compile_one(&blocks(check::MAX_LOOPS), Arithmetic::Fast)
            .unwrap_or_else(|error| panic!("{error}"));
        let deep = error_of(&blocks(100_000));
        assert!(deep.to_string().contains("more than"), "{deep}");
    }
    let ladder = format!(
        "@compute @workgroup_size(1) fn main() {{ if false {{}} {} }}",
        "else if false {}".repeat(100)
    );
    compile_one(&ladder, Arithmetic::Fast).unwrap_or_else(|error| panic!("{error}"));
}

#[test]
fn a_file_that_is_too_large_is_not_read() {
    let error = error_of(&" ".repeat((1 << 20) + 1));
    assert!(error.to_string().contains("over the limit"), "{error}");
}
