//! Random programs with nested, divergent control flow against an evaluation
//! of the same program one invocation at a time: results, and which indices are
//! outside of an array.

use crate::common;

use std::cell::Cell;
use std::fmt::Write as _;

use common::*;
use etalon_cpu::{BoundResource, Checks, Executor, Finding, FindingKind};

const VARIABLES: usize = 5;

#[derive(Clone, Debug)]
enum Expr {
    Constant(u32),
    Variable(usize),
    /// The loop's counter, by nesting level.
    Counter(usize),
    Lane,
    Group,
    Add(Box<Expr>, Box<Expr>),
    Multiply(Box<Expr>, Box<Expr>),
    Xor(Box<Expr>, Box<Expr>),
    Shift(Box<Expr>),
    /// A call of a function with early returns.
    Call(Box<Expr>, Box<Expr>),
    /// An element of an array variable.
    Element(Box<Expr>),
}

#[derive(Clone, Debug)]
enum Condition {
    Less(Expr, Expr),
    Bit(Expr, u32),
    And(Box<Condition>, Box<Condition>),
    Or(Box<Condition>, Box<Condition>),
}

#[derive(Clone, Debug)]
enum Stmt {
    Assign(usize, Expr),
    SetElement(Expr, Expr),
    If(Condition, Vec<Stmt>, Vec<Stmt>),
    /// At most so many trips.
    For(u32, Vec<Stmt>),
    /// A loop with a `continuing` block and a condition at its end.
    Loop(u32, Vec<Stmt>, usize, Expr, Condition),
    Switch(Expr, Vec<(Vec<u32>, Vec<Stmt>)>, Vec<Stmt>),
    BreakIf(Condition),
    ContinueIf(Condition),
    ReturnIf(Condition),
}

/// A small generator of numbers; the seed names the program.
struct Random(u64);

impl Random {
    fn below(&mut self, limit: u32) -> u32 {
        self.0 = self
            .0
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 33) as u32 % limit
    }

    fn expr(&mut self, depth: u32, loops: usize) -> Expr {
        let pick = if depth == 0 {
            self.below(5)
        } else {
            self.below(12)
        };
        let sub = |random: &mut Self| Box::new(random.expr(depth - 1, loops));
        match pick {
            0 => Expr::Constant(self.below(9)),
            1 | 2 => Expr::Variable(self.below(VARIABLES as u32) as usize),
            3 if loops > 0 => Expr::Counter(self.below(loops as u32) as usize),
            3 => Expr::Group,
            4 => Expr::Lane,
            5 | 6 => Expr::Add(sub(self), sub(self)),
            7 => Expr::Multiply(sub(self), sub(self)),
            8 => Expr::Xor(sub(self), sub(self)),
            9 => Expr::Shift(sub(self)),
            10 => Expr::Element(sub(self)),
            _ => Expr::Call(sub(self), sub(self)),
        }
    }

    fn condition(&mut self, depth: u32, loops: usize) -> Condition {
        match self.below(if depth == 0 { 2 } else { 4 }) {
            0 => Condition::Less(self.expr(1, loops), self.expr(1, loops)),
            1 => Condition::Bit(self.expr(1, loops), self.below(4)),
            2 => Condition::And(
                Box::new(self.condition(depth - 1, loops)),
                Box::new(self.condition(depth - 1, loops)),
            ),
            _ => Condition::Or(
                Box::new(self.condition(depth - 1, loops)),
                Box::new(self.condition(depth - 1, loops)),
            ),
        }
    }

    fn block(&mut self, depth: u32, loops: usize) -> Vec<Stmt> {
        (0..1 + self.below(4))
            .map(|_| self.stmt(depth, loops))
            .collect()
    }

    fn stmt(&mut self, depth: u32, loops: usize) -> Stmt {
        let variable = self.below(VARIABLES as u32) as usize;
        match self.below(if depth == 0 { 5 } else { 16 }) {
            0..=2 => Stmt::Assign(variable, self.expr(2, loops)),
            3 => Stmt::SetElement(self.expr(1, loops), self.expr(1, loops)),
            4 if loops > 0 => match self.below(3) {
                0 => Stmt::ContinueIf(self.condition(1, loops)),
                _ => Stmt::BreakIf(self.condition(1, loops)),
            },
            4 => Stmt::Assign(variable, self.expr(1, loops)),
            5..=8 => {
                let accept = self.block(depth - 1, loops);
                let reject = if self.below(2) == 0 {
                    Vec::new()
                } else {
                    self.block(depth - 1, loops)
                };
                Stmt::If(self.condition(1, loops), accept, reject)
            }
            9..=11 => Stmt::For(1 + self.below(5), self.block(depth - 1, loops + 1)),
            12 => Stmt::Loop(
                1 + self.below(4),
                self.block(depth - 1, loops + 1),
                variable,
                self.expr(1, loops + 1),
                self.condition(0, loops + 1),
            ),
            13 | 14 => {
                let cases = (0..1 + self.below(3))
                    .map(|i| (vec![3 * i, 3 * i + 1], self.block(depth - 1, loops)))
                    .collect();
                Stmt::Switch(self.expr(1, loops), cases, self.block(depth - 1, loops))
            }
            _ => Stmt::ReturnIf(self.condition(1, loops)),
        }
    }
}

fn expr_text(expr: &Expr) -> String {
    match expr {
        Expr::Constant(value) => format!("{value}u"),
        Expr::Variable(i) => format!("v{i}"),
        Expr::Counter(i) => format!("i{i}"),
        Expr::Lane => "lane".to_owned(),
        Expr::Group => "group".to_owned(),
        Expr::Add(a, b) => format!("({} + {})", expr_text(a), expr_text(b)),
        Expr::Multiply(a, b) => format!("({} * {})", expr_text(a), expr_text(b)),
        Expr::Xor(a, b) => format!("({} ^ {})", expr_text(a), expr_text(b)),
        Expr::Shift(a) => format!("({} >> 1u)", expr_text(a)),
        Expr::Call(a, b) => format!("helper({}, {})", expr_text(a), expr_text(b)),
        // The parser refuses constants outside; so it sees none.
        Expr::Element(a) => format!("elements[({} ^ (lane & 0u)) & 7u]", expr_text(a)),
    }
}

fn condition_text(condition: &Condition) -> String {
    match condition {
        Condition::Less(a, b) => format!("{} < {}", expr_text(a), expr_text(b)),
        Condition::Bit(a, bit) => format!("(({} >> {bit}u) & 1u) == 1u", expr_text(a)),
        Condition::And(a, b) => format!("({}) && ({})", condition_text(a), condition_text(b)),
        Condition::Or(a, b) => format!("({}) || ({})", condition_text(a), condition_text(b)),
    }
}

fn block_text(block: &[Stmt], loops: usize, out: &mut String) {
    for stmt in block {
        match stmt {
            Stmt::Assign(i, value) => writeln!(out, "v{i} = {};", expr_text(value)).unwrap(),
            Stmt::SetElement(i, value) => writeln!(
                out,
                "elements[({} ^ (lane & 0u)) & 7u] = {};",
                expr_text(i),
                expr_text(value)
            )
            .unwrap(),
            Stmt::If(condition, accept, reject) => {
                writeln!(out, "if {} {{", condition_text(condition)).unwrap();
                block_text(accept, loops, out);
                out.push_str("} else {\n");
                block_text(reject, loops, out);
                out.push_str("}\n");
            }
            Stmt::For(trips, body) => {
                writeln!(
                    out,
                    "for (var i{loops} = 0u; i{loops} < {trips}u; i{loops}++) {{"
                )
                .unwrap();
                block_text(body, loops + 1, out);
                out.push_str("}\n");
            }
            Stmt::Loop(trips, body, variable, value, condition) => {
                writeln!(out, "{{ var i{loops} = 0u; loop {{").unwrap();
                block_text(body, loops + 1, out);
                writeln!(out, "continuing {{ v{variable} = {}; i{loops}++; break if i{loops} >= {trips}u || ({}); }} }} }}", expr_text(value), condition_text(condition)).unwrap();
            }
            Stmt::Switch(selector, cases, default) => {
                writeln!(out, "switch {} {{", expr_text(selector)).unwrap();
                for (values, body) in cases {
                    let values: Vec<String> = values.iter().map(|v| format!("{v}u")).collect();
                    writeln!(out, "case {}: {{", values.join(", ")).unwrap();
                    block_text(body, loops, out);
                    out.push_str("}\n");
                }
                out.push_str("default: {\n");
                block_text(default, loops, out);
                out.push_str("}\n}\n");
            }
            Stmt::BreakIf(condition) => {
                writeln!(out, "if {} {{ break; }}", condition_text(condition)).unwrap()
            }
            Stmt::ContinueIf(condition) => {
                writeln!(out, "if {} {{ continue; }}", condition_text(condition)).unwrap()
            }
            Stmt::ReturnIf(condition) => writeln!(
                out,
                "if {} {{ return Result(v0, v1, v2, v3, v4); }}",
                condition_text(condition)
            )
            .unwrap(),
        }
    }
}

/// Where control goes.
#[derive(PartialEq)]
enum Flow {
    Next,
    Break,
    Continue,
    Return,
}

struct Invocation {
    variables: [u32; VARIABLES],
    elements: [u32; 4],
    counters: Vec<u32>,
    lane: u32,
    group: u32,
    /// How often an index was outside of the array.
    outside: Cell<u64>,
}

fn helper(a: u32, b: u32) -> u32 {
    if a & 1 == 1 {
        return b.wrapping_add(3);
    }
    for i in 0..3_u32 {
        if b.wrapping_add(i) & 7 == 2 {
            return a ^ i;
        }
    }
    a.wrapping_add(b)
}

impl Invocation {
    /// Which element an index means: the last where there is none.
    fn element(&self, index: u32) -> usize {
        let index = index & 7;
        if index > 3 {
            self.outside.set(self.outside.get() + 1);
        }
        index.min(3) as usize
    }

    fn expr(&self, expr: &Expr) -> u32 {
        match expr {
            Expr::Constant(value) => *value,
            Expr::Variable(i) => self.variables[*i],
            Expr::Counter(i) => self.counters[*i],
            Expr::Lane => self.lane,
            Expr::Group => self.group,
            Expr::Add(a, b) => self.expr(a).wrapping_add(self.expr(b)),
            Expr::Multiply(a, b) => self.expr(a).wrapping_mul(self.expr(b)),
            Expr::Xor(a, b) => self.expr(a) ^ self.expr(b),
            Expr::Shift(a) => self.expr(a) >> 1,
            Expr::Call(a, b) => helper(self.expr(a), self.expr(b)),
            Expr::Element(a) => self.elements[self.element(self.expr(a))],
        }
    }

    fn holds(&self, condition: &Condition) -> bool {
        match condition {
            Condition::Less(a, b) => self.expr(a) < self.expr(b),
            Condition::Bit(a, bit) => self.expr(a) >> bit & 1 == 1,
            Condition::And(a, b) => self.holds(a) && self.holds(b),
            Condition::Or(a, b) => self.holds(a) || self.holds(b),
        }
    }

    fn block(&mut self, block: &[Stmt]) -> Flow {
        for stmt in block {
            let flow = self.stmt(stmt);
            if flow != Flow::Next {
                return flow;
            }
        }
        Flow::Next
    }

    fn stmt(&mut self, stmt: &Stmt) -> Flow {
        match stmt {
            Stmt::Assign(i, value) => self.variables[*i] = self.expr(value),
            Stmt::SetElement(i, value) => {
                let element = self.element(self.expr(i));
                self.elements[element] = self.expr(value)
            }
            Stmt::If(condition, accept, reject) => {
                return if self.holds(condition) {
                    self.block(accept)
                } else {
                    self.block(reject)
                };
            }
            Stmt::For(trips, body) => {
                self.counters.push(0);
                let level = self.counters.len() - 1;
                while self.counters[level] < *trips {
                    match self.block(body) {
                        Flow::Break => break,
                        Flow::Return => return Flow::Return,
                        Flow::Next | Flow::Continue => {}
                    }
                    self.counters[level] += 1;
                }
                self.counters.pop();
            }
            Stmt::Loop(trips, body, variable, value, condition) => {
                self.counters.push(0);
                let level = self.counters.len() - 1;
                loop {
                    match self.block(body) {
                        Flow::Break => break,
                        Flow::Return => return Flow::Return,
                        Flow::Next | Flow::Continue => {}
                    }
                    self.variables[*variable] = self.expr(value);
                    self.counters[level] += 1;
                    if self.counters[level] >= *trips || self.holds(condition) {
                        break;
                    }
                }
                self.counters.pop();
            }
            Stmt::Switch(selector, cases, default) => {
                let selector = self.expr(selector);
                let body = cases
                    .iter()
                    .find(|(values, _)| values.contains(&selector))
                    .map_or(default, |(_, body)| body);
                return match self.block(body) {
                    // `break` in a case leaves the switch.
                    Flow::Break => Flow::Next,
                    other => other,
                };
            }
            Stmt::BreakIf(condition) if self.holds(condition) => return Flow::Break,
            Stmt::ContinueIf(condition) if self.holds(condition) => return Flow::Continue,
            Stmt::ReturnIf(condition) if self.holds(condition) => return Flow::Return,
            Stmt::BreakIf(_) | Stmt::ContinueIf(_) | Stmt::ReturnIf(_) => {}
        }
        Flow::Next
    }
}

/// Runs a random program; if it goes wrong, fails with the smallest part of it
/// that still does.
fn run(seed: u64, size: u32) {
    let mut body = Random(seed).block(4, 0);
    let Some(mut message) = mistake(&body, size) else {
        return;
    };
    while let Some((less, why)) = smaller(&body)
        .into_iter()
        .find_map(|less| mistake(&less, size).map(|why| (less, why)))
    {
        (body, message) = (less, why);
    }
    panic!("seed {seed}, workgroup size {size}: {message}");
}

/// What a program does wrong, with its text.
fn mistake(body: &[Stmt], size: u32) -> Option<String> {
    let mut text = String::new();
    block_text(body, 0, &mut text);
    let wgsl = format!(
        "struct Result {{ a: u32, b: u32, c: u32, d: u32, e: u32 }}
         @group(0) @binding(0) var<storage, read> data: array<u32>;
         @group(0) @binding(1) var<storage, read_write> result: array<Result>;
         fn helper(a: u32, b: u32) -> u32 {{
             if (a & 1u) == 1u {{ return b + 3u; }}
             for (var i = 0u; i < 3u; i++) {{
                 if ((b + i) & 7u) == 2u {{ return a ^ i; }}
             }}
             return a + b;
         }}
         fn body(lane: u32, group: u32) -> Result {{
             var v0 = lane; var v1 = group; var v2 = data[lane]; var v3 = 7u; var v4 = lane * lane;
             var elements = array<u32, 4>(1u, lane, group, 4u);
             {text}
             return Result(v0 + elements[0], v1 + elements[1], v2 + elements[2], v3 + elements[3], v4);
         }}
         @compute @workgroup_size({size})
         fn main(@builtin(local_invocation_index) lane: u32, @builtin(workgroup_id) group: vec3<u32>) {{
             result[group.x * {size}u + lane] = body(lane, group.x);
         }}"
    );
    let groups = 3;
    let data: Vec<u32> = (0..size)
        .map(|i| i.wrapping_mul(2_654_435_761) >> 27)
        .collect();
    let result = run_buffers(&wgsl, &data, (groups * size) as usize * VARIABLES, groups);
    // How often an index is outside of the array, and who is the first to have one.
    let (mut outside, mut first) = (0, None);
    for group in 0..groups {
        for lane in 0..size {
            let mut invocation = Invocation {
                variables: [lane, group, data[lane as usize], 7, lane * lane],
                elements: [1, lane, group, 4],
                counters: Vec::new(),
                lane,
                group,
                outside: Cell::new(0),
            };
            let returned = invocation.block(body) == Flow::Return;
            let mut expected = invocation.variables;
            if !returned {
                for (value, element) in expected.iter_mut().zip(invocation.elements) {
                    *value = value.wrapping_add(element);
                }
            }
            outside += invocation.outside.get();
            if outside > 0 && first.is_none() {
                first = Some((group, lane));
            }
            let at = (group * size + lane) as usize * VARIABLES;
            let got = &result[at..at + VARIABLES];
            if got != expected {
                return Some(format!(
                    "group {group}, lane {lane}: {got:?}, not {expected:?}\n{wgsl}\n{}",
                    program(&wgsl)
                ));
            }
        }
    }
    let found = findings(&wgsl, &data, (groups * size) as usize * VARIABLES, groups);
    let count: u64 = found.iter().map(|finding| finding.count).sum();
    let found_first = found
        .iter()
        .map(|finding| (finding.workgroup[0], finding.invocation[0]))
        .min();
    let other = found
        .iter()
        .any(|finding| finding.kind != FindingKind::Index);
    (other || count != outside || found_first != first).then(|| {
        format!(
            "{outside} indices outside, the first of {first:?}, but found are {found:#?}\n{wgsl}"
        )
    })
}

/// What all checks find, the same in two ways of running.
fn findings(wgsl: &str, data: &[u32], results: usize, workgroups: u32) -> Vec<Finding> {
    let program = checks::checked(wgsl, Checks::all());
    let run = |threads, lanes| {
        let executor = Executor::new(threads).unwrap().with_lanes(lanes);
        let (input, output) = (buffer(data), buffer(&vec![0; results]));
        let bound: Vec<BoundResource<'_>> = program
            .bindings()
            .iter()
            .map(|binding| {
                BoundResource::Buffer(if binding.binding == 0 {
                    &input
                } else {
                    &output
                })
            })
            .collect();
        program
            .dispatch(&executor, [workgroups, 1, 1], &bound)
            .unwrap_or_else(|error| panic!("{error}\n{program}"))
            .findings
    };
    let found = run(1, 64);
    assert_eq!(found, run(3, 256), "{wgsl}");
    found
}

#[test]
fn random_programs_do_what_each_invocation_would() {
    for seed in 0..250 {
        run(seed, 64);
    }
}

#[test]
fn random_programs_of_any_workgroup_size() {
    for (seed, size) in (1000..1060).zip([1, 7, 32, 65, 100, 128, 192, 256].into_iter().cycle()) {
        run(seed, size);
    }
}

/// All programs with one statement less, or with a compound one replaced by its parts.
fn smaller(block: &[Stmt]) -> Vec<Vec<Stmt>> {
    let mut all = Vec::new();
    let replace = |i: usize, with: Vec<Stmt>| -> Vec<Stmt> {
        block[..i]
            .iter()
            .cloned()
            .chain(with)
            .chain(block[i + 1..].iter().cloned())
            .collect()
    };
    for (i, stmt) in block.iter().enumerate() {
        all.push(replace(i, Vec::new()));
        match stmt {
            Stmt::If(c, a, b) => {
                all.push(replace(i, a.clone()));
                all.push(replace(i, b.clone()));
                all.extend(
                    smaller(a)
                        .into_iter()
                        .map(|a| replace(i, vec![Stmt::If(c.clone(), a, b.clone())])),
                );
                all.extend(
                    smaller(b)
                        .into_iter()
                        .map(|b| replace(i, vec![Stmt::If(c.clone(), a.clone(), b)])),
                );
            }
            Stmt::For(n, a) => all.extend(
                smaller(a)
                    .into_iter()
                    .map(|a| replace(i, vec![Stmt::For(*n, a)])),
            ),
            Stmt::Loop(n, a, v, e, c) => all.extend(
                smaller(a)
                    .into_iter()
                    .map(|a| replace(i, vec![Stmt::Loop(*n, a, *v, e.clone(), c.clone())])),
            ),
            Stmt::Switch(e, cases, default) => {
                for k in 0..cases.len() {
                    let mut less = cases.clone();
                    less.remove(k);
                    all.push(replace(
                        i,
                        vec![Stmt::Switch(e.clone(), less, default.clone())],
                    ));
                    for body in smaller(&cases[k].1) {
                        let mut less = cases.clone();
                        less[k].1 = body;
                        all.push(replace(
                            i,
                            vec![Stmt::Switch(e.clone(), less, default.clone())],
                        ));
                    }
                }
                all.extend(
                    smaller(default)
                        .into_iter()
                        .map(|d| replace(i, vec![Stmt::Switch(e.clone(), cases.clone(), d)])),
                );
            }
            _ => {}
        }
    }
    all
}
