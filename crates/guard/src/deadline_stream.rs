//! A blocking connection with a time limit for a whole conversation, not only for each byte of it.

use std::io::{self, ErrorKind, Read, Write};
use std::net::TcpStream;
use std::time::{Duration, Instant};

/// A connection whose reads and writes all end by a time, however slowly the other side sends.
#[derive(Debug)]
pub struct DeadlineStream {
    stream: TcpStream,
    until: Instant,
}

impl DeadlineStream {
    /// Limits all that is read and written to `time` from now.
    #[must_use]
    pub fn new(stream: TcpStream, time: Duration) -> Self {
        Self { stream, until: Instant::now() + time }
    }

    /// Lifts the limit, up to the next call: the conversation goes on without end. Its timeouts are now those of
    /// [`get_ref`](Self::get_ref).
    pub fn unlimited(&mut self) {
        // Half of what an `Instant` can be added to is far beyond any flight.
        self.until = Instant::now() + Duration::from_secs(u64::from(u32::MAX));
    }

    /// The connection.
    #[must_use]
    pub fn get_ref(&self) -> &TcpStream {
        &self.stream
    }

    /// Time left; an error if there is none.
    fn left(&self) -> io::Result<Duration> {
        let left = self.until.saturating_duration_since(Instant::now());
        if left.is_zero() { Err(io::Error::new(ErrorKind::ConnectionAborted, "too slow")) } else { Ok(left) }
    }

    fn shorten(
        &self,
        given: io::Result<Option<Duration>>,
        set: impl FnOnce(Option<Duration>) -> io::Result<()>,
    ) -> io::Result<()> {
        let (left, given) = (self.left()?, given?);
        if given.is_none_or(|given| given > left) { set(Some(left)) } else { Ok(()) }
    }
}

impl Read for DeadlineStream {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        self.shorten(self.stream.read_timeout(), |left| self.stream.set_read_timeout(left))?;
        self.stream.read(buffer)
    }
}

impl Write for DeadlineStream {
    fn write(&mut self, buffer: &[u8]) -> io::Result<usize> {
        self.shorten(self.stream.write_timeout(), |left| self.stream.set_write_timeout(left))?;
        self.stream.write(buffer)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.stream.flush()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::net::TcpListener;

    #[test]
    fn a_byte_now_and_then_does_not_prolong_it() {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let mut slow = TcpStream::connect(listener.local_addr().unwrap()).unwrap();
        let begun = Instant::now();
        let mut patient = DeadlineStream::new(listener.accept().unwrap().0, Duration::from_millis(300));
        let sender = std::thread::spawn(move || {
            while slow.write_all(b"x").is_ok() && begun.elapsed() < Duration::from_secs(10) {
                std::thread::sleep(Duration::from_millis(20));
            }
        });
        let mut all = Vec::new();
        assert!(patient.read_to_end(&mut all).is_err());
        assert!(!all.is_empty());
        drop(patient);
        sender.join().unwrap();
    }
}
