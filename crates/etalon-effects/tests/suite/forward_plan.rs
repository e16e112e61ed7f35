//! What forward shading declares: which draws, in which order, with which kernels.

use crate::common;

use common::drawn::{drawn, geometry, item, plan, raster, view};
use etalon_core::Format;
use etalon_core::graph::{Graph, Texture};
use etalon_core::kernel::Arithmetic;
use etalon_core::plan::Plan;
use etalon_core::raster::{Blend, CullMode};
use etalon_core::resource::{Compare, TextureDesc};
use etalon_effects::environment::{
    Environment, EnvironmentMap, Irradiance, Prefilter, Surroundings, environment,
};
use etalon_effects::forward::{Lamps, Lighting, MAX_LAMPS, forward, glass, lamp_bytes};
use etalon_effects::geometry::{DrawClass, Maps, prepass};
use etalon_effects::lighting::{LightKind, PunctualLight};
use etalon_effects::{DepthRange, EffectError};
use glam::{DVec3, Vec3};

fn step(plan: &Plan, name: &str) -> usize {
    let mut steps = plan.steps.iter();
    steps.position(|step| step.name == name).unwrap()
}

fn lamp() -> PunctualLight {
    PunctualLight {
        kind: LightKind::Point,
        position: DVec3::new(1.0, 2.0, 3.0),
        direction: DVec3::NEG_Y,
        power: Vec3::ONE,
        reach: Some(8.0),
    }
}

fn surroundings(graph: &mut Graph) -> Surroundings {
    let desc = TextureDesc::d2(48, 32, Format::Rgba16Float);
    let base = graph.import_texture("base", desc).unwrap();
    let irradiance = Irradiance::of_gradient(DVec3::ONE, DVec3::ZERO);
    let around = environment(graph, base, &irradiance, &Prefilter::default()).unwrap();
    Surroundings {
        above: Vec3::ONE,
        environment: Some(around),
        ..Surroundings::default()
    }
}

/// Every combination of maps and of what lights, opaque and blended, compiles and
/// is bound.
#[test]
fn every_surface_has_its_kernels() {
    for bits in 0..64_u32 {
        let mut graph = Graph::new();
        let mut one = item(&mut graph, "one", DrawClass::Static);
        let mut map = |bit: u32| -> Option<Texture> {
            let desc = TextureDesc::d2(64, 64, Format::Rgba8Unorm);
            (bits >> bit & 1 == 1)
                .then(|| graph.import_texture(&format!("map {bit}"), desc).unwrap())
        };
        one.surface.maps = Maps {
            base: map(0),
            surface: map(1),
            emission: map(2),
            normal: map(3),
        };
        let items = [one];
        let lighting = Lighting {
            lamps: Lamps::import(&mut graph, "lamps", bits >> 4 & 1).unwrap(),
            surroundings: match (bits >> 5 & 1, bits & 1) {
                (0, _) => Surroundings::default(),
                (_, 0) => Surroundings {
                    below: Vec3::ONE,
                    ..Surroundings::default()
                },
                _ => surroundings(&mut graph),
            },
        };
        let geometry = geometry(&items);
        let pre = (bits % 3 == 0).then(|| prepass(&mut graph, &geometry, false).unwrap());
        let thin = bits % 5 < 2;
        let shaded = forward(&mut graph, &geometry, pre.as_ref(), &lighting, thin).unwrap();
        assert_eq!(shaded.thin.is_some(), thin);
        let (light, depth) = (shaded.light, shaded.depth);
        let light = glass(&mut graph, &geometry, light, depth, &lighting).unwrap();
        graph.output("light", light).unwrap();
        if let Some(thin) = shaded.thin {
            graph.output("normal", thin.normal).unwrap();
            graph.output("specular", thin.specular).unwrap();
        }
        for arithmetic in [Arithmetic::Strict, Arithmetic::Fast] {
            let plan = plan(&graph, arithmetic);
            let opaque = raster(&plan, step(&plan, "forward/opaque"));
            let depth = opaque.draws[0].state.depth.unwrap();
            let want = match pre {
                Some(_) => (Compare::Equal, false),
                None => (Compare::Greater, true),
            };
            assert_eq!((depth.compare, depth.write), want);
        }
    }
}

#[test]
fn opaque_items_go_by_class_and_glass_in_the_order_given() {
    let mut graph = Graph::new();
    let mut pane = item(&mut graph, "pane", DrawClass::Dynamic);
    pane.surface.two_sided = true;
    let items = [
        pane,
        item(&mut graph, "ball", DrawClass::Static),
        item(&mut graph, "visor", DrawClass::Weapon),
    ];
    let geometry = geometry(&items);
    let lighting = Lighting {
        lamps: Lamps::import(&mut graph, "lamps", 3).unwrap(),
        ..Lighting::default()
    };
    let shaded = forward(&mut graph, &geometry, None, &lighting, false).unwrap();
    let (light, depth) = (shaded.light, shaded.depth);
    let light = glass(&mut graph, &geometry, light, depth, &lighting).unwrap();
    graph.output("light", light).unwrap();
    let plan = plan(&graph, Arithmetic::Strict);
    let opaque = step(&plan, "forward/opaque");
    let order = ["visor vertices", "ball vertices", "pane vertices"];
    assert_eq!(drawn(&plan, opaque), order);
    let over = step(&plan, "forward/glass");
    let order = [
        "pane vertices",
        "pane vertices",
        "ball vertices",
        "visor vertices",
    ];
    assert_eq!(drawn(&plan, over), order);
    let states: Vec<_> = raster(&plan, over).draws.iter().map(|d| &d.state).collect();
    let culled: Vec<_> = states.iter().map(|state| state.cull).collect();
    // What is behind in a thing of two sides comes first.
    let (front, back) = (CullMode::Front, CullMode::Back);
    assert_eq!(culled, [front, back, back, back]);
    for state in states {
        let depth = state.depth.unwrap();
        assert_eq!((depth.compare, depth.write), (Compare::Greater, false));
        assert_eq!(state.targets[0].blend, Some(Blend::OVER));
    }
}

/// One table serves all passes that are given it.
#[test]
fn the_table_of_mirroring_is_made_once_for_all() {
    for shared in [false, true] {
        let mut graph = Graph::new();
        let items = [item(&mut graph, "one", DrawClass::Static)];
        let geometry = geometry(&items);
        let mut lighting = Lighting::default();
        lighting.surroundings.above = Vec3::ONE;
        if shared {
            let table = etalon_effects::environment::mirroring(&mut graph).unwrap();
            lighting.surroundings.mirroring = Some(table);
        }
        let shaded = forward(&mut graph, &geometry, None, &lighting, false).unwrap();
        let (light, depth) = (shaded.light, shaded.depth);
        let light = glass(&mut graph, &geometry, light, depth, &lighting).unwrap();
        graph.output("light", light).unwrap();
        let plan = plan(&graph, Arithmetic::Strict);
        let tables = plan.steps.iter();
        let tables = tables
            .filter(|step| step.name.contains("mirroring"))
            .count();
        assert_eq!(tables, if shared { 1 } else { 2 });
    }
}

#[test]
fn lamps_are_packed_in_the_space_of_the_view() {
    let view = view(DepthRange::ReversedInfinite);
    let sun = PunctualLight {
        kind: LightKind::Directional,
        direction: DVec3::new(0.0, -2.0, 0.0),
        reach: None,
        ..lamp()
    };
    let bytes = lamp_bytes(&view, &[lamp(), sun]).unwrap();
    let numbers: Vec<f32> = bytes
        .chunks_exact(4)
        .map(|four| f32::from_le_bytes(four.try_into().unwrap()))
        .collect();
    // The view is five behind the origin.
    assert_eq!(numbers[..4], [1.0, 2.0, -2.0, 8.0]);
    assert_eq!(numbers[4..8], [0.0, -1.0, 0.0, 0.0]);
    // A point's cone has all directions within: 1 - cosine is at most 2.
    assert_eq!(numbers[8..11], [1.0; 3]);
    let [scale, edge] = [numbers[11], numbers[12]];
    assert!((edge - 2.0) * scale >= 1.0, "{edge} · {scale}");
    assert_eq!(numbers[20..24], [0.0, -1.0, 0.0, 1.0]);
    assert_eq!(numbers[19], 0.0);
    assert_eq!(numbers.len(), 32);
}

#[test]
fn numbers_out_of_range_are_refused() {
    let refused = |result: Result<(), EffectError>| {
        assert!(matches!(result, Err(EffectError::Setting(_))), "{result:?}");
    };
    let mut graph = Graph::new();
    let view = view(DepthRange::ReversedInfinite);
    let mut bad = lamp();
    bad.power.x = f32::NAN;
    refused(lamp_bytes(&view, &[bad]).map(drop).map_err(Into::into));
    let many = vec![lamp(); MAX_LAMPS as usize + 1];
    refused(lamp_bytes(&view, &many).map(drop).map_err(Into::into));
    refused(Lamps::import(&mut graph, "lamps", MAX_LAMPS + 1).map(drop));
    assert_eq!(Lamps::import(&mut graph, "lamps", 0).unwrap(), None);

    let mut items = [item(&mut graph, "one", DrawClass::Static)];
    let fine = surroundings(&mut graph);
    let mut harmonics = Irradiance::default();
    harmonics.harmonics[4].y = f64::INFINITY;
    let changes: [fn(&mut Surroundings, Environment); 3] = [
        |around, _| around.above.x = -1.0,
        |around, _| around.background.y = f32::NAN,
        |around, bad| around.environment = Some(bad),
    ];
    let bad = Environment {
        irradiance: harmonics,
        ..fine.environment.unwrap()
    };
    for change in changes {
        let mut lighting = Lighting {
            surroundings: fine,
            ..Lighting::default()
        };
        change(&mut lighting.surroundings, bad);
        let light = graph.texture("light", TextureDesc::d2(96, 64, Format::Rgba16Float));
        let depth = graph.texture("depth", TextureDesc::d2(96, 64, Format::Depth32Float));
        let geometry = geometry(&items);
        refused(forward(&mut graph, &geometry, None, &lighting, false).map(drop));
        refused(glass(&mut graph, &geometry, light, depth, &lighting).map(drop));
    }
    items[0].surface.roughness = 2.0;
    let lighting = Lighting::default();
    refused(forward(&mut graph, &geometry(&items), None, &lighting, true).map(drop));

    for samples in [0, 8, 48, 2048] {
        let settings = Prefilter { samples };
        assert!(settings.validate().is_err(), "{samples}");
    }
    let irradiance = Irradiance::default();
    for (name, width, height) in [("a", 72, 48), ("b", 64, 64), ("c", 24, 16)] {
        let desc = TextureDesc::d2(width, height, Format::Rgba16Float);
        let base = graph.import_texture(name, desc).unwrap();
        let settings = Prefilter::default();
        refused(environment(&mut graph, base, &irradiance, &settings).map(drop));
    }
    let picture = common::image(Format::Rgba32Float, 8, 4, |_, _| [1.0; 4]);
    for side in [0, 16, 100, 4096] {
        refused(EnvironmentMap::of_equirectangular(&picture, side).map(drop));
    }
}
