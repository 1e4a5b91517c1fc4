//! Every fault in every phase of a flight, of the simulated quadrotor, and of the virtual Tello, PX4 and ArduPilot behind their
//! drivers, in virtual time.

mod column;
mod faults;
mod faulty;
mod model;
mod report;
mod watch;

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, OnceLock};

use spf_core::geometry::{Attitude, EnuPosition, Pose};
use spf_core::telemetry::FlightPhase;
use spf_core::time::{Duration, Time};
use spf_drone::Drone;
use spf_envelope::{BrakeLimits, Limits};
use spf_flight::flight::{FlightPlan, Site, fly};
use spf_flight::real::Real;
use spf_flight::sim::{LoadedScene, OracleVlm, SimDrone, SimWorld, VlmFactory};
use spf_flight::site::Clock;
use spf_flight::world::Script;
use spf_oracle::ErrorFile;
use spf_pilot::method::{Measured, Method};
use spf_pilot::{OperatorEvent, Phase, PilotSettings, Preset};
use spf_serve::fault::{CraftFault, FaultMachine, FaultPlan, Stream};
use spf_serve::tello::ProtocolParameters;
use spf_sim::depth_sensor::DepthSensor;
use spf_vlm::Vlm;

use self::faults::{FlightPart, Row, Sender, What};
use self::faulty::Faulty;
use self::model::Scripted;
use self::watch::Watch;
use crate::mavlink::wired::WiredVehicle;
use crate::wired::{Stranger, Wired};

pub(crate) use self::column::Column;
pub(crate) use self::report::{tables, tsv};

/// Time at which the operator of the phases `manual` and `landing` acts; both craft are flying by then.
const OPERATOR_AT: f64 = 12.0;
/// Duration of the manual flight.
const BY_HAND: f64 = 6.0;

/// Seed of the simulated craft.
const SEED: u64 = 5;
/// With a depth sensor: scene, start and instruction of `sim-obstacle-black-car/spf-depth/oracle-perfect/3` of the bench, where
/// something solid stands on the straight path to the car, 28 m away.
const OBSTACLES: &str = "city@488252265";
const BEFORE_OBSTACLES: ([f64; 3], f64) = ([76.026, 11.095, -0.1], -1.763);
const AROUND: &str = "Take off and fly to the black car (avoiding obstacles)";

/// Time limits of these flights: with the fault, and without it.
const GUIDED_TIME: Duration = Duration::from_secs(100);
const PHASE_TIME: Duration = Duration::from_secs(10);

fn among_obstacles() -> &'static Arc<LoadedScene> {
    static SCENE: OnceLock<Arc<LoadedScene>> = OnceLock::new();
    SCENE.get_or_init(|| Arc::new(LoadedScene::load(OBSTACLES).unwrap()))
}

/// A fault in a phase of a craft.
#[derive(Clone, Debug)]
pub(crate) struct Cell {
    pub(crate) column: Column,
    pub(crate) part: FlightPart,
    pub(crate) row: Row,
}

/// The result.
#[derive(Clone, Debug)]
pub(crate) struct Flown {
    /// Start of the fault, s.
    pub(crate) onset: f64,
    /// The last command with motion after the fault began, s after it.
    pub(crate) last_motion: Option<f64>,
    /// Outcome and cause.
    pub(crate) outcome: String,
    pub(crate) cause: String,
    /// The last command that the pilot cleared.
    pub(crate) last_command: String,
    /// The last setpoint or command that an autopilot was sent, and its flight mode at the end.
    pub(crate) told: Option<(String, String)>,
    /// The craft's true phase, and speed in m/s, at the end.
    pub(crate) phase: FlightPhase,
    pub(crate) speed: f64,
    /// With a depth sensor, the least distance of the craft's middle from anything solid in flight, m.
    pub(crate) nearest: Option<f64>,
    /// Motion without a fresh reason.
    pub(crate) violations: Vec<String>,
}

impl Cell {
    /// All cells of these columns.
    pub(crate) fn all(columns: [Column; 2]) -> Vec<Self> {
        let cell = |column, row: &Row, part| Self { column, part, row: row.clone() };
        let of = |row: Row| columns.into_iter().flat_map(move |column| FlightPart::ALL.map(|part| cell(column, &row, part)));
        faults::rows().into_iter().flat_map(of).collect()
    }

    /// Its name.
    pub(crate) fn name(&self) -> String {
        format!("{}, {}, {}", self.column.name(), self.row.name, self.part.name())
    }

    /// Why there is nothing to fly, if so.
    pub(crate) fn left_out(&self) -> Option<&'static str> {
        let is_quad = self.column == Column::Quad;
        match self.row.what {
            What::Craft(_) if self.column.autopilot().is_some() => Some("the virtual vehicle has no such fault"),
            What::Sender(_) if self.column.autopilot().is_some() => Some("packets have no sender in virtual time"),
            What::Depth(_) if self.column.autopilot().is_some() => Some("no driver reads a depth sensor"),
            What::Craft(CraftFault::ImuLost) => None,
            What::Craft(_) if is_quad => Some("the simulated quadrotor has no such fault"),
            What::Sender(_) if is_quad => Some("the simulated quadrotor is not reached by datagrams"),
            What::Depth(_) if !is_quad => Some("the Tello has no depth sensor"),
            What::Depth(_) if self.part != FlightPart::Executing => {
                Some("a flight with a depth sensor takes long; one phase is flown")
            }
            What::Thread if is_quad => Some("the simulated quadrotor is flown in the loop's own thread"),
            What::Craft(CraftFault::TakeOffRefused) | What::TakeOffLost if self.part != FlightPart::TakeOff => {
                Some("it can only occur during take-off")
            }
            _ => None,
        }
    }

    /// Flies it.
    pub(crate) fn fly(&self, scene: &Arc<LoadedScene>) -> Flown {
        let fair = self.fair(scene);
        // Before the fault begins, both flights are the same.
        let onset = match self.row.what {
            What::Craft(CraftFault::TakeOffRefused) => Time::ZERO,
            // Shortly before the command.
            What::TakeOffLost => fair.entered(Phase::TakeOff).unwrap() - Duration::from_millis(100),
            _ => fair.begin_of(self.part).unwrap_or_else(|| panic!("{}: never", self.name())),
        };
        let (watch, world, told) = self.fly_from(scene, Some(onset));
        let craft = world.shared_craft();
        let craft = craft.lock().unwrap();
        let speed = craft.truth().velocity.speed();
        let (outcome, cause) = watch.outcome.clone().unwrap();
        let mut violations = watch.violations.clone();
        if let Some((at, touched)) = craft.truth().collided_with.first().filter(|_| self.has_depth()) {
            violations.push(format!("at {at} it touches the object {touched}"));
        }
        // Datagrams from another address change nothing.
        let same = watch.outcome == fair.outcome && watch.last_motion == fair.last_motion;
        if matches!(self.row.what, What::Sender(Sender::Other)) && !same {
            violations.push(format!("not the flight without the fault: {:?}", fair.outcome));
        }
        Flown {
            onset: onset.as_secs_f64(),
            last_motion: watch.last_motion.filter(|at| *at > onset).map(|at| at.since(onset).as_secs_f64()),
            outcome: spf_flight::words::outcome(outcome).to_owned(),
            cause,
            last_command: watch.last_command.clone(),
            told,
            phase: craft.dynamics().phase(),
            speed,
            nearest: self.has_depth().then_some(watch.nearest),
            violations,
        }
    }

    /// The flight without the fault, which is the same for many cells.
    fn fair(&self, scene: &Arc<LoadedScene>) -> Arc<Watch> {
        type Key = (Column, bool, bool, bool, bool);
        static FLOWN: Mutex<BTreeMap<Key, Arc<Watch>>> = Mutex::new(BTreeMap::new());
        let is = |part| self.part == part;
        let (manual, landing) = (is(FlightPart::Manual), is(FlightPart::Landing));
        let key = (self.column, manual, landing, is(FlightPart::Searching), self.has_depth());
        let flown = FLOWN.lock().unwrap().get(&key).cloned();
        flown.unwrap_or_else(|| {
            let watch = Arc::new(self.fly_from(scene, None).0);
            FLOWN.lock().unwrap().insert(key, watch.clone());
            watch
        })
    }

    fn fly_from(&self, scene: &Arc<LoadedScene>, onset: Option<Time>) -> (Watch, SimWorld, Option<(String, String)>) {
        let scene = if self.has_depth() { among_obstacles() } else { scene };
        let world = SimWorld::new(scene.clone(), self.column.kind(), self.start(scene), SEED);
        let mut told = None;
        let plan = onset.map_or_else(FaultPlan::default, |onset| self.row.plan(onset.as_secs_f64()));
        let frames = |rule: &spf_serve::fault::Rule| rule.stream == Stream::Frames;
        // A Tello's state, commands and responses pass its virtual link; its driver receives the remainder.
        let (drone, outside): (Box<dyn Drone>, FaultPlan) = match self.column {
            Column::Px4 | Column::ArduPilot => {
                let (outside, inside) = plan.rules.into_iter().partition(frames);
                let faults = FaultPlan { rules: inside, craft: plan.craft };
                let autopilot = self.column.autopilot().unwrap();
                let mut wired = WiredVehicle::new(world.clone(), autopilot, column::parameters(autopilot), faults, Vec::new());
                wired.get_ready();
                wired.thread_dies_at = onset.filter(|_| matches!(self.row.what, What::Thread));
                told = Some(wired.told.clone());
                (Box::new(wired), FaultPlan { rules: outside, ..FaultPlan::default() })
            }
            Column::Quad => {
                let sensor = self.has_depth().then(DepthSensor::default);
                (Box::new(SimDrone::new(world.clone()).with_depth_sensor(sensor, SEED)), plan)
            }
            Column::Tello => {
                let (outside, inside) = plan.rules.into_iter().partition(frames);
                let faults = FaultPlan { rules: inside, craft: plan.craft };
                let mut wired = Wired::new(world.clone(), ProtocolParameters::default(), faults);
                wired.thread_dies_at = onset.filter(|_| matches!(self.row.what, What::Thread));
                if let What::Sender(sender) = self.row.what {
                    wired.stranger = onset.map(|from| Stranger { from, forges: sender == Sender::Forged });
                }
                (Box::new(wired), FaultPlan { rules: outside, ..FaultPlan::default() })
            }
        };
        let mut drone = Faulty::new(drone, FaultMachine::new(outside, 7).unwrap());
        let depth = match self.row.what {
            What::Depth(fault) => onset.map(|onset| (onset, fault)),
            _ => None,
        };
        drone.depth = depth;
        match self.row.what {
            What::Charge(charge) => drone.charge = onset.map(|onset| (onset, charge)),
            // The virtual Tello reports its own.
            What::Craft(CraftFault::ImuLost) if self.column == Column::Quad => drone.imu_error_from = onset,
            _ => {}
        }
        let fault = match self.row.what {
            What::Model(fault) => onset.map(|onset| (onset, fault)),
            _ => None,
        };
        let model: Box<dyn Vlm> = if self.has_depth() {
            let errors = ErrorFile::named("perfect").unwrap();
            Box::new(OracleVlm::new("oracle:perfect".to_owned(), world.clone(), errors, SEED))
        } else {
            Box::new(Scripted { searching: self.part == FlightPart::Searching, fault })
        };
        let model = Mutex::new(Some(model));
        let vlm_factory: VlmFactory = Arc::new(move |_, _| Ok(model.lock().unwrap().take().unwrap()));
        let site = Site::Real(Real { drone: Box::new(drone), clock: Clock::Virtual });
        let guided = self.has_depth();
        let max_time = match onset {
            // At the speed of a craft without depth, around the obstacle and to the target.
            Some(_) if guided => GUIDED_TIME,
            // Only to find the phase.
            None if guided => PHASE_TIME,
            _ => Duration::from_secs(45),
        };
        let settings = PilotSettings {
            max_time,
            avoid: guided,
            method: if guided { Method::Depth(Measured::View) } else { Method::Paper },
            ..PilotSettings::preset(Preset::Default)
        };
        let instruction = if guided { AROUND } else { "fly to the door" };
        let plan = FlightPlan { settings, script: self.script(), ..FlightPlan::new(site, instruction, "scripted", vlm_factory) };
        let brake = guided.then(BrakeLimits::with_sensor);
        let plan = FlightPlan { limits: Limits { brake, ..plan.limits.clone() }, ..plan };
        let mut watch = Watch::new(plan.limits.clone(), depth, guided.then(|| world.clone()));
        fly(plan, &mut [&mut watch]).unwrap();
        let told = told.map(|told| column::told_last(&told.lock().unwrap()));
        (watch, world, told)
    }

    /// Whether the craft has a depth sensor, and what goes with it.
    fn has_depth(&self) -> bool {
        matches!(self.row.what, What::Depth(_))
    }

    fn start(&self, scene: &LoadedScene) -> Pose {
        if !self.has_depth() {
            return scene.scene.start;
        }
        let ([east, north, up], heading) = BEFORE_OBSTACLES;
        Pose { position: EnuPosition { east, north, up }, attitude: Attitude { heading, ..Attitude::default() } }
    }

    fn script(&self) -> Script {
        let at = Time::from_secs_f64;
        match self.part {
            FlightPart::Manual => {
                let setpoint = |step: u32| {
                    let right = if step % 20 < 10 { 0.4 } else { -0.4 };
                    let setpoint = spf_core::command::Setpoint { right, ..spf_core::command::Setpoint::HOLD };
                    (at(OPERATOR_AT + 0.1 * f64::from(step)), OperatorEvent::Setpoint(setpoint))
                };
                let mut events: Vec<_> = (0..(BY_HAND * 10.0) as u32).map(setpoint).collect();
                events.push((at(OPERATOR_AT + BY_HAND + 1.0), OperatorEvent::Resume));
                Script::new(events)
            }
            FlightPart::Landing => Script::new(vec![(at(OPERATOR_AT), OperatorEvent::Land)]),
            _ => Script::default(),
        }
    }

    /// The error in a flight, if any: for any fault, nothing moves without a fresh reason, and the craft ends on the
    /// ground, or at rest if no command reaches it.
    pub(crate) fn problems(&self, flown: &Flown) -> Vec<String> {
        let mut problems = flown.violations.clone();
        let safe = match flown.phase {
            FlightPhase::OnGround | FlightPhase::Stopped => true,
            // A Tello lands by itself; the simulated quadrotor hovers, and so does ArduPilot. PX4 lands, but for a take-off: it ends
            // that by itself, and then holds.
            _ if self.row.commands_arrive || flown.speed >= 0.1 => false,
            _ => self.column != Column::Tello && (self.column != Column::Px4 || self.part == FlightPart::TakeOff),
        };
        if !safe {
            problems.push(format!("left {:?} at {:.2} m/s", flown.phase, flown.speed));
        }
        problems
    }
}

/// Flies cells on two threads, in order.
pub(crate) fn fly_all(cells: &[Cell], scene: &Arc<LoadedScene>) -> Vec<Option<Flown>> {
    let next = std::sync::atomic::AtomicUsize::new(0);
    let flown: Vec<Mutex<Option<Flown>>> = cells.iter().map(|_| Mutex::new(None)).collect();
    std::thread::scope(|scope| {
        for _ in 0..2 {
            scope.spawn(|| {
                while let Some(index) = Some(next.fetch_add(1, std::sync::atomic::Ordering::Relaxed)).filter(|i| *i < cells.len())
                {
                    if cells[index].left_out().is_none() {
                        *flown[index].lock().unwrap() = Some(cells[index].fly(scene));
                    }
                }
            });
        }
    });
    flown.into_iter().map(|flown| flown.into_inner().unwrap()).collect()
}
