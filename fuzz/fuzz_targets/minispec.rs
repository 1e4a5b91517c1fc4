//! Any text, in any two pieces: the same program as in one piece, no panic, and a run that ends.
#![no_main]

use libfuzzer_sys::fuzz_target;
use spf_baselines::typefly::minispec::{
    Block, Machine, Precedence, ProgramStream, Progress, Skills, Value, parse_body, parse_program,
};

/// Two skills, one of them written in the language.
struct Few(Block);

impl Skills for Few {
    fn is_skill(&self, name: &str) -> bool {
        matches!(name, "iv" | "s")
    }

    fn body(&self, name: &str) -> Option<Block> {
        (name == "s").then(|| self.0.clone())
    }
}

fuzz_target!(|input: (&str, u16)| {
    let (text, cut) = input;
    let cut = text.floor_char_boundary(usize::from(cut));
    let mut stream = ProgramStream::new(Precedence::Published);
    let mut pieces = stream.push(&text[..cut]);
    pieces.extend(stream.push(&text[cut..]));
    let pieces = stream.finish().map(|rest| {
        pieces.extend(rest);
        pieces
    });
    let whole = parse_program(text, Precedence::Published);
    assert_eq!(pieces, whole);
    let Ok(program) = whole else { return };
    let skills = Few(parse_body("8{?iv,$1{->True;}}->False;").expect("a program"));
    let mut machine = Machine::default();
    machine.extend(program);
    machine.complete();
    // No program has more steps than this.
    for _ in 0..10_001 {
        let Progress::Skill(_) = machine.advance(&skills) else { return };
        machine.resume(Value::None);
    }
    panic!("a program without an end");
});
