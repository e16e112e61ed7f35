//! Checks of textures and storage buffers.

use std::sync::atomic::AtomicU32;

use super::{Checker, Detail, Lane, Part, Site, Use, float, int, lanes, texture};
use crate::code::CodeInst;
use crate::exec::sample;
use crate::exec::state::{Resource, State};
use crate::ir::{Access, Check, ImageAccess};
use crate::memory::{Level, TextureView, written};
use crate::num::Number;

/// Where a texel is, or what is wrong with where it should be.
fn locate(
    texture: &TextureView<'_>,
    access: ImageAccess,
    [at, level]: [&[u32]; 2],
    signed: bool,
) -> Result<u32, Detail> {
    let level = level.first().copied().unwrap_or(0);
    let Some(&Level {
        width,
        height,
        depth,
        start,
    }) = texture.levels.get(level as usize)
    else {
        return Err(Detail::Level {
            level: level as i32,
            levels: texture.levels.len() as u32,
        });
    };
    let axes = usize::from(access.coordinates);
    let third = at.get(2).copied().unwrap_or(0);
    let size = [width, height, depth];
    if (0..axes).any(|axis| at[axis] >= size[axis]) {
        return Err(Detail::Texel {
            at: coordinates(at, axes, signed),
            size,
            axes,
        });
    }
    if access.layered && third >= depth {
        return Err(Detail::Layer {
            layer: third as i32,
            layers: depth,
        });
    }
    // Inside, so the index is below the number of texels, which has 32 bits.
    let second = at.get(1).copied().unwrap_or(0);
    Ok((third * height + second) * width + at[0] + start)
}

fn coordinates(at: &[u32], axes: usize, signed: bool) -> [i64; 3] {
    std::array::from_fn(|axis| match at.get(axis) {
        Some(&value) if axis < axes && signed => i64::from(value as i32),
        Some(&value) if axis < axes => i64::from(value),
        _ => 0,
    })
}

/// The coordinates and layer of a lane, then its level.
fn address<N: Number>(
    state: &State<'_, N>,
    inst: &CodeInst,
    access: ImageAccess,
    level: bool,
    at: Lane,
) -> (Vec<u32>, Vec<u32>) {
    let count = usize::from(access.coordinates) + usize::from(access.layered);
    let all: Vec<u32> = inst
        .operands
        .iter()
        .map(|&slot| int(state, slot, at))
        .collect();
    let (place, rest) = all.split_at(count.min(all.len()));
    let levels = if level { rest } else { &[] };
    (place.to_vec(), levels.to_vec())
}

/// That coordinates, levels and layers are those of the texture.
pub(super) fn bounds<N: Number>(
    state: &State<'_, N>,
    checker: &mut Checker<'_>,
    inst: &CodeInst,
    check: Check,
    site: Site,
) {
    let image = match check {
        Check::Texel { access, .. } => access.image,
        Check::Layer { image } | Check::Level { image } => image,
        _ => return,
    };
    let Some(texture) = texture(state, image) else {
        return;
    };
    for at in lanes(state, inst) {
        let fault = match check {
            Check::Texel {
                access,
                level,
                signed,
            } => {
                let (place, level) = address(state, inst, access, level, at);
                locate(texture, access, [&place, &level], signed).err()
            }
            Check::Layer { .. } => {
                let layer = int(state, inst.operands[0], at);
                let layers = match texture.desc().dimension {
                    etalon_core::resource::Dimension::Cube => texture.desc().layers() / 6,
                    _ => texture.desc().layers(),
                };
                (layer >= layers).then_some(Detail::Layer {
                    layer: layer as i32,
                    layers,
                })
            }
            _ => {
                let level = int(state, inst.operands[0], at);
                let levels = texture.levels.len() as u32;
                (level >= levels).then_some(Detail::Level {
                    level: level as i32,
                    levels,
                })
            }
        };
        if let Some(fault) = fault {
            checker.report(site, at.invocation, || fault);
        }
    }
}

/// What nothing wrote, and races.
pub(super) fn memory<N: Number>(
    state: &State<'_, N>,
    checker: &mut Checker<'_>,
    inst: &CodeInst,
    check: Check,
    index: u32,
) {
    match check {
        Check::Buffer {
            buffer,
            offset,
            words,
            access,
        } => {
            for at in lanes(state, inst) {
                let computed = inst
                    .operands
                    .first()
                    .map_or(0, |&slot| int(state, slot, at));
                let mut used = Vec::with_capacity(words as usize);
                for word in 0..words {
                    let word = offset.saturating_add(computed).saturating_add(word);
                    used.push((word, Part::Word(buffer, word)));
                }
                checker.use_resource(buffer, &used, access, at.invocation, index);
            }
        }
        Check::TexelMemory {
            image,
            level,
            access,
        } => {
            let Some(texture) = texture(state, image.image) else {
                return;
            };
            for at in lanes(state, inst) {
                let (place, level) = address(state, inst, image, level, at);
                // What is outside is another check's business.
                if let Ok(texel) = locate(texture, image, [&place, &level], true) {
                    let shown = coordinates(&place, place.len(), false);
                    let part = Part::Texel(image.image, shown, place.len());
                    checker.use_resource(
                        image.image,
                        &[(texel, part)],
                        access,
                        at.invocation,
                        index,
                    );
                }
            }
        }
        Check::SampleMemory { access, sampler } => {
            let shadows = checker.shadows;
            let Some(view) = shadows
                .get(usize::from(access.image))
                .and_then(|shadow| shadow.view.as_ref())
            else {
                return;
            };
            let Some(&Resource::Sampler(sampler)) = state.resources.get(usize::from(sampler))
            else {
                return;
            };
            let axes = usize::from(access.coordinates);
            for at in lanes(state, inst) {
                let number = |i: usize| float(state, inst.operands[i], at).to_f32();
                let position = [0, 1, 2].map(|axis| if axis < axes { number(axis) } else { 0.0 });
                let layer = if access.layered {
                    int(state, inst.operands[axes], at)
                } else {
                    0
                };
                let lod = number(axes + usize::from(access.layered));
                if sample::one(view, sampler, access, position, layer, lod) > 0.0 {
                    let part = Part::Sample(access.image);
                    checker.report(Site::Inst(index), at.invocation, || Detail::Unwritten(part));
                }
            }
        }
        _ => {}
    }
}

impl Checker<'_> {
    /// One invocation uses words or texels of a binding.
    fn use_resource(
        &mut self,
        binding: u16,
        used: &[(u32, Part)],
        access: Access,
        invocation: u32,
        inst: u32,
    ) {
        let shadows = self.shadows;
        let Some(shadow) = shadows.get(usize::from(binding)) else {
            return;
        };
        let word = |index: u32| -> Option<&AtomicU32> { shadow.words?.get(index as usize) };
        let mut race = None;
        let mut unwritten = Vec::new();
        for &(index, part) in used {
            if let Some(word) = word(index)
                && self.checks.uninitialised
            {
                if access.reads() && written::is_unwritten(word) {
                    unwritten.push((index, part));
                }
                if access.writes() {
                    written::write_by(word, self.workgroup);
                }
            }
            if self.checks.races && shadow.writable {
                let by = Use { invocation, inst };
                let uses = if matches!(part, Part::Word(..)) {
                    &mut self.buffers
                } else {
                    &mut self.texels
                };
                let conflict = uses.entry((binding, index)).or_default().access(access, by);
                race = race.or(conflict.map(|conflict| (part, conflict)));
            }
        }
        for (index, part) in unwritten {
            if shadow.writable {
                // Another workgroup may yet write it.
                self.collector.add_candidate(
                    inst,
                    self.workgroup,
                    invocation,
                    (binding, index),
                    part,
                );
            } else {
                self.report(Site::Inst(inst), invocation, || Detail::Unwritten(part));
            }
        }
        if let Some((part, (other, other_writes))) = race {
            self.report(Site::Inst(inst), invocation, || Detail::Race {
                part,
                writes: access.writes(),
                other,
                other_writes,
            });
        }
    }
}
