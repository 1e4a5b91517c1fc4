//! Any text, split anywhere: no panic, nothing out of range, the same reply whole and in chunks, and a parsed reply can
//! be written again. And as a text that a model copies into its target, escaped or not: it changes nothing but the target.
#![no_main]

use libfuzzer_sys::fuzz_target;
use spf_core::grounding::{AxisOrder, GroundingProfile, Habit, Scale};
use spf_core::reply::{DEPTH_LABELS, Reply, ReplyStream, Status, parse_reply};

fuzz_target!(|data: &[u8]| {
    let Some((&choice, rest)) = data.split_first() else { return };
    let text = String::from_utf8_lossy(rest);
    let scale =
        [Scale::Thousand, Scale::Hundred, Scale::Unit, Scale::Pixels { width: 960, height: 720 }][usize::from(choice & 3)];
    let order = if choice & 4 == 0 { AxisOrder::Yx } else { AxisOrder::Xy };
    let habit = [Habit::Asked, Habit::Asked, Habit::List, Habit::Tags][usize::from(choice >> 6)];
    let profile = GroundingProfile { order, scale, habit };

    let avoid = choice & 8 != 0;
    let whole = parse_reply(&text, &profile, avoid);
    let size = usize::from(choice >> 3) + 1;
    let mut stream = ReplyStream::new(profile, avoid);
    let letters: Vec<char> = text.chars().collect();
    for chunk in letters.chunks(size) {
        let before = stream.early().is_some();
        stream.push(&chunk.iter().collect::<String>());
        // What comes early is the reply of the text so far, or the first of several in it; more text can make it a draft, or refuse
        // it.
        if let (false, Some(early)) = (before, stream.early())
            && let Ok(so_far) = parse_reply(stream.text(), &profile, avoid)
        {
            assert_eq!(so_far.status, early.status);
        }
    }
    assert_eq!(stream.finish(), whole);
    if let Ok(reply) = whole {
        check(&reply, habit);
        // Written and parsed again it is the same except for the rounding of coordinates, which may turn a point near
        // the corner into one that looks like fractions.
        if let Ok(again) = parse_reply(&reply.to_json(&profile, true), &profile, avoid) {
            assert_eq!((again.status, again.look, again.stage), (reply.status, reply.look, reply.stage));
            // Metres are written to tenths, which may be another label.
            assert!(reply.range_m.is_some() || again.depth == reply.depth);
            assert_eq!(again.target, reply.target);
        } else {
            assert!(matches!(scale, Scale::Hundred));
        }
    }
    check_copied(&text, choice);
});

/// Replies in every form of quotes.
const HONEST: [&str; 4] = [
    r#"{"target":"TARGET","status":"navigating","stage":2,"target_box":null,"point":[250,750],"depth":6,"turn_deg":null,"look":null,"open_way":null,"boxes":[{"box":[100,200,300,400],"depth":3,"name":"a tree"}]}"#,
    r#"{"target":"TARGET","status":"not_visible","stage":null,"target_box":null,"point":null,"depth":null,"turn_deg":null,"look":"left","open_way":{"point":[500,500],"depth":4},"boxes":[]}"#,
    r#"{“target”:“TARGET”,“status”:“navigating”,“stage”:null,“target_box”:null,“point”:null,“depth”:null,“turn_deg”:20,“look”:null,“open_way”:null,“boxes”:[]}"#,
    r#"[{'target':'TARGET','status':'blocked','stage':null,'target_box':null,'point':null,'depth':null,'turn_deg':null,'look':null,'open_way':null,'boxes':[{'box':[1,2,3,4],'depth':1,'name':'x'}]}]"#,
];

/// What a sign in the image says may get out of its string, but into no other field.
fn check_copied(text: &str, choice: u8) {
    let (profile, written) = (GroundingProfile::default(), HONEST[usize::from(choice & 3)]);
    let honest = parse_reply(written, &profile, true).unwrap();
    if let Ok(reply) = parse_reply(&written.replace("TARGET", text), &profile, true) {
        // Of two distances the nearer counts.
        assert!(reply.label() <= honest.label());
        let apart = Reply { target: None, depth: None, range_m: None, ..reply };
        assert_eq!(apart, Reply { target: None, depth: None, ..honest });
    }
}

fn check(reply: &Reply, habit: Habit) {
    let fraction = |x: f64| (0.0..=1.0).contains(&x);
    assert!(reply.point.is_none_or(|p| fraction(p.u) && fraction(p.v)));
    assert!(reply.depth.is_none_or(|d| (1..=DEPTH_LABELS).contains(&d)));
    assert!(!reply.status.leads_to_a_point() || reply.turn_deg.is_some() != reply.point.is_some());
    assert!(reply.point.is_some() == reply.depth.is_some() || (habit != Habit::Asked && reply.depth.is_none()));
    assert!(reply.turn_deg.is_none_or(|degrees| (-180.0..=180.0).contains(&degrees)));
    assert!(reply.look.is_none() && reply.open_way.is_none() || reply.status == Status::NotVisible);
    for b in &reply.boxes {
        let area = b.area;
        assert!([area.left, area.top, area.right, area.bottom].into_iter().all(fraction));
        assert!(area.left <= area.right && area.top <= area.bottom && (1..=DEPTH_LABELS).contains(&b.depth));
    }
}
