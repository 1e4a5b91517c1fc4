//! The safety envelope: the last check before a driver (`docs/explanation/safety.md`).
//!
//! It is enforced by types: drivers accept only [`Cleared<Command>`](Cleared), which only [`Envelope`] can create. The
//! envelope takes observations ([`observe_telemetry`](Envelope::observe_telemetry),
//! [`observe_frame`](Envelope::observe_frame), …), returns the reaction they require ([`reaction`](Envelope::reaction))
//! and clears the commands of the pilot or the operator. Whatever the inputs, cleared commands are finite and within
//! the limits, and the craft moves only on fresh data.
//!
//! The envelope has no clock: every call passes the time, and a time earlier than the last one is treated as equal to
//! it.
#![forbid(unsafe_code)]

mod ahead;
mod brake;
mod brake_limits;
mod cause;
mod estimate;
pub mod geofence;
mod height;
mod limits;
mod manoeuvre;
mod marked;
mod person;
mod reach;
mod returning;
mod watch;

pub use brake_limits::BrakeLimits;
pub use cause::{Cause, Reaction, Refusal};
pub use limits::{Limits, LimitsError};

use self::ahead::Ahead;
use self::brake::Brake;
use self::estimate::Estimate;
use self::height::HeightCheck;
use self::marked::Marked;
use self::person::Person;
use self::watch::{Control, Found, Watch};
use spf_core::command::{Command, Manoeuvre, Setpoint};
use spf_core::craft::Craft;
use spf_core::depth::DepthGrid;
use spf_core::frame::FrameMeta;
use spf_core::geometry::{EnuPosition, EnuVelocity, Pose, Spread};
use spf_core::keep_out::KeepOut;
use spf_core::motion::MotionEstimate;
use spf_core::query::VerticalRoom;
use spf_core::ranges::RangeScan;
use spf_core::telemetry::{FlightPhase, Telemetry};
use spf_core::time::{Time, duration_from_secs};

/// Greatest tilt of a camera, radians.
const STRAIGHT_DOWN: f64 = core::f64::consts::FRAC_PI_2;
/// Vertical search moves keep this distance from floor and ceiling, metres.
const LOOK_MARGIN: f64 = 0.5;

/// A value cleared by the envelope. It cannot be created, deserialised or modified anywhere else.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cleared<T> {
    what: T,
    valid_until: Time,
}

impl<T> Cleared<T> {
    /// The cleared value.
    pub fn get(&self) -> &T {
        &self.what
    }

    /// Expiry of the clearance. The driver replaces a setpoint without a successor by zero at that time, and
    /// stops a manoeuvre that has not ended. [`Time::MAX`] for other commands.
    pub fn valid_until(&self) -> Time {
        self.valid_until
    }
}

/// A cleared command, and why it differs from the requested one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ClearedCommand {
    /// For the driver.
    pub cleared: Cleared<Command>,
    /// Why it differs from the request; `None` if unchanged.
    pub changed: Option<Cause>,
}

impl ClearedCommand {
    /// The cleared setpoint; `None` for other commands.
    #[must_use]
    pub fn setpoint(&self) -> Option<Setpoint> {
        match self.cleared.what {
            Command::Setpoint(setpoint) => Some(setpoint),
            _ => None,
        }
    }
}

/// The safety envelope of one craft. See the [module](self).
///
/// ```
/// use spf_core::command::{Command, Setpoint};
/// use spf_core::craft::Craft;
/// use spf_envelope::{Envelope, Limits};
/// use spf_core::time::Time;
///
/// let craft = Craft::quad();
/// let mut envelope = Envelope::new(Limits::for_craft(&craft), craft);
///
/// // Without telemetry nothing moves: the cleared setpoint is a hold, and the cause is reported.
/// let ahead = Setpoint { forward: 2.0, ..Setpoint::HOLD };
/// let clearance = envelope.clear(Time::from_millis(100), Command::Setpoint(ahead)).unwrap();
/// assert_eq!(clearance.setpoint(), Some(Setpoint::HOLD));
/// assert!(clearance.changed.is_some());
/// ```
#[derive(Clone, Debug)]
pub struct Envelope {
    limits: Limits,
    craft: Craft,
    estimate: Estimate,
    watch: Watch,
    brake: Brake,
    /// Places marked by the operator.
    marked: Marked,
    person: Person,
    height_check: HeightCheck,
    /// Latest time passed in.
    now: Time,
    /// World velocity of the last cleared setpoint, and its expiry.
    commanded: Option<(EnuVelocity, Time)>,
    /// Bound of the position error, which adds to `margin`.
    spread: Spread,
    /// A spread of this radius leaves no room within the limits, m.
    room: f64,
}

impl Envelope {
    /// An envelope for `craft`. Limits that are negative or NaN are read as zero, the strictest value;
    /// [`Limits::check`] reports them to the user.
    #[must_use]
    pub fn new(limits: Limits, craft: Craft) -> Self {
        let limits = limits.made_strict();
        Self {
            room: limits.room(),
            limits,
            craft,
            estimate: Estimate::default(),
            watch: Watch::default(),
            brake: Brake::default(),
            marked: Marked::default(),
            person: Person::default(),
            height_check: HeightCheck::default(),
            now: Time::ZERO,
            commanded: None,
            spread: Spread::default(),
        }
    }

    /// The limits in force.
    #[must_use]
    pub fn limits(&self) -> &Limits {
        &self.limits
    }

    /// The take-off point, once known: where the craft last reported being on the ground, or the point below where it
    /// was first seen in the air.
    #[must_use]
    pub fn home(&self) -> Option<EnuPosition> {
        self.estimate.home
    }

    /// Takes a telemetry report that arrived at `now`. A report no newer than the newest known one is ignored;
    /// non-finite or implausible values count as absent.
    pub fn observe_telemetry(&mut self, now: Time, telemetry: &Telemetry) {
        let now = self.advance(now);
        // The last cleared command may have been flown at any time since the last report.
        let since = self.estimate.measured.unwrap_or(Time::ZERO);
        let reckoned = self.commanded.filter(|&(_, until)| since < until).map_or(EnuVelocity::default(), |(v, _)| v);
        let fresh = duration_from_secs(self.limits.max_telemetry_age);
        if self.estimate.observe(now, telemetry, reckoned, fresh) {
            self.check_height(since, reckoned.up);
            let found = Found {
                breached: self.breached(),
                uncertain: self.spread.horizontal > self.room,
                height_stuck: self.height_check.has_failed(),
            };
            self.watch.estimate(now, &self.estimate, &self.limits, found);
        }
    }

    /// Compares the height of the newest report with the commanded climb since the one before, measured at `since`.
    fn check_height(&mut self, since: Time, up: f64) {
        match self.estimate.phase {
            FlightPhase::Flying => {
                let elapsed = self.estimate.measured.map_or(0.0, |measured| measured.since(since).as_secs_f64());
                self.height_check.observe(&self.craft, elapsed, up, self.estimate.height);
            }
            FlightPhase::OnGround => self.height_check.reset(),
            _ => self.height_check.pause(),
        }
    }

    /// Sets the bound of the position error, from the next telemetry report on. Values that are negative or not a number count
    /// as unbounded.
    pub fn observe_spread(&mut self, spread: Spread) {
        let strict = |metres: f64| if metres >= 0.0 { metres } else { f64::INFINITY };
        self.spread = Spread { horizontal: strict(spread.horizontal), vertical: strict(spread.vertical) };
    }

    /// Takes a camera frame that arrived at `now`, including unusable ones.
    pub fn observe_frame(&mut self, now: Time, frame: &FrameMeta) {
        let now = self.advance(now);
        self.watch.frame(now, frame, &self.limits);
    }

    /// Takes the outcome of a VLM query: `ok` only for a reply that was parsed. A failed call, a timeout and an invalid
    /// reply all count as failures.
    pub fn observe_reply(&mut self, now: Time, ok: bool) {
        let now = self.advance(now);
        self.watch.reply(now, ok);
    }

    /// Takes a depth grid that arrived at `now`, measured at `pose` according to the motion estimate. Returns whether it is a new
    /// measurement of a working sensor: no other part may believe what the brake does not believe.
    pub fn observe_depth(&mut self, now: Time, grid: &DepthGrid, pose: Pose) -> bool {
        let now = self.advance(now);
        let height = self.estimate.clearance.unwrap_or(self.estimate.height);
        self.brake.depth(now, grid, pose, height)
    }

    /// Takes a scan of a sensor around the craft that arrived at `now`, measured at `pose` according to the motion estimate. It
    /// counts for a second. Ignored without [`Limits::brake`].
    pub fn observe_ranges(&mut self, now: Time, scan: &RangeScan, pose: Pose) {
        let now = self.advance(now);
        if self.limits.brake.is_some() {
            self.brake.ranges(now, scan, pose);
        }
    }

    /// Replaces the remembered obstacles: occupied places near the craft, according to the motion estimate. Ignored without
    /// [`Limits::brake`].
    pub fn observe_obstacles(&mut self, places: impl Iterator<Item = EnuPosition>) {
        if self.limits.brake.is_some() {
            self.brake.remember(places);
        }
    }

    /// Takes the places that the operator has marked, instead of those before: no setpoint of the pilot brings the body nearer to
    /// one than 0.1 m, and what the position error has grown by since then.
    pub fn keep_out(&mut self, places: &[KeepOut]) {
        self.marked.set(places, self.spread);
    }

    /// Takes the position at `now` of a person whom the craft follows, according to the motion estimate: for a second, the pilot's
    /// setpoints come no nearer than 2 m.
    pub fn observe_person(&mut self, now: Time, at: EnuPosition) {
        let now = self.advance(now);
        self.person.observe(now, at);
    }

    /// Takes the motion estimate on which depth grids and obstacles are based. If none arrives for half a second, the
    /// brake uses the envelope's own.
    pub fn observe_motion(&mut self, now: Time, known: &MotionEstimate) {
        let now = self.advance(now);
        self.brake.motion(now, known.position, known.attitude.heading);
    }

    /// Records that the link to the craft was lost at `now`.
    pub fn link_lost(&mut self, now: Time) {
        let now = self.advance(now);
        self.watch.link_lost(now);
    }

    /// Records that the link to the craft is back.
    pub fn link_restored(&mut self, now: Time) {
        self.advance(now);
        self.watch.link_restored();
    }

    /// The reaction required while the pilot flies; the most severe one wins. The pilot obeys it; if it did not, no
    /// motion would be cleared anyway.
    #[must_use]
    pub fn reaction(&self, now: Time) -> Reaction {
        self.reaction_under(now, Control::Pilot)
    }

    /// The reaction required while the operator flies manually or holds: camera and VLM do not matter, and a craft
    /// outside a limit is not landed but may be flown back.
    #[must_use]
    pub fn manual_reaction(&self, now: Time) -> Reaction {
        self.reaction_under(now, Control::Operator)
    }

    /// The next instant after `now` at which a reaction or the validity of the last setpoint changes without new input.
    #[must_use]
    pub fn next_deadline(&self, now: Time) -> Option<Time> {
        let now = now.max(self.now);
        let conditions = [Control::Pilot, Control::Operator]
            .into_iter()
            .flat_map(|control| self.watch.conditions(&self.estimate, &self.limits, control));
        let validity = self.commanded.map(|(_, until)| until).filter(|&until| until > now);
        watch::next_change(now, conditions).into_iter().chain(validity).min()
    }

    /// Clears a command of the pilot. Setpoints and manoeuvres are limited, at worst to a hold, and never refused;
    /// landing and emergency stop always pass.
    ///
    /// # Errors
    /// A [`Refusal`] of a take-off or a return; no other command is ever refused.
    pub fn clear(&mut self, now: Time, command: Command) -> Result<ClearedCommand, Refusal> {
        match command {
            Command::Setpoint(setpoint) => Ok(self.clear_setpoint(now, setpoint)),
            Command::Manoeuvre(manoeuvre) => Ok(self.clear_manoeuvre(now, manoeuvre)),
            Command::TakeOff => self.take_off(now),
            Command::Return => self.clear_return(now),
            // Moves no craft; what is no angle looks ahead.
            Command::Tilt(tilt) => {
                let tilt = if tilt.is_finite() { tilt.clamp(-STRAIGHT_DOWN, STRAIGHT_DOWN) } else { 0.0 };
                Ok(passed(Command::Tilt(tilt)))
            }
            Command::Land | Command::EmergencyStop => {
                self.advance(now);
                self.commanded = None;
                Ok(passed(command))
            }
        }
    }

    /// Clears a setpoint of the pilot.
    pub fn clear_setpoint(&mut self, now: Time, setpoint: Setpoint) -> ClearedCommand {
        self.clear_under(now, setpoint, Control::Pilot)
    }

    /// Clears a setpoint of the operator: the same limits apply, but camera and VLM failures do not stop it, and a low
    /// battery only stops it once the craft is about to land.
    pub fn clear_manual(&mut self, now: Time, setpoint: Setpoint) -> ClearedCommand {
        self.clear_under(now, setpoint, Control::Operator)
    }

    /// Clears a manoeuvre of the pilot, shortened so that its path and end stay within all limits; a hold if nothing of
    /// it is left, or if a setpoint would not be allowed to move the craft now. No manoeuvre starts from outside a limit. The
    /// clearance is valid until the manoeuvre must have ended.
    pub fn clear_manoeuvre(&mut self, now: Time, requested: Manoeuvre) -> ClearedCommand {
        let now = self.advance(now);
        let velocity = requested.velocity(self.craft.yaw_rate);
        // A manoeuvre must not be used to fly back inside a limit, as a setpoint may: it would not be supervised.
        let reaction = match self.reaction(now) {
            Reaction::Continue => None,
            Reaction::Hold(cause) | Reaction::Land(cause) => Some(cause),
        };
        let stopped = self.stopped_by(now, velocity, Control::Pilot).max(reaction);
        let (allowed, changed) = match stopped {
            _ if !requested.is_finite() => (None, Some(Cause::NotFinite)),
            Some(cause) => (None, Some(cause)),
            None => manoeuvre::confined(&self.ahead(now), &self.brake, &self.marked, requested),
        };
        let Some(manoeuvre) = allowed else { return ClearedCommand { changed, ..self.hold(now) } };
        let valid_until = now + manoeuvre::patience(manoeuvre, &self.craft);
        let heading = self.estimate.heading.unwrap_or(0.0);
        self.commanded = Some((reach::world_velocity(manoeuvre.velocity(0.0), heading), valid_until));
        ClearedCommand { cleared: Cleared { what: Command::Manoeuvre(manoeuvre), valid_until }, changed }
    }

    /// Clears a hold: zero velocity, valid as long as any setpoint.
    pub fn hold(&mut self, now: Time) -> ClearedCommand {
        self.clear_under(now, Setpoint::HOLD, Control::Pilot)
    }

    /// Available descent and climb for a vertical search move, metres: down to 0.5 m above the minimum altitude, above
    /// the ground if its clearance is measured, and up to 0.5 m below the maximum altitude. Negative outside.
    #[must_use]
    pub fn vertical_room(&self) -> (f64, f64) {
        let low = self.estimate.clearance.map_or(self.estimate.height, |clearance| clearance.min(self.estimate.height));
        (low - self.limits.min_altitude - LOOK_MARGIN, self.limits.max_altitude - LOOK_MARGIN - self.estimate.height)
    }

    /// How far the craft may sink and climb within its altitude limits, metres; negative outside them.
    #[must_use]
    pub fn altitude_room(&self) -> (f64, f64) {
        let (down, up) = self.vertical_room();
        (down + LOOK_MARGIN, up + LOOK_MARGIN)
    }

    /// Whether the craft measures its distance to the ground.
    #[must_use]
    pub fn measures_clearance(&self) -> bool {
        self.estimate.clearance.is_some()
    }

    /// The distance to the ground below the craft, metres, if the last telemetry had it.
    #[must_use]
    pub fn clearance(&self) -> Option<f64> {
        self.estimate.clearance
    }

    /// Height above the take-off point, and how far the craft may sink and climb, metres.
    #[must_use]
    pub fn room(&self) -> VerticalRoom {
        let (down, up) = self.altitude_room();
        VerticalRoom { height: self.estimate.height, error: None, down: down.max(0.0), up: up.max(0.0) }
    }

    /// Whether a usable frame was captured within the maximum frame age.
    #[must_use]
    pub fn has_fresh_frame(&self, now: Time) -> bool {
        let fresh = duration_from_secs(self.limits.max_frame_age);
        self.watch.captured().is_some_and(|captured| now.since(captured) < fresh)
    }

    /// Advances the envelope's time, never backwards.
    fn advance(&mut self, now: Time) -> Time {
        self.now = self.now.max(now);
        self.now
    }

    fn reaction_under(&self, now: Time, control: Control) -> Reaction {
        let reaction = Watch::reaction(now.max(self.now), self.watch.conditions(&self.estimate, &self.limits, control));
        match reaction {
            // A landing is already the more severe reaction; a hold must not interrupt it.
            Reaction::Hold(_) if self.estimate.phase == FlightPhase::Landing => Reaction::Continue,
            reaction => reaction,
        }
    }

    /// The limits that the craft has breached: altitude, distance, geofence.
    fn breached(&self) -> [bool; 3] {
        let Some(home) = self.estimate.home else { return [false; 3] };
        let high = self.estimate.height > self.limits.max_altitude;
        let far = self.estimate.position.horizontal_distance(home) > self.limits.max_distance;
        let at = EnuPosition { up: self.estimate.height, ..self.estimate.position };
        let out = self.limits.geofence.as_ref().is_some_and(|fence| !fence.contains_below_ceiling(at));
        [high, far, out]
    }

    fn take_off(&mut self, now: Time) -> Result<ClearedCommand, Refusal> {
        let now = self.advance(now);
        let fresh = duration_from_secs(self.limits.max_telemetry_age);
        if self.watch.is_link_lost() {
            return Err(Refusal::LinkLost);
        }
        if self.estimate.measured.is_none_or(|measured| now.since(measured) > fresh) {
            return Err(Refusal::NoTelemetry);
        }
        if self.estimate.crashed {
            return Err(Refusal::Crashed);
        }
        if self.estimate.imu_error {
            return Err(Refusal::ImuError);
        }
        if self.estimate.phase != FlightPhase::OnGround {
            return Err(Refusal::AlreadyFlying);
        }
        let needed = self.limits.take_off_battery;
        if let Some(charge) = self.estimate.battery.filter(|&charge| charge < needed) {
            return Err(Refusal::LowBattery { charge, needed });
        }
        if self.limits.take_off_checks && self.estimate.battery.is_none() {
            return Err(Refusal::UnknownBattery);
        }
        if let Some((celsius, limit)) = self.estimate.temperature.zip(self.limits.max_temperature)
            && celsius > limit
        {
            return Err(Refusal::TooHot { celsius, limit });
        }
        if self.spread.horizontal > self.room {
            return Err(Refusal::UncertainPosition { spread: self.spread.horizontal, room: self.room });
        }
        if self.limits.take_off_checks && !self.has_fresh_frame(now) {
            return Err(Refusal::NoVideo);
        }
        let (height, limit) = (self.craft.take_off_height, self.limits.max_altitude);
        if height > limit {
            return Err(Refusal::TooLow { height, limit });
        }
        let at = EnuPosition { up: height, ..self.estimate.position };
        if self.limits.geofence.as_ref().is_some_and(|fence| !fence.contains_below_ceiling(at)) {
            return Err(Refusal::OutsideGeofence { east: at.east, north: at.north, height });
        }
        self.commanded = None;
        Ok(passed(Command::TakeOff))
    }

    fn clear_return(&mut self, now: Time) -> Result<ClearedCommand, Refusal> {
        let now = self.advance(now);
        returning::check(now, &self.limits, &self.craft, &self.watch, &self.estimate)?;
        self.commanded = None;
        Ok(passed(Command::Return))
    }

    fn clear_under(&mut self, now: Time, setpoint: Setpoint, control: Control) -> ClearedCommand {
        let now = self.advance(now);
        let (allowed, changed) = match self.stopped_by(now, setpoint, control) {
            Some(cause) => (Setpoint::HOLD, Some(cause).filter(|_| !setpoint.is_hold())),
            None => self.limit(now, setpoint, control),
        };
        let valid_until = now + duration_from_secs(self.limits.setpoint_validity);
        let heading = self.estimate.heading.unwrap_or(0.0);
        self.commanded = Some((reach::world_velocity(allowed, heading), valid_until));
        ClearedCommand { cleared: Cleared { what: Command::Setpoint(allowed), valid_until }, changed }
    }

    /// Why no motion is allowed now; `None` if it is.
    fn stopped_by(&self, now: Time, setpoint: Setpoint, control: Control) -> Option<Cause> {
        if !setpoint.is_finite() {
            return Some(Cause::NotFinite);
        }
        let fresh = duration_from_secs(self.limits.max_telemetry_age);
        let mut stopping: Option<Cause> = None;
        if self.estimate.measured.is_none_or(|measured| now.since(measured) >= fresh) || self.estimate.heading.is_none() {
            stopping = Some(Cause::NoTelemetry);
        } else if self.estimate.phase != FlightPhase::Flying {
            stopping = Some(Cause::NotFlying);
        }
        let conditions = self.watch.conditions(&self.estimate, &self.limits, control);
        stopping.max(conditions.filter(|c| now >= c.land_at || (now >= c.hold_at && !c.may_move)).map(|c| c.cause).max())
    }

    /// A finite setpoint reduced to the limits.
    fn limit(&self, now: Time, requested: Setpoint, control: Control) -> (Setpoint, Option<Cause>) {
        let limits = &self.limits;
        let mut setpoint = requested;
        let mut cause = None;
        let speed = libm::hypot(requested.right, requested.forward);
        if speed > limits.max_speed {
            let fraction = limits.max_speed / speed;
            (setpoint.right, setpoint.forward) = (requested.right * fraction, requested.forward * fraction);
            cause = Some(Cause::SpeedLimit);
        }
        if requested.up.abs() > limits.max_climb {
            setpoint.up = requested.up.clamp(-limits.max_climb, limits.max_climb);
            cause = cause.or(Some(Cause::ClimbLimit));
        }
        if requested.yaw_rate.abs() > limits.max_yaw_rate {
            setpoint.yaw_rate = requested.yaw_rate.clamp(-limits.max_yaw_rate, limits.max_yaw_rate);
            cause = cause.or(Some(Cause::YawRateLimit));
        }
        let ahead = self.ahead(now);
        let Some(situation) = ahead.situation() else { return (Setpoint::HOLD, Some(Cause::NoTelemetry)) };
        let (setpoint, confined) = reach::confine(limits, &self.craft, &situation, setpoint);
        let (setpoint, unknown) = self.without_climb_at_unknown_height(setpoint);
        let (setpoint, low) = self.above_ground(setpoint);
        // The operator flies by sight.
        let (setpoint, person) =
            if control == Control::Pilot { self.away_from_person(&ahead, setpoint) } else { (setpoint, None) };
        let braked = if control == Control::Pilot { self.braked(&ahead, setpoint) } else { 1.0 };
        let Setpoint { right, forward, up, yaw_rate } = setpoint;
        let setpoint = Setpoint { right: right * braked, forward: forward * braked, up: up * braked, yaw_rate };
        (setpoint, confined.or(unknown).or(low).or(person).or((braked < 1.0).then_some(Cause::Obstacle)).or(cause))
    }

    /// A setpoint that comes no nearer to a followed person than allowed.
    fn away_from_person(&self, ahead: &Ahead<'_>, setpoint: Setpoint) -> (Setpoint, Option<Cause>) {
        let Some(motion) = ahead.motion(&self.brake, setpoint, ahead.turns(setpoint)) else { return (setpoint, None) };
        let kept = self.person.keep_away(ahead.now, &motion, setpoint);
        (kept, (kept != setpoint).then_some(Cause::Person))
    }

    /// The fraction of a setpoint that the brake allows.
    fn braked(&self, ahead: &Ahead<'_>, setpoint: Setpoint) -> f64 {
        if self.limits.brake.is_none() && self.marked.is_empty() {
            return 1.0;
        }
        let Some(motion) = ahead.motion(&self.brake, setpoint, ahead.turns(setpoint)) else { return 0.0 };
        let known = self.limits.brake.as_ref().map_or(1.0, |limits| self.brake.allowed(ahead.now, limits, &motion));
        known.min(self.marked.allowed(&motion, self.spread))
    }

    /// A setpoint that stops descending at the minimum altitude above the surface measured below the craft, such as a
    /// table or a slope.
    fn above_ground(&self, setpoint: Setpoint) -> (Setpoint, Option<Cause>) {
        let Some(clearance) = self.estimate.clearance.filter(|_| setpoint.up < 0.0) else { return (setpoint, None) };
        // From the position at which the setpoint takes effect, as for the other limits.
        let lasts = self.limits.setpoint_validity + self.craft.dead_time + self.craft.lag;
        let slowest = ((clearance - self.limits.min_altitude) / lasts).max(0.0);
        if -setpoint.up <= slowest {
            return (setpoint, None);
        }
        (Setpoint { up: -slowest, ..setpoint }, Some(Cause::FloorLimit))
    }

    /// A setpoint that does not climb if the reported height does not follow the commands: the ceiling could not be kept.
    fn without_climb_at_unknown_height(&self, setpoint: Setpoint) -> (Setpoint, Option<Cause>) {
        if self.height_check.has_failed() && setpoint.up > 0.0 {
            (Setpoint { up: 0.0, ..setpoint }, Some(Cause::HeightStuck))
        } else {
            (setpoint, None)
        }
    }

    fn ahead(&self, now: Time) -> Ahead<'_> {
        let Self { limits, craft, estimate, spread, .. } = self;
        let velocity = estimate.velocity.or(self.commanded.map(|(v, _)| v)).unwrap_or_default();
        Ahead { now, limits, craft, estimate, velocity, spread: *spread }
    }
}

/// Clears a non-setpoint command unchanged.
fn passed(command: Command) -> ClearedCommand {
    ClearedCommand { cleared: Cleared { what: command, valid_until: Time::MAX }, changed: None }
}

#[cfg(test)]
mod tests;
