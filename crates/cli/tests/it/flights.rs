//! Results of flights: outcomes and exit codes, and that flags reach the pilot.

use serde_json::Value;

use crate::harness::Lab;

#[test]
fn an_absent_target_is_not_found() {
    let (code, summary) = Lab::new().fly("mine", &["fly to the elephant", "--vlm", "oracle:perfect"]);
    assert_eq!((code, summary["outcome"].as_str()), (3, Some("not_found")), "{summary}");
    assert_eq!(summary["targets"].as_array().unwrap().len(), 0);
    assert!(summary["final_distance_m"].is_null());
}

#[test]
fn the_reading_of_the_instruction_is_printed_before_take_off() {
    let lab = Lab::new();
    let brief = ["--max-queries", "1", "--no-video"];
    let run = lab.spf(&[&["fly", "GO TO TEH RED CRAN, then to the elephant", "--out", "mine"][..], &brief].concat());
    assert!(run.stderr.contains("\nreads: fly to → red tower crane"), "{}", run.stderr);
    assert!(
        run.stderr.contains("; then fly to → elephant (not in this scene; the drone will search for it)\n"),
        "{}",
        run.stderr
    );
    assert!(run.stderr.contains("\nspelling: \"teh\" as \"the\", \"cran\" as \"crane\"\n"), "{}", run.stderr);
}

#[test]
fn a_part_that_is_not_read_is_no_success() {
    let lab = Lab::new();
    let words = "Fly to the taxi from above";
    let refused = lab.spf(&["fly", words, "--out", "mine"]);
    assert_eq!(refused.code, Some(2), "{}", refused.stderr);
    assert!(
        refused.stderr.contains("has no use for \"from above\"") && refused.stderr.contains("\"fly to the yellow taxi\""),
        "{}",
        refused.stderr
    );
    let run = lab.spf(&["fly", words, "--anyway", "--vlm", "oracle:perfect", "--no-video", "--out", "mine"]);
    assert!(run.stderr.contains("\nnot understood: \"from above\""), "{}", run.stderr);
    let end = "reached, verified by the oracle's reading of your words: the instruction is fulfilled, except \"from above\", which was not \
               understood\n";
    assert!(run.code == Some(0) && run.stdout.starts_with(end), "{}", run.stdout);
    let summary = std::fs::read_to_string(lab.path("mine/summary.json")).unwrap();
    assert!(summary.replace(char::is_whitespace, "").contains(r#""not_read":["fromabove"]"#), "{summary}");
}

#[test]
fn what_is_ignored_is_said_before_take_off_and_in_the_verdict() {
    let lab = Lab::new();
    let words = "if you see a bus go slowly to the taxi at dusk";
    let run = lab.spf(&["fly", words, "--anyway", "--vlm", "oracle:perfect", "--no-video", "--out", "mine"]);
    let parts = "\"if you see a bus\", \"at dusk\"";
    assert!(run.stderr.contains("\nlimit: \"slowly\": at most 1.5 m/s\n"), "{}", run.stderr);
    assert!(run.stderr.contains("\nreads: fly to → yellow taxi\n"), "{}", run.stderr);
    assert!(run.stderr.contains(&format!("\nnot understood: {parts}")), "{}", run.stderr);
    assert!(run.code == Some(0) && run.stdout.contains(&format!("except {parts}, which were not understood")), "{}", run.stdout);
}

#[test]
fn another_language_is_refused_before_take_off() {
    let lab = Lab::new();
    for words in ["geh zum roten Auto", "va a la iglesia", "vole vers la voiture rouge"] {
        let run = lab.spf(&["fly", words, "--out", "mine"]);
        assert!(run.code == Some(2) && run.stderr.starts_with("error: the oracle reads English only, "), "{}", run.stderr);
        assert!(run.stderr.contains("--vlm gemini"), "{}", run.stderr);
    }
    assert!(lab.names(".").is_empty(), "nothing is left behind");
}

#[test]
fn how_long_somebody_was_followed_is_said() {
    let lab = Lab::new();
    let args =
        ["fly", "follow the person in orange", "--scene", "park", "--vlm", "oracle:perfect", "--max-time", "60", "--no-video"];
    let run = lab.spf(&[&args[..], &["--out", "mine"]].concat());
    assert!(run.code == Some(3) && run.stdout.contains("\nfollowed: "), "{}", run.stdout);
    let summary: Value = serde_json::from_slice(&lab.read("mine/summary.json")).unwrap();
    assert_eq!((&summary["followed"]["within_m"], &summary["verified"]), (&10.0.into(), &Value::Null), "{summary}");
}

#[test]
fn words_that_name_nothing_fly_nothing() {
    let lab = Lab::new();
    for (words, message) in [
        ("fly to the qwertzuiop", "error: the oracle cannot parse \"fly to the qwertzuiop\": unknown word `qwertzuiop`\n"),
        ("hello", "error: the oracle cannot parse \"hello\": "),
        ("!!!", "error: the oracle cannot parse \"!!!\": it names no object to fly to\n"),
    ] {
        let run = lab.spf(&["fly", words, "--out", "mine"]);
        assert!(run.code == Some(2) && run.stderr.starts_with(message), "{}", run.stderr);
        assert!(run.stderr.contains("objects in city include: "), "{}", run.stderr);
    }
    assert!(lab.names(".").is_empty(), "nothing is left behind");
}

#[test]
fn spent_decisions_are_a_timeout() {
    let (code, summary) = Lab::new().fly("mine", &["fly to the red crane", "--preset", "paper", "--max-decisions", "1"]);
    assert_eq!((code, summary["outcome"].as_str(), summary["decisions"].as_u64()), (3, Some("timeout"), Some(1)), "{summary}");
}

#[test]
fn spent_queries_are_a_timeout_and_second_looks_count() {
    let lab = Lab::new();
    let flight = ["fly", "fly to the red crane", "--max-queries", "5", "--no-video", "--out", "mine"];
    let run = lab.spf(&flight);
    assert!(run.code == Some(3) && run.stdout.starts_with("timeout: the limit of 5 queries was reached\n"), "{}", run.stdout);
    assert!(run.stderr.contains("hint: `--max-queries 15` permits more queries"), "{}", run.stderr);
    assert_eq!(lab.decisions("mine").len(), 5);
}

#[test]
fn a_target_beyond_a_limit_ends_the_flight_soon_and_names_the_limit() {
    let lab = Lab::new();
    let flight = ["fly", "fly to the red crane", "--vlm", "oracle:perfect", "--max-distance", "8", "--no-video", "--out", "mine"];
    let run = lab.spf(&flight);
    let end = "aborted: the maximum distance of 8 m from the take-off point refused the motion of 3 answers in a row\n";
    assert!(run.code == Some(5) && run.stdout.starts_with(end), "{}{}", run.stdout, run.stderr);
    assert!(run.stderr.contains("hint: if it is safe to fly farther, `--max-distance M` sets"), "{}", run.stderr);
    assert!(lab.decisions("mine").len() <= 25, "{}", run.stdout);
}

#[cfg(unix)]
#[test]
fn a_low_ceiling_ends_the_flight_soon_and_is_named() {
    let lab = Lab::new();
    let up = r#""text":"{\"actions\":[{\"cmd\":\"up\",\"value\":3}],\"done\":false}"}"#;
    let program = format!("while read -r line; do id=${{line#*'\"id\":'}}; echo '{{\"id\":'${{id%%,*}}',{up}'; done\n");
    lab.write("up.sh", program);
    let vlm = format!("exec:sh '{}'", lab.path("up.sh").display());
    let flight = ["fly up", "--policy", "plain", "--vlm", &vlm, "--max-altitude", "7"];
    let (code, summary) = lab.fly("mine", &flight);
    assert_eq!((code, &summary["outcome"]), (5, &"aborted".into()), "{summary}");
    assert_eq!(summary["cause"], "the maximum height of 7 m refused the motion of 3 answers in a row");
    assert!(summary["decisions"].as_u64() <= Some(8), "{summary}");
}

#[test]
fn a_flight_that_ends_at_its_target_without_a_done_says_so() {
    let lab = Lab::new();
    let fly = |name: &str, more: &[&str]| {
        let args = [&["fly", "fly to the red crane", "--vlm", "oracle:perfect", "--no-video", "--out", name], more].concat();
        let run = lab.spf(&args);
        (run.code, run.stdout, serde_json::from_slice::<Value>(&lab.read(&format!("{name}/summary.json"))).unwrap())
    };
    let (code, _, whole) = fly("whole", &[]);
    assert_eq!((code, &whole["outcome"]), (Some(0), &"reached".into()), "{whole}");
    // A moment before the second look, and one before the first.
    for (before, done) in [(0.5, "the VLM said done, but did not confirm it"), (2.0, "the VLM never said done")] {
        let time = (whole["finished_at_s"].as_f64().unwrap() - before).to_string();
        let (code, printed, summary) = fly(done, &["--max-time", &time]);
        assert_eq!((code, &summary["outcome"], &summary["verified"]), (Some(3), &"timeout".into(), &true.into()), "{summary}");
        let cause = format!("the flight time limit of {time} s was reached; the craft was at its target, and {done}");
        assert_eq!(summary["cause"], cause);
        assert!(printed.starts_with(&format!("timeout: {cause}\n")), "{printed}");
    }
}

#[test]
fn what_is_touched_is_a_collision() {
    // Steps of 30 m from between two buildings, the next wall 12 m ahead and the target behind it.
    let args = [
        "fly to the tall white building",
        "--start",
        "-24,60,0,0",
        "--step",
        "fixed:30",
        "--think",
        "stop",
        "--vlm",
        "oracle:perfect",
    ];
    let (code, summary) = Lab::new().fly("mine", &args);
    assert_eq!((code, summary["outcome"].as_str()), (4, Some("collision")), "{summary}");
    assert_eq!((&summary["verified"], summary["collisions"].as_u64()), (&Value::Bool(false), Some(1)));
    assert_eq!(summary["verified_by"], "parser");
    // The message names the object: the wall between.
    let touched = summary["touched"].as_array().unwrap();
    assert_eq!(touched.len(), 1, "{summary}");
    assert!(!touched[0]["object"].as_str().unwrap().is_empty(), "{summary}");
    assert!(touched[0]["at_s"].as_f64().unwrap() <= summary["finished_at_s"].as_f64().unwrap(), "{summary}");
}

#[test]
fn a_geofence_is_never_left() {
    let lab = Lab::new();
    let ring = "[[-6, -6], [8, -6], [8, 8], [-6, 8], [-6, -6]]";
    lab.write("fence.json", format!("{{\"type\": \"Polygon\", \"coordinates\": [{ring}]}}"));
    let (code, summary) = lab.fly("mine", &["fly to the red crane", "--geofence", "fence.json", "--max-time", "45"]);
    assert!([(3, "timeout"), (5, "aborted")].contains(&(code, summary["outcome"].as_str().unwrap())), "{summary}");
    assert!(summary["path_length_m"].as_f64().unwrap() > 8.0, "it flew: {summary}");
    for decision in lab.decisions("mine") {
        for pose in [&decision["pose"], &decision["pose_at_reply"]] {
            let at = |axis: &str| pose["position"][axis].as_f64().unwrap();
            // The estimate drifts by the noise of the sensors.
            assert!((-7.0..=9.0).contains(&at("east")) && (-7.0..=9.0).contains(&at("north")), "{pose}");
        }
    }
    // 68 m from the start to the crane; the fence ends 8 m along the path.
    assert!(summary["final_distance_m"].as_f64().unwrap() > 55.0, "{summary}");
}

#[test]
fn light_and_weather_are_flown_in_and_recorded() {
    let lab = Lab::new();
    let flown = |name: &str, more: &[&str]| {
        let args = [&["fly to the red crane", "--max-queries", "1"], more].concat();
        let (_, summary) = lab.fly(name, &args);
        ["light", "weather"].map(|key| summary[key].as_str().unwrap().to_owned())
    };
    assert_eq!(flown("own", &[]), ["day", "clear"]);
    assert_eq!(flown("asked", &["--light", "dusk", "--weather", "rain"]), ["dusk", "rain"]);
}

#[test]
fn twice_verbose_it_says_until_when_it_waits_and_why() {
    let run = Lab::new().spf(&["fly", "fly to the red crane", "--max-queries", "1", "--no-video", "--out", "mine", "-vv"]);
    assert!(run.stderr.contains("waits at most until the next setpoint"), "{}", run.stderr);
}

#[test]
fn a_tello_flies_in_the_city() {
    let (code, summary) = Lab::new().fly("mine", &["fly to the red crane", "--drone-model", "tello", "--max-time", "30"]);
    assert_eq!(
        (code, summary["outcome"].as_str(), summary["drone_model"].as_str()),
        (3, Some("timeout"), Some("tello")),
        "{summary}"
    );
    assert!(summary["path_length_m"].as_f64().unwrap() > 5.0, "{summary}");
}

#[test]
fn flags_reach_the_pilot() {
    let fly = |args: &[&str]| {
        let mut all = vec!["fly to the red crane", "--max-time", "12"];
        all.extend(args);
        let lab = Lab::new();
        lab.write("spf.toml", "[fly]\nrate_hz = 20\n");
        let (code, summary) = lab.fly("mine", &all);
        assert_eq!(code, 3, "{summary}");
        (summary, lab.decisions("mine"))
    };
    let (summary, _) = fly(&["--preset", "paper", "--vlm", "oracle:poor", "--start", "5,-3,0,20"]);
    let settings = &summary["settings"];
    assert_eq!((&summary["preset"], &summary["vlm"]), (&Value::from("paper"), &Value::from("oracle:poor")));
    assert_eq!([&settings["motion"], &settings["think"], &settings["lifting"]], ["sequential", "stop", "paper"]);

    let flags = ["--motion", "sequential", "--think", "stop", "--step", "fixed:2.5", "--avoid", "--max-decisions", "7"];
    let (summary, decisions) = fly(&flags);
    let settings = &summary["settings"];
    assert_eq!([&settings["motion"], &settings["think"]], ["sequential", "stop"]);
    assert_eq!(settings["step"]["fixed"], 2.5);
    assert_eq!((settings["rate_hz"].as_f64(), settings["max_decisions"].as_u64()), (Some(20.0), Some(7)));
    assert_eq!(settings["avoid"], true);
    assert_eq!(decisions[0]["query"]["avoid"], true);

    let (summary, decisions) = fly(&["--policy", "plain"]);
    assert_eq!(summary["policy"], "plain");
    assert!(!decisions[0]["reading"]["actions"].as_array().unwrap().is_empty());
}

#[test]
fn a_detectors_boxes_are_those_of_each_reply() {
    let lab = Lab::new();
    let args = ["fly to the red crane", "--detector", "oracle:perfect", "--vlm", "oracle:perfect", "--max-queries", "4"];
    let (_, summary) = lab.fly("mine", &args);
    assert_eq!([&summary["detector"], &summary["policy"]], ["oracle:perfect", "spf"]);
    assert_eq!((&summary["settings"]["avoid"], summary["decisions"].as_u64()), (&Value::from(true), Some(4)));
    let decisions = lab.decisions("mine");
    for decision in &decisions {
        assert_eq!((&decision["query"]["kind"], &decision["query"]["avoid"]), (&Value::from("point"), &Value::from(true)));
    }
    // Of COCO's classes, of which the oracle itself uses other names.
    let boxes = decisions[0]["reading"]["reply"]["boxes"].as_array().unwrap();
    assert!(boxes.iter().any(|found| found["name"] == "car"), "{boxes:?}");
}

#[test]
fn the_configuration_reaches_the_pilot() {
    let lab = Lab::new();
    lab.write("spf.toml", "[fly]\nseed = 9\nmax_time_s = 4\nvideo = false\npreset = \"paper\"\n");
    lab.write(".env", "SPF_SEED=10\nSPF_OUT=dotenv\n");
    let output = lab.command(&["fly", "fly to the red crane", "--json", "--seed", "11"]).env("SPF_OUT", "mine").output().unwrap();
    let summary: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(
        (summary["seed"].as_u64(), summary["out_dir"].as_str(), summary["preset"].as_str()),
        (Some(11), Some("mine"), Some("paper"))
    );
    assert_eq!(summary["finished_at_s"], 4.0);
    assert_eq!(lab.names("mine"), ["decisions.jsonl", "flight.mcap", "queries.jsonl", "summary.json", "trajectory.svg"]);
}

/// A craft that reckons its position from its take-off point flies in the map of the scene, wherever that point is.
#[test]
fn the_estimated_path_begins_where_the_true_one_does() {
    let lab = Lab::new();
    lab.fly("mine", &["fly to the door", "--scene", "office", "--max-queries", "1"]);
    let map = std::fs::read_to_string(lab.path("mine/trajectory.svg")).unwrap();
    let begins = |width: &str| -> Vec<f64> {
        let line = map.lines().find(|line| line.starts_with("<polyline") && line.contains(width)).unwrap();
        let first = line.split('"').nth(1).unwrap().split(' ').next().unwrap();
        first.split(',').map(|at| at.parse().unwrap()).collect()
    };
    let (known, flown) = (begins(r#"stroke-width="1.8""#), begins(r#"stroke-width="6""#));
    assert!((known[0] - flown[0]).hypot(known[1] - flown[1]) < 3.0, "pixels: {known:?} {flown:?}");
}

/// What guides between two answers is on with a depth sensor, unless it is switched off or the preset cannot use it.
#[test]
fn a_depth_sensor_turns_on_what_it_is_for() {
    let settings = |flags: &[&str]| {
        let args = [&["fly to the red crane", "--max-queries", "1"][..], flags].concat();
        Lab::new().fly("mine", &args).1["settings"].clone()
    };
    let sensed = settings(&["--depth-sensor", "on"]);
    assert_eq!((&sensed["method"], &sensed["avoid"]), (&serde_json::json!({ "depth": "view" }), &false.into()));
    assert_eq!(settings(&["--depth-sensor", "on", "--preset", "paper"])["method"], "paper");
}

/// Without a depth sensor the VLM is asked for boxes; not of a person or a program, which may know nothing of them.
#[test]
fn boxes_and_an_anchor_are_on_by_default() {
    let lab = Lab::new();
    let model = |boxes: &str| {
        format!(
            "import json, sys\nfor line in sys.stdin:\n    query = json.loads(line)\n    said = {boxes} if query['kind'] == 'declare' else \
             {{'status': 'done', 'boxes': []}}\n    print(json.dumps({{'id': query['id'], **said}}), flush=True)\n"
        )
    };
    lab.write("model.py", model("{'boxes': False}"));
    lab.write("lists.py", model("{'error': 'what is that?'}"));
    let parts = |flags: &[&str]| {
        let args = [&["fly to the red crane", "--max-queries", "1"][..], flags].concat();
        let folder = format!("mine{}", flags.concat().replace([' ', ':'], "-"));
        let settings = lab.fly(&folder, &args).1["settings"].clone();
        (settings["avoid"] == true, settings["method"].as_str().unwrap_or_default().to_owned())
    };
    assert_eq!(parts(&[]), (true, "boxes".to_owned()));
    assert_eq!(parts(&["--avoid"]), (true, "boxes".to_owned()));
    // A program lists boxes, as models do, unless it declares before take-off that it does not.
    assert_eq!(parts(&["--vlm", "exec:python3 lists.py"]), (true, "boxes".to_owned()));
    for off in [&["--avoid=off"][..], &["--preset", "paper"], &["--policy", "plain"], &["--vlm", "exec:python3 model.py"]] {
        assert_eq!(parts(off), (false, "paper".to_owned()), "{off:?}");
    }
}
