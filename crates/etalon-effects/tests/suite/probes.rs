//! What probes refuse, what calls for them, and how far off a room's walls they are right.

use etalon_core::Format;
use etalon_core::graph::Graph;
use etalon_core::kernel::Arithmetic;
use etalon_core::plan::Plan;
use etalon_core::resource::TextureDesc;
use etalon_effects::demand::{Demands, Outputs};
use etalon_effects::environment::{Mirrored, Prefilter, Surroundings, of_faces};
use etalon_effects::frame::{Drawables, Request, Shading, of_geometry};
use etalon_effects::geometry::DrawClass;
use etalon_effects::knob::Tunable;
use etalon_effects::probes::capture::{Capture, Captured, capture};
use etalon_effects::probes::truth::{influence, projected, shares};
use etalon_effects::probes::{
    MAX_MAPS, MAX_PROBES, Probe, ProbeMaps, Probes, Room, probe_bytes, probe_map,
};
use etalon_effects::{ChainSettings, DepthRange, EffectError, SettingError};
use glam::{DQuat, DVec3, Vec3};

use crate::common::drawn::{item, plan, view};

fn probe() -> Probe {
    Probe {
        position: DVec3::new(0.5, 0.0, 0.0),
        room: Room {
            centre: DVec3::ZERO,
            turn: DQuat::IDENTITY,
            half: DVec3::new(2.0, 1.0, 3.0),
        },
        influence: DVec3::new(1.5, 1.0, 2.0),
        falloff: 0.5,
        layer: 0,
    }
}

#[test]
fn what_is_no_probe_is_refused() {
    let refused = |change: &dyn Fn(&mut Probe)| -> &'static str {
        let mut bad = probe();
        change(&mut bad);
        let view = view(DepthRange::ReversedInfinite);
        let SettingError { effect, field, .. } = probe_bytes(&view, &[bad]).unwrap_err();
        assert_eq!(effect, "probes");
        field
    };
    for number in [f64::NAN, f64::INFINITY, -1.0, 0.0, 2e6] {
        assert_eq!(refused(&|probe| probe.room.half.y = number), "half");
        assert_eq!(refused(&|probe| probe.influence.z = number), "influence");
        assert_eq!(refused(&|probe| probe.falloff = number as f32), "falloff");
    }
    assert_eq!(refused(&|probe| probe.room.centre.x = f64::NAN), "centre");
    assert_eq!(
        refused(&|probe| probe.room.turn = DQuat::from_xyzw(0.0, 0.0, 0.0, 2.0)),
        "turn"
    );
    assert_eq!(refused(&|probe| probe.room.turn.x = f64::NAN), "turn");
    assert_eq!(refused(&|probe| probe.position.x = 2.5), "position");
    assert_eq!(refused(&|probe| probe.position.y = f64::NAN), "position");
    assert_eq!(refused(&|probe| probe.layer = MAX_MAPS), "layer");
    // Narrower than it fades out.
    assert_eq!(refused(&|probe| probe.influence.x = 0.25), "influence");
    let view = view(DepthRange::ReversedInfinite);
    let all = [probe(); MAX_PROBES as usize + 1];
    assert_eq!(probe_bytes(&view, &all).unwrap_err().field, "probes");
    let bytes = probe_bytes(&view, &all[1..]).unwrap();
    assert_eq!(bytes.len(), 128 * MAX_PROBES as usize);
}

#[test]
fn what_are_no_maps_is_refused() {
    let mut graph = Graph::new();
    let field = |error: EffectError| match error {
        EffectError::Setting(SettingError { field, .. }) => field,
        other => panic!("{other}"),
    };
    for (side, count, wrong) in [
        (48, 1, "side"),
        (16, 1, "side"),
        (64, 0, "maps"),
        (64, 257, "maps"),
    ] {
        assert_eq!(
            field(ProbeMaps::new(&mut graph, side, count).unwrap_err()),
            wrong
        );
    }
    let maps = ProbeMaps::new(&mut graph, 64, 2).unwrap();
    let base = |graph: &mut Graph, name: &str, side: u32| {
        let desc = TextureDesc::d2(side + side / 2, side, Format::Rgba16Float);
        graph.import_texture(name, desc).unwrap()
    };
    let (good, small) = (base(&mut graph, "good", 64), base(&mut graph, "small", 32));
    let settings = Prefilter::default();
    let mut refused =
        |layer, base| field(probe_map(&mut graph, maps, layer, base, &settings).unwrap_err());
    assert_eq!(refused(2, good), "layer");
    assert_eq!(refused(0, small), "height");
    for count in [MAX_PROBES + 1, u32::MAX] {
        let error = Probes::import(&mut graph, "list", maps, count).unwrap_err();
        assert_eq!(field(error), "probes");
    }
    assert_eq!(Probes::import(&mut graph, "list", maps, 0).unwrap(), None);
    for (width, height, layers, wrong) in [
        (8, 4, 6, "face height"),
        (8, 8, 5, "faces"),
        (5000, 5000, 6, "face width"),
    ] {
        let mut desc = TextureDesc::d2(width, height, Format::Rgba16Float);
        desc.extent.depth_or_layers = layers;
        let faces = graph.texture("faces", desc);
        assert_eq!(field(of_faces(&mut graph, faces, 64).unwrap_err()), wrong);
    }
    let default = Capture::default();
    assert_eq!(default.validate(), Ok(()));
    for (bad, wrong) in [
        (Capture { face: 8, ..default }, "face"),
        (
            Capture {
                side: 96,
                ..default
            },
            "side",
        ),
        (
            Capture {
                samples: 65,
                ..default
            },
            "samples",
        ),
    ] {
        assert_eq!(bad.validate().unwrap_err().field, wrong);
    }
    assert_eq!(Capture::knobs().len(), 3);
}

#[test]
fn shares_are_smooth_and_sum_to_one() {
    let probes = [
        probe(),
        Probe {
            influence: DVec3::splat(1.0),
            falloff: 1.0,
            ..probe()
        },
    ];
    // Across the border of where both count.
    let at = |x: f64| shares(&probes, DVec3::new(x, 0.2, 0.3));
    let mut last = at(-3.0);
    let mut moved = 0.0_f64;
    for k in 0..=6000 {
        let (own, rest) = at(f64::from(k) * 1e-3 - 3.0);
        let sum = own.iter().sum::<f64>() + rest;
        assert!((sum - 1.0).abs() < 1e-12, "{sum}");
        assert!(own.iter().all(|share| (0.0..=1.0).contains(share)) && rest >= 0.0);
        for (a, b) in own.iter().zip(&last.0).chain([(&rest, &last.1)]) {
            moved = moved.max((a - b).abs());
        }
        last = (own, rest);
    }
    // A smooth step is at most 1.5 times as steep as its width says: here 0.5 and 1.
    assert!(moved <= 1e-3 * (1.5 / 0.5 + 1.5) * 1.001, "{moved}");
    assert_eq!(influence(&probe(), DVec3::ZERO), 1.0);
    assert_eq!(influence(&probe(), DVec3::new(1.5, 0.0, 0.0)), 0.0);
    assert_eq!(influence(&probe(), DVec3::new(1.25, 0.0, 0.0)), 0.5);
}

/// What is seen in a mirror at a wall is where it is seen from the point of capture; what
/// stands before the wall is off by its parallax. Off the wall by a share of the room the
/// error grows in proportion, and without projection it is larger by far at the wall.
#[test]
fn the_models_error_grows_with_the_depth_of_what_is_in_the_room() {
    let room = Room {
        centre: DVec3::ZERO,
        turn: DQuat::IDENTITY,
        half: DVec3::new(4.0, 1.5, 3.0),
    };
    let probe = Probe {
        position: DVec3::new(0.5, 0.0, -0.5),
        room,
        influence: room.half,
        falloff: 0.5,
        layer: 0,
    };
    // Mirrors on the floor, and panels at a distance before the wall at x = 4.
    let errors = |depth: f64| -> (f64, f64) {
        let (mut with, mut without, mut count) = (0.0, 0.0, 0.0);
        for (i, j) in (0..20).flat_map(|i| (0..20).map(move |j| (i, j))) {
            let mirror = DVec3::new(f64::from(i) * 0.1 - 1.0, -1.5, f64::from(j) * 0.2 - 2.0);
            for (y, z) in [
                (-1.0, -2.0),
                (-0.5, 1.0),
                (0.0, 0.0),
                (0.75, 2.0),
                (1.25, -1.0),
            ] {
                let panel = DVec3::new(4.0 - depth, y, z);
                let way = (panel - mirror).normalize();
                let want = (panel - probe.position).normalize();
                let angle = |got: DVec3| 2.0 * (0.5 * (got - want).length()).asin().to_degrees();
                with += angle(projected(&probe, mirror, way));
                without += angle(way);
                count += 1.0;
            }
        }
        (with / count, without / count)
    };
    let table: Vec<(f64, f64, f64)> = [0.0, 0.1, 0.25, 0.5, 1.0, 2.0]
        .into_iter()
        .map(|depth| {
            let (with, without) = errors(depth);
            println!("{depth} m off the wall: {with:.3}° with the room, {without:.3}° without");
            (depth, with, without)
        })
        .collect();
    assert!(table[0].1 < 1e-6);
    assert!(table.windows(2).all(|pair| pair[0].1 < pair[1].1));
    // Small depths: in proportion.
    let slope = table[1].1 / 0.1;
    assert!((table[2].1 / (0.25 * slope) - 1.0).abs() < 0.15);
    assert!(table.iter().all(|(_, with, without)| with < without));
    assert!(table[3].2 > 3.0 * table[3].1);
}

/// A frame among probes, whose maps are drawn from what it shows.
fn frame(request: &Request, mirrored: Mirrored, shading: Shading) -> (Graph, Plan) {
    let mut graph = Graph::new();
    let items = [item(&mut graph, "one", DrawClass::Static)];
    let around = Surroundings {
        above: Vec3::ONE,
        ..Surroundings::default()
    };
    let captured = Captured {
        items: &items,
        position: DVec3::ZERO,
        near: 0.1,
        lamps: [None; 6],
        surroundings: around,
    };
    let settings = Capture::default();
    let base = capture(&mut graph, &captured, &settings).unwrap();
    let maps = ProbeMaps::new(&mut graph, settings.side, 1).unwrap();
    let maps = probe_map(&mut graph, maps, 0, base, &settings.prefilter()).unwrap();
    let drawables = Drawables {
        opaque: &items,
        blended: &[],
        view: view(DepthRange::ReversedInfinite),
        size: [96, 64],
        lights: &[],
        lamps: None,
        surroundings: Surroundings {
            probes: Probes::import(&mut graph, "probes", maps, 1).unwrap(),
            mirrored,
            ..around
        },
        shading,
        delta_time: 0.0,
    };
    of_geometry(&mut graph, &drawables, request).unwrap();
    let plan = plan(&graph, Arithmetic::Strict);
    (graph, plan)
}

fn reason<'p>(plan: &'p Plan, name: &str) -> (bool, &'p str) {
    let effect = plan
        .effects
        .iter()
        .find(|effect| effect.name == name)
        .unwrap();
    let decision = &effect.decision;
    (decision.is_run(), decision.reason())
}

#[test]
fn probes_are_drawn_if_something_is_lit_by_them() {
    let drawn = |plan: &Plan| {
        let of = |name: &str| {
            plan.steps
                .iter()
                .filter(|step| step.name.starts_with(name))
                .count()
        };
        (of("environment/prefilter"), of("environment/faces"))
    };
    let surfaces = Demands::everything();
    let mut depth = Outputs::NONE;
    depth.depth = true;
    for shading in [Shading::Forward, Shading::Deferred] {
        let asked = |demands, outputs| Request {
            demands,
            outputs,
            ..Request::default()
        };
        let (_, plan) = frame(&asked(surfaces, Outputs::PICTURE), Mirrored::Lit, shading);
        assert_eq!(drawn(&plan), (1, 1), "{shading:?}");
        assert_eq!(reason(&plan, "probes"), (true, "1 light surfaces"));
        // Nobody asks for light.
        let (_, plan) = frame(&asked(surfaces, depth), Mirrored::Lit, shading);
        assert_eq!(drawn(&plan), (0, 0), "{shading:?}");
        assert_eq!(reason(&plan, "probes"), (false, "no surface is lit"));
    }
}

#[test]
fn what_mirrors_them_is_one_pass_or_the_other() {
    let has = |plan: &Plan, name: &str| plan.steps.iter().any(|step| step.name == name);
    let mut demands = Demands::everything();
    // Glass mirrors by itself.
    demands.transparent = None;
    let with = Request {
        demands,
        ..Request::default()
    };
    let without = Request {
        settings: ChainSettings {
            ssr: None,
            ..ChainSettings::full()
        },
        ..with
    };
    // The faces that are captured have a table of their own.
    let tables = |plan: &Plan| {
        let steps = plan.steps.iter();
        steps
            .filter(|step| step.name.starts_with("environment/mirroring"))
            .count()
    };
    let (_, lit) = frame(&with, Mirrored::Lit, Shading::Forward);
    let (_, reflected) = frame(&with, Mirrored::Reflected, Shading::Forward);
    let (_, alone) = frame(&without, Mirrored::Reflected, Shading::Forward);
    assert!(has(&lit, "ssr/march") && has(&reflected, "ssr/march"));
    assert_eq!(tables(&reflected) + 1, tables(&lit));
    assert_eq!(tables(&alone), tables(&lit));
    assert!(reason(&reflected, "ssr/fallback").0);
    assert!(!reason(&alone, "ssr/fallback").0);
}
