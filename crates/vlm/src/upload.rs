//! A request body that records when the connection accepted its last part.

use std::convert::Infallible;
use std::pin::Pin;
use std::sync::{Arc, OnceLock};
use std::task::{Context, Poll};
use std::time::Instant;

use bytes::Bytes;
use http_body::{Body, Frame, SizeHint};

/// Bytes passed to the connection at a time. The HTTP library buffers at most sixteen parts, so by the recorded time
/// the socket has accepted all but the last 32 KiB of a request.
const PIECE: usize = 2048;

/// When the connection accepted the last part of a body; the operating system may still buffer some of it.
pub(crate) type Uploaded = Arc<OnceLock<Instant>>;

/// A body of known length.
pub(crate) struct Upload {
    left: Bytes,
    uploaded: Uploaded,
}

impl Upload {
    /// A body that sets `uploaded` once it is accepted completely.
    pub(crate) fn new(body: Bytes, uploaded: Uploaded) -> Self {
        Self { left: body, uploaded }
    }
}

impl Body for Upload {
    type Data = Bytes;
    type Error = Infallible;

    fn poll_frame(mut self: Pin<&mut Self>, _: &mut Context<'_>) -> Poll<Option<Result<Frame<Bytes>, Infallible>>> {
        if self.left.is_empty() {
            return Poll::Ready(None);
        }
        let length = self.left.len().min(PIECE);
        let piece = self.left.split_to(length);
        if self.left.is_empty() {
            self.uploaded.get_or_init(Instant::now);
        }
        Poll::Ready(Some(Ok(Frame::data(piece))))
    }

    fn is_end_stream(&self) -> bool {
        self.left.is_empty()
    }

    fn size_hint(&self) -> SizeHint {
        SizeHint::with_exact(self.left.len() as u64)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::task::Waker;

    #[test]
    fn the_end_is_noted_with_the_last_piece() {
        let bytes: Vec<u8> = (0..5000_u32).map(|i| i as u8).collect();
        let uploaded = Uploaded::default();
        let mut upload = Upload::new(bytes.clone().into(), uploaded.clone());
        assert_eq!(upload.size_hint().exact(), Some(5000));
        let (mut seen, mut pieces) = (Vec::new(), 0);
        while !upload.is_end_stream() {
            assert!(uploaded.get().is_none());
            let polled = Pin::new(&mut upload).poll_frame(&mut Context::from_waker(Waker::noop()));
            let Poll::Ready(Some(Ok(frame))) = polled else { panic!("it is there at once") };
            seen.extend_from_slice(&frame.into_data().unwrap());
            pieces += 1;
        }
        assert!(uploaded.get().is_some());
        assert_eq!((seen, pieces), (bytes, 3));
    }
}
