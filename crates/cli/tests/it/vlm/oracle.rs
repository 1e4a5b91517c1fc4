//! The oracle behind each vendor's protocol: its text is sent as a vendor's, and the flight must equal the oracle's.

use std::sync::{Arc, Mutex};

use spf_core::craft::CraftKind;
use spf_core::grounding::GroundingProfile;
use spf_core::query::QueryKind;
use spf_core::reply::parse_reply;
use spf_core::time::Duration;
use spf_flight::flight::{FlightPlan, Site, fly};
use spf_flight::sim::{LoadedScene, OracleVlm, SimWorld, Simulated, VlmFactory, oracle_factory};
use spf_flight::summary::Summary;
use spf_oracle::ErrorFile;
use spf_pilot::{Outcome, PilotSettings};
use spf_vlm::setup::Access;
use spf_vlm::table::Table;
use spf_vlm::{Answer, ImageSpec, QueryImage, QueryRequest, Remote, RequestOptions, Usage, Vlm, setup};

use super::KEY;
use super::server::{Request, Server};
use super::vendors::Vendor;

/// Queries the oracle, lets the server send its text, and the model's client fetch it from there.
struct Behind {
    oracle: OracleVlm,
    remote: Remote,
    words: Arc<Mutex<String>>,
    camera: (u32, u32),
}

impl Vlm for Behind {
    fn name(&self) -> &str {
        self.remote.name()
    }

    fn image_spec(&self, camera: (u32, u32)) -> ImageSpec {
        self.remote.image_spec(camera)
    }

    fn answer(&mut self, request: &QueryRequest<'_>, image: &mut dyn QueryImage) -> Answer {
        let meant = self.oracle.answer(request, image);
        let mut words = meant.text.unwrap();
        if let QueryKind::Point { avoid, .. } = request.query.kind {
            let own = self.image_spec(self.camera).grounding;
            words = parse_reply(&words, &GroundingProfile::default(), avoid).unwrap().to_json(&own, avoid);
        }
        self.words.lock().unwrap().clone_from(&words);
        let answer = self.remote.answer(request, image);
        assert_eq!(answer.text.as_ref().unwrap().trim(), words, "what was said is what was heard");
        // Flown with the oracle's latency, so that flights can be compared.
        Answer { latency: meant.latency, account: Usage { requests: answer.account.requests, ..Usage::default() }, ..answer }
    }
}

fn loaded() -> Arc<LoadedScene> {
    static CITY: std::sync::OnceLock<Arc<LoadedScene>> = std::sync::OnceLock::new();
    CITY.get_or_init(|| Arc::new(LoadedScene::load("city").unwrap())).clone()
}

pub(super) fn plan(vlm_factory: VlmFactory, avoid: bool) -> FlightPlan {
    let site = Simulated { kind: CraftKind::Quad, seed: 2, ..Simulated::new(loaded(), "city") };
    let plan = FlightPlan::new(Site::Simulated(site), "fly to the red crane", "", vlm_factory);
    FlightPlan { settings: PilotSettings { avoid, ..plan.settings }, ..plan }
}

/// A flight over a vendor's protocol, and its requests.
pub(super) fn flown_over(vendor: Vendor, model: Option<&str>, long_side: Option<u32>, avoid: bool) -> (Summary, Vec<Request>) {
    let words = Arc::new(Mutex::new(String::new()));
    let told = words.clone();
    let server = Server::start(move |_, request| vendor.stream(&vendor.model(request), &told.lock().unwrap().clone()));
    let name = format!("{}{}@{}", vendor.name(), model.map_or(String::new(), |id| format!("#{id}")), server.url());
    let key = |variable: &str| (variable == vendor.key()).then(|| KEY.to_owned());
    let (strategy, send_to) = (RequestOptions { long_side, ..RequestOptions::default() }, [server.host()]);
    let access = Access { send_to: &send_to, ..Access::of(&key) };
    let remote = setup::remote(&Table::shipped(), &[name.as_str().into()], access, strategy).unwrap();
    let vlm_factory: VlmFactory = Arc::new(move |world: Option<&SimWorld>, seed| {
        let world = world.unwrap();
        let oracle = OracleVlm::new("oracle".to_owned(), world.clone(), ErrorFile::named("perfect")?, seed);
        let camera = (world.camera().width, world.camera().height);
        Ok(Box::new(Behind { oracle, remote: remote.clone(), words: words.clone(), camera }))
    });
    let summary = fly(plan(vlm_factory, avoid), &mut []).unwrap().summary;
    let questions = server.questions();
    // One, and perhaps a second if a query overtakes the end of the previous answer.
    let connections = server.connections.load(std::sync::atomic::Ordering::SeqCst);
    assert!(connections <= 2, "{connections} connections for {} questions", questions.len());
    (summary, questions)
}

#[test]
fn two_vendors_wires_carry_a_whole_flight() {
    carry_a_flight(&[Vendor::Gemini, Vendor::Chat]);
}

#[test]
#[ignore = "takes long: .ci/interop runs it"]
fn every_vendors_wire_carries_a_whole_flight() {
    carry_a_flight(&Vendor::ALL);
}

fn carry_a_flight(vendors: &[Vendor]) {
    let perfect = oracle_factory("oracle".to_owned(), ErrorFile::named("perfect").unwrap());
    let own = fly(plan(perfect, false), &mut []).unwrap().summary;
    assert_eq!(own.outcome, Outcome::Reached);
    for vendor in vendors.iter().copied() {
        let (summary, questions) = flown_over(vendor, None, None, false);
        assert_eq!((summary.outcome, summary.verified), (Outcome::Reached, Some(true)), "{vendor:?}: {summary:?}");
        let used = summary.vlm_use.as_ref().unwrap();
        assert_eq!((used.requests as usize, used.failed.len()), (questions.len(), 0), "{vendor:?}");
        for request in &questions {
            assert_eq!(request.path.split('#').next().unwrap(), vendor.path(), "{vendor:?}");
            assert!(request.header(vendor.key_header()).unwrap().ends_with(KEY), "{vendor:?}");
            let image = spf_media::jpeg::decode(&vendor.image(request)).unwrap();
            // Gemini counts the same for any size.
            let size = if vendor == Vendor::Gemini { (960, 720) } else { (768, 576) };
            assert_eq!((image.width(), image.height()), size, "{vendor:?}");
            assert!(
                request.body.len() < if vendor == Vendor::Gemini { 140_000 } else { 100_000 },
                "{vendor:?}: {} bytes sent",
                request.body.len()
            );
        }
    }
    // In the same coordinates and at the same size it is the oracle's own flight, bit for bit.
    let (summary, _) = flown_over(Vendor::Gemini, None, Some(960), false);
    assert_eq!(Summary { vlm_use: None, ..summary }, own);
}

#[test]
fn obstacles_and_resized_images_cross_the_wire() {
    // 756×588 in pixels, and boxes with every point.
    let (summary, questions) = flown_over(Vendor::Chat, Some("Qwen/Qwen2.5-VL-7B-Instruct"), None, true);
    assert_eq!(summary.outcome, Outcome::Reached, "{summary:?}");
    let image = spf_media::jpeg::decode(&Vendor::Chat.image(&questions[0])).unwrap();
    assert_eq!((image.width(), image.height()), (756, 588));
    let schema = &questions[0].json()["response_format"]["json_schema"]["schema"];
    assert!(schema["required"].as_array().unwrap().iter().any(|key| key == "boxes"), "{schema}");
    assert!(questions[0].json().to_string().contains("in pixels of this image, 756 wide"));
}

/// The server does not answer, and the query is cancelled: it ends at once, and the server sees its client disconnect.
#[test]
fn a_question_taken_back_ends_at_once() {
    use super::server::{Piece, Reply};
    struct Grey;
    impl QueryImage for Grey {
        fn size(&self) -> (u32, u32) {
            (64, 48)
        }
        fn jpeg(&mut self, _: (u32, u32), _: u8) -> Result<Arc<[u8]>, spf_vlm::VlmError> {
            Ok(Arc::new([0xff, 0xd8]))
        }
    }
    let server = Server::start(|_, _| Reply { pieces: vec![Piece::Hang], ..Reply::new(200, "text/event-stream", "") });
    let name = format!("vllm@{}", server.url());
    let mut remote =
        setup::remote(&Table::shipped(), &[name.as_str().into()], Access::of(&|_| None), RequestOptions::default()).unwrap();
    let query = super::check::query();
    let request = QueryRequest::new(&query, Duration::from_secs(60));
    let cancel = request.cancel.clone();
    let taker = std::thread::spawn(move || {
        std::thread::sleep(Duration::from_millis(300));
        cancel.cancel();
    });
    let answer = remote.answer(&request, &mut Grey);
    assert_eq!(answer.text.unwrap_err().code(), "cancelled");
    assert!(answer.latency < Duration::from_secs(30), "{:?}", answer.latency);
    taker.join().unwrap();
    for _ in 0..300 {
        if server.left.load(std::sync::atomic::Ordering::SeqCst) == 1 {
            return;
        }
        std::thread::sleep(Duration::from_millis(100));
    }
    panic!("the server still waits for its client");
}
