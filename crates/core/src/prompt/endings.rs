//! What "done" means, by the verbs of the instruction: one line for each kind of instruction that its words may be, for a line
//! that is not needed costs tokens and attention.

const FOLLOWING: &str = "following: never; only a new instruction ends it.";

/// The kinds of instruction whose end differs from that of going to something.
const KINDS: [Kind; 6] = [
    Kind {
        words: &["through", "into", "inside", "enter", "under", "underneath", "beneath"],
        phrases: &[],
        ending: "going through something: the opening is behind the drone, which is out on the other side.",
    },
    Kind {
        words: &["around", "round", "circle", "circling", "orbit", "encircle", "circumnavigate"],
        phrases: &[],
        ending: "going around something: the drone has been all the way round it.",
    },
    Kind {
        words: &["over", "across", "above"],
        phrases: &[],
        ending: "going over something: the drone has crossed it, and it lies behind.",
    },
    Kind {
        words: &["past", "beyond", "behind", "pass"],
        phrases: &[],
        ending: "going past or behind something: the drone is beyond it, on its far side.",
    },
    Kind {
        words: &["scan", "survey", "rotate", "spin", "panorama", "surroundings"],
        phrases: &["look around", "turn around", "look round", "turn round", "full circle", "full turn"],
        ending: "looking around: the drone has turned through a full circle.",
    },
    Kind {
        words: &["follow", "following", "track", "tracking", "chase", "pursue", "accompany", "escort"],
        phrases: &["stay with", "stay behind", "keep up", "keep with"],
        ending: FOLLOWING,
    },
];

/// Words of instructions to go to something.
const REACHING: [&str; 17] = [
    "to", "toward", "towards", "reach", "find", "approach", "visit", "land", "locate", "inspect", "at", "near", "nearest",
    "next", "beside", "by", "until",
];

struct Kind {
    words: &'static [&'static str],
    phrases: &'static [&'static str],
    ending: &'static str,
}

/// What "done" means, a line each. `near`: the distance at which a target counts as reached, metres; `None` if it is not set.
/// `keep`: the distance that the drone keeps by itself from what it follows, metres; `None` if it does not.
pub(super) fn endings(instruction: &str, near: Option<f64>, keep: Option<f64>) -> String {
    let words: Vec<String> =
        instruction.split(|c: char| !c.is_alphanumeric()).filter(|word| !word.is_empty()).map(str::to_lowercase).collect();
    let line = format!(" {} ", words.join(" "));
    let has = |word: &&str| line.contains(&format!(" {word} "));
    let special: Vec<&Kind> = KINDS.iter().filter(|kind| kind.words.iter().any(&has) || kind.phrases.iter().any(&has)).collect();
    let mut lines = Vec::new();
    if special.is_empty() || REACHING.iter().any(has) {
        let within = near.map_or_else(|| "close to it".to_owned(), |near| format!("within {near} m of it"));
        lines.push(format!("going to something: the drone is {within}, and it is in view."));
    }
    lines.extend(special.iter().map(|kind| match keep {
        Some(keep) if kind.ending == FOLLOWING => {
            format!("{FOLLOWING} The drone stays {keep} m away by itself: say how far away the target really is, and never \"blocked\" because of it.")
        }
        _ => kind.ending.to_owned(),
    }));
    if lines.len() > 1 {
        lines.push("Of several stages, the last one decides.".to_owned());
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
            "- going to something: the drone is within 3 m of it, and it is in view."
        );
        assert!(endings("go to the door", Some(0.8), None).contains("within 0.8 m of it"));
        assert!(endings("I am thirsty", None, None).starts_with("- going to something: the drone is close to it"));
        assert_eq!(endings("Follow the walking man", None, None), "- following: never; only a new instruction ends it.");
        let kept = endings("Follow the walking man", None, Some(2.5));
        assert!(kept.contains("ends it. The drone stays 2.5 m away by itself: say how far"), "{kept}");
        assert_eq!(endings("go to the door", None, Some(2.5)), endings("go to the door", None, None));
        assert!(endings("Look around.", None, None).contains("full circle"));
        assert_eq!(lines("fly through the tunnel, then to the church"), 3);
        assert_eq!(lines("fly over the bridge"), 1);
        // A word within another one is none.
        assert_eq!(lines("go to the overpass"), 1);
    }
}
