//! What "done" means, by the verbs of the instruction: one line for each kind of instruction that its words may be, for a line
//! that is not needed costs tokens and attention.

const FOLLOWING: &str = "following: never; only a new instruction ends it.";

/// The kinds of instruction whose end differs from that of going to something. `{near}` stands for the distance that counts.
const KINDS: [Kind; 7] = [
    Kind {
        words: &["through", "into", "inside", "enter", "under", "underneath", "beneath"],
        phrases: &[],
        ending: "going through something: out on the other side, the opening behind.",
    },
    Kind {
        words: &["around", "round", "circle", "circling", "orbit", "encircle", "circumnavigate"],
        phrases: &[],
        ending: "going around something: all the way round it.",
    },
    Kind {
        words: &["over", "across", "above"],
        phrases: &[],
        ending: "going over something: across it above its top, and beyond its far edge.",
    },
    Kind {
        words: &["past", "beyond", "behind", "pass"],
        phrases: &[],
        ending: "going past or behind something: beyond it by {near} or more, as seen from where the drone began.",
    },
    Kind {
        words: &["next", "second", "third", "fourth", "another", "other"],
        phrases: &[],
        ending: "the next or another one: never that of the stage before.",
    },
    Kind {
        words: &["scan", "survey", "rotate", "spin", "panorama", "surroundings", "explore"],
        phrases: &[
            "look around",
            "turn around",
            "look round",
            "turn round",
            "full circle",
            "full turn",
            "search the environment",
            "search the area",
            "search the place",
            "search the room",
        ],
        ending: "looking around or searching a place: a full circle turned there.",
    },
    Kind {
        words: &["follow", "following", "track", "tracking", "chase", "pursue", "accompany", "escort"],
        phrases: &["stay with", "stay behind", "keep up", "keep with"],
        ending: FOLLOWING,
    },
];

/// Distance from its target at which an instruction counts as fulfilled if nothing else is set, metres.
const NEAR: f64 = 3.0;

/// Words of instructions to go to something.
const REACHING: [&str; 22] = [
    "to", "toward", "towards", "reach", "find", "search", "seek", "spot", "for", "approach", "visit", "land", "locate",
    "inspect", "at", "near", "nearest", "next", "beside", "by", "until", "another",
];

struct Kind {
    words: &'static [&'static str],
    phrases: &'static [&'static str],
    ending: &'static str,
}

/// The kinds of instruction that the words may be, and whether something may be meant that is to be reached.
fn kinds(instruction: &str) -> (Vec<&'static Kind>, bool) {
    let words: Vec<String> =
        instruction.split(|c: char| !c.is_alphanumeric()).filter(|word| !word.is_empty()).map(str::to_lowercase).collect();
    let line = format!(" {} ", words.join(" "));
    let has = |word: &&str| line.contains(&format!(" {word} "));
    let special: Vec<&Kind> = KINDS.iter().filter(|kind| kind.words.iter().any(&has) || kind.phrases.iter().any(&has)).collect();
    let is_reaching = special.is_empty() || REACHING.iter().any(has);
    (special, is_reaching)
}

/// Whether an instruction may ask for something that is fulfilled at a distance from its target: what is flown through or over is not.
#[must_use]
pub fn ends_near_target(instruction: &str) -> bool {
    kinds(instruction).1
}

/// What "done" means, a line each. `near`: the distance at which a target counts as reached, metres; `None` for [`NEAR`].
/// `keep`: the distance that the drone keeps by itself from what it follows, metres; `None` if it does not.
pub(super) fn endings(instruction: &str, near: Option<f64>, keep: Option<f64>) -> String {
    let near = near.unwrap_or(NEAR);
    let (special, is_reaching) = kinds(instruction);
    let mut lines = Vec::new();
    if is_reaching {
        lines.push(format!("going to or finding something: it is in view, its nearest part within {near} m."));
    }
    lines.extend(special.iter().map(|kind| match keep {
        Some(keep) if kind.ending == FOLLOWING => {
            format!("{FOLLOWING} The drone stays {keep} m away by itself: say how far away the target really is, and never \"blocked\" because of it.")
        }
        _ => kind.ending.replace("{near}", &format!("{near} m")),
    }));
    if lines.len() > 1 {
        lines.push("Of several stages, the last decides.".to_owned());
    }
    lines.iter().map(|line| format!("- {line}")).collect::<Vec<_>>().join("\n")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_the_kinds_named_are_explained() {
        let lines = |instruction: &str| endings(instruction, Some(3.0), None).lines().count();
        assert_eq!(
            endings("Fly to the red crane", Some(3.0), None),
            "- going to or finding something: it is in view, its nearest part within 3 m."
        );
        assert!(endings("go to the door", Some(0.8), None).contains("within 0.8 m"));
        assert!(endings("I am thirsty", None, None).contains("within 3 m"));
        assert!(endings("fly past the tree", Some(0.8), None).contains("by 0.8 m or more"));
        assert_eq!(lines("visit one tower and the next"), 3);
        assert_eq!(endings("Follow the walking man", None, None), "- following: never; only a new instruction ends it.");
        let kept = endings("Follow the walking man", None, Some(2.5));
        assert!(kept.contains("ends it. The drone stays 2.5 m away by itself: say how far"), "{kept}");
        assert_eq!(endings("go to the door", None, Some(2.5)), endings("go to the door", None, None));
        assert!(endings("Look around.", None, None).contains("full circle"));
        assert_eq!(lines("fly over the building and search the environment behind it"), 5);
        assert_eq!(lines("fly through the tunnel, then to the church"), 3);
        assert_eq!(lines("fly over the bridge"), 1);
        assert!(ends_near_target("fly to the bridge") && !ends_near_target("fly through the bridge"));
        // A word within another one is none.
        assert_eq!(lines("go to the overpass"), 1);
    }
}
