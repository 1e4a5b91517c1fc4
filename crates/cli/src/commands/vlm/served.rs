//! The service behind a run of the bench or a trial of models: what the user is told of it.

use std::sync::Arc;
use std::sync::atomic::AtomicU32;
use std::time::Duration;

use spf_vlm::service::{PATIENCE, RunEnd, Service, Wait, WallClock};

use super::advice;
use crate::error::CliError;
use crate::printer::Printer;

/// The service of a run on this machine's clock, with a cost limit in US dollars; `signals` stop it.
pub(crate) fn service(max_cost_usd: Option<f64>, signals: &Arc<AtomicU32>, printer: &Printer) -> Result<Arc<Service>, CliError> {
    let voice = printer.voice();
    let service = Service::new(Arc::new(WallClock::default()), max_cost_usd, move |wait| voice.log(&waiting(wait)));
    stoppable(&service, signals)?;
    Ok(service)
}

/// Lets `signals` stop a service.
pub(super) fn stoppable(service: &Arc<Service>, signals: &Arc<AtomicU32>) -> Result<(), CliError> {
    service.stop_on(signals.clone()).map_err(|error| CliError::internal("cannot start a thread").because(&error))
}

fn waiting(wait: &Wait) -> String {
    let Wait { vlm, error, failing, pause, left } = wait;
    let since = if failing.is_zero() { String::new() } else { format!("no answer for {}; ", span(*failing)) };
    format!("{vlm}: {error}; {since}asked again in {}, given up in {}", span(*pause), span(*left))
}

/// A time in words.
fn span(time: Duration) -> String {
    let (minutes, seconds) = (time.as_secs() / 60, time.as_secs() % 60);
    match (minutes / 60, minutes % 60) {
        (0, 0) => format!("{seconds} s"),
        (0, minutes) if seconds == 0 => format!("{minutes} min"),
        (0, minutes) => format!("{minutes} min {seconds} s"),
        (hours, 0) => format!("{hours} h"),
        (hours, minutes) => format!("{hours} h {minutes} min"),
    }
}

/// The error for a run that its service ended; `None` if the user or the cost limit ended it. `kept`: what was done is kept, in words.
pub(crate) fn failure(end: &RunEnd, kept: &str) -> Option<CliError> {
    let (message, error, what) = match end {
        RunEnd::Refused { vlm, error } => (format!("`{vlm}` refuses to answer, and the run has ended"), error, advice(error)),
        RunEnd::Down { vlm, error, failing } if failing.is_zero() => {
            let message = format!("`{vlm}` asks to wait for more than {}, and the run has ended", span(PATIENCE));
            (message, error, advice(error))
        }
        RunEnd::Down { vlm, error, failing } => {
            (format!("`{vlm}` has not answered for {}, and the run has ended", span(*failing)), error, advice(error))
        }
        RunEnd::Unanswered { vlm, error } => {
            (format!("`{vlm}` answered no query of a whole flight, and the run has ended"), error, advice(error))
        }
        _ => return None,
    };
    Some(CliError::failed(message).because(error).hint(format!("{what}\n{kept}")))
}

/// Dollars of a run: spent, left, and what all of it will come to, as text behind a count; empty if nothing is paid.
pub(crate) fn dollars(service: &Service, reckoned: Option<f64>) -> String {
    let spent = service.spent_usd();
    if spent == 0.0 && service.max_cost_usd().is_none() {
        return String::new();
    }
    let left = service.max_cost_usd().map_or(String::new(), |most| format!(", ${:.2} left", (most - spent).max(0.0)));
    let whole = reckoned.map_or(String::new(), |whole| format!(", about ${whole:.2} for all"));
    format!("; ${spent:.2} spent{left}{whole}")
}

#[cfg(test)]
mod tests {
    use super::*;
    use spf_vlm::VlmError;

    #[test]
    fn a_wait_is_told_with_its_reason_and_its_times() {
        let error = VlmError::Network { host: "api.example".to_owned(), reason: "no route to host".to_owned() };
        let wait = Wait {
            vlm: "gemini".to_owned(),
            error,
            failing: Duration::from_secs(75),
            pause: Duration::from_secs(160),
            left: Duration::from_secs(7125),
        };
        assert_eq!(
            waiting(&wait),
            "gemini: cannot reach api.example: no route to host; no answer for 1 min 15 s; asked again in 2 min 40 s, given up in \
             1 h 58 min"
        );
        assert_eq!(span(PATIENCE), "2 h");
    }

    #[test]
    fn dollars_are_told_as_far_as_they_are_known() {
        let service = Service::new(Arc::new(WallClock::default()), Some(2.0), |_| {});
        service.charge(0.5);
        assert_eq!(dollars(&service, Some(1.234)), "; $0.50 spent, $1.50 left, about $1.23 for all");
        assert_eq!(dollars(&Service::impatient(), None), "");
    }
}
