//! Buffers.

use std::sync::atomic::{AtomicU32, Ordering};

use super::wide::WideWords;
use super::written;
use crate::error::RunError;

/// Bytes a kernel reads and writes, as 32-bit words.
#[derive(Debug)]
pub struct Buffer {
    words: Vec<AtomicU32>,
    bytes: u64,
    wide: Option<WideWords>,
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
            wide: None,
            shadow: None,
        })
    }

    /// The buffer with a wide plane: an `f64` beside each word that was last
    /// written as a floating-point number by a program of a
    /// [number type](crate::NumberType) wider than `f32`.
    ///
    /// Such a program reads the `f64` back where it reads the word as a
    /// floating-point number. The word has the nearest `f32`. A word that was
    /// last written in another way, as an integer, by an atomic operation, from
    /// outside, has no `f64`, and reading it as a number gives the `f32` whose
    /// bits it has.
    ///
    /// # Errors
    /// [`RunError::OutOfMemory`] if there is no memory for it: 8 bytes per word.
    pub fn widen(mut self) -> Result<Self, RunError> {
        if self.wide.is_none() {
            self.wide = Some(WideWords::new(self.words.len() as u64)?);
        }
        Ok(self)
    }

    /// Whether there is a wide plane.
    #[must_use]
    pub fn is_wide(&self) -> bool {
        self.wide.is_some()
    }

    /// For each word what it was last written as, if that was a floating-point
    /// number and there is a wide plane.
    ///
    /// # Errors
    /// [`RunError::OutOfMemory`] if there is no memory for it.
    pub fn to_f64(&self) -> Result<Vec<Option<f64>>, RunError> {
        let count = self.words.len();
        let mut values = Vec::new();
        values
            .try_reserve_exact(count)
            .map_err(|_| RunError::OutOfMemory {
                what: "a buffer's contents".to_owned(),
                bytes: (count as u64).saturating_mul(16),
            })?;
        let wide = self.wide.as_ref();
        values.extend((0..count).map(|word| wide.and_then(|wide| wide.get(word))));
        Ok(values)
    }

    pub(crate) fn wide(&self) -> Option<&WideWords> {
        self.wide.as_ref()
    }

    fn forget_wide(&self) {
        if let Some(wide) = &self.wide {
            wide.forget_all();
        }
    }

    /// Bytes held, those of a wide plane included.
    #[must_use]
    pub fn held_bytes(&self) -> u64 {
        let wide = self.wide.as_ref().map_or(0, WideWords::bytes);
        self.bytes.saturating_add(wide)
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
        self.forget_wide();
        if let Some(shadow) = &self.shadow {
            written::write(&shadow[..bytes.len().div_ceil(4).min(shadow.len())]);
        }
    }

    /// Sets every byte to zero.
    pub fn clear(&self) {
        for word in &self.words {
            word.store(0, Ordering::Relaxed);
        }
        self.forget_wide();
        if let Some(shadow) = &self.shadow {
            written::write(shadow);
        }
    }

    /// Copies as many bytes of another buffer as both have.
    pub fn copy_from(&self, source: &Self) {
        for (word, from) in self.words.iter().zip(&source.words) {
            word.store(from.load(Ordering::Relaxed), Ordering::Relaxed);
        }
        match (&self.wide, &source.wide) {
            (Some(wide), Some(source)) => wide.copy_from(source),
            _ => self.forget_wide(),
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
