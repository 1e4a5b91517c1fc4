//! Tokens in printed addresses, and the sessions that they open.

use std::collections::{BTreeMap, VecDeque};
use std::net::IpAddr;
use std::time::{Duration, Instant};

use crate::message::Hello;
use spf_guard::Secret;

/// Maximum number of sessions; the oldest is forgotten.
const SESSIONS: usize = 32;
/// So many wrong tokens of one address within a minute, and it is told no more until the minute is over.
const WRONG: usize = 10;
/// Maximum number of addresses whose wrong tokens are counted.
const WRONG_FROM: usize = 256;
const WRONG_WITHIN: Duration = Duration::from_secs(60);
/// A used one-time address is replaced after its page was away for this long.
const RENEW_AFTER: Duration = Duration::from_secs(5);

/// Why a page was refused.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub(crate) enum Refused {
    #[error("this address needs the part after the `#`: open it as the terminal shows it")]
    NoToken,
    #[error("this address was used already: it works once; the terminal shows a new one when its page is gone")]
    Used,
    #[error("unknown token: open the address as the terminal shows it")]
    Unknown,
    #[error("too many wrong tokens: try again in a minute")]
    TooMany,
    #[error("as many pages as there is room for are watching already: try again later")]
    Full,
    #[error("no random numbers from the operating system")]
    NoRandom,
}

/// What somebody may do.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum May {
    Watch,
    Fly,
}

/// The secrets of the cockpit.
#[derive(Debug)]
pub(crate) struct Keys {
    /// On this machine only: everybody here may watch, and the address that flies can be opened again.
    loopback: bool,
    fly: Secret,
    /// The token that flies was used.
    used: bool,
    /// For spectators elsewhere.
    watch: Secret,
    sessions: VecDeque<(u64, Secret)>,
    next: u64,
    /// Wrong tokens of an address: how many, since when.
    wrong: BTreeMap<IpAddr, (usize, Instant)>,
}

impl Keys {
    pub(crate) fn new(loopback: bool) -> std::io::Result<Self> {
        let (fly, watch) = (Secret::new()?, Secret::new()?);
        Ok(Self { loopback, fly, used: false, watch, sessions: VecDeque::new(), next: 0, wrong: BTreeMap::new() })
    }

    /// The secrets of the addresses to print: to fly, and to watch if that needs one.
    pub(crate) fn printed(&self) -> (String, Option<String>) {
        (self.fly.text().to_owned(), (!self.loopback).then(|| self.watch.text().to_owned()))
    }

    /// What the sender of a greeting may see. It uses no token up.
    pub(crate) fn look(&mut self, hello: &Hello, peer: IpAddr, now: Instant) -> Result<May, Refused> {
        if let Some(session) = &hello.session
            && self.sessions.iter().any(|(_, secret)| secret.is(session))
        {
            return Ok(May::Fly);
        }
        match &hello.token {
            Some(token) => self.token(token, peer, now).map(|_| May::Watch),
            None if self.loopback => Ok(May::Watch),
            None => Err(Refused::NoToken),
        }
    }

    /// The session of the sender of a greeting; `None` for a spectator.
    pub(crate) fn enter(&mut self, hello: &Hello, peer: IpAddr, now: Instant) -> Result<Option<(u64, String)>, Refused> {
        if let Some(session) = &hello.session
            && let Some((id, secret)) = self.sessions.iter().find(|(_, secret)| secret.is(session))
        {
            return Ok(Some((*id, secret.text().to_owned())));
        }
        match &hello.token {
            Some(token) if self.token(token, peer, now)? == May::Fly => {
                if self.used && !self.loopback {
                    return Err(Refused::Used);
                }
                let session = self.session()?;
                self.used = true;
                Ok(Some(session))
            }
            None if !self.loopback => Err(Refused::NoToken),
            _ => Ok(None),
        }
    }

    /// The session whose secret this is; `None` for the token that flies, on this machine.
    pub(crate) fn bearer(&mut self, secret: &str, peer: IpAddr, now: Instant) -> Result<Option<u64>, Refused> {
        if let Some((id, _)) = self.sessions.iter().find(|(_, known)| known.is(secret)) {
            return Ok(Some(*id));
        }
        match self.token(secret, peer, now)? {
            May::Fly if self.loopback => Ok(None),
            _ => Err(Refused::NoToken),
        }
    }

    /// A new session: its number and secret.
    pub(crate) fn session(&mut self) -> Result<(u64, String), Refused> {
        let secret = Secret::new().map_err(|_| Refused::NoRandom)?;
        let (id, text) = (self.next, secret.text().to_owned());
        self.next += 1;
        if self.sessions.len() >= SESSIONS {
            self.sessions.pop_front();
        }
        self.sessions.push_back((id, secret));
        Ok((id, text))
    }

    fn token(&mut self, token: &str, peer: IpAddr, now: Instant) -> Result<May, Refused> {
        // First of all: whoever has it is not locked out by those who guess.
        match (self.fly.is(token), self.watch.is(token)) {
            (true, _) => return Ok(May::Fly),
            (false, true) => return Ok(May::Watch),
            (false, false) => {}
        }
        self.wrong.retain(|_, (_, since)| now.duration_since(*since) <= WRONG_WITHIN);
        if self.wrong.len() >= WRONG_FROM && !self.wrong.contains_key(&peer) {
            let oldest = self.wrong.iter().min_by_key(|(_, (_, since))| *since).map(|(peer, _)| *peer);
            oldest.and_then(|oldest| self.wrong.remove(&oldest));
        }
        let (count, _) = self.wrong.entry(peer).or_insert((0, now));
        *count += 1;
        Err(if *count > WRONG { Refused::TooMany } else { Refused::Unknown })
    }

    /// A new secret that flies, if the one-time one was used and its page has been away for this long.
    pub(crate) fn renew(&mut self, away: Duration) -> Option<String> {
        if self.loopback || !self.used || away < RENEW_AFTER {
            return None;
        }
        self.fly = Secret::new().ok()?;
        self.used = false;
        Some(self.fly.text().to_owned())
    }
}

#[cfg(test)]
mod tests {
    use std::net::Ipv4Addr;

    use super::*;

    const HERE: IpAddr = IpAddr::V4(Ipv4Addr::LOCALHOST);

    fn token(token: &str) -> Hello {
        Hello { token: Some(token.to_owned()), session: None }
    }

    #[test]
    fn a_token_of_a_network_works_once_and_a_session_again() {
        let mut keys = Keys::new(false).unwrap();
        let now = Instant::now();
        let (fly, watch) = keys.printed();
        assert_eq!(keys.look(&Hello::default(), HERE, now), Err(Refused::NoToken));
        assert_eq!(keys.look(&token(&watch.clone().unwrap()), HERE, now), Ok(May::Watch));
        assert_eq!(keys.enter(&token(&watch.unwrap()), HERE, now), Ok(None));
        let (id, session) = keys.enter(&token(&fly), HERE, now).unwrap().unwrap();
        assert_eq!(keys.enter(&token(&fly), HERE, now), Err(Refused::Used), "replayed");
        let again = Hello { token: None, session: Some(session.clone()) };
        assert_eq!(keys.enter(&again, HERE, now), Ok(Some((id, session))));
        assert_eq!(keys.look(&again, HERE, now), Ok(May::Fly));
        assert_eq!(keys.renew(Duration::from_secs(1)), None);
        let renewed = keys.renew(RENEW_AFTER).unwrap();
        assert_eq!(keys.enter(&token(&fly), HERE, now), Err(Refused::Unknown));
        assert!(keys.enter(&token(&renewed), HERE, now).unwrap().is_some());
    }

    #[test]
    fn on_this_machine_everybody_watches_and_the_address_opens_again() {
        let mut keys = Keys::new(true).unwrap();
        let (now, (fly, watch)) = (Instant::now(), keys.printed());
        assert_eq!((watch, keys.enter(&Hello::default(), HERE, now)), (None, Ok(None)));
        assert!(keys.enter(&token(&fly), HERE, now).unwrap().is_some() && keys.enter(&token(&fly), HERE, now).unwrap().is_some());
    }

    #[test]
    fn guessing_is_slow() {
        let mut keys = Keys::new(true).unwrap();
        let (now, (fly, _)) = (Instant::now(), keys.printed());
        let other = IpAddr::from([192, 0, 2, 7]);
        (0..WRONG).for_each(|_| assert_eq!(keys.enter(&token("0"), HERE, now), Err(Refused::Unknown)));
        assert_eq!(keys.enter(&token("0"), HERE, now), Err(Refused::TooMany));
        assert_eq!(keys.enter(&token("0"), other, now), Err(Refused::Unknown), "another address");
        assert!(keys.enter(&token(&fly), HERE, now).is_ok(), "the right one is never locked out");
        assert_eq!(keys.enter(&token("0"), HERE, now + WRONG_WITHIN + Duration::from_secs(1)), Err(Refused::Unknown));
        for count in 0..2000_u32 {
            assert_eq!(keys.enter(&token("0"), IpAddr::from(count.to_be_bytes()), now), Err(Refused::Unknown));
        }
        assert!(keys.wrong.len() <= WRONG_FROM);
    }
}
