//! What the driver tells the user.

use super::vehicle::Notice;

/// A return that ends farther from home than this is warned of, metres.
const NEAR_HOME: f64 = 3.0;

/// Tells it.
pub(super) fn tell(notice: &Notice) {
    match notice {
        Notice::Refused { what, result, texts } => {
            let words = if texts.is_empty() { "without a reason".to_owned() } else { format!("it says: {}", texts.join("; ")) };
            tracing::error!("the autopilot refused {what} ({}), {words}", result.words());
        }
        Notice::Waits { what, texts } if texts.is_empty() => {
            tracing::warn!("the autopilot rejects {what} for now, without a reason; it is asked again")
        }
        Notice::Waits { what, texts } => {
            tracing::warn!("the autopilot rejects {what} for now, and is asked again; it says: {}", texts.join("; "))
        }
        Notice::Says { severity, text } => match severity {
            0..=3 => tracing::error!("the autopilot: {text}"),
            4 => tracing::warn!("the autopilot: {text}"),
            _ => tracing::info!("the autopilot: {text}"),
        },
        Notice::LetGo { mode } => tracing::error!(
            "the flight mode is now {mode}, which was not commanded here: another station, the RC transmitter or a failsafe has control, \
             and nothing more is sent"
        ),
        Notice::HeldByFailsafe { mode } => tracing::error!(
            "the link was lost, and the autopilot's own failsafe holds the craft in {mode}: nobody flies it. Attended, T flies on and \
             L lands; unattended, it is landed"
        ),
        Notice::LeftTo { mode } => tracing::error!(
            "the craft is in the air in {mode}, which was not commanded here: whoever changed the mode, by the RC transmitter or \
             another station, has it, and this program sends it nothing"
        ),
        Notice::Missing { step, what } => {
            tracing::warn!("{step} waits: the autopilot does not send {}", what.join(", "));
        }
        Notice::NotOurs { what } => {
            tracing::error!(
                "no {what} is commanded: another station, the RC transmitter or a failsafe has control, until you resume (T)"
            )
        }
        Notice::UnknownHeight => tracing::error!(
            "no take-off: PX4 climbs to MIS_TAKEOFF_ALT, which could not be read, so that it cannot be checked against \
             --max-altitude; connect again, or improve the link"
        ),
        Notice::Returned { off: Some(off) } if *off > NEAR_HOME => {
            tracing::warn!("the craft has returned, landed and disarmed, {off:.1} m from its home position")
        }
        Notice::Returned { off } => {
            let off = off.map_or(String::new(), |off| format!(", {off:.1} m from its home position"));
            tracing::info!("the craft has returned, landed and disarmed{off}");
        }
        Notice::TakingBack { mode } => tracing::warn!("the operator takes control back from {mode}"),
        Notice::Unattended { landing: false } => tracing::error!("the flight loop was silent for 2 s: the craft hovers"),
        Notice::Unattended { landing: true } => tracing::error!("the flight loop was silent for 5 s: landing the craft"),
        Notice::Failed => tracing::error!("a part of the MAVLink driver failed: landing the craft"),
    }
}
