//! A detector beside a VLM: in obstacle mode it lists the objects in the frame, and the obstacle boxes of the reply are its own.
//!
//! The policy sees a reply like any other. The detector runs first and the VLM is asked with its list, so that both latencies count.
//! Without a list there is no reply.

use std::sync::Arc;
use std::time::Instant;

use spf_core::camera::Camera;
use spf_core::detection::{Detection, lines, obstacles, parse_detections, write_detections};
use spf_core::grounding::GroundingProfile;
use spf_core::prompt::PromptText;
use spf_core::query::{DepthAs, Query, QueryKind};
use spf_core::reply::{MAX_BOXES, Reply, parse_reply};
use spf_core::time::Duration;
use spf_detect::Detector;
use spf_vlm::{Answer, ImageSpec, QueryImage, QueryRequest, Usage, Vlm, VlmError};

use crate::sim::VlmFactory;

/// The detector of a flight.
#[derive(Clone)]
pub struct DetectorPlan {
    /// Its name.
    pub name: String,
    /// Creates it; without, the VLM itself answers the query for the list, as the oracle does from one percept.
    pub factory: Option<VlmFactory>,
}

/// A VLM whose replies in obstacle mode have a detector's boxes.
pub(crate) struct WithDetector {
    pub(crate) vlm: Box<dyn Vlm>,
    /// `None`: the VLM itself.
    pub(crate) detector: Option<Box<dyn Vlm>>,
    /// The camera, by whose optics a box's height tells its range.
    pub(crate) camera: Camera,
    /// The prompt of the queries.
    pub(crate) prompt: Arc<PromptText>,
}

impl WithDetector {
    /// The objects in the frame of a query, with the time that this took.
    fn list(&mut self, request: &QueryRequest<'_>, image: &mut dyn QueryImage) -> (Result<Vec<Detection>, VlmError>, Answer) {
        let asked = request.query;
        // A detector has neither a prompt nor an image size of its own: it receives the camera's frame.
        let query = Query {
            instruction: asked.instruction.clone(),
            ..Query::new(asked.id, asked.frame, QueryKind::Detect { coco: true, scored: true })
        };
        let request = QueryRequest { query: &query, ..request.clone() };
        let answer = self.detector.as_mut().unwrap_or(&mut self.vlm).answer(&request, image);
        let found = answer.text.clone();
        let found = found.and_then(|text| parse_detections(&text).map_err(|error| VlmError::Detector(error.to_string())));
        (found, answer)
    }
}

impl Vlm for WithDetector {
    fn name(&self) -> &str {
        self.vlm.name()
    }

    fn image_spec(&self, camera: (u32, u32)) -> ImageSpec {
        self.vlm.image_spec(camera)
    }

    fn temperature(&self) -> Option<f64> {
        self.vlm.temperature()
    }

    fn answer(&mut self, request: &QueryRequest<'_>, image: &mut dyn QueryImage) -> Answer {
        let QueryKind::Point { avoid: true, depth } = request.query.kind else { return self.vlm.answer(request, image) };
        let (found, listed) = self.list(request, image);
        let found = match found {
            Ok(found) => found,
            Err(error) => return Answer { text: Err(error), ..listed },
        };
        // The list takes the place of the boxes in the prompt.
        let mut query =
            Query { kind: QueryKind::Point { avoid: false, depth }, detections: lines(&found), ..request.query.clone() };
        let ImageSpec { grounding, .. } = self.vlm.image_spec(image.size());
        query.prompt = self.prompt.write_point(&query, &grounding);
        let time_left = request.time_left.saturating_sub(listed.latency);
        let answer = self.vlm.answer(&QueryRequest { query: &query, time_left, ..request.clone() }, image);
        Answer {
            text: answer.text.map(|text| with_boxes(text, &found, &self.camera, &grounding, depth)),
            latency: listed.latency + answer.latency,
            ..answer
        }
    }
}

/// A reply with the boxes of a list instead of its own. What is no reply stays as it is: obstacle mode refuses it.
fn with_boxes(text: String, found: &[Detection], camera: &Camera, grounding: &GroundingProfile, depth: DepthAs) -> String {
    let Ok(reply) = parse_reply(&text, grounding, false) else { return text };
    let mut boxes = obstacles(found, camera, reply.target.as_deref());
    // Of more than a reply may have, the nearest.
    boxes.sort_by_key(|obstacle| obstacle.depth);
    boxes.truncate(MAX_BOXES);
    Reply { boxes, ..reply }.to_json_as(grounding, true, depth)
}

/// A detection model as a [`Vlm`].
struct DetectorVlm {
    model: Detector,
    /// Its latency; `None`: the measured inference time.
    latency: Option<Duration>,
}

impl Vlm for DetectorVlm {
    fn name(&self) -> &str {
        self.model.name()
    }

    fn answer(&mut self, request: &QueryRequest<'_>, image: &mut dyn QueryImage) -> Answer {
        // In the simulator this renders the frame; a camera's frame is available immediately.
        let pixels = image.frame();
        let began = Instant::now();
        let detect = |pixels| self.model.detect(&pixels).map_err(|error| VlmError::Detector(error.to_string()));
        let text = match request.query.kind {
            QueryKind::Detect { .. } => pixels.and_then(detect).map(|found| write_detections(&found)),
            _ => {
                Err(VlmError::Refused { model: self.model.name().to_owned(), reason: "lists the objects in an image".to_owned() })
            }
        };
        let latency = self.latency.unwrap_or_else(|| began.elapsed());
        Answer { text, latency, model: self.model.name().to_owned(), account: Usage::default() }
    }
}

/// A detection model as a [`DetectorPlan::factory`]; all flights share its network. Its latency is this, or the measured inference time.
#[must_use]
pub fn model_detects(model: Detector, latency: Option<Duration>) -> VlmFactory {
    Arc::new(move |_, _| Ok(Box::new(DetectorVlm { model: model.clone(), latency })))
}

#[cfg(test)]
mod tests {
    use spf_core::frame::FrameId;
    use spf_core::prompt::PromptKind;
    use spf_core::query::{ImagePoint, QueryId};
    use spf_core::reply::Status;

    use super::*;

    /// Answers with a text, or fails, and remembers what it was asked.
    struct Scripted {
        text: Option<&'static str>,
        latency: Duration,
        asked: Arc<std::sync::Mutex<Vec<Query>>>,
    }

    impl Vlm for Scripted {
        fn name(&self) -> &str {
            "scripted"
        }

        fn answer(&mut self, request: &QueryRequest<'_>, _: &mut dyn QueryImage) -> Answer {
            self.asked.lock().unwrap().push(request.query.clone());
            let text = self.text.map(str::to_owned).ok_or_else(|| VlmError::Detector("out of memory".to_owned()));
            Answer { text, latency: self.latency, model: "scripted".to_owned(), account: Usage::default() }
        }
    }

    struct NoImage;

    impl QueryImage for NoImage {
        fn size(&self) -> (u32, u32) {
            (960, 720)
        }

        fn jpeg(&mut self, _: (u32, u32), _: u8) -> Result<Arc<[u8]>, VlmError> {
            Err(VlmError::Image("none".to_owned()))
        }
    }

    const CAR: &str = "car_1 x:0.5 y:0.5 width:0.1 height:0.2 score:0.8";
    const AHEAD: &str = r#"{"status":"navigating","point":[500,500],"depth":9,"target":"the black car","boxes":
        [{"box":[0,0,1000,1000],"depth":1,"name":"wall"}]}"#;

    /// The answer to a query, by these of the detector and the VLM, and what both were asked.
    fn answered(kind: QueryKind, list: Option<&'static str>, reply: &'static str) -> (Answer, Vec<Query>) {
        let asked = Arc::default();
        let scripted = |text, millis| Scripted { text, latency: Duration::from_millis(millis), asked: Arc::clone(&asked) };
        let mut vlm = WithDetector {
            vlm: Box::new(scripted(Some(reply), 1500)),
            detector: Some(Box::new(scripted(list, 200))),
            camera: Camera::quad(),
            prompt: PromptText::shipped(PromptKind::Point),
        };
        let query = Query { instruction: "fly to the black car".to_owned(), ..Query::new(QueryId(3), FrameId(5), kind) };
        let answer = vlm.answer(&QueryRequest::new(&query, Duration::from_secs(10)), &mut NoImage);
        let asked = asked.lock().unwrap().clone();
        (answer, asked)
    }

    fn read(answer: &Answer) -> Reply {
        parse_reply(answer.text.as_ref().unwrap(), &GroundingProfile::default(), true).unwrap()
    }

    #[test]
    fn the_detectors_boxes_take_the_place_of_the_replys_and_both_latencies_count() {
        let (answer, asked) = answered(QueryKind::point(true), Some(CAR), AHEAD);
        assert_eq!(answer.latency, Duration::from_millis(1700));
        let reply = read(&answer);
        assert_eq!((reply.status, reply.point), (Status::Navigating, Some(ImagePoint { u: 0.5, v: 0.5 })));
        // 1.5 m high on 144 of 480 pixels of focal length: 5 m away. It has the target's name, as the reply writes it.
        let [car] = reply.boxes.as_slice() else { panic!("{reply:?}") };
        assert_eq!((car.depth, car.name.as_str()), (spf_core::lift::label_of_range(5.0), "the black car"));
        assert!((car.area.left - 0.45).abs() < 1e-3 && (car.area.bottom - 0.6).abs() < 1e-3, "{car:?}");
        // The detector sees the camera's frame; the VLM is given its list, and is not asked for boxes.
        assert_eq!((&asked[0].kind, asked[0].frame), (&QueryKind::Detect { coco: true, scored: true }, FrameId(5)));
        assert_eq!((&asked[1].kind, asked[1].detections.len()), (&QueryKind::point(false), 1));
        assert!(asked[1].prompt.contains("\ncar, [400, 450, 600, 550], 0.80\n") && !asked[1].prompt.contains("- boxes:"));
    }

    #[test]
    fn nothing_found_is_an_empty_list() {
        assert_eq!(read(&answered(QueryKind::point(true), Some("none"), AHEAD).0).boxes, []);
    }

    #[test]
    fn without_a_list_there_is_no_reply() {
        for list in [None, Some("I see a car.")] {
            let (answer, asked) = answered(QueryKind::point(true), list, AHEAD);
            assert!(matches!(answer.text, Err(VlmError::Detector(_))), "{answer:?}");
            assert_eq!((asked.len(), answer.latency), (1, Duration::from_millis(200)), "the VLM is not asked");
        }
    }

    #[test]
    fn what_is_no_reply_is_refused_in_obstacle_mode() {
        let (answer, _) = answered(QueryKind::point(true), Some(CAR), "I see a car.");
        assert!(parse_reply(answer.text.as_ref().unwrap(), &GroundingProfile::default(), true).is_err());
    }

    #[test]
    fn of_more_objects_than_a_reply_may_have_the_nearest_count() {
        let far = "car_1 x:0.5 y:0.5 width:0.02 height:0.02 score:0.8\n".repeat(MAX_BOXES);
        let list: &'static str = Box::leak((far + CAR).into_boxed_str());
        let boxes = read(&answered(QueryKind::point(true), Some(list), AHEAD).0).boxes;
        assert_eq!((boxes.len(), boxes[0].depth), (MAX_BOXES, spf_core::lift::label_of_range(5.0)));
    }

    #[test]
    fn outside_obstacle_mode_and_in_other_queries_no_detector_is_asked() {
        for kind in [QueryKind::point(false), QueryKind::Done, QueryKind::Detect { coco: false, scored: false }] {
            let (answer, asked) = answered(kind.clone(), None, AHEAD);
            assert_eq!((answer.text.as_deref(), asked.len(), &asked[0].kind), (Ok(AHEAD), 1, &kind));
        }
    }
}
