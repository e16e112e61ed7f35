//! What geometry declares: which draws, in which order, with which kernels.

use crate::common;

use common::drawn::{drawn, geometry, item, plan, raster, view};
use etalon_core::Format;
use etalon_core::graph::{Graph, Texture};
use etalon_core::kernel::Arithmetic;
use etalon_core::raster::{CullMode, FrontFace};
use etalon_core::resource::{Compare, TextureDesc};
use etalon_effects::geometry::{DrawClass, Geometry, Item, Maps, gbuffer, prepass};
use etalon_effects::{DepthRange, EffectError};
use glam::{DMat4, DVec3, Vec4};

#[test]
fn the_weapon_is_drawn_first_and_what_moves_last() {
    let mut graph = Graph::new();
    let items = [
        item(&mut graph, "runner", DrawClass::Dynamic),
        item(&mut graph, "wall", DrawClass::Static),
        item(&mut graph, "gun", DrawClass::Weapon),
        item(&mut graph, "floor", DrawClass::Static),
    ];
    let pre = prepass(&mut graph, &geometry(&items), true).unwrap();
    let g = gbuffer(&mut graph, &geometry(&items), Some(&pre)).unwrap();
    graph.output("velocity", pre.velocity.unwrap()).unwrap();
    graph.output("normal", g.normal).unwrap();
    for arithmetic in [Arithmetic::Strict, Arithmetic::Fast] {
        let plan = plan(&graph, arithmetic);
        let order = [
            "gun vertices",
            "wall vertices",
            "floor vertices",
            "runner vertices",
        ];
        let step = |name: &str| {
            plan.steps
                .iter()
                .position(|step| step.name == name)
                .unwrap()
        };
        let (first, second) = (step("geometry/prepass"), step("geometry/gbuffer"));
        assert_eq!(drawn(&plan, first), order);
        assert_eq!(drawn(&plan, second), order);
        let depth = raster(&plan, second).draws[0].state.depth.unwrap();
        assert_eq!((depth.compare, depth.write), (Compare::Equal, false));
        // One kernel for what moves and one for what does not.
        let kernels = |step| {
            let mut ids: Vec<_> = raster(&plan, step)
                .draws
                .iter()
                .map(|d| d.kernel.0.id)
                .collect();
            ids.sort_unstable();
            ids.dedup();
            ids.len()
        };
        assert_eq!((kernels(first), kernels(second)), (2, 1));
    }
}

/// Every combination of maps, with and without a prepass, compiles and is bound.
#[test]
fn every_surface_has_its_kernels() {
    for bits in 0..16_u32 {
        let mut graph = Graph::new();
        let mut one = item(&mut graph, "one", DrawClass::Dynamic);
        let mut map = |bit: u32| -> Option<Texture> {
            let format = if bit.is_multiple_of(2) {
                Format::Rgba8UnormSrgb
            } else {
                Format::Rgba8Unorm
            };
            let desc = TextureDesc::d2(64, 64, format);
            (bits >> bit & 1 == 1)
                .then(|| graph.import_texture(&format!("map {bit}"), desc).unwrap())
        };
        one.surface.maps = Maps {
            base: map(0),
            surface: map(1),
            emission: map(2),
            normal: map(3),
        };
        one.surface.cutoff = 0.5;
        let items = [one];
        let pre = prepass(&mut graph, &geometry(&items), bits % 3 == 0).unwrap();
        let g = gbuffer(&mut graph, &geometry(&items), Some(&pre)).unwrap();
        graph.output("colour", g.colour).unwrap();
        if let Some(velocity) = pre.velocity {
            graph.output("velocity", velocity).unwrap();
        }
        for arithmetic in [Arithmetic::Strict, Arithmetic::Fast] {
            let plan = plan(&graph, arithmetic);
            let masked = raster(&plan, 0).draws[0].kernel.0.raster().unwrap().clone();
            let discards = masked.fragment.is_some_and(|fragment| fragment.discards);
            assert_eq!(discards, bits & 1 == 1, "maps {bits:b}");
        }
    }
}

#[test]
fn states_follow_from_the_camera_the_matrix_and_the_surface() {
    let mut graph = Graph::new();
    let mut mirrored = item(&mut graph, "mirrored", DrawClass::Static);
    mirrored.world = DMat4::from_scale(DVec3::new(-1.0, 1.0, 1.0));
    let mut pane = item(&mut graph, "pane", DrawClass::Static);
    pane.surface.two_sided = true;
    let mut hidden = item(&mut graph, "hidden", DrawClass::Static);
    hidden.surface.base = Vec4::new(1.0, 1.0, 1.0, 0.25);
    hidden.surface.cutoff = 0.5;
    let items = [mirrored, pane, hidden];
    let geometry = Geometry {
        view: view(DepthRange::Standard { far: 100.0 }),
        ..geometry(&items)
    };
    let g = gbuffer(&mut graph, &geometry, None).unwrap();
    graph.output("colour", g.colour).unwrap();
    let plan = plan(&graph, Arithmetic::Strict);
    let draws = &raster(&plan, 0).draws;
    // What is never opaque enough is not drawn.
    assert_eq!(draws.len(), 2);
    assert_eq!(draws[0].state.front, FrontFace::Clockwise);
    assert_eq!(draws[1].state.front, FrontFace::CounterClockwise);
    assert_eq!(
        (draws[0].state.cull, draws[1].state.cull),
        (CullMode::Back, CullMode::None)
    );
    let depth = draws[0].state.depth.unwrap();
    assert_eq!((depth.compare, depth.write), (Compare::Less, true));
}

#[test]
fn numbers_out_of_range_are_refused() {
    let mut graph = Graph::new();
    let fine = item(&mut graph, "one", DrawClass::Static);
    let changes: [fn(&mut Item); 5] = [
        |item| item.surface.roughness = f32::NAN,
        |item| item.surface.base.x = 1.5,
        |item| item.surface.emission.y = -1.0,
        |item| item.world.x_axis.x = f64::NAN,
        |item| item.previous.w_axis.x = f64::INFINITY,
    ];
    for change in changes {
        let mut items = [fine.clone()];
        change(&mut items[0]);
        let refused = prepass(&mut graph, &geometry(&items), false);
        assert!(matches!(refused, Err(EffectError::Setting(_))));
    }
    let items = [fine];
    for matrix in [
        DMat4::ZERO,
        DMat4::NAN,
        DMat4::from_scale(DVec3::splat(3.0)),
    ] {
        let mut bad = geometry(&items);
        bad.view.previous = matrix;
        let refused = gbuffer(&mut graph, &bad, None);
        assert!(matches!(refused, Err(EffectError::Setting(_))), "{matrix}");
    }
}
