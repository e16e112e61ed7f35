//! The lint of strict kernels: every built-in function is on one side or the
//! other.

use super::*;

/// What the lint says about an expression, if anything.
fn findings(expression: &str) -> Vec<lint::Finding> {
    match compile_one(&evaluating(expression), Arithmetic::Strict) {
        Ok(_) => Vec::new(),
        Err(KernelError::NotStrict { findings, .. }) => findings,
        Err(error) => panic!("{expression}: {error}"),
    }
}

#[test]
fn exact_operations_are_allowed() {
    for expression in [
        "x + x - x * x / x",
        "-x",
        "sqrt(x)",
        "abs(x) + min(x, 1.0) + max(x, 1.0) + clamp(x, 0.0, 1.0) + saturate(x)",
        "floor(x) + ceil(x) + trunc(x) + round(x)",
        "sign(x) + step(x, 1.0)",
        "select(x, 1.0, x > 2.0 && x != 3.0)",
        "(v * x).x + (x * v).y + (v * v).z + (v / x).w",
        "(m * x)[0].x + (m + m)[1].y + (m - m)[2].z",
        "transpose(m)[0].x",
        "f32(i % 3) + f32(u % 3u) + f32(i / 3) + f32(u >> 1u)",
        "f32(i32(x)) + f32(u32(x)) + bitcast<f32>(bitcast<u32>(x) & 0xfffff000u)",
        "f32(dot(vec2i(i), vec2i(2, i)))",
        "f32(countOneBits(u) + firstLeadingBit(u) + extractBits(u, 1u, 2u) + reverseBits(u))",
        "f32(dot4U8Packed(u, u)) + f32(unpack4xU8(u).x) + f32(abs(i) + sign(i))",
        "textureLoad(image, vec2u(u), 0).x + f32(textureDimensions(image).x)",
        "f32(all(v > v.wzyx)) + f32(any(v == v))",
        // Computed at compile time, the same for all.
        "exp(1.5) + sin(0.25) + length(vec2f(3.0, 4.0))",
    ] {
        assert_eq!(findings(expression), [], "{expression}");
    }
}

#[test]
fn inexact_operations_are_found_and_named() {
    for (expression, operation) in [
        ("x % 2.0", "`%` on floats"),
        ("(m * v).x", "a matrix product"),
        ("(v * m).x", "a matrix product"),
        ("(m * m)[0].x", "a matrix product"),
        ("dot(v, v)", "`dot`"),
        ("cross(v.xyz, v.yzx).x", "`cross`"),
        ("length(v)", "`length`"),
        ("distance(v, v.wzyx)", "`distance`"),
        ("normalize(v).x", "`normalize`"),
        ("faceForward(v, v, v).x", "`faceForward`"),
        ("reflect(v, v).x", "`reflect`"),
        ("refract(v, v, x).x", "`refract`"),
        ("determinant(m)", "`determinant`"),
        ("fma(x, x, x)", "`fma`"),
        ("mix(x, 1.0, x)", "`mix`"),
        ("smoothstep(0.0, 1.0, x)", "`smoothstep`"),
        ("fract(x)", "`fract`"),
        ("modf(x).fract", "`modf`"),
        ("frexp(x).fract", "`frexp`"),
        ("ldexp(x, i)", "`ldexp`"),
        ("inverseSqrt(x)", "`inverseSqrt`"),
        ("exp(x)", "`exp`"),
        ("exp2(x)", "`exp2`"),
        ("log(x)", "`log`"),
        ("log2(x)", "`log2`"),
        ("pow(x, 2.5)", "`pow`"),
        ("sin(x)", "`sin`"),
        ("cos(x)", "`cos`"),
        ("tan(x)", "`tan`"),
        ("sinh(x)", "`sinh`"),
        ("cosh(x)", "`cosh`"),
        ("tanh(x)", "`tanh`"),
        ("asin(x)", "`asin`"),
        ("acos(x)", "`acos`"),
        ("atan(x)", "`atan`"),
        ("atan2(x, 1.0)", "`atan2`"),
        ("asinh(x)", "`asinh`"),
        ("acosh(x)", "`acosh`"),
        ("atanh(x)", "`atanh`"),
        ("radians(x)", "`radians`"),
        ("degrees(x)", "`degrees`"),
        ("quantizeToF16(x)", "`quantizeToF16`"),
        ("f32(pack4x8unorm(v))", "`pack4x8unorm`"),
        ("f32(pack4x8snorm(v))", "`pack4x8snorm`"),
        ("f32(pack2x16unorm(v.xy))", "`pack2x16unorm`"),
        ("f32(pack2x16snorm(v.xy))", "`pack2x16snorm`"),
        ("f32(pack2x16float(v.xy))", "`pack2x16float`"),
        ("unpack4x8unorm(u).x", "`unpack4x8unorm`"),
        ("unpack4x8snorm(u).x", "`unpack4x8snorm`"),
        ("unpack2x16unorm(u).x", "`unpack2x16unorm`"),
        ("unpack2x16snorm(u).x", "`unpack2x16snorm`"),
        ("unpack2x16float(u).x", "`unpack2x16float`"),
        (
            "textureSampleLevel(image, filter_, v.xy, 0.0).x",
            "`textureSample*`",
        ),
        (
            "textureGather(0, image, filter_, v.xy).x",
            "`textureGather*`",
        ),
    ] {
        let found = findings(expression);
        assert_eq!(found.len(), 1, "{expression}: {found:?}");
        assert_eq!(found[0].operation, operation);
        // The line `output[0] = …` of the frame, there behind an opening
        // parenthesis or conversion.
        let SourceLocation { line, column, .. } = found[0].location;
        let inside = expression
            .strip_prefix("f32(")
            .or(expression.strip_prefix('('));
        let indent = expression.len() - inside.map_or(expression.len(), str::len);
        assert_eq!((line, column as usize), (9, 26 + indent), "{expression}");
        assert!(found[0].line.contains(expression));
        // Fast kernels may.
        compile_one(&evaluating(expression), Arithmetic::Fast).unwrap();
    }
}

#[test]
fn all_findings_are_reported_in_order_with_their_lines() {
    let library = library(&[
        ("test/lib", "fn f(x: f32) -> f32 {\n    return exp(x);\n}"),
        (
            "test/kernel",
            "import package::test::lib::f;
@group(0) @binding(0) var<storage, read_write> o: array<f32>;
@compute @workgroup_size(1) fn main() {
    o[0] = f(o[1]);
    o[1] = fma(o[1], sin(o[0]), 1.0);
    @if(!strict) { o[2] = cos(o[1]); }
}",
        ),
    ]);
    let error = library
        .get(&KernelRequest::new("test/kernel"), Arithmetic::Strict)
        .unwrap_err();
    assert_eq!(
        error.to_string(),
        "kernel `test/kernel` is not strict: 3 operation(s) may differ between devices
test/kernel.wesl:5:12: `fma` is not exact; write `a * b + c`, which is rounded twice everywhere
5 |     o[1] = fma(o[1], sin(o[0]), 1.0);
  |            ^
test/kernel.wesl:5:22: `sin` is not exact; use the function from `package::lib`
5 |     o[1] = fma(o[1], sin(o[0]), 1.0);
  |                      ^
test/lib.wesl:2:12: `exp` is not exact; use the function from `package::lib`
2 |     return exp(x);
  |            ^"
    );
    assert!(
        library
            .get(&KernelRequest::new("test/kernel"), Arithmetic::Fast)
            .is_ok()
    );
}
