//! The portal ScreenCast: the real portal, PipeWire and GStreamer on a bus of their own, and in the desktop's place a program that has
//! always chosen the same stream.

use std::path::Path;
use std::process::Command;

use spf_screen::area::Region;
use spf_screen::profile::Key;
use spf_screen::{Display, Eye, Hands, ScreenError, Target, WindowName};

use crate::harness::{Screen, wait};

/// Debian's dbus, pipewire, wireplumber, gstreamer1.0-tools and gstreamer1.0-pipewire.
const PROGRAMS: [&str; 5] = ["dbus-run-session", "pipewire", "wireplumber", "pw-dump", "gst-launch-1.0"];
/// Where Debian has the portal.
const PORTAL: &str = "/usr/libexec/xdg-desktop-portal";
/// The variable that holds the folder of the session.
const FOLDER: &str = "SPF_TEST_PORTAL";
/// Rows of this width do not end at a multiple of four bytes. Desktops send pictures in this format.
const PIPELINE: &str = "videotestsrc pattern=ball is-live=true foreground-color=0xff3214c8 background-color=0xff14c832 \
    ! video/x-raw,format=BGRx,width=322,height=240,framerate=20/1";
const SESSION: &str = r#"
pipewire & echo $! >> "$SPF_TEST_PORTAL/pids"
for i in $(seq 100); do [ -e "$XDG_RUNTIME_DIR/pipewire-0" ] && break; sleep 0.1; done
wireplumber & echo $! >> "$SPF_TEST_PORTAL/pids"
/usr/bin/python3 "$1" "$2" 322x240 > "$SPF_TEST_PORTAL/backend" & echo $! > "$SPF_TEST_PORTAL/backend-pid"
for i in $(seq 200); do grep -q ready "$SPF_TEST_PORTAL/backend" && break; sleep 0.1; done
/usr/libexec/xdg-desktop-portal & echo $! >> "$SPF_TEST_PORTAL/pids"
for i in $(seq 100); do
  gdbus introspect --session --dest org.freedesktop.portal.Desktop --object-path /org/freedesktop/portal/desktop |
    grep -q ScreenCast && break
  sleep 0.1
done
"$3" --ignored --exact portal::within_the_session --nocapture
code=$?
kill $(cat "$SPF_TEST_PORTAL/pids" "$SPF_TEST_PORTAL/backend-pid") 2>/dev/null
exit $code
"#;

fn missing() -> Option<&'static str> {
    let has_gi = Command::new("/usr/bin/python3").args(["-c", "import gi"]).output().is_ok_and(|output| output.status.success());
    match crate::server::Server::missing(&PROGRAMS) {
        None if !Path::new(PORTAL).exists() => Some("xdg-desktop-portal"),
        None if !has_gi => Some("python3-gi"),
        missing => missing,
    }
}

#[test]
#[ignore = "needs a desktop's portal: .ci/interop runs it"]
fn what_the_user_lets_the_portal_show_is_seen() {
    let Some(screen) = Screen::start("320x240x24") else { return };
    if let Some(missing) = missing() {
        assert!(std::env::var("CI").as_deref() != Ok("true"), "{missing} is missing");
        return eprintln!("NOT CHECKED: {missing} is missing");
    }
    let folder = tempfile::tempdir().unwrap();
    let portals = folder.path().join("portals");
    std::fs::create_dir(&portals).unwrap();
    let known = "[portal]\nDBusName=org.freedesktop.impl.portal.desktop.spftest\n\
        Interfaces=org.freedesktop.impl.portal.ScreenCast;\nUseIn=spftest\n";
    std::fs::write(portals.join("spftest.portal"), known).unwrap();
    let backend = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/it/portal_backend.py");
    let mut session = screen.command("dbus-run-session", &["--", "sh", "-c", SESSION, "session"]);
    session.arg(backend).arg(PIPELINE).arg(std::env::current_exe().unwrap());
    session.env(FOLDER, folder.path()).env("XDG_RUNTIME_DIR", folder.path()).env("HOME", folder.path());
    session.env("XDG_DESKTOP_PORTAL_DIR", portals).env("XDG_CURRENT_DESKTOP", "spftest");
    let output = session.output().unwrap();
    let said = String::from_utf8_lossy(&output.stdout) + String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success() && said.contains("1 passed"), "{said}");
}

#[test]
#[ignore = "runs within the session of the test above"]
fn within_the_session() {
    let Some(folder) = std::env::var_os(FOLDER) else { return };
    let display = Display::open(None).unwrap();
    let mut eye = Eye::new(display.clone(), Target::Portal { region: Region([0.5, 0.0, 0.5, 1.0]) });
    let first = eye.look().unwrap().unwrap();
    assert_eq!((first.image.width(), first.image.height()), (161, 240));
    let colours = |image: &spf_media::Rgb| {
        let count = |wanted: [u8; 3]| {
            let is_near = |pixel: &[u8]| pixel.iter().zip(wanted).all(|(one, two)| one.abs_diff(two) < 30);
            image.data().chunks_exact(3).filter(|pixel| is_near(pixel)).count()
        };
        (count([0x14, 0xc8, 0x32]), count([0x32, 0x14, 0xc8]))
    };
    // The ball comes by, and nothing else is in the picture but its edge. A wrong stride would slant and mix the colours.
    wait("the ball", || {
        let (ground, ball) = colours(&eye.look().unwrap().unwrap().image);
        ball > 800 && ground + ball > 161 * 240 * 19 / 20
    });
    let later = eye.look().unwrap().unwrap();
    assert!(later.at > first.at && later.at.elapsed().as_secs_f64() < 1.0);
    // Whether it has the focus is not known: no key is pressed.
    let mut hands = Hands::open(&display, &WindowName::default()).unwrap();
    assert!(hands.activate().unwrap() && hands.has_focus().unwrap());
    let key = Key::named("w").unwrap();
    assert!(matches!(hands.set(key, true), Err(ScreenError::NoFocus)) && matches!(hands.turn(5), Err(ScreenError::NoFocus)));
    // The desktop ends the stream.
    let pid = std::fs::read_to_string(Path::new(&folder).join("backend-pid")).unwrap();
    assert!(Command::new("kill").arg(pid.trim()).status().unwrap().success());
    wait("the end", || matches!(eye.look(), Err(ScreenError::Portal(why)) if why.contains("ended")));
}
