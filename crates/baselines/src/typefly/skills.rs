//! TypeFly's skills: what a program can call (arXiv 2312.14950, §4 and its second version). The words and programs are our own.

use std::collections::BTreeMap;

use super::minispec::{Block, SkillCall, Skills, Value, parse_body};

/// A low-level skill: carried out by the policy.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Skill {
    /// Along an axis of the body.
    Move(Axis),
    /// Clockwise when true.
    Turn(bool),
    Delay,
    /// Whether something is on the list of detections.
    IsVisible,
    /// A measure of its box.
    Measure(Figure),
    Log,
    Picture,
    /// A question to the model about the list.
    Query,
    /// The weak "go to" of the configuration without replanning.
    TurnAndHop,
    RePlan,
}

/// Ways to move.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Axis {
    Forward,
    Backward,
    Left,
    Right,
    Up,
    Down,
}

/// A value of a box.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Figure {
    X,
    Y,
    Width,
    Height,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    Number,
    Text,
    /// Its argument, as text.
    Any,
}

/// Name, names of another version, argument, description.
type Row = (&'static str, &'static [&'static str], Option<Kind>, &'static str, Skill);

const LOW: [Row; 18] = [
    ("move_forward", &[], Some(Kind::Number), "fly forward by centimetres", Skill::Move(Axis::Forward)),
    ("move_backward", &[], Some(Kind::Number), "fly backward by centimetres", Skill::Move(Axis::Backward)),
    ("move_left", &[], Some(Kind::Number), "fly to the left by centimetres", Skill::Move(Axis::Left)),
    ("move_right", &[], Some(Kind::Number), "fly to the right by centimetres", Skill::Move(Axis::Right)),
    ("move_up", &[], Some(Kind::Number), "climb by centimetres", Skill::Move(Axis::Up)),
    ("move_down", &[], Some(Kind::Number), "descend by centimetres", Skill::Move(Axis::Down)),
    ("turn_cw", &[], Some(Kind::Number), "turn clockwise by degrees", Skill::Turn(true)),
    ("turn_ccw", &[], Some(Kind::Number), "turn counter-clockwise by degrees", Skill::Turn(false)),
    ("delay", &[], Some(Kind::Number), "wait for seconds", Skill::Delay),
    ("is_visible", &[], Some(Kind::Any), "whether the named object is in view", Skill::IsVisible),
    ("object_x", &[], Some(Kind::Any), "centre of the object's box, 0 left to 1 right", Skill::Measure(Figure::X)),
    ("object_y", &[], Some(Kind::Any), "centre of the object's box, 0 top to 1 bottom", Skill::Measure(Figure::Y)),
    ("object_width", &[], Some(Kind::Any), "width of the object's box, 0 to 1", Skill::Measure(Figure::Width)),
    ("object_height", &[], Some(Kind::Any), "height of the object's box, 0 to 1", Skill::Measure(Figure::Height)),
    ("log", &[], Some(Kind::Any), "tell the person something", Skill::Log),
    ("picture", &["take_picture"], None, "save the current picture", Skill::Picture),
    ("query", &["probe"], Some(Kind::Text), "ask about what is in view; True, False, a number or a name", Skill::Query),
    ("re_plan", &[], None, "end this program and write another", Skill::RePlan),
];

/// Name, names of another version, body with `HOP` for a hop's centimetres, description.
const HIGH: [(&str, &[&str], &str, &str); 5] = [
    (
        "sweeping",
        &["scan"],
        "8{?is_visible($1){->True;}turn_cw(45);}->False;",
        "turn round until the named object is in view; False if it never is",
    ),
    (
        "sweeping_abstract",
        &["scan_abstract"],
        "8{_1=query($1);?_1!=False{->_1;}turn_cw(45);}->False;",
        "turn round until the question has an answer, and give that; False if it never has",
    ),
    (
        "approach",
        &[],
        "6{_1=object_height($1);?_1>0.5{->True;}move_forward(HOP);}_1=object_height($1);?_1>0.5{->True;}->False;",
        "fly forward in up to six hops until the named object fills half of the picture's height; False if it does not yet",
    ),
    (
        "orienting",
        &[],
        "4{_1=object_x($1);?_1>=0.4&_1<=0.6{->True;}?_1>0.6{turn_cw(15);}?_1<0.4{turn_ccw(15);}}\
         _1=object_x($1);?_1>=0.4&_1<=0.6{->True;}->False;",
        "turn until the named object is in the middle of the picture; False if it is not yet",
    ),
    (
        "goto",
        &[],
        "_1=orienting($1);?_1==False{->False;}_1=approach($1);->_1;",
        "turn to the named object and approach it; False if it is not reached yet",
    ),
];

/// A hop of the published approach, for a craft with a Tello's cruise speed, centimetres.
const HOP_CM: f64 = 40.0;

#[derive(Clone, Debug)]
enum What {
    Low(Skill, Option<Kind>),
    High(Block),
}

/// The skills under their names and abbreviations.
#[derive(Clone, Debug)]
pub(super) struct Library {
    entries: Vec<What>,
    names: BTreeMap<String, usize>,
    /// For the prompt: low-level skills, then high-level ones.
    described: [String; 2],
}

impl Library {
    /// The skills for a craft that is `scale` times as fast as the one they were written for. `closed_loop`: "go to"
    /// observes again after each hop; else it is one turn and one hop.
    pub(super) fn new(scale: f64, closed_loop: bool) -> Self {
        let mut library = Self { entries: Vec::new(), names: BTreeMap::new(), described: Default::default() };
        for (name, others, argument, does, skill) in LOW {
            if closed_loop || skill != Skill::RePlan {
                library.add(name, others, argument.is_some(), does, What::Low(skill, argument));
            }
        }
        let hop = libm::round(HOP_CM * scale).to_string();
        for (name, others, body, does) in HIGH {
            // A test parses the bodies.
            let body = parse_body(&body.replace("HOP", &hop)).unwrap_or_default();
            let weak = What::Low(Skill::TurnAndHop, Some(Kind::Any));
            library.add(name, others, true, does, if name == "goto" && !closed_loop { weak } else { What::High(body) });
        }
        library
    }

    fn add(&mut self, name: &str, others: &[&str], argument: bool, does: &str, what: What) {
        let short = abbreviation(name, |short| self.names.contains_key(short));
        let high = matches!(what, What::High(_));
        let given = if argument { "(argument)" } else { "" };
        self.described[usize::from(high)].push_str(&format!("{short} {name}{given}: {does}\n"));
        for word in others.iter().copied().chain([name, &short]) {
            self.names.insert(word.to_owned(), self.entries.len());
        }
        self.entries.push(what);
    }

    fn find(&self, name: &str) -> Option<&What> {
        self.names.get(&name.to_ascii_lowercase()).map(|&index| &self.entries[index])
    }

    /// The low-level and the high-level skills, one line each.
    pub(super) fn described(&self) -> &[String; 2] {
        &self.described
    }

    /// The low-level skill of a call, with its argument: a number, or a text.
    pub(super) fn low(&self, call: &SkillCall) -> Result<(Skill, Argument), String> {
        let Some(What::Low(skill, kind)) = self.find(&call.name) else {
            return Err(format!("there is no skill `{}`", call.name));
        };
        let wrong = |wanted: &str| Err(format!("`{}` requires {wanted}", call.name));
        let argument = match (kind, call.arguments.as_slice()) {
            (None, _) => Argument::default(),
            (Some(_), []) => return wrong("an argument"),
            (Some(Kind::Number), [value, ..]) => match value.number() {
                Some(number) => Argument { number, text: String::new() },
                None => return wrong(&format!("a number, not {value}")),
            },
            (Some(Kind::Text), [value, ..]) => match value {
                Value::Text(text) => Argument { number: 0.0, text: text.clone() },
                other => return wrong(&format!("a string, not {other}")),
            },
            (Some(Kind::Any), [value, ..]) => match value {
                Value::Text(text) => Argument { number: 0.0, text: text.clone() },
                other => Argument { number: 0.0, text: other.to_string() },
            },
        };
        Ok((*skill, argument))
    }
}

/// The argument of a low-level skill.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Argument {
    pub(super) number: f64,
    pub(super) text: String,
}

impl Skills for Library {
    fn is_skill(&self, name: &str) -> bool {
        self.find(name).is_some()
    }

    fn body(&self, name: &str) -> Option<Block> {
        match self.find(name) {
            Some(What::High(body)) => Some(body.clone()),
            _ => None,
        }
    }
}

/// Initials of the words, two at most; if that is taken, the first letter and the next free letter of the name.
fn abbreviation(name: &str, taken: impl Fn(&str) -> bool) -> String {
    let initials: String = name.split('_').filter_map(|word| word.chars().next()).take(2).collect();
    if !taken(&initials) {
        return initials;
    }
    let joined = name.replace('_', "");
    let first: String = joined.chars().take(1).collect();
    let others = joined.chars().skip(1).map(|letter| format!("{first}{letter}"));
    others.into_iter().find(|short| !taken(short)).unwrap_or(joined)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn abbreviations_are_the_published_ones() {
        let library = Library::new(1.0, true);
        let shorts: Vec<&str> =
            library.described.iter().flat_map(|text| text.lines()).filter_map(|l| l.split(' ').next()).collect();
        let low = ["mf", "mb", "ml", "mr", "mu", "md", "tc", "tu", "d", "iv", "ox", "oy", "ow", "oh", "l", "p", "q", "rp"];
        assert_eq!(shorts[..18], low);
        assert_eq!(shorts[18..], ["s", "sa", "a", "o", "g"]);
    }

    #[test]
    fn bodies_can_be_read() {
        for (name, _, body, _) in HIGH {
            let body = parse_body(&body.replace("HOP", "40")).unwrap();
            assert!(!body.is_empty(), "{name}");
        }
    }

    #[test]
    fn calls_are_checked() {
        let library = Library::new(1.0, true);
        let call = |name: &str, arguments: Vec<Value>| library.low(&SkillCall { name: name.to_owned(), arguments });
        let chair = || Value::Text("chair".to_owned());
        assert_eq!(call("MF", vec![Value::Int(50)]).unwrap().0, Skill::Move(Axis::Forward));
        assert_eq!(call("probe", vec![chair()]).unwrap(), (Skill::Query, Argument { number: 0.0, text: "chair".to_owned() }));
        assert_eq!(call("mf", vec![chair()]), Err("`mf` requires a number, not 'chair'".to_owned()));
        assert_eq!(call("iv", Vec::new()), Err("`iv` requires an argument".to_owned()));
        assert!(library.body("scan").is_some() && library.body("mf").is_none() && !library.is_skill("flip"));
        assert!(Library::new(1.0, false).body("goto").is_none());
    }
}
