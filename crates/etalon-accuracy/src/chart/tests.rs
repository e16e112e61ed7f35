use super::*;

fn spread(median: f64) -> Spread {
    Spread {
        median,
        lower: median * 0.9,
        upper: median * 1.2,
        frames: 30,
    }
}

fn mark(id: &str, time: f64, error: f64) -> Mark {
    Mark {
        id: id.to_owned(),
        series: "strict".to_owned(),
        time: Some(spread(time)),
        error: Some(error),
        description: format!("about {id}"),
        ..Mark::default()
    }
}

fn chart(marks: Vec<Mark>) -> Chart {
    Chart {
        title: "ash · llvmpipe".to_owned(),
        error: "hit position, median [px]".to_owned(),
        marks,
    }
}

/// An element: its name, its attributes, and the text directly in it.
#[derive(Debug, Default)]
struct Element {
    name: String,
    attributes: Vec<(String, String)>,
    text: String,
}

impl Element {
    fn get(&self, name: &str) -> Option<&str> {
        let mut attributes = self.attributes.iter();
        attributes
            .find(|(known, _)| known == name)
            .map(|(_, value)| value.as_str())
    }

    fn number(&self, name: &str) -> f64 {
        self.get(name).unwrap().parse().unwrap()
    }
}

/// All elements of a document, which has to be well-formed: one root, every tag
/// closed in order, attributes quoted and unique, no bare `&` or `<`.
fn parse(xml: &str) -> Vec<Element> {
    let mut elements: Vec<Element> = Vec::new();
    let mut open: Vec<usize> = Vec::new();
    let mut rest = xml.trim();
    let mut rooted = false;
    while !rest.is_empty() {
        let start = rest.find('<').unwrap_or(rest.len());
        let (text, tail) = rest.split_at(start);
        check_entities(text);
        match open.last() {
            Some(&element) => elements[element].text.push_str(text),
            None => assert!(text.trim().is_empty(), "text outside the root: {text}"),
        }
        if tail.is_empty() {
            break;
        }
        let end = tail.find('>').expect("a tag ends");
        let tag = &tail[1..end];
        rest = &tail[end + 1..];
        if let Some(name) = tag.strip_prefix('/') {
            let element = open.pop().expect("something to close");
            assert_eq!(elements[element].name, name);
            continue;
        }
        assert!(!open.is_empty() || !rooted, "one root");
        rooted = true;
        let (tag, closed) = tag
            .strip_suffix('/')
            .map_or((tag, false), |tag| (tag, true));
        elements.push(element(tag));
        if !closed {
            open.push(elements.len() - 1);
        }
    }
    assert!(open.is_empty(), "{open:?} are open");
    elements
}

fn element(tag: &str) -> Element {
    let (name, mut rest) = tag.split_once(' ').unwrap_or((tag, ""));
    let mut attributes: Vec<(String, String)> = Vec::new();
    while !rest.trim().is_empty() {
        let (name, tail) = rest.trim_start().split_once("=\"").expect("quoted");
        let (value, tail) = tail.split_once('"').expect("a quote ends");
        check_entities(value);
        assert!(attributes.iter().all(|(known, _)| known != name), "{tag}");
        attributes.push((name.to_owned(), value.to_owned()));
        rest = tail;
    }
    Element {
        name: name.to_owned(),
        attributes,
        text: String::new(),
    }
}

fn check_entities(text: &str) {
    for tail in text.split('&').skip(1) {
        let (entity, _) = tail.split_once(';').expect("an entity");
        assert!(
            ["amp", "lt", "gt", "quot", "#39"].contains(&entity),
            "{entity}"
        );
    }
}

/// The points drawn, after looking at what has to hold for any chart.
fn points(chart: &Chart) -> Vec<Element> {
    for place in [Place::Page, Place::Alone] {
        let svg = chart.svg(place);
        let elements = parse(&svg);
        for element in &elements {
            for (name, value) in &element.attributes {
                assert!(
                    !value.contains("NaN") && !value.contains("inf"),
                    "{name}={value}"
                );
                if ["x", "y", "cx", "cy", "r", "width", "height"].contains(&name.as_str()) {
                    let number: f64 = value.parse().unwrap();
                    assert!((-30.0..=WIDTH).contains(&number), "{element:?}");
                }
            }
        }
    }
    let of_page = parse(&chart.svg(Place::Page));
    let is_point = |element: &Element| element.get("data-point").is_some();
    let points: Vec<Element> = of_page.into_iter().filter(is_point).collect();
    for point in &points {
        assert_eq!(point.name, "circle");
        assert_eq!(point.get("tabindex"), Some("0"));
        assert!((LEFT..=RIGHT).contains(&point.number("cx")), "{point:?}");
        assert!((TOP..=BOTTOM).contains(&point.number("cy")), "{point:?}");
    }
    points
}

fn by_id<'a>(points: &'a [Element], id: &str) -> &'a Element {
    points
        .iter()
        .find(|point| point.get("data-point") == Some(id))
        .unwrap()
}

#[test]
fn places_follow_values() {
    let marks: Vec<Mark> = (0..20)
        .map(|step| {
            let step = f64::from(step);
            mark(
                &format!("p{step}"),
                1e5 * 1.5_f64.powf(step),
                10.0 * 0.6_f64.powf(step),
            )
        })
        .collect();
    let points = points(&chart(marks));
    assert_eq!(points.len(), 20);
    for step in 1..20 {
        let (before, after) = (
            by_id(&points, &format!("p{}", step - 1)),
            by_id(&points, &format!("p{step}")),
        );
        assert!(before.number("cx") < after.number("cx"));
        assert!(before.number("cy") < after.number("cy"), "less is lower");
    }
}

#[test]
fn decades_are_equally_far_apart() {
    let points = points(&chart(vec![
        mark("a", 1e3, 1.0),
        mark("b", 1e5, 1e-2),
        mark("c", 1e7, 1e-4),
    ]));
    let step = |from: &str, to: &str, axis: &str| {
        by_id(&points, to).number(axis) - by_id(&points, from).number(axis)
    };
    assert!((step("a", "b", "cx") - step("b", "c", "cx")).abs() < 0.2);
    assert!((step("a", "b", "cy") - step("b", "c", "cy")).abs() < 0.2);
}

#[test]
fn no_error_at_all_is_beneath_every_error() {
    let chart = chart(vec![
        mark("some", 1e6, 1e-12),
        mark("none", 2e6, 0.0),
        mark("none too", 3e6, -0.0),
    ]);
    let points = points(&chart);
    assert!(by_id(&points, "none").number("cy") > by_id(&points, "some").number("cy") + GAP);
    assert_eq!(
        by_id(&points, "none").number("cy"),
        by_id(&points, "none too").number("cy")
    );
    assert!(chart.svg(Place::Page).contains(">exactly 0<"));
    let only = super::Chart {
        marks: vec![mark("none", 2e6, 0.0)],
        ..chart.clone()
    };
    assert!(only.svg(Place::Page).contains("Every error is exactly 0."));
    assert_eq!(self::points(&only).len(), 1);
    // Without such an error there is no such strip.
    let without = super::Chart {
        marks: vec![mark("some", 1e6, 1e-12)],
        ..chart
    };
    assert!(!without.svg(Place::Page).contains("exactly 0"));
}

#[test]
fn whatever_the_values_there_is_a_chart() {
    assert!(points(&chart(Vec::new())).is_empty());
    assert!(
        chart(Vec::new())
            .svg(Place::Alone)
            .contains("Nothing was tried here.")
    );
    assert_eq!(points(&chart(vec![mark("one", 1e6, 0.1)])).len(), 1);
    let equal: Vec<Mark> = (0..9).map(|n| mark(&n.to_string(), 1e6, 0.1)).collect();
    assert_eq!(points(&chart(equal)).len(), 9);
    let wide = vec![
        mark("least", f64::MIN_POSITIVE, f64::MAX),
        mark("most", f64::MAX / 2.0, 5e-324),
        mark("middle", 1.0, 1.0),
    ];
    assert_eq!(points(&chart(wide)).len(), 3);
    let mut odd = mark("odd quartiles", 1e6, 0.1);
    odd.time = Some(Spread {
        median: 1e6,
        lower: f64::NAN,
        upper: f64::INFINITY,
        frames: 0,
    });
    assert_eq!(points(&chart(vec![odd])).len(), 1);
}

#[test]
fn points_without_a_place_are_counted() {
    let mut chart = chart(vec![mark("a", 1e6, 0.1)]);
    for (time, error) in [
        (Some(0.0), Some(0.1)),
        (Some(f64::NAN), Some(0.1)),
        (None, Some(0.1)),
        (Some(1e6), None),
        (Some(1e6), Some(f64::NAN)),
        (Some(1e6), Some(f64::INFINITY)),
        (Some(1e6), Some(-1.0)),
    ] {
        chart.marks.push(Mark {
            time: time.map(spread),
            error,
            ..mark("x", 1.0, 1.0)
        });
    }
    assert_eq!(points(&chart).len(), 1);
    let svg = chart.svg(Place::Page);
    assert!(
        svg.contains("1 of 8 drawn: 3 not timed, 4 without this error"),
        "{svg}"
    );
    chart.marks.drain(..4);
    assert!(
        chart
            .svg(Place::Page)
            .contains("Nothing has this error here.")
    );
    chart.marks.truncate(0);
    chart.marks.push(Mark {
        time: None,
        ..mark("x", 1.0, 1.0)
    });
    assert!(chart.svg(Place::Page).contains("Nothing was timed here."));
}

#[test]
fn names_and_texts_cannot_become_markup() {
    let hostile = "<script>&\"'\u{0}";
    let chart = Chart {
        title: hostile.to_owned(),
        error: hostile.to_owned(),
        marks: vec![Mark {
            id: hostile.to_owned(),
            name: Some(hostile.to_owned()),
            series: hostile.to_owned(),
            description: hostile.to_owned(),
            ..mark("", 1.0, 1.0)
        }],
    };
    assert_eq!(points(&chart).len(), 1);
    assert!(!chart.svg(Place::Alone).contains("<script"));
}

#[test]
fn presets_are_named_the_default_is_ringed_and_the_front_is_a_line() {
    let preset = |id: &str, name: &str, time, error| Mark {
        name: Some(name.to_owned()),
        ..mark(id, time, error)
    };
    let mut medium = preset("m", "medium", 2e6, 0.1);
    medium.default = true;
    let chart = chart(vec![
        preset("l", "low", 1e6, 1.0),
        medium,
        preset("h", "high", 4e6, 0.2),
        mark("x", 8e6, 0.01),
    ]);
    let svg = chart.svg(Place::Page);
    let elements = parse(&svg);
    let with_class = |class: &str| {
        let has = |element: &&Element| {
            element
                .get("class")
                .is_some_and(|all| all.split(' ').any(|one| one == class))
        };
        elements.iter().filter(has).collect::<Vec<_>>()
    };
    let names: Vec<&str> = with_class("name")
        .iter()
        .map(|name| name.text.as_str())
        .collect();
    assert_eq!(names, ["low", "medium", "high"]);
    // One in the legend.
    assert_eq!(with_class("default-ring").len(), 2);
    assert_eq!(with_class("front").len(), 2);
    let points = points(&chart);
    let class = |id| by_id(&points, id).get("class").unwrap();
    assert!(!class("h").contains("on-front"));
    for id in ["l", "m", "x"] {
        assert!(class(id).contains("on-front"), "{id}");
    }
    assert!(svg.contains("<title>about m</title>"));
}

#[test]
fn a_series_is_not_beaten_by_another() {
    let fast = |id: &str, time, error| Mark {
        series: "fast".to_owned(),
        ..mark(id, time, error)
    };
    let points = points(&chart(vec![
        mark("strict", 2e6, 0.1),
        mark("worse", 3e6, 0.1),
        fast("fast", 1e6, 0.1),
        fast("slow", 4e6, 0.2),
    ]));
    let on_front: Vec<&str> = points
        .iter()
        .filter(|point| point.get("class").unwrap().contains("on-front"))
        .map(|point| point.get("data-point").unwrap())
        .collect();
    assert_eq!(on_front, ["fast", "strict"]);
}

#[test]
fn what_is_better_the_larger_is_drawn_as_what_is_missing() {
    let metric = |unit: &str| Metric {
        id: "m".to_owned(),
        name: "recall".to_owned(),
        unit: unit.to_owned(),
        larger_is_better: true,
        ..Metric::default()
    };
    let subject = |values: [f64; 2]| Subject {
        points: values
            .iter()
            .enumerate()
            .map(|(number, &value)| Point {
                id: number.to_string(),
                results: vec![Outcome {
                    executor: "cpu".to_owned(),
                    time: Some(spread(1e6)),
                    errors: [("m".to_owned(), value)].into(),
                    ..Outcome::default()
                }],
                ..Point::default()
            })
            .collect(),
        ..Subject::default()
    };
    let executor = Executor {
        id: "cpu".to_owned(),
        ..Executor::default()
    };
    let errors =
        |chart: &Chart| -> Vec<f64> { chart.marks.iter().filter_map(|mark| mark.error).collect() };
    let share = Chart::of(&subject([0.75, 1.0]), &metric(""), &executor);
    assert_eq!(errors(&share), [0.25, 0.0]);
    assert_eq!(share.error, "recall, missing to 1");
    assert!(share.marks[0].description.ends_with("recall 0.750"));
    let decibel = Chart::of(&subject([20.0, 50.0]), &metric("dB"), &executor);
    assert_eq!(errors(&decibel), [30.0, 0.0]);
    assert_eq!(decibel.error, "recall, missing to the best [dB]");
    // Who did not run is not there.
    let other = Executor {
        id: "ash".to_owned(),
        ..Executor::default()
    };
    assert!(
        Chart::of(&subject([0.5, 1.0]), &metric(""), &other)
            .marks
            .is_empty()
    );
}
