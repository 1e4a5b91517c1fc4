use std::collections::BTreeMap;

use spf_core::camera::Camera;
use spf_core::frame::FrameId;
use spf_core::geometry::Attitude;
use spf_core::grounding::GroundingProfile;
use spf_core::query::{
    ActForm, DepthAs, FinishedPlace, FinishedStage, ImageBox, ImagePoint, Mark, Memory, Motion, PastAnswer, Query, QueryId,
    QueryKind, Said,
};
use spf_core::reply::{Look, Reply, Status, parse_reply};
use spf_core::sign::SignView;
use spf_core::tags::PieceTag;

use super::*;

mod stages;

const W: usize = 960;
const H: usize = 720;

/// An image painted by hand: rectangles of one id and depth, later ones in front.
pub(super) struct Painting {
    ids: Vec<u16>,
    depth: Vec<f32>,
    piece_ids: Vec<u16>,
    pub(super) pieces: Vec<PieceTag>,
    opening_ids: Vec<u16>,
    opening_depth: Vec<f32>,
    in_frame: BTreeMap<u16, f32>,
    pub(super) signs: Vec<SignView>,
    tags: Vec<Tagged>,
    camera: Camera,
}

pub(super) fn tagged(id: u16, name: &str, kind: &str, colour: &str) -> Tagged {
    Tagged {
        id,
        key: format!("{name}_{id}").replace(' ', "_"),
        names: vec![name.to_owned()],
        kind: kind.to_owned(),
        colour: (!colour.is_empty()).then(|| colour.to_owned()),
        ..Tagged::default()
    }
}

impl Painting {
    pub(super) fn new() -> Self {
        Self {
            ids: vec![0; W * H],
            depth: vec![f32::INFINITY; W * H],
            piece_ids: vec![0; W * H],
            pieces: Vec::new(),
            opening_ids: vec![0; W * H],
            opening_depth: vec![f32::INFINITY; W * H],
            in_frame: BTreeMap::new(),
            signs: Vec::new(),
            tags: Vec::new(),
            camera: Camera::quad(),
        }
    }

    /// A rectangle of columns `x` and rows `y`.
    pub(super) fn with(mut self, tags: Tagged, x: core::ops::Range<usize>, y: core::ops::Range<usize>, depth: f32) -> Self {
        for row in y {
            let line = row * W + x.start..row * W + x.end;
            if tags.opening {
                self.opening_ids[line.clone()].fill(tags.id);
                self.opening_depth[line].fill(depth);
            } else {
                self.ids[line.clone()].fill(tags.id);
                self.depth[line].fill(depth);
            }
        }
        self.tags.push(tags);
        self
    }

    /// Names what is painted there.
    pub(super) fn named(
        mut self,
        object: u16,
        name: &str,
        main: bool,
        x: core::ops::Range<usize>,
        y: core::ops::Range<usize>,
    ) -> Self {
        self.pieces.push(PieceTag { object, name: name.to_owned(), main, solid: true });
        for row in y {
            self.piece_ids[row * W + x.start..row * W + x.end].fill(self.pieces.len() as u16);
        }
        self
    }

    /// Changes the depth of a rectangle, column by column.
    pub(super) fn deepened(
        mut self,
        x: core::ops::Range<usize>,
        y: core::ops::Range<usize>,
        depth: impl Fn(usize) -> f32,
    ) -> Self {
        for row in y {
            for column in x.clone() {
                self.depth[row * W + column] = depth(column);
            }
        }
        self
    }

    /// As another camera has taken it.
    pub(super) fn seen_by(mut self, camera: Camera) -> Self {
        self.camera = camera;
        self
    }

    pub(super) fn percept(&self, oracle: &Oracle, frame: u64) -> Percept {
        let sight = GroundTruthView {
            width: W,
            height: H,
            ids: &self.ids,
            depth: &self.depth,
            piece_ids: &self.piece_ids,
            pieces: &self.pieces,
            opening_ids: &self.opening_ids,
            opening_depth: &self.opening_depth,
            camera: &self.camera,
            attitude: Attitude::default(),
            in_frame: &self.in_frame,
            light: &BTreeMap::new(),
            signs: &self.signs,
        };
        oracle.percept(FrameId(frame), &sight, &self.tags)
    }
}

pub(super) fn query(id: u64, kind: QueryKind, instruction: &str) -> Query {
    Query { instruction: instruction.to_owned(), ..Query::new(QueryId(id), FrameId(id), kind) }
}

pub(super) const POINT: QueryKind = QueryKind::point(false);

fn oracle(name: &str) -> Oracle {
    Oracle::new(ErrorFile::named(name).unwrap(), 3.0, 7)
}

pub(super) fn ask(oracle: &Oracle, painting: &Painting, query: &Query) -> Reply {
    let answer = oracle.answer(query, &painting.percept(oracle, query.frame.0));
    let avoid = matches!(query.kind, QueryKind::Point { avoid: true, .. });
    parse_reply(&answer.text, &GroundingProfile::default(), avoid).unwrap()
}

/// A red crane at 20 m left of the middle, a yellow one on the right, a tree below.
fn site() -> Painting {
    Painting::new()
        .with(tagged(1, "crane", "machine", "red"), 300..341, 200..401, 20.0)
        .with(tagged(2, "crane", "machine", "yellow"), 700..800, 200..500, 40.0)
        .with(tagged(3, "tree", "tree", "green"), 100..160, 500..600, 10.0)
}

#[test]
fn the_perfect_oracle_points_at_the_middle_of_the_target() {
    let reply = ask(&oracle("perfect"), &site(), &query(0, POINT, "Take off and fly to the red crane"));
    assert_eq!(reply.status, Status::Navigating);
    let point = reply.point.unwrap();
    assert!((point.u - 320.5 / 960.0).abs() < 2e-3 && (point.v - 300.5 / 720.0).abs() < 2e-3, "{point:?}");
    // Depth 20 m, 159.5 px left of centre at fx = 480: 20·√(1 + 0.332² + 0.124²) = 21.2 m; 1 + 4.5·log10 21.2 = 6.97.
    assert_eq!(reply.depth, Some(7));
    assert_eq!(reply.target.as_deref(), Some("red crane"));
}

#[test]
fn a_crane_is_pointed_at_in_its_mast_however_wide_its_jib() {
    let crane = tagged(1, "crane", "machine", "red");
    let painting = |shift: usize| {
        Painting::new()
            .with(crane.clone(), 100..700, 100..160, 30.0)
            .with(crane.clone(), 300..330, 160..500, 40.0)
            .with(crane.clone(), 280..350, 500..560 + shift, 40.0)
            .named(1, "jib", false, 100..700, 100..160)
            .named(1, "mast", true, 300..330, 160..500)
            .named(1, "base", false, 280..350, 500..560 + shift)
    };
    for shift in [0, 10, 40] {
        let reply = ask(&oracle("perfect"), &painting(shift), &query(0, POINT, "fly to the red crane"));
        let point = reply.point.unwrap();
        assert!((point.u - 315.0 / 960.0).abs() < 2e-3 && (point.v - 330.0 / 720.0).abs() < 2e-2, "{point:?}");
        // The mast is 40 m away, the jib 30 m: labels 8.2 and 7.6.
        assert_eq!(reply.depth, Some(8));
    }
    // With the mast out of view, what else is seen of it.
    let hidden = painting(0).with(tagged(2, "house", "building", "white"), 0..960, 160..720, 20.0).named(
        2,
        "wall",
        false,
        0..960,
        160..720,
    );
    let point = ask(&oracle("perfect"), &hidden, &query(0, POINT, "fly to the red crane")).point.unwrap();
    assert!(point.v < 160.0 / 720.0, "{point:?}");
}

#[test]
fn what_is_absent_is_not_visible_and_never_something_else() {
    let oracle = oracle("perfect");
    for words in ["fly to the blue crane", "go to the bridge", "fly to the elephant", "blah", ""] {
        let reply = ask(&oracle, &site(), &query(0, POINT, words));
        assert_eq!((reply.status, reply.look), (Status::NotVisible, Some(Look::Right)), "{words}");
    }
    let mut query = query(0, POINT, "go to the bridge");
    query.memory.last_seen = Some(Look::Left);
    assert_eq!(ask(&oracle, &site(), &query).look, Some(Look::Left));
}

#[test]
fn what_belongs_to_a_place_is_told_by_its_tags_whatever_is_in_view() {
    let in_car_park =
        |id: u16, name: &str, colour: &str| Tagged { group: Some("car park".to_owned()), ..tagged(id, name, name, colour) };
    let avenue = || Painting::new().with(tagged(1, "car", "car", "red"), 400..500, 300..400, 20.0);
    // What the image does not show has tags all the same.
    let hidden = |painting: Painting| painting.with(in_car_park(2, "car", "red"), 0..0, 0..0, 20.0);
    let ground = in_car_park(3, "car park", "grey");
    let mut turned = query(0, POINT, "go to the red car in the car park");
    turned.memory.turned = 7.0;
    let oracle = oracle("perfect");
    for painting in [hidden(avenue()), hidden(avenue()).with(ground.clone(), 600..960, 400..600, 30.0)] {
        assert_eq!(ask(&oracle, &painting, &turned).status, Status::NotVisible);
    }
    let shown = avenue().with(in_car_park(2, "car", "red"), 700..780, 400..450, 30.0);
    let point = ask(&oracle, &shown, &turned).point.unwrap();
    assert!(point.u > 0.7, "{point:?}");
    // A scene that says nothing of the place leaves it to the image.
    let alone = avenue().with(ground, 600..960, 400..600, 30.0);
    assert_eq!(ask(&oracle, &alone, &query(0, POINT, "go to the red car in the car park")).status, Status::Navigating);
}

#[test]
fn a_distance_is_kept_from_what_reaches_out_in_front() {
    let mill = tagged(1, "windmill", "building", "white");
    let painting = Painting::new()
        .with(mill.clone(), 300..600, 100..160, 10.0)
        .with(mill, 400..500, 160..600, 30.0)
        .named(1, "sails", false, 300..600, 100..160)
        .named(1, "tower", true, 400..500, 160..600);
    let label = |words: &str| ask(&oracle("perfect"), &painting, &query(0, POINT, words)).depth.unwrap();
    assert_eq!([label("go to the windmill"), label("go to the windmill and stay 3 m away")], [8, 6]);
}

#[test]
fn an_object_cut_by_the_edge_is_looked_for_beyond_it() {
    let oracle = oracle("perfect");
    let mut painting = Painting::new().with(tagged(1, "car", "vehicle", "black"), 0..20, 300..400, 9.0);
    let at = query(0, POINT, "go to the black car");
    assert_eq!(ask(&oracle, &painting, &at).status, Status::Navigating);
    painting.in_frame.insert(1, 0.2);
    let reply = ask(&oracle, &painting, &at);
    assert_eq!((reply.status, reply.look), (Status::NotVisible, Some(Look::Left)));
    // An object that fills a fiftieth of the image is in view however much of it is outside, and reached if it fills a tenth.
    for (rows, range, status) in
        [(14, 9.0, Status::NotVisible), (15, 9.0, Status::Navigating), (15, 1.0, Status::NotVisible), (72, 1.0, Status::Done)]
    {
        let mut painting = Painting::new().with(tagged(1, "building", "building", "grey"), 0..960, 0..rows, range);
        painting.in_frame.insert(1, 0.1);
        assert_eq!(ask(&oracle, &painting, &query(0, POINT, "go to the building")).status, status, "{rows} {range}");
    }
    // 5 rows of 720 are less than 0.8 % of the height: not visible, and no edge to name.
    let painting = Painting::new().with(tagged(1, "wall", "structure", "grey"), 100..900, 300..305, 9.0);
    assert_eq!(ask(&oracle, &painting, &query(0, POINT, "go to the wall")).look, Some(Look::Right));
}

#[test]
fn done_is_judged_by_range_alone() {
    let oracle = oracle("perfect");
    for (depth, status) in [(2.5, Status::Done), (3.5, Status::Navigating)] {
        let painting = Painting::new().with(tagged(1, "car", "vehicle", "black"), 430..530, 310..410, depth);
        assert_eq!(ask(&oracle, &painting, &query(0, POINT, "go to the car")).status, status);
    }
    // At `near` exactly the default oracle answers done half the time (range noise included), sampled by query number.
    let oracle = Oracle::new(ErrorFile::default(), 3.0, 1);
    let painting = Painting::new().with(tagged(1, "car", "vehicle", "black"), 430..530, 310..410, 3.0);
    let percept = painting.percept(&oracle, 5);
    let message = (0..2000)
        .filter(|&id| oracle.answer(&query(id, QueryKind::Done, "go to the car"), &percept).text.contains("true"))
        .count();
    let range = percept.seen(&oracle.errors, None).next().unwrap().range;
    let p = 1.0 / (1.0 + libm::exp(-libm::log(3.0 / range) / 0.25));
    assert!((message as f64 / 2000.0 - p).abs() < 0.04, "{message} {p}");
}

#[test]
fn half_of_eight_pixels_square_are_seen_and_most_of_sixteen() {
    let oracle = Oracle::new(ErrorFile::default(), 3.0, 3);
    let fraction = |side: usize, size: Option<(u32, u32)>| {
        let painting = Painting::new().with(tagged(1, "car", "vehicle", "black"), 430..430 + side, 310..310 + side, 30.0);
        let base = painting.percept(&oracle, 0);
        assert_eq!(base.things.len(), 1);
        (0..1500)
            .filter(|&frame| {
                let key = [frame, 1];
                let luck = RandomStream::new(oracle.seed, "oracle seen", &key).uniform();
                let mut percept = base.clone();
                percept.things[0].redraw(luck);
                percept.seen(&oracle.errors, size).next().is_some()
            })
            .count() as f64
            / 1500.0
    };
    assert!((fraction(8, None) - 0.5).abs() < 0.04);
    assert!((fraction(16, None) - 0.95).abs() < 0.02);
    // Sent at half the size, 16 pixels are 8.
    assert!((fraction(16, Some((480, 360))) - 0.5).abs() < 0.04);
}

#[test]
fn one_frame_has_one_percept_and_every_answer_its_own_errors() {
    let oracle = Oracle::new(ErrorFile::default(), 3.0, 11);
    let painting = site();
    let percept = painting.percept(&oracle, 4);
    assert_eq!(percept, painting.percept(&oracle, 4));
    let a = oracle.answer(&query(1, POINT, "fly to the red crane"), &percept);
    assert_eq!(a, oracle.answer(&query(1, POINT, "fly to the red crane"), &percept));
    let b = oracle.answer(&query(2, POINT, "fly to the red crane"), &percept);
    assert_eq!(a.text, b.text);
    assert_ne!(a.latency, b.latency);
    assert_ne!(percept.things[0].point, painting.percept(&oracle, 5).things[0].point);
}

#[test]
fn three_answers_in_a_hundred_confuse_the_target() {
    let oracle = Oracle::new(ErrorFile::default(), 3.0, 2);
    let percept = site().percept(&oracle, 0);
    let texts = (0..3000).map(|id| oracle.answer(&query(id, POINT, "fly to the red crane"), &percept).text);
    let wrong = texts.filter(|text| text.contains("yellow crane")).count();
    assert!((50..130).contains(&wrong), "{wrong}");
}

#[test]
fn latency_is_log_normal() {
    let oracle = oracle("default");
    let percept = Painting::new().percept(&oracle, 0);
    let mut all: Vec<f64> =
        (0..4000).map(|id| oracle.answer(&query(id, QueryKind::Done, ""), &percept).latency.as_secs_f64()).collect();
    all.sort_by(f64::total_cmp);
    assert!((all[2000] - 1.5).abs() < 0.05 && (all[3800] - 3.0).abs() < 0.15, "{} {}", all[2000], all[3800]);
}

#[test]
fn labels_follow_their_reading() {
    let label = |name: &str, range, fraction| answer::label(&ErrorFile::named(name).unwrap(), range, fraction);
    // 1 + 4.5·log10: 1 m → 1, 10 m → 5.5 → 6, 100 m and more → 10.
    assert_eq!([0.5, 1.0, 10.0, 60.0, 100.0, f64::INFINITY].map(|r| label("default", r, 0.1)), [1, 1, 6, 9, 10, 10]);
    assert_eq!([7.4, 25.0, 80.0].map(|r| label("linear", r, 0.1)), [1, 5, 10]);
    assert_eq!([1.0, 0.5, 0.0].map(|s| label("size", 9.0, s)), [1, 6, 10]);
    // Half of 6 m is 3 m: label 5 flies 2.872 m. Half of 0.1 m fits nothing: 1.
    assert_eq!([6.0, 0.1, 100.0].map(|r| label("intended", r, 0.1)), [5, 1, 10]);
}

#[test]
fn the_nearest_things_are_boxed_and_the_point_stays_on_the_target() {
    let oracle = oracle("perfect");
    let mut painting = Painting::new()
        .with(tagged(1, "building", "building", "white"), 400..660, 100..500, 60.0)
        .with(tagged(2, "ground", "ground", ""), 0..960, 500..720, 10.0)
        .with(tagged(3, "tree", "tree", "green"), 440..620, 110..500, 12.0)
        .with(tagged(4, "car", "vehicle", "red"), 100..200, 480..520, 15.0)
        .with(tagged(5, "tower", "building", "grey"), 700..760, 100..500, 80.0);
    let requested = query(0, QueryKind::point(true), "fly to the white building");
    let reply = ask(&oracle, &painting, &requested);
    let names: Vec<&str> = reply.boxes.iter().map(|obstacle| obstacle.name.as_str()).collect();
    assert_eq!(names, ["green tree", "red car"], "nearest first; neither ground nor what is farther than the target");
    let free = ask(&oracle, &painting, &query(0, POINT, "fly to the white building"));
    assert_eq!((free.boxes.len(), free.point), (0, reply.point), "obstacles do not move the point");
    // A perfect oracle's box is that of the target.
    let area = reply.target_box.unwrap();
    assert!((area.left - 400.0 / 960.0).abs() < 2e-3 && (area.right - 660.0 / 960.0).abs() < 2e-3, "{area:?}");
    for id in 0..10_u16 {
        let left = 10 + 30 * usize::from(id);
        painting = painting.with(tagged(10 + id, "post", "post", "white"), left..left + 20, 300..420, 5.0 + f32::from(id));
    }
    let boxes = ask(&oracle, &painting, &requested).boxes;
    assert!(boxes.len() == 8 && boxes.is_sorted_by_key(|obstacle| obstacle.depth), "{boxes:?}");
    assert_eq!(boxes.iter().filter(|obstacle| obstacle.name == "white post").count(), 7, "the tree is nearer than the eighth");
}

#[test]
fn metres_are_stated_where_they_are_asked_for() {
    let oracle = oracle("perfect");
    let painting = Painting::new().with(tagged(1, "building", "building", "white"), 400..660, 100..500, 60.0);
    let kind = QueryKind::Point { avoid: true, depth: DepthAs::Metres };
    let percept = painting.percept(&oracle, 0);
    let text = oracle.answer(&query(0, kind, "fly to the white building"), &percept).text;
    assert!(text.contains("\"depth_m\":6") && !text.contains("\"depth\""), "{text}");
    let reply = parse_reply(&text, &GroundingProfile::default(), true).unwrap();
    assert!(reply.depth == Some(9) && (60.0..64.0).contains(&reply.range_m.unwrap()), "{reply:?}");
}

#[test]
fn what_a_detector_listed_moves_no_point() {
    let oracle = oracle("perfect");
    let painting = Painting::new()
        .with(tagged(1, "building", "building", "white"), 400..660, 100..500, 60.0)
        .with(tagged(3, "truck", "vehicle", "green"), 440..620, 110..500, 12.0)
        .with(tagged(4, "bin", "bin", "red"), 650..660, 110..500, 12.0);
    let percept = painting.percept(&oracle, 0);
    let detect = query(0, QueryKind::Detect { coco: true, scored: true }, "");
    let list = oracle.answer(&detect, &percept);
    assert_eq!(list.text, "truck_1 x:0.5521 y:0.4236 width:0.1875 height:0.5417 score:1.00\n", "no building and no bin in COCO");
    assert_eq!(list.latency, Duration::from_millis(100));

    let pointed = |detections: &[&str]| {
        let detections = detections.iter().map(|line| (*line).to_owned()).collect();
        let query = Query { detections, ..query(1, POINT, "fly to the white building") };
        let reply = ask(&oracle, &painting, &query);
        assert_eq!(reply.boxes, [], "boxes that were told are not told back");
        reply.point.unwrap()
    };
    let straight = pointed(&[]);
    assert_eq!(pointed(&["none"]), straight);
    assert_eq!(pointed(&["truck_1 x:0.2 y:0.4 width:0.2 height:0.5"]), straight, "nothing is seen there");
    assert_eq!(pointed(&[list.text.trim()]), straight, "the pilot leads around what was listed");
}

/// Tasks of a bench share their seeds; the cost of an answer's errors can only be measured over many samples if the
/// tasks do not share these.
#[test]
fn the_luck_of_answers_differs_with_seed_question_and_words() {
    let oracle = oracle("default");
    let painting = site();
    let percept = painting.percept(&oracle, 0);
    let latency = |id, words| oracle.answer(&query(id, POINT, words), &percept).latency;
    let one = latency(3, "fly to the red crane");
    assert_eq!(one, latency(3, "fly to the red crane"));
    assert_ne!(one, latency(4, "fly to the red crane"));
    assert_ne!(one, latency(3, "fly to the yellow crane"));
}

#[test]
fn the_other_kinds_answer_from_the_same_percept() {
    let oracle = oracle("perfect");
    let painting = site();
    let percept = painting.percept(&oracle, 0);
    let mut choose = query(0, QueryKind::Choose, "fly to the red crane");
    let number = |u, v, number| Mark::Number { at: ImagePoint { u, v }, number };
    choose.marks = vec![number(0.9, 0.5, 1), number(0.35, 0.4, 2), number(0.2, 0.1, 3)];
    assert_eq!(oracle.answer(&choose, &percept).text, r#"{"points":[2]}"#);
    choose.marks.truncate(1);
    assert_eq!(oracle.answer(&choose, &percept).text, r#"{"points":[]}"#);

    // Bearing atan(−159.5/480) = −18.4°, rounded to −15°; 21.2 m is cut to the form's 5 m; 0.124·5/1.053 = 0.6 m up.
    let text = oracle.answer(&query(0, QueryKind::Act { form: ActForm::Commands }, "fly to the red crane"), &percept).text;
    let act: serde_json::Value = serde_json::from_str(&text).unwrap();
    assert_eq!(act["actions"][0]["cmd"], "yaw_left");
    assert_eq!(act["actions"][0]["value"], 15.0);
    assert_eq!(act["actions"][1]["value"], 5.0);
    assert_eq!(act["done"], false);

    let lines = oracle.answer(&query(0, QueryKind::Detect { coco: false, scored: false }, ""), &percept).text;
    assert!(lines.starts_with("crane_1 x:0.33 y:0.42 width:0.04 height:0.28 color:red\n"), "{lines}");
    let mut program = query(0, QueryKind::Program, "go to the yellow crane");
    program.detections = lines.lines().map(str::to_owned).collect();
    assert_eq!(oracle.answer(&program, &percept).text, "o('crane_2');_1=a('crane_2');?_1==False{rp;}->True;");
    // After an earlier target the program continues from there, and searches for an unlisted object.
    let mut later = query(0, QueryKind::Program, "go to the yellow crane, then to the black car");
    later.detections = program.detections.clone();
    later.memory.stage = 2;
    assert_eq!(oracle.answer(&later, &percept).text, "_1=s('black car');?_1==False{->False;}rp;");
    // None of COCO's classes is here, and a detector does not take as long as a VLM.
    let known = oracle.answer(&query(0, QueryKind::Detect { coco: true, scored: false }, ""), &percept);
    assert_eq!((known.text.as_str(), known.latency), ("", Duration::from_millis(100)));
    let mut requested = query(0, QueryKind::Question { text: "How many cranes are there?".to_owned() }, "");
    requested.detections = program.detections;
    assert_eq!(oracle.answer(&requested, &percept).text, "2");
    requested.kind = QueryKind::Question { text: "Is there a bridge?".to_owned() };
    assert_eq!(oracle.answer(&requested, &percept).text, "False");
}
