//! Report output: one image with all points, and a self-contained HTML page.

use std::fmt::Write as _;

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use spf_core::query::{ImageBox, ImagePoint, Mark};
use spf_core::reply::Status;
use spf_media::marks::{self, Canvas, Colour, Hud};
use spf_media::{Jpeg, Rgb, resize};

use super::ask::CENTRE;
use super::measure::{Grades, Report, outline};
use super::{AnswerRow, Item, Outline, ParsedReply, photo, table};

/// Maximum number of misses shown on a page; the rest are counted.
const MOST: usize = 60;
/// Width of a miss's image, pixels.
const WIDTH: u32 = 480;
/// Height of one panel of an image with panels side by side.
const PANEL: u32 = 480;
const QUALITY: u8 = 80;
/// Colour of the target.
const TARGET: Colour = Colour::rgb(64, 230, 120);
/// One colour per answerer, distinguishable with most kinds of colour blindness (Okabe and Ito).
const COLOURS: [(u8, u8, u8); 7] =
    [(213, 94, 0), (86, 180, 233), (240, 228, 66), (204, 121, 167), (0, 158, 115), (0, 114, 178), (230, 159, 0)];

fn colour(answerer: usize) -> Colour {
    let (red, green, blue) = COLOURS[answerer % COLOURS.len()];
    Colour::rgb(red, green, blue)
}

/// An answer in a few words.
#[must_use]
pub fn words(row: &AnswerRow) -> String {
    match &row.parsed {
        ParsedReply::Nothing(code, why) => format!("no reply ({code}): {why}"),
        ParsedReply::Refused(why) => format!("not usable: {why}"),
        ParsedReply::Reply(reply) => {
            let target =
                reply.target.as_deref().filter(|_| reply.point.is_some()).map_or(String::new(), |what| format!(" {what}"));
            let at = if target.is_empty() { " " } else { " at " };
            let place = reply.point.map_or(String::new(), |point| format!("{at}({:.3}, {:.3})", point.u, point.v));
            let depth =
                reply.depth.filter(|_| reply.point.is_some()).map_or(String::new(), |depth| format!(", depth label {depth}"));
            let status = match reply.status {
                Status::Navigating => "points to",
                Status::Done => "done",
                Status::NotVisible => "not visible",
                Status::Following => "follows",
                Status::Waiting => "waits",
                Status::Blocked => "blocked",
            };
            format!("{status}{target}{place}{depth}")
        }
    }
}

/// Time, tokens and money of an answer in a few words.
#[must_use]
pub fn account(row: &AnswerRow) -> String {
    let tokens = row.account.tokens;
    let mut text = format!("{:.2} s", row.latency_s);
    if !tokens.is_empty() {
        let about = if tokens.estimated { "about " } else { "" };
        let _ = write!(text, ", {about}{} tokens in, {} out", tokens.input, tokens.output + tokens.thinking);
    }
    if let Some(cost) = row.account.cost_usd {
        let _ = write!(text, ", ${cost:.5}");
    }
    text
}

/// One copy of an image per answer, side by side, with its point.
#[must_use]
pub fn side_by_side(image: &Rgb, instruction: &str, rows: &[AnswerRow]) -> Rgb {
    let width = |of: &Rgb| {
        (u64::from(of.width()) * u64::from(PANEL) / u64::from(of.height().max(1))).clamp(64, 4 * u64::from(PANEL)) as u32
    };
    let small = resize(image, width(image), PANEL);
    let panels: Vec<Rgb> = rows.iter().map(|row| panel(&small, instruction, row)).collect();
    let line = 3 * small.width() as usize;
    let data: Vec<u8> = (0..PANEL as usize)
        .flat_map(|y| panels.iter().flat_map(move |panel| panel.data()[y * line..(y + 1) * line].iter().copied()))
        .collect();
    Rgb::from_raw(small.width() * panels.len() as u32, PANEL, data).unwrap_or(small)
}

fn panel(image: &Rgb, instruction: &str, row: &AnswerRow) -> Rgb {
    let mut panel = image.clone();
    let reply = row.reply();
    let boxes: Vec<Mark> = reply
        .iter()
        .flat_map(|reply| &reply.boxes)
        .map(|obstacle| Mark::Box { area: obstacle.area, label: format!("{} {}", obstacle.depth, obstacle.name) })
        .collect();
    let label = reply.as_ref().and_then(|reply| reply.depth).map_or(String::new(), |depth| depth.to_string());
    let point = reply.as_ref().and_then(|reply| reply.point);
    let (outcome, took) = (words(row), account(row));
    let hud = Hud { title: &row.answerer, status: "", lines: &[instruction, &outcome, &took], corner: None };
    marks::annotate(&mut panel, &boxes, point.map(|point| (point, label.as_str())), &hud);
    panel
}

/// A complete page: statistics, comparisons, and the misses with their images.
#[must_use]
pub fn page(title: &str, note: &str, items: &[Item], report: &Report, grades: &Grades) -> String {
    let mut html = String::from(HEAD);
    let _ = write!(html, "<title>{0}</title></head><body><h1>{0}</h1><p>{1}.</p>", escape(title), escape(&table::about(report)));
    for line in note.lines() {
        let _ = write!(html, "<p>{}</p>", escape(line));
    }
    html += "<h2>Figures</h2><p class=note>95 % confidence intervals: Wilson for rates, bootstrap otherwise.</p>";
    html += &rows(&table::figures(report));
    if !report.comparisons.is_empty() {
        html += "<h2>Comparisons on the same images</h2>";
        html += "<p class=note>Newcombe interval of the difference; p values with Holm correction over all comparisons in \
            this table.</p>";
        html += &rows(&table::comparisons(report));
    }
    let misses = misses(items, grades);
    let _ = write!(html, "<h2 id=misses>Misses</h2><p class=note>{}</p><div class=gallery>", escape(&legend(misses.len())));
    for item in misses.iter().take(MOST) {
        html += &card(*item, items, report, grades);
    }
    html += "</div></body></html>\n";
    html
}

fn legend(misses: usize) -> String {
    match misses {
        0 => "None, apart from the baseline that always points at the image centre.".to_owned(),
        n if n > MOST => {
            format!("{n} images with a miss or a wrong report of visibility; the first {MOST} are shown. The target is green.")
        }
        n => format!("{n} images with a miss or a wrong report of visibility. The target is green."),
    }
}

/// Items that an answerer other than the baselines missed.
fn misses(items: &[Item], grades: &Grades) -> Vec<usize> {
    let mut missed = vec![false; items.len()];
    for graded in grades.by_answerer.iter().flatten().filter(|graded| graded.row.answerer != CENTRE) {
        let grade = &graded.grade;
        let mistaken = grade.is_absent == Some(true) && grade.says_absent != Some(true);
        missed[graded.item] |= grade.hit == Some(false) || mistaken;
    }
    (0..items.len()).filter(|item| missed[*item]).collect()
}

fn card(item: usize, items: &[Item], report: &Report, grades: &Grades) -> String {
    let about = &items[item];
    let mut html =
        format!("<figure><figcaption><b>{}</b> <code>{}</code></figcaption>", escape(&about.instruction), escape(&about.key));
    let answers = grades.by_answerer.iter().enumerate().filter_map(|(which, all)| {
        let graded = all.iter().find(|graded| graded.item == item)?;
        (report.measures[which].answerer != CENTRE).then_some((which, graded))
    });
    let answers: Vec<_> = answers.collect();
    let points: Vec<_> = answers.iter().filter_map(|(which, graded)| Some((*which, graded.row.reply()?.point?))).collect();
    match drawn(about, &points) {
        Some(jpeg) => {
            let _ = write!(html, "<img alt=\"\" loading=lazy src=\"data:image/jpeg;base64,{}\">", STANDARD.encode(jpeg.bytes()));
        }
        None => html += "<p>Cannot read the image.</p>",
    }
    html += "<ul>";
    for (which, graded) in answers {
        let (red, green, blue) = COLOURS[which % COLOURS.len()];
        let outcome = match (graded.grade.hit, graded.grade.is_absent, graded.grade.says_absent) {
            (Some(true), ..) => "hit",
            (Some(false), _, Some(true)) => "wrongly reported as not visible",
            (Some(false), ..) => "missed",
            (None, Some(true), Some(true)) => "correctly reported as not visible",
            (None, Some(true), _) => "target reported although not in the image",
            (None, ..) => "",
        };
        let _ = write!(
            html,
            "<li><span style=\"background:rgb({red},{green},{blue})\"></span><b>{}</b> {outcome}: {}</li>",
            escape(&graded.row.answerer),
            escape(&words(&graded.row)),
        );
    }
    html += "</ul></figure>";
    html
}

/// An item's image with its target and all points.
fn drawn(item: &Item, points: &[(usize, ImagePoint)]) -> Option<Jpeg> {
    let image = photo::decode(&spf_input::read(&item.image, photo::LONGEST_FILE).ok()?).ok()?;
    let height = (u64::from(image.height()) * u64::from(WIDTH) / u64::from(image.width().max(1))).clamp(1, 4096) as u32;
    let mut small = resize(&image, WIDTH, height);
    if let Some(outline) = outline(item).ok().flatten() {
        edge(&mut small, &outline);
    }
    for (which, point) in points {
        marks::draw_waypoint(&mut small, *point, "", colour(*which));
    }
    Jpeg::encode(&small, QUALITY).ok()
}

/// Outlines a target: the rim of a mask, otherwise the box.
fn edge(image: &mut Rgb, outline: &Outline) {
    let (width, height) = (image.width(), image.height());
    let Some(mask) = outline.mask() else {
        let ImageBox { left, top, right, bottom } = outline.bounds();
        let mut canvas = Canvas::new(image);
        let (from, to) = (canvas.place(ImagePoint { u: left, v: top }), canvas.place(ImagePoint { u: right, v: bottom }));
        canvas.frame(marks::Rect { left: from.x, top: from.y, right: to.x, bottom: to.y }, 2.0, TARGET);
        return;
    };
    let holds = |x: i64, y: i64| {
        let inside = (0..i64::from(width)).contains(&x) && (0..i64::from(height)).contains(&y);
        let fraction = |at: i64, side: u32| (at as f64 + 0.5) / f64::from(side);
        inside && mask.holds(ImagePoint { u: fraction(x, width), v: fraction(y, height) })
    };
    for y in 0..i64::from(height) {
        for x in 0..i64::from(width) {
            // Just outside the mask, so that its inside stays visible.
            let beside = [(1, 0), (-1, 0), (0, 1), (0, -1)].into_iter().any(|(dx, dy)| holds(x + dx, y + dy));
            if beside && !holds(x, y) {
                image.set_pixel(x as u32, y as u32, [64, 230, 120]);
            }
        }
    }
}

fn rows(rows: &[Vec<String>]) -> String {
    let mut html = String::from("<div class=wide><table>");
    for (number, row) in rows.iter().enumerate() {
        html += "<tr>";
        for (column, cell) in row.iter().enumerate() {
            let tag = if number == 0 || column == 0 { "th" } else { "td" };
            let _ = write!(html, "<{tag}>{}</{tag}>", escape(cell));
        }
        html += "</tr>";
    }
    html + "</table></div>"
}

/// Escapes external text: instructions, file names and replies.
fn escape(text: &str) -> String {
    text.chars().fold(String::with_capacity(text.len()), |mut escaped, letter| {
        match letter {
            '&' => escaped += "&amp;",
            '<' => escaped += "&lt;",
            '>' => escaped += "&gt;",
            '"' => escaped += "&quot;",
            '\'' => escaped += "&#39;",
            other => escaped.push(other),
        }
        escaped
    })
}

/// No external resources and no scripts.
const HEAD: &str = "<!doctype html><html lang=en><head><meta charset=utf-8>\
<meta http-equiv=Content-Security-Policy content=\"default-src 'none'; img-src data:; style-src 'unsafe-inline'\">\
<meta name=viewport content=\"width=device-width, initial-scale=1\">\
<style>\
:root{color-scheme:light dark;--line:#8886}\
body{font:15px/1.45 system-ui,sans-serif;max-width:1200px;margin:2rem auto;padding:0 1rem}\
h1{font-size:1.5rem}h2{font-size:1.15rem;margin-top:2.2rem}.note{opacity:.75;margin-top:-.4rem}\
.wide{overflow-x:auto}table{border-collapse:collapse;font-variant-numeric:tabular-nums}\
th,td{padding:.3rem .8rem;text-align:right;border-bottom:1px solid var(--line);white-space:nowrap}\
th:first-child{text-align:left}tr:hover td,tr:hover th{background:#8882}\
.gallery{display:grid;grid-template-columns:repeat(auto-fill,minmax(300px,1fr));gap:1.2rem}\
figure{margin:0;border:1px solid var(--line);border-radius:6px;padding:.7rem;break-inside:avoid}\
figure img{width:100%;display:block;margin:.5rem 0;border-radius:3px}figcaption code{opacity:.6;font-size:.8em}\
ul{list-style:none;margin:0;padding:0;font-size:.88em}li{margin:.2rem 0;overflow-wrap:anywhere}\
li span{display:inline-block;width:.75em;height:.75em;border-radius:50%;margin-right:.45em}\
</style>";

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_from_elsewhere_are_no_markup() {
        assert_eq!(escape("<script>\"a\" & 'b'"), "&lt;script&gt;&quot;a&quot; &amp; &#39;b&#39;");
    }
}
