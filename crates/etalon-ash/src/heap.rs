//! The memory of transient resources: one allocation for textures and one for
//! buffers, with everything where the plan says.
//!
//! # Resources that stay apart
//! Three kinds of transients get memory of their own instead:
//!
//! * whose planned size or alignment is less than the device needs, because
//!   the plan was made with another memory model than
//!   [`Backend::memory`](etalon_core::backend::Backend::memory);
//! * whose memory types have none in common with those that come before it
//!   (few devices have textures that differ so);
//! * that the driver wants an allocation of their own for.
//!
//! The plan's barriers order uses of shared memory, across runs as well. A
//! resource apart shares with nobody but its own past, so the barrier before
//! its first use also waits for its own uses; see [`Heaps::apart`].

use std::sync::Arc;

use ash::vk;
use etalon_core::backend::BackendError;
use etalon_core::graph::ResourceDesc;
use etalon_core::plan::{Placement, Plan, ResourceKind};
use gpu_allocator::MemoryLocation;
use gpu_allocator::vulkan::AllocationScheme;

use crate::buffer::Buffer;
use crate::device::Device;
use crate::error::unsupported;
use crate::image::{self, Image};
use crate::memory::{Memory, Requirements};
use crate::{Resource, buffer, usage};

/// The transient resources of a plan, in memory.
pub(crate) struct Heaps {
    /// By number in the plan; `None` for what is not transient.
    pub(crate) transients: Vec<Option<Resource>>,
    /// By number in the plan: whether a transient has memory of its own.
    pub(crate) apart: Vec<bool>,
    /// What they take, shared memory counted once.
    pub(crate) bytes: u64,
}

/// A transient and what it needs.
struct Tenant {
    resource: usize,
    place: Placement,
    needed: Requirements,
}

impl Heaps {
    /// Makes every transient of a plan that has been checked.
    pub(crate) fn new(device: &Arc<Device>, plan: &Plan) -> Result<Self, BackendError> {
        let mut this = Self {
            transients: vec![None; plan.resources.len()],
            apart: vec![false; plan.resources.len()],
            bytes: 0,
        };
        let mut textures = Vec::new();
        let mut buffers = Vec::new();
        for (resource, planned) in plan.resources.iter().enumerate() {
            let ResourceKind::Transient(place) = planned.kind else {
                continue;
            };
            let (needed, heap) = match &planned.desc {
                ResourceDesc::Texture(desc) => (
                    image::requirements(device, desc, usage::image_flags(planned.usages)),
                    &mut textures,
                ),
                ResourceDesc::Buffer(desc) => (
                    buffer::requirements(device, desc.bytes, usage::buffer_flags(planned.usages))
                        .ok_or_else(|| format!("a buffer of {} bytes", desc.bytes)),
                    &mut buffers,
                ),
            };
            let needed = needed.map_err(|what| unsupported(&planned.name, what))?;
            heap.push(Tenant {
                resource,
                place,
                needed,
            });
        }
        this.fill(device, plan, &textures, plan.texture_heap, false)?;
        this.fill(device, plan, &buffers, plan.buffer_heap, true)?;
        Ok(this)
    }

    /// Allocates one heap and puts its tenants into it.
    fn fill(
        &mut self,
        device: &Arc<Device>,
        plan: &Plan,
        tenants: &[Tenant],
        bytes: u64,
        linear: bool,
    ) -> Result<(), BackendError> {
        let alignment = plan.heap_alignment.max(1);
        let fitting: Vec<bool> = tenants
            .iter()
            .map(|tenant| fits(tenant, alignment))
            .collect();
        let bits: Vec<u32> = tenants
            .iter()
            .zip(&fitting)
            .map(|(tenant, fits)| {
                if *fits {
                    tenant.needed.memory.memory_type_bits
                } else {
                    0
                }
            })
            .collect();
        let (types, shares) = common_types(&bits, local_types(&device.physical.memory));
        let memory = if shares.contains(&true) {
            let name = if linear {
                "transient buffers"
            } else {
                "transient textures"
            };
            self.bytes = self.bytes.saturating_add(bytes);
            let requirements = vk::MemoryRequirements {
                size: bytes,
                alignment,
                memory_type_bits: types,
            };
            Some(Memory::new(
                device,
                name,
                requirements,
                MemoryLocation::GpuOnly,
                linear,
                AllocationScheme::GpuAllocatorManaged,
            )?)
        } else {
            None
        };
        for (tenant, shares) in tenants.iter().zip(shares) {
            let planned = &plan.resources[tenant.resource];
            let shared = memory.as_ref().filter(|_| shares);
            let name = &planned.name;
            self.apart[tenant.resource] = shared.is_none();
            if shared.is_none() {
                self.bytes = self.bytes.saturating_add(tenant.needed.memory.size);
            }
            self.transients[tenant.resource] = Some(match &planned.desc {
                ResourceDesc::Texture(desc) => {
                    let flags = usage::image_flags(planned.usages);
                    Resource::Texture(match shared {
                        Some(memory) => {
                            Image::placed(device, name, desc, flags, memory, tenant.place.offset)?
                        }
                        None => Image::new(device, name, desc, flags)?,
                    })
                }
                ResourceDesc::Buffer(desc) => {
                    let (bytes, flags) = (desc.bytes, usage::buffer_flags(planned.usages));
                    Resource::Buffer(match shared {
                        Some(memory) => {
                            Buffer::placed(device, name, bytes, flags, memory, tenant.place.offset)?
                        }
                        None => Buffer::new(device, name, bytes, flags, MemoryLocation::GpuOnly)?,
                    })
                }
            });
        }
        Ok(())
    }
}

/// Whether a transient can live where it was planned.
fn fits(tenant: &Tenant, heap_alignment: u64) -> bool {
    let needed = &tenant.needed.memory;
    let alignment = needed.alignment.max(1);
    !tenant.needed.dedicated
        && tenant.place.bytes >= needed.size
        && tenant.place.offset.is_multiple_of(alignment)
        && heap_alignment.is_multiple_of(alignment)
        && heap_alignment.is_power_of_two()
}

/// The memory types that are the device's own.
fn local_types(memory: &vk::PhysicalDeviceMemoryProperties) -> u32 {
    memory
        .memory_types_as_slice()
        .iter()
        .enumerate()
        .filter(|(_, kind)| {
            kind.property_flags
                .contains(vk::MemoryPropertyFlags::DEVICE_LOCAL)
        })
        .fold(0, |bits, (index, _)| bits | 1 << index)
}

/// The memory types that suit all, and for each whether it is one of "all":
/// one that has none of the usable types left in common with those before it
/// is not.
fn common_types(bits: &[u32], usable: u32) -> (u32, Vec<bool>) {
    let mut common = usable;
    let shares = bits
        .iter()
        .map(|bits| {
            let left = common & bits;
            if left != 0 {
                common = left;
            }
            left != 0
        })
        .collect();
    (common, shares)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn tenant(size: u64, alignment: u64, place: (u64, u64)) -> Tenant {
        Tenant {
            resource: 0,
            place: Placement {
                offset: place.0,
                bytes: place.1,
                slot: 0,
            },
            needed: Requirements {
                memory: vk::MemoryRequirements {
                    size,
                    alignment,
                    memory_type_bits: 1,
                },
                dedicated: false,
            },
        }
    }

    #[test]
    fn types_are_intersected_in_order() {
        assert_eq!(
            common_types(&[0b111, 0b110, 0b001, 0b100], 0b111),
            (0b100, vec![true, true, false, true])
        );
        assert_eq!(common_types(&[0b01], 0b10), (0b10, vec![false]));
        assert_eq!(common_types(&[], 0b10), (0b10, vec![]));
    }

    #[test]
    fn a_place_that_is_too_small_or_misaligned_does_not_fit() {
        assert!(fits(&tenant(100, 64, (128, 100)), 64));
        assert!(!fits(&tenant(101, 64, (128, 100)), 64));
        assert!(!fits(&tenant(100, 64, (96, 100)), 64));
        assert!(!fits(&tenant(100, 64, (128, 100)), 32));
        let mut wanted_alone = tenant(100, 64, (128, 100));
        wanted_alone.needed.dedicated = true;
        assert!(!fits(&wanted_alone, 64));
    }
}
