//! Checks of textures: texels, levels, layers, and texels that nothing wrote.

use crate::common;

use common::checks::*;
use common::*;
use etalon_core::Format;
use etalon_core::image::ImageData;
use etalon_core::resource::{AddressMode, Dimension, Extent, Filter, SamplerDesc, TextureDesc};
use etalon_cpu::{BoundResource, Checks, Finding, FindingKind as K, Texture};

const F: Format = Format::R32Float;

/// Three levels of 16×8 and two layers.
fn array() -> Texture {
    Texture::zeroed(TextureDesc {
        dimension: Dimension::D2,
        extent: Extent {
            width: 16,
            height: 8,
            depth_or_layers: 2,
        },
        mips: 3,
        format: F,
    })
    .unwrap()
}

const HEAD: &str = "
@group(0) @binding(0) var flat: texture_2d<f32>;
@group(0) @binding(1) var layers: texture_2d_array<f32>;
@group(0) @binding(2) var volume: texture_3d<f32>;
@group(0) @binding(3) var linear: sampler;
@group(0) @binding(4) var result: texture_storage_2d<r32float, write>;
@group(0) @binding(5) var<storage, read> data: array<u32>;
@compute @workgroup_size(8, 4)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    let at = vec2<i32>(id.xy);
    var value = 0.0;
    let one = data[0];
    let two = data[1];
";

/// 16×8 invocations in 2×2 workgroups, all resources written unless `flat` is given.
fn run_on(wgsl: &str, checks: Checks, flat: impl Fn() -> Texture) -> Vec<Finding> {
    let program = checked(wgsl, checks);
    let layers = array();
    let volume = Texture::zeroed(TextureDesc {
        dimension: Dimension::D3,
        extent: Extent {
            width: 4,
            height: 4,
            depth_or_layers: 4,
        },
        mips: 1,
        format: F,
    })
    .unwrap();
    let data = buffer(&[1, 2]);
    let sampler = SamplerDesc::new(AddressMode::ClampToEdge, Filter::Linear, Filter::Nearest);
    find(&program, &all_executors(), [2, 2, 1], |dispatch| {
        let result = empty(16, 8, F);
        let flat = flat();
        let bound: Vec<BoundResource<'_>> = program
            .bindings()
            .iter()
            .map(|binding| match binding.binding {
                0 => BoundResource::Texture(flat.view()),
                1 => BoundResource::Texture(layers.view()),
                2 => BoundResource::Texture(volume.view()),
                3 => BoundResource::Sampler(sampler),
                4 => BoundResource::Texture(result.view()),
                _ => BoundResource::Buffer(&data),
            })
            .collect();
        dispatch(&bound);
    })
}

fn kernel(body: &str) -> String {
    format!("{HEAD}    {body}\n    textureStore(result, at, vec4<f32>(value));\n}}")
}

/// Kind, workgroup, invocation, count, message.
type Expected<'a> = (K, [u32; 3], [u32; 3], u64, &'a str);

fn expect_on(body: &str, flat: impl Fn() -> Texture, expected: Option<Expected<'_>>) {
    let wgsl = kernel(body);
    let found = run_on(&wgsl, Checks::all(), &flat);
    let Some((kind, workgroup, invocation, count, message)) = expected else {
        assert!(found.is_empty(), "{}\n{wgsl}", list(&found));
        return;
    };
    let [finding] = &found[..] else {
        panic!("{}\n{wgsl}", list(&found));
    };
    assert_eq!(
        (
            finding.kind,
            &finding.location,
            finding.workgroup,
            finding.invocation,
            finding.count
        ),
        (kind, &place(&wgsl, 0), workgroup, invocation, count),
        "{finding}\n{wgsl}"
    );
    assert!(finding.message.contains(message), "{finding}");
    assert_eq!(run_on(&wgsl, only(kind), &flat), found);
    assert!(run_on(&wgsl, all_but(kind), &flat).is_empty());
}

fn expect(body: &str, expected: Option<Expected<'_>>) {
    expect_on(body, || empty(16, 8, F), expected);
}

#[test]
fn texels_outside_are_found() {
    expect("value = textureLoad(flat, at, 0).x;", None);
    // The last column looks beyond.
    expect(
        "value = /*!*/textureLoad(flat, at + vec2<i32>(1, 0), 0).x;",
        Some((
            K::Texel,
            [1, 0, 0],
            [7, 0, 0],
            8,
            "texel (16, 0) is outside of 16×8",
        )),
    );
    expect(
        "value = 1.0 + /*!*/textureLoad(flat, at - vec2<i32>(0, 1), 0).x;",
        Some((
            K::Texel,
            [0, 0, 0],
            [0, 0, 0],
            16,
            "texel (0, -1) is outside of 16×8",
        )),
    );
    expect(
        "if at.x < 15 { value = textureLoad(flat, at + vec2<i32>(1, 0), 0).x; }",
        None,
    );
    // Unsigned coordinates are shown as they are.
    expect(
        "if id.x == 3u { value = /*!*/textureLoad(flat, id.xy - vec2<u32>(4u, 0u), 0).x; }",
        Some((K::Texel, [0, 0, 0], [3, 0, 0], 8, "texel (4294967295, 0)")),
    );
    // Smaller levels have fewer texels.
    expect(
        "value = /*!*/textureLoad(layers, at, 0, i32(one)).x;",
        Some((
            K::Texel,
            [1, 0, 0],
            [0, 0, 0],
            96,
            "texel (8, 0) is outside of 8×4",
        )),
    );
    expect("value = textureLoad(layers, at / 2, 1, i32(one)).x;", None);
    expect(
        "value = /*!*/textureLoad(volume, vec3<i32>(at / 4, at.x / 2), 0).x;",
        Some((
            K::Texel,
            [1, 0, 0],
            [0, 0, 0],
            64,
            "texel (2, 0, 4) is outside of 4×4×4",
        )),
    );
    expect(
        "if at.y == 7 { /*!*/textureStore(result, at + 1, vec4<f32>()); }",
        Some((
            K::Texel,
            [0, 1, 0],
            [0, 3, 0],
            16,
            "texel (1, 8) is outside",
        )),
    );
}

#[test]
fn levels_and_layers_that_are_not_there_are_found() {
    expect(
        "if at.x > 3 { value = /*!*/textureLoad(flat, at, i32(one)).x; }",
        Some((
            K::Level,
            [0, 0, 0],
            [4, 0, 0],
            96,
            "level 1 is outside of 1",
        )),
    );
    expect(
        "value = /*!*/textureLoad(flat, at, i32(one) - 2).x;",
        Some((
            K::Level,
            [0, 0, 0],
            [0, 0, 0],
            128,
            "level -1 is outside of 1",
        )),
    );
    expect(
        "value = /*!*/textureLoad(layers, at, two, 0).x;",
        Some((
            K::Layer,
            [0, 0, 0],
            [0, 0, 0],
            128,
            "layer 2 is outside of 2",
        )),
    );
    expect("value = textureLoad(layers, at, one, 0).x;", None);
    expect(
        "value = /*!*/textureSampleLevel(layers, linear, vec2<f32>(id.xy) / 16.0, at.x - 14, 0.0).x;",
        Some((
            K::Layer,
            [0, 0, 0],
            [0, 0, 0],
            112,
            "layer -14 is outside of 2",
        )),
    );
    // Levels of detail are clamped by definition.
    expect(
        "value = textureSampleLevel(layers, linear, vec2<f32>(id.xy) / 16.0, one, 40.0).x;",
        None,
    );
    expect(
        "value = f32(/*!*/textureDimensions(layers, two + one).x);",
        Some((
            K::Level,
            [0, 0, 0],
            [0, 0, 0],
            128,
            "level 3 is outside of 3",
        )),
    );
    expect("value = f32(textureDimensions(layers, two).x);", None);
}

/// 16×8, of which the host wrote the columns below 8.
fn half_written() -> Texture {
    let source = image(16, 8, F, |x, y| [x as f32, y as f32, 0.0, 1.0]);
    // Whole rows only can be written from the start, so: what lies above is a copy.
    let mut texture = Texture::unwritten(source.desc).unwrap();
    let rows = ImageData {
        bytes: source.bytes[..4 * 16 * 4].to_vec(),
        ..source
    };
    texture.write(&rows.bytes);
    texture
}

#[test]
fn texels_that_nothing_wrote_are_found() {
    // Rows 4 to 7 are unwritten.
    expect_on(
        "value = textureLoad(flat, at, 0).x;",
        || empty(16, 8, F),
        None,
    );
    expect_on(
        "value = /*!*/textureLoad(flat, at, 0).x;",
        half_written,
        Some((
            K::Uninitialised,
            [0, 1, 0],
            [0, 0, 0],
            64,
            "nothing wrote texel (0, 4) of `flat`",
        )),
    );
    expect_on(
        "if at.y < 4 { value = textureLoad(flat, at, 0).x; }",
        half_written,
        None,
    );
    // A filter reads the texels that have a weight: at the centres of row 3 it is
    // none of row 4, half a texel further it is.
    let sample = |y: &str| {
        format!("value = /*!*/textureSampleLevel(flat, linear, vec2<f32>(0.5, {y} / 8.0), 0.0).x;")
    };
    expect_on(&sample("3.5"), half_written, None);
    expect_on(
        &sample("(3.0 + f32(at.x) / 15.0)"),
        half_written,
        Some((
            K::Uninitialised,
            [1, 0, 0],
            [0, 0, 0],
            64,
            "nothing wrote a texel of `flat`",
        )),
    );
    // A gather reads the same texels.
    expect_on(
        "value = /*!*/textureGather(0, flat, linear, vec2<f32>(0.5, (3.0 + f32(at.x) / 15.0) / 8.0)).x;",
        half_written,
        Some((
            K::Uninitialised,
            [1, 0, 0],
            [0, 0, 0],
            64,
            "nothing wrote a texel of `flat`",
        )),
    );
    // What is outside of the texture is no memory; that is another check.
    let wgsl = kernel("value = textureLoad(flat, at + 16, 0).x;");
    let found = run_on(&wgsl, only(K::Uninitialised), half_written);
    assert!(found.is_empty(), "{}", list(&found));
}

/// A storage texture that is read and written.
#[test]
fn storage_textures_are_watched() {
    let kernel = |body: &str| {
        format!(
            "@group(0) @binding(0) var image: texture_storage_2d<r32float, read_write>;
@compute @workgroup_size(8, 4)
fn main(@builtin(global_invocation_id) id: vec3<u32>, @builtin(local_invocation_id) l: vec3<u32>) {{
    let at = vec2<i32>(id.xy);
    {body}
}}"
        )
    };
    let run = |wgsl: &str| {
        let program = checked(wgsl, Checks::all());
        find(&program, &all_executors(), [2, 2, 1], |dispatch| {
            let image = Texture::unwritten(TextureDesc::d2(16, 8, F)).unwrap();
            dispatch(&[BoundResource::Texture(image.view())]);
        })
    };
    let one = |body: &str, kind: K, invocation: [u32; 3], count: u64, message: &str| {
        let wgsl = kernel(body);
        let found = run(&wgsl);
        let [finding] = &found[..] else {
            panic!("{}\n{wgsl}", list(&found))
        };
        assert_eq!(
            (
                finding.kind,
                &finding.location,
                finding.workgroup,
                finding.invocation,
                finding.count
            ),
            (kind, &place(&wgsl, 0), [0; 3], invocation, count),
            "{finding}"
        );
        assert!(finding.message.contains(message), "{finding}");
    };
    one(
        "let old = /*!*/textureLoad(image, at); textureStore(image, at, old + 1.0);",
        K::Uninitialised,
        [0; 3],
        128,
        "nothing wrote texel (0, 0) of `image`",
    );
    one(
        "textureStore(image, at, vec4<f32>(1.0)); let n = vec2<i32>(id.xy - l.xy + (l.xy + vec2<u32>(1u, 0u)) % 8u);
        if l.y < 4u { let other = /*!*/textureLoad(image, n); if other.x > 5.0 { textureStore(image, at, other); } }",
        K::Race,
        [0; 3],
        128,
        "texel (1, 0) of `image` is read here and written by invocation (1,0,0)",
    );
    one(
        "/*!*/textureStore(image, vec2<i32>(id.xy - l.xy), vec4<f32>(1.0));",
        K::Race,
        [1, 0, 0],
        124,
        "texel (0, 0) of `image` is written here and written by invocation (0,0,0)",
    );
    for silent in [
        "textureStore(image, at, vec4<f32>(1.0)); let back = textureLoad(image, at); textureStore(image, at, back);",
        "textureStore(image, at, vec4<f32>(1.0)); textureBarrier(); let other = textureLoad(image, vec2<i32>(id.xy - l.xy)); if other.x > 5.0 { textureStore(image, at, other); }",
    ] {
        let wgsl = kernel(silent);
        let found = run(&wgsl);
        assert!(found.is_empty(), "{}\n{wgsl}", list(&found));
    }
}

/// Filling and copying write; parts of a texture are told apart.
#[test]
fn textures_remember_what_is_written() {
    let wgsl = kernel("value = /*!*/textureLoad(flat, at, 0).x;");
    let count = |texture: fn() -> Texture| {
        run_on(&wgsl, Checks::all(), texture)
            .iter()
            .map(|finding| finding.count)
            .sum::<u64>()
    };
    fn unwritten() -> Texture {
        Texture::unwritten(TextureDesc::d2(16, 8, F)).unwrap()
    }
    assert_eq!(count(unwritten), 128);
    assert_eq!(
        count(|| {
            let texture = unwritten();
            texture
                .view()
                .fill(etalon_core::texel::Texel::Float([1.0; 4]));
            texture
        }),
        0
    );
    assert_eq!(
        count(|| {
            let texture = unwritten();
            assert!(texture.view().copy_from(&half_written().view()));
            texture
        }),
        64
    );
}
