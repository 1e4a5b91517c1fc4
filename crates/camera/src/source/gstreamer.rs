//! What a pipeline of GStreamer gives.

use std::time::Instant;

use gstreamer as gst;
use gstreamer::prelude::*;
use gstreamer_app::AppSink;
use spf_media::Rgb;

use super::{POLL_INTERVAL, SILENCE};
use crate::address::Pipeline;
use crate::failure::SourceError;
use crate::feed::Feed;

/// What is put behind the pipeline: packed RGB, the newest image alone, at once.
const SINK: &str = "videoconvert ! video/x-raw,format=RGB ! appsink name=spf-frames max-buffers=1 drop=true sync=false";
/// What to do about a pipeline that fails.
const TRY: &str = "try the pipeline with gst-launch-1.0 and autovideosink behind it";
/// Longest side of an image, pixels.
const LONGEST_SIDE: i32 = 8192;

/// Receives until stopped.
pub(super) fn receive(pipeline: &Pipeline, feed: &mut Feed) -> Result<(), SourceError> {
    gst::init().map_err(|_| SourceError::Connection { why: "GStreamer cannot be started".to_owned(), hint: TRY })?;
    let built = gst::parse::launch(&format!("{} ! {SINK}", pipeline.0)).map_err(|error| invalid(&error))?;
    let pipeline = built.downcast::<gst::Pipeline>().map_err(|_| SourceError::Pipeline("it is no pipeline".to_owned()))?;
    let running = Running(pipeline);
    let sink = running.0.by_name("spf-frames").and_then(|sink| sink.downcast::<AppSink>().ok());
    let sink = sink.ok_or_else(|| SourceError::Pipeline("it uses the name spf-frames".to_owned()))?;
    let bus = running.0.bus().ok_or_else(|| SourceError::Pipeline("it has no bus".to_owned()))?;
    // A live source shows nothing while it is paused. The cause of a failure is on the bus.
    let mut paused = running.0.set_state(gst::State::Paused);
    let begun = Instant::now();
    while paused == Ok(gst::StateChangeSuccess::Async) && begun.elapsed() < SILENCE && !feed.stopped() {
        // A source that connects first tells afterwards whether it is live.
        paused = running.0.state(gst::ClockTime::from_mseconds(POLL_INTERVAL.as_millis() as u64)).0;
    }
    let is_live = paused == Ok(gst::StateChangeSuccess::NoPreroll) && sources_are_live(&running.0);
    if !is_live {
        feed.is_recording();
    }
    running.0.set_state(gst::State::Playing).ok();
    let mut last = Instant::now();
    while !feed.stopped() {
        if let Some(message) = bus.pop_filtered(&[gst::MessageType::Error, gst::MessageType::Eos]) {
            return Err(match message.view() {
                gst::MessageView::Error(error) => SourceError::Connection { why: failure(&error.error()), hint: TRY },
                _ => SourceError::Ended,
            });
        }
        let wait = gst::ClockTime::from_mseconds(POLL_INTERVAL.as_millis() as u64);
        let Some(sample) = sink.try_pull_sample(wait) else {
            if last.elapsed() > SILENCE {
                return Err(SourceError::Silent(SILENCE.as_secs()));
            }
            continue;
        };
        last = Instant::now();
        let at = feed.now();
        let (stamp, age) = times(&running.0, &sample);
        // What is not live comes as fast as it can be made: its times say nothing about its age. Those of a live source may be
        // times of capture, or of the arrival from a network: nothing is younger than the usual latency.
        let usual = feed.latency().as_secs_f64();
        let age = age.filter(|_| is_live).map(|age| age.max(usual));
        match image(&sample) {
            Some(image) => feed.decoded(at, stamp.filter(|_| is_live), age, image, "raw"),
            None => return Err(SourceError::Pipeline("its images have no usable size".to_owned())),
        }
    }
    Ok(())
}

/// A pipeline that is stopped at the end, however that comes.
struct Running(gst::Pipeline);

impl Drop for Running {
    fn drop(&mut self) {
        // Nothing can be done about a pipeline that does not stop.
        self.0.set_state(gst::State::Null).ok();
    }
}

/// Whether all sources of a paused pipeline are live. The pipeline says so too if another element keeps to the clock, as
/// `identity sync=true` does behind a file.
fn sources_are_live(pipeline: &gst::Pipeline) -> bool {
    let sources: Vec<gst::Element> = pipeline.iterate_sources().into_iter().flatten().collect();
    let is_live = |source: &gst::Element| source.state(gst::ClockTime::ZERO).0 == Ok(gst::StateChangeSuccess::NoPreroll);
    !sources.is_empty() && sources.iter().all(is_live)
}

/// When a sample was captured, by the pipeline's clock: nanoseconds, and its age in seconds.
fn times(pipeline: &gst::Pipeline, sample: &gst::Sample) -> (Option<i64>, Option<f64>) {
    let captured = sample
        .buffer()
        .and_then(|buffer| buffer.pts())
        .and_then(|pts| sample.segment()?.downcast_ref::<gst::ClockTime>()?.to_running_time(pts));
    let now = pipeline.current_running_time();
    let stamp = captured.and_then(|time| i64::try_from(time.nseconds()).ok());
    let age = captured.zip(now).map(|(captured, now)| (now.nseconds() as f64 - captured.nseconds() as f64) * 1e-9);
    (stamp, age)
}

/// The pixels of a sample without the padding of its rows.
fn image(sample: &gst::Sample) -> Option<Rgb> {
    let caps = sample.caps()?.structure(0)?;
    let side = |name: &str| caps.get::<i32>(name).ok().filter(|side| (1..=LONGEST_SIDE).contains(side));
    let (width, height) = (side("width")?, side("height")?);
    let buffer = sample.buffer()?.map_readable().ok()?;
    // Rows begin at multiples of four bytes.
    let row = 3 * width as usize;
    let stride = row.next_multiple_of(4);
    let mut bytes = Vec::with_capacity(row * height as usize);
    for line in 0..height as usize {
        bytes.extend_from_slice(buffer.get(line * stride..line * stride + row)?);
    }
    Rgb::from_raw(width as u32, height as u32, bytes).ok()
}

/// What is wrong with a description of a pipeline. Where a value cannot be set, the library quotes it, and it may be a password.
fn invalid(error: &gst::glib::Error) -> SourceError {
    SourceError::Pipeline(match error.kind::<gst::ParseError>() {
        Some(gst::ParseError::CouldNotSetProperty) => "a property cannot have its value".to_owned(),
        // These quote names of elements and properties alone.
        Some(gst::ParseError::NoSuchElement | gst::ParseError::NoSuchProperty) => {
            error.message().lines().next().unwrap_or_default().to_owned()
        }
        Some(kind) => words("the description", &kind),
        None => failure(error),
    })
}

/// What failed, by the kind of the error: its text may contain values of properties, among them addresses and passwords.
fn failure(error: &gst::glib::Error) -> String {
    let kinds = [
        error.kind::<gst::ResourceError>().map(|kind| words("a source or a device", &kind)),
        error.kind::<gst::StreamError>().map(|kind| words("the stream", &kind)),
        error.kind::<gst::CoreError>().map(|kind| words("the pipeline", &kind)),
        error.kind::<gst::LibraryError>().map(|kind| words("the library", &kind)),
    ];
    let known = kinds.into_iter().flatten().next().unwrap_or_else(|| "an unknown error".to_owned());
    format!("GStreamer reports: {known}; `GST_DEBUG=2` shows more, passwords included")
}

/// `OpenRead` of a file becomes "a file: open read".
fn words(what: &str, kind: &dyn std::fmt::Debug) -> String {
    let mut text = format!("{what}:");
    for letter in format!("{kind:?}").chars() {
        if letter.is_ascii_uppercase() {
            text.push(' ');
        }
        text.push(letter.to_ascii_lowercase());
    }
    text
}
