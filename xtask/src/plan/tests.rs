use std::collections::BTreeSet;
use std::path::PathBuf;

use clap::Parser;
use etalon::Format;
use etalon::graph::{ClearValue, Graph};
use etalon::resource::TextureDesc;
use etalon_core::plan::{Plan, PlanOptions};

use super::flow::{Edge, edges};
use super::layout::{Size, layout};
use super::*;

#[derive(Parser)]
struct Line {
    #[command(flatten)]
    options: Options,
}

fn options(words: &[&str]) -> Options {
    let words = ["plan"].iter().chain(words);
    Line::try_parse_from(words).unwrap().options
}

fn planned(words: &[&str]) -> Report {
    let mut all = words.to_vec();
    all.extend(["--size", "64x36"]);
    report(&options(&all)).unwrap_or_else(|error| panic!("{words:?}: {error}"))
}

fn decision(report: &Report, effect: &str) -> (bool, String) {
    let effects = &report.plan.effects;
    let found = effects.iter().find(|known| known.name == effect);
    let decision = &found
        .unwrap_or_else(|| panic!("nothing is told of {effect}"))
        .decision;
    (decision.is_run(), decision.reason().to_owned())
}

#[test]
fn wrong_arguments_are_refused_with_what_would_be_right() {
    for (words, wanted) in [
        (
            &["wet-flor"][..],
            "there is no scene `wet-flor`; there are wet-floor",
        ),
        (&["wet-flor"], ".gltf, .glb or .exr"),
        (
            &["wet-floor", "--effects", "blur"],
            "all, none, ssr, exposure, bloom",
        ),
        (
            &["wet-floor", "--outputs", "sound"],
            "picture, light, depth",
        ),
        (
            &["wet-floor", "--max-roughness", "2"],
            "`max_roughness` is 2",
        ),
        (&["wet-floor", "--max-roughness", "NaN"], "from 0 to 1"),
        (
            &["wet-floor", "--size", "99999x1"],
            "a frame of 99999×1 pixels is not possible",
        ),
        (&["nowhere/none.glb"], "nowhere/none.glb"),
        (&["nowhere/none.exr"], "nowhere/none.exr"),
    ] {
        let error = match report(&options(words)) {
            Err(error) => error.to_string(),
            Ok(_) => panic!("{words:?} is taken"),
        };
        assert!(error.contains(wanted), "{words:?}: {error}");
    }
    assert!(Line::try_parse_from(["plan"]).is_err(), "a scene is needed");
    assert!(Line::try_parse_from(["plan", "a", "--size", "0x1"]).is_err());
    assert!(Line::try_parse_from(["plan", "a", "--preset", "best"]).is_err());
}

#[test]
fn a_scene_is_planned_with_its_reasons() {
    let wet = planned(&["wet-floor"]);
    assert!(decision(&wet, "ssr").0 && decision(&wet, "bloom").0);
    let strict = planned(&["wet-floor", "--max-roughness", "0.01"]);
    let (runs, why) = decision(&strict, "ssr");
    assert!(
        !runs && why.contains("smoother than 0.01 on screen"),
        "{why}"
    );
    assert!(strict.plan.steps.iter().all(|step| step.effect != "ssr"));
    let none = planned(&["wet-floor", "--effects", "none"]);
    assert_eq!(none.counters.kernels, 1);
    assert_eq!(decision(&none, "bloom").1, "the settings have it off");
    // A perfect mirror is not blurred.
    let mirror = planned(&["mirror-planes"]);
    assert!(decision(&mirror, "ssr").0);
    assert!(!decision(&mirror, "ssr/blur").0);
}

#[test]
fn a_model_is_drawn_only_as_far_as_it_is_called_for() {
    let gallery = planned(&["gallery", "--outputs", "picture,velocity"]);
    for part in [
        "geometry/prepass",
        "geometry/velocity",
        "forward/glass",
        "ssr",
    ] {
        assert!(decision(&gallery, part).0, "{part}");
    }
    assert!(!decision(&gallery, "geometry/gbuffer").0);
    let deferred = planned(&["gallery", "--shading", "deferred"]);
    assert!(decision(&deferred, "geometry/gbuffer").0);
    assert_eq!(
        decision(&deferred, "geometry/velocity").1,
        "velocity is not asked for"
    );
    let depth = planned(&["gallery", "--outputs", "depth"]);
    let passes: Vec<_> = depth.plan.steps.iter().map(|step| &step.name).collect();
    assert_eq!(passes, ["geometry/prepass"]);
    let stairs = planned(&["stairs"]);
    assert_eq!(
        decision(&stairs, "forward/glass").1,
        "nothing on screen lets light pass"
    );
}

#[test]
fn everything_that_is_told_is_in_every_form() {
    let report = planned(&["wet-floor", "--run", "cpu"]);
    let (text, page, dot) = (
        text::render(&report),
        html::render(&report),
        dot::render(&report.plan),
    );
    let json: serde_json::Value = serde_json::from_str(&model::json(&report)).unwrap();
    for step in &report.plan.steps {
        for form in [&text, &page, &dot] {
            assert!(form.contains(&step.name), "{}", step.name);
        }
    }
    for effect in &report.plan.effects {
        assert!(text.contains(effect.decision.reason()));
    }
    let run = &report.measured[0];
    assert_eq!(run.counters.invocations, report.counters.invocations);
    assert_eq!(json["counters"]["dispatches"], report.counters.dispatches);
    assert_eq!(json["measured"][0]["backend"]["backend"], "cpu");
    assert_eq!(json["memory"]["least"], report.memory.least);
    assert_eq!(
        json["timeline"].as_array().unwrap().len(),
        report.plan.steps.len()
    );
    assert!(json["demands"]["reflective"]["region"]["coverage"].is_number());
    // Nothing is fetched from anywhere.
    assert!(!page.contains("http:") && !page.contains("https:") && !page.contains("src="));
    let opened = page.matches("<svg").count();
    assert_eq!((opened, page.matches("</svg>").count()), (2, 2));
}

#[test]
fn files_are_written_where_they_are_asked_for() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name).display().to_string();
    let options = options(&[
        "wet-floor",
        "--size",
        "32x18",
        "--dot",
        &at("plan.dot"),
        "--json",
        &at("plan.json"),
        "--report",
        &at("page"),
    ]);
    run(&options).unwrap();
    for file in ["plan.dot", "plan.json", "page/index.html"] {
        assert!(std::fs::metadata(folder.path().join(file)).unwrap().len() > 100);
    }
    let nowhere = Options {
        dot: Some(PathBuf::from(at("none/plan.dot"))),
        ..options
    };
    let error = run(&nowhere).unwrap_err();
    assert!(error.to_string().contains("none/plan.dot"), "{error}");
}

/// `a` is cleared, copied to `b`, and `b` once more: names that markup would take for
/// something else.
fn copies() -> Plan {
    let desc = TextureDesc::d2(4, 4, Format::R32Float);
    let mut graph = Graph::new();
    let [a, b, c] = ["<a & \"b\">", "b\\", "c"].map(|name| graph.texture(name, desc));
    let a = graph.clear(a, ClearValue::Float([1.0; 4])).unwrap();
    let b = graph.copy(a, b).unwrap();
    let c = graph.copy(b, c).unwrap();
    graph.output("<out>", c).unwrap();
    Plan::new(&graph, &etalon::effects::kernels(), &PlanOptions::default()).unwrap()
}

#[test]
fn edges_are_what_steps_hand_to_each_other() {
    let plan = copies();
    let resource = |name: &str| {
        let position = plan.resources.iter().position(|known| known.name == name);
        position.unwrap() as u32
    };
    let edge = |from: Option<usize>, to: Option<usize>, name: &str| Edge {
        from,
        to,
        resource: resource(name),
    };
    assert_eq!(
        edges(&plan),
        [
            edge(Some(0), Some(1), "<a & \"b\">"),
            edge(Some(1), Some(2), "b\\"),
            edge(Some(2), None, "c"),
        ]
        .into_iter()
        .collect::<BTreeSet<_>>()
        .into_iter()
        .collect::<Vec<_>>()
    );
}

/// Every pass of a plan but those that write outputs hands something to a later one:
/// else it would have been culled. And what a step reads has been written, or comes in.
#[test]
fn edges_of_real_plans_leave_no_pass_alone() {
    for words in [
        &["wet-floor"][..],
        &[
            "gallery",
            "--shading",
            "deferred",
            "--outputs",
            "picture,velocity",
        ],
        &[
            "gallery",
            "--outputs",
            "picture,light,depth,normal,specular,velocity",
        ],
    ] {
        let plan = planned(words).plan;
        let edges = edges(&plan);
        for (index, step) in plan.steps.iter().enumerate() {
            assert!(
                edges.iter().any(|edge| edge.from == Some(index)),
                "{words:?}: {} hands nothing on",
                step.name
            );
            if let Some(reader) = step.reason.strip_suffix("` reads what it writes") {
                let reader = reader.trim_start_matches('`');
                let found = edges.iter().any(|edge| {
                    let to = edge.to.map(|to| plan.steps[to].name.as_str());
                    edge.from == Some(index) && to == Some(reader)
                });
                assert!(found, "{words:?}: {} for {reader}", step.name);
            }
        }
        assert!(edges.iter().all(|edge| match (edge.from, edge.to) {
            (Some(from), Some(to)) => from < to,
            _ => true,
        }));
    }
}

#[test]
fn names_cannot_become_markup() {
    let plan = copies();
    let svg = svg::graph(&plan);
    assert!(
        !svg.contains("<a &") && svg.contains("&lt;a &amp;"),
        "{svg}"
    );
    assert!(!svg.contains("<out>") && svg.contains("&lt;out&gt;"));
    let dot = dot::render(&plan);
    assert!(dot.contains(r#"label="<a & \"b\">""#), "{dot}");
    assert!(dot.contains(r#"label="b\\""#), "{dot}");
}

#[test]
fn boxes_lie_below_what_they_depend_on_and_apart() {
    // A small generator of random numbers (Knuth's MMIX).
    let mut state = 5_u64;
    let mut random = |below: usize| {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (state >> 33) as usize % below.max(1)
    };
    for _ in 0..200 {
        let count = 1 + random(20);
        let boxes: Vec<Size> = (0..count)
            .map(|_| Size {
                width: 40.0 + random(150) as f64,
                height: 26.0 + random(20) as f64,
            })
            .collect();
        let mut edges = Vec::new();
        for to in 1..count {
            for _ in 0..random(4) {
                edges.push((random(to), to));
            }
        }
        edges.sort_unstable();
        edges.dedup();
        let found = layout(&boxes, &edges);
        assert_eq!(
            (found.centres.len(), found.paths.len()),
            (count, edges.len())
        );
        for (index, (size, [x, y])) in boxes.iter().zip(&found.centres).enumerate() {
            assert!(x - 0.5 * size.width > -1e-9 && x + 0.5 * size.width < found.width + 1e-9);
            assert!(y - 0.5 * size.height > -1e-9 && y + 0.5 * size.height < found.height + 1e-9);
            for (other, [u, v]) in boxes[..index].iter().zip(&found.centres) {
                let apart_x = (x - u).abs() >= 0.5 * (size.width + other.width) - 1e-9;
                let apart_y = (y - v).abs() >= 0.5 * (size.height + other.height) - 1e-9;
                assert!(apart_x || apart_y, "two boxes in one place");
            }
        }
        for ((from, to), path) in edges.iter().zip(&found.paths) {
            assert!(
                path.windows(2).all(|pair| pair[0][1] < pair[1][1]),
                "{path:?}"
            );
            assert_eq!(path[0][0], found.centres[*from][0]);
            assert_eq!(path[path.len() - 1][0], found.centres[*to][0]);
        }
    }
    assert_eq!(layout(&[], &[]).paths, Vec::<Vec<[f64; 2]>>::new());
}
