//! Wrong usage: exit code 2, the error and its place, one hint, nothing on standard output and no files left behind.

use crate::harness::{Lab, Run};

/// The error message of each command line, and its form.
fn refusals(lab: &Lab, lines: &[&[&str]]) -> String {
    let before = lab.names(".");
    let mut message = String::new();
    for args in lines {
        let run = lab.spf(args);
        let shown: Vec<String> = args
            .iter()
            .map(|arg| if arg.contains(' ') || arg.is_empty() { format!("{arg:?}") } else { (*arg).to_owned() })
            .collect();
        assert_eq!((run.code, run.stdout.as_str()), (Some(2), ""), "{args:?}: {}", run.stderr);
        let hints = ["hint: ", "tip: ", "For more information, try '--help'."].map(|hint| run.stderr.matches(hint).count());
        assert!(hints[0] == 1 || (hints[0] == 0 && hints[1] + hints[2] > 0), "{args:?} has {hints:?} hints: {}", run.stderr);
        assert!(!run.stderr.contains('\u{1b}'), "{args:?}: control codes in {:?}", run.stderr);
        message.push_str(&format!("$ spf {}\n{}\n", shown.join(" "), run.stderr));
    }
    assert_eq!(lab.names("."), before, "something was left behind");
    message
}

#[test]
fn of_flags() {
    let message = refusals(
        &Lab::new(),
        &[
            &["flyy", "x"],
            &["fly"],
            &["fly", "x", "--sceen", "city"],
            &["fly", "x", "--speed", "1"],
            &["fly", "x", "--track"],
            &["fly", "  "],
            &["fly", "x", "--scene", "citty"],
            &["fly", "x", "--scene", "moon"],
            &["fly", "x", "--light", "nigth"],
            &["fly", "x", "--weather", "snow"],
            &["fly", "x", "--start", "1,2"],
            &["fly", "x", "--start", "-1,2,nan,4"],
            &["fly", "x", "--start", "1,2,3,4,95"],
            &["fly", "x", "--drone", "tullo"],
            &["fly", "x", "--drone-model", "telo"],
            &["fly", "x", "--seed", "18446744073709551616"],
            &["fly", "x", "--seed", "-1"],
            &["fly", "x", "--wind", "strong"],
            &["fly", "x", "--camera-effects", "blurr"],
            &["fly", "x", "--camera-effects", "compression=png"],
            &["fly", "x", "--vlm", "orcale"],
            &["fly", "x", "--vlm", "gpt-5"],
            &["fly", "x", "--vlm", "claude"],
            &["fly", "x", "--keep", "3"],
            &["fly", "x", "--vlm", "oracle:prefect"],
            &["fly", "x", "--vlm", "oracle:default@0.5s"],
            &["fly", "x", "--policy", "spfff"],
            &["fly", "x", "--policy", "plain", "--detector", "oracle"],
            &["fly", "x", "--detector", "yolo.pt"],
            &["fly", "x", "--preset", "papper"],
            &["fly", "x", "--step", "fixed:0"],
            &["fly", "x", "--step", "-1"],
            &["fly", "x", "--motion", "both"],
            &["fly", "x", "--think", "stopp"],
            &["fly", "x", "--max-time", "nan"],
            &["fly", "x", "--max-time", "-1"],
            &["fly", "x", "--max-decisions", "1.5"],
            &["fly", "x", "--max-decisions", "0"],
            &["sim", "render", "cty", "-o", "x.png"],
            &["sim", "render", "city", "-o", "x.png", "--pose", "north"],
            &["sim", "render", "city", "-o", "x.png", "--light", "dsk"],
            &["sim", "render", "city", "-o", "x.png", "--weather", "snow"],
            &["sim", "render", "city", "-o", "x.png", "--size", "3x3"],
            &["sim", "render", "city", "-o", "x.png", "--drone-model", "quat"],
            &["sim", "render", "city", "-o", "x.png", "--camera-effects", "lens=fish"],
            &["sim", "render", "city", "-o", "x.png", "--moving", "fast"],
            &["sim", "render", "city", "-o", "nowhere/x.png", "--size", "16x16"],
            &["sim", "render", "city", "-o", "x.png", "--depth", "x.png"],
            &["sim", "render", "city", "-o", "x.png", "--ids", "ids.json"],
            &["sim", "view", "--listen", "nonsense"],
            &["sim", "view", "--scene", "citty"],
            &["sim", "view", "--pose", "1,2,3"],
        ],
    );
    insta::assert_snapshot!(message);
}

// The operating system's messages differ elsewhere.
#[cfg(unix)]
#[test]
fn of_files() {
    let lab = Lab::new();
    for (name, content) in [
        ("no-json.json", "hello"),
        ("empty.json", "{}"),
        ("open.json", r#"{"type": "Polygon", "coordinates": [[[0, 0], [1, 0], [1, 1]]]}"#),
        ("dance.toml", "[[event]]\nat_s = 1\ndo = \"dance\"\n"),
        ("evnt.toml", "[[evnt]]\nat_s = 1\n"),
        ("late.toml", "[[event]]\nat_s = 1\ndo = \"hold\"\n\n[[event]]\nat_s = -2\ndo = \"land\"\n"),
        ("mute.toml", "[[event]]\nat_s = 1\ndo = \"instruction\"\n"),
        ("push.toml", "[[event]]\nat_s = 1\ndo = \"hold\"\nforward_m_s = 1\n"),
        ("scene.toml", "format = 1\nnmae = \"x\"\n"),
        ("errors.toml", "point_noise = \"much\"\n"),
        ("full/mine.txt", ""),
    ] {
        std::fs::create_dir_all(lab.path(name).parent().unwrap()).unwrap();
        lab.write(name, content);
    }
    lab.write("latin1.toml", b"[fly]\nscene = \"caf\xe9\"\n");
    let message = refusals(
        &lab,
        &[
            &["fly", "x", "--geofence", "nowhere.json"],
            &["fly", "x", "--geofence", "no-json.json"],
            &["fly", "x", "--geofence", "empty.json"],
            &["fly", "x", "--geofence", "open.json"],
            &["fly", "x", "--events", "nowhere.toml"],
            &["fly", "x", "--events", "dance.toml"],
            &["fly", "x", "--events", "evnt.toml"],
            &["fly", "x", "--events", "late.toml"],
            &["fly", "x", "--events", "mute.toml"],
            &["fly", "x", "--events", "push.toml"],
            &["fly", "x", "--scene", "scene.toml"],
            &["fly", "x", "--scene", "./nowhere.toml"],
            &["fly", "x", "--vlm", "oracle:./nowhere.toml"],
            &["fly", "x", "--vlm", "oracle:./errors.toml"],
            &["fly", "x", "--detector", "nowhere.onnx"],
            &["fly", "x", "--config", "nowhere.toml"],
            &["fly", "x", "--config", "latin1.toml"],
            &["fly", "crane", "--out", "full"],
            &["fly", "crane", "--out", "scene.toml"],
        ],
    );
    insta::assert_snapshot!(message);
}

#[test]
fn of_the_configuration() {
    let lab = Lab::new();
    for (name, content) in [
        ("key.toml", "# a flight\n[fly]\nseed = 1\nsceen = \"city\"\n"),
        ("table.toml", "[fyl]\nscene = \"city\"\n"),
        ("loose.toml", "scene = \"city\"\n"),
        ("torn.toml", "[fly]\nseed = 1\n[envelope\n"),
        ("list.toml", "[fly]\nscene = [\"city\"]\n"),
        ("value.toml", "[fly]\n\nseed = -3\n"),
        ("word.toml", "[fly]\npreset = \"papre\"\n"),
        ("odd.toml", "[fly]\n\"sc\\nene\" = 1\n"),
        ("inline.toml", "\n\nfly = { sede = 3 }\n"),
        ("no_video.toml", "[fly]\nno_video = true\n"),
        ("limits.toml", "[envelope]\nmin_altitude_m = 50\nmax_altitude_m = 10\n"),
    ] {
        lab.write(name, content);
    }
    let lines: Vec<Vec<String>> =
        lab.names(".").into_iter().map(|name| ["fly", "x", "--config", &name].map(str::to_owned).to_vec()).collect();
    let lines: Vec<Vec<&str>> = lines.iter().map(|line| line.iter().map(String::as_str).collect()).collect();
    let lines: Vec<&[&str]> = lines.iter().map(Vec::as_slice).collect();
    let message = refusals(&lab, &lines);
    insta::assert_snapshot!(message);
}

#[test]
fn of_variables() {
    let lab = Lab::new();
    let refused = |variables: &[(&str, &str)]| {
        let output = lab.command(&["fly", "x"]).envs(variables.iter().copied()).output().unwrap();
        assert_eq!((output.status.code(), output.stdout.len()), (Some(2), 0));
        String::from_utf8(output.stderr).unwrap()
    };
    let mut message = refused(&[("SPF_SEED", "many")]);
    lab.write(".env", "SPF_THINK=never\n");
    message.push_str(&refused(&[]));
    insta::assert_snapshot!(message);
    // The line may contain a key, so it is not shown.
    lab.write(".env", "API_KEY='secret\n");
    let message = refused(&[]);
    assert!(!message.contains("secret"), "{message}");
}

#[test]
fn a_variable_that_nobody_knows_is_warned_about_and_left_alone() {
    let lab = Lab::new();
    lab.write(".env", "SPF_THNIK=stop\n");
    let mut command = lab.command(&["vlm", "list", "--json"]);
    let run = Run::of(&command.envs([("SPF_SEEDS", "1"), ("SPF_SCEEN", "city"), ("SPF_SHARDS", "4")]).output().unwrap());
    assert_eq!((run.code, run.stdout.starts_with('[')), (Some(0), true), "{}", run.stderr);
    insta::assert_snapshot!(run.stderr, @r"
    warning: unknown variable `SPF_SCEEN` in the environment is ignored: did you mean `SPF_SCENE`? `spf config show` lists every key
    warning: unknown variable `SPF_SEEDS` in the environment is ignored: did you mean `SPF_SEED`? `spf config show` lists every key
    warning: unknown variable `SPF_THNIK` in .env is ignored: did you mean `SPF_THINK`? `spf config show` lists every key
    ");
}

#[cfg(unix)]
#[test]
fn a_variable_that_is_no_text_is_refused() {
    use std::os::unix::ffi::OsStrExt;
    let lab = Lab::new();
    let value = std::ffi::OsStr::from_bytes(b"caf\xe9");
    let output = lab.command(&["fly", "x"]).env("SPF_SCENE", value).output().unwrap();
    assert_eq!(output.status.code(), Some(2));
    assert!(String::from_utf8(output.stderr).unwrap().starts_with("error: environment SPF_SCENE: the value is not UTF-8"));
}

#[test]
fn a_start_inside_something_leaves_no_folder() {
    let lab = Lab::new();
    // Half in the south wall of the tall white building.
    let run = lab.spf(&["fly", "crane", "--start", "-24,92,0.5,0", "--out", "mine"]);
    assert_eq!((run.code, run.stdout.as_str()), (Some(2), ""), "{}", run.stderr);
    assert!(run.stderr.contains("is inside `") && run.stderr.contains("hint: use another start"), "{}", run.stderr);
    assert_eq!(lab.names("."), Vec::<String>::new());
}
