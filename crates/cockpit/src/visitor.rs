//! Who opens a socket: until it has greeted it may have to make room for others.

use std::convert::Infallible;
use std::net::{IpAddr, Ipv4Addr};
use std::time::Duration;

use axum::extract::FromRequestParts;
use axum::extract::ws::{Message, WebSocket};
use axum::http::request::Parts;
use spf_guard::{Peer, Place, TurnedOut};
use tokio::time::timeout;

/// Time limit for the first message.
const GREETING: Duration = Duration::from_secs(5);

/// The other side of a socket.
pub(crate) struct Visitor {
    pub(crate) peer: IpAddr,
    place: Option<Place>,
    turned_out: Option<TurnedOut>,
}

impl<S: Sync> FromRequestParts<S> for Visitor {
    type Rejection = Infallible;

    async fn from_request_parts(parts: &mut Parts, _: &S) -> Result<Self, Infallible> {
        let peer = parts.extensions.get::<Peer>().map_or(IpAddr::V4(Ipv4Addr::UNSPECIFIED), |peer| peer.0);
        let (place, turned_out) = (parts.extensions.get().cloned(), parts.extensions.get().cloned());
        Ok(Self { peer, place, turned_out })
    }
}

impl Visitor {
    /// The first message; `None` if there is none in time, or if others need the place first.
    pub(crate) async fn greeting(&self, socket: &mut WebSocket) -> Option<String> {
        let out = async {
            match &self.turned_out {
                Some(turned_out) => turned_out.wait().await,
                None => std::future::pending().await,
            }
        };
        tokio::select! {
            first = timeout(GREETING, socket.recv()) => match first {
                Ok(Some(Ok(Message::Text(first)))) => Some(first.to_string()),
                _ => None,
            },
            () = out => None,
        }
    }

    /// Keeps its place from now on: it is known who this is.
    pub(crate) fn settle(&self) {
        self.place.iter().for_each(Place::settle);
    }
}
