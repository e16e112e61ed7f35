//! A frame of what is called for: no pass that nothing on the screen asks for.
//!
//! [`of_images`] begins with images that an engine has drawn, [`of_geometry`] draws
//! them. Both put every decision into the graph, so that the plan can tell why each
//! effect is there or is not: see [`demand`](mod@crate::demand).
//!
//! | Decision | of |
//! |---|---|
//! | `geometry/prepass` | depth before anything is shaded |
//! | `geometry/velocity` | velocity beside it, and the pass that fills in the camera's |
//! | `geometry/gbuffer` | the G-buffer |
//! | `forward/thin` | normals and specular colour beside light that is drawn |
//! | `lighting`, `forward/opaque` | the light of opaque surfaces, by either way |
//! | `forward/glass` | what is seen through |
//! | `probes` | light captured nearby |
//! | `ssr/fallback` | surroundings in reflections where the screen has no answer |
//! | `ssr`, `exposure`, `bloom`, `composite` | the effects on the screen |

use etalon_core::graph::{Decision, Graph, Texture};

use crate::demand::{Calls, Demands, Outputs, Thresholds};
use crate::environment::{Mirrored, Surroundings};
use crate::forward::{Lamps, Lighting, forward, glass};
use crate::geometry::{Geometry, Item, View, gbuffer, prepass};
use crate::lighting::{PunctualLight, lighting};
use crate::registry::effect;
use crate::tiles::Tiling;
use crate::{
    Beyond, Chain, ChainSettings, EffectError, SceneInputs, chain, forward as forward_module,
    geometry, lighting as lighting_module, ssr,
};

/// What is asked of a frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Request {
    /// What is on the screen.
    pub demands: Demands,
    /// What is asked for. Each that can be had is an output of the graph under its
    /// field's name.
    pub outputs: Outputs,
    /// The effects that are on.
    pub settings: ChainSettings,
    /// What is worth an effect.
    pub thresholds: Thresholds,
}

impl Default for Request {
    /// A picture with every effect, of a frame that may hold anything.
    fn default() -> Self {
        Self {
            demands: Demands::everything(),
            outputs: Outputs::PICTURE,
            settings: ChainSettings::full(),
            thresholds: Thresholds::default(),
        }
    }
}

impl Request {
    fn calls(&self) -> Calls<'_> {
        Calls {
            demands: &self.demands,
            outputs: &self.outputs,
            settings: &self.settings,
            thresholds: &self.thresholds,
        }
    }

    fn validate(&self) -> Result<(), EffectError> {
        self.demands.validate()?;
        self.thresholds.validate()?;
        Ok(self.settings.validate()?)
    }

    /// What is decided of the effects on the screen, by name, in the order they run.
    #[must_use]
    pub fn decisions(&self) -> Vec<(&'static str, Decision)> {
        let calls = self.calls();
        ["ssr", "exposure", "bloom", "composite"]
            .into_iter()
            .filter_map(|name| Some((name, effect(name)?.decide(&calls))))
            .collect()
    }

    /// Notes the decisions in a graph.
    fn note(&self, graph: &mut Graph) {
        for (effect, decision) in self.decisions() {
            graph.decide(effect, decision);
        }
        let (Some(asked), Some(suited)) = (self.settings.ssr, self.called_for().ssr) else {
            return;
        };
        if suited.blur_radius < asked.blur_radius {
            let reason = "all that mirrors is perfectly smooth";
            graph.decide("ssr/blur", Decision::absent(reason));
        }
        if let Some(reason) = ssr::demand::other_rate(&asked, &suited, &self.calls()) {
            let decision = if suited.quarter_from == 0.0 {
                Decision::runs(reason)
            } else {
                Decision::absent(reason)
            };
            graph.decide("ssr/quarter", decision);
        }
        if suited.tiles != asked.tiles {
            let reason = "so much of the screen mirrors that tiles would cost more than they save";
            graph.decide("ssr/classify", Decision::absent(reason));
        }
        if suited.tiles != Tiling::Off {
            graph.decide("tiles", Decision::runs("`ssr` runs on lists of them"));
        }
    }

    /// The settings with off what nothing calls for, and without what nothing calls
    /// for within an effect: a graph with these is the graph of the frame.
    #[must_use]
    pub fn called_for(&self) -> ChainSettings {
        let runs = |name: &str| {
            let calls = self.calls();
            effect(name).is_some_and(|effect| effect.decide(&calls).is_run())
        };
        let settings = self.settings;
        ChainSettings {
            ssr: settings
                .ssr
                .filter(|_| runs("ssr"))
                .map(|settings| ssr::demand::suited(&settings, &self.demands, &self.thresholds)),
            exposure: settings.exposure.filter(|_| runs("exposure")),
            bloom: settings.bloom.filter(|_| runs("bloom")),
            composite: settings.composite,
        }
    }
}

/// How opaque surfaces are lit.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Shading {
    /// As they are drawn.
    #[default]
    Forward,
    /// From a G-buffer.
    Deferred,
}

/// What a frame is drawn from.
#[derive(Clone, Copy, Debug)]
pub struct Drawables<'a> {
    /// What is opaque, in any order.
    pub opaque: &'a [Item],
    /// What is seen through, from far to near.
    pub blended: &'a [Item],
    /// Who looks.
    pub view: View,
    /// Pixels of the picture in x and y.
    pub size: [u32; 2],
    /// Lights without extent.
    pub lights: &'a [PunctualLight],
    /// The same in a buffer, for what is lit as it is drawn.
    pub lamps: Option<Lamps>,
    /// Light from everywhere.
    pub surroundings: Surroundings,
    /// How opaque surfaces are lit.
    pub shading: Shading,
    /// Seconds since the frame before, in `[0, 1e6]`.
    pub delta_time: f32,
}

/// What a frame has; `None` is what nobody asked for, nothing calls for or, of images,
/// was not given.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Frame {
    /// What the display shows.
    pub picture: Option<Texture>,
    /// Linear light with reflections, before exposure.
    pub light: Option<Texture>,
    /// Device depth.
    pub depth: Option<Texture>,
    /// Normals in view space.
    pub normal: Option<Texture>,
    /// What is mirrored, and 1 − roughness.
    pub specular: Option<Texture>,
    /// Screen position now less that one frame earlier. Where nothing moves there is
    /// none: it would be 0 everywhere.
    pub velocity: Option<Texture>,
}

impl Frame {
    /// Makes outputs of what is asked for and there.
    fn output(self, graph: &mut Graph, asked: &Outputs) -> Result<Self, EffectError> {
        let mut kept = Self::default();
        for (name, asked, texture, kept) in [
            ("picture", asked.picture, self.picture, &mut kept.picture),
            ("light", asked.light, self.light, &mut kept.light),
            ("depth", asked.depth, self.depth, &mut kept.depth),
            ("normal", asked.normal, self.normal, &mut kept.normal),
            (
                "specular",
                asked.specular,
                self.specular,
                &mut kept.specular,
            ),
            (
                "velocity",
                asked.velocity,
                self.velocity,
                &mut kept.velocity,
            ),
        ] {
            *kept = texture.filter(|_| asked);
            if let Some(texture) = *kept {
                graph.output(name, texture)?;
            }
        }
        Ok(kept)
    }
}

/// Declares the effects that a frame calls for, on images that are there.
///
/// # Errors
/// If a number is out of its range, the inputs do not fit together, or the graph has
/// outputs of these names.
pub fn of_images(
    graph: &mut Graph,
    inputs: &SceneInputs,
    request: &Request,
) -> Result<Frame, EffectError> {
    request.validate()?;
    request.note(graph);
    let (picture, light) = on_screen(graph, inputs, request)?;
    let frame = Frame {
        picture,
        light,
        depth: Some(inputs.depth),
        normal: Some(inputs.normal),
        specular: Some(inputs.specular),
        velocity: inputs.velocity,
    };
    frame.output(graph, &request.outputs)
}

/// The effects on the screen: the picture, and the light it is of.
fn on_screen(
    graph: &mut Graph,
    inputs: &SceneInputs,
    request: &Request,
) -> Result<(Option<Texture>, Option<Texture>), EffectError> {
    let settings = request.called_for();
    if request.outputs.picture {
        let Chain { picture, light, .. } = chain(graph, inputs, &settings)?;
        return Ok((Some(picture), Some(light)));
    }
    let light = match &settings.ssr {
        Some(settings) => ssr::ssr(graph, inputs, settings)?,
        None => inputs.colour,
    };
    Ok((None, Some(light)))
}

/// Declares the passes that a frame calls for, from geometry on.
///
/// # Errors
/// If a number is out of its range, or the graph refuses a pass or has outputs of these
/// names.
pub fn of_geometry(
    graph: &mut Graph,
    drawables: &Drawables<'_>,
    request: &Request,
) -> Result<Frame, EffectError> {
    request.validate()?;
    request.note(graph);
    let parts = Parts::decide(graph, drawables.shading, request);
    let solid = Geometry {
        items: if request.demands.surfaces.is_some() {
            drawables.opaque
        } else {
            &[]
        },
        view: drawables.view,
        size: drawables.size,
    };
    let drawables = &Drawables {
        surroundings: surroundings(graph, drawables, request, &parts),
        ..*drawables
    };
    let lit = Lighting {
        lamps: drawables.lamps,
        surroundings: drawables.surroundings,
    };
    let first = match parts.prepass {
        true => Some(prepass(graph, &solid, parts.velocity)?),
        false => None,
    };
    let mut frame = Frame {
        depth: first.map(|first| first.depth),
        velocity: first.and_then(|first| first.velocity),
        ..Frame::default()
    };
    if parts.gbuffer {
        let surfaces = gbuffer(graph, &solid, first.as_ref())?;
        frame.depth = Some(surfaces.depth);
        frame.normal = Some(surfaces.normal);
        frame.specular = Some(surfaces.specular);
        if parts.lighting {
            let (view, around) = (&drawables.view, &drawables.surroundings);
            frame.light = Some(lighting(graph, view, &surfaces, drawables.lights, around)?);
        }
    }
    if parts.forward {
        let shaded = forward(graph, &solid, first.as_ref(), &lit, parts.thin)?;
        frame.light = Some(shaded.light);
        frame.depth = Some(shaded.depth);
        if let Some(thin) = shaded.thin {
            frame.normal = Some(thin.normal);
            frame.specular = Some(thin.specular);
        }
    }
    if let (true, Some(light), Some(depth)) = (parts.glass, frame.light, frame.depth) {
        let panes = Geometry {
            items: drawables.blended,
            ..solid
        };
        frame.light = Some(glass(graph, &panes, light, depth, &lit)?);
    }
    if let Some(colour) = frame.light {
        (frame.picture, frame.light) = finish(graph, drawables, request, colour, &frame)?;
    }
    frame.output(graph, &request.outputs)
}

/// What of the surroundings is called for: probes only where surfaces are lit, and nothing
/// is left for reflections on the screen to mirror where there are none.
fn surroundings(
    graph: &mut Graph,
    drawables: &Drawables<'_>,
    request: &Request,
    parts: &Parts,
) -> Surroundings {
    let asked = drawables.surroundings;
    let lit = parts.lighting || parts.forward || parts.glass;
    let decision = match (asked.probes, lit) {
        (None, _) => Decision::absent("there are none"),
        (Some(_), false) => Decision::absent("no surface is lit"),
        (Some(probes), true) => Decision::runs(format!("{} light surfaces", probes.count)),
    };
    let probes = asked.probes.filter(|_| decision.is_run());
    graph.decide("probes", decision);
    let mirrored = match request.called_for().ssr {
        Some(_) => asked.mirrored,
        None => Mirrored::Lit,
    };
    if asked.mirrored == Mirrored::Reflected {
        graph.decide(
            "ssr/fallback",
            match mirrored {
                Mirrored::Reflected => {
                    Decision::runs("reflections show surroundings where the screen has no answer")
                }
                Mirrored::Lit => Decision::absent(
                    "there are no reflections: light from everywhere is mirrored as it lights",
                ),
            },
        );
    }
    Surroundings {
        probes,
        mirrored,
        ..asked
    }
}

/// The effects on what has been drawn.
fn finish(
    graph: &mut Graph,
    drawables: &Drawables<'_>,
    request: &Request,
    colour: Texture,
    drawn: &Frame,
) -> Result<(Option<Texture>, Option<Texture>), EffectError> {
    if let (Some(depth), Some(normal), Some(specular)) = (drawn.depth, drawn.normal, drawn.specular)
    {
        let inputs = SceneInputs {
            colour,
            depth,
            normal,
            specular,
            velocity: drawn.velocity,
            camera: drawables.view.camera,
            delta_time: drawables.delta_time,
            beyond: beyond(drawables),
        };
        return on_screen(graph, &inputs, request);
    }
    // Nothing of what is left reads more than the light.
    if !request.outputs.picture {
        return Ok((None, Some(colour)));
    }
    let settings = request.called_for();
    let of_light = crate::chain::on_light(graph, colour, drawables.delta_time, &settings)?;
    Ok((Some(of_light.picture), Some(colour)))
}

/// What reflections show beyond the screen, where the light that is drawn is without it.
fn beyond(drawables: &Drawables<'_>) -> Option<Beyond> {
    let surroundings = drawables.surroundings;
    let reflected = surroundings.mirrored == Mirrored::Reflected && surroundings.shine();
    reflected.then_some(Beyond {
        surroundings,
        view: drawables.view.view,
    })
}

/// Which passes draw.
struct Parts {
    prepass: bool,
    velocity: bool,
    gbuffer: bool,
    thin: bool,
    lighting: bool,
    forward: bool,
    glass: bool,
}

impl Parts {
    fn decide(graph: &mut Graph, shading: Shading, request: &Request) -> Self {
        let calls = request.calls();
        let deferred = shading == Shading::Deferred;
        let mut decide = |part: &str, decision: Decision| {
            let runs = decision.is_run();
            graph.decide(part, decision);
            runs
        };
        let prepass = decide("geometry/prepass", geometry::demand::decide(&calls));
        let velocity = decide("geometry/velocity", geometry::demand::velocity(&calls));
        let lighting = decide(
            "lighting",
            lighting_module::demand::decide(&calls, deferred),
        );
        let forward = decide(
            "forward/opaque",
            forward_module::demand::opaque(&calls, deferred),
        );
        let mut readers = Vec::new();
        for (name, decision) in request.decisions() {
            let reads = effect(name).is_some_and(|effect| !effect.needs.is_empty());
            if decision.is_run() && reads {
                readers.push(name);
            }
        }
        for (asked, name) in [
            (request.outputs.normal, "output `normal`"),
            (request.outputs.specular, "output `specular`"),
        ] {
            if asked {
                readers.push(name);
            }
        }
        // Where nothing is lit there is no forward pass to write beside.
        let (gbuffer, thin) = match forward {
            true => (Some("forward/thin"), None),
            false => (None, Some("geometry/gbuffer")),
        };
        if lighting {
            readers.push("lighting");
        }
        let surfaces = |other| geometry::demand::surfaces(&readers, other);
        let gbuffer = decide("geometry/gbuffer", surfaces(gbuffer));
        let thin = decide("forward/thin", surfaces(thin));
        let glass = decide("forward/glass", forward_module::demand::glass(&calls));
        let mut whole = |effect: &str, runs: bool, why: &str, why_not: &str| {
            let decision = if runs {
                Decision::runs(why)
            } else {
                Decision::absent(why_not)
            };
            decide(effect, decision);
        };
        let (some, none) = (
            "some of its passes are called for",
            "none of its passes is called for",
        );
        whole("geometry", prepass || velocity || gbuffer, some, none);
        whole("forward", forward || glass || thin, some, none);
        whole(
            "environment",
            lighting || forward || glass,
            "it lights surfaces",
            "no surface is lit",
        );
        Self {
            prepass,
            velocity,
            gbuffer,
            thin,
            lighting,
            forward,
            glass,
        }
    }
}
