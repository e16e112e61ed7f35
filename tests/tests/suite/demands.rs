//! Demands are never less than what is on the screen: everything is drawn, and every
//! texel looked at.

use std::path::PathBuf;

use etalon::backend::{Backend, Execution};
use etalon::effects::demand::{Demands, Outputs, Region};
use etalon::effects::frame::{Request, Shading};
use etalon::effects::{ChainSettings, demand};
use etalon::graph::Graph;
use etalon::kernel::{Arithmetic, KernelLibrary};
use etalon::plan::Capture;
use etalon_scenes::model::gltf::{GltfOptions, load_gltf};
use etalon_scenes::model::{Model, Moment, Shot};
use etalon_scenes::{Frame, FrameSize, models, scenes};
use etalon_tests::{cpu, plan_for};

/// All that a frame holds, drawn: `transparent` says whether with what is seen through.
fn drawn(
    cpu: &mut dyn Backend,
    kernels: &KernelLibrary,
    shot: &Shot,
    size: FrameSize,
    transparent: bool,
) -> Execution {
    let mut graph = Graph::new();
    let sky = Shot::sky(&mut graph).unwrap();
    let mut request = Request {
        outputs: Outputs::ALL,
        settings: ChainSettings::default(),
        ..Request::default()
    };
    if !transparent {
        request.demands.transparent = None;
    }
    shot.frame(
        &mut graph,
        size,
        sky,
        Shading::Forward,
        1.0 / 60.0,
        &request,
    )
    .unwrap();
    let plan = plan_for(cpu, &graph, kernels, Arithmetic::Strict, Capture::Outputs).unwrap();
    cpu.execute(&plan, &shot.inputs()).unwrap()
}

/// What every texel has.
struct Screen {
    size: [u32; 2],
    near: f64,
    depth: Vec<[f32; 4]>,
    specular: Vec<[f32; 4]>,
    velocity: Vec<[f32; 4]>,
    light: Vec<[f32; 4]>,
    opaque_light: Vec<[f32; 4]>,
}

impl Screen {
    fn of_shot(shot: &Shot, size: FrameSize) -> Self {
        let mut cpu = cpu().unwrap();
        let kernels = etalon::effects::kernels();
        let all = drawn(cpu.as_mut(), &kernels, shot, size, true);
        let opaque = drawn(cpu.as_mut(), &kernels, shot, size, false);
        let texels = |of: &Execution, name: &str| of.output(name).unwrap().to_rgba_f32().unwrap();
        Self {
            size: [size.width(), size.height()],
            near: shot.camera().projection(size).unwrap().near(),
            depth: texels(&all, "depth"),
            specular: texels(&all, "specular"),
            velocity: texels(&all, "velocity"),
            light: texels(&all, "light"),
            opaque_light: texels(&opaque, "light"),
        }
    }

    fn of_frame(frame: &Frame) -> Self {
        let texels = |name: &str| frame.image(name).unwrap().to_rgba_f32().unwrap();
        Self {
            size: [frame.size().width(), frame.size().height()],
            near: frame.camera.projection.near(),
            depth: texels("depth"),
            specular: texels("specular"),
            velocity: texels("velocity"),
            light: texels("colour"),
            opaque_light: texels("colour"),
        }
    }

    /// The first texel that has something which `demands` does not admit, in words.
    fn check(&self, demands: &Demands) -> Result<(), String> {
        for index in 0..self.depth.len() {
            let at = [index as u32 % self.size[0], index as u32 / self.size[0]];
            let within = |what: &str, region: Option<Region>| {
                let inside = region.is_some_and(|region| {
                    let [first, end] = region.texels(self.size);
                    (0..2).all(|axis| (first[axis]..end[axis]).contains(&at[axis]))
                });
                match inside {
                    true => Ok(()),
                    false => Err(format!("{what} at {at:?}, outside of {region:?}")),
                }
            };
            if self.depth[index][0] != 0.0 {
                within("a surface", demands.surfaces)?;
            }
            let [r, g, b, shininess] = self.specular[index];
            let specular = r.max(g).max(b);
            if specular > 0.0 {
                within("a mirror", demands.reflective.map(|mirror| mirror.region))?;
                let mirror = demands.reflective.ok_or("a mirror")?;
                let [smoothest, roughest] = mirror.roughness;
                let roughness = 1.0 - shininess;
                if specular > mirror.specular || !(smoothest..=roughest).contains(&roughness) {
                    return Err(format!(
                        "{specular} is mirrored by a roughness of {roughness} at {at:?}: {mirror:?}"
                    ));
                }
                let depth = f64::from(self.depth[index][0]);
                let distance = if depth > 0.0 && depth.is_finite() {
                    self.near / depth
                } else {
                    // No surface is there.
                    f64::INFINITY
                };
                // Both are rounded to f32.
                if distance < (1.0 - 1e-6) * f64::from(mirror.nearest) {
                    return Err(format!("a mirror at {distance} at {at:?}: {mirror:?}"));
                }
            }
            // Bits, as some are no numbers.
            let bits = |light: &[[f32; 4]]| light[index].map(f32::to_bits);
            if bits(&self.light) != bits(&self.opaque_light) {
                within("something seen through", demands.transparent)?;
            }
            // As kernels read it.
            let brightest = self.light[index][..3].iter().fold(0.0_f32, |most, &x| {
                if x > most { x.min(65_504.0) } else { most }
            });
            let known = demands
                .bright
                .map_or((0.0, 0.0), |light| (light.peak, light.floor));
            if brightest > known.0 {
                return Err(format!("light of {brightest} at {at:?}: {known:?}"));
            }
            if brightest > known.1 {
                within("light", demands.bright.map(|light| light.region))?;
            }
            let [u, v, ..] = self.velocity[index];
            // Positions are rounded to f32 and velocity to a half float: what stands
            // still may seem to move by a hundredth of a texel.
            let still = [u * self.size[0] as f32, v * self.size[1] as f32];
            if still
                .iter()
                .any(|moved| moved.is_nan() || moved.abs() > 0.01)
            {
                within("motion", demands.moving.and_then(|moving| moving.region()))?;
            }
        }
        Ok(())
    }
}

fn sizes() -> [FrameSize; 2] {
    [(96, 54), (33, 61)].map(|(width, height)| FrameSize::new(width, height).unwrap())
}

fn demands(shot: &Shot, size: FrameSize) -> Demands {
    let sky = Shot::sky(&mut Graph::new()).unwrap();
    shot.demands(size, &sky).unwrap()
}

fn check_model(name: &str, model: &Model, times: &[f64]) {
    for size in sizes() {
        for &time in times {
            let shot = Shot::new(model.clone(), time).unwrap();
            let demands = demands(&shot, size);
            demands.validate().unwrap();
            let screen = Screen::of_shot(&shot, size);
            if let Err(what) = screen.check(&demands) {
                panic!("{name} at {time} s, {size:?}: {what}");
            }
        }
    }
}

#[test]
fn models_hold_no_more_than_they_say() {
    for entry in models() {
        let model = (entry.build)().unwrap();
        check_model(entry.name, &model, &[0.0, 0.5, 1.75]);
    }
}

#[test]
fn models_of_files_hold_no_more_than_they_say() {
    let Some(folder) = std::env::var_os("ETALON_INPUTS").map(PathBuf::from) else {
        eprintln!("skipped: ETALON_INPUTS is not set");
        return;
    };
    let mut files = Vec::new();
    for entry in std::fs::read_dir(folder.join("gltf")).unwrap() {
        for file in std::fs::read_dir(entry.unwrap().path()).unwrap() {
            let path = file.unwrap().path();
            if path
                .extension()
                .is_some_and(|ending| ending == "gltf" || ending == "glb")
            {
                files.push(path);
            }
        }
    }
    files.sort();
    assert!(!files.is_empty());
    for path in files {
        let model = load_gltf(&path, &GltfOptions::default()).unwrap();
        check_model(&path.display().to_string(), &model, &[0.3]);
    }
}

/// A camera that stands still, so that what moves is bounded by itself.
#[test]
fn what_moves_before_a_still_camera_is_bounded() {
    use etalon_scenes::model::{
        Animation, Interpolation, Material, ModelParts, Node, Track, Transform, Values, Viewpoint,
        shapes,
    };
    use etalon_scenes::{Camera, Pose};
    let mut parts = ModelParts::default();
    let ball = parts.mesh(shapes::icosphere("ball", 0.4, 2).unwrap());
    let matte = parts.material(Material {
        ior: 1.0,
        ..Material::dielectric("matte", [0.5; 3], 0.9)
    });
    parts.node(Node::with_part(
        "still",
        Transform::at([1.5, 0.0, -4.0]),
        ball,
        matte,
    ));
    let moving = parts.node(Node::with_part("moving", Transform::default(), ball, matte));
    parts.animations.push(Animation {
        name: "to the right".into(),
        tracks: vec![Track {
            node: moving,
            times: vec![0.0, 1.0],
            interpolation: Interpolation::Linear,
            values: Values::Translation(vec![[-2.0, 0.0, -4.0], [0.0, 0.5, -3.0]]),
        }],
    });
    let pose = Pose::look_at(glam::DVec3::ZERO, glam::DVec3::NEG_Z, glam::DVec3::Y);
    let camera = Camera::new(pose.unwrap(), 1.0).unwrap();
    parts.viewpoints.push(Viewpoint::Fixed(camera));
    let model = Model::new(parts).unwrap();
    check_model("two balls", &model, &[0.25, 0.5]);
    let size = sizes()[0];
    let shot = Shot::new(model.clone(), 0.5).unwrap();
    let found = demands(&shot, size);
    let moving = found.moving.unwrap();
    assert!(!moving.camera);
    let region = moving.objects.unwrap();
    assert!(region.coverage() < 0.25, "{region:?}");
    assert_eq!(
        found.reflective, None,
        "an index of refraction of 1 mirrors nothing"
    );
    assert_eq!(found.transparent, None);
    // Before and after the animation nothing moves.
    let snapshot = model
        .at_moment(Moment {
            animation: Some(0),
            time: 3.0,
            step: 1.0 / 60.0,
        })
        .unwrap();
    let still = |instance: &etalon_scenes::model::Instance| instance.world == instance.previous;
    assert!(snapshot.instances.all().iter().all(still));
    let shot = Shot::new(model, 3.0).unwrap();
    assert_eq!(demands(&shot, size).moving, None);
}

#[test]
fn images_hold_what_they_say_and_that_exactly() {
    let size = FrameSize::new(96, 54).unwrap();
    for entry in scenes() {
        let frame = entry.frame(size).unwrap();
        let demands = frame.demands();
        demands.validate().unwrap();
        let screen = Screen::of_frame(&frame);
        if let Err(what) = screen.check(&demands) {
            panic!("{}: {what}", entry.name);
        }
        // Bounds are tight to the texel's border that rounding costs.
        let mut mirrors = [[u32::MAX; 2], [0; 2]];
        for (index, texel) in screen.specular.iter().enumerate() {
            if texel[..3].iter().any(|&channel| channel > 0.0) {
                let at = [index as u32 % 96, index as u32 / 96];
                for axis in 0..2 {
                    mirrors[0][axis] = mirrors[0][axis].min(at[axis]);
                    mirrors[1][axis] = mirrors[1][axis].max(at[axis] + 1);
                }
            }
        }
        if let Some(mirror) = demands.reflective {
            let mirrors = screen.specular.iter().zip(&screen.depth);
            let depth = mirrors
                .filter(|(texel, _)| texel[..3].iter().any(|&channel| channel > 0.0))
                .filter(|(_, depth)| depth[0] > 0.0 && depth[0].is_finite())
                .fold(0.0_f64, |most, (_, depth)| most.max(depth[0].into()));
            let exact = screen.near / depth;
            let nearest = f64::from(mirror.nearest);
            // Quotients next to 0 have few digits in f32.
            let slack = 1e-6 * exact + f64::from(f32::MIN_POSITIVE);
            assert!((nearest - exact).abs() <= slack, "{nearest} {exact}");
        }
        let found = demands
            .reflective
            .map(|mirror| mirror.region.texels([96, 54]));
        if let Some(found) = found {
            for (found, exact) in found.as_flattened().iter().zip(mirrors.as_flattened()) {
                assert!(
                    found.abs_diff(*exact) <= 1,
                    "{}: {found} {exact}",
                    entry.name
                );
            }
        } else {
            assert_eq!(mirrors[1], [0; 2], "{}", entry.name);
        }
    }
}

/// The check above must be able to fail: each demand is made a little less in turn.
#[test]
fn demands_that_say_too_little_are_caught() {
    let model = etalon_scenes::model("gallery").unwrap();
    let shot = Shot::new((model.build)().unwrap(), 0.5).unwrap();
    let size = sizes()[0];
    let full = demands(&shot, size);
    let screen = Screen::of_shot(&shot, size);
    screen.check(&full).unwrap();
    let left = Region::new([0.0, 0.0], [0.3, 1.0]);
    type Plant = (&'static str, fn(&mut Demands, Region));
    let plants: [Plant; 11] = [
        ("a surface", |demands, left| demands.surfaces = Some(left)),
        ("a surface", |demands, _| demands.surfaces = None),
        ("a mirror", |demands, left| {
            if let Some(mirror) = &mut demands.reflective {
                mirror.region = left;
            }
        }),
        ("a mirror", |demands, _| demands.reflective = None),
        ("is mirrored by", |demands, _| {
            if let Some(mirror) = &mut demands.reflective {
                mirror.specular = 0.3;
            }
        }),
        ("is mirrored by", |demands, _| {
            if let Some(mirror) = &mut demands.reflective {
                mirror.roughness = [0.5, 1.0];
            }
        }),
        ("a mirror at", |demands, _| {
            if let Some(mirror) = &mut demands.reflective {
                mirror.nearest = 100.0;
            }
        }),
        ("seen through", |demands, _| demands.transparent = None),
        ("light of", |demands, _| {
            if let Some(light) = &mut demands.bright {
                light.peak = 0.25;
            }
        }),
        ("light at", |demands, left| {
            if let Some(light) = &mut demands.bright {
                light.region = left;
            }
        }),
        ("motion", |demands, _| demands.moving = None),
    ];
    for (what, plant) in plants {
        let mut planted = full;
        plant(&mut planted, left.unwrap());
        let caught = screen.check(&planted).unwrap_err();
        assert!(caught.contains(what), "{what}: {caught}");
    }
    assert_eq!(
        demand::Demands::everything().union(full),
        Demands::everything()
    );
}
