//! The frame of a page of the bench: self-contained, without scripts.

use maud::{DOCTYPE, Markup, PreEscaped, html};

const STYLE: &str = include_str!("report/page/style.css");

/// A page with this body. `loads` is what the browser may load beside the page itself, a directive of its content security policy;
/// `style`: rules beside those of all pages.
pub(crate) fn page(title: &str, loads: &str, style: &str, body: &Markup) -> String {
    let policy = format!("default-src 'none'; style-src 'unsafe-inline'{loads}");
    let page = html! {
        (DOCTYPE)
        html lang="en" {
            head {
                meta charset="utf-8";
                meta http-equiv="Content-Security-Policy" content=(policy);
                meta name="viewport" content="width=device-width, initial-scale=1";
                title { (title) }
                // Our own style sheets, without external text.
                style { (PreEscaped(STYLE)) (PreEscaped(style)) }
            }
            body { (body) }
        }
    };
    page.into_string()
}
