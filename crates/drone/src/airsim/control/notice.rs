//! What the driver tells the user.

/// A message.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(in crate::airsim) enum Notice {
    /// A call was refused, with the simulator's reason.
    Refused {
        /// What was asked.
        what: &'static str,
        /// Why not.
        why: String,
    },
    /// The craft touched something.
    Collided {
        /// Its name in the simulator.
        object: String,
    },
    /// Another program has taken control.
    TakenOver,
    /// The craft is in the air, and another program has it.
    LeftInTheAir,
    /// Something was not commanded, since another program has control.
    NotOurs {
        /// What.
        what: &'static str,
    },
    /// The pilot does not call the driver any more.
    Unattended {
        /// Whether the craft is landed; else it hovers.
        landing: bool,
    },
    /// A part of the driver failed; the craft is landed.
    Failed,
    /// The simulator reports a pose that is no number, or its time stands still.
    NoPose {
        /// Which of the two.
        why: &'static str,
    },
    /// It does not answer motion calls.
    Unanswered,
}

impl Notice {
    /// Tells it.
    pub(in crate::airsim) fn tell(&self) {
        match self {
            Self::Refused { what, why } => tracing::warn!("the simulator refused {what}: {why}"),
            Self::Collided { object } => tracing::error!("the craft has collided with `{object}`"),
            Self::TakenOver => tracing::error!(
                "another program has taken the API control of the vehicle away, or has reset it: nothing more is sent until you \
                 resume (T)"
            ),
            Self::LeftInTheAir => {
                tracing::error!(
                    "the craft is in the air, and another program has its API control: this program sends it nothing"
                );
            }
            Self::NotOurs { what } => {
                tracing::error!("no {what} is commanded: another program has the API control of the vehicle")
            }
            Self::Unattended { landing: false } => tracing::error!("the flight loop was silent for 2 s: the craft hovers"),
            Self::Unattended { landing: true } => tracing::error!("the flight loop was silent for 5 s: landing the craft"),
            Self::Failed => tracing::error!("a part of the AirSim driver failed: landing the craft"),
            Self::NoPose { why } => tracing::error!("the simulator's reports cannot be used: {why}"),
            Self::Unanswered => tracing::error!("the simulator answers no motion call any more: the link is treated as lost"),
        }
    }
}
