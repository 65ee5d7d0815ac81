use std::alloc::{Layout, alloc_zeroed, dealloc};
use std::ffi::c_void;
use std::ptr::NonNull;

use crate::error::{Error, Status};
use crate::ffi::DCLOTH_ALIGNMENT;

/// Zeroed memory on `DCLOTH_ALIGNMENT` that is lent to the engine. It does not move.
pub(crate) struct Memory {
    bytes: NonNull<u8>,
    layout: Layout,
}

// SAFETY: plain bytes with one owner; whoever reads or writes them through the engine keeps to its rules.
unsafe impl Send for Memory {}
// SAFETY: a shared reference gives only an address.
unsafe impl Sync for Memory {}

impl Memory {
    /// Tells when there is not enough memory, instead of ending the process.
    pub(crate) fn new(size: usize) -> Result<Self, Error> {
        let short = || Error::plain(Status::Memory, format!("found no memory for {size} bytes"));
        let layout = Layout::from_size_align(size.max(1), DCLOTH_ALIGNMENT).map_err(|_| short())?;
        // SAFETY: the layout has a size.
        let bytes = NonNull::new(unsafe { alloc_zeroed(layout) }).ok_or_else(short)?;
        Ok(Self { bytes, layout })
    }

    pub(crate) fn copy_of(from: &[u8]) -> Result<Self, Error> {
        let memory = Self::new(from.len())?;
        // SAFETY: the memory is new, so it overlaps nothing, and holds as many bytes.
        unsafe { memory.bytes.as_ptr().copy_from_nonoverlapping(from.as_ptr(), from.len()) };
        Ok(memory)
    }

    pub(crate) fn address(&self) -> *mut c_void {
        self.bytes.as_ptr().cast()
    }
}

impl Drop for Memory {
    fn drop(&mut self) {
        // SAFETY: allocated with this layout.
        unsafe { dealloc(self.bytes.as_ptr(), self.layout) };
    }
}
