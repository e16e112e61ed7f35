//! What probes noted, with names and places.

use std::collections::BTreeMap;

use naga::Span;

use super::{Role, Sanitised, Site};
use crate::binding::BindingInfo;
use crate::error::Location;
use crate::exec::{Heat, Tally};
use crate::ir::{Probe, Probed};
use crate::program::Program;

/// Where the probes of a program are.
pub(crate) struct Probes<'a> {
    pub(crate) probes: &'a [Probe],
    pub(crate) bindings: &'a [BindingInfo],
    pub(crate) locate: &'a dyn Fn(Span) -> Location,
}

impl Program {
    fn probes(&self) -> Probes<'_> {
        Probes {
            probes: &self.code.resources.probes,
            bindings: &self.bindings,
            locate: &*self.locate,
        }
    }

    /// Room for where in a dispatch something is found.
    pub(crate) fn heat(&self, workgroups: [u32; 3]) -> Heat {
        let [width, height] = self.grid(workgroups);
        self.probes().heat(u64::from(width) * u64::from(height))
    }

    /// Invocations along x, and those of y and z together; at most as many as 32 bits
    /// hold.
    fn grid(&self, workgroups: [u32; 3]) -> [u32; 2] {
        let along = |axis: usize| workgroups[axis].saturating_mul(self.workgroup_size[axis]);
        [along(0), along(1).saturating_mul(along(2))]
    }

    /// Gives what was noted names and places.
    pub(crate) fn sanitised(
        &self,
        tallies: &[Tally],
        heat: &Heat,
        workgroups: [u32; 3],
    ) -> Sanitised {
        let size = [0, 1].map(|axis: usize| {
            u64::from(workgroups[axis]) * u64::from(self.workgroup_size[axis]).max(1)
        });
        let named = |invocation: u64| {
            let (x, rest) = (invocation % size[0].max(1), invocation / size[0].max(1));
            // Each is below the product of two counts that were dispatched.
            [
                x as u32,
                (rest % size[1].max(1)) as u32,
                (rest / size[1].max(1)) as u32,
            ]
        };
        self.probes()
            .sanitised(tallies, heat, self.grid(workgroups), named)
    }
}

impl Probes<'_> {
    /// A map for each site, of so many invocations.
    pub(crate) fn heat(&self, invocations: u64) -> Heat {
        let mut known: BTreeMap<(Location, Role, String), u32> = BTreeMap::new();
        let maps = self
            .probes
            .iter()
            .map(|probe| {
                let next = known.len() as u32;
                *known.entry(self.key(probe)).or_insert(next)
            })
            .collect();
        Heat::new(maps, invocations)
    }

    fn key(&self, probe: &Probe) -> (Location, Role, String) {
        let (role, operation) = match probe.probed {
            Probed::Arith(op) if op.decides() => (Role::Comparison, op.mnemonic().to_owned()),
            Probed::Arith(op) if op.indexes() || op.drops_digits() => {
                (Role::Index, op.mnemonic().to_owned())
            }
            Probed::Arith(op) => (Role::Arithmetic, op.mnemonic().to_owned()),
            Probed::Texel(access) => {
                let binding = self.bindings.get(usize::from(access.image));
                let name = binding.map_or("", |binding| binding.name.as_str());
                (Role::Store, format!("store {name}"))
            }
            Probed::Colour(target) => (Role::Store, format!("give {target}")),
            Probed::Word => (Role::Store, "store".to_owned()),
        };
        ((self.locate)(probe.span), role, operation)
    }

    /// Gives what was noted names and places: one site for all components of a vector.
    pub(crate) fn sanitised(
        &self,
        tallies: &[Tally],
        heat: &Heat,
        grid: [u32; 2],
        named: impl Fn(u64) -> [u32; 3] + Copy,
    ) -> Sanitised {
        let probes = self.probes;
        if probes.is_empty() {
            return Sanitised::default();
        }
        let mut sites: BTreeMap<(Location, Role, String), (usize, Tally)> = BTreeMap::new();
        for (index, (probe, tally)) in probes.iter().zip(tallies).enumerate() {
            sites
                .entry(self.key(probe))
                .and_modify(|(_, known)| known.append(tally))
                .or_insert_with(|| (index, tally.clone()));
        }
        let site =
            |((location, role, operation), (index, tally)): ((_, _, _), (usize, Tally))| Site {
                location,
                operation,
                role,
                executions: tally.executions,
                after_divergence: tally.after_divergence,
                max_ulps: tally.ulps,
                p99_ulps: tally.p99(),
                max_relative: tally.relative.of,
                worst: tally.relative.place.named(named),
                introduced_ulps: tally.introduced,
                lost: tally.lost.count(named),
                cancelled_bits: tally.cancelled,
                births: tally.births.count(named),
                propagated: tally.propagated,
                deaths: tally.deaths.count(named),
                unstable: tally.unstable.count(named),
                unstable_margin: tally.margin,
                of_range: tally.of_range,
                subnormal: tally.subnormal,
                floor: tally.floor,
                heat: heat.of(index),
            };
        Sanitised {
            sites: sites
                .into_iter()
                .filter(|(_, (_, tally))| tally.executions > 0)
                .map(site)
                .collect(),
            grid,
            diverged: heat.diverged(),
        }
    }
}
