use std::sync::mpsc::{Receiver, channel};

use spf_core::camera::Camera;
use spf_core::craft::Craft;
use spf_pilot::Phase;

use super::*;
use spf_flight::pointing::Side;

const HERE: IpAddr = IpAddr::V4(std::net::Ipv4Addr::LOCALHOST);

struct Cabin {
    controls: Controls,
    pointing: Arc<Pointing>,
    now: Instant,
    token: String,
    orders: Receiver<OperatorEvent>,
}

impl Cabin {
    fn new(only: bool) -> Self {
        let hub = Hub::new();
        let keys = Keys::new(true).unwrap();
        let token = keys.printed().0;
        let pointing = Arc::<Pointing>::default();
        let controls = Controls::new(keys, hub, pointing.clone());
        let (operator, orders) = channel();
        let read: ReadInstruction =
            Arc::new(|text| if text == "gibberish" { Err("not understood".into()) } else { Ok("reads".into()) });
        controls.begin(FlightControls { operator, craft: Craft::tello(), read, only });
        Self { controls, pointing, now: Instant::now(), token, orders }
    }

    fn page(&self, token: bool) -> (u64, mpsc::Receiver<Arc<str>>) {
        let (send, messages) = mpsc::channel(TO_PAGE);
        let hello = Hello { token: token.then(|| self.token.clone()), session: None };
        (self.controls.enter(&hello, HERE, send, self.now).unwrap().0, messages)
    }

    fn order(&self, page: u64, order: Order, ms: u64) -> Result<String, String> {
        self.controls.order(page, &order, self.after(ms))
    }

    fn after(&self, ms: u64) -> Instant {
        self.now + Duration::from_millis(ms)
    }

    fn sent(&self) -> Vec<OperatorEvent> {
        self.orders.try_iter().collect()
    }
}

#[test]
fn one_page_flies_and_others_only_watch() {
    let cabin = Cabin::new(false);
    let (pilot, _one) = cabin.page(true);
    let (second, _two) = cabin.page(true);
    let (spectator, _three) = cabin.page(false);
    for other in [second, spectator] {
        for order in
            [Order::Hold, Order::Land, Order::Cut, Order::Instruction("go".to_owned()), Order::Give { page: 1, yes: true }]
        {
            assert!(cabin.controls.order(other, &order, cabin.now).is_err());
        }
    }
    assert_eq!(cabin.sent(), []);
    assert!(cabin.controls.order(pilot, &Order::Hold, cabin.now).is_ok());
    assert_eq!(cabin.sent(), [OperatorEvent::Hold]);
    assert!(cabin.controls.order(pilot, &Order::Instruction("gibberish".to_owned()), cabin.now).is_err());
    assert_eq!(cabin.sent(), []);
    assert_eq!(cabin.controls.order(pilot, &Order::Instruction("go".to_owned()), cabin.now), Ok("reads".to_owned()));
    assert_eq!(cabin.sent(), [OperatorEvent::Instruction("go".to_owned()), OperatorEvent::Resume]);
}

#[test]
fn the_controls_are_handed_over_by_consent_and_the_drone_holds() {
    let cabin = Cabin::new(false);
    let ((pilot, _one), (spectator, mut told)) = (cabin.page(true), cabin.page(false));
    assert!(cabin.controls.order(spectator, &Order::Ask, cabin.now).is_ok());
    assert!(cabin.controls.order(spectator, &Order::Hold, cabin.now).is_err(), "asking is not enough");
    let (third, _third) = cabin.page(false);
    assert!(cabin.order(third, Order::Ask, 0).is_err(), "the first one's turn");
    assert!(cabin.order(pilot, Order::Give { page: third, yes: true }, 0).is_err(), "not the one asked about");
    assert!(cabin.order(pilot, Order::Give { page: spectator, yes: false }, 0).is_ok());
    assert!(cabin.order(pilot, Order::Give { page: spectator, yes: true }, 0).is_err(), "nobody asks any more");
    assert!(cabin.order(spectator, Order::Ask, 29_000).is_err(), "refused a moment ago");
    assert!(cabin.order(spectator, Order::Ask, 30_000).is_ok());
    assert!(cabin.order(pilot, Order::Give { page: spectator, yes: true }, 30_000).is_ok());
    assert_eq!(cabin.sent(), [OperatorEvent::Left]);
    assert!(cabin.controls.order(pilot, &Order::Resume, cabin.now).is_err());
    assert!(cabin.controls.order(spectator, &Order::Resume, cabin.now).is_ok());
    let messages: Vec<Arc<str>> = std::iter::from_fn(|| told.try_recv().ok()).collect();
    assert!(messages.iter().any(|message| message.contains("\"session\"")), "it may come back");
}

#[test]
fn motors_are_cut_in_two_steps_within_six_seconds() {
    let cabin = Cabin::new(false);
    let (pilot, _page) = cabin.page(true);
    let order = |order: Order, ms: u64| cabin.controls.order(pilot, &order, cabin.after(ms)).is_ok();
    assert!(!order(Order::Cut, 0));
    assert!(order(Order::ArmCut, 0) && !order(Order::Cut, 6001), "too late");
    assert!(order(Order::ArmCut, 7000) && order(Order::Hold, 7100) && !order(Order::Cut, 7200), "something else came between");
    assert_eq!(cabin.sent(), [OperatorEvent::Hold]);
    assert!(order(Order::ArmCut, 8000) && order(Order::Cut, 13_500));
    assert_eq!(cabin.sent(), [OperatorEvent::CutMotors]);
}

#[test]
fn a_flight_that_only_a_lost_page_controls_holds_and_then_lands() {
    let cabin = Cabin::new(true);
    let (pilot, _page) = cabin.page(true);
    let check = |ms| {
        cabin.controls.check(cabin.after(ms));
        cabin.sent()
    };
    cabin.controls.heard(pilot, cabin.after(900));
    // The page answers nothing from 0.9 s on: within a second the drone holds.
    assert_eq!(check(1500), []);
    assert_eq!(check(1600), [OperatorEvent::Left]);
    assert_eq!((check(2500), check(21_500)), (vec![], vec![]));
    cabin.controls.heard(pilot, cabin.after(21_550));
    assert_eq!(check(21_600), [], "it is back");
    cabin.controls.leave(pilot, cabin.after(22_000));
    assert_eq!((check(22_100), check(23_100)), (vec![], vec![OperatorEvent::Left]), "a page loaded anew takes a moment");
    assert_eq!(check(42_100), [OperatorEvent::Abandoned]);
    assert_eq!(check(60_000), []);
}

#[test]
fn with_keys_in_the_terminal_a_lost_page_stops_nothing() {
    let cabin = Cabin::new(false);
    let (pilot, _page) = cabin.page(true);
    cabin.controls.leave(pilot, cabin.now);
    cabin.controls.check(cabin.after(30_000));
    assert_eq!(cabin.sent(), []);
    let (back, _again) = cabin.page(true);
    assert!(cabin.order(back, Order::Hold, 0).is_err(), "it did not fly before");
    assert!(cabin.order(back, Order::Ask, 0).is_ok(), "whoever has the address may take over");
    assert_eq!(cabin.sent(), [OperatorEvent::Left]);
    assert!(cabin.order(back, Order::Resume, 0).is_ok());
}

#[test]
fn manual_flight_is_at_half_the_preset_speeds() {
    let cabin = Cabin::new(false);
    let (pilot, _page) = cabin.page(true);
    let order = Order::Fly { right: 0.0, forward: 1.0, up: -1.0, turn: 0.5 };
    assert!(cabin.controls.order(pilot, &order, cabin.now).is_ok());
    let craft = Craft::tello();
    let expected =
        Setpoint { right: 0.0, forward: 0.5 * craft.cruise_speed, up: -0.5 * craft.climb_speed, yaw_rate: 0.25 * craft.yaw_rate };
    assert_eq!(cabin.sent(), [OperatorEvent::Setpoint(expected)]);
}

#[test]
fn only_the_page_that_flew_last_takes_the_controls_by_itself() {
    let cabin = Cabin::new(true);
    let enter = |hello: &Hello| {
        let (send, messages) = mpsc::channel(TO_PAGE);
        let (number, session) = cabin.controls.enter(hello, HERE, send, cabin.now).unwrap();
        (number, Hello { token: None, session }, messages)
    };
    let token = Hello { token: Some(cabin.token.clone()), session: None };
    let ((first, first_session, _one), (second, second_session, _two)) = (enter(&token), enter(&token));
    assert!(cabin.order(second, Order::Ask, 0).is_ok());
    assert!(cabin.order(first, Order::Give { page: second, yes: true }, 0).is_ok());
    cabin.controls.leave(first, cabin.now);
    cabin.controls.leave(second, cabin.now);
    assert_eq!(cabin.sent(), [OperatorEvent::Left]);
    // The tab of the former pilot connects again by itself.
    let (former, _, _former) = enter(&first_session);
    assert!(cabin.order(former, Order::Land, 0).is_err());
    let (back, _, _back) = enter(&second_session);
    assert!(cabin.order(back, Order::Hold, 0).is_ok());
    assert_eq!(cabin.sent(), [OperatorEvent::Hold]);
}

#[test]
fn a_click_undoes_no_hold_and_no_landing() {
    let cabin = Cabin::new(false);
    let (pilot, _page) = cabin.page(true);
    let point = |ms| cabin.order(pilot, Order::Point { u: 0.5, v: 0.5, depth: 5, frame: 1 }, ms);
    for human in [true, false] {
        cabin.pointing.begin(Camera::quad(), human);
        for (phase, refused) in
            [(Phase::Flying, false), (Phase::Held, human), (Phase::Manual, human), (Phase::Landing, true), (Phase::Ended, true)]
        {
            cabin.pointing.phase(phase);
            let told = point(5000);
            assert_eq!(told.is_err(), refused, "{human} {phase:?}: {told:?}");
            assert_eq!(cabin.sent().is_empty(), refused, "{human} {phase:?}");
        }
        // Clicked before the hold could be seen.
        cabin.pointing.phase(Phase::Flying);
        assert!(cabin.order(pilot, Order::Hold, 0).is_ok() && point(100).is_err());
        assert_eq!(cabin.sent(), [OperatorEvent::Hold]);
        assert!(cabin.order(pilot, Order::Resume, 0).is_ok() && point(200).is_ok());
        cabin.sent();
    }
}

#[test]
fn a_late_check_does_not_count_against_the_page() {
    let cabin = Cabin::new(true);
    let (pilot, _page) = cabin.page(true);
    let check = |ms| {
        cabin.controls.check(cabin.after(ms));
        cabin.sent()
    };
    cabin.controls.heard(pilot, cabin.after(0));
    assert_eq!((check(100), check(1150)), (vec![], vec![]), "its answers wait to be read");
    cabin.controls.heard(pilot, cabin.after(1160));
    assert_eq!((check(1250), check(2100)), (vec![], vec![]));
    // However late the checks are, twice the time without an answer is the limit.
    assert_eq!((check(2500), check(2550)), (vec![], vec![]));
    assert_eq!(check(2600), [OperatorEvent::Left]);
}

#[test]
fn without_its_page_a_drone_does_not_take_off() {
    let cabin = Cabin::new(true);
    let (pilot, _page) = cabin.page(true);
    assert!(cabin.controls.has_pilot());
    cabin.pointing.phase(Phase::Ground);
    cabin.controls.check(cabin.after(1100));
    assert_eq!(cabin.sent(), [OperatorEvent::Abandoned]);
    assert!(!cabin.controls.has_pilot());
    cabin.controls.heard(pilot, cabin.after(1200));
    assert!(cabin.controls.has_pilot());
}

/// A page that is lost orders nothing that would interrupt a landing, in whatever order it is lost, lands, and comes back.
#[test]
fn a_lost_page_gives_no_order_that_the_pilot_takes_for_the_operators_hold() {
    let cabin = Cabin::new(true);
    let (pilot, _page) = cabin.page(true);
    assert!(cabin.order(pilot, Order::Land, 0).is_ok());
    cabin.controls.leave(pilot, cabin.after(1200));
    for ms in (1300..40_000).step_by(100) {
        cabin.controls.check(cabin.after(ms));
    }
    let (other, _page) = cabin.page(true);
    assert!(cabin.order(other, Order::Ask, 40_000).is_ok());
    assert_eq!(cabin.sent(), [OperatorEvent::Land, OperatorEvent::Left, OperatorEvent::Abandoned, OperatorEvent::Left]);
}

#[test]
fn a_held_key_or_pad_neither_prevents_nor_disarms_a_cut() {
    let cabin = Cabin::new(false);
    let (pilot, _page) = cabin.page(true);
    let fly = || Order::Fly { right: 0.0, forward: 0.0, up: 1.0, turn: 0.0 };
    for (ms, order) in [(0, fly()), (100, Order::ArmCut), (150, fly()), (250, fly()), (1700, Order::Cut)] {
        assert!(cabin.order(pilot, order.clone(), ms).is_ok(), "{order:?}");
    }
    assert_eq!(cabin.sent().last(), Some(&OperatorEvent::CutMotors));
}

#[test]
fn an_order_that_arrives_late_or_out_of_order_is_dropped_and_hold_and_land_never_are() {
    let cabin = Cabin::new(false);
    let (pilot, _page) = cabin.page(true);
    let receive = |id, tick, order: &Order, ms| {
        cabin.controls.receive(pilot, id, Some(tick), order, cabin.after(ms)).map_err(|why| {
            assert!(why.contains("dropped"), "{why}");
        })
    };
    assert_eq!(cabin.controls.beat(pilot, cabin.after(0)), 1);
    assert!(receive(1, 1, &Order::Resume, 900).is_ok());
    // The link stalls: what the page has sent meanwhile arrives 3 s later, after it was given up.
    assert_eq!(cabin.controls.beat(pilot, cabin.after(4000)), 2);
    cabin.sent();
    let fly = Order::Fly { right: 0.0, forward: 1.0, up: 0.0, turn: 0.0 };
    let late = [Order::Resume, Order::ArmCut, Order::Cut, Order::Instruction("go".to_owned()), Order::Look(Side::Left), fly];
    for (id, order) in (2..).zip(&late) {
        assert!(receive(id, 1, order, 4000).is_err(), "{order:?}");
    }
    assert_eq!(cabin.sent(), []);
    assert!(receive(8, 1, &Order::Hold, 4000).is_ok() && receive(9, 1, &Order::Land, 4000).is_ok());
    assert!(cabin.controls.receive(pilot, 0, None, &Order::Land, cabin.after(4000)).is_ok(), "without a beat, too");
    assert_eq!(cabin.sent(), [OperatorEvent::Hold, OperatorEvent::Land, OperatorEvent::Land]);
    // A cut that was armed in time, and whose second step is late; and one that a later order has overtaken.
    assert!(receive(10, 2, &Order::ArmCut, 4100).is_ok() && receive(11, 2, &Order::Cut, 5100).is_err());
    assert_eq!(cabin.controls.beat(pilot, cabin.after(5100)), 3);
    assert!(receive(13, 3, &Order::Hold, 5200).is_ok() && receive(12, 3, &Order::Resume, 5300).is_err());
    assert!(receive(14, 2, &Order::Resume, 4900).is_err());
    assert_eq!(cabin.sent(), [OperatorEvent::Hold]);
    // Everybody is told, but not of the many setpoints of a held key.
    let (known, _) = cabin.controls.hub.subscribe();
    let dropped: Vec<&str> = known.iter().map(|news| &*news.text).filter(|text| text.contains("dropped")).collect();
    assert_eq!(dropped.len(), late.len() - 1 + 3, "{dropped:?}");
    assert!(dropped[0].contains("resume dropped: it arrived 4.0 s late"), "{dropped:?}");
}

#[test]
fn a_page_that_is_back_is_told_for_how_long_the_drone_has_held() {
    let cabin = Cabin::new(true);
    let (pilot, mut told) = cabin.page(true);
    let held = |told: &mut mpsc::Receiver<Arc<str>>| -> Vec<Arc<str>> {
        std::iter::from_fn(|| told.try_recv().ok()).filter(|text| text.contains("\"held\"")).collect()
    };
    cabin.controls.heard(pilot, cabin.after(100));
    cabin.controls.check(cabin.after(900));
    cabin.controls.heard(pilot, cabin.after(3900));
    let texts = held(&mut told);
    assert!(texts.len() == 1 && texts[0].contains("\"away\":3.0"), "{texts:?}");
    // Noticed, and back before anything was done about it; and a flight that has keys as well.
    cabin.controls.leave(pilot, cabin.after(4000));
    let (_, mut told) = cabin.page(true);
    assert!(held(&mut told).is_empty());
}
