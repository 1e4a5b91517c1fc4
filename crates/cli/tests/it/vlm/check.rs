//! `spf vlm check` against servers that point well, in other coordinates, or not at all.

use spf_core::frame::FrameId;
use spf_core::grounding::{AxisOrder, GroundingProfile, Scale};
use spf_core::query::{ImagePoint, Query, QueryId, QueryKind};

use super::KEY;
use super::server::{Reply, Server};
use super::vendors::Vendor;
use crate::harness::{Lab, Run};

/// Any question.
pub(super) fn query() -> Query {
    Query {
        instruction: "fly to the red dot".to_owned(),
        prompt: "Where?".to_owned(),
        ..Query::new(QueryId(0), FrameId(0), QueryKind::point(false))
    }
}

/// The centre of the red part of the received image: this server evaluates it.
fn red_dot(jpeg: &[u8]) -> ImagePoint {
    let image = spf_media::jpeg::decode(jpeg).unwrap();
    let (width, height) = (image.width(), image.height());
    let all = (0..height).flat_map(|y| (0..width).map(move |x| (x, y)));
    let red: Vec<(u32, u32)> = all
        .filter(|(x, y)| {
            let [r, g, _] = image.pixel(*x, *y).unwrap();
            r > 180 && g < 90
        })
        .collect();
    let mean = |of: fn(&(u32, u32)) -> u32| red.iter().map(|at| f64::from(of(at)) + 0.5).sum::<f64>() / red.len() as f64;
    ImagePoint { u: mean(|at| at.0) / f64::from(width), v: mean(|at| at.1) / f64::from(height) }
}

/// A server that points at the dot in coordinates of its own.
fn pointing(vendor: Vendor, own: GroundingProfile) -> Server {
    Server::start(move |_, request| {
        let [a, b] = own.point_numbers(red_dot(&vendor.image(request)));
        let text =
            format!("{{\"status\":\"navigating\",\"look\":null,\"stage\":1,\"point\":[{a},{b}],\"depth\":2,\"target\":\"dot\"}}");
        vendor.stream(&vendor.model(request), &text)
    })
}

fn check(server: &Server, vendor: Vendor) -> Run {
    let lab = Lab::new();
    let name = format!("{}@{}", vendor.name(), server.url());
    Run::of(&lab.command(&["vlm", "check", &name]).env(vendor.key(), KEY).output().unwrap())
}

fn profile(order: AxisOrder, scale: Scale) -> GroundingProfile {
    GroundingProfile { order, scale, ..GroundingProfile::default() }
}

const PIXELS: Scale = Scale::Pixels { width: 768, height: 576 };

#[test]
fn one_that_points_well_is_good() {
    for (vendor, own) in [
        (Vendor::Gemini, GroundingProfile::default()),
        (Vendor::OpenAi, profile(AxisOrder::Xy, PIXELS)),
        (Vendor::Anthropic, profile(AxisOrder::Xy, PIXELS)),
        (Vendor::Chat, profile(AxisOrder::Xy, Scale::Thousand)),
    ] {
        let run = check(&pointing(vendor, own), vendor);
        assert_eq!(run.code, Some(0), "{vendor:?} {}{}", run.stdout, run.stderr);
        assert!(run.stdout.contains("responds and points within 0."), "{}", run.stdout);
        assert_eq!(run.stdout.lines().count(), 4, "{}", run.stdout);
    }
}

/// A server that is right at 4:3 only: it squeezes every image into that shape, and answers in pixels of the result.
#[test]
fn the_images_have_the_size_and_shape_of_the_flights() {
    let sizes = std::sync::Arc::new(std::sync::Mutex::new(Vec::new()));
    let seen = sizes.clone();
    let server = Server::start(move |_, request| {
        let jpeg = Vendor::Anthropic.image(request);
        let image = spf_media::jpeg::decode(&jpeg).unwrap();
        seen.lock().unwrap().push((image.width(), image.height()));
        let own = profile(AxisOrder::Xy, Scale::Pixels { width: image.width(), height: image.width() * 3 / 4 });
        let [a, b] = own.point_numbers(red_dot(&jpeg));
        let text = format!("{{\"status\":\"navigating\",\"look\":null,\"stage\":1,\"point\":[{a},{b}],\"depth\":2}}");
        Vendor::Anthropic.stream(&Vendor::Anthropic.model(request), &text)
    });
    let name = format!("anthropic@{}", server.url());
    let lab = Lab::new();
    let check = |more: &[&str], side: &str| {
        let mut command = lab.command(&[&["vlm", "check", &name], more].concat());
        Run::of(&command.env(Vendor::Anthropic.key(), KEY).env("SPF_VLM_IMAGE_LONG_SIDE", side).output().unwrap())
    };
    let run = check(&[], "640");
    assert!(run.code == Some(0) && run.stdout.contains("of 640×480 pixels"), "{}{}", run.stdout, run.stderr);
    let run = check(&["--size", "1280x720"], "640");
    assert_eq!(run.code, Some(6), "{}{}", run.stdout, run.stderr);
    let sizes: std::collections::BTreeSet<(u32, u32)> = sizes.lock().unwrap().iter().copied().collect();
    assert_eq!(sizes.into_iter().collect::<Vec<_>>(), [(640, 360), (640, 480)]);
    let run = check(&["--size", "big"], "640");
    assert!(run.code == Some(2) && run.stderr.contains("--size: expected WIDTHxHEIGHT"), "{}", run.stderr);
}

#[test]
fn swapped_axes_and_other_scales_are_explained() {
    let run = check(&pointing(Vendor::Gemini, profile(AxisOrder::Xy, Scale::Thousand)), Vendor::Gemini);
    assert_eq!(run.code, Some(6), "{}", run.stderr);
    assert!(
        run.stderr.contains("gives coordinates as [x, y] in thousandths, not as the table of models states"),
        "{}",
        run.stderr
    );
    assert!(run.stderr.contains("order = \"xy\", scale = \"thousand\""), "{}", run.stderr);
    let run = check(&pointing(Vendor::Anthropic, profile(AxisOrder::Xy, Scale::Hundred)), Vendor::Anthropic);
    assert!(run.stderr.contains("[x, y] in percent"), "{}", run.stderr);
}

#[test]
fn every_refusal_is_explained() {
    let error = |status: u16, code: &'static str| {
        move |_: usize, _: &super::server::Request| {
            let body = serde_json::json!({ "error": { "message": format!("no: {KEY}"), "type": code, "code": code } });
            Reply::json(status, &body)
        }
    };
    for (status, code, hint) in [
        (401, "invalid_api_key", "the API key is invalid"),
        (402, "billing", "no credit"),
        (403, "permission", "region"),
        (404, "model_not_found", "unknown or retired model"),
        (429, "insufficient_quota", "quota is used up"),
        (400, "bad", "rejects the request format"),
    ] {
        let run = check(&Server::start(error(status, code)), Vendor::OpenAi);
        assert_eq!(run.code, Some(6), "{}", run.stderr);
        assert!(run.stderr.contains(hint) && run.stderr.contains("no: ***"), "{status}: {}", run.stderr);
        assert!(!run.stderr.contains(KEY), "{}", run.stderr);
    }
    let page = Server::start(|_, _| Reply::new(200, "text/html", "<html><title>Please sign in</title>"));
    let run = check(&page, Vendor::Chat);
    assert!(run.stderr.contains("web page \"Please sign in\"") && run.stderr.contains("proxy"), "{}", run.stderr);
    let lab = Lab::new();
    let run = lab.spf(&["vlm", "check", "vllm@http://127.0.0.1:9/v1"]);
    assert!(run.code == Some(6) && run.stderr.contains("cannot reach") && run.stderr.contains("HTTPS_PROXY"), "{}", run.stderr);
}
