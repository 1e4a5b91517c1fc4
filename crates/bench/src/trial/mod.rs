//! One trial: sampled, flown, judged and measured.

mod draw;
mod latency;
mod method;
mod path;
mod record;
mod signs;
mod watch;

use std::sync::atomic::Ordering;
use std::sync::{Arc, OnceLock};

use serde::Serialize;
use spf_core::geometry::{EnuPosition, Pose};
use spf_core::prompt::PromptText;
use spf_envelope::{BrakeLimits, Limits};
use spf_flight::depth_network::DepthPlan;
use spf_flight::detector::DetectorPlan;
use spf_flight::flight::{FlightPlan, Site, fly};
use spf_flight::recorder::RecordPlan;
use spf_flight::run::Observer;
use spf_flight::sim::{FlightConditions, SimWorld, Simulated, VlmFactory, oracle_factory};
use spf_flight::summary::{Summary, VerifiedBy};
use spf_oracle::ErrorFile;
use spf_pilot::method::{Measured, Method as PilotMethod};
use spf_pilot::{Outcome, PilotSettings};
use spf_scene::geometry::ObjectId;
use spf_sim::depth_sensor::DepthSensor;
use spf_sim::model::Model;
use spf_vlm::Vlm;
use spf_vlm::service::{Fate, RunEnd, Service};

use crate::fnv;
use crate::judge::Judge;
use crate::measures::{Course, GoalDistance, shortest};
use crate::stats::percentile;
use crate::task::{GoalKind, Task, TaskSet, centre};
pub use draw::{SampleError, Sampled, draw};
use latency::Timed;
pub use latency::split_latency;
pub use method::{Method, NO_VLM};
pub use path::FlownPath;
pub use record::{Milliseconds, Record, Scores, VlmDetails, run_id};
pub use signs::SignFigures;
use signs::SignWatch;
use watch::{Findings, Watcher};

/// The detector used with a model.
const DETECTOR: &str = "oracle:default";

/// A VLM under test: its name, and how it is created.
#[derive(Clone)]
pub struct VlmUnderTest {
    /// Its name on the command line.
    pub name: String,
    /// Creates the VLM of a trial.
    pub vlm_factory: VlmFactory,
    /// Fixed latency of its replies, seconds; `None` for its own latency.
    pub latency: Option<f64>,
}

/// The result of a trial.
#[derive(Clone, Debug, PartialEq)]
pub struct Flown {
    /// Its row of `results.jsonl`.
    pub record: Record,
    /// Its row of `paths.jsonl`; without positions if it was not flown.
    pub path: FlownPath,
}

/// A trial that is none: the service behind its VLM failed, or the run was stopped. It has no row, and is flown again when the run
/// is resumed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lost {
    /// Cost of its queries, US dollars.
    pub cost_usd: f64,
}

/// Neural networks that take the place of what the simulator gives a method.
#[derive(Clone, Default)]
pub struct Networks {
    /// In place of the simulated detector, of methods with one.
    pub detector: Option<DetectorPlan>,
    /// In place of the depth sensor, of methods with one.
    pub depth: Option<DepthPlan>,
}

/// The depth network of a trial failed, or took too long.
#[derive(Debug, thiserror::Error)]
#[error("the depth network was given up in flight")]
struct NetworkLost;

/// Revision of the source from which the program was built, with a `+` if files differed from it; empty if it is not known.
pub const GIT_REV: &str =
    git_version::git_version!(args = ["--always", "--dirty=+", "--abbrev=12", "--exclude=*"], fallback = "");

/// How the VLM is queried.
#[derive(Clone, Copy)]
struct QuerySettings {
    /// Image width and height, pixels.
    size: (u32, u32),
    temperature: Option<f64>,
}

/// One trial of a plan.
#[derive(Clone)]
pub struct Trial {
    /// The task.
    pub task: Arc<Task>,
    /// The method.
    pub method: Method,
    /// The VLM; `None` for the blind control.
    pub pointer: Option<VlmUnderTest>,
    /// The seed.
    pub seed: u64,
    /// Cost limit of this trial, US dollars.
    pub max_cost_usd: Option<f64>,
    /// What takes the place of what the simulator gives the method.
    pub networks: Networks,
}

impl Trial {
    /// Name of the VLM.
    #[must_use]
    pub fn vlm(&self) -> &str {
        self.pointer.as_ref().map_or(NO_VLM, |pointer| &pointer.name)
    }

    /// Its id in `results.jsonl`.
    #[must_use]
    pub fn run_id(&self) -> String {
        run_id(&self.task.id, self.method.name(), self.vlm(), self.seed)
    }

    /// Flies it from the sampled start. Never fails: a trial that cannot be flown results in a row with an `error`.
    #[must_use]
    pub fn fly(&self, drawn: &Sampled, record: Option<RecordPlan>) -> Flown {
        self.fly_observed(drawn, record, &mut [])
    }

    /// The same, with observers beside the judge.
    #[must_use]
    pub fn fly_observed(&self, drawn: &Sampled, record: Option<RecordPlan>, others: &mut [&mut dyn Observer]) -> Flown {
        self.fly_guarded(drawn, record, others, None)
    }

    /// Flies it as a part of a run, whose service its queries share.
    ///
    /// # Errors
    /// [`Lost`] if the run ended in it, or none of its queries was answered, which ends the run.
    pub fn fly_served(&self, drawn: &Sampled, record: Option<RecordPlan>, service: &Arc<Service>) -> Result<Flown, Lost> {
        self.fly_served_observed(drawn, record, &mut [], service)
    }

    /// The same, with observers beside the judge.
    ///
    /// # Errors
    /// [`Lost`] as for [`Self::fly_served`].
    pub fn fly_served_observed(
        &self,
        drawn: &Sampled,
        record: Option<RecordPlan>,
        others: &mut [&mut dyn Observer],
        service: &Arc<Service>,
    ) -> Result<Flown, Lost> {
        let fate = Fate::default();
        let flown = self.fly_guarded(drawn, record, others, Some((service, &fate)));
        let lost = Lost { cost_usd: fate.cost_usd() };
        if let Some(error) = fate.unanswered() {
            service.end(RunEnd::Unanswered { vlm: self.vlm().to_owned(), error });
            return Err(lost);
        }
        if fate.lost().load(Ordering::Relaxed) > 0 { Err(lost) } else { Ok(flown) }
    }

    fn fly_guarded(
        &self,
        drawn: &Sampled,
        record: Option<RecordPlan>,
        others: &mut [&mut dyn Observer],
        run: Option<(&Arc<Service>, &Fate)>,
    ) -> Flown {
        let judge = match Judge::new(&self.task, drawn.loaded.clone(), drawn.start) {
            Ok(judge) => judge,
            Err(error) => return self.failed(Some(drawn), &error),
        };
        let (world, query_settings) = (Arc::new(OnceLock::new()), Arc::new(OnceLock::new()));
        let reference = self.reference(drawn, &judge);
        let mut plan = self.plan(drawn, world.clone(), query_settings.clone(), record, run);
        if self.method.is_fenced() {
            match signs::fence(&self.task, &reference, drawn.start.position) {
                Ok(fence) => plan.limits.geofence = Some(fence),
                Err(error) => return self.failed(Some(drawn), &error),
            }
        }
        let signs = SignWatch::new(&self.task, &drawn.loaded, drawn.start.position, reference, plan.limits.clone());
        let mut watcher = Watcher::new(world, judge, signs);
        let mut observers: Vec<&mut dyn Observer> = vec![&mut watcher];
        observers.extend(others.iter_mut().map(|other| &mut **other as &mut dyn Observer));
        let given_up = plan.depth_network.as_ref().map(|network| network.given_up.clone());
        match fly(plan, &mut observers) {
            // Without its network it was another method's flight.
            Ok(_) if given_up.is_some_and(|given_up| given_up.load(Ordering::Relaxed)) => self.failed(Some(drawn), &NetworkLost),
            Ok(flown) => {
                let mut flown = self.scored(drawn, watcher, flown.summary);
                if let Some(query_settings) = query_settings.get() {
                    flown.record.vlm_details.image_px = Some([query_settings.size.0, query_settings.size.1]);
                    flown.record.vlm_details.temperature = query_settings.temperature;
                }
                flown
            }
            Err(error) => self.failed(Some(drawn), &error),
        }
    }

    /// The rows of a trial that could not be flown.
    #[must_use]
    pub fn failed(&self, drawn: Option<&Sampled>, error: &dyn std::error::Error) -> Flown {
        let mut why = error.to_string();
        let mut source = error.source();
        while let Some(cause) = source {
            why = format!("{why}: {cause}");
            source = cause.source();
        }
        let record = Record { error: Some(why), ..self.blank(drawn) };
        Flown { path: FlownPath { run_id: record.run_id.clone(), ..FlownPath::default() }, record }
    }

    /// `world` and `query_settings` receive the world and the query settings when the VLM is created.
    fn plan(
        &self,
        drawn: &Sampled,
        world: Arc<OnceLock<SimWorld>>,
        query_settings: Arc<OnceLock<QuerySettings>>,
        record: Option<RecordPlan>,
        run: Option<(&Arc<Service>, &Fate)>,
    ) -> FlightPlan {
        let task = &self.task;
        let vlm_factory = match &self.pointer {
            Some(pointer) => pointer.vlm_factory.clone(),
            None => method::blind(if task.set == TaskSet::Simulation { 5.0 } else { 1.0 }),
        };
        let (fixed, delay) = (self.pointer.as_ref().and_then(|pointer| pointer.latency), task.vlm_delay);
        let guard = run.map(|(service, fate)| (service.clone(), fate.clone()));
        let seen: VlmFactory = Arc::new(move |of, seed| {
            let vlm = vlm_factory(of, seed)?;
            let vlm: Box<dyn Vlm> = match &guard {
                Some((service, fate)) => Box::new(service.guard(vlm, fate)),
                None => vlm,
            };
            // A flight has one world, requested once.
            if let Some(of) = of {
                let camera = of.camera();
                let frame = (camera.width, camera.height);
                let size = vlm.image_spec(frame).image_size.unwrap_or(frame);
                query_settings.get_or_init(|| QuerySettings { size, temperature: vlm.temperature() });
                drop(world.set(of.clone()));
            }
            Ok(Box::new(Timed { vlm, fixed, delay, seed }))
        });
        let brief = Arc::new(task.brief(&drawn.loaded, drawn.start.position));
        let site = Simulated {
            start: Some(drawn.start),
            kind: task.craft,
            flight_conditions: FlightConditions {
                wind: drawn.wind,
                depth_sensor: self.has_depth_sensor().then(DepthSensor::default),
                ..FlightConditions::default()
            },
            seed: self.seed,
            brief: Some(brief.clone()),
            ..Simulated::new(drawn.loaded.clone(), &drawn.scene)
        };
        let site = Site::Simulated(site);
        FlightPlan {
            limits: Limits { brake: self.brake(), ..site.limits() },
            policy: self.method.policy_maker(&brief),
            preset: self.method.preset(),
            settings: self.settings(),
            detector: self.detector(),
            // Whether it is given up is told of each flight.
            depth_network: self.depth_network().map(|network| DepthPlan { given_up: Arc::default(), ..network.clone() }),
            max_cost_usd: self.max_cost_usd,
            record,
            // A flight whose queries are taken away ends at once.
            interrupts: run.map_or_else(Arc::default, |(_, fate)| fate.lost().clone()),
            ..FlightPlan::new(site, &task.instruction, self.vlm(), seen)
        }
    }

    /// The method's brake.
    fn brake(&self) -> Option<BrakeLimits> {
        match self.method.brake_and_depth() {
            (false, _) => None,
            (true, false) => Some(BrakeLimits::without_sensor()),
            (true, true) if self.depth_network().is_some() => Some(BrakeLimits::with_network()),
            (true, true) => Some(BrakeLimits::with_sensor()),
        }
    }

    /// The depth network, if one takes the place of the method's sensor.
    fn depth_network(&self) -> Option<&DepthPlan> {
        self.networks.depth.as_ref().filter(|_| self.method.brake_and_depth().1)
    }

    fn has_depth_sensor(&self) -> bool {
        self.method.brake_and_depth().1 && self.networks.depth.is_none()
    }

    fn settings(&self) -> PilotSettings {
        let settings = self.method.settings(&self.task);
        match self.depth_network() {
            // As in flights: what a network sees is checked against boxes as well.
            Some(_) => PilotSettings { method: PilotMethod::Depth(Measured::Part), avoid: true, ..settings },
            None => settings,
        }
    }

    /// The detector, if the method uses one: the trial's own oracle, with the same percept; the default oracle
    /// if a model is used. Both only detect COCO classes.
    fn detector(&self) -> Option<DetectorPlan> {
        if let (Some(network), true) = (&self.networks.detector, self.method.has_detector()) {
            return Some(network.clone());
        }
        let own = provider(self.vlm()) == "oracle";
        let name = if own { self.vlm() } else { DETECTOR }.to_owned();
        let factory = (!own).then(|| oracle_factory(name.clone(), ErrorFile::default()));
        self.method.has_detector().then_some(DetectorPlan { name, factory })
    }

    /// A digest of what determines the flight besides scene, start and VLM.
    fn params_hash(&self) -> String {
        format!("{:016x}", fnv(self.params().to_string().as_bytes()))
    }

    /// Policy, preset and craft by their names, what the method changes of the settings and limits that these have, its parts, and
    /// the prompt. Keys are sorted, so that the order of fields in the code is no part of it.
    fn params(&self) -> serde_json::Value {
        let (policy, preset) = (self.method.policy(), self.method.preset());
        let usual = Limits::for_craft(&Model::of(self.task.craft).craft);
        let limits = Limits { brake: self.brake(), ..usual.clone() };
        let mut params = serde_json::json!({
            "craft": self.task.craft,
            "depth_sensor": self.has_depth_sensor(),
            "detector": self.method.has_detector(),
            "fence": self.method.is_fenced(),
            "limits": changed(&limits, &usual),
            "policy": policy.name(),
            "preset": preset,
            "prompt": PromptText::shipped(policy.prompt()).source(),
            "settings": changed(&self.settings(), &PilotSettings::preset(preset)),
        });
        // Only where there is one: the digests of the others stay as they are.
        let mut add = |what: &str, name: Option<&String>| {
            if let Some(name) = name {
                params[what] = name.clone().into();
            }
        };
        add("depth_network", self.depth_network().map(|network| &network.details));
        add(
            "detector_network",
            self.networks.detector.as_ref().filter(|_| self.method.has_detector()).map(|network| &network.name),
        );
        params.sort_all_objects();
        params
    }

    /// Description of the reply latency.
    fn latency_model(&self) -> String {
        let own = match &self.pointer {
            None => "fixed".to_owned(),
            Some(VlmUnderTest { latency: Some(seconds), .. }) => format!("fixed {seconds} s"),
            Some(pointer) if provider(&pointer.name) == "oracle" => "log-normal".to_owned(),
            Some(_) => "measured".to_owned(),
        };
        self.task.vlm_delay.map_or(own.clone(), |[least, most]| format!("{own} + uniform {least} to {most} s"))
    }

    /// A row with what is known before the flight.
    fn blank(&self, drawn: Option<&Sampled>) -> Record {
        let task = &self.task;
        Record {
            run_id: self.run_id(),
            program: env!("CARGO_PKG_VERSION").to_owned(),
            git_rev: GIT_REV.to_owned(),
            task: task.id.clone(),
            set: task.set,
            category: task.category,
            method: self.method.name().to_owned(),
            params_hash: self.params_hash(),
            latency_model: self.latency_model(),
            answered_by: None,
            scores: Scores::default(),
            error: None,
            scene_id: drawn.map_or_else(|| task.scene.clone(), |drawn| drawn.scene.clone()),
            start_pose: drawn.map_or_else(Pose::default, |drawn| drawn.start),
            start_in_view: drawn.and_then(|drawn| drawn.in_view),
            start_range_m: drawn.and_then(|drawn| drawn.range),
            goal: Vec::new(),
            goals: task.goals.len(),
            goals_met: 0,
            osr: false,
            spl: 0.0,
            shortest_m: 0.0,
            ndtw: 0.0,
            sdtw: 0.0,
            ttfm_s: None,
            min_clearance_m: None,
            n_vlm_calls: 0,
            tokens_in: 0,
            tokens_out: 0,
            cost_usd: None,
            latency_ms: None,
            frame_age_ms_p95: None,
            parse_failures: 0,
            rejected_waypoints: 0,
            shield_interventions: 0,
            vlm_details: VlmDetails { provider: provider(self.vlm()), ..VlmDetails::default() },
            signs: None,
            flight: None,
        }
    }

    fn scored(&self, drawn: &Sampled, watcher: Watcher, summary: Summary) -> Flown {
        let (mut found, judge) = watcher.into_findings();
        let stage = &drawn.loaded;
        let scores = self.scores(&found);
        let (reference, radius_m) = (self.reference(drawn, &judge), self.task.set.radius());
        let course = Course { shortest_m: shortest(&reference, radius_m), reference, radius_m };
        let distance = GoalDistance { least_m: found.least_distance, final_m: found.distance };
        let navigation = course.measure(&found.path, distance, scores.strict, scores.collided);
        let goal: Vec<String> = judge.last_targets().iter().map(|id| stage.key(*id)).collect();
        let usage = summary.vlm_use.clone();
        let base = self.blank(Some(drawn));
        let landed_elsewhere = scores.false_stop;
        let signs = found.signs.take().map(|figures| SignFigures { landed_elsewhere, ..figures });
        let keys = |ids: &[ObjectId]| ids.iter().map(|id| stage.key(*id)).collect();
        let path = core::mem::take(&mut found.trace).into_path(self.run_id(), judge.targets().map(keys).collect());
        let record = Record {
            signs,
            goals_met: judge.met().max(if found.holds_at_end { self.task.goals.len() } else { 0 }),
            osr: navigation.oracle_success,
            spl: navigation.spl,
            sdtw: navigation.sdtw,
            ndtw: navigation.ndtw,
            shortest_m: course.shortest_m,
            ttfm_s: found.first_motion.map(spf_core::time::Time::as_secs_f64),
            min_clearance_m: found.clearance,
            n_vlm_calls: usage.as_ref().map_or(found.latencies.len() as u32 + found.given_up, |usage| usage.questions),
            tokens_in: usage.as_ref().map_or(0, |usage| usage.tokens_in),
            tokens_out: usage.as_ref().map_or(0, |usage| usage.tokens_out + usage.tokens_thinking),
            cost_usd: usage.as_ref().and_then(|usage| usage.cost_usd),
            latency_ms: milliseconds(&found.latencies),
            frame_age_ms_p95: percentile(&found.frame_ages, 0.95).map(|age| 1e3 * age),
            parse_failures: found.given_up,
            rejected_waypoints: found.refused,
            shield_interventions: found.interventions,
            vlm_details: VlmDetails {
                models: usage.map_or_else(Vec::new, |usage| usage.models.into_keys().collect()),
                ..base.vlm_details
            },
            flight: Some(Summary {
                cause: found.cause.unwrap_or(summary.cause),
                verified: Some(found.holds_at_end && !scores.collided),
                verified_by: Some(VerifiedBy::Task),
                not_read: Vec::new(),
                // The task's own goal judges.
                followed: None,
                final_distance_m: found.distance,
                target_in_view: found.sees,
                targets: goal.clone(),
                ..summary
            }),
            goal,
            scores,
            ..base
        };
        Flown { record, path }
    }

    fn scores(&self, found: &Findings) -> Scores {
        let outcome = found.outcome;
        let done = found.holds_at_end && found.untouched;
        let reported_done = outcome == Some(Outcome::Reached);
        // Following is never reported as done: the time limit ends it.
        let follows = matches!(self.task.goals.last().map(|goal| goal.kind), Some(GoalKind::Follow { .. }));
        let ended = reported_done || (follows && outcome == Some(Outcome::Timeout));
        let within = |metres: f64| found.distance.is_some_and(|distance| distance <= metres);
        Scores {
            strict: done && ended,
            paper: found.paper.is_some(),
            paper_s: found.paper.map(spf_core::time::Time::as_secs_f64),
            false_stop: reported_done && !done,
            success_1m: within(1.0),
            success_5m: within(5.0),
            success_20m: within(20.0),
            collided: !found.untouched,
            timeout: outcome == Some(Outcome::Timeout),
            landed_by_failsafe: matches!(outcome, Some(Outcome::Failed | Outcome::Aborted)),
        }
    }

    /// Straight from above the start past each goal's nearest object.
    fn reference(&self, drawn: &Sampled, judge: &Judge) -> Vec<EnuPosition> {
        let stage = &drawn.loaded;
        let up = drawn.start.position.up + Model::of(self.task.craft).craft.take_off_height;
        let mut path = vec![EnuPosition { up, ..drawn.start.position }];
        for targets in judge.targets() {
            let from = path[path.len() - 1];
            let places = targets.iter().filter_map(|id| stage.scene.object(*id)).map(|object| centre(&object.bounds));
            path.extend(places.min_by(|a, b| a.distance(from).total_cmp(&b.distance(from))));
        }
        path
    }
}

fn provider(vlm: &str) -> String {
    vlm.split(['#', ':', '@']).next().unwrap_or_default().to_owned()
}

fn milliseconds(seconds: &[f64]) -> Option<Milliseconds> {
    let at = |fraction| percentile(seconds, fraction).map(|value| 1e3 * value);
    Some(Milliseconds { p50: at(0.5)?, p95: at(0.95)?, p99: at(0.99)?, max: at(1.0)? })
}

/// The fields of a value that differ from those of the usual one, serialised; `null` for one that only the usual one has.
fn changed<T: Serialize>(value: &T, usual: &T) -> serde_json::Value {
    let fields = |value: &T| match serde_json::to_value(value) {
        Ok(serde_json::Value::Object(fields)) => fields,
        _ => serde_json::Map::new(),
    };
    let (value, usual) = (fields(value), fields(usual));
    let names = value.keys().chain(usual.keys());
    let differs = |name: &&String| value.get(*name) != usual.get(*name);
    names.filter(differs).map(|name| (name.clone(), value.get(name).cloned().unwrap_or_default())).collect()
}

#[cfg(test)]
mod tests {
    use serde_json::{Value, json};

    use super::*;
    use crate::task::shipped;

    fn trial(method: &str, task: &str) -> Trial {
        let task = Arc::new(shipped(task).unwrap().unwrap());
        Trial {
            task,
            method: Method::of_name(method).unwrap(),
            pointer: None,
            seed: 0,
            max_cost_usd: None,
            networks: Networks::default(),
        }
    }

    #[test]
    fn the_digest_is_made_from_what_differs_from_the_preset() {
        let settings = |method| trial(method, "real-long-cones").params()["settings"].clone();
        let same = settings("spf");
        // The task's own limits.
        assert!(same.as_object().unwrap().keys().all(|key| ["max_time", "max_decisions"].contains(&key.as_str())), "{same}");
        let paper = settings("spf-paper");
        assert_eq!(paper, same, "the preset is named beside it");
        let mut step = settings("spf-step-1m");
        let fixed = step.as_object_mut().unwrap().shift_remove("step");
        assert_eq!((fixed, step), (Some(json!({ "fixed": 1.0 })), same));
        let brake = |method| trial(method, "real-long-cones").params()["limits"].clone();
        assert_eq!(brake("spf"), json!({}));
        assert!(matches!(&brake("spf-depth")["brake"], Value::Object(_)));
    }

    #[test]
    fn a_digest_tells_methods_and_craft_apart_and_neither_seed_nor_place() {
        let hash = |method, task| trial(method, task).params_hash();
        let cones = "real-long-cones";
        let mut all: Vec<String> =
            Method::all().filter(|method| method.uses_vlm()).map(|method| hash(method.name(), cones)).collect();
        let methods = all.len();
        all.sort_unstable();
        all.dedup();
        assert_eq!(all.len(), methods);
        assert_eq!(Trial { seed: 7, ..trial("spf", cones) }.params_hash(), hash("spf", cones));
        let text = trial("spf", cones).params().to_string();
        let place = |key: &str| text.find(&format!("\"{key}\":")).unwrap();
        assert!(
            ["craft", "fence", "limits", "policy", "preset", "prompt", "settings"].is_sorted_by_key(|key| place(key)),
            "{text}"
        );
    }
}
