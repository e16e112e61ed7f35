//! Random graphs against models that share nothing with the phases.
//!
//! Each pass is a symbol computed from the symbols it reads. The graph's
//! meaning is evaluated as it is declared; the plan's by running its steps over
//! bytes of a modelled heap, where writing one resource destroys whatever else
//! lies there. Both must give the outputs the same symbols.

use std::cell::Cell;
use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::hash::{DefaultHasher, Hash, Hasher};

use proptest::prelude::*;

use super::{R32, library, plan_with};
use crate::graph::{ClearValue, Graph, ResourceDesc, Texture};
use crate::kernel::KernelLibrary;
use crate::plan::{Bound, Capture, Plan, PlannedResource, ResourceKind, Step, Usage, UsageSet};

fn symbol(parts: impl Hash) -> u64 {
    let mut hasher = DefaultHasher::new();
    parts.hash(&mut hasher);
    hasher.finish()
}

/// A graph with, per output, the symbol it should hold, and the passes that
/// matter to some output.
struct Case {
    graph: Graph,
    expected: BTreeMap<String, u64>,
    needed: BTreeSet<String>,
}

/// One version of a texture of two mips: per mip, its symbol and the passes behind it.
#[derive(Clone)]
struct Value {
    handle: Texture,
    mips: [Option<(u64, BTreeSet<String>)>; 2],
}

/// Builds a graph from arbitrary numbers: passes that write new textures, write
/// over or update old ones (one mip of two), reading anything defined so far,
/// old versions included.
fn case(choices: &[u32]) -> Case {
    let desc = R32.with_mips(2);
    let mut graph = Graph::new();
    let import = graph.import_texture("import", desc).unwrap();
    let imported = |mip: u32| Some((symbol(("import", mip)), BTreeSet::new()));
    // All versions ever made, and the newest version of each texture.
    let mut versions = vec![Value {
        handle: import,
        mips: [imported(0), imported(1)],
    }];
    let mut newest = vec![0_usize];
    for (index, chunk) in choices.chunks_exact(5).enumerate() {
        let [kind, target, mip, reads, which] = chunk.try_into().unwrap();
        let mip = mip % 2;
        let name = format!("pass {index}");
        // The import stays as it is; a third of the passes start a texture.
        let slot = if newest.len() == 1 || target % 3 == 0 {
            let handle = graph.texture(format!("texture {index}"), desc);
            versions.push(Value {
                handle,
                mips: [None, None],
            });
            newest.push(versions.len() - 1);
            newest.len() - 1
        } else {
            1 + target as usize % (newest.len() - 1)
        };
        let before = versions[newest[slot]].clone();
        let update = kind % 4 == 1 && before.mips[mip as usize].is_some();
        let mut inputs = Vec::new();
        let mut passes: BTreeSet<String> = BTreeSet::from([name.clone()]);
        let mut symbols = Vec::new();
        for read in 0..reads % 4 {
            let pick = (which as usize)
                .wrapping_mul(31)
                .wrapping_add(read as usize * 7)
                % versions.len();
            let (value, from) = (&versions[pick], which.wrapping_add(read) % 2);
            let Some((content, behind)) = &value.mips[from as usize] else {
                continue;
            };
            // A pass may not read what it writes.
            if value.handle.resource == before.handle.resource && from == mip {
                continue;
            }
            inputs.push(value.handle.mip(from));
            symbols.push(*content);
            passes.extend(behind.iter().cloned());
        }
        let access = if update { "update" } else { "write" };
        if update && let Some((content, behind)) = before.mips[mip as usize].clone() {
            symbols.push(content);
            passes.extend(behind);
        }
        let mut pass = graph
            .compute(format!("test/{access}{}", inputs.len()))
            .named(&name);
        pass = if update {
            pass.update("result", before.handle.mip(mip))
        } else {
            pass.write("result", before.handle.mip(mip))
        };
        for (position, input) in inputs.iter().enumerate() {
            pass = pass.read(format!("in{position}"), *input);
        }
        let written = pass.per_texel("result").unwrap();
        let mut mips = before.mips;
        mips[mip as usize] = Some((symbol((&name, &symbols)), passes));
        versions.push(Value {
            handle: written,
            mips,
        });
        newest[slot] = versions.len() - 1;
    }
    // Every third texture's newest version is asked for, if it is complete.
    let mut expected = BTreeMap::new();
    let mut needed = BTreeSet::new();
    for (index, version) in newest
        .iter()
        .enumerate()
        .filter(|(index, _)| index % 3 == 1)
    {
        if let [Some(first), Some(second)] = &versions[*version].mips {
            let name = format!("output {index}");
            graph.output(&name, versions[*version].handle).unwrap();
            expected.insert(name, symbol((first.0, second.0)));
            needed.extend(first.1.iter().chain(&second.1).cloned());
        }
    }
    Case {
        graph,
        expected,
        needed,
    }
}

/// The modelled memory: every resource's subresources, and which bytes of the
/// heap it occupies.
struct Memory<'a> {
    plan: &'a Plan,
    contents: HashMap<(u32, u32), u64>,
}

impl Memory<'_> {
    fn read(&self, resource: u32, mip: u32) -> u64 {
        match self.contents.get(&(resource, mip)) {
            Some(content) => *content,
            None if matches!(
                self.plan.resources[resource as usize].kind,
                ResourceKind::Import(_)
            ) =>
            {
                symbol(("import", mip))
            }
            None => panic!(
                "{} mip {mip} holds nothing",
                self.plan.resources[resource as usize].name
            ),
        }
    }

    /// Writing destroys everything else in the same bytes.
    fn write(&mut self, resource: u32, mip: u32, content: u64) {
        if let ResourceKind::Transient(place) = &self.plan.resources[resource as usize].kind {
            for (index, other) in self.plan.resources.iter().enumerate() {
                if let ResourceKind::Transient(with) = &other.kind {
                    let apart = place.offset + place.bytes <= with.offset
                        || with.offset + with.bytes <= place.offset;
                    if index as u32 != resource && !apart {
                        self.contents.retain(|(owner, _), _| *owner != index as u32);
                    }
                }
            }
        }
        self.contents.insert((resource, mip), content);
    }
}

fn run(plan: &Plan) -> BTreeMap<String, u64> {
    let mut memory = Memory {
        plan,
        contents: HashMap::new(),
    };
    for step in &plan.steps {
        let Step::Dispatch {
            bindings, kernel, ..
        } = &step.step
        else {
            continue;
        };
        let mut symbols = Vec::new();
        let mut target = None;
        for (bound, binding) in bindings.iter().zip(&kernel.0.bindings) {
            let Bound::Texture { resource, range } = bound else {
                panic!()
            };
            if binding.name == "result" {
                target = Some((*resource, range.mip));
            } else {
                symbols.push(memory.read(*resource, range.mip));
            }
        }
        let (resource, mip) = target.unwrap();
        if kernel.0.name.contains("update") {
            symbols.push(memory.read(resource, mip));
        }
        memory.write(resource, mip, symbol((&step.name, &symbols)));
    }
    let mut outputs = BTreeMap::new();
    for (index, resource) in plan.resources.iter().enumerate() {
        if let ResourceKind::Output(names) = &resource.kind {
            for name in names {
                let content = symbol((memory.read(index as u32, 0), memory.read(index as u32, 1)));
                outputs.insert(name.clone(), content);
            }
        }
    }
    outputs
}

/// One use of one mip by a step, in the order of the steps.
#[derive(Clone, Copy)]
struct Touch {
    step: usize,
    usage: Usage,
}

fn touches(plan: &Plan) -> HashMap<(u32, u32), Vec<Touch>> {
    let mut touches: HashMap<(u32, u32), Vec<Touch>> = HashMap::new();
    for (index, step) in plan.steps.iter().enumerate() {
        let Step::Dispatch {
            bindings, kernel, ..
        } = &step.step
        else {
            continue;
        };
        for (bound, binding) in bindings.iter().zip(&kernel.0.bindings) {
            let Bound::Texture { resource, range } = bound else {
                panic!()
            };
            let usage = match (binding.name.as_str(), kernel.0.name.contains("update")) {
                ("result", true) => Usage::StorageUpdate,
                ("result", false) => Usage::StorageWrite,
                _ => Usage::Sampled,
            };
            touches
                .entry((*resource, range.mip))
                .or_default()
                .push(Touch { step: index, usage });
        }
    }
    touches
}

/// Whether the barriers on a mip of a resource in steps `after..=until` order
/// `usage` before a later use as `then`: some chain of barriers leads from one
/// to the other.
fn ordered(
    plan: &Plan,
    resource: u32,
    mip: u32,
    after: usize,
    until: usize,
    usage: Usage,
    then: Usage,
) -> bool {
    let mut sources = vec![usage];
    let mut reached = Vec::new();
    for step in &plan.steps[after + 1..=until] {
        for barrier in &step.barriers {
            let covers = barrier.resource == resource
                && (barrier.range.mip..barrier.range.mip + barrier.range.mips).contains(&mip);
            if covers && sources.iter().any(|source| barrier.from.contains(*source)) {
                sources.push(barrier.to);
                reached.push(barrier.to);
            }
        }
    }
    reached.contains(&then)
}

/// Checks that no use of memory races with another, and that every use finds
/// its texture in the right layout with its contents kept.
fn check_barriers(plan: &Plan) {
    let touches = touches(plan);
    for (&(resource, mip), uses) in &touches {
        let name = &plan.resources[resource as usize].name;
        for (index, later) in uses.iter().enumerate() {
            for earlier in &uses[..index] {
                if earlier.step == later.step || (!earlier.usage.writes() && !later.usage.writes())
                {
                    continue;
                }
                // A later write in between orders both; adjacent pairs suffice
                // for writes, but every reader must be waited for.
                let between = uses.iter().any(|use_| {
                    use_.usage.writes() && earlier.step < use_.step && use_.step < later.step
                });
                if !between {
                    assert!(
                        ordered(
                            plan,
                            resource,
                            mip,
                            earlier.step,
                            later.step,
                            earlier.usage,
                            later.usage
                        ),
                        "{name} mip {mip}: steps {} and {} race",
                        earlier.step,
                        later.step
                    );
                }
            }
        }
        check_layout(plan, resource, mip, uses);
    }
    check_aliases(plan, &touches);
}

fn check_layout(plan: &Plan, resource: u32, mip: u32, uses: &[Touch]) {
    let planned = &plan.resources[resource as usize];
    let import = matches!(planned.kind, ResourceKind::Import(_));
    let mut layout = import.then_some(Usage::Sampled);
    let mut defined = import;
    for (index, step) in plan.steps.iter().enumerate() {
        for barrier in &step.barriers {
            if barrier.resource == resource
                && (barrier.range.mip..barrier.range.mip + barrier.range.mips).contains(&mip)
            {
                match barrier.layout {
                    Some(old) => assert!(
                        layout.is_some_and(|layout| layout.same_layout(old)),
                        "wrong old layout"
                    ),
                    None => defined = false,
                }
                layout = Some(barrier.to);
            }
        }
        for touch in uses.iter().filter(|touch| touch.step == index) {
            assert!(
                layout.is_some_and(|layout| layout.same_layout(touch.usage)),
                "{} in the wrong layout",
                planned.name
            );
            if touch.usage != Usage::StorageWrite {
                assert!(
                    defined,
                    "{} mip {mip} was discarded before step {index}",
                    planned.name
                );
            }
            defined |= touch.usage.writes();
        }
    }
    if !matches!(planned.kind, ResourceKind::Transient(_)) {
        for barrier in plan
            .final_barriers
            .iter()
            .filter(|barrier| barrier.resource == resource)
        {
            if (barrier.range.mip..barrier.range.mip + barrier.range.mips).contains(&mip) {
                layout = Some(barrier.to);
            }
        }
        assert!(
            layout.is_some_and(|layout| layout.same_layout(Usage::Sampled)),
            "{} not at rest",
            planned.name
        );
    }
}

/// The first use of memory must wait for its former tenants' uses.
fn check_aliases(plan: &Plan, touches: &HashMap<(u32, u32), Vec<Touch>>) {
    check_first_tenants(plan, touches);
    for (a, first) in plan.resources.iter().enumerate() {
        for (b, second) in plan.resources.iter().enumerate() {
            let (ResourceKind::Transient(p), ResourceKind::Transient(q)) =
                (&first.kind, &second.kind)
            else {
                continue;
            };
            if a == b || p.offset + p.bytes <= q.offset || q.offset + q.bytes <= p.offset {
                if a != b && p.slot == q.slot {
                    assert!(
                        first.last < second.first || second.last < first.first,
                        "a slot with two tenants"
                    );
                }
                continue;
            }
            assert!(
                first.last < second.first || second.last < first.first,
                "two tenants at once"
            );
            if first.last < second.first {
                for mip in 0..2 {
                    let Some(entry) = touches.get(&(b as u32, mip)).and_then(|uses| uses.first())
                    else {
                        continue;
                    };
                    for earlier in (0..2)
                        .filter_map(|mip| touches.get(&(a as u32, mip)))
                        .flatten()
                    {
                        assert!(
                            ordered(
                                plan,
                                b as u32,
                                mip,
                                earlier.step,
                                entry.step,
                                earlier.usage,
                                entry.usage
                            ),
                            "{} does not wait for {}",
                            second.name,
                            first.name
                        );
                    }
                }
            }
        }
    }
}

/// The first tenant of a byte must wait for whatever an earlier run did to it.
fn check_first_tenants(plan: &Plan, touches: &HashMap<(u32, u32), Vec<Touch>>) {
    let place = |resource: &PlannedResource| match &resource.kind {
        ResourceKind::Transient(place) => Some(place.offset..place.offset + place.bytes),
        _ => None,
    };
    for (index, resource) in plan.resources.iter().enumerate() {
        let Some(bytes) = place(resource) else {
            continue;
        };
        let mut before: Vec<_> = plan
            .resources
            .iter()
            .filter(|other| other.last < resource.first)
            .filter_map(place)
            .collect();
        before.sort_by_key(|bytes| bytes.start);
        let covered = before.iter().fold(bytes.start, |covered, other| {
            if other.start <= covered {
                covered.max(other.end)
            } else {
                covered
            }
        });
        if covered >= bytes.end {
            continue;
        }
        let uses = (0..2).filter_map(|mip| touches.get(&(index as u32, mip)));
        for first in uses.filter_map(|uses| uses.first()) {
            let mut barriers = plan.steps[first.step].barriers.iter();
            let barrier = barriers
                .rfind(|barrier| barrier.resource == index as u32 && barrier.layout.is_none());
            let from = barrier.map(|barrier| barrier.from);
            assert!(
                from.is_some_and(|from| from.is_empty() || from == UsageSet::ALL),
                "{} does not wait for earlier runs: {from:?}",
                resource.name
            );
        }
    }
}

/// Checks one graph and returns how many passes ran and how many did not.
fn check(choices: &[u32], library: &KernelLibrary) -> (usize, usize) {
    let case = case(choices);
    let plan = match plan_with(&case.graph, library, Capture::None) {
        Ok(plan) => plan,
        // Reading a version that must be written over first is a legitimate
        // contradiction of a random graph.
        Err(crate::plan::PlanError::Cycle { .. }) => return (0, 0),
        Err(error) => panic!("{error}"),
    };
    assert_eq!(run(&plan), case.expected);
    let ran: BTreeSet<String> = plan.steps.iter().map(|step| step.name.clone()).collect();
    assert_eq!(ran, case.needed, "exactly the needed passes run");
    assert_eq!(ran.len() + plan.culled.len(), case.graph.passes.len());
    check_barriers(&plan);
    check_lives(&plan);
    let lower_bound = largest_set_alive(&plan);
    let memory = plan.transient_memory();
    assert_eq!(memory.least, lower_bound);
    assert_eq!(memory.planned, plan.texture_heap);
    assert!(memory.planned >= lower_bound && memory.planned <= plan.unaliased_bytes);
    let timeline = plan.memory_timeline();
    let largest = timeline.iter().map(|at| at.alive).max().unwrap_or(0);
    assert_eq!(largest, lower_bound);
    (ran.len(), plan.culled.len())
}

/// Checks from the list of steps alone that no two resources are in the same bytes at
/// a time: what the plan says of when each lives is not believed.
fn check_lives(plan: &Plan) {
    let mut lives: HashMap<u32, (usize, usize)> = HashMap::new();
    for ((resource, _), uses) in touches(plan) {
        for touch in uses {
            let life = lives.entry(resource).or_insert((touch.step, touch.step));
            *life = (life.0.min(touch.step), life.1.max(touch.step));
        }
    }
    let placed: Vec<_> = (0_u32..)
        .zip(&plan.resources)
        .filter_map(|(index, resource)| Some((resource.placement()?, *lives.get(&index)?)))
        .collect();
    for (number, (place, life)) in placed.iter().enumerate() {
        for (other, lived) in &placed[..number] {
            let apart = place.offset + place.bytes <= other.offset
                || other.offset + other.bytes <= place.offset;
            assert!(
                apart || life.1 < lived.0 || lived.1 < life.0,
                "two tenants of the bytes from {} on, in steps {life:?} and {lived:?}",
                place.offset
            );
        }
    }
}

/// Bytes of the transients alive at the busiest step.
fn largest_set_alive(plan: &Plan) -> u64 {
    let alive = |step: usize| {
        let of = |resource: &crate::plan::PlannedResource| match (&resource.kind, &resource.desc) {
            (ResourceKind::Transient(place), ResourceDesc::Texture(_))
                if (resource.first as usize..=resource.last as usize).contains(&step) =>
            {
                place.bytes
            }
            _ => 0,
        };
        plan.resources.iter().map(of).sum::<u64>()
    };
    (0..plan.steps.len()).map(alive).max().unwrap_or(0)
}

#[test]
fn random_graphs_plan_right() {
    let config = ProptestConfig {
        cases: 1000,
        failure_persistence: None,
        rng_seed: prop::test_runner::RngSeed::Fixed(7),
        ..ProptestConfig::default()
    };
    let library = library();
    let (ran, culled) = (Cell::new(0), Cell::new(0));
    let choices = prop::collection::vec(any::<u32>(), 0..250);
    prop::test_runner::TestRunner::new(config)
        .run(&choices, |choices| {
            let counts = check(&choices, &library);
            ran.set(ran.get() + counts.0);
            culled.set(culled.get() + counts.1);
            Ok(())
        })
        .unwrap();
    // The graphs must be worth checking.
    assert!(
        ran.get() > 2000 && culled.get() > 2000,
        "{ran:?} ran, {culled:?} culled"
    );
}

/// The checks above must be able to fail: a plan with its barriers removed, a
/// wrong order, or two tenants in one place is caught.
#[test]
fn planted_faults_are_caught() {
    let desc = R32.with_mips(2);
    let mut graph = Graph::new();
    let mut last = graph.import_texture("import", desc).unwrap();
    for index in 0..4 {
        let mut target = graph.texture(format!("texture {index}"), desc);
        for mip in 0..2 {
            target = graph
                .compute("test/write1")
                .named(format!("pass {index} {mip}"))
                .read("in0", last.mip(mip))
                .write("result", target.mip(mip))
                .per_texel("result")
                .unwrap();
        }
        last = target;
    }
    graph.output("output", last).unwrap();
    let plan = plan_with(&graph, &library(), Capture::None).unwrap();
    check_barriers(&plan);
    let outputs = run(&plan);
    let fails = |plan: Plan| {
        let wrong = std::panic::catch_unwind(|| {
            check_barriers(&plan);
            assert_eq!(run(&plan), outputs);
        });
        wrong.is_err()
    };
    for step in 0..plan.steps.len() {
        for barrier in 0..plan.steps[step].barriers.len() {
            let mut planted = plan.clone();
            planted.steps[step].barriers.remove(barrier);
            assert!(
                fails(planted),
                "barrier {barrier} of step {step} is not missed"
            );
        }
    }
    let mut planted = plan.clone();
    planted.steps.swap(2, 5);
    assert!(fails(planted));
    let mut planted = plan.clone();
    for resource in &mut planted.resources {
        if let ResourceKind::Transient(place) = &mut resource.kind {
            place.offset = 0;
        }
    }
    assert!(std::panic::catch_unwind(|| check_lives(&planted)).is_err());
    assert!(fails(planted));
    assert!(!fails(plan.clone()));
    check_lives(&plan);
}

#[test]
fn a_long_chain_lives_in_two_places() {
    let mut graph = Graph::new();
    let first = graph.texture("start", R32);
    let mut last = graph.clear(first, ClearValue::Float([0.0; 4])).unwrap();
    for index in 0..50 {
        let target = graph.texture(format!("texture {index}"), R32);
        last = graph
            .compute("test/write1")
            .read("in0", last)
            .write("result", target)
            .per_texel("result")
            .unwrap();
    }
    graph.output("output", last).unwrap();
    let plan = plan_with(&graph, &library(), Capture::None).unwrap();
    let one = R32.bytes().unwrap();
    assert_eq!(plan.texture_heap, 2 * one);
    assert_eq!(plan.unaliased_bytes, 50 * one);
    assert_eq!(largest_set_alive(&plan), 2 * one);
}
