//! `f16`: what kernels need, and what would be misread.

use super::*;

/// A kernel with `code`, which has an `f16` `h`, an `f32` `x` and a `u32` `u`.
fn with_half(declarations: &str, code: &str) -> String {
    format!(
        "enable f16;
{declarations}
@group(0) @binding(0) var<storage, read_write> words: array<u32>;
@compute @workgroup_size(1) fn main() {{
    let u = words[0];
    let x = bitcast<f32>(u);
    let h = f16(x);
    {code}
    words[1] = u32(h);
}}"
    )
}

fn needs(text: &str) -> Vec<Need> {
    compile_one(text, Arithmetic::Strict)
        .unwrap_or_else(|error| panic!("{error}"))
        .needs
        .clone()
}

fn buffer(binding: &str) -> Need {
    Need::F16Buffer {
        binding: binding.to_owned(),
    }
}

#[test]
fn what_is_used_is_needed() {
    assert_eq!(needs(&with_half("", "")), [Need::F16]);
    assert_eq!(needs(&evaluating("x + 1.0")), []);
    let unused = "enable f16;
        struct Unused { h: f16 }
        @group(0) @binding(0) var<storage, read_write> words: array<u32>;
        @compute @workgroup_size(1) fn main() { words[0] += 1u; }";
    assert_eq!(needs(unused), []);
    // Only a value, in a function that is called; no type is declared.
    let called = "enable f16;
        @group(0) @binding(0) var<storage, read_write> words: array<u32>;
        fn rounded(x: f32) -> f32 { return f32(f16(x)); }
        @compute @workgroup_size(1) fn main() { words[0] = u32(rounded(f32(words[1]))); }";
    assert_eq!(needs(called), [Need::F16]);
    let buffers = with_half(
        "struct Inner { a: f32, b: array<vec2<f16>, 3> }
         @group(0) @binding(5) var<storage, read> deep: array<Inner>;
         @group(0) @binding(3) var<storage, read_write> flat: array<f16>;
         var<workgroup> local: array<f16, 4>;",
        "local[0] = deep[u].b[1].x; flat[1] = local[0] * h;",
    );
    assert_eq!(needs(&buffers), [Need::F16, buffer("flat"), buffer("deep")]);
    assert_eq!(buffer("deep").to_string(), "`f16` in the buffer `deep`");
}

#[test]
fn imported_files_may_have_it() {
    let library = library(&[
        (
            "test/kernel",
            "import package::test::lib::half_of;
             enable f16;
             @group(0) @binding(0) var<storage, read_write> words: array<u32>;
             @compute @workgroup_size(1) fn main() { words[0] = u32(half_of(f16(words[1]))); }",
        ),
        (
            "test/lib",
            "enable f16; fn half_of(h: f16) -> f16 { return h * 0.5h; }",
        ),
    ]);
    let kernel = library
        .get(&KernelRequest::new("test/kernel"), Arithmetic::Strict)
        .unwrap_or_else(|error| panic!("{error}"));
    assert_eq!(kernel.needs, [Need::F16]);
}

#[test]
fn what_naga_would_make_something_else_of_is_refused() {
    let bits = "`pack2x16float`";
    for (declarations, code, says) in [
        // Numbers of 32 bits with another meaning, without these checks.
        ("", "let v = bitcast<vec2<f16>>(u);", bits),
        ("", "let v = bitcast<vec2<f16>>(x);", bits),
        ("", "let v = bitcast<vec2h>(i32(u));", bits),
        (
            "",
            "let v = bitcast<vec4<f16>>(vec2(u, u)); words[2] = u32(v.x + v.y);",
            bits,
        ),
        ("", "let v = bitcast< vec4 < f16 > > (vec2(x, x));", bits),
        ("alias Pair = vec2<f16>;", "let v = bitcast<Pair>(u);", bits),
        (
            "alias Short = f16;\nalias Pair = vec2<Short>;\nalias Again = Pair;",
            "let v = bitcast<Again>(u);",
            bits,
        ),
        ("", "let v = bitcast<u32>(vec2(h, h));", bits),
        ("", "let v = bitcast<vec2<i32>>(vec4(h, h, h, h));", bits),
        ("", "let v = bitcast<f32>(vec2(h, h));", bits),
        (
            "fn f(u: u32) -> f32 { return f32(bitcast<vec2<f16>>(u).x); }",
            "",
            "",
        ),
        ("", "let e = frexp(h);", "`frexp` of `f32"),
        (
            "",
            "words[2] = u32(i32(frexp(vec2(h, h)).exp.x));",
            "`frexp` of `f32",
        ),
    ] {
        let text = with_half(declarations, code);
        if says.is_empty() {
            // Not called, so not compiled.
            assert!(compile_one(&text, Arithmetic::Fast).is_ok());
            continue;
        }
        let error = error_of(&text);
        assert!(matches!(error, KernelError::Wgsl(_)), "{error:?}");
        assert!(error.to_string().contains(says), "{code}: {error}");
        let line = text.lines().position(|line| line.contains(code)).unwrap();
        assert_eq!(
            error.location().unwrap().line as usize,
            line + 1,
            "{code}: {error}"
        );
    }
}

#[test]
fn other_bit_casts_are_not() {
    for (declarations, code) in [
        ("", "let v = bitcast<f16>(h);"),
        ("", "let v = bitcast<vec2<f16>>(vec2(h, h));"),
        (
            "alias Pair = vec2h;",
            "let v = bitcast<Pair>(vec2(h, h)).y;",
        ),
        ("alias Float = f32;", "let v = bitcast<Float>(u);"),
        ("", "let v = bitcast<vec2<f32>>(vec2(u, u));"),
        ("", "let v = bitcast<u32>(f32(h));"),
        ("", "let e = frexp(f32(h)).exp;"),
    ] {
        let text = with_half(declarations, code);
        let compiled = compile_one(&text, Arithmetic::Fast);
        assert!(compiled.is_ok(), "{code}: {}", compiled.unwrap_err());
    }
}

#[test]
fn uniforms_have_none() {
    for ty in ["f16", "vec4<f16>", "mat2x4<f16>"] {
        let error = error_of(&format!(
            "enable f16;
             struct In {{ member: {ty}, x: f32 }}
             @group(0) @binding(0) var<uniform> input: In;
             @group(0) @binding(1) var<storage, read_write> output: array<f32>;
             @compute @workgroup_size(1) fn main() {{ output[0] = input.x; }}"
        ));
        assert!(matches!(error, KernelError::Interface(_)), "{ty}: {error}");
        assert!(error.to_string().contains("`member`"), "{ty}: {error}");
    }
}
