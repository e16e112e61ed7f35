//! Light of all directions drawn by six views, and made into maps.

use std::f64::consts::PI;

use etalon::Format;
use etalon::backend::{Backend, Execution, Inputs};
use etalon::effects::environment::truth::Light;
use etalon::effects::environment::{
    CubePicture, EnvironmentMap, FACES, Irradiance, Prefilter, environment, face_direction,
    of_faces,
};
use etalon::effects::geometry::{DrawClass, Item, Surface};
use etalon::effects::lighting::Surroundings;
use etalon::effects::probes::capture::{Capture as Settings, Captured, capture, faces};
use etalon::effects::probes::{ProbeMaps, probe_map, truth::box_exit};
use etalon::effects::truth::Plane;
use etalon::graph::Graph;
use etalon::image::ImageData;
use etalon::kernel::{Arithmetic, KernelLibrary};
use etalon::plan::Capture;
use etalon::raster::{StepMode, VertexAttribute, VertexFormat, VertexLayout};
use etalon::resource::BufferDesc;
use etalon_tests::{difference, executors, first_difference, plan_for};
use glam::{DMat4, DVec2, DVec3, Vec3, Vec4};

use super::room::planted;

/// A sky brighter to one side, and a soft lamp.
fn sky(at: DVec3) -> DVec3 {
    let lamp = at.dot(DVec3::new(0.6, 0.48, -0.64)).max(0.0).powi(6);
    let glow = 0.5 + 0.3 * at.y + 0.15 * at.x - 0.2 * at.z;
    DVec3::new(0.4, 0.5, 0.7) * glow + DVec3::new(3.0, 2.0, 1.0) * lamp
}

/// A map and nine factors of faces.
fn made(
    executor: &mut dyn Backend,
    picture: &CubePicture,
    side: u32,
    kernels: &KernelLibrary,
) -> Execution {
    let mut graph = Graph::new();
    let given = graph.import_texture("faces", picture.image().desc).unwrap();
    let base = of_faces(&mut graph, given, side).unwrap();
    let maps = ProbeMaps::new(&mut graph, side, 1).unwrap();
    let maps = probe_map(&mut graph, maps, 0, base, &Prefilter { samples: 16 }).unwrap();
    graph.output("base", base).unwrap();
    graph.output("radiance", maps.radiance).unwrap();
    graph.output("irradiance", maps.irradiance).unwrap();
    let (strict, outputs) = (Arithmetic::Strict, Capture::Outputs);
    let plan = plan_for(executor, &graph, kernels, strict, outputs).unwrap();
    let inputs = Inputs::new().texture("faces", picture.image());
    executor.execute(&plan, &inputs).unwrap()
}

/// The largest difference from the map that the host makes in f64, in half steps of f16:
/// every texel of every mip, frames that lie across the octahedron's fold and texels across
/// the cube's edges among them.
fn from_host(base: &ImageData, picture: &CubePicture, side: u32) -> f64 {
    let host = EnvironmentMap::of_cube(picture, side).unwrap();
    let (a, b) = (
        base.to_rgba_f32().unwrap(),
        host.image().to_rgba_f32().unwrap(),
    );
    assert_eq!(a.len(), b.len());
    let texels = a.iter().flatten().zip(b.iter().flatten());
    texels.fold(0.0, |worst, (a, b)| {
        let (a, b) = (f64::from(*a), f64::from(*b));
        worst.max((a - b).abs() / (b.abs() / 2048.0 + 1e-7))
    })
}

#[test]
fn faces_become_the_map_that_f64_makes_of_them() {
    let kernels = etalon::effects::kernels();
    // Of a constant all is exact; else means of up to 4096 places in f32, of directions whose
    // places in faces of 48 texels are right to 2^-19 of one.
    let constant = |_: DVec3| DVec3::new(1.0, 0.25, 3.0);
    type Radiance<'a> = &'a dyn Fn(DVec3) -> DVec3;
    for (name, radiance, side, most) in [
        ("constant", &constant as Radiance<'_>, 32, 0.0),
        ("smooth", &sky as Radiance<'_>, 64, 2.05),
    ] {
        let picture = CubePicture::of_directions(48, radiance).unwrap();
        let mut first: Option<Execution> = None;
        for executor in &mut executors() {
            let execution = made(executor.as_mut(), &picture, side, &kernels);
            let worst = from_host(execution.output("base").unwrap(), &picture, side);
            println!("{name} on {}: {worst}", executor.info());
            assert!(worst <= most, "{name} on {}: {worst}", executor.info());
            match &first {
                None => first = Some(execution),
                Some(first) => {
                    let found = first_difference(first, &execution);
                    assert_eq!(found, None, "{name} on {}", executor.info());
                }
            }
        }
    }
    // Two faces exchanged, and edges that do not know of their neighbours.
    let picture = CubePicture::of_directions(48, sky).unwrap();
    for (part, by) in [
        ("select(0u, 1u, way.x < 0.0)", "select(1u, 0u, way.x < 0.0)"),
        (
            "return face_light(faces, face_of(face_way(face, at)));",
            "return vec3<f32>(0.0);",
        ),
    ] {
        let kernels = planted("lib/cube", part, by);
        let mut interpreter = etalon_tests::cpu().unwrap();
        let execution = made(interpreter.as_mut(), &picture, 64, &kernels);
        let worst = from_host(execution.output("base").unwrap(), &picture, 64);
        assert!(worst > 12.0, "{by}: {worst}");
    }
}

/// The map shows what the faces were made of, across the edges of faces and the fold: off
/// by what bends within a texel of each.
///
/// The sky's slope is below 14 a radian and its second derivative below 120; a face of 64
/// has texels of up to 2 / 64, a map's of 128 up to 5.2^½ · 2 / 126 = 0.036 across, and
/// means are off by a 24th, interpolations by an 8th, of their squares in two axes: 0.05.
/// An edge where neighbours do not meet shows half a texel's slope: 0.2.
#[test]
fn maps_have_no_seams() {
    let kernels = etalon::effects::kernels();
    let picture = CubePicture::of_directions(64, sky).unwrap();
    let mut interpreter = etalon_tests::cpu().unwrap();
    let execution = made(interpreter.as_mut(), &picture, 128, &kernels);
    let base = execution.output("base").unwrap();
    let inner = 126.0;
    let mut worst = 0_f64;
    for (x, y) in (0..128).flat_map(|y| (0..128).map(move |x| (x, y))) {
        let place = (DVec2::new(f64::from(x), f64::from(y)) - 0.5) / inner * 2.0 - 1.0;
        let [r, g, b, _] = base.texel(x, y, 0, 0).unwrap().to_f64();
        let off = (DVec3::new(r, g, b) - sky(unfolded(place)))
            .abs()
            .max_element();
        worst = worst.max(off);
    }
    println!("{worst}");
    assert!(worst < 0.05, "{worst}");
}

/// The direction at a place of the octahedron's square, or across its fold, from a plane
/// of each octant.
fn unfolded(place: DVec2) -> DVec3 {
    let mut p = place;
    if p.x.abs() > 1.0 {
        p = DVec2::new(p.x.signum() * 2.0 - p.x, -p.y);
    }
    if p.y.abs() > 1.0 {
        p = DVec2::new(-p.x, p.y.signum() * 2.0 - p.y);
    }
    let up = 1.0 - p.x.abs() - p.y.abs();
    let (x, z) = match up < 0.0 {
        true => (
            (1.0 - p.y.abs()) * p.x.signum(),
            (1.0 - p.x.abs()) * p.y.signum(),
        ),
        false => (p.x, p.y),
    };
    DVec3::new(x, up, z).normalize()
}

/// The largest difference of nine factors from f64's, relative to the largest of them.
fn factors_apart(execution: &Execution, want: &Irradiance) -> f64 {
    let image = execution.output("irradiance").unwrap();
    let want = want.polynomial();
    let largest = want
        .iter()
        .map(|factor| factor.abs().max_element())
        .fold(0.0, f64::max);
    let off = (0..9).map(|k| {
        let [r, g, b, _] = image.texel(k, 0, 0, 0).unwrap().to_f64();
        (DVec3::new(r, g, b) - want[k as usize]).abs().max_element()
    });
    off.fold(0.0, f64::max) / largest
}

/// Nine sums are those of f64 over the same map in sixteen times as many pieces, and those
/// over the faces. Midpoints are off by a 24th of the square of a texel of 2 / 62 times
/// what bends: solid angles by 15 in two axes, polynomials and light by as much again.
#[test]
fn irradiance_is_that_of_f64() {
    let kernels = etalon::effects::kernels();
    for side in [32, 64, 256] {
        let picture = CubePicture::of_directions(64, sky).unwrap();
        let mut first: Option<Execution> = None;
        for executor in &mut executors() {
            let execution = made(executor.as_mut(), &picture, side, &kernels);
            let map = Plane::of(execution.output("base").unwrap()).unwrap();
            let of_map = Irradiance::of_pieces(&Light::of_map(&map).unwrap());
            let of_faces = Irradiance::of_cube(&picture).unwrap();
            let off = [&of_map, &of_faces].map(|want| factors_apart(&execution, want));
            println!("{side} on {}: {off:?}", executor.info());
            let texel = 2.0 / f64::from(side.min(64) - 2);
            let most = 60.0 * texel * texel / 24.0;
            assert!(
                off[0] < most && off[1] < 2.0 * most,
                "{side}: {off:?}, {most}"
            );
            let first = first.get_or_insert_with(|| execution.clone());
            assert_eq!(
                first_difference(first, &execution),
                None,
                "{}",
                executor.info()
            );
        }
    }
    // A band that keeps too much.
    let kernels = planted("environment/irradiance", "(n.y, 2.0)", "(n.y, 2.1)");
    let picture = CubePicture::of_directions(64, sky).unwrap();
    let mut interpreter = etalon_tests::cpu().unwrap();
    let execution = made(interpreter.as_mut(), &picture, 64, &kernels);
    let off = factors_apart(&execution, &Irradiance::of_cube(&picture).unwrap());
    assert!(off > 0.005, "{off}");
}

#[test]
fn a_function_of_two_bands_is_held_by_its_factors() {
    let light =
        |at: DVec3| DVec3::splat(2.0) + DVec3::new(at.y, at.x * at.z, at.z * at.z - 1.0 / 3.0);
    let of_cube = Irradiance::of_cube(&CubePicture::of_directions(128, light).unwrap()).unwrap();
    // Of irradiance over π the first band keeps ⅔, the second ¼.
    for at in [
        DVec3::Y,
        DVec3::new(0.6, 0.0, 0.8),
        DVec3::new(0.36, -0.48, 0.8),
    ] {
        let bands = DVec3::new(
            at.y * 2.0 / 3.0,
            at.x * at.z / 4.0,
            (at.z * at.z - 1.0 / 3.0) / 4.0,
        );
        let off = of_cube.at(at) / PI - (DVec3::splat(2.0) + bands);
        assert!(off.length() < 1e-3, "{off}");
    }
}

const CENTRE: DVec3 = DVec3::new(10.0, 1.0, -5.0);
const HALF: DVec3 = DVec3::new(3.0, 2.0, 4.0);
const EYE: DVec3 = DVec3::new(9.0, 0.5, -3.0);
/// Of the walls at +x, -x, +y, -y, +z and -z.
const WALLS: [[f32; 3]; 6] = [
    [1.0, 0.0, 0.0],
    [0.0, 1.0, 1.0],
    [0.0, 1.0, 0.0],
    [1.0, 0.0, 1.0],
    [0.0, 0.0, 1.0],
    [1.0, 1.0, 0.0],
];

/// The walls of a room, seen from within, as the bytes of their corners.
fn walls() -> Vec<Vec<u8>> {
    let wall = |face: u32| {
        let ahead = face_direction(face, DVec2::ZERO);
        let corner = |x: f64, y: f64| CENTRE + HALF * face_direction(face, DVec2::new(x, y));
        let [a, b, c, d] =
            [(-1.0, -1.0), (-1.0, 1.0), (1.0, 1.0), (1.0, -1.0)].map(|(x, y)| corner(x, y));
        let corners = [a, b, c, a, c, d].into_iter();
        let numbers = corners.flat_map(|at| [at.as_vec3(), -ahead.as_vec3()]);
        numbers
            .flat_map(|v| v.to_array())
            .flat_map(f32::to_le_bytes)
            .collect()
    };
    (0..FACES).map(wall).collect()
}

fn items(graph: &mut Graph, walls: &[Vec<u8>]) -> Vec<Item> {
    let attribute = |name: &'static str, offset| VertexAttribute {
        name: name.into(),
        format: VertexFormat::Float32x3,
        offset,
    };
    let layout = VertexLayout {
        stride: 24,
        step: StepMode::Vertex,
        attributes: vec![attribute("position", 0), attribute("normal", 12)],
    };
    let item = |(number, bytes): (usize, &Vec<u8>)| {
        let desc = BufferDesc {
            bytes: bytes.len() as u64,
        };
        let buffer = graph
            .import_buffer(&format!("wall {number}"), desc)
            .unwrap();
        Item {
            vertices: vec![(buffer, 0, layout.clone())],
            indices: None,
            elements: 0..6,
            world: DMat4::IDENTITY,
            previous: DMat4::IDENTITY,
            class: DrawClass::Static,
            surface: Surface {
                base: Vec4::new(0.0, 0.0, 0.0, 1.0),
                mirrored: 0.0,
                emission: Vec3::from(WALLS[number]),
                ..Surface::default()
            },
        }
    };
    walls.iter().enumerate().map(item).collect()
}

/// The wall that is seen along a way, and how far its end is off in units of the room.
fn wall(way: DVec3) -> (Vec3, f64) {
    let exit = box_exit(EYE - CENTRE, way, HALF) / HALF;
    let size = exit.abs();
    let axis = (0..3).max_by(|&a, &b| size[a].total_cmp(&size[b])).unwrap();
    let face = 2 * axis + usize::from(exit[axis] < 0.0);
    let others = (0..3).filter(|&other| other != axis);
    let to_edge = others.map(|other| 1.0 - size[other]).fold(1.0, f64::min);
    (Vec3::from(WALLS[face]), to_edge)
}

/// Each view sees its face of the world: the walls where rays in f64 meet them, but for
/// pixels on their edges.
#[test]
fn six_views_see_a_room_as_rays_do() {
    let walls = walls();
    let kernels = etalon::effects::kernels();
    let mut first: Option<Execution> = None;
    for executor in &mut executors() {
        let mut graph = Graph::new();
        let items = items(&mut graph, &walls);
        let captured = Captured {
            items: &items,
            position: EYE,
            near: 0.01,
            lamps: [None; 6],
            surroundings: Surroundings::default(),
        };
        let drawn = faces(&mut graph, &captured, 48).unwrap();
        graph.output("faces", drawn).unwrap();
        let settings = Settings {
            face: 48,
            side: 64,
            samples: 16,
        };
        let base = capture(&mut graph, &captured, &settings).unwrap();
        graph.output("base", base).unwrap();
        let (strict, outputs) = (Arithmetic::Strict, Capture::Outputs);
        let plan = plan_for(executor.as_ref(), &graph, &kernels, strict, outputs).unwrap();
        let mut inputs = Inputs::new();
        for (number, bytes) in walls.iter().enumerate() {
            inputs = inputs.buffer(format!("wall {number}"), bytes);
        }
        let execution = executor.execute(&plan, &inputs).unwrap();
        let image = execution.output("faces").unwrap();
        let (mut seen, mut all) = (0, [false; 6]);
        for face in 0..FACES {
            for (x, y) in (0..48).flat_map(|y| (0..48).map(move |x| (x, y))) {
                let place = (DVec2::new(f64::from(x), f64::from(y)) + 0.5) / 24.0 - 1.0;
                let (want, to_edge) = wall(face_direction(face, place));
                // A pixel is at most 1 / 24 of a wall that is as far as it is wide.
                if to_edge < 0.1 {
                    continue;
                }
                let [r, g, b, _] = image.texel(x, y, face, 0).unwrap().to_f64();
                let got = DVec3::new(r, g, b).as_vec3();
                assert_eq!(got, want, "face {face} at {x}, {y} on {}", executor.info());
                seen += 1;
                all[WALLS.iter().position(|w| Vec3::from(*w) == want).unwrap()] = true;
            }
        }
        println!("{}: {seen} pixels", executor.info());
        assert!(seen > 5000 && all == [true; 6]);
        // And so does the map that is made of them.
        let base = execution.output("base").unwrap();
        let mut held = 0;
        for (x, y) in (1..63).flat_map(|y| (1..63).map(move |x| (x, y))) {
            let place = (DVec2::new(f64::from(x), f64::from(y)) - 0.5) / 31.0 - 1.0;
            let (want, to_edge) = wall(unfolded(place));
            if to_edge > 0.4 {
                let [r, g, b, _] = base.texel(x, y, 0, 0).unwrap().to_f64();
                let off = (DVec3::new(r, g, b).as_vec3() - want).abs().max_element();
                assert!(off < 1e-3, "{x}, {y}: {off}");
                held += 1;
            }
        }
        assert!(held > 400, "{held}");
        let first = first.get_or_insert_with(|| execution.clone());
        for name in ["faces", "base"] {
            let (a, b) = (first.output(name).unwrap(), execution.output(name).unwrap());
            assert_eq!(difference(a, b), None, "{name} on {}", executor.info());
        }
    }
}

/// What a map of a layer is made of is what an environment is.
#[test]
fn a_layer_is_what_an_environment_is() {
    let kernels = etalon::effects::kernels();
    let picture = CubePicture::of_directions(32, sky).unwrap();
    let mut interpreter = etalon_tests::cpu().unwrap();
    let layer = made(interpreter.as_mut(), &picture, 32, &kernels);
    let mut graph = Graph::new();
    let given = graph.import_texture("faces", picture.image().desc).unwrap();
    let base = of_faces(&mut graph, given, 32).unwrap();
    let none = Irradiance::default();
    let around = environment(&mut graph, base, &none, &Prefilter { samples: 16 }).unwrap();
    graph.output("radiance", around.radiance).unwrap();
    let (strict, outputs) = (Arithmetic::Strict, Capture::Outputs);
    let plan = plan_for(interpreter.as_ref(), &graph, &kernels, strict, outputs).unwrap();
    let inputs = Inputs::new().texture("faces", picture.image());
    let execution = interpreter.execute(&plan, &inputs).unwrap();
    let (a, b) = (
        execution.output("radiance").unwrap(),
        layer.output("radiance").unwrap(),
    );
    assert_eq!(a.desc.format, Format::Rgba16Float);
    assert!(a.bytes == b.bytes);
}
