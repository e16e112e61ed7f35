//! Vertex and fragment kernels: what they are given and give, fragments that are
//! discarded, and differences between neighbours.
//!
//! A discarded fragment runs on as a helper of its neighbours, as WGSL §9.4.10 has
//! it: a variable says which lanes are still alive, and whatever others could see
//! of an invocation is done where it says so.

use naga::{BuiltIn, DerivativeAxis, DerivativeControl, Expression, Handle, TypeInner};

use super::layout::{class_of, is_half};
use super::{Fail, Frame, Translator};
use crate::ir::{
    Arith, Class, Input, Interpolation, Op, Probed, StageInput, StageOutput, Value, Variable,
};

/// What kind of kernel is translated.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) enum StageKind<'a> {
    #[default]
    Compute,
    Vertex {
        /// The attribute that feeds a location.
        attributes: &'a [(u32, u16)],
        /// What fragments take of the outputs.
        wanted: &'a [StageInput],
    },
    Fragment {
        /// How many targets there are.
        targets: u32,
    },
}

/// What is known of the stage while translating.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct StageState<'a> {
    pub(super) kind: StageKind<'a>,
    /// Which lanes are covered and not discarded.
    pub(super) alive: Option<Variable>,
    pub(super) discards: bool,
}

impl StageState<'_> {
    pub(super) fn is_fragment(&self) -> bool {
        matches!(self.kind, StageKind::Fragment { .. })
    }
}

impl<'a> Translator<'a> {
    /// Before the body of a fragment kernel.
    pub(super) fn begin_stage(&mut self) {
        if self.stage.is_fragment() {
            let alive = self.builder.new_variable(Class::Int);
            let covered = self.stage_input(StageInput::Covered, Class::Int);
            self.builder.set(alive, covered);
            self.stage.alive = Some(alive);
        }
    }

    fn stage_input(&mut self, input: StageInput, class: Class) -> Value {
        let inputs = &mut self.builder.tree.resources.stage.inputs;
        let slot = inputs.iter().position(|known| *known == input);
        let slot = slot.unwrap_or_else(|| {
            inputs.push(input);
            inputs.len() - 1
        });
        // Locations and their components are fewer.
        let input = Op::Input(Input::Stage(slot as u16));
        self.builder.op(input, &[], &[class])[0]
    }

    /// The built-in inputs of the stage; `None` for other ones.
    pub(super) fn stage_builtin(&mut self, builtin: BuiltIn) -> Option<Vec<Value>> {
        let values = match (self.stage.kind, builtin) {
            (StageKind::Vertex { .. }, BuiltIn::VertexIndex) => {
                vec![self.stage_input(StageInput::VertexIndex, Class::Int)]
            }
            (StageKind::Vertex { .. }, BuiltIn::InstanceIndex) => {
                vec![self.stage_input(StageInput::InstanceIndex, Class::Int)]
            }
            (StageKind::Fragment { .. }, BuiltIn::Position { .. }) => (0..4)
                .map(|axis| self.stage_input(StageInput::Position(axis), Class::Float))
                .collect(),
            (StageKind::Fragment { .. }, BuiltIn::FrontFacing) => {
                vec![self.stage_input(StageInput::FrontFacing, Class::Int)]
            }
            _ => return None,
        };
        Some(values)
    }

    /// An input by its location.
    pub(super) fn stage_location(
        &mut self,
        ty: &TypeInner,
        location: u32,
        interpolation: Option<naga::Interpolation>,
        sampling: Option<naga::Sampling>,
    ) -> Result<Vec<Value>, Fail> {
        let (scalar, count) = numbers(ty)?;
        let class = class_of(scalar.kind);
        let kind = self.stage.kind;
        let input = |component: u8| -> Result<StageInput, Fail> {
            match kind {
                StageKind::Vertex { attributes, .. } => {
                    let attribute = attributes.iter().find(|(at, _)| *at == location);
                    let &(_, attribute) = attribute.ok_or_else(|| {
                        Fail::invalid(format!("nothing is at location {location}"))
                    })?;
                    Ok(StageInput::Attribute {
                        attribute,
                        component,
                    })
                }
                StageKind::Fragment { .. } => Ok(StageInput::Varying {
                    location,
                    component,
                    interpolation: interpolated(scalar, interpolation, sampling)?,
                }),
                StageKind::Compute => Err(Fail::unsupported(
                    "inputs of compute shaders other than built-in ones",
                )),
            }
        };
        let inputs = (0..count).map(input).collect::<Result<Vec<_>, _>>()?;
        Ok(inputs
            .into_iter()
            .map(|input| self.stage_input(input, class))
            .collect())
    }

    /// After the body: gives what the kernel returned.
    pub(super) fn end_stage(&mut self, frame: &Frame<'a>) -> Result<(), Fail> {
        if let StageKind::Compute = self.stage.kind {
            return Ok(());
        }
        let mut leaves = Vec::new();
        if let Some(result) = &frame.function.result {
            let ty = self.inner(result.ty);
            match (&result.binding, ty) {
                (None, TypeInner::Struct { members, .. }) => {
                    for member in members {
                        let ty = self.inner(member.ty);
                        self.outputs_of(ty, member.binding.as_ref(), &mut leaves)?;
                    }
                }
                (binding, ty) => self.outputs_of(ty, binding.as_ref(), &mut leaves)?,
            }
        }
        let mut colours: Vec<(u32, Vec<Value>)> = Vec::new();
        for (leaf, &variable) in leaves.into_iter().zip(&frame.result) {
            if let Some(output) = leaf {
                let value = self.builder.get(variable);
                self.give(output, value);
                if let StageOutput::Colour { target, .. } = output {
                    match colours.last_mut() {
                        Some((last, channels)) if *last == target => channels.push(value),
                        _ => colours.push((target, vec![value])),
                    }
                }
            }
        }
        if self.builder.instrument.probes {
            for (target, channels) in colours {
                self.where_alive(|this| this.builder.probe(Probed::Colour(target), &channels));
            }
        }
        if let Some(alive) = self.stage.alive
            && self.stage.discards
        {
            let value = self.builder.get(alive);
            self.give(StageOutput::Alive, value);
        }
        Ok(())
    }

    fn give(&mut self, output: StageOutput, value: Value) {
        let outputs = &mut self.builder.tree.resources.stage.outputs;
        // Locations and their components are fewer.
        let slot = outputs.len() as u16;
        outputs.push(output);
        self.builder.op(Op::StageOutput { slot }, &[value], &[]);
    }

    /// What the scalars of a returned value are; `None` for those nobody takes.
    fn outputs_of(
        &self,
        ty: &TypeInner,
        binding: Option<&naga::Binding>,
        out: &mut Vec<Option<StageOutput>>,
    ) -> Result<(), Fail> {
        let (_, count) = numbers(ty)?;
        for component in 0..count {
            out.push(match (self.stage.kind, binding) {
                (
                    StageKind::Vertex { .. },
                    Some(naga::Binding::BuiltIn(BuiltIn::Position { .. })),
                ) => Some(StageOutput::Position(component)),
                (
                    StageKind::Vertex { wanted, .. },
                    Some(&naga::Binding::Location {
                        location,
                        blend_src: None,
                        ..
                    }),
                ) => wanted
                    .iter()
                    .any(|input| {
                        matches!(*input, StageInput::Varying { location: l, component: c, .. }
                            if (l, c) == (location, component))
                    })
                    .then_some(StageOutput::Varying {
                        location,
                        component,
                    }),
                (StageKind::Fragment { .. }, Some(naga::Binding::BuiltIn(BuiltIn::FragDepth))) => {
                    Some(StageOutput::Depth)
                }
                (
                    StageKind::Fragment { targets },
                    Some(&naga::Binding::Location {
                        location,
                        blend_src: None,
                        ..
                    }),
                ) => (location < targets).then_some(StageOutput::Colour {
                    target: location,
                    channel: component,
                }),
                (_, Some(naga::Binding::BuiltIn(other))) => {
                    return Err(Fail::unsupported(format!("the built-in output {other:?}")));
                }
                (_, Some(naga::Binding::Location { .. })) => {
                    return Err(Fail::unsupported("blending with two sources"));
                }
                (_, None) => return Err(Fail::invalid("an output has no binding")),
            });
        }
        Ok(())
    }

    pub(super) fn discard(&mut self) -> Result<(), Fail> {
        let alive = self
            .stage
            .alive
            .ok_or_else(|| Fail::invalid("`discard` outside of a fragment kernel"))?;
        self.stage.discards = true;
        let none = self.builder.bool(false);
        self.builder.set(alive, none);
        Ok(())
    }

    /// Does what can be seen from outside: in fragment kernels for the lanes that
    /// are alive.
    pub(super) fn where_alive(&mut self, act: impl FnOnce(&mut Self)) {
        let Some(alive) = self.stage.alive else {
            return act(self);
        };
        let condition = self.builder.get(alive);
        let before = self.builder.snapshot();
        self.builder.begin();
        act(self);
        let accept = self.builder.end(true);
        self.builder.restore(&before);
        self.builder.begin();
        let reject = self.builder.end(true);
        self.builder.finish_if(condition, &before, accept, reject);
    }

    /// An atomic operation; the old value is 0 in lanes that are not alive.
    pub(super) fn atomic_where_alive(&mut self, op: Op, operands: &[Value]) -> Value {
        if self.stage.alive.is_none() {
            return self.builder.op(op, operands, &[Class::Int])[0];
        }
        let old = self.builder.new_variable(Class::Int);
        let zero = self.builder.int(0);
        self.builder.set(old, zero);
        self.where_alive(|this| {
            let value = this.builder.op(op, operands, &[Class::Int])[0];
            this.builder.set(old, value);
        });
        self.builder.get(old)
    }

    /// The difference to the right or down within the quad.
    pub(super) fn difference(&mut self, value: Value, down: bool, coarse: bool) -> Value {
        self.builder
            .op(Op::Derivative { down, coarse }, &[value], &[Class::Float])[0]
    }

    /// `dpdx`, `dpdy`, `fwidth` and their kin. Those that leave it open are the
    /// fine ones: of a fragment and its neighbour in the same row or column.
    pub(super) fn derivative(
        &mut self,
        frame: &mut Frame<'a>,
        axis: DerivativeAxis,
        control: DerivativeControl,
        expression: Handle<Expression>,
    ) -> Result<Vec<Value>, Fail> {
        if !self.stage.is_fragment() {
            return Err(Fail::unsupported("derivatives outside of fragment kernels"));
        }
        let coarse = control == DerivativeControl::Coarse;
        let half = self.ty(frame, expression).scalar().is_some_and(is_half);
        let values = self.scalars(frame, expression)?;
        let mut results = Vec::with_capacity(values.len());
        for value in values {
            let mut result = match axis {
                DerivativeAxis::X => self.difference(value, false, coarse),
                DerivativeAxis::Y => self.difference(value, true, coarse),
                DerivativeAxis::Width => {
                    let x = self.difference(value, false, coarse);
                    let y = self.difference(value, true, coarse);
                    let x = self.builder.arith(Arith::AbsF, &[x]);
                    let y = self.builder.arith(Arith::AbsF, &[y]);
                    self.builder.arith(Arith::AddF, &[x, y])
                }
            };
            if half {
                result = self.builder.arith(Arith::RoundHalf, &[result]);
            }
            results.push(result);
        }
        Ok(results)
    }
}

/// The scalar and the number of components of something with a location.
fn numbers(ty: &TypeInner) -> Result<(naga::Scalar, u8), Fail> {
    let (scalar, count) = match *ty {
        TypeInner::Scalar(scalar) => (scalar, 1),
        TypeInner::Vector { size, scalar } => (scalar, size as u8),
        _ => {
            return Err(Fail::unsupported(
                "inputs and outputs other than numbers and vectors of them",
            ));
        }
    };
    if is_half(scalar) {
        return Err(Fail::unsupported("inputs and outputs of f16"));
    }
    Ok((scalar, count))
}

fn interpolated(
    scalar: naga::Scalar,
    interpolation: Option<naga::Interpolation>,
    sampling: Option<naga::Sampling>,
) -> Result<Interpolation, Fail> {
    // With one sample the centroid is the centre.
    if sampling == Some(naga::Sampling::Sample) {
        return Err(Fail::unsupported("interpolation for each sample"));
    }
    match interpolation {
        Some(naga::Interpolation::Flat) => Ok(Interpolation::Flat),
        Some(naga::Interpolation::Linear) => Ok(Interpolation::Linear),
        Some(naga::Interpolation::PerVertex) => {
            Err(Fail::unsupported("interpolation by the kernel"))
        }
        None if scalar.kind != naga::ScalarKind::Float => Ok(Interpolation::Flat),
        None | Some(naga::Interpolation::Perspective) => Ok(Interpolation::Perspective),
    }
}
