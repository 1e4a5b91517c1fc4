use std::collections::BTreeMap;

use proptest::prelude::*;

use super::*;

fn program(text: &str) -> Vec<Statement> {
    parse_program(text, Precedence::Published).unwrap_or_else(|error| panic!("{text}: {error}"))
}

fn refused(text: &str) -> String {
    parse_program(text, Precedence::Published).unwrap_err().to_string()
}

/// Skills of these tests: `say` takes anything, `double` and `forever` are written in the language.
struct Words(BTreeMap<&'static str, Option<Block>>);

impl Words {
    fn new() -> Self {
        let body = |text: &str| Some(parse_body(text).unwrap());
        Self(BTreeMap::from([
            ("say", None),
            ("see", None),
            ("twice", body("2{say,$1;}->$1;")),
            ("own", body("_1=5;->_1;")),
            ("forever", body("forever,$1;")),
            ("second", body("->$2;")),
        ]))
    }
}

impl Skills for Words {
    fn is_skill(&self, name: &str) -> bool {
        self.0.contains_key(name)
    }

    fn body(&self, name: &str) -> Option<Block> {
        self.0[name].clone()
    }
}

/// Runs a program; `see` returns each of the given values in turn, `say` its argument. Returns the calls, and the
/// result.
fn run(text: &str, sights: &[Value]) -> (Vec<String>, Progress) {
    let mut machine = Machine::default();
    machine.extend(program(text));
    machine.complete();
    let (mut calls, mut sights) = (Vec::new(), sights.iter().cloned());
    for _ in 0..20_000 {
        match machine.advance(&Words::new()) {
            Progress::Skill(call) => {
                let told: Vec<String> = call.arguments.iter().map(ToString::to_string).collect();
                calls.push(format!("{} {}", call.name, told.join(" ")));
                let message = call.arguments.first().cloned().unwrap_or(Value::None);
                machine.resume(if call.name == "see" { sights.next().unwrap_or(Value::None) } else { message });
            }
            end => return (calls, end),
        }
    }
    panic!("never ends: {text}");
}

fn result(text: &str) -> Progress {
    run(text, &[]).1
}

fn finished(value: Value) -> Progress {
    Progress::Finished(value)
}

#[test]
fn both_ways_of_calling_are_read_alike() {
    assert_eq!(program("mf,100;tc,-90;"), program("mf(100) tc( -90 );"));
    assert_eq!(program("_1=iv,red car;?_1==True{->True;};"), program("_1=iv('red car');\n?_1==True{->True}"));
    assert_eq!(program("?iv,chair{mf,1}"), program("?iv(chair)==True{mf(1);}"));
    assert_eq!(program("```minispec\nmf,1;\n```\n"), program("mf,1"));
    assert_eq!(program("`mf,1;`"), program("mf,1;"));
    let Statement::Call(call) = &program("say,'a, {b};',-2,.5,_3,True,None;")[0] else { panic!() };
    let values = [Value::Text("a, {b};".to_owned()), Value::Int(-2), Value::Float(0.5)].map(Operand::Value);
    assert_eq!(call.arguments[..3], values);
    let rest = [Operand::Variable(3), Operand::Value(Value::Bool(true)), Operand::Value(Value::None)];
    assert_eq!(call.arguments[3..], rest);
}

#[test]
fn errors_state_where() {
    assert_eq!(refused("mf,100;\n 8tc,45;"), "line 2, column 3: expected `{`, found `t`");
    assert_eq!(refused("mf,;"), "line 1, column 4: expected a value, found `;`");
    assert_eq!(refused("8{tc,45;"), "line 1, column 9: expected `}`, found the end");
    assert_eq!(refused("_1;"), "line 1, column 1: a variable alone is not a statement; `_1=…` assigns it");
    assert_eq!(refused("mf,$1;"), "line 1, column 4: `$` is only valid in the body of a skill, and counts from 1");
    assert_eq!(refused("say,'chair;"), "line 1, column 5: the quote is not closed");
    assert_eq!(refused("}"), "line 1, column 1: expected a statement, found `}`");
    assert_eq!(refused("99999999999{}"), "line 1, column 1: `99999999999` is not a number up to 4294967295");
    assert!(refused(&"2{".repeat(17)).contains("nested more than 16 deep"));
    assert!(refused(&"mf,1;".repeat(4000)).contains("longer than 16384 bytes"));
}

#[test]
fn statements_before_an_error_are_given() {
    let mut stream = ProgramStream::new(Precedence::Published);
    assert_eq!(stream.push("mf,100;mf"), program("mf,100;"));
    assert_eq!(stream.push("(;tc,90;"), []);
    assert!(stream.finish().is_err() && stream.error().is_some());
}

#[test]
fn a_statement_is_there_as_soon_as_its_end_is() {
    let mut stream = ProgramStream::new(Precedence::Published);
    let given: Vec<usize> = "mf,1;?iv(a)>0{mf(2);}tc(3)".chars().map(|c| stream.push(&c.to_string()).len()).collect();
    let ends: Vec<usize> = (0..given.len()).filter(|&i| given[i] > 0).collect();
    assert_eq!(ends, [4, 20, 25]);
    assert_eq!(stream.finish(), Ok(Vec::new()));
}

#[test]
fn programs_run_as_written() {
    let (calls, end) = run("3{say,1;}_1=say,7;?_1>6&_1<8{say,big;}?_1!=7{say,never;}->_1;say,after;", &[]);
    assert_eq!(calls, ["say 1", "say 1", "say 1", "say 7", "say 'big'"]);
    assert_eq!(end, finished(Value::Int(7)));
    assert_eq!(result(""), finished(Value::None));
    // A return inside blocks ends everything.
    assert_eq!(run("9{9{say,1;->False;}}", &[]), (vec!["say 1".to_owned()], finished(Value::Bool(false))));
    assert_eq!(result("_1=red;->_1;"), finished(Value::Text("red".to_owned())));
    let (calls, _) = run("12{}12{say,a;}", &[]);
    assert_eq!(calls.len(), 12, "counts of several digits");
}

#[test]
fn skills_have_variables_of_their_own() {
    assert_eq!(run("_1=2;_2=own;_3=twice,_1;->_1;", &[]), (vec!["say 2".to_owned(); 2], finished(Value::Int(2))));
    assert_eq!(result("_1=own;->_1;"), finished(Value::Int(5)));
    assert_eq!(result("second,1;"), Progress::Stopped(RuntimeError::NoArgument(2)));
    assert_eq!(result("forever,1;"), Progress::Stopped(RuntimeError::TooDeep));
}

#[test]
fn conditions_call_before_they_compare() {
    let (seen, not) = (Value::Bool(true), Value::Bool(false));
    let message = |text: &str, sights: &[Value]| run(text, sights).0.iter().any(|call| call == "say 1");
    assert!(message("?see,a{say,1;}", core::slice::from_ref(&seen)));
    assert!(!message("?see(a){say,1;}", core::slice::from_ref(&not)));
    // (a|b)&c, and with ordinary precedence a|(b&c).
    assert!(!message("?see(a)|see(b)&see(c){say,1;}", &[seen.clone(), seen.clone(), not.clone()]));
    let ordinary = parse_program("?see(a)|see(b)&see(c){say,1;}", Precedence::Ordinary).unwrap();
    let Statement::If { condition, .. } = &ordinary[0] else { panic!() };
    assert_eq!((condition.all_groups, condition.groups.len(), condition.groups[1].len()), (false, 2, 2));
}

#[test]
fn values_compare_by_type() {
    let compare = |text: &str| match result(&format!("?{text}{{->True;}}->False;")) {
        Progress::Finished(Value::Bool(holds)) => Ok(holds),
        other => Err(other),
    };
    for (text, holds) in [("1==1.0", true), ("1==True", false), ("1!='1'", true), ("2>1.5", true), ("a<b", true), ("2>=2", true)]
    {
        assert_eq!(compare(text), Ok(holds), "{text}");
    }
    assert!(matches!(compare("None>0.5"), Err(Progress::Stopped(RuntimeError::Type(_)))));
    assert_eq!(result("->_4;"), Progress::Stopped(RuntimeError::Unset(4)));
    assert_eq!(result("fly,3;"), Progress::Stopped(RuntimeError::UnknownSkill("fly".to_owned())));
}

#[test]
fn endless_programs_end() {
    assert_eq!(result("4000000000{_1=1;}"), Progress::Stopped(RuntimeError::TooManySteps));
    assert_eq!(result("4000000000{4000000000{}}"), Progress::Stopped(RuntimeError::TooManySteps));
    assert_eq!(result("4000000000{say,1;}"), Progress::Stopped(RuntimeError::TooManySteps));
}

#[test]
fn the_calls_of_the_program_are_reported() {
    let mut machine = Machine::default();
    machine.extend(program("twice,3;say,'x';"));
    machine.complete();
    while let Progress::Skill(_) = machine.advance(&Words::new()) {
        machine.resume(Value::Bool(false));
    }
    assert_eq!(machine.trace(), ["twice(3) = 3", "say('x') = False"]);
}

/// Texts that resemble programs.
fn program_like() -> impl Strategy<Value = String> {
    "(mf,1|tc|;|\\{|\\}|\\(|\\)|\\?|_1|=|==|->|\\$1|True|'|\"|&|\\||3|,|>|`|\n|é| |\\?_1>2\\{mf,3;\\}|8\\{tc,45;\\}|_2=iv,a b;){0,25}"
}

proptest! {
    #[test]
    fn any_split_reads_the_same(text in program_like(), cuts in proptest::collection::vec(any::<prop::sample::Index>(), 0..6)) {
        let mut whole = ProgramStream::new(Precedence::Published);
        let mut expected = whole.push(&text);
        let end = whole.finish().map(|rest| expected.extend(rest));
        let ends: Vec<usize> = text.char_indices().map(|(at, _)| at).chain([text.len()]).collect();
        let mut at: Vec<usize> = cuts.iter().map(|cut| ends[cut.index(ends.len())]).collect();
        at.push(text.len());
        at.sort_unstable();
        let (mut stream, mut found, mut from) = (ProgramStream::new(Precedence::Published), Vec::new(), 0);
        for until in at {
            found.extend(stream.push(&text[from..until]));
            from = until;
        }
        let finished = stream.finish().map(|rest| found.extend(rest));
        prop_assert_eq!(found, expected);
        prop_assert_eq!(finished, end);
    }

    #[test]
    fn whatever_is_read_ends(text in program_like()) {
        if parse_program(&text, Precedence::Published).is_ok() {
            let _ = run(&text, &[]);
        }
    }

    #[test]
    fn any_text_is_read_without_panic(text in any::<String>()) {
        let _ = parse_program(&text, Precedence::Ordinary);
        let _ = parse_body(&text);
    }
}
