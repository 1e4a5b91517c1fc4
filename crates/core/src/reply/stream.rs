//! Parsing a reply, complete or still arriving.

use super::habit::by_habit;
use super::parse::{Asked, ReplyError, interpret};
use super::repair::{keys_in, repaired};
use super::scan::{MAX_TEXT, Scan, ScanError, Verdict, has_thought};
use super::{Reply, Status};
use crate::grounding::{GroundingProfile, Habit};

/// Parses the reply in `text`, in the coordinates of `profile`. `avoid`: it answers a query in obstacle mode, and must have
/// the list of `boxes` unless it is `done`; an empty list means that there is no obstacle.
///
/// `docs/reference/reply.md` lists the accepted deviations: fences and prose around the JSON, an array for the object,
/// numbers as text, other keys and spellings, coordinates up to 1 % outside. What is before the last end of a thought
/// is no answer. Of several replies after it the last counts, if all that are valid have the same status. Text copied from the
/// image into the target of a complete reply becomes no other field, whether or not it is escaped: an answer in which it could is
/// refused. So is one that goes on behind a reply as the rest of it would.
///
/// ```
/// use spf_core::grounding::GroundingProfile;
/// use spf_core::reply::parse_reply;
///
/// let text = "Here it is: {'status': 'navigating', 'point': [250, 500], 'depth': '6',}";
/// let reply = parse_reply(text, &GroundingProfile::default(), false)?; // [y, x] in thousandths
/// let point = reply.point.unwrap();
/// assert_eq!((point.u, point.v, reply.depth), (0.5, 0.25, Some(6)));
/// # Ok::<(), spf_core::reply::ReplyError>(())
/// ```
///
/// # Errors
/// [`ReplyError`] of the first object that was intended as a reply, or of replies that contradict one another. Every number of a returned reply is finite and
/// within its range.
pub fn parse_reply(text: &str, profile: &GroundingProfile, avoid: bool) -> Result<Reply, ReplyError> {
    let mut stream = ReplyStream::new(*profile, avoid);
    stream.push(text);
    stream.finish()
}

/// Whether whoever wrote an answer has shown that the first reply in a text may be a draft: the answer has the beginning or
/// the end of a thought, or several replies. Arguments as of [`parse_reply`].
#[must_use]
pub fn has_drafts(text: &str, profile: &GroundingProfile, avoid: bool) -> bool {
    let mut stream = ReplyStream::new(*profile, avoid);
    stream.push(text);
    stream.scan_to(true);
    let Scan { accepted, refused, overruled, .. } = &stream.scan;
    let refusals = usize::from(refused.is_some()) + usize::from(overruled.is_some());
    has_thought(text) || accepted.len() + refusals > 1
}

/// A reply that is still arriving. However the text is split into chunks, [`finish`](Self::finish) returns what
/// [`parse_reply`] returns for the complete text.
#[derive(Clone, Debug, PartialEq)]
pub struct ReplyStream {
    profile: GroundingProfile,
    avoid: bool,
    text: String,
    too_long: bool,
    scan: Scan<Reply, ReplyError>,
    /// Whether no text had left its string when the first reply was complete.
    is_clear: bool,
}

impl ReplyStream {
    /// An empty stream; `avoid` as in [`parse_reply`].
    #[must_use]
    pub fn new(profile: GroundingProfile, avoid: bool) -> Self {
        Self { profile, avoid, text: String::new(), too_long: false, scan: Scan::new(), is_clear: false }
    }

    /// Appends the next chunk. Text beyond [`MAX_TEXT`] is dropped.
    pub fn push(&mut self, chunk: &str) {
        if self.too_long || self.text.len() + chunk.len() > MAX_TEXT {
            self.too_long = true;
            return;
        }
        let (had_none, since) = (self.scan.accepted.is_empty(), self.scan.since);
        self.text.push_str(chunk);
        self.scan_to(false);
        // Looked at once, since it reads all of the text.
        if (had_none || since != self.scan.since) && !self.scan.accepted.is_empty() {
            self.is_clear = self.scan.overruled.is_none() && !self.scan.is_torn && self.is_all_read();
        }
    }

    /// The first reply, as soon as its JSON is complete, unless text has left its string. Of a model that does not think it is
    /// the answer; what else may follow can make it a draft.
    #[must_use]
    pub fn early(&self) -> Option<&Reply> {
        self.scan.accepted.first().filter(|_| self.is_clear)
    }

    /// Whether all keys that make a reply were read as keys: else text has left its string, and may pass for a reply.
    fn is_all_read(&self) -> bool {
        keys_in(&self.text[self.scan.since..]) == self.scan.keys
    }

    /// The text so far.
    #[must_use]
    pub fn text(&self) -> &str {
        &self.text
    }

    /// Finishes the stream and returns the reply.
    ///
    /// # Errors
    /// Same as [`parse_reply`].
    pub fn finish(mut self) -> Result<Reply, ReplyError> {
        if self.too_long {
            return Err(ReplyError::TooLong { limit: MAX_TEXT });
        }
        self.scan_to(true);
        // A text that has left the name of an obstacle, and ended the reply around it, leaves the rest of that reply behind.
        let has_names = self.scan.accepted.iter().any(|reply| !reply.boxes.is_empty());
        if self.scan.is_torn || has_names && ends_what_began_before(&self.text[self.scan.accepted_until..]) {
            return Err(ReplyError::Ambiguous);
        }
        if self.is_all_read() {
            let answer = &self.text[self.scan.since..];
            return last_of(self.scan).or_else(|error| match error {
                // Tags within JSON are text.
                ReplyError::NoReply if self.profile.habit == Habit::Tags => Err(error),
                ReplyError::NoJson | ReplyError::NoReply => by_habit(answer, &self.profile, self.avoid).unwrap_or(Err(error)),
                error => Err(error),
            });
        }
        let asked = Asked { profile: &self.profile, avoid: self.avoid };
        let value = if self.scan.is_thinking() { None } else { repaired(&self.text[self.scan.since..]) };
        match value.map(|value| interpret(&value, asked, true)) {
            Some(Verdict::Accepted(reply)) if reply.status != Status::Done => Ok(reply),
            Some(Verdict::Refused(error)) => Err(error),
            // Whoever is done says so again.
            Some(Verdict::Accepted(_)) => Err(ReplyError::Ambiguous),
            Some(Verdict::Other) | None => Err(last_of(self.scan).err().unwrap_or(ReplyError::Ambiguous)),
        }
    }

    fn scan_to(&mut self, ended: bool) {
        let asked = Asked { profile: &self.profile, avoid: self.avoid };
        self.scan.advance(&self.text, ended, |value, nested| interpret(value, asked, nested));
    }
}

/// Whether a text has the end of a string, and then that of a list or an object that began before it.
fn ends_what_began_before(text: &str) -> bool {
    let (mut open, mut is_quoted) = (0_usize, false);
    text.bytes().any(|byte| {
        match byte {
            b'"' | b'\'' => is_quoted = true,
            b'{' | b'[' => open += 1,
            b'}' | b']' if open == 0 => return is_quoted,
            b'}' | b']' => open -= 1,
            _ => {}
        }
        false
    })
}

/// The last reply of a complete answer.
fn last_of(mut scan: Scan<Reply, ReplyError>) -> Result<Reply, ReplyError> {
    if let Some(error) = scan.overruled.take() {
        return Err(error);
    }
    let mut all = scan.outcome().map_err(|unfound| match unfound {
        ScanError::TooLong => ReplyError::TooLong { limit: MAX_TEXT },
        ScanError::Refused(error) => error,
        ScanError::Truncated => ReplyError::Truncated,
        ScanError::NoReply => ReplyError::NoReply,
        ScanError::NoJson => ReplyError::NoJson,
    })?;
    let last = all.pop().ok_or(ReplyError::NoReply)?;
    if all.iter().any(|other| other.status != last.status) {
        return Err(ReplyError::Contradiction);
    }
    Ok(last)
}
