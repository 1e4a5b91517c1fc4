//! Limits within the words of an instruction, applied before take-off, whatever model flies: they only tighten the envelope or the
//! approach.

use spf_core::craft::Craft;
use spf_core::time::Duration;
use spf_envelope::Limits;
use spf_oracle::limits::{Demand, LANDING_ON, LimitWords, limits};
use spf_pilot::PilotSettings;

use crate::error::{Error, one_line, quoted};

/// "Slowly" is this part of the speed that is otherwise flown.
const SLOWLY: f64 = 0.5;
/// Less is no flight, metres per second.
const SLOWEST: f64 = 0.1;

/// Where a flight begins, for limits that it would break at once.
#[derive(Clone, Copy, Debug)]
pub struct Beginning<'a> {
    /// The craft.
    pub craft: &'a Craft,
    /// Its height at the start of the flight, metres; `None` if only the take-off shows it.
    pub height: Option<f64>,
}

/// Tightens the limits and the method of a flight by what the instruction demands; the lines that say so. With `anyway`, what cannot be
/// kept is announced instead of refused.
///
/// # Errors
/// A usage error for a demand that nothing on board can keep, or that the flight would break at its start.
pub fn tighten(
    instruction: &str,
    anyway: bool,
    beginning: Beginning<'_>,
    envelope: &mut Limits,
    method: &mut PilotSettings,
) -> Result<Vec<String>, Error> {
    let found = limits(instruction).0;
    let mut lines = Vec::new();
    for LimitWords { words, demand } in &found {
        match kept(*demand, beginning, envelope, method) {
            Ok(line) => lines.push(format!("limit: \"{}\": {line}", one_line(words))),
            Err(why) if anyway || *demand == Demand::Fast => lines.push(format!("not heeded: \"{}\": {why}", one_line(words))),
            Err(why) => {
                return Err(Error::usage(format!("cannot keep to \"{}\": {why}", one_line(words))).hint(without(
                    *demand,
                    words,
                    instruction,
                )));
            }
        }
    }
    Ok(lines)
}

/// What to do about a demand of an instruction that cannot be kept.
fn without(demand: Demand, words: &str, instruction: &str) -> String {
    let leave = "leave it out, or fly without it with --anyway (docs/guide/fly.md, \"Limits within the words\")";
    if demand != Demand::Unmeasured(LANDING_ON) {
        return leave.to_owned();
    }
    let there = instruction.replacen(words, "fly to", 1);
    // What is named before is flown to already.
    let there = there.replace(" and fly to it", "").replace(", then fly to it", "");
    format!("to land at it, beside it or on it, say `spf fly \"{}\" --at-end land`", one_line(there.trim()))
}

/// Refuses limits in an instruction that is given in flight: the envelope of a flight is fixed at take-off.
///
/// # Errors
/// A usage error that names them.
pub(crate) fn refuse_in_flight(instruction: &str) -> Result<(), Error> {
    let demands = limits(instruction).0.into_iter().filter(|limit| limit.demand != Demand::Fast);
    let words: Vec<String> = demands.map(|limit| limit.words).collect();
    if words.is_empty() {
        return Ok(());
    }
    Err(Error::usage(format!("cannot keep to {} from now on: limits are fixed at take-off", quoted(&words)))
        .hint("give the instruction without it, or land and begin a flight with it"))
}

/// Tightens for one demand; what is said about it, or why nothing keeps it.
fn kept(demand: Demand, from: Beginning<'_>, envelope: &mut Limits, method: &mut PilotSettings) -> Result<String, String> {
    Ok(match demand {
        Demand::Height(most) => {
            let least = from.height.unwrap_or(0.0) + from.craft.take_off_height + envelope.margin;
            if most < least {
                return Err(format!("the craft takes off to such a height that at least {least:.1} m must be permitted"));
            }
            envelope.max_altitude = envelope.max_altitude.min(most);
            format!("at most {:.1} m high", envelope.max_altitude)
        }
        Demand::Speed(most) => slower(most, envelope),
        Demand::Slow => slower(SLOWLY * envelope.max_speed.min(from.craft.cruise_speed), envelope),
        Demand::Fast => return Err(format!("the craft flies at its usual speed, at most {:.1} m/s", envelope.max_speed)),
        Demand::Distance(most) => {
            envelope.max_distance = envelope.max_distance.min(most);
            format!("at most {:.0} m from the take-off point", envelope.max_distance)
        }
        Demand::Time(most) => {
            method.max_time = method.max_time.min(Duration::from_secs_f64(most));
            format!("at most {:.0} s", method.max_time.as_secs_f64())
        }
        Demand::StandOff(least) => {
            if !method.is_guided() {
                return Err("a distance from the target is kept by the default method only".to_owned());
            }
            method.stand_off_m = Some(least.max(method.stand_off_m.unwrap_or(0.0)));
            method.keep_m = method.keep_m.max(least);
            format!("the approach ends {least:.1} m before the target by what is known of its distance, which is not measured")
        }
        Demand::Obstacles if method.avoid || method.method.measures_view() => "obstacle mode is on".to_owned(),
        Demand::Obstacles => return Err("obstacle mode is off (--avoid)".to_owned()),
        Demand::Unmeasured(what) => return Err(format!("the drone does not measure {what}")),
    })
}

fn slower(most: f64, envelope: &mut Limits) -> String {
    envelope.max_speed = envelope.max_speed.min(most.max(SLOWEST));
    envelope.max_climb = envelope.max_climb.min(envelope.max_speed);
    format!("at most {:.1} m/s", envelope.max_speed)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn tightened(instruction: &str, anyway: bool) -> (Result<Vec<String>, Error>, Limits, PilotSettings) {
        let craft = Craft::quad();
        let (mut limits, mut method) = (Limits::for_craft(&craft), PilotSettings::preset(spf_pilot::Preset::Default));
        let lines = tighten(instruction, anyway, Beginning { craft: &craft, height: Some(0.0) }, &mut limits, &mut method);
        (lines, limits, method)
    }

    #[test]
    fn words_only_tighten() {
        let usual = Limits::for_craft(&Craft::quad());
        let (lines, limits, method) = tightened("go slowly to the bus, not higher than 9 m, keep 5 m away, within 50 s", false);
        assert_eq!(lines.unwrap().len(), 4);
        assert_eq!((limits.max_altitude, limits.max_speed, method.stand_off_m), (9.0, 1.5, Some(5.0)));
        assert_eq!(method.max_time, Duration::from_secs(50));
        let (lines, limits, _) =
            tightened("go to the bus, not higher than 5000 m, at most 90 m/s, not farther than 99999 m", false);
        assert_eq!(lines.unwrap().len(), 3);
        assert_eq!((limits.max_altitude, limits.max_distance), (usual.max_altitude, usual.max_distance));
        assert!(limits.max_speed <= usual.max_speed);
    }

    #[test]
    fn what_cannot_be_kept_is_refused_and_flown_without_only_when_told() {
        for (text, why) in [
            ("go to the bus, never fly over people", "what is below it"),
            ("go to the bus, below 3 m", "takes off to such a height"),
            ("go to the bus without hitting anything", "obstacle mode is off"),
            ("land on the bus", "on what it lands"),
        ] {
            let refused = tightened(text, false).0.unwrap_err().to_string();
            assert!(refused.contains(why), "{text}: {refused}");
            let flown = tightened(text, true).0.unwrap();
            assert!(flown[0].starts_with("not heeded: ") && flown[0].contains(why), "{text}: {flown:?}");
        }
        let landing = tightened("land on the landing pad", false).0.unwrap_err();
        assert!(landing.to_string().contains("spf fly \"fly to the landing pad\" --at-end land"), "{landing}");
        let kept = tightened("land on the bus, stay below 10 m", false).0.unwrap_err().to_string();
        assert!(kept.contains("\"fly to the bus, stay below 10 m\" --at-end land"), "{kept}");
        let slow = tightened("go to the bus, don't hurry", false);
        assert!(slow.1.max_speed < Limits::for_craft(&Craft::quad()).max_speed, "{:?}", slow.0);
        let wish = tightened("go quickly to the bus", false);
        assert!(wish.0.unwrap()[0].starts_with("not heeded: \"quickly\"") && wish.1 == Limits::for_craft(&Craft::quad()));
        assert!(refuse_in_flight("go quickly to the bus").is_ok());
        assert!(refuse_in_flight("go slowly to the bus").is_err() && refuse_in_flight("go to the bus").is_ok());
    }
}
