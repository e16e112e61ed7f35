//! What is on the screen, and what that calls for.

use etalon_core::Format;
use etalon_core::graph::{Decision, Graph};
use etalon_core::kernel::{Arithmetic, KernelLibrary};
use etalon_core::plan::{Plan, PlanOptions};
use etalon_core::resource::TextureDesc;
use etalon_effects::bloom::Bloom;
use etalon_effects::composite::Composite;
use etalon_effects::demand::{Bright, Demands, Moving, Outputs, Reflective, Region, Thresholds};
use etalon_effects::exposure::Exposure;
use etalon_effects::frame::{Request, of_images};
use etalon_effects::ssr::{Blend, Ssr};
use etalon_effects::tiles::Tiling;
use etalon_effects::tiles::crossover::Cost;
use etalon_effects::{
    CameraParams, ChainSettings, EffectError, Quality, SceneInputs, SettingError, chain, effects,
};

use crate::common::hash;

const REFLECTIVE: Reflective = Reflective {
    region: Region::FULL,
    roughness: [0.25, 0.5],
    specular: 0.5,
    nearest: 8.0,
};

fn inputs(graph: &mut Graph, width: u32, height: u32) -> SceneInputs {
    let mut import = |name: &str, format| {
        graph
            .import_texture(name, TextureDesc::d2(width, height, format))
            .expect("every name is used once")
    };
    SceneInputs {
        colour: import("colour", Format::Rgba16Float),
        depth: import("depth", Format::R32Float),
        normal: import("normal", Format::Rgba16Float),
        specular: import("specular", Format::Rgba8Unorm),
        velocity: Some(import("velocity", Format::Rg16Float)),
        camera: CameraParams::perspective(1.0, 1.5, 0.1),
        delta_time: 1.0 / 60.0,
        beyond: None,
    }
}

fn plan(graph: &Graph, kernels: &KernelLibrary) -> Plan {
    let options = PlanOptions {
        arithmetic: Arithmetic::Strict,
        ..PlanOptions::default()
    };
    Plan::new(graph, kernels, &options).expect("a plan")
}

fn decided(request: &Request, effect: &str) -> Decision {
    let decisions = request.decisions();
    let found = decisions.into_iter().find(|(name, _)| *name == effect);
    found.expect("registered").1
}

/// Light of one brightness everywhere.
fn light(peak: f32) -> Bright {
    Bright {
        peak,
        floor: peak,
        region: Region::FULL,
    }
}

/// Exposed by nothing but a factor.
fn fixed(factor: f32) -> ChainSettings {
    ChainSettings {
        exposure: None,
        composite: Composite {
            exposure: factor,
            ..Composite::default()
        },
        ..ChainSettings::full()
    }
}

#[test]
fn reflections_run_only_where_something_mirrors_that_is_smooth_enough() {
    let mut request = Request::default();
    request.demands.reflective = None;
    assert_eq!(
        decided(&request, "ssr"),
        Decision::absent("no surface on screen mirrors")
    );
    request.demands.reflective = Some(REFLECTIVE);
    assert!(decided(&request, "ssr").is_run());
    request.thresholds.max_roughness = 0.2;
    assert_eq!(
        decided(&request, "ssr").reason(),
        "no mirroring surface smoother than 0.2 on screen; the smoothest has 0.25"
    );
    request.thresholds = Thresholds {
        min_specular: 0.5,
        ..Thresholds::default()
    };
    assert_eq!(
        decided(&request, "ssr").reason(),
        "no surface on screen mirrors more than 0.5 of a colour; the most is 0.5"
    );
    request.thresholds = Thresholds::default();
    request.outputs = Outputs::NONE;
    request.outputs.velocity = true;
    assert_eq!(
        decided(&request, "ssr").reason(),
        "the light is not asked for"
    );
    request.outputs.light = true;
    assert!(decided(&request, "ssr").is_run());
    request.settings.ssr = None;
    assert_eq!(
        decided(&request, "ssr").reason(),
        "the settings have it off"
    );
}

/// One rate where nothing calls for two, and a quarter of it where reflections are faint
/// or distant.
#[test]
fn rays_are_as_many_as_surfaces_call_for() {
    let kernels = etalon_effects::kernels();
    let told_of = |asked: f32, roughness: [f32; 2], thresholds: Thresholds| {
        let mut request = Request::default();
        request.demands.reflective = Some(Reflective {
            roughness,
            ..REFLECTIVE
        });
        request.thresholds = thresholds;
        request.settings.ssr = Some(Ssr {
            quarter_from: asked,
            ..Ssr::default()
        });
        let mut graph = Graph::new();
        let images = inputs(&mut graph, 64, 48);
        of_images(&mut graph, &images, &request).expect("valid");
        let plan = plan(&graph, &kernels);
        let effects = plan.effects.iter();
        let reason = effects
            .filter(|effect| effect.name == "ssr/quarter")
            .map(|effect| effect.decision.reason().to_owned())
            .next();
        let rate = request.called_for().ssr.map(|ssr| ssr.quarter_from);
        (rate.expect("on"), reason.unwrap_or_default())
    };
    let told = |asked: f32, roughness: [f32; 2], faint_specular: f32| {
        let thresholds = Thresholds {
            faint_specular,
            ..Thresholds::default()
        };
        told_of(asked, roughness, thresholds)
    };
    let none = Ssr::NO_QUARTER;
    assert_eq!(told(0.5, [0.25, 0.75], 0.0), (0.5, String::new()));
    assert_eq!(told(none, [0.25, 0.75], 0.0), (none, String::new()));
    assert_eq!(told(0.0, [0.25, 0.75], 0.0), (0.0, String::new()));
    let (rate, reason) = told(0.5, [0.75, 1.0], 0.0);
    assert_eq!(rate, 0.0);
    assert_eq!(
        reason,
        "nothing that mirrors is smoother than 0.75: one texel in four is marched"
    );
    let (rate, reason) = told(0.5, [0.0, 0.25], 0.0);
    assert_eq!(rate, none);
    assert_eq!(
        reason,
        "nothing that mirrors is rougher than 0.25: every texel is marched"
    );
    // Half of a step of an 8-bit map from the limit nothing is said.
    assert_eq!(told(0.5, [0.501, 1.0], 0.0).0, 0.5);
    assert_eq!(told(0.5, [0.0, 0.499], 0.0).0, 0.5);
    // Half of a colour is mirrored.
    assert_eq!(told(none, [0.25, 0.75], 0.49).0, none);
    let (rate, reason) = told(none, [0.25, 0.75], 0.5);
    assert_eq!(rate, 0.0);
    assert_eq!(
        reason,
        "no surface mirrors more than 0.5 of a colour: one texel in four is marched"
    );
    // The nearest is at 8.
    let beyond = |distant| Thresholds {
        distant,
        ..Thresholds::default()
    };
    assert_eq!(told_of(none, [0.25, 0.75], beyond(8.5)).0, none);
    let (rate, reason) = told_of(none, [0.25, 0.75], beyond(8.0));
    assert_eq!(rate, 0.0);
    assert_eq!(
        reason,
        "no surface that mirrors is nearer than 8: one texel in four is marched"
    );
}

#[test]
fn tiles_are_off_where_so_much_mirrors_that_they_are_not_worth_it() {
    let tiles = |lower: [f32; 2], cost: Option<Cost>| {
        let mut request = Request::default();
        request.demands.reflective = Some(Reflective {
            region: Region::new([0.0, 0.0], lower).expect("a region"),
            ..REFLECTIVE
        });
        request.thresholds.tiles = cost;
        request.called_for().ssr.map(|ssr| ssr.tiles)
    };
    // They are worth it up to three quarters of the screen.
    let cost = Cost {
        idle: 0.25,
        slope: 1.0,
        whole: 1.0,
    };
    let usual = Some(Ssr::default().tiles);
    assert_eq!(tiles([1.0, 0.7], Some(cost)), usual);
    assert_eq!(tiles([1.0, 0.8], Some(cost)), Some(Tiling::Off));
    // Of bounds that may be loose nothing follows.
    assert_eq!(tiles([1.0, 1.0], None), usual);
}

/// With a knee of a half and a threshold of 1 bloom begins at 0.5.
#[test]
fn bloom_runs_only_where_exposed_light_can_pass_its_threshold() {
    let mut request = Request {
        settings: fixed(1.0),
        ..Request::default()
    };
    request.demands.reflective = None;
    let mut runs = |peak: f32, factor: f32, change: &dyn Fn(&mut Request)| {
        request.settings.composite.exposure = factor;
        request.demands.bright = Some(light(peak));
        let mut changed = request;
        change(&mut changed);
        decided(&changed, "bloom").is_run()
    };
    let as_it_is = |_: &mut Request| ();
    assert!(!runs(0.49, 1.0, &as_it_is));
    assert!(runs(0.51, 1.0, &as_it_is));
    assert!(runs(0.26, 2.0, &as_it_is) && !runs(0.24, 2.0, &as_it_is));
    // A mirror adds up to half of the brightest light to itself.
    let mirror = |request: &mut Request| request.demands.reflective = Some(REFLECTIVE);
    assert!(runs(0.4, 1.0, &mirror) && !runs(0.32, 1.0, &mirror));
    let replacing = |request: &mut Request| {
        request.demands.reflective = Some(REFLECTIVE);
        request.settings.ssr = Some(Ssr {
            blend: Blend::Replace,
            ..Ssr::default()
        });
    };
    assert!(!runs(0.4, 1.0, &replacing));
    // What is adapted to can be as dark as 0.001, which is brought to 0.18.
    let adapted = |request: &mut Request| request.settings.exposure = Some(Exposure::default());
    assert!(runs(0.003, 1.0, &adapted) && !runs(0.0027, 1.0, &adapted));
    let silent = |request: &mut Request| {
        request.settings.bloom = Some(Bloom {
            intensity: 0.0,
            ..Bloom::default()
        });
    };
    assert!(!runs(100.0, 1.0, &silent));
    request.demands.bright = None;
    assert_eq!(
        decided(&request, "bloom").reason(),
        "there is no light on screen"
    );
}

fn everything_but(change: impl FnOnce(&mut Demands)) -> Demands {
    let mut demands = Demands::everything();
    change(&mut demands);
    demands
}

/// What is decided is what is planned: with each demand taken away the plan is that of
/// the chain with the effect off, in every step, byte and kernel.
#[test]
fn an_absent_effect_is_not_in_the_plan() {
    let full = ChainSettings::full();
    for (without, settings) in [
        (
            everything_but(|demands| demands.reflective = None),
            ChainSettings { ssr: None, ..full },
        ),
        (
            everything_but(|demands| demands.bright = None),
            ChainSettings {
                bloom: None,
                ..full
            },
        ),
        (
            Demands::default(),
            ChainSettings {
                ssr: None,
                bloom: None,
                ..full
            },
        ),
        (Demands::everything(), full),
    ] {
        let (kernels, reference_kernels) = (etalon_effects::kernels(), etalon_effects::kernels());
        let mut graph = Graph::new();
        let images = inputs(&mut graph, 64, 48);
        let request = Request {
            demands: without,
            ..Request::default()
        };
        of_images(&mut graph, &images, &request).expect("valid");
        let mut reference = Graph::new();
        let images = inputs(&mut reference, 64, 48);
        let result = chain(&mut reference, &images, &settings).expect("valid");
        reference.output("picture", result.picture).expect("once");
        let (planned, reference) = (plan(&graph, &kernels), plan(&reference, &reference_kernels));
        assert_eq!(planned.steps, reference.steps);
        assert_eq!(planned.resources, reference.resources);
        assert_eq!(planned.uniforms, reference.uniforms);
        assert_eq!(planned.structure(), reference.structure());
        assert_eq!(planned.counters(), reference.counters());
        assert_eq!(kernels.stats(), reference_kernels.stats());
        assert!(planned.culled.is_empty(), "{:?}", planned.culled);
        // And the plan tells why.
        for (name, decision) in request.decisions() {
            let told = planned.effects.iter().find(|effect| effect.name == name);
            let told = told.expect("every decision is told");
            assert_eq!(told.decision, decision);
            assert_eq!(told.passes > 0, decision.is_run(), "{name}");
        }
    }
}

#[test]
fn mirrors_that_are_perfectly_smooth_are_not_blurred() {
    let kernels = etalon_effects::kernels();
    let names = |roughest: f32| {
        let mut graph = Graph::new();
        let images = inputs(&mut graph, 64, 48);
        let mut request = Request::default();
        request.demands.reflective = Some(Reflective {
            roughness: [0.0, roughest],
            ..REFLECTIVE
        });
        of_images(&mut graph, &images, &request).expect("valid");
        let plan = plan(&graph, &kernels);
        let blurs = plan.steps.iter().filter(|step| step.name.contains("blur"));
        (blurs.count(), plan.to_string().contains("perfectly smooth"))
    };
    assert_eq!(names(0.0), (0, true));
    assert_eq!(names(0.01), (2, false));
}

#[test]
fn only_what_is_asked_for_is_output() {
    let kernels = etalon_effects::kernels();
    let mut graph = Graph::new();
    let images = inputs(&mut graph, 64, 48);
    let mut outputs = Outputs::NONE;
    (outputs.light, outputs.velocity) = (true, true);
    let request = Request {
        outputs,
        ..Request::default()
    };
    let frame = of_images(&mut graph, &images, &request).expect("valid");
    assert!(frame.picture.is_none() && frame.light.is_some());
    assert_eq!((frame.depth, frame.velocity), (None, images.velocity));
    let plan = plan(&graph, &kernels);
    // Reflections, and the lists of tiles that they run on.
    let parts = ["ssr", "tiles"];
    assert!(
        plan.steps
            .iter()
            .all(|step| parts.contains(&step.effect.as_str()))
    );
    assert!(plan.output("light").is_some() && plan.output("picture").is_none());
}

#[test]
fn every_effect_can_be_decided_of() {
    let request = Request::default();
    for name in ["ssr", "exposure", "bloom", "composite"] {
        assert!(decided(&request, name).is_run(), "{name}");
        assert!(effects().iter().any(|effect| effect.name == name));
    }
    let nothing = Request {
        outputs: Outputs::NONE,
        ..request
    };
    for (name, decision) in nothing.decisions() {
        assert!(
            !decision.is_run() && !decision.reason().is_empty(),
            "{name}"
        );
    }
}

#[test]
fn demands_that_are_no_numbers_are_refused() {
    let refused = |change: &dyn Fn(&mut Request)| {
        let mut request = Request::default();
        change(&mut request);
        let mut graph = Graph::new();
        let images = inputs(&mut graph, 64, 48);
        match of_images(&mut graph, &images, &request) {
            Err(EffectError::Setting(SettingError { field, .. })) => field,
            other => panic!("{other:?}"),
        }
    };
    let reflective = |roughness, specular| Reflective {
        roughness,
        specular,
        ..REFLECTIVE
    };
    for (mirror, field) in [
        (
            reflective([f32::NAN, 1.0], 0.5),
            "roughness of the smoothest",
        ),
        (reflective([0.5, 0.2], 0.5), "roughness of the roughest"),
        (reflective([0.0, 1.0], 1.5), "specular"),
        (
            Reflective {
                nearest: -1.0,
                ..REFLECTIVE
            },
            "nearest",
        ),
    ] {
        assert_eq!(
            refused(&|request| request.demands.reflective = Some(mirror)),
            field
        );
    }
    for (peak, floor, field) in [
        (f32::INFINITY, 0.0, "peak"),
        (f32::NAN, 0.0, "peak"),
        (1.0, 2.0, "floor"),
    ] {
        let bright = Bright {
            peak,
            floor,
            region: Region::FULL,
        };
        assert_eq!(
            refused(&|request| request.demands.bright = Some(bright)),
            field
        );
    }
    assert_eq!(
        refused(&|request| request.thresholds.max_roughness = f32::NAN),
        "max_roughness"
    );
    assert_eq!(
        refused(&|request| request.thresholds.faint_specular = 1.5),
        "faint_specular"
    );
    assert_eq!(
        refused(&|request| request.thresholds.distant = f32::NAN),
        "distant"
    );
    assert_eq!(
        refused(&|request| request.thresholds.min_specular = -1.0),
        "min_specular"
    );
}

#[test]
fn demands_add_up() {
    let left = Region::new([0.0, 0.0], [0.25, 1.0]).expect("not empty");
    let right = Region::new([0.75, 0.5], [1.0, 1.0]).expect("not empty");
    let one = Demands::default()
        .with_surfaces(left)
        .with_reflective(Reflective {
            region: left,
            ..REFLECTIVE
        })
        .with_bright(light(2.0))
        .with_moving(Moving {
            camera: false,
            objects: Some(left),
        });
    let other = Demands::default()
        .with_transparent(right)
        .with_reflective(Reflective {
            region: right,
            roughness: [0.1, 0.3],
            specular: 0.7,
            nearest: 3.0,
        })
        .with_bright(Bright {
            peak: 9.0,
            floor: 1.0,
            region: right,
        })
        .with_moving(Moving::default());
    assert_eq!(other.moving, None, "what does not move is no motion");
    let both = one.union(other);
    assert_eq!(both, other.union(one));
    let mirror = both.reflective.expect("both have it");
    assert_eq!(mirror.region, left.union(right));
    assert_eq!((mirror.roughness, mirror.specular), ([0.1, 0.5], 0.7));
    assert_eq!(mirror.nearest, 3.0);
    let bright = both.bright.expect("both have it");
    assert_eq!((bright.peak, bright.floor), (9.0, 2.0));
    assert_eq!((both.surfaces, both.transparent), (Some(left), Some(right)));
    assert_eq!(both.moving.and_then(|moving| moving.region()), Some(left));
    let everything = Demands::everything();
    assert_eq!(both.union(everything), everything);
    assert_eq!(Demands::default().union(both), both);
}

/// Against every texel: a region of texels has them, and its texels hold it.
#[test]
fn regions_hold_the_texels_they_were_made_of() {
    for number in 0..2000_u32 {
        let random = |salt: u32, below: u32| hash(number * 16 + salt) % below.max(1);
        let size = [1 + random(0, 4100), 1 + random(1, 2200)];
        let min = [random(2, size[0]), random(3, size[1])];
        let max = [0, 1].map(|axis| {
            let more = random(4 + axis as u32, size[axis] - min[axis]);
            min[axis] + 1 + more
        });
        let region = Region::of_texels(min, max, size).expect("not empty");
        let [first, end] = region.texels(size);
        for axis in 0..2 {
            assert!(first[axis] <= min[axis] && max[axis] <= end[axis]);
            // And no more than a border of one.
            assert!(min[axis] - first[axis] <= 1 && end[axis] - max[axis] <= 1);
        }
        let share = f64::from(max[0] - min[0]) * f64::from(max[1] - min[1])
            / (f64::from(size[0]) * f64::from(size[1]));
        assert!(f64::from(region.coverage()) >= share * (1.0 - 1e-6));
    }
    assert_eq!(Region::of_texels([3, 3], [3, 9], [10, 10]), None);
}

#[test]
fn regions_are_cut_at_the_screen() {
    assert_eq!(Region::new([-3.0, -1.0], [9.0, 2.0]), Some(Region::FULL));
    assert_eq!(Region::new([0.5, 0.5], [0.5, 0.9]), None);
    assert_eq!(Region::new([1.0, 0.0], [2.0, 1.0]), None);
    // What is nowhere could be anywhere.
    assert_eq!(
        Region::new([f32::NAN; 2], [f32::NAN; 2]),
        Some(Region::FULL)
    );
    let small = Region::new([0.0, 0.0], [0.01, 0.5]).expect("not empty");
    assert_eq!(small.to_string(), "at most 0.50 % of the screen");
    assert_eq!(Region::FULL.to_string(), "all of the screen");
    let grown = small.grown(2.0, [100, 4]);
    assert_eq!(grown.texels([100, 4]), [[0, 0], [3, 4]]);
}

/// What the transients of every shipped chain take, against the largest set of them
/// that is alive at once.
#[test]
fn transient_memory_is_within_a_tenth_of_the_least() {
    let kernels = etalon_effects::kernels();
    let mut all: Vec<(String, ChainSettings)> = Quality::ALL
        .map(|quality| (quality.to_string(), ChainSettings::preset(quality)))
        .to_vec();
    all.push(("full".into(), ChainSettings::full()));
    let full = ChainSettings::full();
    all.push(("without ssr".into(), ChainSettings { ssr: None, ..full }));
    let without = ChainSettings {
        bloom: None,
        ..full
    };
    all.push(("without bloom".into(), without));
    let sizes = [
        (1, 1),
        (16, 9),
        (70, 30),
        (640, 360),
        (1001, 777),
        (1920, 1080),
        (4096, 1),
    ];
    let mut worst = 0.0_f64;
    let mut check = |what: &str, (width, height): (u32, u32), graph: &Graph| {
        let memory = plan(graph, &kernels).transient_memory();
        worst = worst.max(memory.excess());
        assert!(memory.least <= memory.planned && memory.planned <= memory.unaliased);
        // Of a few kilobytes the alignment, and a heap of its own for lists of tiles, are a
        // large part.
        assert!(
            memory.excess() <= 0.1 || memory.planned < 1 << 14,
            "{what} at {width}×{height}: {memory:?}"
        );
    };
    for size in sizes {
        for (name, settings) in &all {
            let mut graph = Graph::new();
            let images = inputs(&mut graph, size.0, size.1);
            let result = chain(&mut graph, &images, settings).expect("valid");
            graph.output("picture", result.picture).expect("once");
            check(name, size, &graph);
            // With what comes before kept as well.
            graph.output("light", result.light).expect("once");
            check(&format!("{name}, light"), size, &graph);
        }
        for entry in effects() {
            let mut graph = Graph::new();
            let images = inputs(&mut graph, size.0, size.1);
            let result = entry.build(&mut graph, &images).expect("valid");
            graph.output("result", result).expect("once");
            check(entry.name, size, &graph);
        }
    }
    println!("at most {:.1} % over the least", 100.0 * worst);
}
