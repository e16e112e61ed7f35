//! Reflection of bindings.

use super::*;
use crate::Format;
use crate::format::SampleKind;

fn kernel(declarations: &str, body: &str) -> String {
    format!("{declarations}\n@compute @workgroup_size(4, 2, 3) fn main() {{ {body} }}")
}

/// The one binding of a kernel.
fn binding(declaration: &str, body: &str) -> BindingKind {
    let text = kernel(&format!("@group(0) @binding(7) {declaration}"), body);
    let kernel = compile_one(&text, Arithmetic::Fast).unwrap_or_else(|error| panic!("{error}"));
    let [binding] = kernel.bindings.as_slice() else {
        panic!("{:?}", kernel.bindings)
    };
    assert_eq!((binding.group, binding.binding), (0, 7));
    assert_eq!(kernel.compute().unwrap().workgroup_size, [4, 2, 3]);
    binding.kind.clone()
}

#[test]
fn textures_are_reflected_with_shape_and_kind() {
    use SampleKind::{Depth, Float, Sint, Uint};
    use ViewDimension::{Cube, CubeArray, D2, D2Array, D3};
    for (ty, load, dimension, kind) in [
        ("texture_2d<f32>", "textureLoad(t, vec2u(), 0)", D2, Float),
        ("texture_2d<i32>", "textureLoad(t, vec2u(), 0)", D2, Sint),
        ("texture_2d<u32>", "textureLoad(t, vec2u(), 0)", D2, Uint),
        ("texture_depth_2d", "textureLoad(t, vec2u(), 0)", D2, Depth),
        (
            "texture_2d_array<f32>",
            "textureLoad(t, vec2u(), 0, 0)",
            D2Array,
            Float,
        ),
        (
            "texture_depth_2d_array",
            "textureLoad(t, vec2u(), 0, 0)",
            D2Array,
            Depth,
        ),
        ("texture_3d<u32>", "textureLoad(t, vec3u(), 0)", D3, Uint),
        ("texture_cube<f32>", "textureDimensions(t)", Cube, Float),
        (
            "texture_cube_array<f32>",
            "textureNumLayers(t)",
            CubeArray,
            Float,
        ),
        ("texture_depth_cube", "textureNumLevels(t)", Cube, Depth),
    ] {
        let found = binding(&format!("var t: {ty};"), &format!("let x = {load};"));
        let expected = BindingKind::Texture {
            dimension,
            kind,
            filtered: false,
        };
        assert_eq!(found, expected, "{ty}");
    }
}

#[test]
fn a_texture_is_filtered_if_some_function_samples_it() {
    let declarations = "
        @group(0) @binding(0) var loaded: texture_2d<f32>;
        @group(0) @binding(1) var sampled: texture_2d<f32>;
        @group(0) @binding(2) var gathered: texture_2d<f32>;
        @group(0) @binding(3) var shadow: texture_depth_2d;
        @group(0) @binding(4) var linear: sampler;
        @group(0) @binding(5) var compare: sampler_comparison;
        @group(0) @binding(6) var through: texture_2d<f32>;
        fn inner(t: texture_2d<f32>, s: sampler) -> vec4f { return textureSampleLevel(t, s, vec2f(), 0.0); }";
    let body = "
        let a = textureLoad(loaded, vec2u(), 0);
        let b = textureSampleLevel(sampled, linear, vec2f(), 0.0);
        let c = textureGather(1, gathered, linear, vec2f());
        let d = textureSampleCompareLevel(shadow, compare, vec2f(), 0.5);
        let e = inner(through, linear);";
    let kernel = compile_one(&kernel(declarations, body), Arithmetic::Fast).unwrap();
    let filtered = |name: &str| match kernel.binding(name).unwrap().kind {
        BindingKind::Texture { filtered, .. } => filtered,
        _ => panic!("{name}"),
    };
    assert!(!filtered("loaded"));
    assert!(filtered("sampled"));
    assert!(filtered("gathered"));
    assert!(filtered("through"));
    // The comparison is filtered, not the depth.
    assert!(!filtered("shadow"));
    assert_eq!(
        kernel.binding("linear").unwrap().kind,
        BindingKind::Sampler { comparison: false }
    );
    assert_eq!(
        kernel.binding("compare").unwrap().kind,
        BindingKind::Sampler { comparison: true }
    );
}

#[test]
fn storage_textures_are_reflected_in_every_format() {
    let mut seen = 0;
    for format in Format::ALL {
        if format.storage() == crate::format::StorageSupport::None {
            continue;
        }
        let value = match format.sample_kind() {
            SampleKind::Uint => "vec4u()",
            SampleKind::Sint => "vec4i()",
            SampleKind::Float | SampleKind::Depth => "vec4f()",
        };
        let found = binding(
            &format!("var t: texture_storage_3d<{format}, write>;"),
            &format!("textureStore(t, vec3u(), {value});"),
        );
        let expected = BindingKind::StorageTexture {
            dimension: ViewDimension::D3,
            format: *format,
            access: Access::Write,
        };
        assert_eq!(found, expected);
        seen += 1;
    }
    // WebGPU's core and tier 1 formats.
    assert_eq!(seen, Format::ALL.len() - 4);
    for (access, expected) in [("read", Access::Read), ("read_write", Access::ReadWrite)] {
        let found = binding(
            &format!("var t: texture_storage_2d_array<r32float, {access}>;"),
            "let x = textureLoad(t, vec2u(), 1);",
        );
        let expected = BindingKind::StorageTexture {
            dimension: ViewDimension::D2Array,
            format: Format::R32Float,
            access: expected,
        };
        assert_eq!(found, expected);
    }
}

#[test]
fn storage_buffers_have_an_access_and_a_least_size() {
    for (declaration, body, access, min_size) in [
        (
            "var<storage> b: array<vec3f>;",
            "let x = b[0];",
            Access::Read,
            16,
        ),
        (
            "var<storage, read> b: array<f32, 5>;",
            "let x = b[0];",
            Access::Read,
            20,
        ),
        (
            "var<storage, read_write> b: u32;",
            "b = 1;",
            Access::ReadWrite,
            4,
        ),
        (
            "var<storage, read_write> b: atomic<u32>;",
            "atomicAdd(&b, 1);",
            Access::ReadWrite,
            4,
        ),
        (
            "var<storage, read_write> b: array<atomic<u32>, 3>;",
            "atomicAdd(&b[1], 1);",
            Access::ReadWrite,
            12,
        ),
    ] {
        let expected = BindingKind::StorageBuffer { access, min_size };
        assert_eq!(binding(declaration, body), expected, "{declaration}");
    }
    let text = kernel(
        "struct List { count: atomic<u32>, items: array<vec2u> }
         @group(0) @binding(2) var<storage, read_write> list: List;",
        "list.items[0] = vec2u();",
    );
    // `count`, 4 bytes of padding, one item.
    let expected = BindingKind::StorageBuffer {
        access: Access::ReadWrite,
        min_size: 16,
    };
    assert_eq!(
        compile_one(&text, Arithmetic::Fast).unwrap().bindings[0].kind,
        expected
    );
}

/// Offsets and sizes computed by hand from the table in WGSL §14.4.1.
#[test]
fn uniform_blocks_are_laid_out_as_wgsl_says() {
    use UniformScalar::{F32, I32, U32};
    let text = kernel(
        "struct S {
            a: f32, b: vec3f, c: i32, d: vec2u, e: mat2x2f, f: mat3x3f, g: mat4x2f,
            h: array<vec4i, 2>, i: array<mat2x4f, 3>, j: mat2x3<f32>, k: u32,
         }
         @group(0) @binding(0) var<uniform> s: S;
         @group(0) @binding(1) var<storage, read_write> o: array<f32>;",
        "o[0] = s.a;",
    );
    let kernel = compile_one(&text, Arithmetic::Strict).unwrap();
    let layout = kernel.uniforms().unwrap();
    let vector = |scalar, size| UniformType::Vector { scalar, size };
    let matrix = |columns, rows, stride| UniformType::Matrix {
        columns,
        rows,
        stride,
    };
    let array = |element: UniformType, count, stride| UniformType::Array {
        element: Box::new(element),
        count,
        stride,
    };
    let expected = [
        ("a", 0, UniformType::Scalar(F32), 4, "f32"),
        ("b", 16, vector(F32, 3), 12, "vec3<f32>"),
        ("c", 28, UniformType::Scalar(I32), 4, "i32"),
        ("d", 32, vector(U32, 2), 8, "vec2<u32>"),
        ("e", 40, matrix(2, 2, 8), 16, "mat2x2<f32>"),
        ("f", 64, matrix(3, 3, 16), 48, "mat3x3<f32>"),
        ("g", 112, matrix(4, 2, 8), 32, "mat4x2<f32>"),
        (
            "h",
            144,
            array(vector(I32, 4), 2, 16),
            32,
            "array<vec4<i32>, 2>",
        ),
        (
            "i",
            176,
            array(matrix(2, 4, 16), 3, 32),
            96,
            "array<mat2x4<f32>, 3>",
        ),
        ("j", 272, matrix(2, 3, 16), 32, "mat2x3<f32>"),
        ("k", 304, UniformType::Scalar(U32), 4, "u32"),
    ];
    assert_eq!(layout.size, 320);
    assert_eq!(layout.members.len(), expected.len());
    for (member, (name, offset, ty, size, spelling)) in layout.members.iter().zip(expected) {
        assert_eq!(member.name, name);
        assert_eq!(member.offset, offset, "{name}");
        assert_eq!(member.ty, ty, "{name}");
        assert_eq!(member.ty.size(), size, "{name}");
        assert_eq!(member.ty.to_string(), spelling);
        assert_eq!(layout.member(name), Some(member));
    }
    assert_eq!(layout.member("z"), None);
}

#[test]
fn what_passes_cannot_fill_is_refused_at_its_place() {
    for (declarations, body, place, says) in [
        (
            "@group(1) @binding(0)\nvar t: texture_2d<f32>;",
            "let x = textureLoad(t, vec2u(), 0);",
            "2:1",
            "group 1",
        ),
        (
            "@group(0) @binding(0) var a: texture_2d<f32>;\n@group(0) @binding(0) var b: texture_2d<f32>;",
            "let x = textureLoad(a, vec2u(), 0) + textureLoad(b, vec2u(), 0);",
            "2:23",
            "`b` and `a` both have binding 0",
        ),
        (
            "var t: texture_2d<f32>;",
            "let x = textureLoad(t, vec2u(), 0);",
            "1:1",
            "needs an explicit",
        ),
        (
            "var<storage> b: array<f32>;",
            "let x = b[0];",
            "1:1",
            "needs an explicit",
        ),
        (
            "struct S { x: f32 }\n@group(0) @binding(0) var<uniform> a: S;\n@group(0) @binding(1) var<uniform> b: S;",
            "let x = a.x + b.x;",
            "3:23",
            "`b` and `a` are both uniform",
        ),
        (
            "@group(0) @binding(0) var<uniform> a: vec4f;",
            "let x = a;",
            "1:23",
            "no structure",
        ),
        (
            "struct Inner { x: f32 }\nstruct S { a: vec4f,\n  b: Inner }\n@group(0) @binding(0) var<uniform> s: S;",
            "let x = s.b.x;",
            "3:3",
            "a structure; list its members",
        ),
        (
            "struct S {\n  b: array<array<vec4f, 2>, 2> }\n@group(0) @binding(0) var<uniform> s: S;",
            "let x = s.b[0][1];",
            "2:3",
            "an array of arrays",
        ),
        (
            "@group(0) @binding(0) var t: texture_multisampled_2d<f32>;",
            "let x = textureLoad(t, vec2u(), 0);",
            "1:23",
            "multisampled",
        ),
        (
            "@group(0) @binding(0) var t: texture_1d<f32>;",
            "let x = textureLoad(t, 0, 0);",
            "1:23",
            "1D",
        ),
        (
            "@group(0) @binding(0) var t: texture_storage_2d<rgb10a2uint, write>;",
            "textureStore(t, vec2u(), vec4u());",
            "1:23",
            "texel format",
        ),
    ] {
        let error = error_of(&kernel(declarations, body));
        assert!(
            matches!(error, KernelError::Interface(_)),
            "{declarations}\n{error}"
        );
        let shown = error.to_string();
        assert!(
            shown.starts_with(&format!("test/one.wesl:{place}: ")),
            "{shown}"
        );
        assert!(shown.contains(says), "{shown}");
    }
}

#[test]
fn bindings_are_in_order_of_number_and_unused_ones_are_named() {
    let text = kernel(
        "@group(0) @binding(9) var late: texture_2d<f32>;
         @group(0) @binding(4) var never: texture_2d<f32>;
         @group(0) @binding(2) var early: texture_2d<f32>;
         @group(0) @binding(3) var smooth_: sampler;",
        "var x = textureLoad(late, vec2u(), 0) + textureLoad(early, vec2u(), 0);
         @if(!strict) { x += textureSampleLevel(early, smooth_, vec2f(), 0.0); }",
    );
    let names = |kernel: &Kernel| -> Vec<String> {
        kernel
            .bindings
            .iter()
            .map(|binding| binding.name.clone())
            .collect()
    };
    let strict = compile_one(&text, Arithmetic::Strict).unwrap();
    assert_eq!(names(&strict), ["early", "late"]);
    assert_eq!(strict.unused, ["never", "smooth_"]);
    let fast = compile_one(&text, Arithmetic::Fast).unwrap();
    assert_eq!(names(&fast), ["early", "smooth_", "late"]);
    assert_eq!(fast.unused, ["never"]);
}

#[test]
fn unused_bindings_of_imported_files_are_named_as_well() {
    let imported = "@group(0) @binding(1) var map: texture_2d<f32>;
        @if(!strict) @group(0) @binding(2) var filtering: sampler;
        fn read() -> vec4f {
            @if(strict) return textureLoad(map, vec2u(), 0);
            @if(!strict) return textureSampleLevel(map, filtering, vec2f(), 0.0);
        }";
    let text = kernel("import package::test::lib::read;", "var x = read();");
    let files = [("test/lib", imported), ("test/one", text.as_str())];
    let library = library(&files);
    for (arithmetic, unused) in [
        (Arithmetic::Strict, vec!["filtering"]),
        (Arithmetic::Fast, vec![]),
    ] {
        let kernel = library.get(&KernelRequest::new("test/one"), arithmetic);
        assert_eq!(kernel.unwrap().unused, unused, "{arithmetic:?}");
    }
}

#[test]
fn resources_of_imported_files_have_their_own_names() {
    let lib = "@group(0) @binding(5) var noise: texture_2d<f32>; fn f() -> f32 { return textureLoad(noise, vec2u(), 0).x; }";
    let kernel = |extra: &str| {
        format!(
            "import package::test::lib::f; {extra}
             @group(0) @binding(0) var<storage, read_write> o: array<f32>;
             @compute @workgroup_size(1) fn main() {{ o[0] = f(); }}"
        )
    };
    let fine = library(&[("test/lib", lib), ("test/kernel", &kernel(""))]);
    let fine = fine
        .get(&KernelRequest::new("test/kernel"), Arithmetic::Strict)
        .unwrap();
    assert_eq!(
        fine.binding("noise").map(|binding| binding.binding),
        Some(5)
    );
    let text = kernel("@group(0) @binding(6) var noise: texture_2d<f32>;")
        .replace("f();", "f() + textureLoad(noise, vec2u(), 0).x;");
    let error = library(&[("test/lib", lib), ("test/kernel", &text)])
        .get(&KernelRequest::new("test/kernel"), Arithmetic::Strict)
        .unwrap_err();
    assert!(
        error
            .to_string()
            .contains("`noise` is the name of two resources"),
        "{error}"
    );
}
