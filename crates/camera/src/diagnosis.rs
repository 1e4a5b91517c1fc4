//! Why there is no image although nothing has failed: what arrived instead, and what to do. No I/O.

use std::net::SocketAddr;

use spf_drone::frames::FrameStats;

use crate::CameraUrl;
use crate::arrivals::{Arrivals, Kind};
use crate::failure::SourceError;
use crate::shared::{CameraReport, CameraState, Failure};

/// What makes a sender repeat the parameter sets.
const REPEAT: &str = "let the sender repeat them before each key frame: with GStreamer `rtph264pay config-interval=-1`, with x264 \
                      `repeat-headers=1`, with `ffmpeg -c copy` `-bsf:v h264_mp4toannexb,dump_extra`; or use rtsp://, which transmits them apart";
/// What makes a key frame come.
const KEY_FRAMES: &str = "set the camera to a key frame (also called I-frame, IDR or GOP) each second: with ffmpeg `-g 15` at 15 frames/s, \
                          with x264enc `key-int-max=15`";

/// What makes an encoder send no B-frames.
const NO_B_FRAMES: &str = "switch B-frames off, the profile may stay High: with ffmpeg `-bf 0` or `-tune zerolatency`, with x264enc \
                           `tune=zerolatency`, in a camera's web page B-frames 0";
/// What to do about a clock that disagrees with ours.
const CLOCK: &str = "set the clocks of camera and machine by NTP, or measure the delay with `spf camera calibrate` and give it as \
                     --camera-latency (`spf camera test`: --latency), which counts in place of the camera's clock";
/// What to do about timestamps that do not keep time.
const TICKS: &str = "if the link is fast enough (`spf camera test` shows losses; a lower bit rate would help), it is the clock of the camera \
                     that ticks at another rate: give --camera-times arrival (`spf camera test`: --times arrival), by which its timestamps are \
                     not believed";
/// Age above which the pilot flies by no frame, seconds: `max_frame_age` of the envelope.
const HELD: f64 = 1.0;
/// A time of capture that is this far in the future shows a clock that is ahead, seconds.
const AHEAD: f64 = 0.1;

/// What is wrong with images that arrive.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Trouble {
    /// The cause.
    pub why: String,
    /// What to do about it; the same for the same cause.
    pub hint: &'static str,
}

/// What is wrong with the images that arrive, although they can be seen.
#[must_use]
pub fn troubles(report: &CameraReport) -> Vec<Trouble> {
    let mut found = Vec::new();
    let mut add = |why: String, hint: &'static str| found.push(Trouble { why, hint });
    if report.b_frames > 0 {
        add("the video has B-frames: its images come late and out of order, and most cannot be shown".to_owned(), NO_B_FRAMES);
    }
    match report.own_age {
        Some(age) if report.own_clock && age > HELD => add(
            format!(
                "by the camera's clock its frames are {age:.1} s old when they arrive, although they are not held back: its clock is behind \
                 that of this machine, and no drone flies by frames older than {HELD} s"
            ),
            CLOCK,
        ),
        Some(age) if age < -AHEAD => {
            add(format!("the camera's clock is {:.1} s or more ahead of that of this machine, and is not used", -age), CLOCK);
        }
        Some(age) if !report.own_clock && age > HELD => {
            add(format!("the camera's clock is {age:.0} s behind that of this machine, and is not used"), CLOCK);
        }
        _ => {}
    }
    if let Some(rate) = report.tick_rate {
        let effect =
            if rate < 1.0 { "so that its frames count as ever older" } else { "so that its frames may count as too young" };
        add(format!("the camera's timestamps advance by {rate:.2} s per second, {effect}"), TICKS);
    }
    found
}

/// The failure of a port at which other packets arrive than its address says.
pub(crate) fn other_packets(address: SocketAddr, arrivals: &Arrivals, kind: Kind) -> SourceError {
    SourceError::Packets { packets: arrivals.packets(), what: kind.words().to_owned(), hint: instead(address, kind) }
}

/// How to receive what arrives, or what to send instead.
fn instead(address: SocketAddr, kind: Kind) -> String {
    let port = address.port();
    match kind {
        Kind::Ts => format!("receive them by udp-ts://{}", short(address)),
        Kind::Rtp => format!("receive them by udp-rtp://{}", short(address)),
        Kind::RtpTs => format!(
            "send MPEG-TS without RTP, and receive it by udp-ts://{}: with ffmpeg `-f mpegts` in the place of `-f rtp_mpegts`, with \
             GStreamer without rtpmp2tpay",
            short(address)
        ),
        Kind::RtpJpeg => "set the camera to H.264, or use its rtsp:// address, by which JPEG in RTP is read".to_owned(),
        Kind::RtpAudio => format!("video and audio have a port each: send the video to port {port}, and no audio"),
        Kind::Rtcp => {
            format!("the video itself goes to another port, as a rule one below: udp-rtp://:{}", port.saturating_sub(1))
        }
        Kind::Bare | Kind::Jpeg => format!(
            "put the video into RTP or MPEG-TS: with GStreamer `h264parse ! rtph264pay config-interval=-1` before udpsink, with ffmpeg \
             `-f rtp rtp://ADDRESS:{port}`"
        ),
        Kind::Text | Kind::Unknown => format!(
            "something else sends to port {port}, such as the telemetry of a craft: send H.264 there, in RTP for udp-rtp:// or in \
             MPEG-TS for udp-ts://, or use another port"
        ),
    }
}

/// As it is written in an address.
fn short(address: SocketAddr) -> String {
    if address.ip().is_unspecified() { format!(":{}", address.port()) } else { address.to_string() }
}

/// Why a camera has shown no image within `seconds`, and what to do.
#[must_use]
pub fn no_image(url: &CameraUrl, report: &CameraReport, stats: &FrameStats, seconds: u64) -> Failure {
    // One that was overcome is no reason.
    if let CameraState::Failed(failure) = &report.state {
        return failure.clone();
    }
    let failure = |why: String, hint: String| Failure { why, hint: Some(hint) };
    let seen = progress(report, stats);
    if stats.decoded == 0
        && let Some(Trouble { why, hint }) = troubles(report).into_iter().next().filter(|_| report.b_frames > 0)
    {
        return failure(why, hint.to_owned());
    }
    if stats.refused > 0 && stats.decoded == 0 {
        return failure(
            format!("the decoder rejects what arrives ({seen})"),
            "the images are damaged, or of a kind that is not read: try another encoder or its profile Baseline".to_owned(),
        );
    }
    match (url, &report.arrivals) {
        (CameraUrl::UdpRtp(address) | CameraUrl::UdpTs(address), None) => nothing_arrived(*address, seconds),
        (CameraUrl::UdpRtp(address) | CameraUrl::UdpTs(address), Some(arrivals)) => match arrivals.seem() {
            None => nothing_arrived(*address, seconds),
            Some(kind) => at_a_port(url, *address, kind, arrivals, report, stats, seconds),
        },
        _ if stats.video.skipped > 0 => failure(format!("no key frame within {seconds} s ({seen})"), KEY_FRAMES.to_owned()),
        (CameraUrl::V4l2(_), _) => failure(
            format!("no image within {seconds} s"),
            "plug the camera in again, or try it with another program, such as ffplay".to_owned(),
        ),
        (CameraUrl::Tello(_), _) => {
            failure(format!("no image within {seconds} s"), "check that no firewall blocks UDP port 11111".to_owned())
        }
        (CameraUrl::Gstreamer(_), _) => failure(
            format!("no image within {seconds} s"),
            "try the pipeline with gst-launch-1.0 and autovideosink behind it".to_owned(),
        ),
        (CameraUrl::File { .. }, _) => failure("the film has no image".to_owned(), "check that it contains video".to_owned()),
        (CameraUrl::Rtsp { .. } | CameraUrl::Mjpeg(_), _) => failure(
            format!("no image within {seconds} s ({seen})"),
            "the server answers slowly, or sends nothing: try the address with another program, such as ffplay or VLC".to_owned(),
        ),
    }
}

fn nothing_arrived(address: SocketAddr, seconds: u64) -> Failure {
    let port = address.port();
    Failure {
        why: format!("no packet arrived at UDP port {port} within {seconds} s"),
        hint: Some(format!(
            "check that the camera sends to this machine (`ip address` lists its addresses) and to port {port}, and that no firewall \
             blocks it; `sudo tcpdump -ni any udp port {port}` shows what reaches this machine"
        )),
    }
}

/// Packets arrived, but no image that can be decoded.
fn at_a_port(
    url: &CameraUrl,
    address: SocketAddr,
    kind: Kind,
    arrivals: &Arrivals,
    report: &CameraReport,
    stats: &FrameStats,
    seconds: u64,
) -> Failure {
    let expected = if matches!(url, CameraUrl::UdpRtp(_)) { Kind::Rtp } else { Kind::Ts };
    let packets = arrivals.packets();
    let failure = |why: String, hint: String| Failure { why, hint: Some(hint) };
    let images = stats.video.units + stats.video.skipped;
    // Whatever the packets seem to be, images were found in them.
    if kind != expected && images == 0 {
        return failure(format!("{packets} packets arrived, but they seem to be {}", kind.words()), instead(address, kind));
    }
    if images > 0 && report.lacks_parameters {
        return failure(
            format!(
                "{packets} packets with {images} images of H.264 arrived within {seconds} s, but without parameter sets (SPS, PPS)"
            ),
            REPEAT.to_owned(),
        );
    }
    if images > 0 {
        let damage = if stats.video.gaps > 0 || report.packets_lost > 0 { ", and losses" } else { "" };
        return failure(
            format!("{packets} packets with {images} images arrived within {seconds} s, but no whole key frame{damage}"),
            KEY_FRAMES.to_owned(),
        );
    }
    if expected == Kind::Ts {
        let others: Vec<&str> = report.other_streams.iter().map(|kind| stream(*kind)).collect();
        return if others.is_empty() {
            failure(
                format!("{packets} packets of MPEG-TS arrived, but no table that says what is in them"),
                "let the sender repeat its tables (PAT, PMT): with ffmpeg `-mpegts_flags resend_headers`".to_owned(),
            )
        } else {
            failure(
                format!("{packets} packets of MPEG-TS arrived, with {}, but without H.264", others.join(", ")),
                "set the camera to H.264, or let ffmpeg convert it: `ffmpeg -i ADDRESS -c:v libx264 -tune zerolatency -pix_fmt yuv420p \
                 -g 15 -f mpegts udp://127.0.0.1:5600?pkt_size=1316`"
                    .to_owned(),
            )
        };
    }
    failure(
        format!("{packets} RTP packets arrived, of payload type {}, but no H.264 was found in them", arrivals.payload_types()),
        "they may be audio, or video of another codec: set the camera to H.264, and send its video alone to this port".to_owned(),
    )
}

/// A kind of stream (ISO/IEC 13818-1, table 2-34).
const fn stream(kind: u8) -> &'static str {
    match kind {
        0x01 | 0x02 => "video in MPEG-2",
        0x03 | 0x04 | 0x0f | 0x11 | 0x81 => "audio",
        0x10 => "video in MPEG-4 part 2",
        0x24 => "video in H.265",
        0x05..=0x0e | 0x15 => "data",
        _ => "a stream of an unknown kind",
    }
}

/// What has come so far, in a few words.
#[must_use]
pub fn progress(report: &CameraReport, stats: &FrameStats) -> String {
    let mut parts = Vec::new();
    if let Some(packets) = report.arrivals.as_ref().map(Arrivals::packets).or(report.packets) {
        parts.push(format!("{packets} packets"));
    }
    let images = stats.video.units + stats.video.skipped;
    if images > 0 {
        parts.push(format!("{images} images"));
    }
    if stats.video.damaged > 0 {
        parts.push(format!("{} damaged", stats.video.damaged));
    }
    if stats.refused > 0 {
        parts.push(format!("{} rejected by the decoder", stats.refused));
    }
    if images > 0 && stats.decoded == 0 && stats.refused == 0 {
        parts.push(
            match (report.lacks_parameters, stats.video.units) {
                (true, _) => "waiting for parameter sets",
                (false, 0) => "waiting for a key frame",
                (false, _) => "waiting for the decoder",
            }
            .to_owned(),
        );
    }
    match (parts.is_empty(), &report.last_failure) {
        (true, None) => "nothing yet".to_owned(),
        (true, Some(failure)) if matches!(report.state, CameraState::Failed(_)) => format!("{failure}; trying again"),
        (true, Some(failure)) => format!("nothing since the last failure ({failure})"),
        (false, _) => parts.join(", "),
    }
}

#[cfg(test)]
mod tests {
    use spf_drone::frames::VideoStats;

    use super::*;

    fn arrivals(packet: &[u8], count: u64) -> Option<Arrivals> {
        let mut arrivals = Arrivals::default();
        (0..count).for_each(|_| arrivals.push(packet));
        Some(arrivals)
    }

    fn of(url: &str, report: &CameraReport, stats: &FrameStats) -> (String, String) {
        let Failure { why, hint } = no_image(&url.parse().unwrap(), report, stats, 15);
        (why, hint.unwrap())
    }

    const RTP: &[u8] = &[0x80, 96, 0, 1, 0, 0, 0, 2, 0, 0, 0, 3, 0x41, 1];

    #[test]
    fn what_arrived_is_told_with_what_to_do() {
        let ts = [&[0x47][..], &[0; 187]].concat();
        let mut stats = FrameStats::default();
        let report = |arrivals| CameraReport { arrivals, ..CameraReport::default() };
        let (why, hint) = of("udp-rtp://:5600", &CameraReport::default(), &stats);
        assert!(
            why == "no packet arrived at UDP port 5600 within 15 s" && hint.contains("tcpdump -ni any udp port 5600"),
            "{hint}"
        );
        let (why, hint) = of("udp-rtp://:5600", &report(arrivals(&ts, 12)), &stats);
        assert_eq!(why, "12 packets arrived, but they seem to be MPEG-TS (each packet begins with 0x47)");
        assert_eq!(hint, "receive them by udp-ts://:5600");
        let (why, hint) = of("udp-ts://239.1.2.3:5600", &report(arrivals(RTP, 12)), &stats);
        assert_eq!(
            (why.as_str(), hint.as_str()),
            ("12 packets arrived, but they seem to be RTP", "receive them by udp-rtp://239.1.2.3:5600")
        );
        let (why, _) = of("udp-rtp://:5600", &report(arrivals(RTP, 12)), &stats);
        assert_eq!(why, "12 RTP packets arrived, of payload type 96, but no H.264 was found in them");
        let (why, _) = of("udp-ts://:5600", &report(arrivals(&ts, 9)), &stats);
        assert!(why.ends_with("but no table that says what is in them"), "{why}");
        let other = CameraReport { other_streams: vec![0x02, 0x0f], ..report(arrivals(&ts, 9)) };
        assert!(of("udp-ts://:5600", &other, &stats).0.ends_with("with video in MPEG-2, audio, but without H.264"));
        stats.video.skipped = 40;
        let (why, hint) = of("udp-rtp://:5600", &report(arrivals(RTP, 99)), &stats);
        assert!(
            why.contains("99 packets with 40 images") && why.contains("no whole key frame") && hint.contains("key-int-max"),
            "{why}"
        );
        let lacking = CameraReport { lacks_parameters: true, ..report(arrivals(RTP, 99)) };
        let (why, hint) = of("udp-rtp://:5600", &lacking, &stats);
        assert!(why.contains("without parameter sets") && hint.contains("config-interval=-1"), "{why}");
        assert_eq!(progress(&lacking, &stats), "99 packets, 40 images, waiting for parameter sets");
        let (why, _) = of("rtsp://cam/x", &CameraReport::default(), &stats);
        assert_eq!(why, "no key frame within 15 s (40 images, waiting for a key frame)");
    }

    #[test]
    fn b_frames_are_named_and_not_their_profile() {
        let report = CameraReport { b_frames: 9, ..CameraReport::default() };
        let [Trouble { why, hint }] = &troubles(&report)[..] else { panic!("{:?}", troubles(&report)) };
        assert!(why.contains("B-frames") && hint.contains("`-bf 0`") && hint.contains("may stay High"), "{why}: {hint}");
        let stats = FrameStats { refused: 5, ..FrameStats::default() };
        assert_eq!(of("udp-rtp://:5600", &report, &stats).0, *why);
        assert!(troubles(&CameraReport::default()).is_empty());
    }

    #[test]
    fn a_clock_that_is_behind_or_ticks_at_another_rate_is_named_with_the_flag_that_helps() {
        let told = |own_clock, own_age, tick_rate| {
            let found = troubles(&CameraReport { own_clock, own_age, tick_rate, ..CameraReport::default() });
            found.into_iter().map(|Trouble { why, hint }| format!("{why}: {hint}")).collect::<Vec<_>>()
        };
        let behind = told(true, Some(30.2), None);
        assert!(
            behind[0].contains("30.2 s old") && behind[0].contains("clock is behind") && behind[0].contains("--camera-latency")
        );
        let [ahead] = &told(false, Some(-3.0), None)[..] else { panic!() };
        assert!(ahead.contains("3.0 s or more ahead") && ahead.contains("is not used"), "{ahead}");
        assert!(told(false, Some(3600.0), None)[0].contains("3600 s behind"));
        let slow = told(false, None, Some(0.5));
        assert!(slow[0].contains("advance by 0.50 s per second, so that its frames count as ever older"), "{slow:?}");
        assert!(slow[0].contains("--camera-times arrival"), "{slow:?}");
        assert_eq!(told(true, Some(0.3), None), Vec::<String>::new());
    }

    #[test]
    fn the_filters_of_ffmpeg_that_repeat_parameter_sets_suit_an_mp4_file() {
        // Of MP4, dump_extra alone would repeat sets of another form.
        assert!(REPEAT.contains("-bsf:v h264_mp4toannexb,dump_extra`"), "{REPEAT}");
    }

    #[test]
    fn a_failure_is_blamed_only_until_it_is_overcome() {
        let failure = Failure { why: "the server answers 503".to_owned(), hint: Some("wait".to_owned()) };
        let stats = FrameStats { video: VideoStats { skipped: 40, ..VideoStats::default() }, ..FrameStats::default() };
        let report = |state| CameraReport { state, last_failure: Some(failure.clone()), ..CameraReport::default() };
        assert_eq!(of("rtsp://cam/x", &report(CameraState::Failed(failure.clone())), &stats).0, failure.why);
        let (why, hint) = of("rtsp://cam/x", &report(CameraState::Receiving), &stats);
        assert!(why.starts_with("no key frame within 15 s") && hint.contains("-g 15"), "{why}: {hint}");
    }

    #[test]
    fn progress_says_what_is_waited_for() {
        let mut stats = FrameStats::default();
        assert_eq!(progress(&CameraReport::default(), &stats), "nothing yet");
        let failure = Failure { why: "the server answers 503".to_owned(), hint: None };
        let failed =
            CameraReport { state: CameraState::Failed(failure.clone()), last_failure: Some(failure), ..CameraReport::default() };
        assert_eq!(progress(&failed, &stats), "the server answers 503; trying again");
        stats.video.skipped = 3;
        let report = CameraReport { arrivals: arrivals(RTP, 7), ..CameraReport::default() };
        assert_eq!(progress(&report, &stats), "7 packets, 3 images, waiting for a key frame");
    }
}
