//! Which words of buffers and texels of textures something wrote: one word of
//! shadow for each, for the check of reads that nothing wrote.

use std::sync::atomic::{AtomicU32, Ordering};

use crate::error::RunError;

/// Written before the dispatch.
const WRITTEN: u32 = 0;
/// Nothing wrote it. As the bits of 1.0, so that a shadow of a texture can be
/// sampled: what comes out is above 0 when an unwritten texel is in it.
const UNWRITTEN: u32 = 0x3f80_0000;
/// Written by several workgroups of the dispatch.
const SEVERAL: u32 = u32::MAX;

/// Shadow of `count` words that nothing wrote.
pub(crate) fn unwritten(count: usize, what: &str) -> Result<Vec<AtomicU32>, RunError> {
    let mut shadow = Vec::new();
    shadow
        .try_reserve_exact(count)
        .map_err(|_| RunError::OutOfMemory {
            what: format!("the shadow of {what}"),
            bytes: (count as u64).saturating_mul(4),
        })?;
    shadow.resize_with(count, || AtomicU32::new(UNWRITTEN));
    Ok(shadow)
}

/// Notes that the host, or a finished dispatch, wrote all of them.
pub(crate) fn write(shadow: &[AtomicU32]) {
    for word in shadow {
        word.store(WRITTEN, Ordering::Relaxed);
    }
}

/// Notes that none of them is written.
pub(crate) fn forget(shadow: &[AtomicU32]) {
    for word in shadow {
        word.store(UNWRITTEN, Ordering::Relaxed);
    }
}

/// What a workgroup is known by in shadows.
fn name(workgroup: u64) -> u32 {
    // Three values mean something else. Beyond 2^32 workgroups, names repeat.
    let name = (workgroup % u64::from(u32::MAX - 4)) as u32 + 1;
    if name >= UNWRITTEN { name + 1 } else { name }
}

/// Notes a write in a dispatch.
pub(crate) fn write_by(word: &AtomicU32, workgroup: u64) {
    let name = name(workgroup);
    // The result is always `Ok` or says that nothing need change.
    let _ = word.fetch_update(Ordering::Relaxed, Ordering::Relaxed, |old| match old {
        UNWRITTEN => Some(name),
        WRITTEN | SEVERAL => None,
        old if old == name => None,
        _ => Some(SEVERAL),
    });
}

/// Whether nothing has written it so far.
pub(crate) fn is_unwritten(word: &AtomicU32) -> bool {
    word.load(Ordering::Relaxed) == UNWRITTEN
}

/// After a dispatch, of a word that a workgroup found unwritten: whether no other
/// workgroup wrote it. If one did, nobody can tell which was first.
pub(crate) fn was_unwritten(word: &AtomicU32, workgroup: u64) -> bool {
    let now = word.load(Ordering::Relaxed);
    now == UNWRITTEN || now == name(workgroup)
}

/// After a dispatch: what it wrote is written.
pub(crate) fn settle(shadow: &[AtomicU32]) {
    for word in shadow {
        if !is_unwritten(word) {
            word.store(WRITTEN, Ordering::Relaxed);
        }
    }
}

/// Notes a copy.
pub(crate) fn copy(to: &AtomicU32, from: Option<&AtomicU32>) {
    let state = from.map_or(WRITTEN, |from| from.load(Ordering::Relaxed));
    to.store(state, Ordering::Relaxed);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_workgroups_mean_nothing_else() {
        let first = u64::from(UNWRITTEN);
        for workgroup in [0, 1, first - 2, first - 1, first, u64::from(u32::MAX) - 6] {
            let name = name(workgroup);
            assert!(
                ![WRITTEN, UNWRITTEN, SEVERAL].contains(&name),
                "{workgroup}"
            );
        }
        assert_ne!(name(first - 2), name(first - 1));
    }

    #[test]
    fn the_only_writer_is_known() {
        let shadow = unwritten(1, "a test").unwrap();
        let word = &shadow[0];
        assert!(is_unwritten(word));
        assert!(was_unwritten(word, 3));
        write_by(word, 3);
        assert!(!is_unwritten(word));
        assert!(was_unwritten(word, 3) && !was_unwritten(word, 4));
        write_by(word, 4);
        assert!(!was_unwritten(word, 3) && !was_unwritten(word, 4));
        settle(&shadow);
        write_by(word, 3);
        assert!(!was_unwritten(word, 3), "written before the dispatch");
        forget(&shadow);
        assert!(is_unwritten(word));
    }
}
