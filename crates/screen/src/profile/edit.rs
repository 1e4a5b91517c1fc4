//! Changes of a profile's text that leave everything else as it is: comments, order, and what was not changed.

use toml_edit::{DocumentMut, Item, TableLike, Value};

use super::ProfileError;

/// A new value.
#[derive(Clone, Debug, PartialEq)]
pub enum Change {
    /// A number, rounded to four digits.
    Number(f64),
    /// A line of text.
    Text(String),
}

/// The text of a profile with other values; each key is a path such as `controls.forward.rate_m_s`. A key that is not there is added to
/// its table, which has to be there.
///
/// # Errors
/// [`ProfileError::Edit`] if the text is no TOML, or a table is missing.
pub fn edited(text: &str, changes: &[(&str, Change)]) -> Result<String, ProfileError> {
    let mut document: DocumentMut = text.parse().map_err(|error: toml_edit::TomlError| ProfileError::Edit(error.to_string()))?;
    for (path, change) in changes {
        let mut table: &mut dyn TableLike = document.as_table_mut();
        let (parts, key) = path.rsplit_once('.').map_or((None, *path), |(parts, key)| (Some(parts), key));
        for part in parts.into_iter().flat_map(|parts| parts.split('.')) {
            let inner = table.get_mut(part).and_then(Item::as_table_like_mut);
            table = inner.ok_or_else(|| ProfileError::Edit(format!("there is no table `{part}` for `{path}`")))?;
        }
        let mut value = match change {
            Change::Number(number) => Value::from(rounded(*number)),
            Change::Text(text) => Value::from(text.as_str()),
        };
        match table.get_mut(key).and_then(Item::as_value_mut) {
            Some(old) => {
                // What stands around it, such as a comment behind it.
                *value.decor_mut() = old.decor().clone();
                *old = value;
            }
            None => drop(table.insert(key, Item::Value(value))),
        }
    }
    Ok(document.to_string())
}

/// A number with four digits.
fn rounded(number: f64) -> f64 {
    format!("{number:.3e}").parse().unwrap_or(number)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::profile::{Profile, SHIPPED};

    #[test]
    fn only_what_changes_changes() {
        let text = "# about it\n[controls]\ndead_time_s = 0.1 # one frame\nforward = { plus = \"w\", rate_m_s = 4.0 }\n\n[controls.yaw]\nrate_deg_s = 9\n";
        let changes = [
            ("controls.dead_time_s", Change::Number(0.123_46)),
            ("controls.forward.rate_m_s", Change::Number(3.9)),
            ("controls.forward.minus_rate_m_s", Change::Number(2.0)),
            ("controls.yaw.rate_deg_s", Change::Number(95.0)),
        ];
        let found = edited(text, &changes).unwrap();
        assert_eq!(
            found,
            "# about it\n[controls]\ndead_time_s = 0.1235 # one frame\nforward = { plus = \"w\", rate_m_s = 3.9 , minus_rate_m_s = 2.0 }\n\n\
             [controls.yaw]\nrate_deg_s = 95.0\n"
        );
        let error = edited(text, &[("controls.right.rate_m_s", Change::Number(1.0))]).unwrap_err().to_string();
        assert!(error.contains("no table `right`"), "{error}");
        assert!(edited("[", &[]).is_err());
    }

    #[test]
    fn a_shipped_profile_keeps_its_comments() {
        for (name, text) in SHIPPED {
            let changes =
                [("controls.up.rate_m_s", Change::Number(2.25)), ("source", Change::Text("measured \"here\"".to_owned()))];
            let found = edited(text, &changes).unwrap();
            let profile = Profile::parse(&found).unwrap();
            assert_eq!((profile.controls.up.rate_m_s, profile.source.as_str()), (2.25, "measured \"here\""), "{name}");
            let comments = |text: &str| text.matches('#').count();
            assert_eq!(comments(text), comments(&found), "{name}");
        }
    }

    proptest! {
        #[test]
        fn any_text_is_changed_or_refused(text in ".{0,200}", path in "[a-z.]{0,20}", number in any::<f64>()) {
            drop(edited(&text, &[(path.as_str(), Change::Number(number)), ("source", Change::Text(text.clone()))]));
        }
    }
}
