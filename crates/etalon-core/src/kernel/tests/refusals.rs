//! Bad requests and bad text.

use super::compile::{KERNEL, example, request};
use super::*;

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
            "@compute @workgroup_size(1) fn main() { let x = 1.0h; }",
            "1:49",
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
        let deep = error_of(&nested(10_000, open, close));
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
        let deep = error_of(&blocks(10_000));
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
