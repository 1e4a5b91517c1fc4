//! Help, version and the configuration, as they are printed.

use crate::harness::Lab;

/// Help as printed without a terminal.
fn help(args: &[&str]) -> String {
    let run = Lab::new().spf(args);
    assert_eq!((run.code, run.stderr.as_str()), (Some(0), ""));
    run.stdout
}

#[test]
fn help_of_spf() {
    insta::assert_snapshot!(help(&["--help"]));
}

#[test]
fn help_of_fly() {
    insta::assert_snapshot!(help(&["fly", "--help"]));
}

#[test]
fn short_help_of_fly() {
    insta::assert_snapshot!(help(&["fly", "-h"]));
}

#[test]
fn help_of_camera_test() {
    insta::assert_snapshot!(help(&["camera", "test", "--help"]));
}

#[test]
fn help_of_camera_calibrate() {
    insta::assert_snapshot!(help(&["camera", "calibrate", "--help"]));
}

#[test]
fn help_of_sim_serve() {
    insta::assert_snapshot!(help(&["sim", "serve", "--help"]));
}

#[test]
fn help_of_screen_preview() {
    insta::assert_snapshot!(help(&["screen", "preview", "--help"]));
}

#[test]
fn help_of_screen_calibrate() {
    insta::assert_snapshot!(help(&["screen", "calibrate", "--help"]));
}

#[test]
fn help_of_sim_window() {
    insta::assert_snapshot!(help(&["sim", "window", "--help"]));
}

#[test]
fn help_of_sim_render() {
    insta::assert_snapshot!(help(&["sim", "render", "--help"]));
}

#[test]
fn help_of_sim_scenes() {
    insta::assert_snapshot!(help(&["sim", "scenes", "--help"]));
}

#[test]
fn help_of_sim_view() {
    insta::assert_snapshot!(help(&["sim", "view", "--help"]));
}

#[test]
fn help_of_sim_dataset() {
    insta::assert_snapshot!(help(&["sim", "dataset", "--help"]));
}

#[test]
fn help_of_bench_ask() {
    insta::assert_snapshot!(help(&["bench", "ask", "--help"]));
}

#[test]
fn help_of_bench_run() {
    insta::assert_snapshot!(help(&["bench", "run", "--help"]));
}

#[test]
fn help_of_bench_report() {
    insta::assert_snapshot!(help(&["bench", "report", "--help"]));
}

#[test]
fn help_of_bench_import() {
    insta::assert_snapshot!(help(&["bench", "import", "--help"]));
}

#[test]
fn help_of_track() {
    insta::assert_snapshot!(help(&["track", "--help"]));
}

#[test]
fn version() {
    assert_eq!(help(&["-V"]), concat!("spf ", env!("CARGO_PKG_VERSION"), "\n"));
    let long = help(&["--version"]);
    let lines: Vec<&str> = long.lines().collect();
    assert!(lines[0] == concat!("spf ", env!("CARGO_PKG_VERSION")) && lines[1].starts_with("revision: "), "{long}");
    assert!(lines[2].starts_with("features: ") && lines.len() == 3, "{long}");
}

#[test]
fn without_a_command_the_help_is_shown() {
    let run = Lab::new().spf(&[]);
    assert_eq!((run.code, run.stdout.as_str()), (Some(2), ""));
    assert!(run.stderr.contains("spf fly \"Take off and fly to the red crane\""), "{}", run.stderr);
}

#[test]
fn configuration_with_nothing_said() {
    let run = Lab::new().spf(&["config", "show"]);
    assert_eq!((run.code, run.stderr.as_str()), (Some(0), ""));
    insta::assert_snapshot!(run.stdout);
}

/// The lines of `spf config show` that are not defaults.
fn message(stdout: &str) -> String {
    stdout.lines().filter(|line| line.contains(" = ") && !line.contains("# default;")).map(|line| format!("{line}\n")).collect()
}

#[test]
fn configuration_from_file_dotenv_and_environment() {
    let lab = Lab::new();
    lab.write(
        "spf.toml",
        "# mine\n[fly]\nscene = \"city\"\nseed = 18446744073709551615\npreset = \"paper\"\nmax_time_s = 90.5\n\n[envelope]\nmax_altitude_m = 40\n",
    );
    lab.write(".env", "SPF_PRESET=default\nSPF_MOTION=sequential\nGEMINI_API_KEY=not-ours\n");
    let mut command = lab.command(&["config", "show"]);
    command.env("SPF_MOTION", "blended").env("SPF_OUT", "007").env("SPF_VLM", "oracle:./a \"b\"\n.toml");
    let output = command.output().unwrap();
    let shown = String::from_utf8(output.stdout).unwrap();
    insta::assert_snapshot!(message(&shown));

    // The output is a configuration file with the same meaning.
    let again = Lab::new();
    again.write("spf.toml", &shown);
    let run = again.spf(&["config", "show"]);
    assert_eq!(run.code, Some(0), "{}", run.stderr);
    let values = |text: &str| -> Vec<String> {
        text.lines().map(|line| line.split_once(" # ").map_or(line, |(value, _)| value).trim().to_owned()).collect()
    };
    assert_eq!(values(&run.stdout), values(&shown));
}

#[test]
fn tables_of_every_spelling_name_their_line() {
    let lab = Lab::new();
    lab.write("a.toml", "fly.seed = 7\nenvelope = { max_altitude_m = 0x28 }\n[fly.preset]\n");
    let run = lab.spf(&["config", "show", "--config", "a.toml"]);
    assert_eq!(run.code, Some(2));
    lab.write("b.toml", "fly.seed = 7\n\"fly\".\"scene\" = 'city'\nenvelope = { max_altitude_m = 40 }\n");
    let run = lab.spf(&["config", "show", "--config", "b.toml"]);
    insta::assert_snapshot!(message(&run.stdout), @r#"
    scene = "city"                     # b.toml:2; SPF_SCENE: scene to fly in: a built-in name, scene file or .glb; city@17 is a variant
    seed = 7                           # b.toml:1; SPF_SEED: random seed; the same seed gives the same flight, byte for byte
    max_altitude_m = 40                # b.toml:3; SPF_MAX_ALTITUDE_M: maximum height above take-off, metres; empty: the limit of the scene or of the drone's driver if there is one, else 120
    "#);
}
