//! `spf vlm check NAME`: checks whether a model replies and points as expected, and explains what is wrong if not.

use spf_core::grounding::{AxisOrder, GroundingProfile, Scale};
use spf_vlm::check::{Check, USUAL_CAMERA, Verdict, check as ask};
use spf_vlm::exec::EXEC;
use spf_vlm::setup::{self, Access};
use spf_vlm::{Paced, Vlm, VlmError};

use super::{exec, refused, request_options, table};
use crate::args::VlmCheck;
use crate::error::CliError;
use crate::exit::Exit;
use crate::printer::Printer;
use crate::settings::{Settings, environment, variables};

/// Queries a model about the calibration images.
pub(crate) fn check(args: &VlmCheck, printer: &Printer) -> Result<Exit, CliError> {
    let mut settings = Settings::of(&args.settings, printer)?;
    settings.fly.vlm.argument("NAME", &args.name);
    let mut vlm: Box<dyn Vlm> = if args.name.starts_with(EXEC) {
        Box::new(Paced::new(Box::new(exec(&settings, &args.name)?), None, true))
    } else {
        let (table, variables) = (table(&settings)?, variables()?);
        let send_to = settings.vlm.send_key_to.get()?.unwrap_or_default();
        let access = Access { keys: &variables, places: &environment, send_to: &send_to };
        let remote = setup::remote(&table, &[args.name.as_str().into()], access, request_options(&settings)?);
        Box::new(remote.map_err(|error| refused(&settings, &args.name, &error))?)
    };
    let time = settings.reply_timeout()?;
    let camera = args.size.as_deref().map(camera_px).transpose()?.unwrap_or(USUAL_CAMERA);
    let check = ask(vlm.as_mut(), time, camera);
    report(&check, printer);
    match &check.verdict {
        Verdict::Good(_) => Ok(Exit::Success),
        Verdict::Failed(error) => Err(failed(&args.name, error)),
        other => Err(astray(&args.name, other)),
    }
}

/// Width and height of a camera's frames, pixels.
fn camera_px(text: &str) -> Result<(u32, u32), CliError> {
    let side = |text: &str| text.parse().ok().filter(|side| (64..=8192).contains(side));
    let size = text.split_once(['x', 'X', '×']).and_then(|(width, height)| Some((side(width)?, side(height)?)));
    size.ok_or_else(|| {
        CliError::usage(format!("--size: expected WIDTHxHEIGHT in pixels, each from 64 to 8192, found `{text}`"))
            .hint("--size 1280x720")
    })
}

fn report(check: &Check, printer: &Printer) {
    for pointed in &check.pointed {
        let dot = pointed.dot;
        let latency = pointed.answer.latency.as_secs_f64();
        let result = match (&pointed.answer.text, pointed.point) {
            (Ok(_), Some(point)) => format!("pointed at ({:.3}, {:.3})", point.u, point.v),
            (Ok(text), None) => format!("replied {}", text.chars().take(120).collect::<String>()),
            (Err(_), _) => "no reply".to_owned(),
        };
        printer.result(&format!("dot at ({:.3}, {:.3}): {result}, {latency:.2} s", dot.u, dot.v));
    }
    if let Verdict::Good(worst) = check.verdict {
        let model = check.pointed.first().map_or("", |pointed| &pointed.answer.model);
        let tokens = check.account.tokens;
        let about = if tokens.estimated { "about " } else { "" };
        let cost = check.account.cost_usd.map_or(String::new(), |cost| format!(", {about}${cost:.5}"));
        printer.result(&format!(
            "good: {model} responds and points within {:.1} % of the image width of {}×{} pixels; {about}{} tokens in, {} out{cost}",
            100.0 * worst,
            check.image_px.0,
            check.image_px.1,
            tokens.input,
            tokens.output + tokens.thinking,
        ));
    }
}

/// It replies, but does not point at the dot.
fn astray(name: &str, verdict: &Verdict) -> CliError {
    match verdict {
        Verdict::Other(own) => {
            CliError::failed(format!("`{name}` gives coordinates as {}, not as the table of models states", convention(own)))
                .hint(format!("add a row for it with --vlm-models (docs/guide/vlm.md): {}", row(own)))
        }
        Verdict::Astray(worst) => CliError::failed(format!(
            "`{name}` does not point at the dots: the error is {:.0} % of the image width",
            100.0 * worst
        ))
        .hint("no coordinate convention fits its replies: the model cannot point accurately; use another model (`spf vlm list`)"),
        Verdict::Unreadable(reason) => CliError::failed(format!("`{name}` responds, but not in the requested format: {reason}"))
            .hint("use a larger model, or one that follows schemas"),
        Verdict::Good(_) | Verdict::Failed(_) => CliError::failed(format!("`{name}` failed")),
    }
}

fn convention(profile: &GroundingProfile) -> String {
    let order = match profile.order {
        AxisOrder::Yx => "[y, x]",
        AxisOrder::Xy => "[x, y]",
    };
    let scale = match profile.scale {
        Scale::Thousand => "thousandths",
        Scale::Hundred => "percent",
        Scale::Unit => "fractions",
        Scale::Pixels { .. } => "pixels",
    };
    format!("{order} in {scale}")
}

fn row(profile: &GroundingProfile) -> String {
    let order = match profile.order {
        AxisOrder::Yx => "yx",
        AxisOrder::Xy => "xy",
    };
    let scale = match profile.scale {
        Scale::Thousand => "thousand",
        Scale::Hundred => "hundred",
        Scale::Unit => "unit",
        Scale::Pixels { .. } => "pixels",
    };
    format!("[[family]] with order = \"{order}\", scale = \"{scale}\" and a part of the model's id in `match`")
}

/// It does not reply: the reason, and a remedy.
fn failed(name: &str, error: &VlmError) -> CliError {
    CliError::failed(format!("no usable reply from `{name}`")).because(error).hint(advice(error))
}

/// A remedy for an error of a VLM.
pub(crate) fn advice(error: &VlmError) -> &'static str {
    match (error.code(), error) {
        _ if error.is_of_stand_in() => {
            "fly with --no-vlm-check, and with the camera that the same `spf sim serve` shows; it cannot be asked about a test image"
        }
        _ if error.is_context() => "the query is longer than the server's context: change one of the settings named above",
        ("bad_request", VlmError::Vendor { code: Some(code), .. }) if code == "FAILED_PRECONDITION" => {
            "the vendor does not serve this region, or requires billing to be set up: see its console"
        }
        ("key", _) => "the API key is invalid or revoked: create a new one and set it in the environment or in .env",
        ("billing", _) => "the account has no credit: top it up at the vendor",
        ("permission", _) => "the API key has no access to this model, or the vendor does not serve this region",
        ("no_such_model", _) => "unknown or retired model, or wrong URL: `spf vlm list` shows successors",
        ("rate_limit", _) if !error.may_retry() => "the account's quota is used up: raise it, or wait until it is renewed",
        ("rate_limit", _) => "the account's rate limit is exceeded: wait, or request a higher tier",
        ("bad_request", _) => {
            "the vendor rejects the request format: the table row of this model may be out of date (docs/guide/vlm.md)"
        }
        ("overloaded" | "server_error" | "error_in_answer", _) => {
            "the vendor's service has a problem: try again, or set vlm.fallback in spf.toml"
        }
        ("network" | "broken_off", _) => {
            "check the network (the Wi-Fi of a drone leads to no Internet), HTTPS_PROXY and SSL_CERT_FILE; a local server must be running"
        }
        ("web_page" | "content_type" | "malformed", _) => {
            "the reply is not from the vendor's API: a proxy, a sign-in page or a wrong path"
        }
        ("deadline", _) => "the model is slow or still loading: try again, or raise fly.reply_timeout_s",
        ("cut_off", _) => {
            "the model thinks for too long: raise `max_output_tokens` in its row of a --vlm-models file, or reduce thinking"
        }
        ("program", _) => "`spf -v vlm check` shows what the program prints to standard error",
        ("blocked" | "declined", _) => "blocked by the vendor's policy: try another model",
        _ => "`spf -v vlm check` shows details",
    }
}
