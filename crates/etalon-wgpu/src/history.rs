//! Textures that live across frames.

use std::collections::BTreeMap;

use etalon_core::backend::BackendError;
use etalon_core::graph::Subresources;
use etalon_core::plan::Plan;
use etalon_core::resource::{Dimension, TextureDesc};

use crate::bind::Physical;
use crate::clear::Clear;
use crate::fault::unsupported;
use crate::gpu::Gpu;
use crate::tally::Owned;

/// Two textures of one name, which change roles after each frame.
#[derive(Debug)]
struct History {
    desc: TextureDesc,
    textures: [Owned<wgpu::Texture>; 2],
    /// Which of the two the next frame reads.
    previous: usize,
    /// Whether that one holds anything yet.
    defined: bool,
}

/// The histories that the last plan had, by name.
#[derive(Debug, Default)]
pub(crate) struct Histories(BTreeMap<String, History>);

/// A history's first contents, still to be written.
pub(crate) struct Initial {
    clear: Clear,
    target: Physical,
    desc: TextureDesc,
}

impl Initial {
    /// Writes the first contents.
    pub(crate) fn record(&self, encoder: &mut wgpu::CommandEncoder) {
        if let Some(part) = self.target.texture() {
            self.clear
                .record(encoder, &self.desc, part, whole(&self.desc));
        }
    }
}

fn whole(desc: &TextureDesc) -> Subresources {
    Subresources {
        mip: 0,
        mips: desc.mips,
        layer: 0,
        layers: desc.layers(),
    }
}

/// Every use the format allows, so that plans which use a history differently
/// can follow each other.
fn usages(desc: &TextureDesc, features: &wgpu::TextureFormatFeatures) -> wgpu::TextureUsages {
    let mut wanted = wgpu::TextureUsages::TEXTURE_BINDING
        | wgpu::TextureUsages::STORAGE_BINDING
        | wgpu::TextureUsages::COPY_SRC
        | wgpu::TextureUsages::COPY_DST;
    // Nothing draws to 3D textures.
    if desc.dimension != Dimension::D3 {
        wanted |= wgpu::TextureUsages::RENDER_ATTACHMENT;
    }
    wanted & features.allowed_usages
}

impl Histories {
    /// Makes sure that every history of a plan exists in its shape. Those just
    /// made come back with what must be written into them before the plan runs.
    pub(crate) fn acquire(&mut self, gpu: &Gpu, plan: &Plan) -> Result<Vec<Initial>, BackendError> {
        let mut initial = Vec::new();
        for planned in &plan.histories {
            let desc = planned.desc;
            let step = format!("history `{}`", planned.name);
            let history = match self.0.remove(&planned.name) {
                Some(history) if history.desc == desc => history,
                _ => {
                    let (format, features) = gpu
                        .format(desc.format)
                        .ok_or_else(|| unsupported(&step, format!("{} textures", desc.format)))?;
                    let usages = usages(&desc, &features);
                    let make = || gpu.texture(&planned.name, &desc, format, usages);
                    History {
                        desc,
                        textures: [make()?, make()?],
                        previous: 0,
                        defined: false,
                    }
                }
            };
            let history = self.0.entry(planned.name.clone()).or_insert(history);
            if !history.defined {
                let target = Physical::whole(&history.textures[history.previous]);
                let range = whole(&desc);
                let mut clear = Clear::new(gpu, &step, &desc, range, planned.initial)?;
                clear.prepare(gpu, &step, &target, range)?;
                initial.push(Initial {
                    clear,
                    target,
                    desc,
                });
            }
        }
        Ok(initial)
    }

    /// What the frame reads and what it writes.
    pub(crate) fn pair(&self, name: &str) -> Option<(Physical, Physical)> {
        let history = self.0.get(name)?;
        let [a, b] = &history.textures;
        let (a, b) = (Physical::whole(a), Physical::whole(b));
        Some(if history.previous == 0 {
            (a, b)
        } else {
            (b, a)
        })
    }

    /// The plan has run: what it wrote is what the next frame reads, and
    /// histories it does not have are gone.
    pub(crate) fn advance(&mut self, plan: &Plan) {
        self.0.retain(|name, history| {
            history.previous = 1 - history.previous;
            history.defined = true;
            plan.histories.iter().any(|planned| planned.name == *name)
        });
    }

    /// Forgets everything.
    pub(crate) fn reset(&mut self) {
        self.0.clear();
    }
}
