//! Results read where the device left them.

use std::ops::Range;
use std::sync::Arc;

use crate::frame::EngineError;
use crate::published::{Packed, TileColumns};

/// A part of a buffer that is mapped until this is dropped.
#[derive(Debug)]
pub struct Mapped {
    /// `None` only while it is dropped.
    view: Option<wgpu::BufferView>,
    buffer: wgpu::Buffer,
    kept: Range<usize>,
    /// Tells the buffer's owner that it is read.
    _reader: Arc<()>,
}

impl Mapped {
    /// The first bytes of a buffer that has been mapped for reading.
    ///
    /// # Errors
    /// [`EngineError::DeviceFailed`] where it has not.
    pub fn new(buffer: &wgpu::Buffer, bytes: u64, reader: Arc<()>) -> Result<Mapped, EngineError> {
        let view = buffer
            .get_mapped_range(..bytes)
            .map_err(|error| EngineError::DeviceFailed(error.to_string()))?;
        Ok(Mapped {
            view: Some(view),
            buffer: buffer.clone(),
            kept: 0..bytes as usize,
            _reader: reader,
        })
    }

    /// Leaves only some bytes.
    pub fn keep(&mut self, bytes: Range<usize>) {
        self.kept = bytes;
    }

    /// What is mapped.
    pub fn bytes(&self) -> &[u8] {
        self.view.as_deref().map_or(&[], |view| &view[self.kept.clone()])
    }
}

impl Packed for Mapped {
    fn heights(&self) -> &[TileColumns] {
        bytemuck::cast_slice(self.bytes())
    }
}

impl Drop for Mapped {
    fn drop(&mut self) {
        // A buffer can't be unmapped while it is viewed.
        self.view = None;
        self.buffer.unmap();
    }
}
