//! RTSP, by the crate `retina`. Within the connection (`rtsp://`), what the camera sends is [repaired](repair) before it.

mod relay;
mod repair;

use std::net::Ipv4Addr;
use std::sync::Arc;
use std::time::{Duration, SystemTime, UNIX_EPOCH};

use futures_util::StreamExt;
use retina::client::{
    Demuxed, PlayOptions, Session, SessionGroup, SessionOptions, SetupOptions, TcpTransportOptions, Transport as RtspTransport,
    UdpTransportOptions, UnknownRtcpSsrcPolicy,
};
use retina::codec::{CodecItem, FrameFormat, VideoFrame};
use spf_drone::frames::VideoStats;
use spf_media::h264::AccessUnit;
use url::Url;

use super::{SILENCE, runtime, unless_stopped};
use crate::address::{Server, Transport};
use crate::failure::{SourceError, reason};
use crate::feed::{Feed, Packets};

/// Time for each answer of the server.
const ANSWER_TIME: Duration = Duration::from_secs(10);
/// Time for saying goodbye, without which some cameras keep the session for a minute and refuse the next.
const GOODBYE_TIME: Duration = Duration::from_millis(500);
/// Seconds from 1900, when the time of NTP begins, to 1970 (RFC 5905, figure 4).
const NTP_EPOCH: f64 = 2_208_988_800.0;
/// A camera whose timestamps go this far from the arrivals within one frame, seconds, has set its clock: what it told of the wall clock
/// before is void.
const CLOCK_SET: f64 = 1.0;
/// The usual port.
const PORT: u16 = 554;

/// Receives from a server.
pub(super) fn receive(server: &Server, transport: Transport, feed: &mut Feed) -> Result<(), SourceError> {
    runtime()?.block_on(async {
        let group = Arc::new(SessionGroup::default());
        let received = session(server, transport, &group, feed).await;
        // Sent when the session is dropped, in the background.
        drop(tokio::time::timeout(GOODBYE_TIME, group.await_teardown()).await);
        received
    })
}

async fn session(server: &Server, transport: Transport, group: &Arc<SessionGroup>, feed: &mut Feed) -> Result<(), SourceError> {
    let explained = |error| failure(&error, server);
    let Some(opened) = unless_stopped(feed, open(server, transport, group.clone()), 3 * ANSWER_TIME).await else { return Ok(()) };
    let (mut stream, is_jpeg) = opened.ok_or_else(SourceError::no_answer)??;
    let mut tally = VideoStats::default();
    let mut packets = Packets::default();
    let (mut awaits_key, mut clock, mut before) = (true, None, None::<(f64, f64)>);
    let mut last_image = feed.now();
    loop {
        let Some(item) = unless_stopped(feed, stream.next(), SILENCE).await else { return Ok(()) };
        let item = item.ok_or(SourceError::Silent(SILENCE.as_secs()))?.ok_or(SourceError::Ended)?.map_err(explained)?;
        let at = feed.now();
        match item {
            CodecItem::VideoFrame(frame) => {
                last_image = at;
                let loss = u64::from(frame.loss());
                packets.lost += loss;
                tally.gaps += u64::from(loss > 0);
                // After a loss, frames up to the next key frame would be shown with errors.
                let key = is_jpeg || frame.is_random_access_point();
                awaits_key = (awaits_key || loss > 0) && !key;
                if awaits_key {
                    tally.skipped += 1;
                } else {
                    tally.units += 1;
                }
                feed.tally(tally, packets);
                let times = (frame.timestamp().elapsed_secs(), at.as_secs_f64());
                let goes_on = |(stamp, at): (f64, f64)| ((times.0 - stamp) - (times.1 - at)).abs() < CLOCK_SET;
                clock = clock.filter(|_| before.replace(times).is_none_or(goes_on));
                if !awaits_key {
                    let stamp = (times.0 * 1e9) as i64;
                    let age = clock.as_ref().and_then(|clock: &SenderClock| clock.age(&frame));
                    tracing::trace!("frame with age {age:?} s by the camera's clock");
                    if is_jpeg {
                        feed.jpeg(at, Some(stamp), age, frame.into_data());
                    } else {
                        feed.unit(at, Some(stamp), age, AccessUnit { key, annex_b: frame.into_data() })?;
                    }
                }
            }
            // Reports alone are silence, too. The library keeps the packets of an image that never ends; this is how many they can be.
            CodecItem::Rtcp(_) if at.since(last_image) > SILENCE => return Err(SourceError::Silent(SILENCE.as_secs())),
            CodecItem::Rtcp(report) => clock = SenderClock::of(&report).or(clock),
            _ => {}
        }
    }
}

/// Opens the first stream with video that can be decoded, and starts it.
async fn open(server: &Server, transport: Transport, group: Arc<SessionGroup>) -> Result<(Demuxed, bool), SourceError> {
    let explained = |error| failure(&error, server);
    let invalid = || SourceError::connection("the address is invalid".to_owned(), None);
    let mut url: Url = server.url.parse().map_err(|_| invalid())?;
    if transport == Transport::Tcp {
        let host = url.host_str().ok_or_else(invalid)?.trim_start_matches('[').trim_end_matches(']');
        let port = relay::to(host, url.port().unwrap_or(PORT)).await;
        let port = port.map_err(|error| SourceError::connection(format!("cannot connect: {error}"), Some(&error)))?;
        // As behind a router that forwards a port: the camera does not see its own name.
        url.set_ip_host(Ipv4Addr::LOCALHOST.into()).and_then(|()| url.set_port(Some(port))).map_err(|()| invalid())?;
    }
    let credentials = server.credentials.as_ref();
    let credentials =
        credentials.map(|known| retina::client::Credentials { username: known.user.clone(), password: known.password.clone() });
    let options = SessionOptions::default().creds(credentials).session_group(group).user_agent("spf".to_owned());
    let mut session = Session::describe(url, options).await.map_err(explained)?;
    let videos = || session.streams().iter().enumerate().filter(|(_, stream)| stream.media() == "video");
    let Some((index, is_jpeg)) = videos().find_map(|(index, stream)| match stream.encoding_name() {
        "h264" => Some((index, false)),
        "jpeg" => Some((index, true)),
        _ => None,
    }) else {
        return Err(match videos().next() {
            Some((_, stream)) if stream.encoding_name() == "h265" => SourceError::Codec("H.265".to_owned()),
            Some((_, stream)) => {
                SourceError::Codec(stream.encoding_name().chars().filter(char::is_ascii_graphic).take(20).collect())
            }
            None => SourceError::Connection {
                why: "the server has no video at this path".to_owned(),
                hint: "check the path; the camera's manual, its web page or an ONVIF program names that of its video",
            },
        });
    };
    let transport = match transport {
        Transport::Tcp => RtspTransport::Tcp(TcpTransportOptions::default()),
        Transport::Udp => RtspTransport::Udp(UdpTransportOptions::default()),
    };
    let setup = SetupOptions::default().transport(transport).frame_format(FrameFormat::SIMPLE);
    session.setup(index, setup).await.map_err(explained)?;
    // Timestamps may jump: `CaptureClock` makes of them what they are worth.
    let play = PlayOptions::default().unknown_rtcp_ssrc(UnknownRtcpSsrcPolicy::Default);
    let stream = session.play(play).await.map_err(explained)?.demuxed().map_err(explained)?;
    Ok((stream, is_jpeg))
}

/// The camera's wall clock at a timestamp of the stream, from a sender report (RFC 3550, section 6.4.1).
struct SenderClock {
    /// Seconds since 1970.
    wall: f64,
    /// Seconds of the stream.
    stream: f64,
}

impl SenderClock {
    fn of(report: &retina::rtcp::ReceivedCompoundPacket) -> Option<Self> {
        let sender = report.pkts().find_map(|packet| packet.as_sender_report().ok().flatten())?;
        let stream = report.rtp_timestamp()?.elapsed_secs();
        let ntp = sender.ntp_timestamp().0;
        // Zero stands for a sender without a clock.
        (ntp != 0).then(|| Self { wall: unix_seconds(ntp), stream })
    }

    /// Age of a frame, seconds.
    fn age(&self, frame: &VideoFrame) -> Option<f64> {
        let captured = self.wall + frame.timestamp().elapsed_secs() - self.stream;
        Some(SystemTime::now().duration_since(UNIX_EPOCH).ok()?.as_secs_f64() - captured)
    }
}

/// Seconds since 1970 of an NTP timestamp, which has 32 bits before the point and 32 behind it.
fn unix_seconds(ntp: u64) -> f64 {
    ntp as f64 / 4_294_967_296.0 - NTP_EPOCH
}

/// What went wrong, in one line without address and password.
fn failure(error: &retina::Error, server: &Server) -> SourceError {
    match error.status_code() {
        Some(401) => return SourceError::Refused { given: server.credentials.is_some() },
        Some(code @ 300..) => return SourceError::Status { code, reason: reason(code) },
        _ => {}
    }
    let text = error.to_string();
    // The library tells its causes in words only.
    let number = text.split_once("(os error ").and_then(|(_, rest)| rest.split_once(')')?.0.parse().ok());
    let system = number.map(std::io::Error::from_raw_os_error);
    let mut line = without_addresses(text.lines().next().unwrap_or_default());
    if let Some(known) = &server.credentials {
        for secret in [&known.password, &known.user].into_iter().filter(|secret| !secret.is_empty()) {
            line = line.replace(secret.as_str(), "…");
        }
    }
    SourceError::connection(line, system.as_ref())
}

/// A text without addresses, however they are spelled, and without whatever follows a question mark.
fn without_addresses(text: &str) -> String {
    let shown = |word| if str::contains(word, "://") { "…" } else { word.split('?').next().unwrap_or_default() };
    text.split(' ').map(shown).collect::<Vec<_>>().join(" ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_address_is_quoted() {
        let text =
            r#"DESCRIBE response at rtsp://cam/s?user=admin&pwd=gr%C3%BCn has bad Content-Base "rtsp://10.0.0.7:554/s" /s?pwd=x"#;
        assert_eq!(without_addresses(text), "DESCRIBE response at … has bad Content-Base … /s");
    }

    #[test]
    fn times_of_ntp_begin_in_1900() {
        assert_eq!(unix_seconds(0x83aa_7e80_0000_0000), 0.0);
        // 26 November 2026, 10:20:00.5 UTC.
        let at = 1_795_688_400_u64 + 2_208_988_800;
        assert!((unix_seconds(at << 32 | 1 << 31) - 1_795_688_400.5).abs() < 1e-6);
    }
}
