//! Position from depth: how far what kernels compute of a drawn depth is from where
//! surfaces are, for every way to store depth.

use etalon::Format;
use etalon::backend::Backend;
use etalon::effects::geometry::{Geometry, View, prepass};
use etalon::effects::{CameraParams, DepthRange};
use etalon::graph::Graph;
use etalon::kernel::Arithmetic;
use etalon::plan::Capture;
use etalon::resource::TextureDesc;
use etalon_scenes::model::{
    Drawable, Material, Mesh, Model, ModelParts, Node, Transform, Vertices, view,
};
use etalon_scenes::{Camera, FrameSize, Pose};
use etalon_tests::{executors, plan_for};
use glam::{DVec2, DVec3, DVec4};

const KERNEL: &str = "
import package::lib::camera::{Camera, distance_of, view_position};
struct Params {
    projection_scale: vec2<f32>,
    projection_centre: vec2<f32>,
    depth_bias_slope: vec2<f32>,
    distance_range: vec2<f32>,
}
@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var depth: texture_2d<f32>;
@group(0) @binding(2) var position: texture_storage_2d<rgba32float, write>;
@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    let extent = textureDimensions(position);
    if (id.x >= extent.x || id.y >= extent.y) {
        return;
    }
    let camera = Camera(
        params.projection_scale,
        params.projection_centre,
        params.depth_bias_slope,
        params.distance_range,
    );
    let distance = distance_of(camera, textureLoad(depth, id.xy, 0).x);
    let uv = (vec2<f32>(id.xy) + 0.5) / vec2<f32>(extent);
    textureStore(position, id.xy, vec4<f32>(view_position(camera, uv, distance), 1.0));
}
";

const NEAR: f32 = 0.1;

/// Strips that face the camera: since depth is the same all over each, the grid that
/// corners are moved to has no part in the errors.
const STRIPS: usize = 64;

fn size() -> FrameSize {
    FrameSize::new(2 * STRIPS as u32, 72).unwrap()
}

fn camera() -> Camera {
    let pose = Pose::look_at(DVec3::ZERO, DVec3::NEG_Z, DVec3::Y).unwrap();
    let camera = Camera::new(pose, 60_f64.to_radians()).unwrap();
    camera.with_near(NEAR.into()).unwrap()
}

/// Distances of the strips: from a number of metres up to 5 % less, as far as `f32`
/// holds them.
fn distances(metres: f64) -> Vec<f32> {
    let share = |strip: usize| 1.0 - 0.05 * strip as f64 / STRIPS as f64;
    let at = |strip| (metres * share(strip)) as f32;
    (0..STRIPS).map(at).collect()
}

fn strips(distances: &[f32]) -> Model {
    let scale = camera().projection(size()).unwrap().scale();
    let mut vertices = Vertices::default();
    let mut triangles = Vec::new();
    for (strip, &distance) in distances.iter().enumerate() {
        let first = vertices.positions.len() as u32;
        let x =
            |edge: usize| (2.0 * edge as f64 / STRIPS as f64 - 1.0) * f64::from(distance) / scale.x;
        let y = 1.2 * f64::from(distance) / scale.y;
        for (x, y) in [
            (x(strip), -y),
            (x(strip + 1), -y),
            (x(strip + 1), y),
            (x(strip), y),
        ] {
            vertices.positions.push([x as f32, y as f32, -distance]);
            vertices.normals.push([0.0, 0.0, 1.0]);
        }
        triangles
            .extend([[0, 1, 2], [0, 2, 3]].map(|corners| corners.map(|corner| first + corner)));
    }
    let mut parts = ModelParts::default();
    let mesh = parts.mesh(Mesh::new("strips", vertices, triangles).unwrap());
    let grey = parts.material(Material::dielectric("grey", [0.5; 3], 0.5));
    parts.node(Node::with_part("strips", Transform::default(), mesh, grey));
    Model::new(parts).unwrap()
}

/// What is drawn and what is made of it.
struct Case {
    metres: f64,
    depth: DepthRange,
    /// A factor on the near plane that the kernel is told.
    told: f32,
}

/// The largest error of a distance, relative to it, and of a position, in metres.
fn errors(executor: &mut dyn Backend, case: &Case) -> (f64, f64) {
    let distances = distances(case.metres);
    let model = strips(&distances);
    let snapshot = model.at(0.0).unwrap();
    let drawable = Drawable::new(&model).unwrap();
    let of_camera = view(&camera(), size()).unwrap();
    let params = CameraParams {
        depth: case.depth,
        ..of_camera.camera
    };
    let mut graph = Graph::new();
    let items = drawable.import(&mut graph).unwrap();
    let items = items.opaque_items(&model, &snapshot);
    let geometry = Geometry {
        items: &items,
        view: View {
            camera: params,
            ..of_camera
        },
        size: [size().width(), size().height()],
    };
    let depth = prepass(&mut graph, &geometry, false).unwrap().depth;
    let desc = TextureDesc::d2(size().width(), size().height(), Format::Rgba32Float);
    let position = graph.texture("position", desc);
    let told = CameraParams {
        near: params.near * case.told,
        ..params
    };
    let position = graph
        .compute("test/position")
        .read("depth", depth)
        .write("position", position)
        .set("projection_scale", told.scale)
        .set("projection_centre", told.centre)
        .set("depth_bias_slope", told.depth_bias_slope())
        .set("distance_range", told.distance_range())
        .per_texel("position")
        .unwrap();
    graph.output("position", position).unwrap();
    let mut kernels = etalon::effects::kernels();
    kernels.add_source("test/position", KERNEL);
    let strict = Arithmetic::Strict;
    let plan = plan_for(executor, &graph, &kernels, strict, Capture::Outputs).unwrap();
    let drawn = executor.execute(&plan, &drawable.inputs()).unwrap();
    let image = drawn.output("position").unwrap();
    let (mut relative, mut moved) = (0.0_f64, 0.0_f64);
    let projection = camera().projection(size()).unwrap();
    let [width, height] = [size().width(), size().height()];
    for (x, y) in (0..height).flat_map(|y| (0..width).map(move |x| (x, y))) {
        let distance = f64::from(distances[x as usize / 2]);
        let ndc = DVec2::new(
            (f64::from(x) + 0.5) / f64::from(width) * 2.0 - 1.0,
            1.0 - (f64::from(y) + 0.5) / f64::from(height) * 2.0,
        );
        let truth = (ndc / projection.scale() * distance).extend(-distance);
        let got = DVec4::from(image.texel(x, y, 0, 0).unwrap().to_f64()).truncate();
        relative = relative.max((got.z - truth.z).abs() / distance);
        moved = moved.max(got.distance(truth));
    }
    (relative, moved)
}

/// What rounding allows, relative to the distance. Depth is rounded as clip space is
/// computed (a product and a sum), as it is divided by w (twice), and as it is mapped
/// to the viewport, each by half a unit of the larger of its terms; the two numbers of
/// the projection themselves, and what is computed of the depth (a difference and a
/// quotient), by as much again.
fn allowed(case: &Case, distance: f64) -> f64 {
    let params = CameraParams {
        depth: case.depth,
        ..CameraParams::perspective(1.0, 1.0, NEAR)
    };
    let [bias, slope] = params.depth_bias_slope().as_dvec2().to_array();
    let largest = bias.abs().max(slope.abs() / distance);
    let end = f64::from(params.distance_range().y);
    if distance > 0.95 * end {
        // Within a few roundings of the far plane: taken for background, at no
        // distance.
        return 1.0;
    }
    10.0 * 0.5 * f64::from(f32::EPSILON) * largest * distance / slope.abs()
}

const DISTANCES: [f64; 3] = [1.0, 99.0, 9990.0];

const RANGES: [(&str, DepthRange); 6] = [
    ("reversed, infinite", DepthRange::ReversedInfinite),
    ("reversed, far 10,000 m", DepthRange::Reversed { far: 1e4 }),
    ("reversed, far 100 m", DepthRange::Reversed { far: 100.0 }),
    ("standard, infinite", DepthRange::StandardInfinite),
    ("standard, far 10,000 m", DepthRange::Standard { far: 1e4 }),
    ("standard, far 100 m", DepthRange::Standard { far: 100.0 }),
];

fn reaches(depth: DepthRange, metres: f64) -> bool {
    match depth {
        DepthRange::Reversed { far } | DepthRange::Standard { far } => metres < f64::from(far),
        DepthRange::ReversedInfinite | DepthRange::StandardInfinite => true,
    }
}

/// Prints the table of `docs/measurements/position-from-depth.md`.
#[test]
fn positions_are_as_far_off_as_depth_is_rounded() {
    for executor in &mut executors() {
        println!("\n{}\n", executor.info());
        println!("| Depth, near 0.1 m | 1 m | 99 m | 9990 m |\n| --- | ---: | ---: | ---: |");
        for (name, depth) in RANGES {
            let mut row = format!("| {name} |");
            for metres in DISTANCES {
                if !reaches(depth, metres) {
                    row += " – |";
                    continue;
                }
                let case = Case {
                    metres,
                    depth,
                    told: 1.0,
                };
                let (relative, moved) = errors(executor.as_mut(), &case);
                if relative == 1.0 {
                    row += " background |";
                } else {
                    row += &format!(" {:.1e} % ({moved:.1e} m) |", relative * 100.0);
                }
                let allowed = allowed(&case, metres);
                let who = format!("{name}, {metres} m on {}", executor.info());
                assert!(relative <= allowed, "{who}: {relative} over {allowed}");
                if depth == DepthRange::default() {
                    assert!(relative < 1e-3, "{who}: {relative}");
                }
            }
            println!("{row}");
        }
    }
}

/// The comparison must be able to fail: a kernel that is told another near plane.
#[test]
fn a_near_plane_that_is_a_thousandth_off_is_found() {
    let case = |told| Case {
        metres: 1.0,
        depth: DepthRange::default(),
        told,
    };
    let mut executors = executors();
    let executor = executors[0].as_mut();
    let (right, _) = errors(executor, &case(1.0));
    let (wrong, _) = errors(executor, &case(1.001));
    let allowed = allowed(&case(1.0), 1.0);
    assert!(
        right <= allowed && wrong > allowed,
        "{right}, {wrong}, {allowed}"
    );
}
