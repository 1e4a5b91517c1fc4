//! What a vehicle carries, in whole flights: sensors that stop it, a map that it is told, a gimbal that looks.

use spf_core::geometry::Pose;
use spf_envelope::BrakeLimits;
use spf_pilot::method::{Method, Sensed};
use spf_vlm::{Answer, ImageSpec, QueryImage, QueryRequest, Usage};

use super::ranges::beside_something;
use super::*;

/// A model that always says the same, after a second.
struct Says(&'static str);

impl Vlm for Says {
    fn name(&self) -> &str {
        "says"
    }

    fn image_spec(&self, _camera: (u32, u32)) -> ImageSpec {
        ImageSpec::default()
    }

    fn answer(&mut self, _request: &QueryRequest<'_>, _image: &mut dyn QueryImage) -> Answer {
        let latency = Duration::from_secs(1);
        Answer { text: Ok(self.0.to_owned()), latency, model: "says".to_owned(), account: Usage::default() }
    }
}

/// A flight of some seconds with such a model, with brake and map or without.
fn flown(
    autopilot: Autopilot,
    start: Pose,
    carry: impl FnOnce(&mut WiredVehicle),
    (says, seconds, feels): (&'static str, u64, bool),
) -> Flight {
    let world = SimWorld::new(park(), CraftKind::Quad, start, 5);
    let mut drone = WiredVehicle::new(world.clone(), autopilot, &[], none(), Vec::new());
    carry(&mut drone);
    drone.get_ready();
    let told = drone.told.clone();
    let vlm_factory: VlmFactory = Arc::new(move |_, _| Ok(Box::new(Says(says))));
    let site = Site::Real(Real { drone: Box::new(drone), clock: Clock::Virtual });
    let mut settings = PilotSettings { max_time: Duration::from_secs(seconds), ..PilotSettings::preset(Preset::Default) };
    settings.avoid = feels;
    settings.method = Method::for_craft(settings.is_guided(), feels, Sensed { ranges: feels, ..Sensed::default() });
    let brake = feels.then(BrakeLimits::without_sensor);
    let limits = Limits { brake, ..Limits::for_craft(&Craft::quad()) };
    let plan = FlightPlan { settings, limits, ..FlightPlan::new(site, "fly to the door", "says", vlm_factory) };
    let mut seen = Seen::default();
    flight::fly(plan, &mut [&mut seen]).unwrap();
    let told = core::mem::take(&mut *told.lock().unwrap());
    Flight { seen, told, world }
}

/// The model sees nothing in the way, and points at what is 4 m ahead as if it were 13 m.
#[test]
fn the_vehicle_s_own_sensors_stop_a_flight_before_what_the_model_does_not_see() {
    let start = beside_something(&park());
    let ahead = r#"{"status":"navigating","target":"door","point":[500,500],"depth":7,"boxes":[]}"#;
    let collides = |autopilot, feels| {
        let flight = flown(autopilot, start, WiredVehicle::measure_ranges, (ahead, 20, feels));
        !flight.world.truth().collided_with.is_empty()
    };
    for autopilot in BOTH {
        assert!(!collides(autopilot, true), "{autopilot:?}");
    }
    assert!(collides(Autopilot::ArduPilot, false), "without them it does not stop");
}

#[test]
fn what_the_map_shows_in_a_flight_is_told_to_a_vehicle_without_sensors() {
    let boxed = r#"{"status":"navigating","target":"door","point":[500,500],"depth":7,
        "boxes":[{"box":[300,450,700,550],"depth":4,"name":"glass door"}]}"#;
    for autopilot in BOTH {
        let flight = flown(autopilot, park().scene.start, |_| (), (boxed, 20, true));
        let told: Vec<(f64, usize)> = flight
            .told
            .sent
            .iter()
            .filter_map(|(at, sent)| match sent {
                Outgoing::Surroundings(scan) => {
                    Some((at.as_secs_f64(), scan.rays.iter().filter(|ray| ray.metres.is_some()).count()))
                }
                _ => None,
            })
            .collect();
        assert!(told.len() > 20 && told.iter().any(|(_, near)| *near > 0), "{autopilot:?}: {told:?}");
        assert!(told.windows(2).all(|pair| pair[1].0 - pair[0].0 > 0.19), "{autopilot:?}: five times a second at most");
    }
}

#[test]
fn in_a_flight_the_gimbal_looks_down_before_the_craft_sinks() {
    let looks = r#"{"status":"not_visible","look":"down"}"#;
    for autopilot in BOTH {
        let first = |carried: bool| {
            let carry = |drone: &mut WiredVehicle| {
                if carried {
                    drone.carry_gimbal(false);
                }
            };
            let flight = flown(autopilot, park().scene.start, carry, (looks, 14, false));
            let flying = flight.entered(Phase::Flying)[0];
            let landing = flight.entered(Phase::Landing)[0];
            let tilts = |it: &&Outgoing| matches!(it, Outgoing::Command(it) if it.command.id == ids::GIMBAL_PITCHYAW);
            let sinks = |it: &&Outgoing| matches!(it, Outgoing::Setpoint(setpoint) if setpoint.up < -0.1);
            flight.sent(flying, landing).into_iter().find(|it| tilts(it) || sinks(it)).map(|it| tilts(&it))
        };
        assert_eq!((first(true), first(false)), (Some(true), Some(false)), "{autopilot:?}");
    }
}
