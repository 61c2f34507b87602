//! Where a scan stands.

#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum State {
    CheckJournal,
    CheckSensors,
    /// Whoever was here before may have left the shutter open.
    Shut,
    Home,
    LampOn,
    Move,
    Begin,
    Dark {
        k: usize,
    },
    Open,
    Expose,
    Close,
    EndPose,
    GiveUp,
    /// A move failed: whatever still turns is stopped before the next.
    Halt,
    /// Suspended: the shutter closes.
    Shade,
    /// Suspended: waiting.
    Suspended,
    /// It has passed: the lamp is switched on again.
    Relight,
    LampOff,
    Safing,
    Ended,
}

impl State {
    /// Whether the scan can stand still here, and go on later or anew.
    pub(super) const fn waits(self) -> bool {
        !matches!(
            self,
            Self::CheckJournal
                | Self::CheckSensors
                | Self::Begin
                | Self::EndPose
                | Self::GiveUp
                | Self::LampOff
                | Self::Safing
                | Self::Ended
        )
    }
}

/// Where the frame under way stands.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Frame {
    /// None: one is to be taken.
    Idle,
    /// Taken, the lamp is to be read.
    Taken,
    /// To be kept with this lamp monitor.
    Read(f64),
}
