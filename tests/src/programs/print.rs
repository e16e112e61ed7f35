//! Programs as WGSL.

use std::collections::BTreeSet;
use std::fmt::{self, Write as _};

use super::grammar::*;

/// The variables and types that the text has to declare.
#[derive(Default)]
struct Used {
    private: BTreeSet<usize>,
    workgroup: BTreeSet<usize>,
    constants: BTreeSet<usize>,
    routines: BTreeSet<usize>,
    /// Structures by number, with their declarations.
    structures: Vec<(usize, String)>,
}

impl fmt::Display for Program {
    /// The program as WGSL. What is not used is not declared.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut printer = Printer {
            program: self,
            used: Used::default(),
            depth: 1,
        };
        let main = printer.block(&self.main);
        // Functions that functions call are before them.
        let mut routines = Vec::new();
        for index in (0..self.routines.len()).rev() {
            if printer.used.routines.contains(&index) {
                routines.push(printer.routine(index));
            }
        }
        let mut variables = String::new();
        for &index in &printer.used.constants.clone() {
            let (ty, words) = &self.constants[index];
            let (name, value) = (printer.ty(ty), printer.value(ty, words));
            let _ = writeln!(variables, "const c{index}: {name} = {value};");
        }
        for &index in &printer.used.private.clone() {
            let (ty, words) = &self.private[index];
            let (name, value) = (printer.ty(ty), printer.value(ty, words));
            let _ = writeln!(variables, "var<private> g{index}: {name} = {value};");
        }
        for &index in &printer.used.workgroup.clone() {
            let name = printer.workgroup(&self.workgroup[index]);
            let _ = writeln!(variables, "var<workgroup> w{index}: {name};");
        }
        printer.used.structures.sort();
        for (_, declaration) in &printer.used.structures {
            f.write_str(declaration)?;
        }
        f.write_str(concat!(
            "@group(0) @binding(0) var<storage, read> data: array<u32>;\n",
            "@group(0) @binding(1) var<storage, read> reals: array<f32>;\n",
            "@group(0) @binding(2) var<storage, read_write> results: array<u32>;\n",
            "@group(0) @binding(3) var<storage, read_write> tallies: array<atomic<u32>>;\n",
            "@group(0) @binding(4) var<storage, read_write> signed_tallies: array<atomic<i32>>;\n",
        ))?;
        f.write_str(&variables)?;
        for text in routines.iter().rev() {
            f.write_str(text)?;
        }
        let [x, y, z] = self.size;
        let base = if main.contains("results[base") {
            format!(
                "    let base = ((group.z * groups.y + group.y) * groups.x + group.x) * {}u + lane * {}u;\n",
                self.lanes() as usize * self.slots,
                self.slots,
            )
        } else {
            String::new()
        };
        write!(
            f,
            "@compute @workgroup_size({x}, {y}, {z})\n\
             fn main(@builtin(local_invocation_index) lane: u32, @builtin(local_invocation_id) local: vec3<u32>,\n        \
                     @builtin(workgroup_id) group: vec3<u32>, @builtin(global_invocation_id) global: vec3<u32>,\n        \
                     @builtin(num_workgroups) groups: vec3<u32>) {{\n\
             {base}{main}}}\n",
        )
    }
}

struct Printer<'a> {
    program: &'a Program,
    used: Used,
    depth: usize,
}

impl Printer<'_> {
    fn routine(&mut self, index: usize) -> String {
        let routine = &self.program.routines[index];
        let parameters: Vec<String> = routine
            .parameters
            .iter()
            .map(|parameter| {
                let ty = self.ty(&parameter.ty);
                let id = parameter.id;
                match parameter.passing {
                    Passing::Value => format!("v{id}: {ty}"),
                    Passing::Function => format!("v{id}: ptr<function, {ty}>"),
                    Passing::Private => format!("v{id}: ptr<private, {ty}>"),
                }
            })
            .collect();
        let result = match &routine.result {
            Some(ty) => format!(" -> {}", self.ty(ty)),
            None => String::new(),
        };
        let body = self.block(&routine.body);
        format!(
            "fn f{index}({}){result} {{\n{body}}}\n",
            parameters.join(", ")
        )
    }

    fn ty(&mut self, ty: &Type) -> String {
        match ty {
            Type::Scalar(scalar) => scalar_name(*scalar).to_owned(),
            Type::Vector(scalar, size) => format!("vec{size}<{}>", scalar_name(*scalar)),
            Type::Matrix { columns, rows } => format!("mat{columns}x{rows}<f32>"),
            Type::Array(element, size) => format!("array<{}, {size}>", self.ty(element)),
            Type::Struct(structure) => {
                let index = structure.index;
                if self.used.structures.iter().all(|(seen, _)| *seen != index) {
                    let mut text = format!("struct S{index} {{ ");
                    for (i, member) in structure.members.iter().enumerate() {
                        let member = self.ty(member);
                        let _ = write!(text, "m{i}: {member}, ");
                    }
                    text.push_str("}\n");
                    self.used.structures.push((index, text));
                }
                format!("S{index}")
            }
        }
    }

    fn workgroup(&mut self, variable: &Workgroup) -> String {
        let lanes = self.program.lanes();
        match variable {
            Workgroup::Lanes(ty) => format!("array<{}, {lanes}>", self.ty(ty)),
            Workgroup::Single(ty) => self.ty(ty),
            Workgroup::LaneAtomics(scalar) => {
                format!("array<atomic<{}>, {lanes}>", scalar_name(*scalar))
            }
            Workgroup::Counters(scalar, count) => {
                format!("array<atomic<{}>, {count}>", scalar_name(*scalar))
            }
        }
    }

    /// A value of a type as a constant expression.
    fn value(&mut self, ty: &Type, words: &[u32]) -> String {
        if let Type::Scalar(scalar) = ty {
            return literal(*scalar, words[0]);
        }
        let mut parts = Vec::new();
        match ty {
            Type::Struct(structure) => {
                let mut at = 0;
                for member in &structure.members {
                    let end = at + member.words();
                    parts.push(self.value(member, &words[at..end]));
                    at = end;
                }
            }
            _ => {
                if let Some((element, _)) = ty.element() {
                    for part in words.chunks(element.words()) {
                        parts.push(self.value(&element, part));
                    }
                }
            }
        }
        format!("{}({})", self.ty(ty), parts.join(", "))
    }

    fn indent(&self) -> String {
        "    ".repeat(self.depth)
    }

    fn block(&mut self, block: &Block) -> String {
        let mut text = String::new();
        for stmt in block {
            let stmt = self.stmt(stmt);
            let _ = writeln!(text, "{}{stmt}", self.indent());
        }
        text
    }

    /// A block in braces, the closing one on a line of its own.
    fn braces(&mut self, block: &Block) -> String {
        self.braces_around("", block, "")
    }

    /// The same with statements before and after, as text.
    fn braces_around(&mut self, before: &str, block: &Block, after: &str) -> String {
        self.depth += 1;
        let indent = self.indent();
        let line = |text: &str| {
            if text.is_empty() {
                String::new()
            } else {
                format!("{indent}{text}\n")
            }
        };
        let text = format!("{{\n{}{}{}", line(before), self.block(block), line(after));
        self.depth -= 1;
        format!("{text}{}}}", self.indent())
    }

    fn stmt(&mut self, stmt: &Stmt) -> String {
        match stmt {
            Stmt::Let(id, value) => format!("let v{id} = {};", self.expr(value)),
            Stmt::Var(id, ty, value) => {
                let value = value
                    .as_ref()
                    .map_or_else(String::new, |value| format!(" = {}", self.expr(value)));
                format!("var v{id}: {}{value};", self.ty(ty))
            }
            Stmt::Assign(place, value) => {
                format!("{} = {};", self.place(place), self.expr(value))
            }
            Stmt::Update(op, place, value) => {
                let place = self.place(place);
                format!("{place} {}= {};", op.symbol(), self.expr(value))
            }
            Stmt::Step(place, up) => {
                format!("{}{};", self.place(place), if *up { "++" } else { "--" })
            }
            Stmt::Ignore(value) => format!("_ = {};", self.expr(value)),
            Stmt::If(condition, accept, reject) => {
                let mut text = format!("if {} {}", self.expr(condition), self.braces(accept));
                match reject.as_slice() {
                    [] => {}
                    [nested @ Stmt::If(..)] => {
                        let _ = write!(text, " else {}", self.stmt(nested));
                    }
                    _ => {
                        let _ = write!(text, " else {}", self.braces(reject));
                    }
                }
                text
            }
            Stmt::Switch(selector, cases) => self.switch(selector, cases),
            Stmt::For {
                id,
                scalar,
                from,
                step,
                trips,
                body,
            } => {
                let end = from.wrapping_add(step.wrapping_mul(*trips));
                let [from, end, step] = [*from, end, *step].map(|bits| literal(*scalar, bits));
                format!(
                    "for (var v{id} = {from}; v{id} != {end}; v{id} += {step}) {}",
                    self.braces(body)
                )
            }
            Stmt::While {
                id,
                trips,
                condition,
                body,
            } => {
                let condition = self.expr(condition);
                let body = {
                    self.depth += 1;
                    let body = self.braces_around(&format!("v{id}++;"), body, "");
                    self.depth -= 1;
                    body
                };
                let indent = self.indent();
                format!(
                    "{{\n{indent}    var v{id} = 0u;\n{indent}    while v{id} < {trips}u && {condition} {body}\n{indent}}}"
                )
            }
            Stmt::Loop {
                id,
                trips,
                body,
                continuing,
                until,
            } => {
                let until = match until {
                    None => format!("v{id} >= {trips}u"),
                    Some(until) => format!("v{id} >= {trips}u || {}", self.expr(until)),
                };
                self.depth += 2;
                let end = format!("v{id}++;\n{}    break if {until};", self.indent());
                let continuing = self.braces_around("", continuing, &end);
                self.depth -= 1;
                let body = self.braces_around("", body, &format!("continuing {continuing}"));
                self.depth -= 1;
                let indent = self.indent();
                format!("{{\n{indent}    var v{id} = 0u;\n{indent}    loop {body}\n{indent}}}")
            }
            Stmt::Break => "break;".to_owned(),
            Stmt::Continue => "continue;".to_owned(),
            Stmt::Return(None) => "return;".to_owned(),
            Stmt::Return(Some(value)) => format!("return {};", self.expr(value)),
            Stmt::Call(routine, arguments) => format!("{};", self.call(*routine, arguments)),
            Stmt::Block(block) => self.braces(block),
            Stmt::Emit(slot, value) => {
                let text = self.expr(value);
                let word = match value.ty.scalar() {
                    Some(Scalar::Bool) => format!("select(0u, 1u, {text})"),
                    Some(Scalar::U32) | None => text,
                    Some(Scalar::I32 | Scalar::F32) => format!("bitcast<u32>({text})"),
                };
                format!("results[base + {slot}u] = {word};")
            }
            Stmt::Alone(lane, block) => {
                let lane = lane % self.program.lanes();
                format!("if lane == {lane}u {}", self.braces(block))
            }
            Stmt::Phase(block, barrier) => {
                let barrier = match barrier {
                    Barrier::Workgroup => "workgroupBarrier();",
                    Barrier::Both => "storageBarrier(); workgroupBarrier();",
                };
                format!("{}\n{}{barrier}", self.braces(block), self.indent())
            }
            Stmt::UniformLoad(id, variable) => {
                self.used.workgroup.insert(*variable);
                format!("let v{id} = workgroupUniformLoad(&w{variable});")
            }
            Stmt::Count(..)
            | Stmt::CompareAndAdd(..)
            | Stmt::Ticket { .. }
            | Stmt::OwnAtomic { .. } => self.atomic(stmt),
        }
    }

    fn switch(&mut self, selector: &Expr, cases: &[Case]) -> String {
        let scalar = selector.ty.scalar().unwrap_or(Scalar::U32);
        let mut text = format!("switch {} {{\n", self.expr(selector));
        self.depth += 1;
        for case in cases {
            let mut selectors: Vec<String> = case
                .values
                .iter()
                .map(|bits| literal(scalar, *bits))
                .collect();
            if case.default {
                selectors.push("default".to_owned());
            }
            let head = match selectors.as_slice() {
                [only] if case.default => only.clone(),
                _ => format!("case {}", selectors.join(", ")),
            };
            let body = self.braces(&case.body);
            let _ = writeln!(text, "{}{head}: {body}", self.indent());
        }
        self.depth -= 1;
        format!("{text}{}}}", self.indent())
    }

    fn atomic(&mut self, stmt: &Stmt) -> String {
        match stmt {
            Stmt::Count(counter, atomic, value) => {
                let counter = self.counter(*counter);
                format!("{}(&{counter}, {});", atomic.name(), self.expr(value))
            }
            Stmt::CompareAndAdd(counter, _, value) => {
                let counter = self.counter(*counter);
                let value = self.expr(value);
                format!(
                    "{{ let addend = {value}; var old = atomicLoad(&{counter}); \
                     loop {{ let swap = atomicCompareExchangeWeak(&{counter}, old, old + addend); \
                     if swap.exchanged {{ break; }} old = swap.old_value; }} }}"
                )
            }
            Stmt::Ticket { from, scalar, draw } => {
                let Draw { to, update, factor } = draw;
                let (from, to) = (self.counter(*from), self.counter(*to));
                let one = literal(*scalar, 1);
                let factor = literal(*scalar, *factor);
                format!(
                    "{{ let ticket = atomicAdd(&{from}, {one}); {}(&{to}, ticket * {factor}); }}",
                    update.name()
                )
            }
            Stmt::OwnAtomic {
                id,
                variable,
                atomic,
                compare,
                value,
            } => {
                self.used.workgroup.insert(*variable);
                let compare = compare
                    .as_ref()
                    .map_or_else(String::new, |compare| format!(", {}", self.expr(compare)));
                let value = self.expr(value);
                let call = format!("{}(&w{variable}[lane]{compare}, {value})", atomic.name());
                match atomic {
                    Atomic::Store => {
                        format!("{call}; let v{id} = atomicLoad(&w{variable}[lane]);")
                    }
                    Atomic::CompareExchange => format!(
                        "let x{id} = {call}; let v{id} = select(x{id}.old_value, ~x{id}.old_value, x{id}.exchanged);"
                    ),
                    _ => format!("let v{id} = {call};"),
                }
            }
            _ => String::new(),
        }
    }

    fn counter(&mut self, counter: Counter) -> String {
        match counter {
            Counter::Tally(index) => format!("tallies[{index}]"),
            Counter::SignedTally(index) => format!("signed_tallies[{index}]"),
            Counter::Workgroup(variable, index) => {
                self.used.workgroup.insert(variable);
                format!("w{variable}[{index}]")
            }
        }
    }

    fn list(&mut self, parts: &[Expr]) -> String {
        let parts: Vec<String> = parts.iter().map(|part| self.expr(part)).collect();
        parts.join(", ")
    }

    fn call(&mut self, routine: usize, arguments: &[Argument]) -> String {
        self.used.routines.insert(routine);
        let arguments: Vec<String> = arguments
            .iter()
            .map(|argument| match argument {
                Argument::Value(value) => self.expr(value),
                Argument::Pointer(Root::Pointer(id)) => format!("v{id}"),
                Argument::Pointer(root) => format!("&{}", self.root(root)),
            })
            .collect();
        format!("f{routine}({})", arguments.join(", "))
    }

    /// An index, bounded.
    fn index(&mut self, index: &Expr, size: usize) -> String {
        match index.kind {
            ExprKind::Literal(bits) => format!("[{}]", bits as usize % size.max(1)),
            _ => format!("[{} % {size}u]", self.expr(index)),
        }
    }

    fn expr(&mut self, expr: &Expr) -> String {
        match &expr.kind {
            ExprKind::Literal(bits) => literal(expr.ty.scalar().unwrap_or(Scalar::U32), *bits),
            ExprKind::Zero => format!("{}()", self.ty(&expr.ty)),
            ExprKind::Constant(index) => {
                self.used.constants.insert(*index);
                format!("c{index}")
            }
            ExprKind::Input(input) => match input {
                Input::Lane => "lane",
                Input::Local => "local",
                Input::Group => "group",
                Input::Global => "global",
                Input::Groups => "groups",
            }
            .to_owned(),
            ExprKind::Data(index) => {
                let size = self.program.data.len();
                format!("data{}", self.index(index, size))
            }
            ExprKind::Reals(index) => {
                let size = self.program.reals.len();
                format!("reals{}", self.index(index, size))
            }
            ExprKind::Name(id) => format!("v{id}"),
            ExprKind::Load(place) => self.place(place),
            ExprKind::Unary(op, a) => {
                let op = match op {
                    Unary::Negate => "-",
                    Unary::Not => "!",
                    Unary::Complement => "~",
                };
                // `--` is a token of its own.
                format!("{op}({})", self.expr(a))
            }
            ExprKind::Binary(op, a, b) => {
                let a = self.expr(a);
                format!("({a} {} {})", op.symbol(), self.expr(b))
            }
            ExprKind::Function(function, parts) => {
                format!("{}({})", function.name(), self.list(parts))
            }
            ExprKind::Call(routine, arguments) => self.call(*routine, arguments),
            ExprKind::Construct(parts) => {
                let ty = self.ty(&expr.ty);
                format!("{ty}({})", self.list(parts))
            }
            ExprKind::Convert(a) => {
                let ty = self.ty(&expr.ty);
                let text = self.expr(a);
                let from = self.ty(&a.ty);
                match (a.ty.scalar(), expr.ty.scalar()) {
                    (Some(Scalar::F32), Some(Scalar::I32)) => format!(
                        "{ty}(clamp({text}, {from}(-2147483648.0f), {from}(2147483520.0f)))"
                    ),
                    (Some(Scalar::F32), Some(Scalar::U32)) => {
                        format!("{ty}(clamp({text}, {from}(0.0f), {from}(4294967040.0f)))")
                    }
                    _ => format!("{ty}({text})"),
                }
            }
            ExprKind::Bitcast(a) => {
                let ty = self.ty(&expr.ty);
                format!("bitcast<{ty}>({})", self.expr(a))
            }
            ExprKind::Swizzle(a, components) => {
                let letters: String = components.iter().map(|i| letter(*i)).collect();
                format!("{}.{letters}", self.expr(a))
            }
            ExprKind::Member(a, index) => format!("{}.m{index}", self.expr(a)),
            ExprKind::Index(a, index) => {
                let size = a.ty.element().map_or(1, |(_, size)| size);
                let a = self.expr(a);
                format!("{a}{}", self.index(index, size))
            }
            ExprKind::AtomicLoad(variable, index) => {
                self.used.workgroup.insert(*variable);
                let size = match self.program.workgroup[*variable] {
                    Workgroup::Counters(_, count) => count,
                    _ => self.program.lanes() as usize,
                };
                format!("atomicLoad(&w{variable}{})", self.index(index, size))
            }
        }
    }

    fn root(&mut self, root: &Root) -> String {
        match root {
            Root::Local(id) => format!("v{id}"),
            Root::Pointer(id) => format!("(*v{id})"),
            Root::Private(index) => {
                self.used.private.insert(*index);
                format!("g{index}")
            }
            Root::Own(variable) => {
                self.used.workgroup.insert(*variable);
                format!("w{variable}[lane]")
            }
            Root::Shared(variable, index) => {
                self.used.workgroup.insert(*variable);
                let lanes = self.program.lanes() as usize;
                format!("w{variable}{}", self.index(index, lanes))
            }
            Root::Single(variable) => {
                self.used.workgroup.insert(*variable);
                format!("w{variable}")
            }
        }
    }

    fn place(&mut self, place: &Place) -> String {
        let mut text = self.root(&place.root);
        let mut ty = Some(place.of.clone());
        for step in &place.path {
            let element = ty.as_ref().and_then(Type::element);
            match step {
                Step::Member(index) => {
                    let _ = write!(text, ".m{index}");
                    ty = ty.and_then(|ty| Some(ty.member(*index)?.0));
                    continue;
                }
                Step::Component(index) => {
                    let _ = write!(text, ".{}", letter(*index));
                }
                Step::Index(index) => {
                    let size = element.as_ref().map_or(1, |(_, size)| *size);
                    text.push_str(&self.index(index, size));
                }
            }
            ty = element.map(|(element, _)| element);
        }
        text
    }
}

const fn scalar_name(scalar: Scalar) -> &'static str {
    match scalar {
        Scalar::Bool => "bool",
        Scalar::I32 => "i32",
        Scalar::U32 => "u32",
        Scalar::F32 => "f32",
    }
}

fn letter(component: usize) -> char {
    ['x', 'y', 'z', 'w'][component % 4]
}

/// A literal of the given bits. Infinities and NaNs have none, and do not occur.
fn literal(scalar: Scalar, bits: u32) -> String {
    match scalar {
        Scalar::Bool => (bits != 0).to_string(),
        // The smallest number is not the negation of a number.
        Scalar::I32 if bits as i32 == i32::MIN => "(-2147483647i - 1i)".to_owned(),
        Scalar::I32 => format!("{}i", bits as i32),
        Scalar::U32 => format!("{bits}u"),
        Scalar::F32 => format!("{:?}f", f32::from_bits(bits)),
    }
}
