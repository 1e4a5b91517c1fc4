//! Whoever asks the endpoint more than it can do waits: two images at a time, eight connections.

use std::io::{Read, Write};
use std::net::TcpStream;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Duration;

use spf_core::craft::CraftKind;
use spf_core::frame::FrameId;
use spf_core::geometry::Pose;
use spf_core::time::Time;
use spf_flight::sim::{LoadedScene, OracleVlm, SimWorld};
use spf_media::Rgb;
use spf_oracle::ErrorFile;
use spf_serve::vlm::{AnswerForm, Endpoint, FrameProvider, Instruction, Memory, Responder};

/// A camera that takes its time, and counts how many images it is taking.
#[derive(Default)]
struct Slow {
    taking: AtomicUsize,
    most: AtomicUsize,
    taken: AtomicUsize,
}

impl FrameProvider for Slow {
    fn newest(&self) -> Option<(FrameId, Rgb)> {
        let taking = self.taking.fetch_add(1, Ordering::SeqCst) + 1;
        self.most.fetch_max(taking, Ordering::SeqCst);
        std::thread::sleep(Duration::from_millis(100));
        self.taking.fetch_sub(1, Ordering::SeqCst);
        self.taken.fetch_add(1, Ordering::SeqCst);
        Some((FrameId(1), Rgb::filled(64, 48, [90; 3])))
    }

    fn put(&self, _: Pose) -> bool {
        false
    }

    fn now(&self) -> Time {
        Time::ZERO
    }
}

#[test]
fn an_endpoint_takes_two_images_at_a_time_and_the_others_wait() {
    let world = SimWorld::new(Arc::new(LoadedScene::load("office").unwrap()), CraftKind::Quad, Pose::default(), 0);
    let errors = ErrorFile::named("default").unwrap();
    let oracle = OracleVlm::new("oracle:default".to_owned(), world, errors, 0);
    let responder = Responder::new(oracle, Arc::new(Memory::default()), Instruction::FromPrompt, AnswerForm::Spf);
    let (endpoint, lens) = (Endpoint::bind("127.0.0.1:0".parse().unwrap()).unwrap(), Arc::new(Slow::default()));
    let address = endpoint.address();
    let serving = endpoint.serve(lens.clone(), responder).unwrap();
    let ask = move || {
        let mut stream = TcpStream::connect(address).unwrap();
        stream.set_read_timeout(Some(Duration::from_secs(60))).unwrap();
        let request = format!("GET /frame.jpg HTTP/1.1\r\nHost: {address}\r\nConnection: close\r\n\r\n");
        stream.write_all(request.as_bytes()).unwrap();
        let mut answer = Vec::new();
        drop(stream.read_to_end(&mut answer));
        String::from_utf8_lossy(&answer[..answer.len().min(12)]).into_owned()
    };
    // As many as there are places: all are answered.
    let asking: Vec<_> = (0..spf_guard::CONNECTIONS).map(|_| std::thread::spawn(ask)).collect();
    let answers: Vec<String> = asking.into_iter().map(|thread| thread.join().unwrap()).collect();
    assert!(answers.iter().all(|answer| answer == "HTTP/1.1 200"), "{answers:?}");
    assert_eq!((lens.most.load(Ordering::SeqCst), lens.taken.load(Ordering::SeqCst)), (2, spf_guard::CONNECTIONS));
    // Many more: each is answered or told to come again, and never more than two images are taken.
    let asking: Vec<_> = (0..60).map(|_| std::thread::spawn(ask)).collect();
    let answers: Vec<String> = asking.into_iter().map(|thread| thread.join().unwrap()).collect();
    assert!(answers.iter().all(|answer| ["HTTP/1.1 200", "HTTP/1.1 503", ""].contains(&answer.as_str())), "{answers:?}");
    assert_eq!(lens.most.load(Ordering::SeqCst), 2);
    drop(serving);
}
