//! What arrived while a camera was watched, and whether a drone can fly by it.

use std::path::Path;
use std::time::{Duration, Instant};

use spf_camera::diagnosis::{Trouble, no_image, troubles};
use spf_camera::{Camera, CameraReport, CameraState, CameraUrl};
use spf_drone::examine::{Check, Finding};
use spf_drone::frames::{FrameStats, Frames as _, VideoStats};
use spf_media::Rgb;

use super::{FIRST_FRAME, POLL_INTERVAL};
use crate::printer::one_line;

/// What helps against losses.
pub(super) const LOSSES: &str = "rtsp:// (by TCP) loses nothing; else use a cable or a better link, fewer pixels and a lower bit rate, or \
                                 a key frame every 0.2 s";
/// Frames per second from which a camera is fine, and below which no drone flies by it.
const RATES: (f64, f64) = (10.0, 5.0);
/// Age of most frames at arrival up to which a camera is fine, and above which the pilot holds most of the time, seconds. The second is
/// the limit at which the envelope holds, `max_frame_age`.
const AGES: (f64, f64) = (0.5, 1.0);
/// Share of packets lost from which no drone flies: with 5 % and a key frame per second, hardly any second passes without a gap
/// (docs/reference/cameras.md).
const MOST_LOST: f64 = 0.05;

/// What arrived while a camera was watched.
pub(super) struct Watched {
    pub(super) image: Option<Rgb>,
    /// Time watched after the first image, and frames in it.
    watched: Duration,
    frames: u32,
    /// Ages of frames at their arrival, seconds, sorted.
    ages: Vec<f64>,
    /// All since the camera was started, and what of it was there before it was watched.
    pub(super) stats: FrameStats,
    before: FrameStats,
}

impl Watched {
    /// Watches a camera for this long, unless it has no image.
    pub(super) fn of(camera: &Camera, time: Duration) -> Self {
        let store = camera.frames();
        let before = store.tally();
        let (since, mut ages, mut frames) = (Instant::now(), Vec::new(), 0);
        let has_ended = || camera.report().state == CameraState::Ended;
        while store.newest().is_some() && since.elapsed() < time && !has_ended() {
            if let Some(meta) = store.take_new_frame() {
                frames += 1;
                ages.push(meta.received.since(meta.captured).as_secs_f64());
            }
            std::thread::sleep(POLL_INTERVAL);
        }
        ages.sort_by(f64::total_cmp);
        let image = store.newest().map(|(_, photo)| photo.pixels().as_ref().clone());
        Self { image, watched: since.elapsed(), frames, ages, stats: store.tally(), before }
    }

    /// How many of something there were per second.
    fn per_second(&self, count: f64) -> f64 {
        let watched = self.watched.as_secs_f64();
        if watched > 0.0 { count / watched } else { 0.0 }
    }

    /// Frames per second.
    fn rate(&self) -> f64 {
        self.per_second(f64::from(self.frames))
    }

    /// Median and greatest age of a frame at its arrival, seconds.
    fn age(&self) -> Option<(f64, f64)> {
        self.ages.get(self.ages.len() / 2).copied().zip(self.ages.last().copied())
    }

    /// The row of `spf doctor`. `mismatch` says why images of a size do not belong to the calibration.
    pub(super) fn check(&self, camera: &Camera, url: &CameraUrl, mismatch: impl Fn((u32, u32)) -> Option<String>) -> Check {
        let report = camera.report();
        let Some(image) = &self.image else {
            let failure = no_image(url, &report, &self.stats, FIRST_FRAME.as_secs());
            let found = format!("{}: {}", one_line(&url.to_string()), one_line(&failure.why));
            return Check::new("camera", Finding::Bad, found, failure.hint.as_deref());
        };
        let size = (image.width(), image.height());
        let judged = self.judge(&report);
        let (worst, advice) =
            judged.iter().max_by_key(|(finding, ..)| *finding).map_or((Finding::Good, ""), |(f, _, a)| (*f, *a));
        let found: Vec<&str> = judged.iter().map(|(_, found, _)| found.as_str()).collect();
        let found = format!("{}×{}, {}", size.0, size.1, found.join(", "));
        match mismatch(size) {
            Some(words) => {
                Check::new("camera", worst.max(Finding::Warning), format!("{found}; {words}"), Some("calibrate it at this size"))
            }
            None => Check::new("camera", worst, found, Some(advice)),
        }
    }

    /// Rate, age and losses, each with its limits, and with what helps. What is wrong is as bad as its effects, and comes last.
    fn judge(&self, report: &CameraReport) -> Vec<(Finding, String, &'static str)> {
        let finding = |good: bool, bad: bool| match (good, bad) {
            (true, _) => Finding::Good,
            (_, true) => Finding::Bad,
            _ => Finding::Warning,
        };
        let rate = self.rate();
        let mut judged = vec![(
            finding(rate >= RATES.0, rate < RATES.1),
            format!("{rate:.1} frames/s (fine from {:.0}, too few below {:.0})", RATES.0, RATES.1),
            "set the camera to more frames per second, or reduce its size or the load of this machine (`spf camera test` shows which)",
        )];
        if let Some((age, _)) = self.age() {
            let basis = if report.own_clock { "by the camera's clock" } else { "assumed" };
            judged.push((
                finding(age <= AGES.0, age > AGES.1),
                format!("frames {age:.2} s old ({basis}; fine up to {} s, held above {} s)", AGES.0, AGES.1),
                "set the clocks of camera and machine by NTP, or measure the delay with `spf camera calibrate` and give it as \
                 --camera-latency; a smaller image, a shorter buffer of the camera or a cable make it shorter",
            ));
        }
        let gaps = self.stats.video.gaps;
        let all = report.packets.map(|received| (received + report.packets_lost).max(1));
        let share = all.map_or(0.0, |all| report.packets_lost as f64 / all as f64);
        let lost = match all {
            Some(all) => format!("{} of {all} packets lost", report.packets_lost),
            None => format!("{} packets known to be lost", report.packets_lost),
        };
        judged.push((
            finding(gaps == 0, share >= MOST_LOST),
            format!("{lost}, {gaps} gaps (fine without gaps, too many from {:.0} % lost)", 100.0 * MOST_LOST),
            LOSSES,
        ));
        let worst = judged.iter().map(|(finding, ..)| *finding).fold(Finding::Warning, Finding::max);
        judged.extend(troubles(report).into_iter().map(|Trouble { why, hint }| (worst, why, hint)));
        judged
    }

    /// The table of `spf camera test`; `first`: time until the first image.
    pub(super) fn rows(&self, report: &CameraReport, first: Duration, output: &Path) -> Vec<Vec<String>> {
        let row = |what: &str, found: String| vec![what.to_owned(), found];
        let (width, height) = self.image.as_ref().map_or((0, 0), |image| (image.width(), image.height()));
        let (watched, rate) = (self.watched.as_secs_f64(), self.rate());
        let mut rows = vec![
            row("image", format!("{width}×{height}, {}", report.codec.unwrap_or("unknown codec"))),
            row(
                "rate",
                format!("{rate:.1} frames/s in {watched:.1} s{}, first frame after {:.1} s", self.came(), first.as_secs_f64()),
            ),
        ];
        if let Some((median, worst)) = self.age() {
            let basis = if report.own_clock { "by the camera's clock" } else { "assumed latency and delays" };
            rows.push(row("age", format!("median {median:.2} s, worst {worst:.2} s at arrival ({basis})")));
        }
        let lost = match report.packets {
            Some(received) => {
                let all = (received + report.packets_lost).max(1);
                format!("{} of {all} packets ({:.1} %)", report.packets_lost, 100.0 * report.packets_lost as f64 / all as f64)
            }
            None => format!("{} packets known to be lost (they are not counted)", report.packets_lost),
        };
        rows.push(row("loss", format!("{lost}, {} gaps in the video", self.stats.video.gaps)));
        rows.push(row("omitted", omitted(&self.stats)));
        if report.connections > 1 {
            let why = report.last_failure.as_ref().map_or_else(|| "none".to_owned(), |failure| one_line(&failure.why));
            rows.push(row("connections", format!("{} (last failure: {why})", report.connections)));
        }
        rows.push(row("picture", output.display().to_string()));
        rows
    }

    /// How many images the camera sent, if more than were shown.
    fn came(&self) -> String {
        let came = |of: fn(&FrameStats) -> u64| of(&self.stats).saturating_sub(of(&self.before));
        let unseen = came(|stats| stats.superseded) + came(|stats| stats.video.skipped) + came(|stats| stats.refused);
        if unseen == 0 {
            return String::new();
        }
        format!(" ({:.1} came, the others were omitted)", self.per_second(f64::from(self.frames) + unseen as f64))
    }
}

/// Why images were left out, and how many; in words that explain themselves.
fn omitted(stats: &FrameStats) -> String {
    let FrameStats { superseded, refused, unusable, video: VideoStats { skipped, damaged, .. }, .. } = *stats;
    let reasons: Vec<String> = [
        (superseded, "superseded (a newer one was there before it was decoded: this machine is busy, or they come in bursts or, with B-frames, out of order)"),
        (skipped, "skipped (after a loss, or at the beginning, nothing can be decoded before the next key frame)"),
        (damaged, "damaged (cut off, or not what it seems to be)"),
        (refused, "rejected by the decoder (damaged, or of a kind that it does not know)"),
        (
            unusable,
            "unusable (shown here, but a pilot does not fly by them: without content, such as black, or with parts missing)",
        ),
    ]
    .iter()
    .filter(|(count, _)| *count > 0)
    .map(|(count, why)| format!("{count} {why}"))
    .collect();
    if reasons.is_empty() {
        "no image: none superseded, skipped, damaged, rejected or unusable".to_owned()
    } else {
        reasons.join("; ")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn watched(frames: u32, ages: &[f64], stats: FrameStats) -> Watched {
        let image = Some(Rgb::filled(64, 48, [90; 3]));
        Watched { image, watched: Duration::from_secs(1), frames, ages: ages.to_vec(), stats, before: FrameStats::default() }
    }

    fn worst(watched: &Watched, report: &CameraReport) -> Finding {
        watched.judge(report).iter().map(|(finding, ..)| *finding).max().unwrap()
    }

    #[test]
    fn each_limit_is_named_and_applied() {
        let (stats, report) = (FrameStats::default(), CameraReport::default());
        for (frames, age, expected) in [
            (15, 0.2, Finding::Good),
            (7, 0.2, Finding::Warning),
            (4, 0.2, Finding::Bad),
            (15, 0.7, Finding::Warning),
            (15, 1.2, Finding::Bad),
        ] {
            assert_eq!(worst(&watched(frames, &[age], stats), &report), expected, "{frames} {age}");
        }
        let gap = FrameStats { video: VideoStats { gaps: 1, ..VideoStats::default() }, ..stats };
        let lossy = |packets_lost| CameraReport { packets: Some(1000), packets_lost, ..CameraReport::default() };
        assert_eq!(worst(&watched(15, &[0.2], gap), &lossy(3)), Finding::Warning);
        assert_eq!(worst(&watched(15, &[0.2], gap), &lossy(60)), Finding::Bad);
        let texts: Vec<String> = watched(15, &[0.2], gap).judge(&lossy(3)).into_iter().map(|(_, text, _)| text).collect();
        assert_eq!(
            texts.join(", "),
            "15.0 frames/s (fine from 10, too few below 5), frames 0.20 s old (assumed; fine up to 0.5 s, held above 1 s), 3 of 1003 \
             packets lost, 1 gaps (fine without gaps, too many from 5 % lost)"
        );
    }

    #[test]
    fn the_cause_is_judged_as_its_effects_are_and_advised_about() {
        let (stats, report) = (FrameStats::default(), CameraReport { b_frames: 9, ..CameraReport::default() });
        for (frames, expected) in [(4, Finding::Bad), (15, Finding::Warning)] {
            let judged = watched(frames, &[0.2], stats).judge(&report);
            let (finding, why, hint) = judged.iter().max_by_key(|(finding, ..)| *finding).unwrap();
            assert!(*finding == expected && why.contains("B-frames") && hint.contains("-bf 0"), "{frames}: {why}: {hint}");
        }
    }

    #[test]
    fn what_was_left_out_is_counted_and_explained() {
        let stats = FrameStats {
            superseded: 2,
            refused: 1,
            video: VideoStats { skipped: 3, ..VideoStats::default() },
            ..FrameStats::default()
        };
        let rows = watched(13, &[0.2], stats).rows(&CameraReport::default(), Duration::ZERO, Path::new("x.jpg"));
        let row = |what: &str| rows.iter().find(|row| row[0] == what).unwrap()[1].clone();
        assert!(row("rate").starts_with("13.0 frames/s in 1.0 s (19.0 came, the others were omitted)"), "{}", row("rate"));
        let omitted = row("omitted");
        assert!(
            omitted.starts_with("2 superseded (") && omitted.contains("; 3 skipped (") && omitted.contains("; 1 rejected"),
            "{omitted}"
        );
        let rows = watched(15, &[0.2], FrameStats::default()).rows(&CameraReport::default(), Duration::ZERO, Path::new("x.jpg"));
        assert!(rows.iter().any(|row| row[1].starts_with("no image: none superseded")), "{rows:?}");
    }
}
