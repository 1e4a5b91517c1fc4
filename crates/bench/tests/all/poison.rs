//! Pilot, map, anchor and planner get only what drivers and the VLM deliver.
//!
//! A task is flown twice. First as the bench flies it: from the simulated site, whose world judge and recorder share. Then sealed:
//! the flight gets a driver and a VLM, and no world at all, and the world that both sense is swapped for a decoy whenever
//! neither of them senses. So while pilot, observers and judge run, true pose, actors, ids, depths and frames are those of another
//! craft elsewhere, and the judge judges that one. Whatever else than deliveries had an influence in either flight, the commands
//! would differ.

use std::path::Path;
use std::sync::{Arc, Mutex};

use spf_bench::judge::Judge;
use spf_bench::task::{Task, shipped};
use spf_bench::trial::{Method, Networks, Sampled, Trial, VlmUnderTest, draw};
use spf_core::command::Command;
use spf_core::frame::FrameId;
use spf_core::geometry::{EnuPosition, Pose};
use spf_core::time::{Time, duration_from_secs};
use spf_drone::frames::Frames;
use spf_drone::{Capabilities, Drone, DroneError, DroneEvent};
use spf_envelope::{BrakeLimits, Cleared, Limits};
use spf_flight::flight::{FlightPlan, Site, fly};
use spf_flight::real::Real;
use spf_flight::recorder::RecordPlan;
use spf_flight::run::Observer;
use spf_flight::sim::{FlightConditions, OracleVlm, SimDrone, SimWorld, VlmFactory, oracle_factory};
use spf_flight::site::Clock;
use spf_oracle::ErrorFile;
use spf_pilot::method::{self, Measured};
use spf_pilot::{Pilot, PilotSettings, Preset};
use spf_record::log::LogReader;
use spf_record::out_dir::OutDir;
use spf_render::Channels;
use spf_sim::craft::SimCraft;
use spf_sim::depth_sensor::DepthSensor;
use spf_vlm::{Answer, ImageSpec, QueryImage, QueryRequest, Vlm};

/// A world that is the true one only while somebody senses it.
#[derive(Clone)]
struct SealedWorld {
    world: SimWorld,
    /// The decoy while the world is open, the true craft while it is sealed.
    other: Arc<Mutex<SimCraft>>,
}

impl SealedWorld {
    fn new(world: SimWorld, decoy: &SimWorld) -> Self {
        let other = decoy.shared_craft();
        let sealed = Self { world, other };
        sealed.swap();
        sealed
    }

    fn swap(&self) {
        let here = self.world.shared_craft();
        core::mem::swap(&mut *here.lock().unwrap(), &mut *self.other.lock().unwrap());
    }

    fn opened<T>(&self, sense: impl FnOnce() -> T) -> T {
        self.swap();
        let sensed = sense();
        self.swap();
        sensed
    }
}

/// A driver, or a VLM, that senses a sealed world.
struct Sealed<T> {
    world: SealedWorld,
    sense: T,
}

impl Drone for Sealed<SimDrone> {
    fn name(&self) -> &str {
        self.sense.name()
    }

    fn capabilities(&self) -> Capabilities {
        self.world.opened(|| self.sense.capabilities())
    }

    fn frames(&self) -> Arc<dyn Frames> {
        self.sense.frames()
    }

    fn apply(&mut self, now: Time, command: &Cleared<Command>) -> Result<(), DroneError> {
        self.world.opened(|| self.sense.apply(now, command))
    }

    fn next_event(&mut self, until: Time) -> Option<(Time, DroneEvent)> {
        self.world.opened(|| self.sense.next_event(until))
    }

    fn next_event_at(&self) -> Option<Time> {
        self.sense.next_event_at()
    }
}

impl Vlm for Sealed<OracleVlm> {
    fn name(&self) -> &str {
        self.sense.name()
    }

    fn image_spec(&self, camera: (u32, u32)) -> ImageSpec {
        self.sense.image_spec(camera)
    }

    fn answer(&mut self, request: &QueryRequest<'_>, image: &mut dyn QueryImage) -> Answer {
        self.world.opened(|| self.sense.answer(request, image))
    }
}

/// Judges the sealed world, as it is while the pilot decides, and looks at everything that it offers.
struct Misled {
    world: SimWorld,
    judge: Judge,
    looked: u32,
}

impl Observer for Misled {
    fn time(&mut self, now: Time, pilot: &Pilot) {
        if self.looked as u128 * 500 > now.as_nanos() as u128 / 1_000_000 {
            return;
        }
        self.looked += 1;
        let snapshot = self.world.now();
        self.judge.look(now, &snapshot);
        let image = self.world.look(&snapshot, Channels { ids: true, ..Channels::default() });
        assert!(image.ids.is_some());
        let _ = (self.world.capture(FrameId(self.looked.into())), self.world.truth());
        // The decoy stands where it is.
        let away = snapshot.pose.position.distance(decoy_start(&self.world).position);
        assert!(away < 1.0, "{:?} {away}", pilot.phase());
    }
}

/// A corner of the scene, far from the craft.
fn decoy_start(world: &SimWorld) -> Pose {
    let start = world.loaded().scene.start;
    Pose { position: EnuPosition { east: start.position.east + 2.0, ..start.position }, ..start }
}

/// The commands of a log, as written, and how many decisions led to them.
fn commands(folder: &Path) -> (Vec<(Time, Vec<u8>)>, usize) {
    let entries: Vec<_> = LogReader::open(&folder.join("flight.mcap")).unwrap().map(|entry| entry.unwrap()).collect();
    let decisions = entries.iter().filter(|entry| entry.topic == "/decision").count();
    let commands = entries.into_iter().filter(|entry| entry.topic == "/command");
    (commands.map(|entry| (entry.time, entry.data.to_vec())).collect(), decisions)
}

fn record(folder: &Path) -> RecordPlan {
    RecordPlan { out: OutDir::at(folder).unwrap(), video: false, view: None }
}

/// As the bench flies it.
fn plain(task: &Arc<Task>, drawn: &Sampled, errors: &str, seed: u64, folder: &Path) {
    let name = format!("oracle:{errors}");
    let vlm_factory = oracle_factory(name.clone(), ErrorFile::named(errors).unwrap());
    let pointer = Some(VlmUnderTest { vlm_factory, name, latency: None });
    let method = Method::of_name("spf-depth").unwrap();
    let trial = Trial { task: task.clone(), method, pointer, seed, max_cost_usd: None, networks: Networks::default() };
    assert_eq!(trial.fly(drawn, Some(record(folder))).record.error, None);
}

/// With nothing but a driver and a VLM.
fn sealed(task: &Arc<Task>, drawn: &Sampled, errors: &str, seed: u64, folder: &Path) {
    let loaded = &drawn.loaded;
    let conditions = FlightConditions { wind: drawn.wind, ..FlightConditions::default() };
    let brief = Arc::new(task.brief(loaded, drawn.start.position));
    let world = SimWorld::under(&conditions, loaded.clone(), task.craft, drawn.start, seed).with_brief(Some(brief));
    let decoy = SimWorld::under(&conditions, loaded.clone(), task.craft, decoy_start(&world), seed + 1);
    let drone = SimDrone::new(world.clone()).with_depth_sensor(Some(DepthSensor::default()), seed);
    let name = format!("oracle:{errors}");
    let vlm = OracleVlm::new(name.clone(), world.clone(), ErrorFile::named(errors).unwrap(), seed);
    let world = SealedWorld::new(world, &decoy);
    let vlm = Mutex::new(Some(Sealed { world: world.clone(), sense: vlm }));
    let vlm_factory: VlmFactory = Arc::new(move |none, _| {
        assert!(none.is_none());
        Ok(Box::new(vlm.lock().unwrap().take().unwrap()))
    });
    let mut misled =
        Misled { world: world.world.clone(), judge: Judge::new(task, loaded.clone(), drawn.start).unwrap(), looked: 0 };
    let site = Site::Real(Real { drone: Box::new(Sealed { world, sense: drone }), clock: Clock::Virtual });
    let plan = FlightPlan {
        limits: Limits { brake: Some(BrakeLimits::with_sensor()), ..loaded.limits(task.craft) },
        settings: PilotSettings {
            avoid: task.avoid,
            max_time: duration_from_secs(task.max_time),
            max_decisions: task.max_decisions,
            near_m: Some(loaded.scene.near),
            method: method::Method::Depth(Measured::View),
            ..PilotSettings::preset(Preset::Default)
        },
        record: Some(record(folder)),
        ..FlightPlan::new(site, &task.instruction, &name, vlm_factory)
    };
    let flown = fly(plan, &mut [&mut misled]).unwrap();
    assert!(flown.recording_problems.is_empty(), "{:?}", flown.recording_problems);
    assert!(misled.looked > 10 && !misled.judge.holds());
}

#[test]
fn with_truth_ids_and_judge_poisoned_after_sensing_the_commands_are_the_same() {
    let (errors, seed) = ("perfect", 0);
    // Long enough for several decisions and a hundred commands.
    let task = Arc::new(Task { max_time: 20.0, ..shipped("real-obstacle-cone").unwrap().unwrap() });
    let drawn = draw(&task, seed).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let (one, other) = (folder.path().join("plain"), folder.path().join("sealed"));
    plain(&task, &drawn, errors, seed, &one);
    sealed(&task, &drawn, errors, seed, &other);
    let ((plain, decisions), (sealed, same)) = (commands(&one), commands(&other));
    assert!(plain.len() > 100 && decisions > 3, "{} commands, {decisions} decisions", plain.len());
    let differs = plain.iter().zip(&sealed).position(|(a, b)| a != b);
    let told = |at: usize| format!("{}\n{}", String::from_utf8_lossy(&plain[at].1), String::from_utf8_lossy(&sealed[at].1));
    assert_eq!(differs.map(told), None);
    assert_eq!((plain.len(), decisions), (sealed.len(), same));
}
