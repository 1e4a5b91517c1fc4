//! The answers to the requests of one client. No I/O.

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;

use super::Quirks;
use super::packet::{CLOCK, PAYLOAD_TYPE};
use super::request::Request;

/// Seconds after which a session without a request ends (RFC 2326, section 12.37).
pub(super) const TIMEOUT: u64 = 60;
/// Name of the one stream, relative to the path.
const STREAM: &str = "video";
const METHODS: &str = "OPTIONS, DESCRIBE, SETUP, PLAY, PAUSE, TEARDOWN, GET_PARAMETER, SET_PARAMETER";

/// How RTP and RTCP packets are to travel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Transport {
    /// Within the connection, on these channels.
    Interleaved {
        /// Of RTP.
        rtp: u8,
        /// Of RTCP.
        rtcp: u8,
    },
    /// By UDP, to these ports of the client.
    Udp {
        /// Of RTP.
        rtp: u16,
        /// Of RTCP.
        rtcp: u16,
    },
}

/// What a request asks for, besides its answer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Step {
    /// Nothing.
    None,
    /// Packets are to travel this way; the answer waits for the ports of the server.
    SetUp(Transport),
    /// The video begins.
    Play,
    /// The video pauses.
    Pause,
    /// The session ends.
    End,
}

/// Parameter sets of the video, as the description tells them (RFC 6184, section 8.1).
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(super) struct ParameterSets {
    pub(super) sps: Vec<u8>,
    pub(super) pps: Vec<u8>,
}

/// One client's session.
#[derive(Clone, Debug)]
pub(super) struct Session {
    /// Path of the stream, with a leading slash.
    path: String,
    id: String,
    is_set_up: bool,
}

impl Session {
    /// A session without a transport; `random` makes its name.
    pub(super) fn new(path: &str, random: u64) -> Self {
        Self { path: path.to_owned(), id: format!("{random:016x}"), is_set_up: false }
    }

    /// The answer to a request, and what it asks for. With [`Step::SetUp`] the answer is made by [`Self::set_up`].
    pub(super) fn answer(&self, request: &Request, parameters: Option<&ParameterSets>) -> (String, Step) {
        let refuse = |status: &str| (self.response(request, status, &[], ""), Step::None);
        let ok = |headers: &[String], step| (self.response(request, "200 OK", headers, ""), step);
        if request.require.is_some() {
            return refuse("551 Option not supported");
        }
        if !matches!(request.method.as_str(), "OPTIONS" | "GET_PARAMETER" | "SET_PARAMETER") && !self.is_here(&request.uri) {
            return refuse("404 Not Found");
        }
        if matches!(request.method.as_str(), "PLAY" | "PAUSE" | "TEARDOWN") && !self.is_mine(request) {
            return refuse("454 Session Not Found");
        }
        match request.method.as_str() {
            "OPTIONS" => ok(&[format!("Public: {METHODS}")], Step::None),
            "DESCRIBE" => {
                let headers =
                    [format!("Content-Base: {}/", request.uri.trim_end_matches('/')), "Content-Type: application/sdp".to_owned()];
                (self.response(request, "200 OK", &headers, &description(&self.id, parameters)), Step::None)
            }
            "SETUP" if self.is_set_up => refuse("455 Method Not Valid in This State"),
            "SETUP" => match request.transport.as_deref().and_then(transport) {
                Some(transport) => (String::new(), Step::SetUp(transport)),
                None => refuse("461 Unsupported Transport"),
            },
            "PLAY" => ok(&["Range: npt=now-".to_owned()], Step::Play),
            "PAUSE" => ok(&[], Step::Pause),
            "TEARDOWN" => ok(&[], Step::End),
            "GET_PARAMETER" | "SET_PARAMETER" => ok(&[], Step::None),
            _ => refuse("501 Not Implemented"),
        }
    }

    /// The answer to `SETUP`; `ports` are those of the server, for UDP.
    pub(super) fn set_up(
        &mut self,
        request: &Request,
        transport: Transport,
        ports: (u16, u16),
        source: u32,
        quirks: Quirks,
    ) -> String {
        self.is_set_up = true;
        let source = if quirks.other_source { !source } else { source };
        let header = match transport {
            Transport::Interleaved { .. } if quirks.no_channels => "RTP/AVP/TCP;unicast".to_owned(),
            Transport::Interleaved { rtp, rtcp } => format!("RTP/AVP/TCP;unicast;interleaved={rtp}-{rtcp}"),
            Transport::Udp { rtp, rtcp } => {
                format!("RTP/AVP;unicast;client_port={rtp}-{rtcp};server_port={}-{}", ports.0, ports.1)
            }
        };
        self.response(request, "200 OK", &[format!("Transport: {header};ssrc={source:08X};mode=\"PLAY\"")], "")
    }

    /// Whether an address is that of the stream, or of its only part.
    fn is_here(&self, uri: &str) -> bool {
        let rest = uri.split_once("://").map_or(uri, |(_, rest)| rest);
        let path = rest.find('/').map_or("", |at| &rest[at..]);
        let path = path.split('?').next().unwrap_or_default().trim_end_matches('/');
        path == self.path || path.strip_prefix(&self.path) == Some(&format!("/{STREAM}"))
    }

    fn is_mine(&self, request: &Request) -> bool {
        let named = request.session.as_deref().and_then(|session| session.split(';').next());
        self.is_set_up && named.map(str::trim) == Some(self.id.as_str())
    }

    fn response(&self, request: &Request, status: &str, headers: &[String], body: &str) -> String {
        let mut text = format!("RTSP/1.0 {status}\r\nCSeq: {}\r\nServer: spf\r\n", request.cseq);
        if self.is_set_up {
            text.push_str(&format!("Session: {};timeout={TIMEOUT}\r\n", self.id));
        }
        for header in headers {
            text.push_str(header);
            text.push_str("\r\n");
        }
        if !body.is_empty() {
            text.push_str(&format!("Content-Length: {}\r\n", body.len()));
        }
        text.push_str("\r\n");
        text.push_str(body);
        text
    }
}

/// The first transport of a header that can be used; its `destination` is never followed, so that nobody sends video to others.
fn transport(header: &str) -> Option<Transport> {
    header.split(',').find_map(|offer| {
        let mut parts = offer.trim().split(';').map(str::trim);
        let is_tcp = match parts.next()?.to_ascii_uppercase().as_str() {
            "RTP/AVP" | "RTP/AVP/UDP" => false,
            "RTP/AVP/TCP" => true,
            _ => return None,
        };
        let (mut channels, mut ports) = (None, None);
        for part in parts {
            match part.split_once('=') {
                None if part.eq_ignore_ascii_case("multicast") => return None,
                Some(("interleaved", value)) => channels = Some(pair::<u8>(value)?),
                Some(("client_port", value)) => ports = Some(pair::<u16>(value)?),
                Some(("mode", value)) if !value.trim_matches('"').eq_ignore_ascii_case("play") => return None,
                _ => {}
            }
        }
        if is_tcp {
            let (rtp, rtcp) = channels.unwrap_or((0, 1));
            return Some(Transport::Interleaved { rtp, rtcp });
        }
        ports.filter(|(rtp, rtcp)| *rtp > 0 && *rtcp > 0).map(|(rtp, rtcp)| Transport::Udp { rtp, rtcp })
    })
}

/// `A-B`, or `A` for A and its successor.
fn pair<N: std::str::FromStr + Copy + TryFrom<u32> + Into<u32>>(text: &str) -> Option<(N, N)> {
    match text.split_once('-') {
        Some((first, second)) => Some((first.parse().ok()?, second.parse().ok()?)),
        None => {
            let first: N = text.parse().ok()?;
            Some((first, N::try_from(first.into() + 1).ok()?))
        }
    }
}

/// The description of the stream (SDP, RFC 8866).
fn description(id: &str, parameters: Option<&ParameterSets>) -> String {
    let number = u64::from_str_radix(id, 16).unwrap_or_default() >> 1;
    let mut format = "packetization-mode=1".to_owned();
    if let Some(ParameterSets { sps, pps }) = parameters {
        if let Some([profile, constraints, level]) = sps.get(1..4) {
            format.push_str(&format!(";profile-level-id={profile:02X}{constraints:02X}{level:02X}"));
        }
        format.push_str(&format!(";sprop-parameter-sets={},{}", STANDARD.encode(sps), STANDARD.encode(pps)));
    }
    format!(
        "v=0\r\no=- {number} 1 IN IP4 0.0.0.0\r\ns=SPF simulated camera\r\nc=IN IP4 0.0.0.0\r\nt=0 0\r\na=control:*\r\na=range:npt=now-\r\n\
         m=video 0 RTP/AVP {PAYLOAD_TYPE}\r\na=rtpmap:{PAYLOAD_TYPE} H264/{CLOCK}\r\na=fmtp:{PAYLOAD_TYPE} {format}\r\n\
         a=control:{STREAM}\r\n"
    )
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn request(method: &str, uri: &str) -> Request {
        Request { method: method.to_owned(), uri: uri.to_owned(), cseq: "7".to_owned(), ..Request::default() }
    }

    #[test]
    fn transports_are_chosen() {
        let udp = Some(Transport::Udp { rtp: 5000, rtcp: 5001 });
        for (header, expected) in [
            ("RTP/AVP;unicast;client_port=5000-5001", udp),
            ("RTP/AVP;unicast;client_port=5000;mode=play", udp),
            ("RTP/AVP/TCP;unicast;interleaved=2-3;mode=\"PLAY\"", Some(Transport::Interleaved { rtp: 2, rtcp: 3 })),
            ("RTP/AVP/TCP", Some(Transport::Interleaved { rtp: 0, rtcp: 1 })),
            ("RTP/AVP;multicast, RTP/SAVP;unicast;client_port=4-5, RTP/AVP/UDP;client_port=5000-5001", udp),
            ("RTP/AVP;unicast", None),
            ("RTP/AVP;unicast;client_port=0-1", None),
            ("RTP/AVP;unicast;client_port=65535", None),
            ("RTP/AVP/TCP;interleaved=255", None),
            ("RTP/AVP/TCP;mode=record", None),
            ("", None),
        ] {
            assert_eq!(transport(header), expected, "{header}");
        }
    }

    #[test]
    fn a_session_from_description_to_end() {
        let mut session = Session::new("/camera", 0xabc);
        let at = "rtsp://127.0.0.1:8554/camera";
        let parameters = ParameterSets { sps: vec![0x67, 0x64, 0, 0x1f, 1], pps: vec![0x68, 2] };
        let (text, step) = session.answer(&request("DESCRIBE", at), Some(&parameters));
        assert!(text.starts_with("RTSP/1.0 200 OK\r\nCSeq: 7\r\n") && step == Step::None, "{text}");
        assert!(text.contains("Content-Base: rtsp://127.0.0.1:8554/camera/\r\n"), "{text}");
        let format = "a=fmtp:96 packetization-mode=1;profile-level-id=64001F;sprop-parameter-sets=Z2QAHwE=,aAI=\r\n";
        assert!(text.contains(format), "{text}");
        let (head, body) = text.split_once("\r\n\r\n").unwrap();
        assert!(head.ends_with(&format!("Content-Length: {}", body.len())), "{head}");
        // Nothing is played before it is set up.
        assert!(session.answer(&request("PLAY", at), None).0.starts_with("RTSP/1.0 454 "));
        let mut set_up = request("SETUP", &format!("{at}/video"));
        assert!(session.answer(&set_up, None).0.starts_with("RTSP/1.0 461 "));
        set_up.transport = Some("RTP/AVP;unicast;client_port=5000-5001".to_owned());
        let (_, step) = session.answer(&set_up, None);
        let Step::SetUp(transport) = step else { panic!("{step:?}") };
        let text = session.set_up(&set_up, transport, (6000, 6001), 0x12ab, Quirks::default());
        assert!(text.contains("client_port=5000-5001;server_port=6000-6001;ssrc=000012AB"), "{text}");
        assert!(text.contains("Session: 0000000000000abc;timeout=60\r\n"), "{text}");
        for (method, expected) in [("PLAY", Step::Play), ("PAUSE", Step::Pause), ("TEARDOWN", Step::End)] {
            let mut request = request(method, at);
            assert!(session.answer(&request, None).0.starts_with("RTSP/1.0 454 "), "{method}");
            request.session = Some("0000000000000abc;timeout=60".to_owned());
            assert_eq!(session.answer(&request, None).1, expected);
        }
        assert!(session.answer(&request("RECORD", at), None).0.starts_with("RTSP/1.0 501 "));
        assert!(session.answer(&request("DESCRIBE", "rtsp://h/other"), None).0.starts_with("RTSP/1.0 404 "));
        assert!(session.answer(&request("DESCRIBE", "rtsp://h"), None).0.starts_with("RTSP/1.0 404 "));
    }

    proptest! {
        #[test]
        fn any_transport_is_chosen_or_refused(header in "(RTP/AVP|RTP/AVP/TCP|x)([;,= -]|client_port|interleaved|mode|[0-9]{1,6}){0,12}") {
            if let Some(Transport::Udp { rtp, rtcp }) = transport(&header) {
                prop_assert!(rtp > 0 && rtcp > 0);
            }
        }
    }
}
