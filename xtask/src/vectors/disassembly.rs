//! Reading what `objdump -dr` prints.

/// A function of an object file.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Function {
    /// Its name, demangled.
    pub name: String,
    /// Its instructions.
    pub instructions: Vec<Instruction>,
}

/// An instruction.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Instruction {
    /// Where it is in the function's section.
    pub address: u64,
    /// What it does: `vaddps`.
    pub mnemonic: String,
    /// On what.
    pub operands: String,
    /// Symbols that the linker puts into it.
    pub symbols: Vec<String>,
}

impl Instruction {
    /// Where a jump within the function goes.
    #[must_use]
    pub fn jump(&self) -> Option<u64> {
        if !self.mnemonic.starts_with('j') {
            return None;
        }
        let address = self.operands.split_whitespace().next()?;
        u64::from_str_radix(address, 16).ok()
    }

    /// Whether it calls another function.
    #[must_use]
    pub fn is_call(&self) -> bool {
        self.mnemonic == "call"
    }
}

/// The functions in a listing made by
/// `objdump -dr --no-show-raw-insn -M intel -C`, in its order.
#[must_use]
pub fn parse(listing: &str) -> Vec<Function> {
    let mut functions: Vec<Function> = Vec::new();
    for line in listing.lines() {
        if let Some(name) = heading(line) {
            // Labels of constants within a function begin with a dot.
            if !name.starts_with(".L") {
                functions.push(Function {
                    name: name.to_owned(),
                    instructions: Vec::new(),
                });
            }
            continue;
        }
        let Some((address, rest)) = line.trim_start().split_once(':') else {
            continue;
        };
        let (Ok(address), Some(function)) =
            (u64::from_str_radix(address, 16), functions.last_mut())
        else {
            continue;
        };
        let rest = rest.trim();
        if let Some(relocation) = rest.strip_prefix("R_X86_64_") {
            let symbol = relocation.split_once(char::is_whitespace);
            if let (Some((_, symbol)), Some(last)) = (symbol, function.instructions.last_mut()) {
                last.symbols.push(without_offset(symbol.trim()).to_owned());
            }
            continue;
        }
        let (mnemonic, operands) = rest.split_once(' ').unwrap_or((rest, ""));
        function.instructions.push(Instruction {
            address,
            mnemonic: mnemonic.to_owned(),
            operands: operands.trim().to_owned(),
            symbols: Vec::new(),
        });
    }
    functions
}

/// The name in `0000000000000000 <name>:`.
fn heading(line: &str) -> Option<&str> {
    let (address, name) = line.split_once(" <")?;
    u64::from_str_radix(address, 16).ok()?;
    name.strip_suffix(">:")
}

/// A symbol without the `-0x4` behind it.
fn without_offset(symbol: &str) -> &str {
    match symbol.rfind(['-', '+']) {
        Some(at) if symbol[at + 1..].starts_with("0x") => &symbol[..at],
        _ => symbol,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn listings_become_functions() {
        let listing = "
lib.o:     file format elf64-x86-64

Disassembly of section .text.f:

0000000000000000 <a::f::<f32, a::G<true>>>:
   0:\tpush   rbp
   1:\tvaddps zmm0,zmm1,ZMMWORD PTR [rax]
   7:\tcall   c <a::f::<f32, a::G<true>>+0xc>
\t\t\t8: R_X86_64_PLT32\tcore::panicking::panic-0x4

000000000000000c <.LCPI1_2>:
   c:\tjne    1 <a::f::<f32, a::G<true>>+0x1>
  12:\tret
";
        let functions = parse(listing);
        assert_eq!(functions.len(), 1);
        assert_eq!(functions[0].name, "a::f::<f32, a::G<true>>");
        let instructions = &functions[0].instructions;
        assert_eq!(instructions.len(), 5);
        assert_eq!(instructions[1].mnemonic, "vaddps");
        assert_eq!(instructions[1].operands, "zmm0,zmm1,ZMMWORD PTR [rax]");
        assert!(instructions[2].is_call());
        assert_eq!(instructions[2].symbols, ["core::panicking::panic"]);
        assert_eq!(instructions[3].jump(), Some(1));
        assert_eq!(instructions[4].jump(), None);
        assert_eq!(instructions[4].mnemonic, "ret");
    }
}
