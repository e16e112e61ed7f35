//! What wgpu cannot do on OpenGL and does not say.
//!
//! OpenGL has no views of textures: wgpu narrows a texture to some of its mips
//! by setting the texture's own `TEXTURE_BASE_LEVEL` and `TEXTURE_MAX_LEVEL`
//! when it binds it to be sampled. These stay set, and stores to mips outside
//! are dropped without an error. So a plan that samples some mips of a texture
//! and stores to others would quietly do nothing; it is refused.

use std::collections::BTreeMap;

use etalon_core::backend::BackendError;
use etalon_core::graph::Subresources;
use etalon_core::kernel::{BindingKind, Kernel};
use etalon_core::plan::{Bound, Plan, ResourceKind, Step};

use crate::fault::unsupported;

/// Resources that may be one texture.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Texture<'a> {
    Own(u32),
    Slot(u32),
    History(&'a str),
}

fn texture(plan: &Plan, resource: u32) -> Texture<'_> {
    match plan.resources.get(resource as usize).map(|r| &r.kind) {
        Some(ResourceKind::Transient(place)) => Texture::Slot(place.slot),
        Some(ResourceKind::HistoryPrevious(history) | ResourceKind::HistoryCurrent(history)) => {
            plan.histories
                .get(*history as usize)
                .map_or(Texture::Own(resource), |history| {
                    Texture::History(&history.name)
                })
        }
        _ => Texture::Own(resource),
    }
}

/// Refuses steps that sample and write different mips of one texture.
pub(crate) fn check(plan: &Plan) -> Result<(), BackendError> {
    let mut sampled: BTreeMap<Texture<'_>, Vec<Subresources>> = BTreeMap::new();
    let mut stored = Vec::new();
    for step in &plan.steps {
        let mut bound: Vec<(&Kernel, &[Bound])> = Vec::new();
        match &step.step {
            Step::Dispatch {
                kernel, bindings, ..
            } => bound.push((&kernel.0, bindings)),
            Step::Raster(raster) => {
                // A framebuffer takes the mips that can be sampled.
                for target in raster.colours.iter().chain(&raster.depth) {
                    let texture = texture(plan, target.resource);
                    stored.push((texture, target.range, &step.name, "a target"));
                }
                let draws = raster.draws.iter();
                bound.extend(draws.map(|draw| (&*draw.kernel.0, draw.bindings.as_slice())));
            }
            _ => {}
        }
        for (kernel, bindings) in bound {
            let mut here: BTreeMap<Texture<'_>, Subresources> = BTreeMap::new();
            for (binding, bound) in kernel.bindings.iter().zip(bindings) {
                let Bound::Texture { resource, range } = bound else {
                    continue;
                };
                let texture = texture(plan, *resource);
                if !matches!(binding.kind, BindingKind::Texture { .. }) {
                    stored.push((texture, *range, &step.name, &binding.name));
                    continue;
                }
                sampled.entry(texture.clone()).or_default().push(*range);
                let before = here.entry(texture).or_insert(*range);
                if (before.mip, before.mips) != (range.mip, range.mips) {
                    return Err(unsupported(
                        &step.name,
                        format!("two runs of mips of `{}` at once", binding.name),
                    ));
                }
            }
        }
    }
    for (texture, range, step, name) in stored {
        let outside =
            |seen: &Subresources| range.mip < seen.mip || range.mip - seen.mip >= seen.mips;
        if sampled
            .get(&texture)
            .is_some_and(|ranges| ranges.iter().any(outside))
        {
            return Err(unsupported(
                step,
                format!(
                    "stores to mip {} of `{name}`, other mips of which are sampled",
                    range.mip
                ),
            ));
        }
    }
    Ok(())
}
