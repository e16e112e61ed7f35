//! Passes that draw.

use std::ops::Range;

use glam::Vec4;

use super::R32;
use crate::Format;
use crate::graph::{Buffer, ClearValue, Draw, Graph, GraphError, Load, Texture, Written};
use crate::kernel::{Arithmetic, KernelLibrary};
use crate::plan::{DrawExtent, Plan, PlanError, PlanOptions, RasterStep, Step, Usage};
use crate::raster::{
    Blend, ColourWrites, DepthState, IndexFormat, RasterState, Scissor, StepMode, TargetState,
    VertexAttribute, VertexFormat, VertexLayout, Viewport,
};
use crate::resource::{BufferDesc, TextureDesc};

const CLEAR: Load = Load::Clear(ClearValue::Float([0.0; 4]));

fn library() -> KernelLibrary {
    let mut library = super::library();
    library.add_source(
        "test/draw",
        "struct Params { tint: vec4f }
         @group(0) @binding(0) var<uniform> params: Params;
         @group(0) @binding(1) var image: texture_2d<f32>;
         struct Corner { @builtin(position) clip: vec4f, @location(0) uv: vec2f }
         @vertex fn vertex(
             @location(0) position: vec3f, @location(1) uv: vec2f, @location(2) offset: vec4f
         ) -> Corner { return Corner(vec4f(position, 1.0) + offset, uv); }
         struct Targets { @location(0) colour: vec4f, @location(1) id: u32 }
         @fragment fn fragment(corner: Corner) -> Targets {
             return Targets(params.tint * textureLoad(image, vec2u(corner.uv), 0), 7u);
         }",
    );
    library.add_source(
        "test/depth",
        "@vertex fn vertex(@location(0) position: vec3f) -> @builtin(position) vec4f {
             return vec4f(position, 1.0);
         }",
    );
    library
}

fn plan(graph: &Graph) -> Result<Plan, PlanError> {
    let options = PlanOptions {
        arithmetic: Arithmetic::Strict,
        ..PlanOptions::default()
    };
    Plan::new(graph, &library(), &options)
}

/// A mesh's buffers, and targets to draw it to.
struct Parts {
    corners: Buffer,
    offsets: Buffer,
    indices: Buffer,
    arguments: Buffer,
    image: Texture,
    colour: Texture,
    id: Texture,
    depth: Texture,
}

fn parts(graph: &mut Graph) -> Parts {
    let mut buffer = |name, bytes| graph.import_buffer(name, BufferDesc { bytes }).unwrap();
    let (corners, offsets) = (buffer("corners", 20 * 8), buffer("offsets", 16 * 4));
    let (indices, arguments) = (buffer("indices", 2 * 36), buffer("arguments", 64));
    let image = graph.import_texture("image", R32).unwrap();
    let mut texture = |name, format| graph.texture(name, TextureDesc::d2(64, 48, format));
    Parts {
        corners,
        offsets,
        indices,
        arguments,
        image,
        colour: texture("colour", Format::Rgba16Float),
        id: texture("id", Format::R32Uint),
        depth: texture("depth", Format::Depth32Float),
    }
}

/// Position and texture coordinates of a vertex.
fn corner() -> VertexLayout {
    let attribute = |name: &'static str, format, offset| VertexAttribute {
        name: name.into(),
        format,
        offset,
    };
    VertexLayout {
        stride: 20,
        step: StepMode::Vertex,
        attributes: vec![
            attribute("uv", VertexFormat::Float32x2, 12),
            attribute("position", VertexFormat::Float32x3, 0),
        ],
    }
}

fn offset() -> VertexLayout {
    VertexLayout {
        step: StepMode::Instance,
        ..VertexLayout::packed("offset", VertexFormat::Float32x4)
    }
}

fn draw(parts: &Parts) -> Draw {
    Draw::new("test/draw")
        .vertices(parts.corners, 0, corner())
        .vertices(parts.offsets, 0, offset())
        .indices(parts.indices, 0, IndexFormat::Uint16)
        .elements(0..36)
        .instances(0..4)
        .read("image", parts.image)
        .set("tint", Vec4::new(1.0, 0.5, 0.25, 1.0))
        .state(RasterState {
            depth: Some(DepthState::REVERSED),
            ..RasterState::default()
        })
}

/// A prepass of depth, then colours over it.
fn two_passes(graph: &mut Graph, parts: &Parts, draw: Draw) -> Result<Written, GraphError> {
    let depth = graph
        .raster("prepass")
        .depth(parts.depth, CLEAR)
        .draw(
            Draw::new("test/depth")
                .vertices(parts.corners, 0, corner())
                .elements(0..6)
                .state(RasterState {
                    depth: Some(DepthState::REVERSED),
                    ..RasterState::default()
                }),
        )
        .finish()?
        .texture("depth")?;
    graph
        .raster("colours")
        .colour("colour", parts.colour, CLEAR)
        .colour("id", parts.id, Load::Clear(ClearValue::Uint([0; 4])))
        .depth(depth, Load::Keep)
        .draw(draw)
        .finish()
}

fn planned(change: impl FnOnce(&Parts, Draw) -> Draw) -> Result<Plan, PlanError> {
    let mut graph = Graph::new();
    let parts = parts(&mut graph);
    let draw = change(&parts, draw(&parts));
    let written = two_passes(&mut graph, &parts, draw).unwrap();
    graph
        .output("colour", written.texture("colour").unwrap())
        .unwrap();
    plan(&graph)
}

fn raster(plan: &Plan, step: usize) -> &RasterStep {
    match &plan.steps[step].step {
        Step::Raster(raster) => raster,
        other => panic!("{other:?}"),
    }
}

#[test]
fn draws_are_planned_after_what_they_draw_over() {
    let plan = planned(|_, draw| draw).unwrap();
    let names: Vec<&str> = plan.steps.iter().map(|step| step.name.as_str()).collect();
    assert_eq!(names, ["prepass", "colours"]);
    assert_eq!((plan.draw_count(), plan.dispatch_count()), (2, 0));
    let (first, second) = (raster(&plan, 0), raster(&plan, 1));
    assert_eq!(second.size, [64, 48]);
    assert_eq!(second.viewport, Viewport::of(64, 48));
    let name = |resource: u32| plan.resources[resource as usize].name.as_str();
    let depth = second.depth.as_ref().unwrap();
    assert_eq!((name(depth.resource), depth.clear), ("depth", None));
    assert_eq!(
        first.depth.as_ref().unwrap().clear,
        Some(ClearValue::Float([0.0; 4]))
    );
    assert_eq!(name(second.colours[1].resource), "id");
    let draw = &second.draws[0];
    assert_eq!(name(draw.vertices[0].buffer), "corners");
    assert_eq!(name(draw.indices.unwrap().buffer), "indices");
    let locations: Vec<(u32, u32)> = draw.vertices[0]
        .layout
        .attributes
        .iter()
        .map(|attribute| (attribute.location, attribute.offset))
        .collect();
    assert_eq!(locations, [(0, 0), (1, 12)]);
    assert_eq!(draw.vertices[1].layout.step, StepMode::Instance);
    // What the depth kernel does not want is left out.
    assert_eq!(first.draws[0].vertices[0].layout.attributes.len(), 1);
    let to = |step: usize| {
        let barriers = &plan.steps[step].barriers;
        let mut to: Vec<(&str, Usage)> =
            barriers.iter().map(|b| (name(b.resource), b.to)).collect();
        to.sort();
        to
    };
    assert_eq!(
        to(0),
        [("corners", Usage::Vertices), ("depth", Usage::DepthTarget)]
    );
    assert_eq!(
        to(1),
        [
            ("colour", Usage::ColourTarget),
            ("depth", Usage::DepthTarget),
            ("id", Usage::ColourTarget),
            ("indices", Usage::Indices),
            ("offsets", Usage::Vertices),
        ]
    );
}

/// Drivers round otherwise what a format does not hold.
#[test]
fn targets_are_cleared_to_what_their_texels_hold() {
    for (format, given, held) in [
        // 0.3 of 255 is 76.5.
        (Format::Rgba8Unorm, 0.299, 76.0 / 255.0),
        // The unit of a half float at 0.05 is 2^-15; 0.05 is 1638.4 of them.
        (Format::Rgba16Float, 0.05, 1638.0 / 32768.0),
        (Format::R32Float, 0.05, 0.05),
    ] {
        let mut graph = Graph::new();
        let target = graph.texture("target", TextureDesc::d2(4, 4, format));
        let clear = Load::Clear(ClearValue::Float([given; 4]));
        let pass = graph.raster("clear").colour("colour", target, clear);
        let cleared = pass.finish().unwrap().texture("colour").unwrap();
        graph.output("cleared", cleared).unwrap();
        let plan = plan(&graph).unwrap();
        match raster(&plan, 0).colours[0].clear {
            Some(ClearValue::Float([red, ..])) => assert_eq!(red, held as f32, "{format}"),
            other => panic!("{other:?}"),
        }
    }
}

/// Depth that is compared and not changed is read, however many passes do so.
#[test]
fn depth_that_no_draw_writes_keeps_its_version() {
    let mut graph = Graph::new();
    let parts = parts(&mut graph);
    let tested = RasterState {
        depth: Some(DepthState {
            write: false,
            ..DepthState::REVERSED
        }),
        ..RasterState::default()
    };
    let filled = graph
        .clear(parts.depth, ClearValue::Float([0.5; 4]))
        .unwrap();
    for name in ["first", "second"] {
        let colour = graph.texture(name, TextureDesc::d2(64, 48, Format::Rgba16Float));
        let id = graph.texture(name, TextureDesc::d2(64, 48, Format::R32Uint));
        let written = graph
            .raster(name)
            .colour("colour", colour, CLEAR)
            .colour("id", id, Load::Clear(ClearValue::Uint([0; 4])))
            .depth(filled, Load::Keep)
            .draw(draw(&parts).state(tested.clone()))
            .finish()
            .unwrap();
        assert!(written.texture("depth").is_err());
        graph
            .output(name, written.texture("colour").unwrap())
            .unwrap();
    }
    graph.output("depth", filled).unwrap();
    let plan = plan(&graph).unwrap();
    assert_eq!(plan.draw_count(), 2);
    assert!(plan.output("depth").is_some());
}

#[test]
fn what_nothing_reads_is_not_drawn() {
    let mut graph = Graph::new();
    let parts = parts(&mut graph);
    let written = two_passes(&mut graph, &parts, draw(&parts)).unwrap();
    let _ = written.texture("colour").unwrap();
    graph.output("image", parts.image).unwrap();
    let plan = plan(&graph).unwrap();
    assert!(plan.steps.is_empty());
    assert_eq!(plan.culled.len(), 2);
}

#[test]
fn indirect_draws_name_their_records() {
    let plan = planned(|parts, draw| draw.indirect(parts.arguments, 4, 3)).unwrap();
    let draw = &raster(&plan, 1).draws[0];
    let DrawExtent::Indirect {
        buffer,
        offset,
        draws,
    } = draw.extent
    else {
        panic!("{:?}", draw.extent);
    };
    assert_eq!(plan.resources[buffer as usize].name, "arguments");
    assert_eq!((offset, draws), (4, 3));
    // Three of twenty bytes from byte 4 on are all; four are not there.
    let refused = planned(|parts, draw| draw.indirect(parts.arguments, 4, 4));
    assert!(matches!(refused, Err(PlanError::Mismatch { .. })));
}

/// Targets that a kernel puts nothing out for stay as they are.
#[test]
fn targets_without_output_are_not_written() {
    let mut graph = Graph::new();
    let parts = parts(&mut graph);
    let written = graph
        .raster("depth alone")
        .colour("colour", parts.colour, CLEAR)
        .depth(parts.depth, CLEAR)
        .draw(
            Draw::new("test/depth")
                .vertices(parts.corners, 0, corner())
                .elements(0..3),
        )
        .finish()
        .unwrap();
    graph
        .output("colour", written.texture("colour").unwrap())
        .unwrap();
    let plan = plan(&graph).unwrap();
    let state = &raster(&plan, 0).draws[0].state;
    assert_eq!(state.targets.len(), 1);
    assert_eq!(state.targets[0].writes, ColourWrites::NONE);
}

#[test]
fn declarations_that_kernels_do_not_suit_are_refused() {
    let mismatch = |change: &dyn Fn(&Parts, Draw) -> Draw, part: &str| {
        let error = planned(change).unwrap_err();
        assert!(matches!(error, PlanError::Mismatch { .. }), "{error}");
        assert!(error.to_string().contains(part), "{error}");
    };
    let with = |parts: &Parts, elements: Range<u32>| {
        Draw::new("test/draw")
            .vertices(parts.corners, 0, corner())
            .vertices(parts.offsets, 0, offset())
            .elements(elements)
            .read("image", parts.image)
            .set("tint", Vec4::ZERO)
    };
    assert!(planned(|parts, _| with(parts, 0..8)).is_ok());
    mismatch(&|parts, _| with(parts, 0..9), "at least 180");
    mismatch(&|_, draw| draw.elements(0..37), "at least 74");
    mismatch(&|_, draw| draw.instances(0..5), "at least 80");
    mismatch(
        &|parts, _| {
            Draw::new("test/draw")
                .vertices(parts.corners, 0, corner())
                .read("image", parts.image)
                .set("tint", Vec4::ZERO)
        },
        "vertex input `offset`",
    );
    mismatch(
        &|parts, _| {
            let mut wrong = corner();
            wrong.attributes[0].format = VertexFormat::Uint32x2;
            Draw::new("test/draw")
                .vertices(parts.corners, 0, wrong)
                .vertices(parts.offsets, 0, offset())
                .read("image", parts.image)
                .set("tint", Vec4::ZERO)
        },
        "float numbers",
    );
    mismatch(&|parts, draw| draw.read("other", parts.image), "`other`");
    mismatch(&|_, draw| draw.set("other", 1.0_f32), "`other`");
    mismatch(
        &|_, draw| {
            draw.state(RasterState {
                targets: vec![
                    TargetState::default(),
                    TargetState {
                        blend: Some(Blend::ADD),
                        ..TargetState::default()
                    },
                ],
                ..RasterState::default()
            })
        },
        "r32uint with blending",
    );
    // A compute kernel draws nothing, a raster kernel is not dispatched.
    mismatch(&|_, _| Draw::new("test/write0"), "compute kernel");
    let mut graph = Graph::new();
    let target = graph.texture("target", R32);
    let written = graph.compute("test/depth").write("target", target);
    let written = written.per_texel("target").unwrap();
    graph.output("target", written).unwrap();
    assert!(
        plan(&graph)
            .unwrap_err()
            .to_string()
            .contains("raster kernel")
    );
}

#[test]
fn targets_are_held_against_each_other() {
    let mut graph = Graph::new();
    let parts = parts(&mut graph);
    let small = graph.texture("small", TextureDesc::d2(32, 48, Format::Rgba8Unorm));
    let volume = graph.texture("volume", TextureDesc::d3(4, 4, 4, Format::Rgba8Unorm));
    let snorm = graph.texture("snorm", TextureDesc::d2(64, 48, Format::Rgba8Snorm));
    let mut refused =
        |declare: &dyn Fn(crate::graph::RasterPass<'_>) -> Result<Written, GraphError>,
         part: &str| {
            let error = declare(graph.raster("refused")).unwrap_err();
            assert!(error.to_string().contains(part), "{error}");
        };
    refused(&|pass| pass.finish(), "no target");
    refused(
        &|pass| {
            pass.colour("a", parts.colour, CLEAR)
                .colour("b", small, CLEAR)
                .finish()
        },
        "32×48",
    );
    refused(
        &|pass| pass.colour("a", snorm, CLEAR).finish(),
        "renderable",
    );
    for depth in [f32::NAN, -0.5, 1.5] {
        let clear = Load::Clear(ClearValue::Float([depth; 4]));
        refused(
            &|pass| pass.depth(parts.depth, clear).finish(),
            "depth is from 0 to 1",
        );
    }
    refused(
        &|pass| pass.colour("a", volume, CLEAR).finish(),
        "targets are 2D",
    );
    refused(
        &|pass| pass.colour("a", parts.depth, CLEAR).finish(),
        "renderable",
    );
    refused(
        &|pass| pass.depth(parts.colour, CLEAR).finish(),
        "a depth format",
    );
    refused(
        &|pass| pass.colour("a", parts.id, CLEAR).finish(),
        "clears a r32uint",
    );
    refused(
        &|pass| pass.colour("a", parts.colour, Load::Keep).finish(),
        "nothing has written",
    );
    refused(
        &|pass| {
            (0..9)
                .fold(pass, |pass, k| {
                    pass.colour(format!("a{k}"), parts.colour, CLEAR)
                })
                .finish()
        },
        "9 colour targets",
    );
    refused(
        &|pass| {
            let whole = Viewport::of(65, 48);
            pass.colour("a", parts.colour, CLEAR)
                .viewport(whole)
                .finish()
        },
        "viewport",
    );
    let scissor = Scissor {
        x: 60,
        y: 0,
        width: 5,
        height: 1,
    };
    refused(
        &|pass| {
            pass.colour("a", parts.colour, CLEAR)
                .scissor(scissor)
                .finish()
        },
        "scissor",
    );
    let depth = || draw(&parts);
    refused(
        &|pass| {
            pass.colour("colour", parts.colour, CLEAR)
                .draw(depth())
                .finish()
        },
        "the pass has none",
    );
    refused(
        &|pass| {
            let draw = Draw::new("test/depth").vertices(parts.corners, 2, corner());
            pass.colour("a", parts.colour, CLEAR).draw(draw).finish()
        },
        "multiple of 4",
    );
    refused(
        &|pass| {
            let draw = Draw::new("test/draw").read("image", parts.colour);
            pass.colour("a", parts.colour, CLEAR).draw(draw).finish()
        },
        "nothing has written",
    );
    #[expect(clippy::reversed_empty_ranges, reason = "what is refused")]
    refused(
        &|pass| {
            let draw = Draw::new("test/depth").elements(5..2);
            pass.colour("a", parts.colour, CLEAR).draw(draw).finish()
        },
        "end before they begin",
    );
}
