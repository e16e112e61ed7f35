//! Pointers: where variables live, and how loads and stores reach them.

use std::rc::Rc;

use naga::TypeInner;

use super::layout::{Leaf, bytes, column_stride, fixed_length};
use super::{Fail, Translator};
use crate::ir::{Access, Arith, AtomicFunction, Class, Memory, Op, Probed, Slots, Value, Variable};

/// Most memory slots of a class per invocation or workgroup.
const MAX_SLOTS: u32 = 1 << 14;

/// What a pointer points at.
#[derive(Clone, Debug)]
pub(super) struct Place {
    pub(super) ty: TypeInner,
    pub(super) root: Root,
}

/// Where a pointee is.
#[derive(Clone, Debug)]
pub(super) enum Root {
    /// Registers: the scalars of the whole variable, and where the pointee starts.
    Variables { all: Rc<[Variable]>, start: usize },
    /// Slots of each class; the computed parts are of each class, too.
    Memory {
        memory: Memory,
        slots: Slots,
        computed: Option<(Value, Value)>,
    },
    /// Bytes of a buffer; the computed part is in words, and in halves of words
    /// where elements of `f16` are not a whole number of words.
    Buffer {
        buffer: u16,
        offset: u32,
        computed: Option<Value>,
        halves: Option<Value>,
        constant: bool,
    },
}

impl Place {
    pub(super) fn buffer(ty: TypeInner, buffer: u16, constant: bool) -> Self {
        Self {
            ty,
            root: Root::Buffer {
                buffer,
                offset: 0,
                computed: None,
                halves: None,
                constant,
            },
        }
    }

    pub(super) fn variables(&self) -> Vec<Variable> {
        match &self.root {
            Root::Variables { all, .. } => all.to_vec(),
            Root::Memory { .. } | Root::Buffer { .. } => Vec::new(),
        }
    }
}

impl<'a> Translator<'a> {
    /// Room for a variable of one invocation.
    pub(super) fn private_place(&mut self, ty: TypeInner, indexed: bool) -> Result<Place, Fail> {
        if indexed {
            return self.memory_place(ty, Memory::Private);
        }
        let leaves = self.leaves(&ty)?;
        let all = leaves
            .into_iter()
            .map(|leaf| self.builder.new_variable(leaf.class()))
            .collect();
        Ok(Place {
            ty,
            root: Root::Variables { all, start: 0 },
        })
    }

    /// Room for a variable of a workgroup.
    pub(super) fn workgroup_place(&mut self, ty: TypeInner) -> Result<Place, Fail> {
        self.memory_place(ty, Memory::Workgroup)
    }

    fn memory_place(&mut self, ty: TypeInner, memory: Memory) -> Result<Place, Fail> {
        let size = self.slots(&ty)?;
        let resources = &mut self.builder.tree.resources;
        let (what, total) = match memory {
            Memory::Private => ("private memory in words", &mut resources.private),
            Memory::Workgroup => ("workgroup memory in words", &mut resources.workgroup),
        };
        let slots = *total;
        total.float += size.float;
        total.int += size.int;
        let most = total.float.max(total.int);
        if most > MAX_SLOTS {
            return Err(Fail::TooLarge {
                what,
                size: most.into(),
                limit: MAX_SLOTS.into(),
            });
        }
        Ok(Place {
            ty,
            root: Root::Memory {
                memory,
                slots,
                computed: None,
            },
        })
    }

    /// The component `index` of what `place` points at.
    pub(super) fn member(&mut self, place: &Place, index: u32) -> Result<Place, Fail> {
        let (ty, byte, before) = match &place.ty {
            TypeInner::Struct { members, .. } => {
                let member = members
                    .get(index as usize)
                    .ok_or_else(|| Fail::invalid("a member index is out of range"))?;
                let mut before = Slots::default();
                for member in &members[..index as usize] {
                    let slots = self.slots(self.inner(member.ty))?;
                    before.float += slots.float;
                    before.int += slots.int;
                }
                (self.inner(member.ty).clone(), member.offset, before)
            }
            other => {
                let (element, stride) = self.element(other)?;
                let slots = self.slots(&element)?;
                let overflow = || Fail::invalid("an index is out of range");
                let before = Slots {
                    float: slots.float.checked_mul(index).ok_or_else(overflow)?,
                    int: slots.int.checked_mul(index).ok_or_else(overflow)?,
                };
                (
                    element,
                    stride.checked_mul(index).ok_or_else(overflow)?,
                    before,
                )
            }
        };
        let mut root = place.root.clone();
        match &mut root {
            Root::Variables { start, .. } => *start += (before.float + before.int) as usize,
            Root::Memory { slots, .. } => {
                slots.float += before.float;
                slots.int += before.int;
            }
            Root::Buffer { offset, .. } => *offset = offset.saturating_add(byte),
        }
        Ok(Place { ty, root })
    }

    /// The element at a computed index, which is brought into range like naga's
    /// `BoundsCheckPolicy::Restrict` does: as an unsigned number, at most the
    /// last one's.
    pub(super) fn element_at(&mut self, place: &Place, index: Value) -> Result<Place, Fail> {
        let last = match self.length_of(&place.ty)? {
            Some(length) => self.builder.int(length.saturating_sub(1)),
            None => {
                let length = self.runtime_length(place)?;
                let one = self.builder.int(1);
                self.builder.arith(Arith::SubI, &[length, one])
            }
        };
        let index = self.builder.arith(Arith::MinU, &[index, last]);
        if let Some(index) = self.builder.constant_bits(index) {
            return self.member(place, index);
        }
        let (element, stride) = self.element(&place.ty)?;
        let mut root = place.root.clone();
        match &mut root {
            Root::Variables { .. } => {
                return Err(Fail::invalid(
                    "a variable in registers is indexed by a computed value",
                ));
            }
            Root::Memory { computed, .. } => {
                let slots = self.slots(&element)?;
                let (float, int) = (
                    self.scaled(index, slots.float),
                    self.scaled(index, slots.int),
                );
                *computed = Some(match *computed {
                    Some((f, i)) => (
                        self.builder.arith(Arith::AddI, &[f, float]),
                        self.builder.arith(Arith::AddI, &[i, int]),
                    ),
                    None => (float, int),
                });
            }
            Root::Buffer {
                computed, halves, ..
            } => {
                let (sum, unit) = if stride % 4 == 0 {
                    (computed, 4)
                } else {
                    (halves, 2)
                };
                let units = self.scaled(index, stride / unit);
                *sum = Some(match *sum {
                    Some(base) => self.builder.arith(Arith::AddI, &[base, units]),
                    None => units,
                });
            }
        }
        Ok(Place { ty: element, root })
    }

    fn scaled(&mut self, index: Value, factor: u32) -> Value {
        let factor = self.builder.int(factor);
        self.builder.arith(Arith::MulI, &[index, factor])
    }

    /// The type of the elements, and bytes between them.
    fn element(&self, ty: &TypeInner) -> Result<(TypeInner, u32), Fail> {
        match *ty {
            TypeInner::Vector { scalar, .. } => Ok((TypeInner::Scalar(scalar), bytes(scalar))),
            TypeInner::Matrix { rows, scalar, .. } => Ok((
                TypeInner::Vector { size: rows, scalar },
                column_stride(rows, scalar),
            )),
            TypeInner::Array { base, stride, .. } => Ok((self.inner(base).clone(), stride)),
            _ => Err(Fail::invalid(
                "something other than a vector, matrix, array or struct is indexed",
            )),
        }
    }

    /// The number of elements, `None` for runtime-sized arrays.
    pub(super) fn length_of(&self, ty: &TypeInner) -> Result<Option<u32>, Fail> {
        Ok(match *ty {
            TypeInner::Vector { size, .. } => Some(size as u32),
            TypeInner::Matrix { columns, .. } => Some(columns as u32),
            TypeInner::Array {
                size: naga::ArraySize::Dynamic,
                ..
            } => None,
            TypeInner::Array { size, .. } => Some(fixed_length(size)?),
            _ => return Err(Fail::invalid("something without elements is indexed")),
        })
    }

    /// `arrayLength`.
    pub(super) fn runtime_length(&mut self, place: &Place) -> Result<Value, Fail> {
        match (&place.ty, &place.root) {
            (
                &TypeInner::Array {
                    size: naga::ArraySize::Dynamic,
                    stride,
                    ..
                },
                &Root::Buffer {
                    buffer,
                    offset,
                    computed: None,
                    ..
                },
            ) => Ok(self.builder.op(
                Op::BufferLength {
                    buffer,
                    offset,
                    stride,
                },
                &[],
                &[Class::Int],
            )[0]),
            _ => Err(Fail::invalid(
                "the length of something other than a runtime-sized array is taken",
            )),
        }
    }

    /// Where an `f16` is, `offset` bytes and the computed parts from the start of
    /// a buffer.
    fn half_at(&mut self, offset: u32, computed: Option<Value>, halves: Option<Value>) -> HalfAt {
        let b = &mut self.builder;
        let Some(halves) = halves else {
            return HalfAt {
                word: offset / 4,
                index: computed,
                shift: b.int(offset % 4 / 2 * 16),
            };
        };
        let before = b.int(offset / 2);
        let halves = b.arith(Arith::AddI, &[halves, before]);
        let (one, four) = (b.int(1), b.int(4));
        let odd = b.arith(Arith::And, &[halves, one]);
        let shift = b.arith(Arith::Shl, &[odd, four]);
        let word = b.arith(Arith::ShrU, &[halves, one]);
        let index = match computed {
            Some(computed) => b.arith(Arith::AddI, &[computed, word]),
            None => word,
        };
        HalfAt {
            word: 0,
            index: Some(index),
            shift,
        }
    }

    pub(super) fn load(&mut self, place: &Place) -> Result<Vec<Value>, Fail> {
        self.check_memory(place, Access::Read)?;
        let leaves = self.leaves(&place.ty)?;
        refuse_shorts(place, &leaves)?;
        let mut slots = Slots::default();
        let mut values = Vec::with_capacity(leaves.len());
        for (i, leaf) in leaves.into_iter().enumerate() {
            let class = leaf.class();
            let value = match &place.root {
                Root::Variables { all, start } => {
                    let variable = *all
                        .get(start + i)
                        .ok_or_else(|| Fail::invalid("a pointer leaves its variable"))?;
                    self.builder.get(variable)
                }
                Root::Memory { .. } => {
                    let (memory, slot, index) = slot_of(&place.root, class, &mut slots)?;
                    self.builder.op(
                        Op::MemoryLoad {
                            memory,
                            slot,
                            class,
                        },
                        index.as_slice(),
                        &[class],
                    )[0]
                }
                &Root::Buffer {
                    buffer,
                    offset,
                    computed,
                    halves,
                    constant,
                } if leaf.is_half => {
                    let at = self.half_at(offset.saturating_add(leaf.offset), computed, halves);
                    let word = self.builder.op(
                        Op::BufferLoad {
                            buffer,
                            offset: at.word,
                            class: Class::Int,
                            constant,
                        },
                        at.index.as_slice(),
                        &[Class::Int],
                    )[0];
                    let half = self.builder.arith(Arith::ShrU, &[word, at.shift]);
                    self.builder.arith(Arith::HalfToF, &[half])
                }
                &Root::Buffer {
                    buffer,
                    offset,
                    computed,
                    constant,
                    ..
                } => {
                    let offset = offset.saturating_add(leaf.offset) / 4;
                    self.builder.op(
                        Op::BufferLoad {
                            buffer,
                            offset,
                            class,
                            constant,
                        },
                        computed.as_slice(),
                        &[class],
                    )[0]
                }
            };
            values.push(value);
        }
        Ok(values)
    }

    pub(super) fn store(&mut self, place: &Place, values: &[Value]) -> Result<(), Fail> {
        let leaves = self.leaves(&place.ty)?;
        if leaves.len() != values.len() {
            return Err(Fail::invalid("a stored value is not of the pointer's type"));
        }
        refuse_shorts(place, &leaves)?;
        self.check_memory(place, Access::Write)?;
        let mut slots = Slots::default();
        for (i, (leaf, &value)) in leaves.into_iter().zip(values).enumerate() {
            let class = leaf.class();
            match &place.root {
                Root::Variables { all, start } => {
                    let variable = *all
                        .get(start + i)
                        .ok_or_else(|| Fail::invalid("a pointer leaves its variable"))?;
                    self.builder.set(variable, value);
                }
                Root::Memory { .. } => {
                    let (memory, slot, index) = slot_of(&place.root, class, &mut slots)?;
                    let operands: Vec<Value> = [value].into_iter().chain(index).collect();
                    self.builder.op(
                        Op::MemoryStore {
                            memory,
                            slot,
                            class,
                        },
                        &operands,
                        &[],
                    );
                }
                &Root::Buffer {
                    buffer,
                    offset,
                    computed,
                    halves,
                    ..
                } if leaf.is_half => {
                    let at = self.half_at(offset.saturating_add(leaf.offset), computed, halves);
                    let half = self.builder.arith(Arith::FToHalf, &[value]);
                    let operands: Vec<Value> =
                        [half, at.shift].into_iter().chain(at.index).collect();
                    self.where_alive(|this| {
                        this.builder.op(
                            Op::BufferStoreHalf {
                                buffer,
                                offset: at.word,
                            },
                            &operands,
                            &[],
                        );
                    });
                }
                &Root::Buffer {
                    buffer,
                    offset,
                    computed,
                    ..
                } => {
                    let offset = offset.saturating_add(leaf.offset) / 4;
                    let operands: Vec<Value> = [value].into_iter().chain(computed).collect();
                    self.where_alive(|this| {
                        if this.builder.instrument.probes && class == Class::Float {
                            this.builder.probe(Probed::Word, &[value]);
                        }
                        this.builder.op(
                            Op::BufferStore {
                                buffer,
                                offset,
                                class,
                            },
                            &operands,
                            &[],
                        );
                    });
                }
            }
        }
        Ok(())
    }

    /// A read-modify-write; returns the old value.
    pub(super) fn atomic(
        &mut self,
        place: &Place,
        function: AtomicFunction,
        values: &[Value],
    ) -> Result<Value, Fail> {
        if values
            .iter()
            .any(|&value| self.builder.class(value) != Class::Int)
        {
            return Err(Fail::unsupported(
                "atomic operations on floating-point numbers",
            ));
        }
        self.check_memory(place, Access::Atomic { reads: true })?;
        let (op, index) = match &place.root {
            &Root::Buffer {
                buffer,
                offset,
                computed,
                ..
            } => (
                Op::BufferAtomic {
                    buffer,
                    offset: offset / 4,
                    function,
                },
                computed,
            ),
            root @ Root::Memory {
                memory: Memory::Workgroup,
                ..
            } => {
                let (_, slot, index) = slot_of(root, Class::Int, &mut Slots::default())?;
                (Op::WorkgroupAtomic { slot, function }, index)
            }
            _ => {
                return Err(Fail::invalid(
                    "an atomic operation is on neither storage nor workgroup memory",
                ));
            }
        };
        let operands: Vec<Value> = values.iter().copied().chain(index).collect();
        Ok(self.atomic_where_alive(op, &operands))
    }
}

/// Buffers of integers of 16 bits are no part of WGSL.
fn refuse_shorts(place: &Place, leaves: &[Leaf]) -> Result<(), Fail> {
    match place.root {
        Root::Buffer { .. } if leaves.iter().any(|leaf| leaf.is_short) => {
            Err(Fail::unsupported("16-bit integers in buffers"))
        }
        _ => Ok(()),
    }
}

/// Where an `f16` of a buffer is.
struct HalfAt {
    /// Fixed part of the word's index.
    word: u32,
    /// Computed part of the word's index.
    index: Option<Value>,
    /// 0 for the lower half, 16 for the upper one.
    shift: Value,
}

/// Where the next scalar of `class` lies; `taken` counts the ones before.
fn slot_of(
    root: &Root,
    class: Class,
    taken: &mut Slots,
) -> Result<(Memory, u32, Option<Value>), Fail> {
    let Root::Memory {
        memory,
        slots,
        computed,
    } = root
    else {
        return Err(Fail::invalid(
            "memory slots of a variable that is not in memory",
        ));
    };
    let (first, taken, index) = match class {
        Class::Float => (slots.float, &mut taken.float, computed.map(|c| c.0)),
        Class::Int => (slots.int, &mut taken.int, computed.map(|c| c.1)),
    };
    *taken += 1;
    Ok((*memory, first + *taken - 1, index))
}
