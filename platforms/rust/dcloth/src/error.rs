use std::ffi::{CStr, c_char};
use std::fmt;

use crate::ffi::*;

/// What kind of thing went wrong.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Status {
    /// A wrong count, a wrong number or an axis that does not fit.
    Argument,
    /// Memory is not aligned. This crate aligns all memory, so it does not occur.
    Alignment,
    /// There is not enough memory.
    Memory,
    /// The bytes are no `.dcloth` file, are truncated or are broken.
    Format,
    /// The file or the state has a version that this release cannot read.
    Version,
    /// The file is intact, but its content is impossible.
    Semantics,
    /// The pose holds NaN, infinity, too large a value or a wrong number of joints.
    Pose,
    /// The skeleton lacks joints of the model.
    Joints,
    /// The saved state belongs to another model.
    Model,
    /// A file could not be read.
    Io,
    /// A status that this version of the crate does not know.
    Unknown(i32),
}

impl Status {
    fn of(status: dcloth_status) -> Self {
        match status {
            DCLOTH_ERROR_ARGUMENT => Self::Argument,
            DCLOTH_ERROR_ALIGNMENT => Self::Alignment,
            DCLOTH_ERROR_MEMORY => Self::Memory,
            DCLOTH_ERROR_FORMAT => Self::Format,
            DCLOTH_ERROR_VERSION => Self::Version,
            DCLOTH_ERROR_SEMANTICS => Self::Semantics,
            DCLOTH_ERROR_POSE => Self::Pose,
            DCLOTH_ERROR_JOINTS => Self::Joints,
            DCLOTH_ERROR_MODEL => Self::Model,
            other => Self::Unknown(other),
        }
    }

    /// The engine's word for it, such as `"ARGUMENT"`.
    pub fn name(self) -> &'static str {
        match self {
            Self::Argument => "ARGUMENT",
            Self::Alignment => "ALIGNMENT",
            Self::Memory => "MEMORY",
            Self::Format => "FORMAT",
            Self::Version => "VERSION",
            Self::Semantics => "SEMANTICS",
            Self::Pose => "POSE",
            Self::Joints => "JOINTS",
            Self::Model => "MODEL",
            Self::Io => "IO",
            Self::Unknown(_) => "UNKNOWN",
        }
    }
}

/// Why a call was refused. The call changed nothing.
///
/// ```
/// let error = dcloth::Model::open(b"no model").unwrap_err();
/// assert_eq!(error.status(), dcloth::Status::Format);
/// println!("{error}"); // FORMAT: ... found ..., allowed ...
/// ```
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Error(Box<Parts>);

#[derive(Clone, Debug, PartialEq, Eq)]
struct Parts {
    status: Status,
    text: String,
    offset: Option<u64>,
    what: Option<String>,
    found: Option<String>,
    allowed: Option<String>,
    mend: Option<String>,
}

impl Error {
    /// What kind of thing went wrong.
    pub fn status(&self) -> Status {
        self.0.status
    }

    /// The whole text: the field, what was found, what is allowed and how to mend it.
    pub fn text(&self) -> &str {
        &self.0.text
    }

    /// The place in the model's or state's bytes, if there is one.
    pub fn offset(&self) -> Option<u64> {
        self.0.offset
    }

    /// The field, tensor or joint of which the text speaks.
    pub fn what(&self) -> Option<&str> {
        self.0.what.as_deref()
    }

    /// What was found there.
    pub fn found(&self) -> Option<&str> {
        self.0.found.as_deref()
    }

    /// What is allowed there.
    pub fn allowed(&self) -> Option<&str> {
        self.0.allowed.as_deref()
    }

    /// How to mend it.
    pub fn mend(&self) -> Option<&str> {
        self.0.mend.as_deref()
    }

    /// An error that this crate finds before the engine is called.
    pub(crate) fn argument(what: &str, found: impl fmt::Display, allowed: impl fmt::Display) -> Self {
        Self(Box::new(Parts {
            status: Status::Argument,
            text: format!("{what}: found {found}, allowed: {allowed}"),
            offset: None,
            what: Some(what.to_string()),
            found: Some(found.to_string()),
            allowed: Some(allowed.to_string()),
            mend: None,
        }))
    }

    pub(crate) fn plain(status: Status, text: String) -> Self {
        Self(Box::new(Parts { status, text, offset: None, what: None, found: None, allowed: None, mend: None }))
    }
}

impl fmt::Display for Error {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(formatter, "{}: {}", self.status().name(), self.text())
    }
}

impl std::error::Error for Error {}

/// Calls the engine with an error to fill in.
pub(crate) fn call(function: impl FnOnce(*mut dcloth_error) -> dcloth_status) -> Result<(), Error> {
    let mut error = dcloth_error::new();
    error.offset_bytes = u64::MAX;
    match function(&mut error) {
        DCLOTH_OK => Ok(()),
        status => Err(translate(status, &error)),
    }
}

fn translate(status: dcloth_status, error: &dcloth_error) -> Error {
    let bytes: Vec<u8> = error.text.iter().map(|&byte| byte as u8).take_while(|&byte| byte != 0).collect();
    let part = |at: u16, size: u16| {
        let part = bytes.get(usize::from(at)..usize::from(at) + usize::from(size))?;
        (size > 0).then(|| String::from_utf8_lossy(part).into_owned())
    };
    let mut text = String::from_utf8_lossy(&bytes).into_owned();
    if text.is_empty() {
        // SAFETY: any number may be asked for; the text is static.
        text = unsafe { text_at(dcloth_status_name(status)) }.unwrap_or_default();
    }
    Error(Box::new(Parts {
        status: Status::of(status),
        text,
        offset: (error.offset_bytes != u64::MAX).then_some(error.offset_bytes),
        what: part(error.what_at, error.what_size),
        found: part(error.found_at, error.found_size),
        allowed: part(error.allowed_at, error.allowed_size),
        mend: part(error.mend_at, error.mend_size),
    }))
}

/// Text of the engine. Names come out of files, so any bytes may be among them.
///
/// # Safety
/// `text` is null or a terminated text.
pub(crate) unsafe fn text_at(text: *const c_char) -> Option<String> {
    if text.is_null() {
        return None;
    }
    // SAFETY: by the caller.
    Some(unsafe { CStr::from_ptr(text) }.to_string_lossy().into_owned())
}
