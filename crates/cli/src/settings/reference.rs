//! Generates `docs/reference/configuration.md` from the declaration of the keys.

use std::fmt::Write;
use std::path::Path;

use super::Settings;
use super::flag::Form;
use super::setting::Row;

/// The text above the tables.
const HEAD: &str = "\
# Configuration

<!-- Written from crates/cli/src/settings/keys.rs by
`INSTA_UPDATE=always cargo test -p spf reference`; a test checks that it is up to date. -->

The value of a key comes from one of four places. In rising order of precedence they are the
default, the configuration file (`./spf.toml`, or the file given with `--config FILE`), an
environment variable and a flag. Variables can also be set in `./.env`; the environment overrides
that file. `spf config show` prints every value in force with its source, in the form of a
configuration file. Neither the configuration file nor `.env` can set `live_origin` or
`send_key_to`, which decide who receives images and API keys
([security](../explanation/security.md)).

The configuration file is TOML: each table below is a `[table]`, and a value is a string, a number,
`true` or `false`. An unknown key is an error; the message names its line. An unknown variable that
begins with `SPF_` causes only a warning, because other programs use that prefix too. `SPF_SHARDS`
is not a setting but a variable of `spf bench` ([cluster](../guide/cluster.md)). What is rarely
changed has no flag: give its key or its variable.

In the column *meaning*, the text after \"empty:\" says what an empty value (`\"\"`) of the key means.
Where there is no such text, an empty value selects the default, or `false` if the values are `true`
and `false`. In the column *flag*, an entry such as \"`--realtime`: true\" means that the flag takes
no value and sets the key to `true`. The flags are those of `spf fly`; other commands have some of
them.

In code: `crates/cli/src/settings`.
";

/// The whole document.
fn document(settings: &Settings) -> String {
    let mut text = HEAD.to_owned();
    let mut table = "";
    for row in settings.rows() {
        let key = row.key();
        if key.table != table {
            table = key.table;
            write!(
                text,
                "\n## `[{table}]`\n\n| key | default | range | variable | flag | meaning |\n|---|---|---|---|---|---|\n"
            )
            .unwrap();
        }
        writeln!(text, "{}", line(row)).unwrap();
    }
    text
}

fn line(row: &dyn Row) -> String {
    let key = row.key();
    let code = |text: &str| if text.is_empty() { String::new() } else { format!("`{text}`") };
    let flag = key.flag.as_ref().map_or(String::new(), |flag| match flag.form {
        Form::Switch(sets) => format!("`{}`: {sets}", flag.name),
        Form::Value(_) | Form::Optional(..) => code(flag.name),
    });
    let meaning = escaped(&row.meaning());
    let cells = [code(key.field), code(key.default), row.range().unwrap_or_default(), code(key.env), flag, meaning];
    let cells = cells.map(|cell| if cell.is_empty() { " ".to_owned() } else { format!(" {cell} ") });
    format!("|{}|", cells.join("|"))
}

/// Text in a table cell: a bar would end it, and asterisks or brackets would be interpreted.
fn escaped(text: &str) -> String {
    let mut code = false;
    let mut out = String::new();
    for letter in text.chars() {
        code ^= letter == '`';
        if letter == '|' || (!code && "[]*_<>".contains(letter)) {
            out.push('\\');
        }
        out.push(letter);
    }
    out
}

#[test]
fn the_reference_is_written_from_the_keys() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/reference/configuration.md");
    let written = document(&Settings::default());
    if std::env::var_os("INSTA_UPDATE").is_some_and(|how| how == "always") {
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(&path, &written).unwrap();
    }
    let kept = std::fs::read_to_string(&path).unwrap_or_default();
    assert!(kept == written, "docs/reference/configuration.md is old: INSTA_UPDATE=always cargo test -p spf reference");
}

#[test]
fn a_cell_keeps_its_text() {
    assert_eq!(escaped("spf[-a|-b], `rc 0 [1] x_y` a_b"), "spf\\[-a\\|-b\\], `rc 0 [1] x_y` a\\_b");
}
