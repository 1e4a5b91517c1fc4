//! A man in the middle of the command channel: it notes what is said to the drone, and when, and loses it on demand.

use std::net::{SocketAddr, UdpSocket};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// Its port at the drone's address.
const PORT: u16 = 9000;
/// How long a receiver waits before it looks whether it is to end.
const WAIT: Duration = Duration::from_millis(200);

/// The tap. State and video go from the drone to the client directly.
pub(crate) struct Tap {
    shared: Arc<Shared>,
    threads: Vec<JoinHandle<()>>,
}

struct Shared {
    /// Towards the client.
    near: UdpSocket,
    /// Towards the drone.
    far: UdpSocket,
    said: Mutex<Vec<(Instant, String)>>,
    client: Mutex<Option<SocketAddr>>,
    lost: AtomicBool,
    ended: AtomicBool,
}

impl Tap {
    /// Before the drone at `drone`, for a client at `local`.
    pub(crate) fn start(drone: &str, local: &str) -> Self {
        let near = UdpSocket::bind((drone, PORT)).unwrap();
        let far = UdpSocket::bind((local, 0)).unwrap();
        far.connect((drone, 8889)).unwrap();
        near.set_read_timeout(Some(WAIT)).unwrap();
        far.set_read_timeout(Some(WAIT)).unwrap();
        let shared = Arc::new(Shared {
            near,
            far,
            said: Mutex::default(),
            client: Mutex::default(),
            lost: AtomicBool::new(false),
            ended: AtomicBool::new(false),
        });
        let (there, back) = (shared.clone(), shared.clone());
        let threads = vec![std::thread::spawn(move || there.forward()), std::thread::spawn(move || back.answer())];
        Self { shared, threads }
    }

    /// The drone's name for the client.
    pub(crate) fn name(drone: &str) -> String {
        format!("{drone}:{PORT}")
    }

    /// From now on what is said to the drone is lost.
    pub(crate) fn lose_commands(&self) {
        self.shared.lost.store(true, Ordering::Relaxed);
    }

    /// What was said so far, or tried to be said.
    pub(crate) fn said(&self) -> Vec<(Instant, String)> {
        self.shared.said.lock().unwrap().clone()
    }
}

impl Drop for Tap {
    fn drop(&mut self) {
        self.shared.ended.store(true, Ordering::Relaxed);
        for thread in self.threads.drain(..) {
            drop(thread.join());
        }
    }
}

impl Shared {
    fn forward(&self) {
        let mut buffer = [0; 2048];
        while !self.ended.load(Ordering::Relaxed) {
            let Ok((length, from)) = self.near.recv_from(&mut buffer) else { continue };
            *self.client.lock().unwrap() = Some(from);
            let text = String::from_utf8_lossy(&buffer[..length]).into_owned();
            self.said.lock().unwrap().push((Instant::now(), text));
            if !self.lost.load(Ordering::Relaxed) {
                drop(self.far.send(&buffer[..length]));
            }
        }
    }

    fn answer(&self) {
        let mut buffer = [0; 2048];
        while !self.ended.load(Ordering::Relaxed) {
            let Ok(length) = self.far.recv(&mut buffer) else { continue };
            if let Some(client) = *self.client.lock().unwrap() {
                drop(self.near.send_to(&buffer[..length], client));
            }
        }
    }
}

/// Whether a command moves a drone.
pub(crate) fn moves(text: &str) -> bool {
    match text.strip_prefix("rc ") {
        Some(sticks) => sticks.split(' ').any(|stick| stick != "0"),
        None => ["go ", "cw ", "ccw ", "up ", "down ", "curve "].iter().any(|verb| text.starts_with(verb)),
    }
}
