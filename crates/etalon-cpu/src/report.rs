//! What checks found, in words.

use std::collections::BTreeMap;
use std::collections::btree_map::Entry;

use naga::Span;

use crate::error::{Location, triple};
use crate::exec;
use crate::finding::{Finding, FindingKind};
use crate::ir::Indexed;
use crate::program::Program;

impl Program {
    /// Gives what was found names and places.
    pub(crate) fn findings(
        &self,
        found: BTreeMap<(exec::Site, FindingKind), exec::Found>,
        workgroups: [u32; 3],
    ) -> Vec<Finding> {
        let mut findings: BTreeMap<(Location, FindingKind), ((u64, u32), Finding)> =
            BTreeMap::new();
        for ((site, kind), found) in found {
            let location = (self.locate)(self.span(site));
            let first = (found.workgroup, found.invocation);
            let finding = |count| Finding {
                kind,
                location: location.clone(),
                message: self.message(&found.detail),
                workgroup: workgroup_id(found.workgroup, workgroups),
                invocation: self.invocation_id(found.invocation),
                count,
            };
            match findings.entry((location.clone(), kind)) {
                Entry::Vacant(entry) => {
                    entry.insert((first, finding(found.count)));
                }
                Entry::Occupied(mut entry) => {
                    let (known_first, known) = entry.get_mut();
                    known.count = known.count.saturating_add(found.count);
                    if first < *known_first {
                        *known_first = first;
                        *known = finding(known.count);
                    }
                }
            }
        }
        findings.into_values().map(|(_, finding)| finding).collect()
    }

    pub(crate) fn span(&self, site: exec::Site) -> Span {
        let span = match site {
            exec::Site::Inst(index) => self.code.insts.get(index as usize).map(|inst| inst.span),
            exec::Site::Loop(index) => self.code.loops.get(index as usize).copied(),
        };
        span.unwrap_or_default()
    }

    pub(crate) fn invocation_id(&self, index: u32) -> [u32; 3] {
        // Not empty, see `Program::new`.
        let [x, y, _] = self.workgroup_size.map(|size| size.max(1));
        [index % x, index / x % y, index / (x * y)]
    }

    /// What a finding says.
    fn message(&self, detail: &exec::Detail) -> String {
        use exec::Detail as D;
        match detail {
            D::Index { of, index, length } => {
                let of = match of {
                    Indexed::Array => "an array of",
                    Indexed::Vector => "a vector of",
                    Indexed::Matrix => "the columns of a matrix of",
                };
                format!("index {index} is outside of {of} {length}")
            }
            D::Texel { at, size, axes } => {
                let size: Vec<String> = size[..*axes].iter().map(u32::to_string).collect();
                format!(
                    "texel {} is outside of {}",
                    tuple(&at[..*axes]),
                    size.join("×")
                )
            }
            D::Level { level, levels } => format!("level {level} is outside of {levels}"),
            D::Layer { layer, layers } => format!("layer {layer} is outside of {layers}"),
            D::Unwritten(part) => format!("nothing wrote {}, which is read", self.part(*part)),
            D::Race {
                part,
                writes,
                other,
                other_writes,
            } => format!(
                "{} is {} here and {} by invocation {} at {} without a barrier between",
                self.part(*part),
                if *writes { "written" } else { "read" },
                if *other_writes { "written" } else { "read" },
                triple(&self.invocation_id(other.invocation)),
                (self.locate)(self.span(exec::Site::Inst(other.inst)))
            ),
            D::Barrier { here, all } => {
                format!("a barrier is reached by {here} of {all} invocations")
            }
            D::Loop { limit } => format!("a loop ran {limit} times without ending"),
            D::DivisionByZero { dividend } => format!("{dividend} is divided by 0"),
            D::DivisionOverflow => format!("{} is divided by -1", i32::MIN),
            D::Shift { amount } => format!("a number of 32 bits is shifted by {amount}"),
            D::Conversion { value, signed } => {
                let ty = if *signed { "i32" } else { "u32" };
                format!("{value} is converted to {ty}, which does not have it")
            }
            D::NonFinite { result, operands } => {
                let operands: Vec<String> = operands.iter().map(f32::to_string).collect();
                format!(
                    "{result} comes of finite operands ({})",
                    operands.join(", ")
                )
            }
        }
    }

    /// A piece of memory for a message.
    fn part(&self, part: exec::Part) -> String {
        let name = |binding: u16| {
            self.bindings
                .get(usize::from(binding))
                .map_or("", |binding| binding.name.as_str())
        };
        match part {
            exec::Part::Private => "an element of the variable".to_owned(),
            exec::Part::Workgroup => "workgroup memory".to_owned(),
            exec::Part::Word(binding, word) => format!("word {word} of `{}`", name(binding)),
            exec::Part::Texel(binding, at, axes) => {
                format!("texel {} of `{}`", tuple(&at[..axes]), name(binding))
            }
            exec::Part::Sample(binding) => format!("a texel of `{}`", name(binding)),
        }
    }
}

/// `workgroup_id` of the workgroup of a number, x first.
pub(crate) fn workgroup_id(index: u64, [x, y, _]: [u32; 3]) -> [u32; 3] {
    // Dispatched, so there are some along each axis; each is below 32 bits.
    let (x, y) = (u64::from(x.max(1)), u64::from(y.max(1)));
    [
        (index % x) as u32,
        (index / x % y) as u32,
        (index / (x * y)) as u32,
    ]
}

/// Coordinates for a message.
fn tuple(at: &[i64]) -> String {
    let at: Vec<String> = at.iter().map(i64::to_string).collect();
    format!("({})", at.join(", "))
}
