//! Server-sent events as used by the vendors: the `data` of each event, however the stream is split.

/// Maximum size of an event, bytes.
pub const MAX_EVENT: usize = 1 << 20;

/// Parses a stream of events incrementally. It buffers at most one event, of at most [`MAX_EVENT`] bytes.
#[derive(Debug, Default)]
pub struct Events {
    /// The current incomplete line.
    line: Vec<u8>,
    /// The data of the current incomplete event.
    data: String,
    /// Whether the last byte was a carriage return, whose line feed may follow in the next part.
    returned: bool,
    overflow: bool,
}

impl Events {
    /// Adds a part of the stream; returns the data of every event completed by it.
    pub fn push(&mut self, piece: &[u8]) -> Vec<String> {
        let mut events = Vec::new();
        for &byte in piece {
            match byte {
                b'\n' if core::mem::take(&mut self.returned) => {}
                b'\n' | b'\r' => {
                    self.returned = byte == b'\r';
                    self.end_line(&mut events);
                }
                _ => {
                    self.returned = false;
                    if self.line.len() + self.data.len() < MAX_EVENT {
                        self.line.push(byte);
                    } else {
                        self.overflow = true;
                    }
                }
            }
        }
        events
    }

    /// Ends the stream and returns the remaining events. An event without its final empty line counts too, since some
    /// servers omit it.
    pub fn finish(&mut self) -> Vec<String> {
        let mut events = Vec::new();
        self.end_line(&mut events);
        self.end_event(&mut events);
        events
    }

    /// Whether an event exceeded the maximum size.
    #[must_use]
    pub fn overflowed(&self) -> bool {
        self.overflow
    }

    fn end_line(&mut self, events: &mut Vec<String>) {
        let line = core::mem::take(&mut self.line);
        if line.is_empty() {
            return self.end_event(events);
        }
        // The data repeats the event name; comments and other fields are not needed.
        if let Some(data) = line.strip_prefix(b"data:") {
            let data = data.strip_prefix(b" ").unwrap_or(data);
            if !self.data.is_empty() {
                self.data.push('\n');
            }
            self.data.push_str(&String::from_utf8_lossy(data));
        }
    }

    fn end_event(&mut self, events: &mut Vec<String>) {
        if !self.data.is_empty() {
            events.push(core::mem::take(&mut self.data));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn all(pieces: &[&[u8]]) -> Vec<String> {
        let mut events = Events::default();
        let mut found: Vec<String> = pieces.iter().flat_map(|piece| events.push(piece)).collect();
        found.extend(events.finish());
        found
    }

    #[test]
    fn what_servers_send() {
        let stream = ": keep-alive\r\n\r\nevent: a\r\ndata: {\"x\":1}\r\n\r\ndata:{\"y\":\r\ndata:  2}\n\ndata: [DONE]";
        assert_eq!(all(&[stream.as_bytes()]), ["{\"x\":1}", "{\"y\":\n 2}", "[DONE]"]);
    }

    #[test]
    fn an_event_without_end_is_bounded() {
        let mut events = Events::default();
        events.push(b"data: ");
        for _ in 0..40 {
            assert!(events.push(&[b'x'; 65_536]).is_empty());
        }
        assert!(events.overflowed() && events.line.len() <= MAX_EVENT);
    }

    proptest! {
        #[test]
        fn cuts_change_nothing(texts in prop::collection::vec("[a-zäß€{}\": ]{1,20}", 0..6), cuts in prop::collection::vec(any::<prop::sample::Index>(), 0..8), end in prop::sample::select(vec!["\n", "\r\n", "\r"])) {
            let stream: String = texts.iter().map(|text| format!("event: e{end}data: {text}{end}{end}")).collect();
            let mut cuts: Vec<usize> = cuts.iter().map(|cut| cut.index(stream.len() + 1)).collect();
            cuts.sort_unstable();
            let mut pieces = Vec::new();
            let mut from = 0;
            for to in cuts.into_iter().chain([stream.len()]) {
                pieces.push(&stream.as_bytes()[from..to]);
                from = to;
            }
            prop_assert_eq!(all(&pieces), texts);
        }

        #[test]
        fn no_bytes_panic(bytes in prop::collection::vec(any::<u8>(), 0..400)) {
            all(&[&bytes]);
        }
    }
}
