//! The plan for a terminal.

use std::fmt::Write;

use etalon_accuracy::report::{bytes, count};
use etalon_core::plan::{Groups, PlannedStep, Step};

use super::model::{Report, is_backends, on_screen, rows};

/// Columns of the picture of memory.
const COLUMNS: usize = 48;

/// All of it.
pub(super) fn render(report: &Report) -> String {
    let mut text = String::new();
    let [width, height] = report.size;
    let _ = writeln!(
        text,
        "{}, {width}×{height}, {} preset, {} arithmetic\n\nOn the screen",
        report.scene, report.preset, report.plan.arithmetic
    );
    for (what, where_) in on_screen(&report.demands) {
        let _ = writeln!(text, "  {what:<14}{where_}");
    }
    effects(&mut text, report);
    passes(&mut text, report);
    memory(&mut text, report);
    counters(&mut text, report);
    text
}

fn effects(text: &mut String, report: &Report) {
    text.push_str("\nEffects\n");
    let effects = &report.plan.effects;
    let longest = effects.iter().map(|effect| effect.name.chars().count());
    let width = longest.max().unwrap_or(0);
    for effect in effects {
        let word = if effect.decision.is_run() {
            "runs"
        } else {
            "absent"
        };
        let passes = match effect.passes {
            0 => String::new(),
            1 => " (1 pass)".to_owned(),
            many => format!(" ({many} passes)"),
        };
        let _ = writeln!(
            text,
            "  {:<width$}  {word:<6}  {}{passes}",
            effect.name,
            effect.decision.reason()
        );
    }
}

/// What a step does, in a few words.
pub(super) fn work(step: &PlannedStep) -> String {
    match &step.step {
        Step::Dispatch { groups, .. } => match groups {
            Groups::Direct([x, y, z]) => format!("{x}×{y}×{z} workgroups"),
            Groups::Indirect { .. } => "workgroups by buffer".to_owned(),
        },
        Step::Raster(raster) => match raster.draws.len() {
            1 => "1 draw".to_owned(),
            many => format!("{many} draws"),
        },
        Step::ClearTexture { .. } | Step::ClearBuffer { .. } => "clears".to_owned(),
        Step::CopyTexture { .. } | Step::CopyBuffer { .. } => "copies".to_owned(),
        Step::Capture { .. } => "to the host".to_owned(),
    }
}

/// Why a step runs, and for whom.
pub(super) fn why(step: &PlannedStep) -> String {
    if step.goal.is_empty() || step.reason.contains(&format!("`{}`", step.goal)) {
        step.reason.clone()
    } else {
        format!("{}, for `{}`", step.reason, step.goal)
    }
}

fn passes(text: &mut String, report: &Report) {
    let plan = &report.plan;
    text.push_str("\nPasses\n");
    let columns: Vec<[String; 2]> = plan
        .steps
        .iter()
        .map(|step| [step.name.clone(), work(step)])
        .collect();
    let width = |column: usize| {
        let lengths = columns.iter().map(|row| row[column].chars().count());
        lengths.max().unwrap_or(0)
    };
    let (names, works) = (width(0), width(1));
    for (index, (step, [name, work])) in plan.steps.iter().zip(&columns).enumerate() {
        let barriers = match step.barriers.len() {
            0 => String::new(),
            1 => "; after 1 barrier".to_owned(),
            many => format!("; after {many} barriers"),
        };
        let _ = writeln!(
            text,
            "{index:>4}  {name:<names$}  {work:<works$}  {}{barriers}",
            why(step)
        );
    }
    if !plan.culled.is_empty() {
        text.push_str("\nDeclared, but not run\n");
        for pass in &plan.culled {
            let _ = writeln!(text, "      {}: {}", pass.name, pass.reason);
        }
    }
}

/// Which columns of the heaps hold something at a step.
fn held(report: &Report, resources: &[u32]) -> String {
    let plan = &report.plan;
    let all = report.memory.planned.max(1);
    let mut line = ['·'; COLUMNS];
    for &index in resources {
        let Some(resource) = plan.resources.get(index as usize) else {
            continue;
        };
        let Some((first, end)) = super::svg::bytes_of(plan, resource) else {
            continue;
        };
        let column = |byte: u64| (u128::from(byte) * COLUMNS as u128 / u128::from(all)) as usize;
        // However small, it is seen.
        let (first, end) = (column(first), column(end).max(column(first) + 1));
        for cell in line.iter_mut().take(end).skip(first) {
            *cell = '█';
        }
    }
    line.iter().collect()
}

fn memory(text: &mut String, report: &Report) {
    let memory = &report.memory;
    let _ = writeln!(
        text,
        "\nTransient memory: {}, {:.1} % over the {} alive at once; {} without aliasing, {} by \
         whole resources",
        bytes(memory.planned),
        100.0 * memory.excess(),
        bytes(memory.least),
        bytes(memory.unaliased),
        bytes(memory.slots),
    );
    if memory.planned == 0 {
        return;
    }
    let longest = report.timeline.iter().map(|at| at.step.chars().count());
    let names = longest.max().unwrap_or(0);
    for (index, at) in report.timeline.iter().enumerate() {
        let _ = writeln!(
            text,
            "{index:>4}  {:<names$}  {}  {}",
            at.step,
            held(report, &at.resources),
            bytes(at.alive)
        );
    }
}

fn counters(text: &mut String, report: &Report) {
    text.push_str("\nCounters");
    let mut heads = vec!["plan".to_owned()];
    heads.extend(
        report
            .measured
            .iter()
            .map(|run| run.backend.backend.to_owned()),
    );
    let planned = rows(&report.counters);
    let measured: Vec<_> = report
        .measured
        .iter()
        .map(|run| rows(&run.counters))
        .collect();
    let _ = write!(text, "{:<16}", "");
    for head in &heads {
        let _ = write!(text, "{head:>14}");
    }
    text.push('\n');
    for (row, (name, value)) in planned.iter().enumerate() {
        if is_backends(name) && measured.is_empty() {
            continue;
        }
        let _ = write!(text, "  {name:<22}");
        let told = if is_backends(name) {
            "–".to_owned()
        } else {
            count(*value)
        };
        let _ = write!(text, "{told:>14}");
        for run in &measured {
            let _ = write!(text, "{:>14}", count(run[row].1));
        }
        text.push('\n');
    }
    let _ = writeln!(text, "  {:<22}{:>14}", "shader files parsed", report.parsed);
}
