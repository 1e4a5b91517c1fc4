//! Class names in model metadata: `{0: 'person', 1: 'bicycle'}`, a Python dictionary, or a list.

use spf_core::coco;

/// Maximum number of classes; the largest public sets have about 1200.
const MAX_CLASSES: usize = 10_000;

/// Parses the names; `None` if they are invalid or have gaps.
pub(crate) fn parse(text: &str) -> Option<Vec<String>> {
    let text = text.trim();
    let inner = text.strip_prefix('{').and_then(|rest| rest.strip_suffix('}'));
    let numbered = inner.is_some();
    let mut rest = inner.or_else(|| text.strip_prefix('[')?.strip_suffix(']'))?.trim();
    let mut names = Vec::new();
    while !rest.is_empty() && names.len() < MAX_CLASSES {
        if numbered {
            let (number, after) = rest.split_once(':')?;
            if number.trim().trim_matches(['\'', '"']).parse() != Ok(names.len()) {
                return None;
            }
            rest = after.trim_start();
        }
        let (name, after) = quoted(rest)?;
        names.push(name);
        let after = after.trim_start();
        rest = match after.strip_prefix(',') {
            Some(after) => after.trim_start(),
            None if after.is_empty() => after,
            None => return None,
        };
    }
    (!names.is_empty() && rest.is_empty()).then_some(names)
}

/// A quoted Python string, and the remaining text.
fn quoted(text: &str) -> Option<(String, &str)> {
    let quote = text.chars().next().filter(|c| ['\'', '"'].contains(c))?;
    let mut out = String::new();
    let mut characters = text.char_indices().skip(1);
    while let Some((at, c)) = characters.next() {
        match c {
            '\\' => out.push(characters.next()?.1),
            _ if c == quote => return Some((out, &text[at + c.len_utf8()..])),
            _ => out.push(c),
        }
    }
    None
}

/// A name for each of `classes`: the model's own, COCO's if it has none and there are 80, else their indices. An
/// end-to-end model does not state their number.
pub(crate) fn complete(own: Option<Vec<String>>, classes: Option<usize>) -> Vec<String> {
    match (own, classes) {
        (Some(own), _) => own,
        (None, None | Some(80)) => coco::CLASSES.map(str::to_owned).to_vec(),
        (None, Some(classes)) => (0..classes).map(|class| format!("class {class}")).collect(),
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn names_are_read_as_models_carry_them() {
        let read = |text: &str| parse(text).map(|names| names.join("|"));
        assert_eq!(read("{0: 'person', 1: 'traffic light'}").as_deref(), Some("person|traffic light"));
        assert_eq!(read(r#"{0: "driver's hat", 1: 'it\'s', }"#).as_deref(), Some("driver's hat|it's"));
        assert_eq!(read(r#"{"0": "a", "1": "b"}"#).as_deref(), Some("a|b"));
        assert_eq!(read("['cone', 'door']").as_deref(), Some("cone|door"));
        for none in ["", "{}", "[]", "{1: 'a'}", "{0: 'a' 1: 'b'}", "{0: a}", "{0: 'a", "person", "{0: 'a'}}"] {
            assert_eq!(read(none), None, "{none}");
        }
    }

    #[test]
    fn without_names_80_classes_are_cocos() {
        assert_eq!(complete(None, Some(80))[2], "car");
        assert_eq!(complete(None, None)[2], "car");
        assert_eq!(complete(None, Some(2)), ["class 0", "class 1"]);
        assert_eq!(complete(parse("['cone']"), Some(80)), ["cone"]);
    }

    proptest! {
        #[test]
        fn any_text_is_read_without_panic(text in ".{0,80}", inner in r#"[0-9:, '"\\a-c]{0,40}"#) {
            let _ = parse(&text);
            let _ = parse(&format!("{{{inner}}}"));
        }

        #[test]
        fn what_python_writes_is_read(names in prop::collection::vec("[a-zé' ]{1,9}", 1..9)) {
            let written: Vec<String> = names.iter().enumerate().map(|(i, name)| format!("{i}: \"{name}\"")).collect();
            prop_assert_eq!(parse(&format!("{{{}}}", written.join(", "))), Some(names));
        }
    }
}
