//! The parts of a sentence, against what they should say.

pub(super) fn between<'a>(text: &'a str, before: &str, after: &str) -> Option<&'a str> {
    text.strip_prefix(before)?.strip_suffix(after)
}

pub(super) fn same(what: &'static str, told: &str, meant: &str) -> Result<&'static str, String> {
    if told == meant { Ok(what) } else { Err(format!("{what}: it was {meant}")) }
}

pub(super) fn number_of(text: &str) -> Result<usize, String> {
    let (number, word) = text.split_once(' ').ok_or("no number")?;
    let number: usize = number.parse().map_err(|_| "no number")?;
    same("number", word, if number == 1 { "answer" } else { "answers" }).map(|_| number)
}

pub(super) fn metres_are(told: &str, meant: f64) -> Result<(), String> {
    let told: f64 = told.parse().map_err(|_| format!("no number in `{told}`"))?;
    let tolerance = if meant < 9.94 { 0.0501 } else { 0.501 };
    if (told - meant).abs() <= tolerance { Ok(()) } else { Err(format!("it was {meant:.2} m")) }
}

/// Checks a direction such as `12° left`; `meant`: degrees to the right.
pub(super) fn direction_is(told: &str, meant: f64) -> Result<(), String> {
    if told == "straight ahead" {
        return if meant.abs() < 2.0 { Ok(()) } else { Err(format!("it is {meant:.1}° off")) };
    }
    turn_is(told, meant, 360.0)
}

/// Checks a turn such as `30° left`, which may be off by whole turns where its sense is not known.
pub(super) fn turn_is(told: &str, meant: f64, whole: f64) -> Result<(), String> {
    let (degrees, side) = told.split_once("° ").ok_or("no turn")?;
    let degrees: f64 = degrees.parse().map_err(|_| "no turn")?;
    let told = match side {
        "left" => -degrees,
        "right" => degrees,
        _ => return Err("no side".to_owned()),
    };
    let off = (told - meant).rem_euclid(whole);
    if off.min(whole - off) <= 0.51 { Ok(()) } else { Err(format!("it was {meant:.1}°")) }
}
