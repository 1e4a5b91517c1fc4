use proptest::prelude::*;

use super::*;

fn luanti() -> &'static str {
    SHIPPED.iter().find(|(name, _)| *name == "luanti").unwrap().1
}

#[test]
fn every_shipped_profile_is_valid_and_comes_back_from_toml() {
    for (name, text) in SHIPPED {
        let profile = Profile::parse(text).unwrap_or_else(|error| panic!("{name}: {error}"));
        assert_eq!(Profile::open(name).unwrap(), profile);
        assert_eq!(Profile::parse(&profile.to_toml().unwrap()).unwrap(), profile, "{name}");
        assert!(profile.keys().len() >= 4 && profile.source.len() > 10, "{name}");
    }
}

#[test]
fn the_profile_of_the_guide_is_valid_with_keys_and_with_the_mouse() {
    let guide = include_str!("../../../../docs/guide/games.md");
    let example = guide.split_once("### A profile of your own").and_then(|(_, rest)| rest.split("```").nth(1)).unwrap();
    let text = example.strip_prefix("toml\n").unwrap();
    let by_keys = Profile::parse(text).unwrap();
    assert_eq!((by_keys.keys().len(), by_keys.window.class.as_deref()), (8, Some("MyGame")));
    let keys = text.lines().find(|line| line.starts_with("yaw = ")).unwrap();
    let by_mouse = Profile::parse(&text.replace(keys, "").replace("# yaw = ", "yaw = ")).unwrap();
    assert!(matches!(by_mouse.controls.yaw, Yaw::Mouse(_)));
}

/// Where the game draws at 960×720, by its own numbers: eight places of 48 pixels with margins of 4 at 4 pixels from the lower edge,
/// with hearts and bubbles of 24 pixels above them, and up to six lines of 18 pixels of chat across the picture.
#[test]
fn the_masks_of_luanti_cover_its_chat_and_its_whole_hot_bar() {
    let masks = Profile::parse(luanti()).unwrap().camera.masks;
    for (what, [left, top, right, bottom]) in [
        ("hot bar", [480 - 224, 720 - 60, 480 + 224, 720]),
        ("hearts and bubbles", [480 - 265, 720 - 88, 480 + 265, 720 - 64]),
        ("chat", [0, 0, 960, 108]),
    ] {
        let covers = |mask: &Region| {
            let Region([x, y, width, height]) = *mask;
            let (x, y) = (x * 960.0, y * 720.0);
            x <= f64::from(left)
                && y <= f64::from(top)
                && x + width * 960.0 >= f64::from(right)
                && y + height * 720.0 >= f64::from(bottom)
        };
        assert!(masks.iter().any(covers), "{what}");
    }
}

#[test]
fn what_is_wrong_is_named() {
    let refused = |from: &str, to: &str| {
        let text = luanti();
        assert!(text.contains(from), "{from}");
        Profile::parse(&text.replacen(from, to, 1)).unwrap_err().to_string()
    };
    for (from, to, words) in [
        ("tilt_deg = 0.0", "tilt_deg = 91.0", "`camera.tilt_deg`: expected -90 to 90, found `91`"),
        ("tilt_deg = 0.0", "tilt = 0.0", "unknown field `tilt`"),
        ("plus = \"w\"", "plus = \"W\"", "expected a key such as `w`"),
        ("minus = \"s\"", "minus = \"w\"", "`controls`: expected each key in one place, found `w`"),
        ("title = \"Minetest\"", "title = \"M\"", "`window.title`: expected a line of 3 to 400"),
        ("vertical_fov_deg = 78.9", "vertical_fov_deg = nan", "`camera.vertical_fov_deg`"),
        ("vertical_fov_deg = 78.9", "vertical_fov_deg = 78.9\nhorizontal_fov_deg = 90.0", "one field of view"),
        ("pulse_hz = 10.0", "pulse_hz = 1e10", "`controls.pulse_hz`"),
        ("minus = \"s\"\n", "", "`controls.forward`: expected two keys, `plus` and `minus`, or a `stick`, found `plus`"),
        ("minus = \"s\"", "minus = \"s\"\nstick = \"left_y\"", "found `plus, minus, stick`"),
        ("plus = \"w\"\nminus = \"s\"", "stick = \"left_z\"", "expected `left_x`, `left_y`, `right_x` or `right_y`"),
        (
            "[controls.yaw]",
            "[controls.gamepad]\ndead_zone = 0.6\n[controls.yaw]",
            "`controls.gamepad.dead_zone`: expected 0 to 0.5",
        ),
        (
            "mouse_deg = 0.2264",
            "plus = \"q\"",
            "expected `rate_deg_s`, and beside it two keys (`plus` and `minus`), or `mouse_deg`",
        ),
        ("mouse_deg = 0.2264\nrate_deg_s = 60.0", "mouse_deg = 0.2264", "found mouse_deg"),
        ("mouse_deg = 0.2264", "mouse_deg = 0.2264\nrate_m_s = 1.0", "unknown field `rate_m_s`"),
        ("[controls.yaw]", "[controls.gamepad]\ndeadzone = 0.1\n[controls.yaw]", "unknown field `deadzone`"),
    ] {
        let error = refused(from, to);
        assert!(error.contains(words), "{from}: {error}");
    }
    let portal = |text: &str| text.replace("title = \"Minetest\"", "portal = true");
    let error = Profile::parse(&portal(luanti())).unwrap_err().to_string();
    assert!(error.contains("expected sticks alone"), "{error}");
    let by_portal = Profile::parse(&portal(&pad())).unwrap();
    assert!(matches!(by_portal.target(), Target::Portal { .. }));
    assert_eq!(Profile::parse(&by_portal.to_toml().unwrap()).unwrap(), by_portal);
    for (window, words) in [("portal = false", "none of them"), ("portal = true\nclass = \"Game\"", "both")] {
        let error = Profile::parse(&pad().replace("title = \"Minetest\"", window)).unwrap_err().to_string();
        assert!(error.contains(words), "{error}");
    }
    let error = Profile::open("lunati").unwrap_err().to_string();
    assert!(error.contains("no profile `lunati`: use drl, luanti, spf-window, or the path"), "{error}");
    assert!(Profile::open("./none.toml").unwrap_err().to_string().contains("cannot read the profile"));
}

/// A profile that is flown by sticks alone.
fn pad() -> String {
    luanti()
        .replace("plus = \"w\"\nminus = \"s\"", "stick = \"-right_y\"")
        .replace("plus = \"d\"\nminus = \"a\"", "stick = \"right_x\"")
        .replace("plus = \"space\"\nminus = \"Shift_L\"", "stick = \"-left_y\"")
        .replace("mouse_deg = 0.2264", "stick = \"left_x\"")
        + "\n[controls.gamepad]\ndead_zone = 0.15\nexponent = 2.0\n\n[take_off]\nsteps = [{ push = \"-left_y\", for_s = 1.0 }]\n"
}

#[test]
fn sticks_take_the_place_of_keys() {
    let profile = Profile::parse(&pad()).unwrap();
    assert!(profile.has_sticks() && profile.keys().is_empty());
    assert_eq!(profile.controls.yaw.stick(), Some(Stick::named("left_x").unwrap()));
    assert_eq!(profile.controls.curve(), Curve { dead_zone: 0.15, exponent: 2.0 });
    assert_eq!(Profile::parse(&profile.to_toml().unwrap()).unwrap(), profile);
    assert!(!Profile::parse(luanti()).unwrap().has_sticks());
    for (from, to, words) in [
        ("stick = \"left_x\"", "stick = \"-left_y\"", "`controls`: expected each axis of a stick in one place, found `-left_y`"),
        ("{ push", "{ hold = \"w\", push", "`take_off.steps`: expected `hold` or `push` in a step"),
    ] {
        let error = Profile::parse(&pad().replacen(from, to, 1)).unwrap_err().to_string();
        assert!(error.contains(words), "{error}");
    }
}

#[test]
fn a_field_of_view_gives_the_other_by_the_shape_of_the_picture() {
    let camera = Profile::parse(luanti()).unwrap().optics((960, 720));
    // By hand: tan 39.45° · 4/3 = 1.0972, thus 95.3°.
    let (across, down) = camera.half_fov();
    assert!((2.0 * across.to_degrees() - 95.3).abs() < 0.05 && (2.0 * down.to_degrees() - 78.9).abs() < 1e-6);
    assert!((camera.fx - camera.fy).abs() < 1e-6);
}

fn any_text() -> impl Strategy<Value = String> {
    prop_oneof![
        ".{0,300}",
        // A valid profile with one place changed.
        (any::<prop::sample::Index>(), ".{0,8}", any::<bool>()).prop_map(|(at, put, is_pad)| {
            let text = if is_pad { pad() } else { luanti().to_owned() };
            let mut at = at.index(text.len());
            while !text.is_char_boundary(at) {
                at -= 1;
            }
            format!("{}{put}{}", &text[..at], &text[at..])
        }),
        (any::<prop::sample::Index>(), any::<f64>(), any::<bool>()).prop_map(|(at, number, is_pad)| {
            let text = if is_pad { pad() } else { luanti().to_owned() };
            let numbers: Vec<(usize, &str)> = text.match_indices("= ").collect();
            let (start, _) = numbers[at.index(numbers.len())];
            let end = text[start..].find('\n').map_or(text.len(), |length| start + length);
            format!("{}= {number:?}{}", &text[..start], &text[end..])
        }),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]
    #[test]
    fn any_text_is_read_or_refused_and_what_is_read_comes_back(text in any_text()) {
        match Profile::parse(&text) {
            Ok(profile) => {
                let again = Profile::parse(&profile.to_toml().unwrap()).unwrap();
                prop_assert_eq!(again, profile.clone());
                let camera = profile.optics((960, 720));
                prop_assert!(camera.fx.is_finite() && camera.fx > 0.0);
            }
            Err(error) => prop_assert!(!error.to_string().is_empty()),
        }
    }
}
