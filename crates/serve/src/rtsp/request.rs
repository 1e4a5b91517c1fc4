//! Reads what a client sends: requests (RFC 2326, section 6) and packets between them (section 10.12).

/// Longest head of a request, bytes.
const LONGEST_HEAD: usize = 8192;
/// Longest body, bytes.
const LONGEST_BODY: usize = 8192;

/// A request.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(super) struct Request {
    /// Its method, such as `DESCRIBE`.
    pub(super) method: String,
    /// The address that it is about.
    pub(super) uri: String,
    /// Its number.
    pub(super) cseq: String,
    /// The header `Transport`.
    pub(super) transport: Option<String>,
    /// The header `Session`.
    pub(super) session: Option<String>,
    /// The header `Require`.
    pub(super) require: Option<String>,
}

/// Something that a client sent.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Incoming {
    /// A request.
    Request(Request),
    /// A packet, such as a receiver report, which is of no use here.
    Packet,
}

/// What a client sends is no RTSP: the connection is closed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Malformed;

/// What `bytes` begin with, and its length; `None` if it is incomplete.
pub(super) fn read(bytes: &[u8]) -> Result<Option<(Incoming, usize)>, Malformed> {
    // Empty lines before a request are ignored (section 4.1 of RFC 2616).
    let blank = bytes.iter().take_while(|byte| matches!(byte, b'\r' | b'\n')).count();
    if blank > LONGEST_HEAD {
        return Err(Malformed);
    }
    let rest = &bytes[blank..];
    if rest.first() == Some(&b'$') {
        let Some(head) = rest.get(..4) else { return Ok(None) };
        let length = 4 + usize::from(u16::from_be_bytes([head[2], head[3]]));
        return Ok((rest.len() >= length).then_some((Incoming::Packet, blank + length)));
    }
    let Some(end) = rest.windows(4).position(|window| window == b"\r\n\r\n") else {
        return if rest.len() > LONGEST_HEAD { Err(Malformed) } else { Ok(None) };
    };
    if end > LONGEST_HEAD {
        return Err(Malformed);
    }
    let head = std::str::from_utf8(&rest[..end]).map_err(|_| Malformed)?;
    let mut lines = head.split("\r\n");
    let mut words = lines.next().unwrap_or_default().split(' ');
    let (Some(method), Some(uri), Some("RTSP/1.0"), None) = (words.next(), words.next(), words.next(), words.next()) else {
        return Err(Malformed);
    };
    let mut request = Request { method: method.to_owned(), uri: uri.to_owned(), ..Request::default() };
    let mut body = 0;
    for line in lines {
        let (name, value) = line.split_once(':').ok_or(Malformed)?;
        let value = value.trim();
        match name.to_ascii_lowercase().as_str() {
            "cseq" => request.cseq = value.to_owned(),
            "transport" => request.transport = Some(value.to_owned()),
            "session" => request.session = Some(value.to_owned()),
            "require" => request.require = Some(value.to_owned()),
            "content-length" => body = value.parse().ok().filter(|length| *length <= LONGEST_BODY).ok_or(Malformed)?,
            _ => {}
        }
    }
    // It is sent back.
    if request.cseq.is_empty() || request.cseq.len() > 10 || !request.cseq.bytes().all(|byte| byte.is_ascii_digit()) {
        return Err(Malformed);
    }
    let length = blank + end + 4 + body;
    Ok((bytes.len() >= length).then_some((Incoming::Request(request), length)))
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn requests_and_packets_are_read() {
        let text = b"\r\nSETUP rtsp://h/camera/video RTSP/1.0\r\ncseq: 3\r\nTransport: RTP/AVP/TCP;unicast\r\nContent-Length: 2\r\n\r\nab$\0\0\x01x";
        let (incoming, length) = read(text).unwrap().unwrap();
        let request = Request {
            method: "SETUP".to_owned(),
            uri: "rtsp://h/camera/video".to_owned(),
            cseq: "3".to_owned(),
            transport: Some("RTP/AVP/TCP;unicast".to_owned()),
            ..Request::default()
        };
        assert_eq!(incoming, Incoming::Request(request));
        assert_eq!(read(&text[length..]), Ok(Some((Incoming::Packet, 5))));
        for cut in 0..length {
            assert_eq!(read(&text[..cut]), Ok(None), "{cut}");
        }
    }

    #[test]
    fn what_is_no_rtsp_is_refused() {
        for text in [
            "GET / HTTP/1.1\r\nHost: localhost\r\n\r\n",
            "OPTIONS * RTSP/2.0\r\nCSeq: 1\r\n\r\n",
            "OPTIONS * RTSP/1.0\r\n\r\n",
            "OPTIONS * RTSP/1.0\r\nCSeq: 1\r\nContent-Length: 99999\r\n\r\n",
            "OPTIONS * RTSP/1.0\r\nCSeq: x\r\n\r\n",
            "OPTIONS * RTSP/1.0\r\nCSeq 1\r\n\r\n",
        ] {
            assert_eq!(read(text.as_bytes()), Err(Malformed), "{text}");
        }
        assert_eq!(read(&[b'x'; LONGEST_HEAD + 1]), Err(Malformed));
        assert_eq!(read(&[b'\n'; LONGEST_HEAD + 1]), Err(Malformed));
    }

    proptest! {
        #[test]
        fn any_bytes_are_read_or_refused(bytes in proptest::collection::vec(any::<u8>(), 0..200), text in "(PLAY|\\$) [a-z ]{0,9} RTSP/1.0\r\n([A-Za-z-]{1,9}: ?[0-9a-z]{0,5}\r\n){0,4}\r\n") {
            for bytes in [bytes, text.into_bytes()] {
                if let Ok(Some((_, length))) = read(&bytes) {
                    prop_assert!(length > 0 && length <= bytes.len());
                }
            }
        }
    }
}
