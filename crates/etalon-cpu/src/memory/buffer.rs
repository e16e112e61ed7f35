//! Buffers.

use std::sync::atomic::{AtomicU32, Ordering};

use super::written;
use crate::error::RunError;

/// Bytes a kernel reads and writes, as 32-bit words.
#[derive(Debug)]
pub struct Buffer {
    words: Vec<AtomicU32>,
    bytes: u64,
    /// Which words something wrote, if that is of interest.
    shadow: Option<Vec<AtomicU32>>,
}

impl Buffer {
    /// A buffer of zeros.
    ///
    /// # Errors
    /// [`RunError::OutOfMemory`] if there is no memory for it.
    pub fn zeroed(bytes: u64) -> Result<Self, RunError> {
        let out_of_memory = || RunError::OutOfMemory {
            what: "a buffer".to_owned(),
            bytes,
        };
        let count = usize::try_from(bytes.div_ceil(4)).map_err(|_| out_of_memory())?;
        let mut words = Vec::new();
        words
            .try_reserve_exact(count)
            .map_err(|_| out_of_memory())?;
        words.resize_with(count, || AtomicU32::new(0));
        Ok(Self {
            words,
            bytes,
            shadow: None,
        })
    }

    /// A buffer that holds nothing yet: its words are zero, and reading one before
    /// it is written is reported by programs that look for that
    /// ([`crate::Checks::uninitialised`]).
    ///
    /// # Errors
    /// [`RunError::OutOfMemory`] if there is no memory for it.
    pub fn unwritten(bytes: u64) -> Result<Self, RunError> {
        let mut buffer = Self::zeroed(bytes)?;
        buffer.forget()?;
        Ok(buffer)
    }

    /// From here on the buffer counts as unwritten, whatever it holds.
    pub(crate) fn forget(&mut self) -> Result<(), RunError> {
        match &self.shadow {
            Some(shadow) => written::forget(shadow),
            None => self.shadow = Some(written::unwritten(self.words.len(), "a buffer")?),
        }
        Ok(())
    }

    /// What is known of which words are written.
    pub(crate) fn shadow(&self) -> Option<&[AtomicU32]> {
        self.shadow.as_deref()
    }

    /// A buffer of the given bytes.
    ///
    /// # Errors
    /// [`RunError::OutOfMemory`] if there is no memory for it.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, RunError> {
        let mut buffer = Self::zeroed(bytes.len() as u64)?;
        buffer.write(bytes);
        Ok(buffer)
    }

    /// Size in bytes.
    #[must_use]
    pub fn len(&self) -> u64 {
        self.bytes
    }

    /// Whether the buffer has no bytes.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.bytes == 0
    }

    /// Overwrites the start of the buffer; bytes beyond its end are ignored.
    pub fn write(&mut self, bytes: &[u8]) {
        for (word, chunk) in self.words.iter_mut().zip(bytes.chunks(4)) {
            let mut value = word.get_mut().to_le_bytes();
            value[..chunk.len()].copy_from_slice(chunk);
            *word.get_mut() = u32::from_le_bytes(value);
        }
        if let Some(shadow) = &self.shadow {
            written::write(&shadow[..bytes.len().div_ceil(4).min(shadow.len())]);
        }
    }

    /// Sets every byte to zero.
    pub fn clear(&self) {
        for word in &self.words {
            word.store(0, Ordering::Relaxed);
        }
        if let Some(shadow) = &self.shadow {
            written::write(shadow);
        }
    }

    /// Copies as many bytes of another buffer as both have.
    pub fn copy_from(&self, source: &Self) {
        for (word, from) in self.words.iter().zip(&source.words) {
            word.store(from.load(Ordering::Relaxed), Ordering::Relaxed);
        }
        if let Some(shadow) = &self.shadow {
            for (i, word) in shadow.iter().enumerate().take(source.words.len()) {
                written::copy(word, source.shadow.as_ref().and_then(|from| from.get(i)));
            }
        }
    }

    /// The word at a byte offset that is a multiple of 4.
    pub(crate) fn word(&self, offset: u64) -> Option<u32> {
        let word = self.words.get(usize::try_from(offset / 4).ok()?)?;
        Some(word.load(Ordering::Relaxed))
    }

    /// A copy of the bytes.
    ///
    /// # Errors
    /// [`RunError::OutOfMemory`] if there is no memory for it.
    pub fn to_bytes(&self) -> Result<Vec<u8>, RunError> {
        let mut bytes = Vec::new();
        bytes
            .try_reserve_exact(self.words.len() * 4)
            .map_err(|_| RunError::OutOfMemory {
                what: "a buffer's contents".to_owned(),
                bytes: self.bytes,
            })?;
        bytes.extend(
            self.words
                .iter()
                .flat_map(|word| word.load(Ordering::Relaxed).to_le_bytes()),
        );
        // Not more than the words hold.
        bytes.truncate(self.bytes as usize);
        Ok(bytes)
    }

    pub(crate) fn words(&self) -> &[AtomicU32] {
        &self.words
    }
}
