//! naga's IR into the [`crate::ir`] tree: calls inlined, composites taken
//! apart, pointers resolved.

mod builder;
mod check;
mod convert;
mod expression;
mod image;
mod layout;
mod math;
mod place;
mod scan;
mod stage;
mod statement;
mod subgroup;

use std::collections::{HashMap, HashSet};

use naga::valid::{FunctionInfo, ModuleInfo};
use naga::{
    AddressSpace, Expression, Function, GlobalVariable, Handle, LocalVariable, Module, Span,
    TypeInner,
};

use self::builder::Builder;
use self::layout::class_of;
use self::place::Place;
pub(crate) use self::stage::StageKind;
use self::stage::StageState;
use crate::binding::{BindingInfo, describe_binding};
use crate::ir::{Input, Op, ScopeId, Tree, Value, Variable};
use crate::program::TranslateOptions;

/// What went wrong; the place is the translator's current span.
#[derive(Debug)]
pub(crate) enum Fail {
    Unsupported(String),
    Invalid(String),
    TooLarge {
        what: &'static str,
        size: u64,
        limit: u64,
    },
}

impl Fail {
    pub(crate) fn unsupported(construct: impl Into<String>) -> Self {
        Self::Unsupported(construct.into())
    }

    pub(crate) fn invalid(what: impl Into<String>) -> Self {
        Self::Invalid(what.into())
    }
}

/// A kernel as a tree, with what it needs bound.
pub(crate) struct Translation {
    pub(crate) tree: Tree,
    pub(crate) bindings: Vec<BindingInfo>,
    /// Bytes of the immediate data, which is the buffer after all bindings.
    pub(crate) immediates: Option<u32>,
}

/// The meaning of an expression while translating.
#[derive(Clone, Debug)]
enum Operand {
    /// A value, flattened into scalars.
    Scalars(Vec<Value>),
    /// A pointer.
    Place(Place),
    /// A texture or sampler, by its index in the bindings.
    Resource(u16),
}

/// A function being inlined.
struct Frame<'a> {
    function: &'a Function,
    info: &'a FunctionInfo,
    arguments: Vec<Operand>,
    operands: HashMap<Handle<Expression>, Operand>,
    locals: HashMap<Handle<LocalVariable>, Place>,
    result: Vec<Variable>,
    scope: ScopeId,
    /// Targets of `break` and `continue`, innermost last.
    breaks: Vec<ScopeId>,
    continues: Vec<ScopeId>,
}

pub(crate) struct Translator<'a> {
    module: &'a Module,
    info: &'a ModuleInfo,
    builder: Builder,
    bindings: Vec<BindingInfo>,
    immediates: Option<u32>,
    globals: HashMap<Handle<GlobalVariable>, Operand>,
    constants: HashMap<Handle<Expression>, Vec<Value>>,
    indexed: scan::Indexed,
    /// Variables of `var<private>`s, which any call may change.
    private_variables: Vec<Variable>,
    workgroup_size: [u32; 3],
    stage: StageState<'a>,
}

/// Translates the entry point of the given index.
///
/// On failure the span is of what could not be translated.
pub(crate) fn translate(
    module: &Module,
    info: &ModuleInfo,
    entry_point: usize,
    options: &TranslateOptions,
) -> Result<Translation, (Fail, Span)> {
    translate_stage(module, info, entry_point, &[], StageKind::Compute, options)
}

/// [`translate`] for any stage; bindings are those of the entry points `others` as
/// well.
pub(crate) fn translate_stage<'a>(
    module: &'a Module,
    info: &'a ModuleInfo,
    entry_point: usize,
    others: &[usize],
    kind: StageKind<'a>,
    options: &TranslateOptions,
) -> Result<Translation, (Fail, Span)> {
    let mut translator = Translator {
        module,
        info,
        builder: Builder::new(),
        bindings: Vec::new(),
        immediates: None,
        globals: HashMap::new(),
        constants: HashMap::new(),
        indexed: scan::indexed(module),
        private_variables: Vec::new(),
        workgroup_size: module.entry_points[entry_point].workgroup_size,
        stage: StageState {
            kind,
            ..StageState::default()
        },
    };
    // Checks know one workgroup at a time.
    translator.builder.tree.independent =
        !options.checks.any() && !scan::is_collective(module, info, entry_point);
    translator.builder.tree.resources.checks = options.checks;
    translator.builder.instrument = builder::Instrument {
        probes: options.sanitise,
        perturbs: options.perturb,
    };
    match translator.entry_point(entry_point, others) {
        Ok(()) => Ok(Translation {
            bindings: translator.bindings,
            immediates: translator.immediates,
            tree: translator.builder.finish(),
        }),
        Err(fail) => Err((fail, translator.builder.span)),
    }
}

impl<'a> Translator<'a> {
    fn entry_point(&mut self, index: usize, others: &[usize]) -> Result<(), Fail> {
        let entry = &self.module.entry_points[index];
        let info = self.info.get_entry_point(index);
        let others: Vec<&FunctionInfo> = others
            .iter()
            .map(|&other| self.info.get_entry_point(other))
            .collect();
        self.declare_globals(info, &others)?;
        self.begin_stage();
        let mut arguments = Vec::new();
        for argument in &entry.function.arguments {
            arguments.push(Operand::Scalars(
                self.entry_argument(argument.ty, argument.binding.as_ref())?,
            ));
        }
        let scope = self.builder.new_scope();
        let mut frame = self.frame(&entry.function, info, arguments, scope)?;
        self.builder.begin();
        let falls_through = self.block(
            &mut frame,
            statement::Sequence::of(&entry.function.body),
            &[scope],
        )?;
        let body = self.builder.end(falls_through);
        self.builder.finish_scope(scope, body);
        self.end_stage(&frame)
    }

    fn frame(
        &mut self,
        function: &'a Function,
        info: &'a FunctionInfo,
        arguments: Vec<Operand>,
        scope: ScopeId,
    ) -> Result<Frame<'a>, Fail> {
        let mut frame = Frame {
            function,
            info,
            arguments,
            operands: HashMap::new(),
            locals: HashMap::new(),
            result: Vec::new(),
            scope,
            breaks: Vec::new(),
            continues: Vec::new(),
        };
        if let Some(result) = &function.result {
            for leaf in self.leaves(self.inner(result.ty))? {
                frame.result.push(self.builder.new_variable(leaf.class()));
            }
        }
        let indexed = self.indexed.locals(function);
        for (handle, local) in function.local_variables.iter() {
            self.builder.span = function.local_variables.get_span(handle);
            let ty = self.inner(local.ty);
            let watched = self.is_watched(ty, local.init.is_some());
            let place = self.private_place(ty.clone(), watched || indexed.contains(&handle))?;
            let initial = match local.init {
                Some(init) => self.scalars(&mut frame, init)?,
                None => self.zero(self.inner(local.ty))?,
            };
            self.store(&place, &initial)?;
            if watched {
                self.forget_place(&place)?;
            }
            frame.locals.insert(handle, place);
        }
        Ok(frame)
    }

    fn declare_globals(
        &mut self,
        info: &FunctionInfo,
        others: &[&FunctionInfo],
    ) -> Result<(), Fail> {
        let mut names = HashSet::new();
        let mut immediates = None;
        for (handle, global) in self.module.global_variables.iter() {
            let elsewhere = others.iter().any(|other| !other[handle].is_empty());
            let shared = global.binding.is_some() || global.space == AddressSpace::Immediate;
            if info[handle].is_empty() && !(elsewhere && shared) {
                continue;
            }
            self.builder.span = self.module.global_variables.get_span(handle);
            let ty = self.inner(global.ty);
            let operand = match global.space {
                AddressSpace::Uniform | AddressSpace::Storage { .. } | AddressSpace::Handle => {
                    let index = self.buffer_index()?;
                    let binding = describe_binding(self.module, global)?;
                    names.insert(binding.name.clone());
                    let constant = !binding.is_writable();
                    self.bindings.push(binding);
                    match global.space {
                        AddressSpace::Handle => Operand::Resource(index),
                        _ => Operand::Place(Place::buffer(ty.clone(), index, constant)),
                    }
                }
                AddressSpace::WorkGroup => Operand::Place(self.workgroup_place(ty.clone())?),
                AddressSpace::Private => {
                    let watched = self.is_watched(ty, global.init.is_some());
                    let indexed = self.indexed.globals.contains(&handle);
                    let place = self.private_place(ty.clone(), watched || indexed)?;
                    let initial = match global.init {
                        Some(init) => self.global_constant(init)?,
                        None => self.zero(ty)?,
                    };
                    self.store(&place, &initial)?;
                    if watched {
                        self.forget_place(&place)?;
                    }
                    self.private_variables.extend(place.variables());
                    Operand::Place(place)
                }
                AddressSpace::Immediate => {
                    // A kernel has one such variable.
                    immediates = Some((handle, ty));
                    continue;
                }
                space => {
                    return Err(Fail::unsupported(format!(
                        "variables in the address space {space:?}"
                    )));
                }
            };
            self.globals.insert(handle, operand);
        }
        if let Some((handle, ty)) = immediates {
            self.immediates = Some(ty.size(self.module.to_ctx()));
            let place = Place::buffer(ty.clone(), self.buffer_index()?, true);
            self.globals.insert(handle, Operand::Place(place));
        }
        Ok(())
    }

    /// The index of what is bound next.
    fn buffer_index(&self) -> Result<u16, Fail> {
        u16::try_from(self.bindings.len()).map_err(|_| Fail::TooLarge {
            what: "number of bindings",
            size: self.bindings.len() as u64,
            limit: 1 << 16,
        })
    }

    /// A built-in input, or a struct of them.
    fn entry_argument(
        &mut self,
        ty: Handle<naga::Type>,
        binding: Option<&naga::Binding>,
    ) -> Result<Vec<Value>, Fail> {
        match (binding, self.inner(ty)) {
            (Some(naga::Binding::BuiltIn(builtin)), _) => match self.stage_builtin(*builtin) {
                Some(values) => Ok(values),
                None => self.builtin(*builtin),
            },
            (
                Some(&naga::Binding::Location {
                    location,
                    interpolation,
                    sampling,
                    ..
                }),
                ty,
            ) => self.stage_location(ty, location, interpolation, sampling),
            (None, TypeInner::Struct { members, .. }) => {
                let mut values = Vec::new();
                for member in members {
                    values.extend(self.entry_argument(member.ty, member.binding.as_ref())?);
                }
                Ok(values)
            }
            _ => Err(Fail::invalid("an input has no binding")),
        }
    }

    fn builtin(&mut self, builtin: naga::BuiltIn) -> Result<Vec<Value>, Fail> {
        use naga::BuiltIn as B;
        let size = self.workgroup_size;
        let values = match builtin {
            B::LocalInvocationId => (0..3).map(|axis| self.local_id(axis)).collect(),
            B::LocalInvocationIndex => vec![self.input(Input::LocalIndex)],
            B::WorkGroupId => (0..3).map(|axis| self.workgroup_id(axis)).collect(),
            B::NumWorkGroups => (0..3)
                .map(|axis| self.input(Input::NumWorkgroups(axis)))
                .collect(),
            B::GlobalInvocationId => (0..3_u8)
                .map(|axis| match size[usize::from(axis)] {
                    1 => self.workgroup_id(axis),
                    size => self.input(Input::GlobalId { axis, size }),
                })
                .collect(),
            B::WorkGroupSize => size.iter().map(|&s| self.builder.int(s)).collect(),
            B::SubgroupSize => vec![self.subgroup_size()],
            B::SubgroupInvocationId => vec![self.subgroup_invocation_id()],
            B::SubgroupId => vec![self.subgroup_id()],
            B::NumSubgroups => vec![self.num_subgroups()],
            other => return Err(Fail::unsupported(format!("the built-in input {other:?}"))),
        };
        Ok(values)
    }

    fn local_id(&mut self, axis: u8) -> Value {
        if self.workgroup_size[usize::from(axis)] == 1 {
            return self.builder.int(0);
        }
        self.input(Input::LocalId(axis))
    }

    fn workgroup_id(&mut self, axis: u8) -> Value {
        self.input(if axis == 0 && self.builder.tree.independent {
            Input::BatchedWorkgroupX
        } else {
            Input::WorkgroupId(axis)
        })
    }

    fn input(&mut self, input: Input) -> Value {
        self.builder
            .op(Op::Input(input), &[], &[crate::ir::Class::Int])[0]
    }

    /// The zero value of a type.
    fn zero(&mut self, ty: &TypeInner) -> Result<Vec<Value>, Fail> {
        Ok(self
            .leaves(ty)?
            .into_iter()
            .map(|leaf| self.builder.constant(class_of(leaf.kind), 0))
            .collect())
    }
}
