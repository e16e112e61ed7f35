//! Kernels against declarations.

use super::{R32, library, plan_with};
use crate::graph::{Graph, GraphError, Texture, Written};
use crate::plan::error::Mismatch;
use crate::plan::{Capture, Groups, Plan, PlanError, PlanOptions, Step, Usage};
use crate::resource::{BufferDesc, Limits, SamplerDesc, TextureDesc};
use crate::{Format, graph::ComputePass, kernel::KernelLibrary};

const UNIFORMS: &str = "
struct Settings { gain: f32, offset: vec3<f32>, size: vec2<u32>, turn: mat3x3<f32> }
@group(0) @binding(0) var<uniform> settings: Settings;
@group(0) @binding(1) var result: texture_storage_2d<r32float, write>;
@compute @workgroup_size(8, 8) fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    let v = settings.turn[0] * settings.offset.x;
    textureStore(result, id.xy, vec4f(settings.gain + v.x + f32(settings.size.x)));
}";

fn kernels() -> KernelLibrary {
    let mut library = library();
    library.add_source("test/uniforms", UNIFORMS);
    library
}

fn try_plan(
    build: impl FnOnce(ComputePass<'_>, Texture) -> Result<Written, GraphError>,
    kernel: &'static str,
) -> Result<Plan, PlanError> {
    let mut graph = Graph::new();
    let target = graph.texture("result", R32);
    let written = build(graph.compute(kernel), target).unwrap();
    graph
        .output("result", written.texture("result").unwrap())
        .unwrap();
    plan_with(&graph, &kernels(), Capture::None)
}

fn uniforms(pass: ComputePass<'_>) -> ComputePass<'_> {
    use glam::{Mat3, UVec2, Vec3};
    let turn = Mat3::from_cols_array(&[1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0]);
    pass.set("turn", turn)
        .set("size", UVec2::new(7, 8))
        .set("offset", Vec3::new(0.5, 0.25, 0.125))
        .set("gain", 2.0)
}

#[test]
fn uniforms_are_packed_by_name_where_wgsl_puts_them() {
    let plan = try_plan(
        |pass, target| {
            uniforms(pass)
                .write("result", target)
                .per_texel_of("result")
        },
        "test/uniforms",
    )
    .unwrap();
    let words: Vec<f32> = plan
        .uniforms
        .chunks_exact(4)
        .map(|word| f32::from_le_bytes(word.try_into().unwrap()))
        .collect();
    // WGSL §14.4.1: vec3 at 16, vec2 at 32 (after vec3's 12 bytes, 28 rounded up to 8), mat3x3 at 48 with columns of 16.
    assert_eq!(words[0], 2.0);
    assert_eq!(words[4..7], [0.5, 0.25, 0.125]);
    assert_eq!([words[8].to_bits(), words[9].to_bits()], [7, 8]);
    assert_eq!(words[12..15], [1.0, 2.0, 3.0]);
    assert_eq!(words[16..19], [4.0, 5.0, 6.0]);
    assert_eq!(words[20..23], [7.0, 8.0, 9.0]);
    assert_eq!(plan.uniforms.len(), 96);
}

#[test]
fn structure_ignores_uniform_values_and_nothing_else() {
    let with = |gain: f32, groups: [u32; 3]| {
        try_plan(
            |pass, target| {
                use glam::{Mat3, UVec2, Vec3};
                pass.set("turn", Mat3::IDENTITY)
                    .set("size", UVec2::ONE)
                    .set("offset", Vec3::ONE)
                    .set("gain", gain)
                    .write("result", target)
                    .groups(groups)
            },
            "test/uniforms",
        )
        .unwrap()
    };
    let reference = with(1.0, [1, 1, 1]);
    assert_eq!(reference.structure(), with(2.0, [1, 1, 1]).structure());
    assert_ne!(reference, with(2.0, [1, 1, 1]));
    assert_ne!(reference.structure(), with(1.0, [2, 1, 1]).structure());
}

/// The disagreement that planning a pass of the `test/uniforms` kernel ends in.
fn mismatch(
    build: impl FnOnce(ComputePass<'_>, Texture) -> Result<Written, GraphError>,
) -> Mismatch {
    match try_plan(build, "test/uniforms") {
        Err(PlanError::Mismatch {
            pass,
            kernel,
            mismatch,
        }) => {
            assert_eq!(
                (pass.as_str(), kernel.as_str()),
                ("test/uniforms", "test/uniforms")
            );
            mismatch
        }
        other => panic!("{other:?}"),
    }
}

#[test]
fn disagreements_name_both_sides() {
    let found = mismatch(|pass, target| {
        uniforms(pass)
            .set("gian", 1.0)
            .write("result", target)
            .per_texel_of("result")
    });
    assert_eq!(
        found.to_string(),
        "the pass gives uniform `gian`, the kernel has none of that name; it has `gain`, `offset`, `size`, `turn`"
    );
    let found = mismatch(|pass, target| {
        pass.set("gain", 1.0)
            .write("result", target)
            .per_texel_of("result")
    });
    assert_eq!(
        found,
        Mismatch::NotInPass {
            what: "uniform",
            name: "offset".to_owned()
        }
    );
    let found = mismatch(|pass, target| {
        use glam::{Mat3, UVec2, Vec3};
        let pass = pass
            .set("turn", Mat3::IDENTITY)
            .set("size", UVec2::ONE)
            .set("offset", Vec3::ONE);
        pass.set("gain", 1_u32)
            .write("result", target)
            .per_texel_of("result")
    });
    assert_eq!(
        found.to_string(),
        "`gain`: the pass gives u32, the kernel wants f32"
    );
    let found = mismatch(|pass, target| {
        uniforms(pass)
            .sampler("smooth", SamplerDesc::default())
            .write("result", target)
            .per_texel_of("result")
    });
    assert_eq!(
        found.to_string(),
        "the pass gives sampler `smooth`, the kernel has none of that name; it has none"
    );
}

/// Plans one pass of `kernel` with the texture `desc` as its target.
fn with_target(desc: TextureDesc, kernel: &'static str, limits: Limits) -> Result<Plan, PlanError> {
    let mut graph = Graph::new();
    let target = graph.texture("result", desc);
    let written = graph
        .compute(kernel)
        .write("result", target)
        .per_texel("result")
        .unwrap();
    graph.output("result", written).unwrap();
    Plan::new(
        &graph,
        &kernels(),
        &PlanOptions {
            limits,
            ..PlanOptions::default()
        },
    )
}

#[test]
fn textures_must_suit_their_bindings() {
    let text = |result: Result<Plan, PlanError>| result.map(|_| ()).unwrap_err().to_string();
    let limits = Limits::default();
    let error = text(with_target(
        R32.with_format(Format::Rgba16Float),
        "test/write0",
        limits,
    ));
    assert!(
        error.contains("the pass gives rgba16float, the kernel wants r32float"),
        "{error}"
    );
    let error = text(with_target(
        TextureDesc::d3(4, 4, 4, Format::R32Float),
        "test/write0",
        limits,
    ));
    assert!(
        error.contains("a D3 texture with 1 layers, the kernel wants a 2d view"),
        "{error}"
    );
    let error = text(with_target(R32.with_mips(3), "test/write0", limits));
    assert!(
        error.contains("3 mips, the kernel wants one mip"),
        "{error}"
    );
    let error = text(with_target(
        R32,
        "test/write0",
        Limits {
            max_workgroups: 1,
            ..limits
        },
    ));
    assert!(
        error.contains("[2, 2, 1] workgroups, over the device's limit of 1"),
        "{error}"
    );
    let error = text(with_target(R32, "test/write1", limits));
    assert!(
        error.contains("the kernel wants resource `in0`, which the pass does not give"),
        "{error}"
    );
    let error = text(with_target(R32, "test/none", limits));
    assert!(error.contains("test/none"), "{error}");
}

#[test]
fn indirect_arguments_must_lie_inside_their_buffer() {
    let plan = |bytes: u64, offset: u64| {
        let mut graph = Graph::new();
        let arguments = graph
            .import_buffer("arguments", BufferDesc { bytes })
            .unwrap();
        let target = graph.texture("result", R32);
        let written = graph
            .compute("test/write0")
            .write("result", target)
            .indirect(arguments, offset)
            .unwrap();
        graph
            .output("result", written.texture("result").unwrap())
            .unwrap();
        plan_with(&graph, &kernels(), Capture::None)
    };
    let good = plan(16, 4).unwrap();
    assert!(matches!(
        good.steps[0].step,
        Step::Dispatch {
            groups: Groups::Indirect { offset: 4, .. },
            ..
        }
    ));
    for (bytes, offset) in [(8, 0), (16, 8), (16, 2), (16, u64::MAX - 3)] {
        assert!(
            matches!(plan(bytes, offset), Err(PlanError::Mismatch { .. })),
            "{bytes} {offset}"
        );
    }
}

#[test]
fn what_only_another_variant_of_a_kernel_uses_may_be_given() {
    let mut library = library();
    library.add_source(
        "test/variants",
        "@if(!strict) @group(0) @binding(1) var smoothly: sampler;
         @group(0) @binding(0) var source: texture_2d<f32>;
         @group(0) @binding(2) var result: texture_storage_2d<rgba16float, write>;
         @compute @workgroup_size(8, 8) fn main(@builtin(global_invocation_id) id: vec3<u32>) {
             @if(strict) let texel = textureLoad(source, id.xy, 0);
             @if(!strict) let texel = textureSampleLevel(source, smoothly, vec2f(id.xy) / 16.0, 0.0);
             textureStore(result, id.xy, texel);
         }",
    );
    let half = R32.with_format(Format::Rgba16Float);
    for arithmetic in [
        crate::kernel::Arithmetic::Strict,
        crate::kernel::Arithmetic::Fast,
    ] {
        let mut graph = Graph::new();
        let source = graph.import_texture("source", half).unwrap();
        let target = graph.texture("target", half);
        let written = graph
            .compute("test/variants")
            .read("source", source)
            .sampler("smoothly", SamplerDesc::LINEAR_CLAMP)
            .write("result", target)
            .per_texel("result")
            .unwrap();
        graph.output("result", written).unwrap();
        let options = PlanOptions {
            arithmetic,
            ..PlanOptions::default()
        };
        Plan::new(&graph, &library, &options).unwrap();
    }
}

#[test]
fn a_list_of_tiles_is_read_and_counts_its_own_workgroups() {
    let mut library = library();
    library.add_source(
        "test/tiles",
        "struct Tiles { groups: vec3<u32>, corners: array<u32> }
         @group(0) @binding(0) var<storage, read> tiles: Tiles;
         @group(0) @binding(1) var result: texture_storage_2d<r32float, write>;
         @compute @workgroup_size(8, 8) fn main(@builtin(workgroup_id) tile: vec3<u32>) {
             let corner = tiles.corners[tile.x];
             textureStore(result, vec2<u32>(corner & 0xffffu, corner >> 16u), vec4f(1.0));
         }",
    );
    let mut graph = Graph::new();
    let tiles = graph
        .import_buffer("tiles", BufferDesc { bytes: 64 })
        .unwrap();
    let target = graph.texture("target", R32);
    let written = graph
        .compute("test/tiles")
        .write("result", target)
        .per_tile("tiles", tiles)
        .unwrap();
    graph
        .output("result", written.texture("result").unwrap())
        .unwrap();
    let plan = plan_with(&graph, &library, Capture::None).unwrap();
    let Step::Dispatch { groups, .. } = &plan.steps[0].step else {
        panic!("a dispatch")
    };
    let Groups::Indirect { buffer, offset } = *groups else {
        panic!("{groups:?}")
    };
    let usages = plan.resources[buffer as usize].usages;
    assert_eq!(offset, 0);
    assert!(usages.contains(Usage::Indirect) && usages.contains(Usage::StorageRead));
    // Both ways of reading wait for whoever wrote the list.
    let mut waits = plan.steps[0].barriers.iter();
    assert!(waits.any(|b| b.resource == buffer && b.to == Usage::Indirect));
}
