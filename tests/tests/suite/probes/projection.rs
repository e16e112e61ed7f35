//! Where rays leave boxes: `lib/box_projection` on thousands of rays against six planes in
//! f64.

use etalon::Format;
use etalon::backend::{Backend, Inputs};
use etalon::effects::probes::truth::box_exit;
use etalon::graph::Graph;
use etalon::image::ImageData;
use etalon::kernel::{Arithmetic, KernelLibrary};
use etalon::plan::Capture;
use etalon::resource::TextureDesc;
use etalon_tests::{executors, plan_for};
use glam::{DVec3, Vec3};

const KERNEL: &str = "
import package::lib::box_projection::{box_exit, box_projected};

struct Params {
    half: vec3<f32>,
    capture: vec3<f32>,
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var points: texture_2d<f32>;
@group(0) @binding(2) var ways: texture_2d<f32>;
@group(0) @binding(3) var exits: texture_storage_2d<rgba32float, write>;
@group(0) @binding(4) var seen: texture_storage_2d<rgba32float, write>;

@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    let extent = textureDimensions(exits);
    if (id.x >= extent.x || id.y >= extent.y) {
        return;
    }
    let point = textureLoad(points, id.xy, 0).xyz;
    let way = textureLoad(ways, id.xy, 0).xyz;
    textureStore(exits, id.xy, vec4<f32>(box_exit(point, way, params.half), 0.0));
    textureStore(seen, id.xy, vec4<f32>(box_projected(point, way, params.half, params.capture), 0.0));
}
";

const SIDE: u32 = 96;

/// A number that looks random: C. Wellons, "Prospecting for Hash Functions", 2018, the
/// hash `lowbias32`.
fn hash(mut x: u32) -> u32 {
    x ^= x >> 16;
    x = x.wrapping_mul(0x7feb_352d);
    x ^= x >> 15;
    x = x.wrapping_mul(0x846c_a68b);
    x ^ (x >> 16)
}

/// A number in `[0, 1)` that looks random.
fn share(seed: u32) -> f32 {
    (hash(seed) >> 8) as f32 / (1 << 24) as f32
}

/// A coordinate of a point by its number: within the box, on a side or next to one, or far
/// outside.
fn coordinate(half: f32, seed: u32) -> f32 {
    let sign = if hash(seed ^ 0x55) & 1 == 0 {
        1.0
    } else {
        -1.0
    };
    let next = |by: i32| f32::from_bits(half.to_bits().wrapping_add_signed(by));
    sign * match hash(seed ^ 0xaa) % 12 {
        0 => 0.0,
        1 => half,
        2 if half > 0.0 => next(1),
        3 if half > 0.0 => next(-1),
        4 => 1.5 * half,
        5 => 1e30,
        6 => 1e-30,
        7 => f32::from_bits(1),
        _ => half * share(seed),
    }
}

/// A part of a way by its number: any, none, or one that divides into more than f32 holds.
fn part(seed: u32) -> f32 {
    let sign = if hash(seed ^ 0x33) & 1 == 0 {
        1.0
    } else {
        -1.0
    };
    sign * match hash(seed ^ 0xcc) % 8 {
        0 => 0.0,
        1 => f32::from_bits(1 + hash(seed) % 100),
        2 => 1e-25,
        3 => 1e-6 * share(seed),
        5 => 1e-31,
        4 => 1.0,
        _ => share(seed),
    }
}

fn vectors(of: impl Fn(usize, u32) -> f32) -> Vec<Vec3> {
    let vector = |index: u32| {
        Vec3::from(std::array::from_fn(|axis| {
            of(axis, 3 * index + axis as u32)
        }))
    };
    (0..SIDE * SIDE).map(vector).collect()
}

fn image(vectors: &[Vec3]) -> ImageData {
    let texels: Vec<_> = vectors.iter().map(|v| v.extend(0.0).to_array()).collect();
    ImageData::from_rgba_f32(TextureDesc::d2(SIDE, SIDE, Format::Rgba32Float), &texels).unwrap()
}

struct Found {
    exits: Vec<DVec3>,
    seen: Vec<DVec3>,
    images: [ImageData; 2],
}

fn run(
    executor: &mut dyn Backend,
    kernels: &KernelLibrary,
    [points, ways]: [&ImageData; 2],
    half: Vec3,
    capture: Vec3,
) -> Found {
    let mut graph = Graph::new();
    let [from, along] = [("points", points), ("ways", ways)]
        .map(|(name, image)| graph.import_texture(name, image.desc).unwrap());
    let [exits, seen] = ["exits", "seen"].map(|name| graph.texture(name, points.desc));
    let written = graph
        .compute("rays")
        .read("points", from)
        .read("ways", along)
        .write("exits", exits)
        .write("seen", seen)
        .set("half", half)
        .set("capture", capture)
        .per_texel_of("exits")
        .unwrap();
    for name in ["exits", "seen"] {
        graph.output(name, written.texture(name).unwrap()).unwrap();
    }
    let (strict, outputs) = (Arithmetic::Strict, Capture::Outputs);
    let plan = plan_for(executor, &graph, kernels, strict, outputs).unwrap();
    let inputs = Inputs::new()
        .texture("points", points)
        .texture("ways", ways);
    let execution = executor.execute(&plan, &inputs).unwrap();
    let vectors = |name: &str| -> Vec<DVec3> {
        let texels = execution.output(name).unwrap().to_rgba_f32().unwrap();
        texels
            .iter()
            .map(|t| Vec3::new(t[0], t[1], t[2]).as_dvec3())
            .collect()
    };
    Found {
        exits: vectors("exits"),
        seen: vectors("seen"),
        images: ["exits", "seen"].map(|name| execution.output(name).unwrap().clone()),
    }
}

fn unit(x: f64) -> f64 {
    f64::from(((x.max(f64::from(f32::MIN_POSITIVE)).to_bits() >> 52) as i32) - 1023 - 23).exp2()
}

/// How many rays are off, and the worst of them in ulps of the box. What is seen is held
/// to the exit that was found: its own rounding is that of a difference and a unit vector.
fn wrong(found: &Found, points: &[Vec3], ways: &[Vec3], half: Vec3, capture: Vec3) -> (usize, f64) {
    let (mut wrong, mut worst) = (0, 0_f64);
    let half = half.as_dvec3();
    for (index, exit) in found.exits.iter().enumerate() {
        let (point, way) = (points[index].as_dvec3(), ways[index].as_dvec3());
        // So little of a way counts as none.
        let way = DVec3::select(
            way.abs().cmpgt(DVec3::splat(2_f64.powi(-100))),
            way,
            DVec3::ZERO,
        );
        let exact = box_exit(point, way, half);
        let off = (*exit - exact).abs();
        let ulps = (0..3)
            .map(|axis| off[axis] / unit(half[axis]))
            .fold(0.0, f64::max);
        let apart = *exit - capture.as_dvec3();
        let far = apart.length() > 1e-3;
        // A way is looked along that has a length of 1: here it is any.
        let seen = !far || (found.seen[index] - apart.normalize()).length() < 1e-6;
        // Written so that NaN is wrong.
        let right = ulps <= 8.0 && seen && found.seen[index].is_finite();
        worst = worst.max(ulps);
        wrong += usize::from(!right);
    }
    (wrong, worst)
}

#[test]
fn rays_leave_boxes_where_f64_says() {
    let mut kernels = etalon::effects::kernels();
    kernels.add_source("rays", KERNEL);
    let mut planted = etalon::effects::kernels();
    planted.add_source("rays", KERNEL);
    let source = planted.source("lib/box_projection").unwrap().to_string();
    // As it is often written: dividing whatever there is to divide by, from outside as well.
    let naive = source
        .replace(
            "let inside = min(max(point, -half), half);",
            "let inside = point;",
        )
        .replace(
            "apart / select(vec3<f32>(1.0), speed, met), met)",
            "apart / speed, true)",
        );
    assert_ne!(source, naive);
    planted.add_source("lib/box_projection", &naive);
    let mut executors = executors();
    let boxes = [
        (Vec3::new(2.0, 1.0, 0.5), Vec3::new(0.5, -0.25, 0.125)),
        (Vec3::new(1e3, 1e-3, 5.0), Vec3::new(-999.0, 0.0, 4.999)),
        (Vec3::new(3.0, 0.0, 2.0), Vec3::ZERO),
        (Vec3::splat(1_048_576.0), Vec3::splat(1_048_576.0)),
        (Vec3::ZERO, Vec3::ZERO),
    ];
    for (number, (half, capture)) in (0..).zip(boxes) {
        let seed = |k: u32| k ^ (number * 0x0100_0193);
        let points = vectors(|axis, k| coordinate(half[axis], seed(k)));
        let mut ways = vectors(|_, k| part(seed(k) ^ 0x8000_0000));
        for (k, way) in ways.iter_mut().enumerate() {
            // Of a size that is taken, but for some that go nowhere.
            if way.abs().max_element() < 2_f32.powi(-20) && k % 16 != 0 {
                way[k % 3] = 1.0;
            } else if k % 16 == 0 && way.abs().max_element() < 2_f32.powi(-20) {
                *way = Vec3::ZERO;
            }
        }
        let images = [&image(&points), &image(&ways)];
        let mut first: Option<[ImageData; 2]> = None;
        for executor in &mut executors {
            let found = run(executor.as_mut(), &kernels, images, half, capture);
            let (off, worst) = wrong(&found, &points, &ways, half, capture);
            println!("{half} on {}: {worst} ulp at most", executor.info());
            assert_eq!(off, 0, "{half} on {}: {worst} ulp", executor.info());
            // But for what is left of subnormal numbers, which a device may take for 0.
            let first = first.get_or_insert_with(|| found.images.clone());
            for (a, b) in first.iter().zip(&found.images) {
                let (a, b) = (a.to_rgba_f32().unwrap(), b.to_rgba_f32().unwrap());
                let mut pairs = a.iter().flatten().zip(b.iter().flatten());
                let same = pairs.all(|(a, b)| a == b || (a - b).abs() <= 1e-30);
                assert!(same, "{half} on {}", executor.info());
            }
        }
        if half == Vec3::ZERO {
            // There is nowhere else to be.
            continue;
        }
        let found = run(executors[0].as_mut(), &planted, images, half, capture);
        let (off, _) = wrong(&found, &points, &ways, half, capture);
        assert!(off > 100, "only {off} rays of the plant are wrong");
    }
}
