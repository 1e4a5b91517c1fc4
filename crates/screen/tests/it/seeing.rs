//! Pictures of windows and monitors.

use spf_media::Rgb;
use spf_screen::area::{Area, Region};
use spf_screen::{Eye, Hidden, ScreenError, Shown, Target, WindowName};

use crate::harness::{CLASS, Screen, Shop, look, pattern};

fn window(title: &str) -> Target {
    Target::Window { name: title.into(), region: Region::WHOLE }
}

#[test]
#[ignore = "needs Xvfb: .ci/interop runs it"]
fn a_window_is_seen_as_it_is_and_followed() {
    let Some(screen) = Screen::start("800x600x24") else { return };
    let image = pattern(320, 240, 5);
    let shop = Shop::open(&screen, "Old Game 3.1", (100, 100), &image);
    let display = screen.display();
    let mut eye = Eye::new(display.clone(), window("Game 3"));
    let first = look(&mut eye, "the picture", |seen| seen.as_ref().is_ok_and(|shown| shown.image == image)).unwrap();
    // A part of it, in whole pixels: from (80, 60) on, 160×120.
    let target = Target::Window { name: "Old Game".into(), region: Region([0.25, 0.25, 0.5, 0.5]) };
    let corners = (image.pixel(80, 60), image.pixel(239, 179));
    let as_expected = |part: &Result<Shown, Hidden>| {
        part.as_ref().is_ok_and(|part| (part.image.pixel(0, 0), part.image.pixel(159, 119)) == corners)
    };
    let part = look(&mut Eye::new(display.clone(), target), "the part", as_expected).unwrap();
    let Area { x, y, .. } = first.area;
    assert_eq!(part.area, Area { x: x + 80, y: y + 60, width: 160, height: 120 });
    shop.place(&screen, (300, 250));
    let moved = look(&mut eye, "the move", |seen| seen.as_ref().is_ok_and(|shown| shown.area.x > x + 150)).unwrap();
    assert!(moved.image == image && moved.area.width == 320);
    let listed = display.windows().unwrap();
    assert!(listed.iter().any(|it| it.title == "Old Game 3.1" && it.area == moved.area && it.shown), "{listed:?}");
}

#[test]
#[ignore = "needs Xvfb: .ci/interop runs it"]
fn a_window_that_cannot_be_seen_says_why() {
    let Some(screen) = Screen::start("800x600x24") else { return };
    let shop = Shop::open(&screen, "Flyer", (100, 100), &pattern(320, 240, 5));
    let mut eye = Eye::new(screen.display(), window("Flyer"));
    look(&mut eye, "the picture", Result::is_ok).unwrap();
    // Another window, over a quarter of it; then beside it.
    let other = Shop::open(&screen, "Chat", (260, 220), &Rgb::filled(300, 200, [9; 3]));
    let covered = |seen: &Result<_, Hidden>| matches!(seen, Err(Hidden::Covered(by)) if by == "`Chat`");
    look(&mut eye, "covered", covered).unwrap_err();
    other.place(&screen, (450, 350));
    look(&mut eye, "free again", Result::is_ok).unwrap();
    other.close();
    // Half of it beside the screen.
    shop.place(&screen, (640, 100));
    look(&mut eye, "off screen", |seen| matches!(seen, Err(Hidden::OffScreen))).unwrap_err();
    shop.place(&screen, (100, 100));
    let id = shop.window.to_string();
    screen.run("xdotool", &["windowminimize", &id]).unwrap();
    look(&mut eye, "minimised", |seen| matches!(seen, Err(Hidden::Minimised))).unwrap_err();
    screen.run("xdotool", &["windowactivate", &id]).unwrap();
    look(&mut eye, "shown again", Result::is_ok).unwrap();
    shop.close();
    look(&mut eye, "gone", |seen| matches!(seen, Err(Hidden::Gone(name)) if name.title.as_deref() == Some("Flyer"))).unwrap_err();
    // Started again, it is another window.
    let _again = Shop::open(&screen, "Flyer 2", (50, 50), &pattern(320, 240, 6));
    look(&mut eye, "started again", Result::is_ok).unwrap();
}

#[test]
#[ignore = "needs Xvfb: .ci/interop runs it"]
fn two_windows_with_the_title_are_refused_unless_one_has_it_exactly() {
    let Some(screen) = Screen::start("800x600x24") else { return };
    let _one = Shop::open(&screen, "Luanti forum", (0, 0), &pattern(100, 100, 1));
    let _two = Shop::open(&screen, "About Luanti", (200, 0), &pattern(100, 100, 2));
    let error = Eye::new(screen.display(), window("Luanti")).look().unwrap_err();
    assert!(matches!(&error, ScreenError::Ambiguous { count: 2, .. }), "{error}");
    let three = Shop::open(&screen, "Luanti", (400, 0), &pattern(100, 100, 3));
    assert!(Eye::new(screen.display(), window("Luanti")).look().unwrap().is_ok());
    // All have the same class: with the title one is meant.
    let display = screen.display();
    let class = |class: &str, title: Option<&str>| WindowName { title: title.map(str::to_owned), class: Some(class.to_owned()) };
    let error = display.find(&class(CLASS, None)).unwrap_err();
    assert!(error.to_string().starts_with("3 windows have the class `SPF test`: "), "{error}");
    assert_eq!(display.find(&class("spf Test", Some("Luanti"))).unwrap(), Some(three.window));
    assert_eq!(display.find(&class("INSTANCE", Some("Luanti"))).unwrap(), Some(three.window));
    assert_eq!(display.find(&class("SPF", Some("Luanti"))).unwrap(), None);
}

#[test]
#[ignore = "needs Xvfb: .ci/interop runs it"]
fn monitors_of_different_size_are_each_seen_in_their_place() {
    let Some(screen) = Screen::start("1000x600x24") else { return };
    // Two monitors side by side, the right one lower and smaller.
    for (name, size) in [("left", "600/160x600/150+0+0"), ("right", "400/100x300/80+600+300")] {
        screen.run("xrandr", &["--setmonitor", name, size, if name == "left" { "screen" } else { "none" }]).unwrap();
    }
    let display = screen.display();
    let monitors = display.monitors().unwrap();
    let right = monitors.iter().find(|monitor| monitor.name == "right").unwrap();
    assert_eq!(right.area, Area { x: 600, y: 300, width: 400, height: 300 }, "{monitors:?}");
    let image = pattern(200, 150, 9);
    let _shop = Shop::open(&screen, "On the right", (700, 400), &image);
    let mut eye = Eye::new(display.clone(), window("On the right"));
    let shown = look(&mut eye, "the window", |seen| seen.as_ref().is_ok_and(|shown| shown.image == image)).unwrap();
    let (x, y) = ((shown.area.x - 600) as u32, (shown.area.y - 300) as u32);
    let mut eye = Eye::new(display.clone(), Target::Monitor { name: "right".to_owned() });
    let in_its_place =
        |seen: &Result<Shown, Hidden>| seen.as_ref().is_ok_and(|seen| seen.image.pixel(x + 17, y + 23) == image.pixel(17, 23));
    let seen = look(&mut eye, "the monitor", in_its_place).unwrap();
    assert_eq!((seen.image.width(), seen.image.height()), (400, 300));
    let error = Eye::new(display, Target::Monitor { name: "DP-1".to_owned() }).look().unwrap_err();
    assert!(error.to_string().contains("`left`") && error.to_string().contains("`right`"), "{error}");
}
