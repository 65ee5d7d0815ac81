use std::ffi::CString;
use std::ptr::null;

use crate::error::{Error, text_at};
use crate::ffi::*;

/// The name of the instruction set that the kernels use on this processor, for example `"avx2"`.
pub fn isa_name() -> String {
    // SAFETY: no arguments; the text is static.
    unsafe { text_at(dcloth_isa_name()) }.unwrap_or_default()
}

/// The engine's version, for example `"0.2.0"`.
pub fn version() -> String {
    // SAFETY: no arguments; the text is static.
    unsafe { text_at(dcloth_version()) }.unwrap_or_default()
}

/// Chooses the instruction set for the whole process: `"scalar"`, `"reproducible"` (the same bits everywhere, for
/// lockstep games and replays), or one that [`isa_name`] may return; `None` for the best.
///
/// # Safety
/// No other call of this crate may run at the same time, on any thread.
///
/// # Errors
/// [`Status::Argument`](crate::Status::Argument) where the processor or the build lacks it.
pub unsafe fn select_isa(name: Option<&str>) -> Result<(), Error> {
    let refused = |found: &str| Error::argument("instruction set", found, "\"scalar\", \"reproducible\" or isa_name()");
    let text = name.map(CString::new).transpose().map_err(|_| refused("a zero byte"))?;
    // SAFETY: null or a terminated text; by the caller nothing else runs.
    match unsafe { dcloth_isa_select(text.as_ref().map_or(null(), |text| text.as_ptr())) } {
        DCLOTH_OK => Ok(()),
        _ => Err(refused(name.unwrap_or("the best"))),
    }
}
