//! Prompt templates: texts with placeholders, so that a prompt is a file and not code.
//!
//! `{{name}}` is replaced by a value. Text between the lines `{{#name}}` and `{{/name}}` is included only if the value
//! is not empty. Substituted text is not expanded again, so an instruction cannot introduce placeholders.

use core::fmt::Write as _;

/// Maximum size of a prompt file, bytes.
const LONGEST: usize = 64 * 1024;
/// Start of the first line.
const HEAD: &str = "spf-prompt ";

/// The kind of query a prompt is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PromptKind {
    /// A point.
    Point,
    /// Actions in words.
    Plain,
    /// Actions as four numbers.
    Numeric,
    /// One of several fixed moves.
    Discrete,
    /// A choice among the numbered marks.
    Choose,
    /// Whether the instruction is fulfilled.
    Done,
    /// A program.
    Program,
    /// A question about a list of detections.
    Question,
    /// All objects in the image.
    Detect,
}

impl PromptKind {
    /// All kinds.
    const ALL: [Self; 9] = [
        Self::Point,
        Self::Plain,
        Self::Numeric,
        Self::Discrete,
        Self::Choose,
        Self::Done,
        Self::Program,
        Self::Question,
        Self::Detect,
    ];

    /// Its name in the first line of a file.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::Point => "point",
            Self::Plain => "plain",
            Self::Numeric => "numeric",
            Self::Discrete => "discrete",
            Self::Choose => "choose",
            Self::Done => "done",
            Self::Program => "program",
            Self::Question => "question",
            Self::Detect => "detect",
        }
    }

    /// The placeholders available in a prompt of this kind.
    fn places(self) -> &'static [&'static str] {
        match self {
            Self::Point => &[
                "instruction",
                "coordinates",
                "labels",
                "in_metres",
                "depth_key",
                "scale",
                "endings",
                "avoid",
                "measures",
                "unguarded",
                "field",
                "detected",
                "close_up",
                "memory",
                "horizon",
                "confirming",
                "example",
            ],
            Self::Plain | Self::Numeric | Self::Discrete => {
                &["instruction", "metres", "degrees", "most_actions", "endings", "actions", "confirming"]
            }
            Self::Choose => &["instruction", "step", "most", "example"],
            Self::Done => &["instruction", "endings", "memory", "confirming"],
            Self::Program => &["instruction", "low_skills", "high_skills", "replanning", "scene", "previous"],
            Self::Question => &["question", "scene"],
            Self::Detect => &["classes"],
        }
    }

    /// The placeholder required in a prompt of this kind.
    fn required(self) -> Option<&'static str> {
        match self {
            Self::Question => Some("question"),
            Self::Detect => None,
            _ => Some("instruction"),
        }
    }
}

/// Why a text is not a valid prompt.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum PromptError {
    /// Invalid first line.
    #[error("line 1 must be `spf-prompt KIND VERSION`, where KIND is one of {}", PromptKind::ALL.map(PromptKind::word).join(", "))]
    Head,
    /// Too long.
    #[error("the prompt exceeds {LONGEST} bytes")]
    TooLong,
    /// An unknown placeholder.
    #[error("line {line}: unknown variable `{{{{{name}}}}}`; a {kind} prompt has {}", known.join(", "))]
    Unknown {
        /// Line number.
        line: usize,
        /// The placeholder's name.
        name: String,
        /// Kind of the prompt.
        kind: &'static str,
        /// Known placeholders.
        known: Vec<&'static str>,
    },
    /// A section that is not closed, or closed without being open.
    #[error("line {line}: the section `{name}` must open and close on lines of their own and cannot be nested")]
    Section {
        /// Line number.
        line: usize,
        /// Its name.
        name: String,
    },
    /// A required placeholder is missing.
    #[error("the prompt lacks the required `{{{{{0}}}}}`")]
    Lacks(&'static str),
}

/// A parsed prompt template.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PromptText {
    kind: PromptKind,
    version: String,
    /// The file's text.
    source: String,
    pieces: Vec<Piece>,
}

#[derive(Clone, Debug, PartialEq, Eq)]
struct Piece {
    /// Included only if this value is not empty.
    only_if: Option<&'static str>,
    what: What,
}

#[derive(Clone, Debug, PartialEq, Eq)]
enum What {
    Text(String),
    Place(&'static str),
}

impl PromptText {
    /// Parses a prompt file.
    ///
    /// # Errors
    /// [`PromptError`], with the line number where applicable.
    pub fn parse(file: &str) -> Result<Self, PromptError> {
        if file.len() > LONGEST {
            return Err(PromptError::TooLong);
        }
        let (head, body) = file.split_once('\n').ok_or(PromptError::Head)?;
        let mut words = head.trim_end().strip_prefix(HEAD).ok_or(PromptError::Head)?.split_whitespace();
        let word = words.next().ok_or(PromptError::Head)?;
        let kind = PromptKind::ALL.into_iter().find(|kind| kind.word() == word).ok_or(PromptError::Head)?;
        let (Some(version), None) = (words.next(), words.next()) else { return Err(PromptError::Head) };
        let (version, source) = (version.to_owned(), file.to_owned());
        let mut prompt = Self { kind, version, source, pieces: Vec::new() };
        let mut section = None;
        for (index, line) in body.split_inclusive('\n').enumerate() {
            prompt.read_line(line, index + 2, &mut section)?;
        }
        match section {
            Some(name) => Err(PromptError::Section { line: body.lines().count() + 1, name: name.to_owned() }),
            None => match kind.required().filter(|name| !prompt.pieces.iter().any(|piece| piece.what == What::Place(name))) {
                Some(name) => Err(PromptError::Lacks(name)),
                None => Ok(prompt),
            },
        }
    }

    fn read_line(&mut self, text: &str, line: usize, section: &mut Option<&'static str>) -> Result<(), PromptError> {
        let tag = |mark: &str| text.trim().strip_prefix("{{")?.strip_suffix("}}")?.strip_prefix(mark);
        if let Some(name) = tag("#") {
            let name = self.place(name, line)?;
            return match section.replace(name) {
                None => Ok(()),
                Some(_) => Err(PromptError::Section { line, name: name.to_owned() }),
            };
        }
        if let Some(name) = tag("/") {
            return match section.take() {
                Some(open) if open == name => Ok(()),
                _ => Err(PromptError::Section { line, name: name.to_owned() }),
            };
        }
        let mut rest = text;
        while let Some((before, after)) = rest.split_once("{{") {
            self.push(*section, What::Text(before.to_owned()));
            let (name, after) = after.split_once("}}").unwrap_or((after, ""));
            let place = self.place(name, line)?;
            self.push(*section, What::Place(place));
            rest = after;
        }
        self.push(*section, What::Text(rest.to_owned()));
        Ok(())
    }

    fn push(&mut self, only_if: Option<&'static str>, what: What) {
        if what != What::Text(String::new()) {
            self.pieces.push(Piece { only_if, what });
        }
    }

    fn place(&self, name: &str, line: usize) -> Result<&'static str, PromptError> {
        let places = self.kind.places();
        places.iter().copied().find(|place| *place == name.trim()).ok_or_else(|| PromptError::Unknown {
            line,
            name: name.trim().chars().take(40).collect(),
            kind: self.kind.word(),
            known: places.to_vec(),
        })
    }

    /// The kind of query it is for.
    #[must_use]
    pub fn kind(&self) -> PromptKind {
        self.kind
    }

    /// Kind and version, for records: `point-2`.
    #[must_use]
    pub fn name(&self) -> String {
        format!("{}-{}", self.kind.word(), self.version)
    }

    /// The file's text, for records: [`PromptText::parse`] returns the same prompt from it.
    #[must_use]
    pub fn source(&self) -> &str {
        &self.source
    }

    /// The text with its placeholders filled in.
    pub(super) fn fill(&self, value: impl Fn(&str) -> String) -> String {
        let mut text = String::with_capacity(4096);
        for piece in &self.pieces {
            if piece.only_if.is_some_and(|name| value(name).is_empty()) {
                continue;
            }
            match &piece.what {
                What::Text(words) => text.push_str(words),
                // Writing to a string cannot fail.
                What::Place(name) => drop(write!(text, "{}", value(name))),
            }
        }
        text
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn places_are_filled_and_sections_stand_or_fall() {
        let file = "spf-prompt plain mine-2\nDo {{instruction}}!\n{{#actions}}\nDone: {{ actions }}.\n{{/actions}}\nEnd\n";
        let prompt = PromptText::parse(file).unwrap();
        assert_eq!((prompt.name().as_str(), prompt.kind()), ("plain-mine-2", PromptKind::Plain));
        let with =
            |actions: &str| prompt.fill(|name| if name == "actions" { actions.to_owned() } else { "{{#avoid}}".to_owned() });
        assert_eq!(with(""), "Do {{#avoid}}!\nEnd\n");
        assert_eq!(with("a; b"), "Do {{#avoid}}!\nDone: a; b.\nEnd\n");
    }

    #[test]
    fn wrong_files_are_refused_by_line() {
        let refused = |body: &str| PromptText::parse(&format!("spf-prompt point 1\n{body}")).unwrap_err().to_string();
        assert!(
            refused("{{instruction}}\n{{colour}}\n")
                .starts_with("line 3: unknown variable `{{colour}}`; a point prompt has instruction, ")
        );
        assert!(refused("{{instruction}}\n{{#avoid}}\nx\n").contains("section `avoid`"));
        assert!(refused("{{/avoid}}\n").starts_with("line 2: "));
        assert_eq!(refused("hello\n"), PromptError::Lacks("instruction").to_string());
        for head in ["", "hello\n", "spf-prompt point\n", "spf-prompt none 1\n", "spf-prompt point 1 2\n"] {
            assert_eq!(PromptText::parse(head), Err(PromptError::Head), "{head}");
        }
    }

    proptest! {
        #[test]
        fn no_text_panics(text in "(\\{\\{|\\}\\}|#|/|avoid|instruction|\n|[a-z ]){0,40}") {
            let _ = PromptText::parse(&text);
            let _ = PromptText::parse(&format!("spf-prompt point 1\n{text}"));
        }
    }
}
