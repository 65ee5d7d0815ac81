use crate::ffi::*;
use crate::model::Stages;

/// One frame of time. The network ticks at its own rate, and frames between ticks are blended.
///
/// ```
/// let frame = dcloth::Frame::new(1.0 / 60.0).pipelined(true).stages(dcloth::Stages::Skeleton);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
#[must_use]
pub struct Frame {
    pub(crate) seconds: f32,
    pub(crate) stages: Stages,
    pub(crate) flags: u32,
}

impl Frame {
    /// A frame that comes `seconds` after the last one: 0 (a pause) or more. It runs all stages.
    ///
    /// The first update after a reset ticks at once, whatever `seconds` says. After a long time only the latest ticks
    /// run.
    pub fn new(seconds: f32) -> Self {
        Self { seconds, stages: Stages::Mesh, flags: 0 }
    }

    /// The stages of ticks that start now. Stages that the model lacks are ignored.
    pub fn stages(mut self, stages: Stages) -> Self {
        self.stages = stages;
        self
    }

    /// Spreads each tick over the frames until the next one is due, so that no frame pays for a whole tick. The ticks
    /// are the same, but later by less than one tick.
    pub fn pipelined(self, on: bool) -> Self {
        self.flag(DCLOTH_FRAME_PIPELINED, on)
    }

    /// The character was moved since the last update: a portal, a new world origin. The jump is not taken for motion.
    pub fn jumped(self, on: bool) -> Self {
        self.flag(DCLOTH_FRAME_JUMPED, on)
    }

    /// No tick starts in this frame. A tick that becomes due waits for the next frame without the flag.
    pub fn hold(self, on: bool) -> Self {
        self.flag(DCLOTH_FRAME_HOLD, on)
    }

    /// Experimental: stops ticking while the character is idle. Frames then cost drawing alone.
    pub fn freeze_idle(self, on: bool) -> Self {
        self.flag(DCLOTH_FRAME_FREEZE_IDLE, on)
    }

    fn flag(mut self, flag: u32, on: bool) -> Self {
        self.flags = if on { self.flags | flag } else { self.flags & !flag };
        self
    }
}
