//! Free text that is kept in a shared log, the instruction and what a model answered, without the parts that look private.
//!
//! This is the second line of defence: whatever can be recognised by a list of known words is (see [`super::redact`]). A part that
//! looks private is replaced, once in every text, so that the pilot reads the same answer again from what is left.

use std::net::{Ipv4Addr, Ipv6Addr};

use super::mark::LEFT_OUT;

/// Letters between which a part of a text stands: white space, and what surrounds a value in JSON or in a sentence.
const BETWEEN: [char; 18] = ['"', '\'', '`', '(', ')', '[', ']', '{', '}', '<', '>', ',', ';', '|', '=', '“', '”', '?'];

/// How keys of vendors begin.
const KEY_STARTS: [&str; 8] = ["sk-", "sk_", "pk-", "AIza", "ghp_", "gsk_", "xai-", "hf_"];
/// Shortest part with letters and digits that counts as a serial number or a key, bytes, and its least number of digits.
const SERIAL: (usize, usize) = (8, 3);
/// Shortest row of digits that counts as a number of a device, an account or a telephone.
const LONG_NUMBER: usize = 9;
/// Length from which a part counts as a key whatever its letters, if it has a digit or capitals in its middle.
const LONG: usize = 24;

/// Whether a text may name a place on the globe: what an operator wrote may, what a model answered about an image does not, and
/// has fractions of its own.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Places {
    /// It may.
    Possible,
    /// It does not.
    None,
}

/// The text with every part replaced that looks private, or that contains one of `known`, the words that this computer is known
/// by. Passing the result again changes nothing.
pub(super) fn without_private(text: &str, known: &[String], places: Places) -> String {
    // Whoever is called like a word of the mark itself is not known by it.
    let known = known.iter().filter(|word| !LEFT_OUT.contains(&word.to_lowercase()));
    let text = known.fold(text.to_owned(), |text, word| without_word(&text, word));
    let mut kept = String::with_capacity(text.len());
    let mut rest = text.as_str();
    while let Some(start) = rest.find(|letter| !is_between(letter)) {
        let (before, from) = rest.split_at(start);
        let end = from.find(is_between).unwrap_or(from.len());
        // What follows the host of a URL, as a password may, belongs to it.
        let url = from[..end].contains("://");
        let end = if url { from.find(ends_url).unwrap_or(from.len()) } else { end };
        let (part, after) = from.split_at(end);
        kept.push_str(before);
        let bare = part.trim_end_matches(['.', '!', ':', '…']);
        if is_private(bare, places) {
            kept.push_str(LEFT_OUT);
            kept.push_str(&part[bare.len()..]);
        } else {
            kept.push_str(part);
        }
        rest = after;
    }
    kept.push_str(rest);
    kept
}

fn is_between(letter: char) -> bool {
    letter.is_whitespace() || BETWEEN.contains(&letter)
}

fn ends_url(letter: char) -> bool {
    letter.is_whitespace() || ['"', '\'', '`', '<', '>', '“', '”'].contains(&letter)
}

fn is_private(part: &str, places: Places) -> bool {
    is_address(part) || is_path(part) || part.split(':').any(is_code) || places == Places::Possible && has_coordinate(part)
}

/// The text without a known word, whatever its case, with the rest of the part in which it stands: a short word if it stands alone
/// between other letters, a long one wherever it is.
fn without_word(text: &str, word: &str) -> String {
    let is_long = word.len() >= 8;
    let (mut kept, mut from, mut last) = (String::new(), 0, None::<char>);
    while let Some(letter) = text[from..].chars().next() {
        let alone = is_long || !last.is_some_and(char::is_alphanumeric);
        let end = if alone { end_of(&text[from..], word).map(|length| from + length) } else { None };
        let end = end.filter(|end| is_long || !text[*end..].starts_with(char::is_alphanumeric));
        if let Some(end) = end.filter(|end| *end > from) {
            // The rest of its part goes with it, on both sides.
            kept.truncate(kept.rfind(is_between).map_or(0, |at| at + kept[at..].chars().next().map_or(0, char::len_utf8)));
            kept.push_str(LEFT_OUT);
            from = end + text[end..].find(is_between).unwrap_or(text.len() - end);
            last = None;
        } else {
            kept.push(letter);
            from += letter.len_utf8();
            last = Some(letter);
        }
    }
    kept
}

/// Where a word ends at the start of a text, bytes; `None` if it does not begin there.
fn end_of(text: &str, word: &str) -> Option<usize> {
    let mut letters = text.chars();
    for wanted in word.chars() {
        letters.next().filter(|letter| *letter == wanted || letter.to_lowercase().eq(wanted.to_lowercase()))?;
    }
    Some(text.len() - letters.as_str().len())
}

/// A URL, a name with a host, an IP or hardware address, or a host's name.
fn is_address(part: &str) -> bool {
    if part.contains("://") || part.split_once('@').is_some_and(|(user, host)| !user.is_empty() && !host.is_empty()) {
        return true;
    }
    let numbers =
        |text: &str| text.parse::<Ipv4Addr>().is_ok() || text.parse::<Ipv6Addr>().is_ok() && text.matches(':').count() > 1;
    let without_scope = part.split(['%', '/']).next().unwrap_or(part);
    let without_port = without_scope.rsplit_once(':').map_or(without_scope, |(host, _)| host);
    if numbers(without_scope) || numbers(without_port) || part.to_lowercase().starts_with("localhost") {
        return true;
    }
    // An IP address within other letters.
    let digits = |text: &str| {
        text.split(|letter: char| !letter.is_ascii_digit() && letter != '.').any(|run| run.parse::<Ipv4Addr>().is_ok())
    };
    if digits(part) {
        return true;
    }
    let hardware = |mark: char| {
        let groups: Vec<&str> = part.split(mark).collect();
        groups.len() >= 6 && groups.iter().all(|group| group.len() == 2 && group.bytes().all(|digit| digit.is_ascii_hexdigit()))
    };
    if hardware(':') || hardware('-') {
        return true;
    }
    let labels: Vec<&str> = without_port.split('.').collect();
    let plain = |label: &&str| {
        !label.is_empty() && label.chars().all(|letter| letter.is_alphanumeric() || letter == '-' || letter == '_')
    };
    let last = labels.last().copied().unwrap_or_default();
    labels.len() >= 2 && labels.iter().all(plain) && last.len() >= 2 && last.chars().all(char::is_alphabetic)
}

/// An absolute path, one into a home folder, or several folders deep.
fn is_path(part: &str) -> bool {
    let drive = part.as_bytes().first().is_some_and(u8::is_ascii_alphabetic) && part.get(1..3) == Some(":\\");
    let rooted =
        part.strip_prefix('/').is_some_and(|rest| rest.starts_with(|letter: char| letter.is_alphanumeric() || letter == '.'));
    let home = part.starts_with("~/")
        || part.starts_with("\\\\")
        || part.contains("\\Users\\")
        || part.starts_with('$') && part.contains('/');
    drive || rooted || home || part.matches('/').count() >= 2
}

/// A key, a serial number, or another long number.
fn is_code(part: &str) -> bool {
    if KEY_STARTS.iter().any(|start| part.starts_with(start)) {
        return true;
    }
    if part.parse::<f64>().is_ok() {
        let bare = part.trim_start_matches(['+', '-']);
        return bare.len() >= LONG_NUMBER && bare.bytes().all(|digit| digit.is_ascii_digit());
    }
    let count = |wanted: fn(char) -> bool| part.chars().filter(|letter| wanted(*letter)).count();
    let (letters, digits) = (count(char::is_alphabetic), count(|letter| letter.is_ascii_digit()));
    // Keys with a value in JSON without quotation marks, and actions with a unit, have a mark in their middle: `u:512`, `12.5m`.
    let plain = part.chars().all(|letter| letter.is_alphanumeric() || matches!(letter, '-' | '_' | '+' | '/' | '*' | '#'));
    if !plain {
        return part.len() >= 2 * LONG && digits > 0;
    }
    let inner_capital = part.chars().skip(1).any(char::is_uppercase) && part.chars().any(char::is_lowercase);
    letters > 0 && part.len() >= SERIAL.0 && digits >= SERIAL.1 || part.len() >= LONG && (digits > 0 || inner_capital)
}

/// A degree of latitude or longitude, with the fraction that makes it a place: 0.0001° is 11 m; or with minutes.
fn has_coordinate(part: &str) -> bool {
    let place = |number: &str| {
        let fraction = number.split_once('.').map_or(0, |(_, fraction)| fraction.len());
        fraction >= 4 && number.parse::<f64>().is_ok_and(|degrees| (1.0..=180.0).contains(&degrees))
    };
    let minutes = part.split_once('°').is_some_and(|(_, after)| after.starts_with(|letter: char| letter.is_ascii_digit()));
    minutes || part.split(|letter: char| !letter.is_ascii_digit() && letter != '.').any(place)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_looks_private_is_replaced_and_the_rest_stays() {
        let known = ["wendelin".to_owned()];
        let private = [
            "http://10.0.0.5:8080/v1",
            "192.168.10.1",
            "192.168.10.1:8889",
            "fe80::1%eth0",
            "fe80::12ab:1",
            "wendelin@home",
            "60:60:1f:a1:b2:c3",
            "60-60-1F-A1-B2-C3",
            "nas.home.example",
            "nas.local:8080",
            "/home/wendelin/x",
            "/root",
            "~/models",
            "C:\\Users\\Wendelin",
            "models/own/best.gguf",
            "sk-proj-abc",
            "AIzaSyA",
            "0TQZH5BEDM0F2A",
            "TELLO-A1B234",
            "013455667788",
            "9f86d081884c7d659a2feaa0c55ad015",
            "Wendelin",
            "wendelin-pc",
            "localhost",
            "47.37692",
            "8.54172E",
            "x192.168.1.7y",
            "geo:47.37692",
            "N47.37692",
            "47.37692/8.54172",
            "47°22",
            "key:AIzaSyA-0123456789",
            "+491701234567",
            "tel:+491701234567",
            "rtsp://cam/?user=admin&password=Secret99",
        ];
        for part in private {
            for text in [format!("fly to {part} now"), format!("{{\"target\":\"{part}\"}}"), format!("It is {part}.")] {
                let kept = without_private(&text, &known, Places::Possible);
                assert!(!kept.contains(part) && kept.contains(LEFT_OUT), "{text}: {kept}");
                assert_eq!(without_private(&kept, &known, Places::Possible), kept, "twice is once");
            }
        }
    }

    #[test]
    fn instructions_and_answers_stay_as_they_are() {
        let texts = [
            "Take off, and fly to the red crane at 3.5 m; then turn 90° left.",
            "Fly to the person with the green shirt and/or the tree, 12.5m away",
            r#"{"status":"navigating","stage":1,"target":"red crane","u":512,"v":0.4375,"depth":7,"boxes":[{"box_2d":[1,2,300,400],"depth":3,"name":"tree"}]}"#,
            r#"{u:512,v:300,depth:4}"#,
            "forward 1.5, yaw -20; done",
            "?_1=is('person')==True{_2=ox('person');?_2>0.6{tc(15)};->True};tc(180)",
            "Flieg zum großen Kran",
            "the target was followed for 12.5 s",
            "no reply within 20 s",
            "飞向红色起重机",
        ];
        for text in texts {
            assert_eq!(without_private(text, &[], Places::None), text);
        }
        assert_eq!(without_private("at 12.34567 m", &[], Places::None), "at 12.34567 m", "an answer's own fraction");
    }

    #[test]
    fn a_short_known_name_counts_as_a_word_only() {
        let known = ["red".to_owned(), "wendelin-key".to_owned()];
        assert_eq!(without_private("a tired colourful bird", &known, Places::Possible), "a tired colourful bird");
        assert_eq!(without_private("xwendelin-keyx", &known, Places::Possible), LEFT_OUT);
        // Known words with what else stands between parts.
        let known = ["John Doe", "jane-d", "two words; of a key", "c2VjcmV0IGtleQ==", "Jürgen"].map(str::to_owned);
        for word in &known {
            for text in [word.clone(), format!("to {word}, at once"), format!("=\"{}\"", word.to_uppercase())] {
                let kept = without_private(&text, &known, Places::Possible);
                assert!(!kept.to_lowercase().contains(&word.to_lowercase()) && kept.contains(LEFT_OUT), "{text}: {kept}");
                assert_eq!(without_private(&kept, &known, Places::Possible), kept, "twice is once");
            }
        }
        assert_eq!(without_private("a jane-doe", &known, Places::Possible), "a jane-doe");
    }
}
