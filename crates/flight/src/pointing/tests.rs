use spf_core::geometry::{Attitude, EnuPosition};
use spf_core::query::QueryId;
use spf_vlm::Cancel;

use super::*;

fn pose(east: f64, north: f64, heading_deg: f64) -> Pose {
    let attitude = Attitude { heading: f64::to_radians(heading_deg), ..Attitude::default() };
    Pose { position: EnuPosition { east, north, up: 3.0 }, attitude }
}

#[test]
fn a_point_is_followed_from_the_picture_where_it_was_set_to_the_one_asked_about() {
    let camera = Camera::quad();
    let at = ImagePoint { u: 0.7, v: 0.4 };
    let same = moved(at, 5, &camera, pose(0.0, 0.0, 0.0), pose(0.0, 0.0, 0.0));
    let Pointed::Point(seen, 5) = same else { panic!("{same:?}") };
    assert!((seen.u - 0.7).abs() < 1e-9 && (seen.v - 0.4).abs() < 1e-9);
    // After a turn to the right it is farther to the left; after a longer one out of view.
    let Pointed::Point(turned, _) = moved(at, 5, &camera, pose(0.0, 0.0, 0.0), pose(0.0, 0.0, 20.0)) else { panic!("in view") };
    assert!(turned.u < 0.6, "{turned:?}");
    let look = |heading| moved(at, 5, &camera, pose(0.0, 0.0, 0.0), pose(0.0, 0.0, heading));
    assert_eq!(
        (look(90.0), look(-90.0), look(200.0)),
        (Pointed::Look(Look::Left), Pointed::Look(Look::Right), Pointed::Look(Look::Behind))
    );
}

struct Blank;

impl QueryImage for Blank {
    fn size(&self) -> (u32, u32) {
        (960, 720)
    }

    fn jpeg(&mut self, _: (u32, u32), _: u8) -> Result<Arc<[u8]>, VlmError> {
        Ok(Arc::from([0xff, 0xd8].as_slice()))
    }
}

/// Says that it is done.
struct Model;

impl Vlm for Model {
    fn name(&self) -> &str {
        "model"
    }

    fn answer(&mut self, _: &QueryRequest<'_>, _: &mut dyn QueryImage) -> Answer {
        let text = Ok(r#"{"status":"done"}"#.to_owned());
        Answer { text, latency: Duration::ZERO, model: "model".to_owned(), account: Usage::default() }
    }
}

fn query() -> Query {
    Query::new(QueryId(3), FrameId(9), QueryKind::point(false))
}

#[test]
fn a_correction_outranks_a_model_once() {
    let shared = Arc::new(Pointing::default());
    let mut pointer = Pointer::new(shared.clone(), Arc::new(|_| {}), Some(Box::new(Model)));
    assert!(shared.correct(Given::done()).is_err(), "without a flight there is nothing to correct");
    shared.begin(Camera::quad(), false);
    assert!(!shared.answer(Given::done()), "no query waits for a person");
    shared.correct(Given::point(0.25, 0.5, 4, 9)).unwrap();
    let query = query();
    let mut ask = || pointer.answer(&QueryRequest::new(&query, Duration::from_secs(5)), &mut Blank);
    let first = ask();
    // In the model's own coordinates, here thousandths, top before left.
    assert_eq!(first.model, HUMAN);
    assert!(first.text.unwrap().contains("navigating"));
    assert_eq!(ask().model, "model");
}

#[test]
fn a_person_answers_and_a_cancelled_query_waits_no_longer() {
    let shared = Arc::new(Pointing::default());
    shared.begin(Camera::quad(), false);
    let mut pointer = Pointer::new(shared.clone(), Arc::new(|_| {}), None);
    let person = std::thread::spawn(move || while !shared.answer(Given::point(0.25, 0.5, 4, 9)) {});
    let query = query();
    let text = pointer.answer(&QueryRequest::new(&query, Duration::from_secs(20)), &mut Blank).text.unwrap();
    person.join().unwrap();
    assert!(text.contains("[240.0,360.0]"), "{text}");
    let cancel = Cancel::default();
    cancel.cancel();
    let request = QueryRequest { query: &query, time_left: Duration::from_secs(20), cancel };
    assert_eq!(pointer.answer(&request, &mut Blank).text.unwrap_err().code(), "cancelled");
    let late = pointer.answer(&QueryRequest::new(&query, Duration::ZERO), &mut Blank);
    assert_eq!(late.text.unwrap_err().code(), "deadline");
}

#[test]
fn a_jump_of_the_position_voids_places_and_the_poses_of_earlier_pictures() {
    let shared = Pointing::default();
    shared.begin(Camera::quad(), false);
    shared.frame(FrameId(1), pose(0.0, 0.0, 0.0));
    let mark = |frame| shared.avoid([0.4, 0.4, 0.6, 0.6], 5, frame);
    assert_eq!((mark(1).unwrap().len(), mark(1).unwrap().len()), (1, 2));
    shared.lost_track(None);
    assert_eq!(mark(1).unwrap().len(), 3, "nothing has jumped");
    shared.lost_track(Some(Time::from_millis(900)));
    assert!(mark(1).unwrap_err().contains("too old"));
    shared.frame(FrameId(2), pose(8.0, 0.0, 0.0));
    let left = mark(2).unwrap();
    assert_eq!(left.iter().map(|place| place.id).collect::<Vec<_>>(), [3], "a new number, and none of before");
    shared.lost_track(Some(Time::from_millis(900)));
    assert_eq!(mark(2).unwrap().len(), 2);
}
