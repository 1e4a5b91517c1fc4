//! The page's files, embedded in the program.

/// A file: its path, its type, its text.
pub(crate) type File = (&'static str, &'static str, &'static str);

const HTML: &str = "text/html; charset=utf-8";
const CSS: &str = "text/css; charset=utf-8";
const JS: &str = "text/javascript; charset=utf-8";

macro_rules! page {
    ($($path:literal => $name:literal: $kind:expr),* $(,)?) => {
        pub(crate) const FILES: &[(File, &str)] = &[$((($path, $kind, include_str!(concat!("../page/", $name))), $name)),*];
    };
}

page! {
    "/" => "index.html": HTML,
    "/cockpit.css" => "cockpit.css": CSS,
    "/app.js" => "app.js": JS,
    "/sockets.js" => "sockets.js": JS,
    "/picture.js" => "picture.js": JS,
    "/draw.js" => "draw.js": JS,
    "/film.js" => "film.js": JS,
    "/map.js" => "map.js": JS,
    "/decisions.js" => "decisions.js": JS,
    "/mark.js" => "mark.js": JS,
    "/fly.js" => "fly.js": JS,
    "/cut.js" => "cut.js": JS,
    "/alarms.js" => "alarms.js": JS,
    "/look.js" => "look.js": JS,
    "/flights" => "flights.html": HTML,
    "/flights.js" => "flights.js": JS,
    "/icon.svg" => "icon.svg": "image/svg+xml",
}

/// The text of a file; in debug builds from the folder that `SPF_COCKPIT_PAGE` names, for work on the page.
pub(crate) fn text(file: &File, name: &str) -> String {
    #[cfg(debug_assertions)]
    if let Some(folder) = std::env::var_os("SPF_COCKPIT_PAGE")
        && let Ok(text) = std::fs::read_to_string(std::path::Path::new(&folder).join(name))
    {
        return text;
    }
    let _ = name;
    file.2.to_owned()
}
