//! Reads the project's own prompts for points (`prompts/point-6.txt`), as far as the oracle needs them: instruction, stage, what was
//! pointed at, how far the craft has turned, coordinates, and what is to be answered. A prompt in an unknown wording is an error:
//! an oracle that took it for a first query would answer the first stage for ever.

use spf_core::grounding::{AxisOrder, GroundingProfile, Scale};
use spf_core::query::{DepthAs, Look, Memory, QueryKind};

/// What a prompt asks.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Wording {
    /// The text between « and ».
    pub(super) instruction: String,
    /// The history, as far as the oracle uses it.
    pub(super) memory: Memory,
    /// The coordinates of the answer.
    pub(super) profile: GroundingProfile,
    /// What is asked.
    pub(super) kind: QueryKind,
}

/// The prompt read; `None` if it has no instruction between « and », and so is none of ours.
///
/// # Errors
/// What is not understood.
pub(super) fn read(prompt: &str, (width, height): (u32, u32)) -> Result<Option<Wording>, &'static str> {
    // The record before it has names of the model's own, each on a line with other words.
    let ours = prompt.rsplit_once("\nThe instruction: «").or_else(|| prompt.split_once('«'));
    let Some((_, behind)) = ours else { return Ok(None) };
    let instruction = behind.split_once('»').ok_or("where the instruction ends (« without »)")?.0;
    // The record comes before the instruction.
    let rest = prompt;
    let scales = [Scale::Thousand, Scale::Hundred, Scale::Unit, Scale::Pixels { width, height }];
    let mut profiles = [AxisOrder::Yx, AxisOrder::Xy]
        .into_iter()
        .flat_map(|order| scales.map(|scale| GroundingProfile { order, scale, ..GroundingProfile::default() }));
    let profile = profiles.find(|profile| rest.contains(&profile.describe())).ok_or("which coordinates it asks for")?;
    let depth = match (rest.contains("\n- depth: "), rest.contains("\n- depth_m: ")) {
        (true, false) => DepthAs::Labels,
        (false, true) => DepthAs::Metres,
        _ => return Err("how it asks for the depth"),
    };
    if !rest.contains("\n- open_way: ") {
        return Err("a request for `open_way`, which reply format 3 requires");
    }
    Ok(Some(Wording {
        instruction: instruction.to_owned(),
        memory: memory(rest)?,
        profile,
        kind: QueryKind::Point { avoid: rest.contains("\n- boxes: "), depth },
    }))
}

/// The stage that is being worked on.
fn stage(rest: &str) -> Result<u32, &'static str> {
    let stages: Vec<u32> = rest.lines().filter_map(|line| number(line, "Stage ", " is being worked on.")).collect();
    if let [stage] = stages[..] { Ok(stage) } else { Err("which stage is being worked on") }
}

/// The history. Names given by a model are on one line and in quotation marks, so that none can pass for a
/// line of its own.
fn memory(rest: &str) -> Result<Memory, &'static str> {
    let stage = stage(rest)?;
    let targets = rest.lines().filter_map(|line| {
        let (_, behind) = line.split_once("answer ago: \"").or_else(|| line.split_once("answers ago: \""))?;
        Some(behind.split_once('"')?.0.to_owned())
    });
    let lost = rest.lines().find(|line| line.starts_with("You last pointed at the target "));
    let unseen = rest.lines().find_map(|line| line.strip_prefix("You have not seen its target yet; the drone has turned "));
    let turned = unseen.or_else(|| Some(lost?.split_once("Since then the drone has turned ")?.1)).map_or(Some(0.0), |text| {
        let (degrees, side) = text.split_once("° ")?;
        let degrees: f64 = degrees.parse().ok()?;
        if side.starts_with("left") { Some(-degrees) } else { side.starts_with("right").then_some(degrees) }
    });
    let last_seen = lost.and_then(|line| match (line.contains(" on the left."), line.contains(" on the right.")) {
        (true, _) => Some(Look::Left),
        (_, true) => Some(Look::Right),
        _ => None,
    });
    let turned = turned.ok_or("how far the drone has turned")?.to_radians();
    Ok(Memory { stage, targets: targets.collect(), turned, last_seen, ..Memory::default() })
}

fn number(line: &str, before: &str, after: &str) -> Option<u32> {
    line.strip_prefix(before)?.strip_suffix(after)?.parse().ok()
}

#[cfg(test)]
mod tests {
    use super::*;
    use spf_core::prompt::{PromptInput, point_prompt};
    use spf_core::query::{LostTarget, Motion, PastAnswer, Said};

    fn remembered() -> Memory {
        let pointed = |target: &str| PastAnswer {
            said: Said::Pointed,
            target: Some(target.to_owned()),
            bearing_deg: Some(0.0),
            range_m: Some(7.7),
            asked_deg: None,
            planned_m: Some(2.9),
            planned_deg: Some(0.0),
            detour: None,
            actions: Vec::new(),
            motion: Some(Motion { moved_m: 2.5, turned_deg: 10.0, ..Motion::default() }),
        };
        let unseen = PastAnswer { said: Said::NotSeen, target: None, ..pointed("") };
        let lost = LostTarget { answers_ago: 2, left_on: Some(Look::Left), bearing_deg: 30.0, in_frame: true, turned_deg: -72.0 };
        Memory {
            stage: 3,
            answers: vec![pointed("gate"), pointed("left of the gate"), unseen],
            lost: Some(lost),
            ..Memory::default()
        }
    }

    #[test]
    fn our_own_prompts_are_understood() {
        let memory = remembered();
        for order in [AxisOrder::Yx, AxisOrder::Xy] {
            for scale in [Scale::Thousand, Scale::Hundred, Scale::Unit, Scale::Pixels { width: 640, height: 480 }] {
                for (avoid, depth) in [(false, DepthAs::Labels), (true, DepthAs::Metres)] {
                    let profile = GroundingProfile { order, scale, ..GroundingProfile::default() };
                    let input = PromptInput { avoid, depth, ..PromptInput::new("go «there»", &memory, &profile) };
                    let read = read(&point_prompt(&input), (640, 480)).unwrap().unwrap();
                    assert_eq!(
                        (read.instruction.as_str(), read.profile, read.kind),
                        ("go \"there\"", profile, QueryKind::Point { avoid, depth })
                    );
                    let Memory { stage, targets, turned, last_seen, .. } = read.memory;
                    assert_eq!((stage, last_seen, turned.to_degrees().round()), (3, Some(Look::Left), -72.0));
                    assert_eq!(targets, ["gate", "left of the gate"]);
                }
            }
        }
        let first = Memory::default();
        let read =
            read(&point_prompt(&PromptInput::new("go", &first, &GroundingProfile::default())), (640, 480)).unwrap().unwrap();
        assert_eq!(read.memory, Memory { stage: 1, ..first });
    }

    #[test]
    fn another_wording_is_an_error_and_no_first_stage() {
        assert_eq!(read("fly on", (640, 480)), Ok(None));
        let memory = remembered();
        let prompt = point_prompt(&PromptInput::new("go", &memory, &GroundingProfile::default()));
        for (was, is) in [
            ("Stage 3 is being worked on.", "Stage 3 was reached."),
            ("Stage 3 is being worked on.", "Stage two is being worked on."),
            ("- depth: ", "- d: "),
            ("- open_way: ", "- way: "),
            ("in thousandths", "in shares"),
            ("°", " degrees"),
        ] {
            let changed = prompt.replace(was, is);
            assert!(changed != prompt && read(&changed, (640, 480)).is_err(), "{was}");
        }
        assert!(read("«go", (640, 480)).is_err());
    }
}
