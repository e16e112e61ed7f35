//! Textures that live across frames.

use std::collections::BTreeMap;
use std::sync::Arc;

use ash::vk;
use etalon_core::backend::BackendError;
use etalon_core::format::SampleKind;
use etalon_core::graph::ClearValue;
use etalon_core::plan::{Plan, Usage, UsageSet};
use etalon_core::resource::TextureDesc;

use crate::commands::{Barriers, Commands, Transition};
use crate::device::Device;
use crate::image::{self, Image};
use crate::usage::Shaders;
use crate::{convert, usage};

/// One history: what the last frame wrote, and what this one will.
struct History {
    desc: TextureDesc,
    previous: Arc<Image>,
    current: Arc<Image>,
    /// Whether no frame has written it yet.
    fresh: bool,
}

/// The histories of a backend, by name.
#[derive(Default)]
pub(crate) struct Histories {
    histories: BTreeMap<String, History>,
}

/// The textures of one history in one run.
pub(crate) struct Pair {
    pub(crate) previous: Arc<Image>,
    pub(crate) current: Arc<Image>,
    /// What `previous` is to be filled with first.
    pub(crate) initial: Option<ClearValue>,
}

impl Histories {
    /// The textures of a plan's histories, in the plan's order. Those that do
    /// not exist, or had another shape, are made.
    pub(crate) fn get(
        &mut self,
        device: &Arc<Device>,
        plan: &Plan,
    ) -> Result<Vec<Pair>, BackendError> {
        let mut pairs = Vec::with_capacity(plan.histories.len());
        for planned in &plan.histories {
            let usable = self
                .histories
                .get(&planned.name)
                .is_some_and(|history| history.desc == planned.desc);
            if !usable {
                let make = |role: &str| {
                    let name = format!("{}.{role}", planned.name);
                    Image::new(device, &name, &planned.desc, flags(device, &planned.desc))
                };
                let history = History {
                    desc: planned.desc,
                    previous: make("even")?,
                    current: make("odd")?,
                    fresh: true,
                };
                self.histories.insert(planned.name.clone(), history);
            }
            let Some(history) = self.histories.get(&planned.name) else {
                continue;
            };
            pairs.push(Pair {
                previous: history.previous.clone(),
                current: history.current.clone(),
                initial: history.fresh.then_some(planned.initial),
            });
        }
        Ok(pairs)
    }

    /// Takes note that a plan has been recorded: what it wrote is what the
    /// next reads, and what it does not know is gone.
    pub(crate) fn advance(&mut self, plan: &Plan) {
        self.histories.retain(|name, history| {
            let known = plan.histories.iter().any(|planned| planned.name == *name);
            if known {
                std::mem::swap(&mut history.previous, &mut history.current);
                history.fresh = false;
            }
            known
        });
    }

    /// Forgets everything.
    pub(crate) fn clear(&mut self) {
        self.histories.clear();
    }
}

/// A later plan may use a history in other ways than this one, and its contents
/// must be there then: it may be used in every way that its format allows.
fn flags(device: &Device, desc: &TextureDesc) -> vk::ImageUsageFlags {
    let plain = UsageSet::from(Usage::Sampled)
        .with(Usage::CopySource)
        .with(Usage::CopyTarget);
    let target = match desc.format.sample_kind() {
        SampleKind::Depth => Usage::DepthTarget,
        SampleKind::Float | SampleKind::Sint | SampleKind::Uint => Usage::ColourTarget,
    };
    let mut all = usage::image_flags(plain);
    for more in [Usage::StorageUpdate, target] {
        let with = all | usage::image_flags(more.into());
        if image::check(device, desc, with).is_ok() {
            all = with;
        }
    }
    all
}

/// Fills new histories with their initial values and leaves them at rest.
pub(crate) fn initialise(commands: &Commands<'_>, pairs: &[Pair]) {
    let fresh: Vec<(&Image, ClearValue)> = pairs
        .iter()
        .filter_map(|pair| Some((&*pair.previous, pair.initial?)))
        .collect();
    let (written, rest) = (usage::row(Usage::CopyTarget), usage::row(Usage::Sampled));
    let mut barriers = Barriers::default();
    for (image, _) in &fresh {
        let by = Transition {
            // The image is new, but its memory may be second-hand.
            source: usage::source(UsageSet::EMPTY, Shaders::Computing),
            target: (written.stages, written.access),
            layouts: (vk::ImageLayout::UNDEFINED, written.layout),
        };
        barriers.image(image, convert::whole(&image.desc), by);
    }
    commands.barrier(&mut barriers);
    for (image, value) in &fresh {
        commands.clear_image(image, convert::whole(&image.desc), *value);
        let by = Transition {
            source: (written.stages, written.access),
            target: (rest.stages, rest.access),
            layouts: (written.layout, rest.layout),
        };
        barriers.image(image, convert::whole(&image.desc), by);
    }
    commands.barrier(&mut barriers);
}
