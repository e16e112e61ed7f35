//! Searches along mirror rays against the exhaustive one.

use etalon_core::Format;
use etalon_core::image::ImageData;
use etalon_core::resource::TextureDesc;
use etalon_effects::hiz::{Build, pyramid};
use etalon_effects::ssr::truth::claim::Claims;
use etalon_effects::ssr::truth::{TrueHit, hits};
use etalon_effects::ssr::{Search, Ssr, march};
use etalon_effects::truth::Plane;
use etalon_effects::{CameraParams, DepthRange};
use glam::{DVec2, Vec2, Vec3};

use crate::common::{PLAIN_SSR, Run, hash, image, texels};

/// A screen to be searched.
struct Screen {
    depth: ImageData,
    normal: ImageData,
    camera: CameraParams,
}

fn share(seed: u32) -> f32 {
    (hash(seed) >> 8) as f32 / (1 << 24) as f32
}

impl Screen {
    fn size(&self) -> [u32; 2] {
        [self.depth.desc.extent.width, self.depth.desc.extent.height]
    }

    fn of(
        size: [u32; 2],
        camera: CameraParams,
        seen: impl Fn(u32, u32) -> (Option<f32>, Vec3),
    ) -> Self {
        let [bias, slope] = camera.depth_bias_slope().to_array();
        let cleared = bias + slope / 1e13;
        let depth = image(Format::R32Float, size[0], size[1], |x, y| {
            let depth = seen(x, y)
                .0
                .map_or(cleared, |distance| bias + slope / distance);
            [depth, 0.0, 0.0, 0.0]
        });
        let normal = image(Format::Rgba32Float, size[0], size[1], |x, y| {
            seen(x, y).1.extend(0.0).to_array()
        });
        Self {
            depth,
            normal,
            camera,
        }
    }

    /// Blocks at all distances, their texels' normals every which way toward the eye, and
    /// holes: no two texels next to each other need have anything to do with each other.
    fn random(seed: u32) -> Self {
        let size = [1 + hash(seed) % 90, 1 + hash(seed ^ 1) % 70];
        let ranges = [
            DepthRange::ReversedInfinite,
            DepthRange::StandardInfinite,
            DepthRange::Reversed { far: 300.0 },
            DepthRange::Standard { far: 300.0 },
        ];
        let camera = CameraParams {
            depth: ranges[(hash(seed ^ 2) % 4) as usize],
            centre: Vec2::new(share(seed ^ 3) - 0.5, share(seed ^ 4) - 0.5),
            ..CameraParams::perspective(0.3 + 2.0 * share(seed ^ 5), 1.3, 0.1)
        };
        let block = 1 + hash(seed ^ 6) % 9;
        let slope = 0.2 * (share(seed ^ 7) - 0.5);
        Self::of(size, camera, |x, y| {
            let own = hash(seed ^ hash((x / block) ^ hash(y / block)));
            let texel = hash(seed ^ hash(x ^ hash(!y)));
            let distance = 0.5 + 8.0 * share(own) + slope * (x + y) as f32 * share(own ^ 1);
            let turn = std::f32::consts::TAU * share(texel ^ 3);
            // Toward the eye more often than not, and along an axis at times.
            let mut out = Vec3::new(turn.cos(), turn.sin(), 2.0 * share(texel ^ 4) - 0.4);
            match texel % 8 {
                0 => out = Vec3::new(1.0, 0.0, 0.3),
                1 => out = Vec3::new(0.0, -1.0, 0.3),
                2 => out = Vec3::new(0.0, 1e-12, 1.0),
                _ => {}
            }
            let surface = !own.is_multiple_of(7);
            (surface.then_some(distance.max(0.11)), out)
        })
    }

    fn marched(&self, settings: &Ssr) -> Vec<[f32; 4]> {
        let mut run = Run::new();
        let depth = run.import("depth", &self.depth);
        let normal = run.import("normal", &self.normal);
        let result = march(&mut run.graph, depth, normal, &self.camera, settings).unwrap();
        texels(&run.output(result))
    }

    /// As [`Search::HiZ`], over so many levels of the pyramid.
    fn over_levels(
        &self,
        settings: &Ssr,
        levels: u32,
        kernel: Option<(&str, &str)>,
    ) -> Vec<[f32; 4]> {
        let mut run = Run::new();
        if let Some((line, other)) = kernel {
            let source = run.kernels.source("hiz/single").unwrap().to_string();
            let replaced = source.replace(line, other);
            assert_ne!(source, replaced);
            run.kernels.add_source("hiz/single", &replaced);
        }
        let depth = run.import("depth", &self.depth);
        let normal = run.import("normal", &self.normal);
        let camera = &self.camera;
        let made = pyramid(&mut run.graph, depth, camera, Build::SinglePass).unwrap();
        let [width, height] = self.size();
        let desc = TextureDesc::d2(width, height, Format::Rgba32Float);
        let result = run.graph.texture("found", desc);
        let result = run
            .graph
            .compute("ssr/march")
            .feature("hiz", true)
            .read("depth", depth)
            .read("normal", normal)
            .read("pyramid", made.texture)
            .write("result", result)
            .set("levels", levels.min(made.layout.levels()))
            .set("projection_scale", camera.scale)
            .set("projection_centre", camera.centre)
            .set("depth_bias_slope", camera.depth_bias_slope())
            .set("distance_range", camera.distance_range())
            .set("max_distance", settings.max_distance)
            .set("thickness", settings.thickness)
            .set("max_steps", settings.march_limit)
            .set("camera_fade", settings.camera_fade)
            .set("depth_fade", settings.depth_fade)
            .set("distance_fade", settings.distance_fade)
            .set("border", settings.border)
            .per_texel("result")
            .unwrap();
        texels(&run.output(result))
    }

    fn planes(&self) -> [Plane; 2] {
        [&self.depth, &self.normal].map(|image| Plane::of(image).unwrap())
    }

    fn truth(&self, settings: &Ssr) -> Vec<Option<TrueHit>> {
        let [depth, normal] = self.planes();
        hits(&depth, &normal, &self.camera, settings).unwrap()
    }
}

fn searching(search: Search) -> Ssr {
    Ssr {
        search,
        march_limit: 23_171,
        ..PLAIN_SSR
    }
}

fn bits(texels: &[[f32; 4]]) -> Vec<[u32; 4]> {
    texels.iter().map(|texel| texel.map(f32::to_bits)).collect()
}

/// How hits compare with the true ones.
#[derive(Clone, Copy, Debug, Default)]
struct Agreement {
    texels: usize,
    true_hits: usize,
    /// Found although there is none, not found although there is one, and found more
    /// than a hundredth of a texel from where it is.
    added: usize,
    missed: usize,
    elsewhere: usize,
    /// Found nearer along the ray than the first there is.
    before: usize,
}

impl Agreement {
    fn add(&mut self, truth: &[Option<TrueHit>], found: &[[f32; 4]], size: [u32; 2]) {
        let extent = DVec2::new(size[0].into(), size[1].into());
        for (hit, texel) in truth.iter().zip(found) {
            self.texels += 1;
            self.true_hits += usize::from(hit.is_some());
            match (hit, texel[3] > 0.0) {
                (None, true) => self.added += 1,
                (Some(_), false) => self.missed += 1,
                (Some(hit), true) => {
                    let place = DVec2::new(texel[0].into(), texel[1].into());
                    let apart = ((place - hit.uv) * extent).length();
                    self.elsewhere += usize::from(apart > 0.01);
                    // By more than what f32 makes of a length of these scenes.
                    self.before += usize::from(f64::from(texel[3]) < hit.length * 0.999 - 1e-3);
                }
                (None, false) => {}
            }
        }
    }

    fn differ(&self) -> usize {
        self.added + self.missed + self.elsewhere
    }
}

#[test]
fn larger_squares_change_no_bit_of_what_is_found() {
    let settings = searching(Search::HiZ);
    let mut hits = 0;
    for seed in 0..60 {
        let screen = Screen::random(seed);
        let each = screen.over_levels(&settings, 0, None);
        hits += each.iter().filter(|texel| texel[3] > 0.0).count();
        for levels in [1, 2, 99] {
            let over = screen.over_levels(&settings, levels, None);
            assert_eq!(bits(&each), bits(&over), "seed {seed}, {levels} levels");
        }
        // And that is what the effect does.
        assert_eq!(bits(&each), bits(&screen.marched(&settings)), "seed {seed}");
    }
    assert!(hits > 10_000, "{hits}");
}

#[test]
fn a_pyramid_that_misses_texels_is_caught() {
    let settings = searching(Search::HiZ);
    let fault = (
        "let inside = min(texel, textureDimensions(depth) - 1u);",
        "let inside = min(texel & vec2<u32>(0xfffffffeu), textureDimensions(depth) - 1u);",
    );
    let caught = (0..10).filter(|&seed| {
        let screen = Screen::random(seed);
        let each = screen.over_levels(&settings, 0, None);
        bits(&each) != bits(&screen.over_levels(&settings, 99, Some(fault)))
    });
    assert!(caught.count() > 5);
}

#[test]
fn no_first_crossing_is_missed() {
    let mut all = Agreement::default();
    let mut claimed = 0;
    for seed in 0..200 {
        let screen = Screen::random(1000 + seed);
        let mut settings = searching(Search::HiZ);
        settings.thickness = [0.05, 0.25, 3.0, 1e6][seed as usize % 4];
        let truth = screen.truth(&settings);
        let found = screen.marched(&settings);
        all.add(&truth, &found, screen.size());
        let [depth, normal] = screen.planes();
        let claims = Claims::new(&depth, &normal, &screen.camera, &settings).unwrap();
        let [width, _] = screen.size();
        for (index, texel) in (0_u32..).zip(&found) {
            let at = [index % width, index / width];
            let claim = claims.check(at, texel.map(f64::from));
            assert_eq!(claim, Ok(()), "seed {seed}, {at:?}: {texel:?}");
            claimed += usize::from(texel[3] > 0.0);
        }
    }
    println!("{all:?}, {claimed} claims");
    assert!(all.true_hits > 50_000, "{all:?}");
    assert_eq!(all.differ(), 0, "{all:?}");
}

#[test]
fn looks_at_single_texels_find_most_of_them() {
    // What the ray touches beside the texels looked at is missed, and what is behind it
    // found instead or nothing: on blocks of random distances at their corners.
    let [mut dda, mut refined] = [Agreement::default(); 2];
    for seed in 0..100 {
        let screen = Screen::random(1000 + seed);
        let truth = screen.truth(&searching(Search::Dda));
        for (search, agreement) in [(Search::Dda, &mut dda), (Search::Refined, &mut refined)] {
            let found = screen.marched(&searching(search));
            agreement.add(&truth, &found, screen.size());
        }
    }
    println!("dda: {dda:?}\nrefined: {refined:?}");
    assert!(dda.true_hits > 40_000);
    // What there is not is never found.
    assert_eq!((dda.added, dda.before), (0, 0), "{dda:?}");
    // The ray's whole way through a texel is held against it, not one place on it.
    assert!(dda.missed < refined.missed, "{dda:?} {refined:?}");
}

#[test]
fn a_wall_is_hit_where_the_closed_form_says() {
    // A column of mirrors 4 away, nothing, and a wall from column 20 on. Rays right along
    // x meet one that is nearer by less than the thickness where it begins; rays that also
    // go away from the eye cross the front of one that is farther.
    let camera = CameraParams::perspective(1.2, 1.0, 0.1);
    let side = 64_u32;
    let eye = |x: u32, y: u32| {
        let ndc = |texel: u32| 2.0 * (texel as f32 + 0.5) / side as f32 - 1.0;
        Vec3::new(ndc(x) / camera.scale.x, -ndc(y) / camera.scale.y, -1.0)
    };
    let column = 5;
    for (out, wall) in [(Vec3::X, 3.9), (Vec3::new(1.0, 0.0, -0.5), 5.0)] {
        let screen = Screen::of([side, side], camera, |x, y| {
            let distance = match x {
                5 => Some(4.0),
                20.. => Some(wall),
                _ => None,
            };
            (distance, out.normalize() - eye(x, y).normalize())
        });
        let expected = if out.z < 0.0 {
            let start = 4.0 * eye(column, 32);
            let at = start.x + out.x * (wall - 4.0) / -out.z;
            let u = 0.5 + 0.5 * camera.scale.x * at / wall;
            assert!(u * side as f32 > 21.0, "beyond where the wall begins");
            u
        } else {
            20.0 / side as f32
        };
        for search in [Search::Dda, Search::HiZ] {
            let found = screen.marched(&searching(search));
            let texel = found[(32 * side + column) as usize];
            let error = (texel[0] - expected).abs() * side as f32;
            assert!(error < 1e-3, "{search:?}, {out}: {texel:?} {expected}");
        }
    }
}
