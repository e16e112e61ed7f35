//! Access chains of one link.
//!
//! naga reaches an element of a buffer in two steps: an access chain to the
//! array, and from there another to the element. That is valid, but validation
//! layers of early 2023 and before, which distributions still ship, follow
//! only one chain from a store to the variable behind it. They take such a
//! buffer for one that is only read, and synchronization validation finds no
//! hazard of its writes. With each chain starting at its variable it does.

/// Words before the first instruction (SPIR-V §2.3).
const HEADER: usize = 5;
const OP_ACCESS_CHAIN: u32 = 65;
const OP_IN_BOUNDS_ACCESS_CHAIN: u32 = 66;

/// Rewrites every access chain that starts at the result of another to start
/// where that does. What is computed stays the same. Words that are no SPIR-V
/// are returned as they are.
pub(crate) fn flatten(words: &[u32]) -> Vec<u32> {
    let mut chains: std::collections::HashMap<u32, Vec<u32>> = std::collections::HashMap::new();
    let mut flat = words.get(..HEADER).unwrap_or(words).to_vec();
    let mut rest = words.get(HEADER..).unwrap_or(&[]);
    while let Some(&first) = rest.first() {
        let (opcode, count) = (first & 0xffff, (first >> 16) as usize);
        let Some((instruction, behind)) = rest.split_at_checked(count.max(1)) else {
            return words.to_vec();
        };
        rest = behind;
        // Operands: result type, result, base, indices.
        let (OP_ACCESS_CHAIN | OP_IN_BOUNDS_ACCESS_CHAIN, [_, kind, result, base, indices @ ..]) =
            (opcode, instruction)
        else {
            flat.extend(instruction);
            continue;
        };
        // A chain is not used before its result is (SPIR-V §2.16.1).
        let mut path = chains.get(base).cloned().unwrap_or_else(|| vec![*base]);
        path.extend(indices);
        flat.push(((path.len() + 3) as u32) << 16 | OP_ACCESS_CHAIN);
        flat.extend([kind, result]);
        flat.extend(&path);
        chains.insert(*result, path);
    }
    flat
}

#[cfg(test)]
mod tests {
    use super::*;

    fn instruction(opcode: u32, operands: &[u32]) -> Vec<u32> {
        let mut words = vec![((operands.len() + 1) as u32) << 16 | opcode];
        words.extend(operands);
        words
    }

    #[test]
    fn chains_start_at_variables() {
        let header = [0x0723_0203, 0x0001_0300, 0, 50, 0];
        let other = instruction(61, &[1, 30, 21]);
        let before = [
            &header[..],
            &instruction(OP_ACCESS_CHAIN, &[1, 20, 7, 8]),
            &instruction(OP_IN_BOUNDS_ACCESS_CHAIN, &[2, 21, 20, 9, 10]),
            &other,
            &instruction(OP_ACCESS_CHAIN, &[3, 22, 21, 11]),
        ]
        .concat();
        let after = [
            &header[..],
            &instruction(OP_ACCESS_CHAIN, &[1, 20, 7, 8]),
            &instruction(OP_ACCESS_CHAIN, &[2, 21, 7, 8, 9, 10]),
            &other,
            &instruction(OP_ACCESS_CHAIN, &[3, 22, 7, 8, 9, 10, 11]),
        ]
        .concat();
        assert_eq!(flatten(&before), after);
        assert_eq!(flatten(&after), after);
    }

    #[test]
    fn what_is_no_spirv_stays_as_it_is() {
        for words in [&[][..], &[1, 2], &[0, 0, 0, 0, 0, 9 << 16 | 65, 1]] {
            assert_eq!(flatten(words), words);
        }
    }
}
