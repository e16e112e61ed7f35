//! Tests of the whole way from text to kernel.

use super::*;

const BLUR: &str = "
import package::lib::weights::gauss;

struct Settings { radius: f32, count: u32, tint: vec3f, m: mat4x4f, w: array<vec4f, 3> }
@group(0) @binding(0) var<uniform> settings: Settings;
@group(0) @binding(1) var source: texture_2d<f32>;
@group(0) @binding(2) var target_: texture_storage_2d<rgba16float, write>;
@if(!strict) @group(0) @binding(3) var smooth_: sampler;
override scale: f32 = 2.0;

@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3u) {
    // A comment.
    var colour = textureLoad(source, id.xy, 0) * gauss(settings.radius) * scale;
    @if(!strict) {
        colour = textureSampleLevel(source, smooth_, vec2f(0.5), 0.0);
    }
    textureStore(target_, id.xy, colour + vec4f(settings.tint, 1.0));
}
";

#[test]
fn smoke() {
    let mut library = KernelLibrary::new();
    library.add_source(
        "lib/weights",
        "fn gauss(x: f32) -> f32 { return x * x; } fn other() {}",
    );
    library.add_source("a/blur", BLUR);
    for arithmetic in [Arithmetic::Strict, Arithmetic::Fast] {
        let k = library
            .get(
                &KernelRequest::new("a/blur").constant("scale", 3.0),
                arithmetic,
            )
            .unwrap_or_else(|e| panic!("{e}"));
        println!("{}\n{:#?}\n{:?} {}", k.wgsl, k.bindings, k.unused, k.id);
        #[cfg(feature = "spirv")]
        println!("{}", spirv(&k, &SpirvOptions::default()).unwrap().len());
    }
    for bad in [
        "fn main() { let x = ; }",
        "import package::lib::nope::x; @compute @workgroup_size(1) fn main() { x(); }",
        "@compute @workgroup_size(1) fn main() { let x = 1 +\n y; }",
        "@compute @workgroup_size(1) fn main() { let x = exp(f32(arrayLength(&v))); v[0] = x; } @group(0) @binding(0) var<storage, read_write> v: array<f32>;",
    ] {
        library.add_source("bad", bad);
        let e = library
            .get(&KernelRequest::new("bad"), Arithmetic::Strict)
            .unwrap_err();
        println!("{e}\n{e:?}\n");
    }
}
