//! Kernels that draw.

use super::*;
use crate::raster::NumberKind;

const KERNEL: &str = "
    struct Params { tint: vec4f, scale: f32 }
    @group(0) @binding(0) var<uniform> params: Params;
    @group(0) @binding(1) var image: texture_2d<f32>;
    override threshold: f32 = 0.5;
    struct Corner {
        @builtin(position) clip: vec4f,
        @location(0) uv: vec2f,
        @location(1) @interpolate(flat) id: u32,
    }
    @vertex fn vertex(
        @location(2) uv: vec2f,
        @location(0) position: vec3f,
        @builtin(instance_index) instance: u32,
        @location(1) joints: vec4u,
    ) -> Corner {
        return Corner(vec4f(position * params.scale, 1.0), uv, instance + joints.x);
    }
    struct Targets { @location(1) id: u32, @location(0) colour: vec4f }
    @fragment fn fragment(corner: Corner) -> Targets {
        let texel = textureLoad(image, vec2u(corner.uv), 0);
        if texel.a < threshold { discard; }
        return Targets(corner.id, texel * params.tint);
    }";

fn value(name: &str, location: u32, kind: NumberKind, components: u32) -> StageValue {
    StageValue {
        name: name.to_owned(),
        location,
        kind,
        components,
    }
}

#[test]
fn stages_are_reflected_by_name_and_location() {
    let kernel = compile_one(KERNEL, Arithmetic::Fast).unwrap();
    assert!(kernel.compute().is_none());
    let stages = kernel.raster().unwrap();
    assert_eq!(stages.vertex.entry_point, "vertex");
    assert_eq!(
        stages.vertex.inputs,
        [
            value("position", 0, NumberKind::Float, 3),
            value("joints", 1, NumberKind::Uint, 4),
            value("uv", 2, NumberKind::Float, 2),
        ]
    );
    let fragment = stages.fragment.as_ref().unwrap();
    assert_eq!(
        fragment.outputs,
        [
            value("colour", 0, NumberKind::Float, 4),
            value("id", 1, NumberKind::Uint, 1),
        ]
    );
    assert!(fragment.discards && !fragment.writes_depth);
    let names: Vec<&str> = kernel.bindings.iter().map(|it| it.name.as_str()).collect();
    assert_eq!(names, ["params", "image"]);
}

/// Overrides of both stages, and resources that one stage alone uses.
#[test]
fn both_stages_are_specialised() {
    let library = library(&[("test/one", KERNEL)]);
    let request = KernelRequest::new("test/one").constant("threshold", 0.25);
    let kernel = library.get(&request, Arithmetic::Fast).unwrap();
    assert_eq!(kernel.constants, [("threshold".to_owned(), 0.25)]);
    assert!(kernel.module.overrides.is_empty());
}

#[test]
fn a_kernel_may_draw_depth_alone_or_put_out_its_own() {
    let depth = "@vertex fn vertex(@location(0) position: vec4f) -> @builtin(position) vec4f {
        return position; }";
    let kernel = compile_one(depth, Arithmetic::Strict).unwrap();
    assert!(kernel.raster().unwrap().fragment.is_none());
    let own = format!(
        "{depth} struct Out {{ @builtin(frag_depth) depth: f32 }}
         @fragment fn fragment() -> Out {{ return Out(0.5); }}"
    );
    let kernel = compile_one(&own, Arithmetic::Strict).unwrap();
    let fragment = kernel.raster().unwrap().fragment.clone().unwrap();
    assert!(fragment.writes_depth && !fragment.discards && fragment.outputs.is_empty());
    let plain =
        format!("{depth} @fragment fn fragment() -> @location(0) vec4f {{ return vec4f(); }}");
    let kernel = compile_one(&plain, Arithmetic::Strict).unwrap();
    let fragment = kernel.raster().unwrap().fragment.clone().unwrap();
    assert_eq!(fragment.outputs, [value("colour", 0, NumberKind::Float, 4)]);
}

#[test]
fn what_cannot_be_drawn_is_refused() {
    let vertex = "@vertex fn vertex() -> @builtin(position) vec4f { return vec4f(); }";
    let fragment = "@fragment fn fragment() -> @location(0) vec4f { return vec4f(); }";
    for text in [
        fragment.to_owned(),
        format!("{vertex} @compute @workgroup_size(1) fn main() {{}}"),
        format!(
            "{vertex} {fragment} {}",
            fragment.replace("fn fragment", "fn other")
        ),
        vertex.replace("fn vertex", "fn corner"),
    ] {
        assert!(
            matches!(error_of(&text), KernelError::EntryPoint { .. }),
            "{text}"
        );
    }
    let writes = format!(
        "@group(0) @binding(0) var<storage, read_write> counts: array<u32>;
         {vertex}
         @fragment fn fragment() -> @location(0) vec4f {{ counts[0] = 1u; return vec4f(); }}"
    );
    let error = error_of(&writes);
    assert!(matches!(error, KernelError::Interface(_)), "{error}");
    assert!(
        error.to_string().contains("`counts` can be written"),
        "{error}"
    );
    let high = format!(
        "{vertex} {}",
        fragment.replace("@location(0)", "@location(8)")
    );
    let error = error_of(&high);
    assert!(error.to_string().contains("location 8"), "{error}");
}

#[test]
fn stages_that_do_not_suit_each_other_are_refused() {
    let vertex = "struct Corner { @builtin(position) clip: vec4f, @location(0) uv: vec2f }
        @vertex fn vertex(@location(0) position: vec4f) -> Corner {
            return Corner(position, position.xy); }";
    let with = |input: &str| {
        format!(
            "{vertex} @fragment fn fragment({input}) -> @location(0) vec4f {{
             return vec4f(uv.x); }}"
        )
    };
    assert!(compile_one(&with("@location(0) uv: vec2f"), Arithmetic::Fast).is_ok());
    for (input, part) in [
        (
            "@location(1) uv: vec2f",
            "location 1, where vertices give nothing",
        ),
        (
            "@location(3) uv: vec2f",
            "location 3, where vertices give nothing",
        ),
        (
            "@location(0) uv: vec3f",
            "location 0, where vertices give something else",
        ),
        (
            "@location(0) @interpolate(linear) uv: vec2f",
            "location 0, where vertices give something else",
        ),
    ] {
        let error = error_of(&with(input));
        assert!(matches!(error, KernelError::Interface(_)), "{error}");
        assert!(error.to_string().contains(part), "{error}");
    }
}

/// Each stage by itself passes for SPIR-V with one entry point of that stage.
#[test]
#[cfg(feature = "spirv")]
fn each_stage_is_a_module_of_its_own() {
    use naga::ShaderStage;
    const OP_ENTRY_POINT: u32 = 15;
    let kernel = compile_one(KERNEL, Arithmetic::Fast).unwrap();
    for (stage, model) in [(ShaderStage::Vertex, 0), (ShaderStage::Fragment, 4)] {
        let words = crate::kernel::spirv(&kernel, stage, &SpirvOptions::default()).unwrap();
        let entries: Vec<u32> = (5..words.len())
            .scan(5, |at, _| {
                let here = *at;
                let word = *words.get(here)?;
                *at += (word >> 16).max(1) as usize;
                Some((word & 0xffff == OP_ENTRY_POINT).then(|| words[here + 1]))
            })
            .flatten()
            .collect();
        assert_eq!(entries, [model]);
    }
    let missing = crate::kernel::spirv(&kernel, ShaderStage::Compute, &SpirvOptions::default());
    assert!(matches!(missing, Err(KernelError::Spirv { .. })));
}
