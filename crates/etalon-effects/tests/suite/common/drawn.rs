//! Things to be drawn, and plans of draws.

use etalon_core::graph::Graph;
use etalon_core::kernel::Arithmetic;
use etalon_core::plan::{Plan, PlanOptions, RasterStep, Step};
use etalon_core::raster::{IndexFormat, StepMode, VertexAttribute, VertexFormat, VertexLayout};
use etalon_core::resource::BufferDesc;
use etalon_effects::geometry::{DrawClass, Geometry, Item, Surface, View};
use etalon_effects::{CameraParams, DepthRange};
use glam::{DMat4, DVec3};

pub(crate) fn item(graph: &mut Graph, name: &str, class: DrawClass) -> Item {
    let mut buffer = |what: &str, bytes| {
        let name = format!("{name} {what}");
        graph.import_buffer(&name, BufferDesc { bytes }).unwrap()
    };
    let (vertices, indices) = (buffer("vertices", 48 * 8), buffer("indices", 4 * 36));
    let attribute = |name: &'static str, format, offset| VertexAttribute {
        name: name.into(),
        format,
        offset,
    };
    let layout = VertexLayout {
        stride: 48,
        step: StepMode::Vertex,
        attributes: vec![
            attribute("position", VertexFormat::Float32x3, 0),
            attribute("normal", VertexFormat::Float32x3, 12),
            attribute("tangent", VertexFormat::Float32x4, 24),
            attribute("uv", VertexFormat::Float32x2, 40),
        ],
    };
    Item {
        vertices: vec![(vertices, 0, layout)],
        indices: Some((indices, 0, IndexFormat::Uint32)),
        elements: 0..36,
        world: DMat4::IDENTITY,
        previous: DMat4::IDENTITY,
        class,
        surface: Surface::default(),
    }
}

pub(crate) fn view(depth: DepthRange) -> View {
    let camera = CameraParams {
        depth,
        ..CameraParams::perspective(1.0, 1.5, 0.1)
    };
    View {
        camera,
        view: DMat4::from_translation(DVec3::new(0.0, 0.0, -5.0)),
        previous: DMat4::IDENTITY,
    }
}

pub(crate) fn geometry(items: &[Item]) -> Geometry<'_> {
    Geometry {
        items,
        view: view(DepthRange::ReversedInfinite),
        size: [96, 64],
    }
}

pub(crate) fn plan(graph: &Graph, arithmetic: Arithmetic) -> Plan {
    let options = PlanOptions {
        arithmetic,
        ..PlanOptions::default()
    };
    Plan::new(graph, &etalon_effects::kernels(), &options).unwrap_or_else(|error| panic!("{error}"))
}

pub(crate) fn raster(plan: &Plan, step: usize) -> &RasterStep {
    match &plan.steps[step].step {
        Step::Raster(raster) => raster,
        other => panic!("{other:?}"),
    }
}

/// The name of the buffer that a step's draws read, in order.
pub(crate) fn drawn(plan: &Plan, step: usize) -> Vec<&str> {
    let draws = raster(plan, step).draws.iter();
    draws
        .map(|draw| {
            plan.resources[draw.vertices[0].buffer as usize]
                .name
                .as_str()
        })
        .collect()
}
