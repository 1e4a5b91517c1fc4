//! Any text as the profile of a game: read or refused, and what is read is written and read again unchanged.
#![no_main]

use libfuzzer_sys::fuzz_target;
use spf_screen::profile::Profile;

fuzz_target!(|data: &[u8]| {
    let Ok(text) = core::str::from_utf8(data) else { return };
    let Ok(profile) = Profile::parse(text) else { return };
    let again = profile.to_toml().expect("a profile is TOML");
    assert_eq!(Profile::parse(&again).expect("what was read is valid"), profile);
    assert!(profile.optics((960, 720)).fx.is_finite());
});
