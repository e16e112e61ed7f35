//! Whether a function uses the vectors it could use.

use std::collections::BTreeMap;
use std::fmt;

use serde::{Deserialize, Serialize};

use super::disassembly::{Function, Instruction};

/// An instruction set, as the interpreter has it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Tier {
    /// 256 bits.
    Avx2,
    /// 512 bits.
    Avx512,
}

impl Tier {
    /// The first letter of its widest registers.
    const fn width(self) -> char {
        match self {
            Self::Avx2 => 'y',
            Self::Avx512 => 'z',
        }
    }
}

impl fmt::Display for Tier {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Avx2 => "avx2",
            Self::Avx512 => "avx512",
        })
    }
}

/// What keeps a function from using vectors.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Fault {
    /// No instruction uses the widest registers.
    Width,
    /// Floating-point arithmetic on one number in a loop, or on more numbers
    /// than a handler has uniform operands.
    Scalar,
    /// Calls of other functions than those that report a failed check.
    Calls,
    /// Calls of closures, which compilers do not compile for the handler's
    /// instruction set.
    Closures,
    /// Loops without a vector in them: lane by lane.
    Loops,
    /// Vectors taken apart and put together, lane by lane.
    Lanes,
}

impl fmt::Display for Fault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Width => "width",
            Self::Scalar => "scalar",
            Self::Calls => "calls",
            Self::Closures => "closures",
            Self::Loops => "loops",
            Self::Lanes => "lanes",
        })
    }
}

/// A fault with what shows it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Finding {
    /// The fault.
    pub fault: Fault,
    /// The instructions or symbols concerned, the first few.
    pub evidence: String,
}

/// Single numbers that a handler may compute before its loop: the product of
/// two uniform operands, a conversion of each.
const UNIFORM_ARITHMETIC: usize = 3;

/// Insertions and extractions that a handler may need beside its loop.
const LOOSE_LANES: usize = 4;

/// Every fault of a function for a tier.
#[must_use]
pub fn judge(function: &Function, tier: Tier) -> Vec<Finding> {
    let mut findings = Vec::new();
    let mut find = |fault, evidence: Vec<&str>| {
        let more = evidence.len().saturating_sub(4);
        let mut text = evidence[..evidence.len() - more].join(", ");
        if more > 0 {
            text += &format!(" and {more} more");
        }
        findings.push(Finding {
            fault,
            evidence: text,
        });
    };
    let instructions = &function.instructions;
    if !instructions.iter().any(|one| is_wide(one, tier)) {
        find(Fault::Width, vec!["no instruction"]);
    }
    let loops = loops(instructions);
    let scalar: Vec<_> = instructions.iter().filter(|one| is_scalar(one)).collect();
    let in_loop = |one: &&Instruction| {
        let within = |&(first, last): &(u64, u64)| (first..=last).contains(&one.address);
        loops.iter().any(within)
    };
    if scalar.len() > UNIFORM_ARITHMETIC || scalar.iter().any(in_loop) {
        find(
            Fault::Scalar,
            scalar.iter().map(|one| one.mnemonic.as_str()).collect(),
        );
    }
    let (closures, calls): (Vec<_>, Vec<_>) = called(instructions)
        .into_iter()
        .filter(|symbol| !is_check(symbol))
        .partition(|symbol| is_closure(symbol));
    if !calls.is_empty() {
        find(Fault::Calls, calls);
    }
    if !closures.is_empty() {
        find(Fault::Closures, closures);
    }
    let narrow = loops.iter().filter(|&&(first, last)| {
        !instructions
            .iter()
            .filter(|one| (first..=last).contains(&one.address))
            .any(|one| is_wide(one, tier))
    });
    let narrow: Vec<String> = narrow.map(|(first, _)| format!("at {first:#x}")).collect();
    if !narrow.is_empty() {
        find(Fault::Loops, narrow.iter().map(String::as_str).collect());
    }
    let lanes: Vec<_> = instructions
        .iter()
        .map(|one| one.mnemonic.as_str())
        .filter(|mnemonic| takes_apart(mnemonic))
        .collect();
    if lanes.len() > LOOSE_LANES {
        find(Fault::Lanes, lanes);
    }
    findings
}

/// The functions called, as far as they have names: calls through a register
/// have that of what was last loaded into it.
fn called(instructions: &[Instruction]) -> Vec<&str> {
    let mut loaded: BTreeMap<&str, &str> = BTreeMap::new();
    let mut calls = Vec::new();
    for one in instructions {
        let symbol = one.symbols.first().map(String::as_str);
        if one.is_call() {
            let register = loaded.get(one.operands.as_str()).copied();
            calls.push(symbol.or(register).unwrap_or("through a pointer"));
        } else if one.mnemonic == "mov"
            && let Some((register, _)) = one.operands.split_once(',')
        {
            match symbol {
                Some(symbol) => loaded.insert(register, symbol),
                None => loaded.remove(register),
            };
        }
    }
    calls
}

/// Whether a function is a closure, or what arrays pass one on to.
fn is_closure(symbol: &str) -> bool {
    [
        "{closure",
        "call_mut",
        "call_once",
        "try_map",
        "drain_array",
    ]
    .iter()
    .any(|part| symbol.contains(part))
}

/// Whether an instruction uses a register of the tier's full width.
fn is_wide(instruction: &Instruction, tier: Tier) -> bool {
    let mut register = [tier.width(), 'm', 'm'].iter().collect::<String>();
    if instruction.operands.contains(&register) {
        return true;
    }
    register.make_ascii_uppercase();
    instruction.operands.contains(&format!("{register}WORD"))
}

/// The addresses of the first and last instruction of everything that is
/// jumped back over.
fn loops(instructions: &[Instruction]) -> Vec<(u64, u64)> {
    instructions
        .iter()
        .filter_map(|one| Some((one.jump()?, one.address)))
        .filter(|(to, from)| to <= from)
        .collect()
}

/// Whether an instruction is floating-point arithmetic on one number.
fn is_scalar(instruction: &Instruction) -> bool {
    const NAMES: [&str; 13] = [
        "add", "sub", "mul", "div", "sqrt", "min", "max", "round", "rndscale", "fmadd", "fmsub",
        "fnmadd", "fnmsub",
    ];
    let name = instruction.mnemonic.as_str();
    let name = name.strip_prefix('v').unwrap_or(name);
    if name.starts_with("cvt") {
        return name.contains("ss") || name.contains("sd");
    }
    let Some(operation) = name.strip_suffix("ss").or_else(|| name.strip_suffix("sd")) else {
        return false;
    };
    NAMES.contains(&operation.trim_end_matches(|digit: char| digit.is_ascii_digit()))
}

/// Whether a function is one that reports a failed check, and does not return.
fn is_check(symbol: &str) -> bool {
    symbol.contains("panic") || symbol.contains("_fail") || symbol.contains("::unwrap_failed")
}

/// Whether an instruction moves one lane into or out of a vector.
fn takes_apart(mnemonic: &str) -> bool {
    let name = mnemonic.strip_prefix('v').unwrap_or(mnemonic);
    ["pextr", "pinsr", "extractps", "insertps"]
        .iter()
        .any(|prefix| name.starts_with(prefix))
}

#[cfg(test)]
mod tests {
    use super::super::disassembly::parse;
    use super::*;

    fn faults(body: &str, tier: Tier) -> Vec<Fault> {
        let functions = parse(&format!("0000000000000000 <f>:\n{body}"));
        judge(&functions[0], tier)
            .iter()
            .map(|finding| finding.fault)
            .collect()
    }

    const CLEAN: &str = "   0:\tvmovups zmm0,ZMMWORD PTR [rax]
   6:\tvaddps zmm0,zmm0,zmm1
   c:\tjne    0 <f>
   e:\tcall   12 <f+0x12>
\t\t\tf: R_X86_64_PLT32\tcore::panicking::panic_bounds_check-0x4
  12:\tret\n";

    #[test]
    fn full_width_loops_are_clean() {
        assert_eq!(faults(CLEAN, Tier::Avx512), []);
        let narrow = CLEAN.replace("zmm", "ymm").replace("ZMM", "YMM");
        assert_eq!(faults(&narrow, Tier::Avx2), []);
        assert_eq!(faults(&narrow, Tier::Avx512), [Fault::Width, Fault::Loops]);
    }

    #[test]
    fn each_fault_is_found() {
        let after = |what: &str| format!("{CLEAN}{what}");
        let of = |what: &str| faults(&after(what), Tier::Avx512);
        assert_eq!(
            of("  13:\tcall   17 <f+0x17>\n\t\t\t14: R_X86_64_PLT32\tmemcpy-0x4\n"),
            [Fault::Calls]
        );
        assert_eq!(of("  13:\tcall   r12\n"), [Fault::Calls]);
        assert_eq!(
            of("  13:\tcall   17 <f+0x17>\n\t\t\t14: R_X86_64_PLT32\tf::run::{closure#1}-0x4\n"),
            [Fault::Closures]
        );
        let through = |symbol: &str| {
            of(&format!(
                "  13:\tmov    r12,QWORD PTR [rip+0x0]\n\t\t\t16: R_X86_64_GOTPCREL\t{symbol}-0x4\n  1a:\tcall   r12\n"
            ))
        };
        assert_eq!(through("sin"), [Fault::Calls]);
        assert_eq!(through("core::panicking::panic"), []);
        assert_eq!(
            of("  13:\tadd    eax,1\n  16:\tjne    13 <f+0x13>\n"),
            [Fault::Loops]
        );
        assert_eq!(of(&"  13:\tvpextrd eax,xmm0,1\n".repeat(5)), [Fault::Lanes]);
        // A uniform product before the loop is fine, four are not.
        assert_eq!(of("  13:\tvmulss xmm0,xmm0,xmm1\n"), []);
        assert_eq!(
            of(&"  13:\tvmulss xmm0,xmm0,xmm1\n".repeat(4)),
            [Fault::Scalar]
        );
        let in_loop = CLEAN.replace("vaddps zmm0,zmm0,zmm1", "vfmadd213ss xmm0,xmm0,xmm1");
        assert_eq!(faults(&in_loop, Tier::Avx512), [Fault::Scalar]);
    }

    #[test]
    fn moves_and_packed_arithmetic_are_not_scalar() {
        for (mnemonic, scalar) in [
            ("vmovss", false),
            ("vbroadcastss", false),
            ("vaddps", false),
            ("vpaddd", false),
            ("vcvttps2dq", false),
            ("addss", true),
            ("vdivsd", true),
            ("vfnmadd231ss", true),
            ("vcvtss2sd", true),
            ("cvttss2si", true),
            ("vrndscaless", true),
        ] {
            let instruction = Instruction {
                mnemonic: mnemonic.to_owned(),
                ..Instruction::default()
            };
            assert_eq!(is_scalar(&instruction), scalar, "{mnemonic}");
        }
    }
}
