use std::collections::BTreeMap;
use std::ffi::OsString;
use std::path::{Path, PathBuf};

use clap::{Arg, CommandFactory, Parser};
use proptest::prelude::*;

use super::Settings;
use super::flag::Form;
use super::setting::{Origin, Row};
use crate::args::{self, Cli, Command};
use crate::error::CliError;

/// The settings of a file.
fn read(text: &str) -> Result<Settings, CliError> {
    let mut settings = Settings::default();
    settings.read_text(Path::new("spf.toml"), text)?;
    Ok(settings)
}

/// Reads every value.
fn check_all(settings: &Settings) -> Vec<CliError> {
    settings.rows().into_iter().filter_map(|row| row.check().err()).collect()
}

/// Applies the arguments of `spf fly` to settings.
fn fly(settings: &mut Settings, flags: &[&str]) {
    let cli = Cli::try_parse_from(["spf", "fly", "x"].iter().chain(flags)).unwrap();
    let Command::Fly(args) = cli.command else { panic!("{flags:?}") };
    args.flight.settings.apply(settings);
}

fn row<'a>(settings: &'a Settings, name: &str) -> &'a dyn Row {
    settings.rows().into_iter().find(|row| row.key().name == name).unwrap()
}

#[test]
fn every_key_has_its_own_name_variable_and_flag() {
    let settings = Settings::default();
    let rows = settings.rows();
    let flag = |row: &dyn Row| row.key().flag.as_ref().map(|flag| flag.name);
    for (index, row) in rows.iter().enumerate() {
        let key = row.key();
        assert!(key.env.starts_with("SPF_") && key.name == format!("{}.{}", key.table, key.field), "{}", key.name);
        for other in &rows[..index] {
            assert!(other.key().name != key.name && other.key().env != key.env, "{}", key.name);
            assert!(flag(*row).is_none() || flag(*other) != flag(*row), "{}", key.name);
        }
    }
}

#[test]
fn every_default_can_be_read() {
    let message: Vec<String> = check_all(&Settings::default()).iter().map(ToString::to_string).collect();
    assert_eq!(message, Vec::<String>::new());
}

#[test]
fn the_meaning_of_a_word_names_every_word() {
    for row in Settings::default().rows() {
        let meaning = row.meaning();
        assert!(!meaning.contains("{}") && row.words().iter().all(|word| meaning.contains(word)), "{meaning}: {:?}", row.words());
    }
}

/// The flags of `spf fly`, with those that every command has.
fn flags_of_fly() -> Vec<Arg> {
    let mut command = Cli::command();
    command.build();
    let flags = command.find_subcommand("fly").unwrap().get_arguments().filter(|arg| arg.get_long().is_some());
    flags.cloned().collect()
}

#[test]
fn spf_fly_has_at_most_60_flags_and_its_short_help_15_of_its_own() {
    let flags = flags_of_fly();
    assert!((40..=60).contains(&flags.len()), "{} flags", flags.len());
    let everywhere = ["help", "verbose"];
    let own = || flags.iter().filter(|flag| !everywhere.contains(&flag.get_long().unwrap()));
    let short = own().filter(|flag| !flag.is_hide_short_help_set()).count();
    assert_eq!(short, 15);
    for flag in own() {
        assert!(flag.get_help_heading().is_some(), "{flag} stands under no heading");
    }
}

#[test]
fn the_help_is_made_from_the_meaning() {
    let help =
        |name: &str| flags_of_fly().iter().find(|flag| flag.get_long() == Some(name)).unwrap().get_help().unwrap().to_string();
    assert_eq!(help("light"), "Light of the scene: day, overcast, dusk or night [default: the scene's]");
    assert_eq!(help("keep"), "The distance to keep from somebody who is followed, metres [default: 2.5]");
    assert_eq!(help("realtime"), "Fly in real time instead of as fast as possible");
    assert_eq!(help("no-vlm-check"), "Do not check the VLM's pointing before a real drone takes off");
}

/// Every command that takes flags of the table.
#[test]
fn a_command_names_only_flags_that_exist() {
    let settings = Settings::default();
    let known: Vec<&str> = settings.rows().iter().filter_map(|row| Some(row.key().flag.as_ref()?.name)).collect();
    for flag in args::taken() {
        assert!(known.contains(&flag), "{flag}");
    }
}

#[test]
fn each_flag_sets_its_own_key_and_no_other() {
    let default = Settings::default();
    for row in default.rows() {
        let Some(flag) = &row.key().flag else { continue };
        let mut settings = Settings::default();
        let (given, text) = match flag.form {
            Form::Switch(sets) => (flag.name.to_owned(), sets),
            Form::Value(_) | Form::Optional(..) => (format!("{}=mine", flag.name), "mine"),
        };
        fly(&mut settings, &[&given]);
        for message in settings.rows() {
            let expected = if message.key().name == row.key().name {
                (text, Origin::Flag(flag.name))
            } else {
                (message.key().default, Origin::Default)
            };
            assert_eq!((message.shown(), message.origin().clone()), expected, "{given}: {}", message.key().name);
        }
    }
}

#[test]
fn every_flag_of_a_flight_is_a_key_s_but_for_the_camera_s_and_four() {
    let settings = Settings::default();
    let known: Vec<&str> = settings.rows().iter().filter_map(|row| Some(row.key().flag.as_ref()?.name)).collect();
    let flags = flags_of_fly();
    let others = flags.iter().filter_map(Arg::get_long).filter(|flag| !known.contains(&format!("--{flag}").as_str()));
    let others: Vec<&str> = others.collect();
    // A camera's address may contain a password, which `spf config show` would print.
    let camera = ["camera", "camera-calibration", "camera-fov", "camera-tilt", "camera-latency", "camera-times"];
    assert_eq!(others, [&["config"], &camera[..], &["events", "json", "anyway", "verbose", "help"]].concat());
}

#[test]
fn flags_go_over_the_environment_over_dotenv_over_the_file_over_defaults() {
    let keys = ["fly.scene", "fly.preset", "fly.think", "fly.seed", "fly.step"];
    let mut settings = read("[fly]\npreset = \"a\"\nthink = \"a\"\nseed = 1\nstep = \"a\"\n").unwrap();
    let dotenv: BTreeMap<String, String> =
        ["SPF_THINK", "SPF_SEED", "SPF_STEP"].map(|name| (name.to_owned(), "b".to_owned())).into();
    let environment = |name: &str| ["SPF_SEED", "SPF_STEP"].contains(&name).then(|| OsString::from("c"));
    settings.take_variables(&dotenv, environment).unwrap();
    fly(&mut settings, &["--step", "d"]);
    let message: Vec<String> =
        keys.map(|name| row(&settings, name)).iter().map(|row| format!("{} ({})", row.shown(), row.origin())).collect();
    assert_eq!(
        message,
        ["city (default)", "a (spf.toml:2)", "b (.env SPF_THINK)", "c (environment SPF_SEED)", "d (--step)"],
        "in rising order"
    );
}

#[test]
fn another_default_applies_only_where_nothing_was_given() {
    let mut settings = Settings::default();
    settings.fly.vlm.default_to("auto");
    assert_eq!((settings.fly.vlm.text(), settings.fly.vlm.origin()), (Some("auto"), &Origin::Default));
    fly(&mut settings, &["--vlm", "oracle"]);
    settings.fly.vlm.default_to("auto");
    assert_eq!(settings.fly.vlm.text(), Some("oracle"));
}

#[test]
fn an_empty_value_leaves_it_to_something_else() {
    let settings = read("[fly]\nseed = \"\"\nscene = \"\"\nvideo = \"\"\nmax_time_s = \"\"\n").unwrap();
    let fly = &settings.fly;
    assert_eq!((fly.seed.get().unwrap(), fly.seed.or_default().unwrap()), (None, 0));
    assert_eq!((fly.scene.text(), fly.scene.text_or_default()), (None, "city"));
    assert_eq!((fly.max_time_s.get().unwrap(), fly.video.is_on().unwrap()), (None, false));
}

#[test]
fn a_wrong_value_is_reported_where_it_is_used_and_nowhere_else() {
    let settings = read("[fly]\nscene = 3\nseed = -1\n").unwrap();
    assert_eq!(settings.fly.scene.get().unwrap().as_deref(), Some("3"));
    let error = settings.fly.seed.get().unwrap_err().to_string();
    assert!(error.starts_with("spf.toml:3: expected a whole number from 0 to 18446744073709551615, found `-1`"), "{error}");
}

#[test]
fn no_file_decides_who_receives_keys_or_images() {
    for (table, key, variable) in [("vlm", "send_key_to", "SPF_SEND_KEY_TO"), ("fly", "live_origin", "SPF_LIVE_ORIGIN")] {
        let error = read(&format!("[{table}]\n{key} = \"evil.example\"\n")).err().unwrap().to_string();
        assert!(error.contains("spf.toml:2") && error.contains("cannot be set in a file"), "{error}");
        assert!(read(&format!("[{table}]\n{key} = \"\"\n")).is_ok());
        let dotenv: BTreeMap<String, String> = [(variable.to_owned(), "evil.example".to_owned())].into();
        let error = Settings::default().take_variables(&dotenv, |_| None).unwrap_err().to_string();
        assert!(error.contains(&format!(".env {variable}")) && error.contains("hint: "), "{error}");
        // The environment is the person's own, and stands above the file.
        let own = |name: &str| (name == variable).then(|| OsString::from("own.example"));
        assert!(Settings::default().take_variables(&dotenv, own).is_ok());
    }
}

#[test]
fn unknown_variables_are_warned_about_once_each() {
    let names = |names: &[&str]| names.iter().map(|name| (*name).to_owned()).collect::<Vec<_>>();
    let warnings = Settings::default().unknown_variables(
        names(&["SPF_THNIK", "SPF_SCEEN", "GEMINI_API_KEY", "SPF_SEED"]),
        names(&["SPF_SCEEN", "SPF_SHARDS", "SPF_ORGANISATION_CHART", "PATH"]),
    );
    assert_eq!(
        warnings,
        [
            "warning: unknown variable `SPF_ORGANISATION_CHART` in the environment is ignored: `spf config show` lists every key",
            "warning: unknown variable `SPF_SCEEN` in the environment is ignored: did you mean `SPF_SCENE`? `spf config show` lists every key",
            "warning: unknown variable `SPF_THNIK` in .env is ignored: did you mean `SPF_THINK`? `spf config show` lists every key",
        ]
    );
}

proptest! {
    #[test]
    fn no_text_panics(text in ".{0,200}", key in "[a-z_.\"\\[\\] ]{0,20}", value in "[-+0-9a-z_.\"'{}\\[\\],]{0,20}") {
        let lines = [text, format!("[fly]\n{key} = {value}\n"), format!("[fly]\nscene = {value}\nseed = {value}\n")];
        for settings in lines.iter().flat_map(|text| read(text)) {
            check_all(&settings);
        }
    }

    #[test]
    fn no_value_panics(value in "(any|\\PC{0,20}|[-+0-9a-z@:,=._]{0,30})") {
        let mut settings = Settings::default();
        for row in settings.rows_mut() {
            row.set(value.clone(), Origin::Default);
        }
        for error in check_all(&settings) {
            prop_assert!(error.to_string().contains("hint: "));
        }
    }

    #[test]
    fn a_value_keeps_its_meaning_and_its_line(text in "[^\\p{Cc}]{0,40}", seed in any::<u64>(), lines in 0usize..5) {
        let quoted = toml::Value::String(text.clone());
        let settings = read(&format!("{}[fly]\nscene = {quoted}\nseed = {seed}\n", "\n".repeat(lines))).unwrap();
        prop_assert_eq!(settings.fly.scene.text().unwrap_or_default(), text);
        prop_assert_eq!(settings.fly.seed.get().unwrap(), Some(seed));
        prop_assert_eq!(settings.fly.seed.origin(), &Origin::File(PathBuf::from("spf.toml"), lines + 3));
    }
}
