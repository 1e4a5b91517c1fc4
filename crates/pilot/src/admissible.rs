//! What a move must not do: lead back into what nobody has seen, or climb or sink into what is remembered.

use crate::policy::Move;
use crate::senses::Senses;
use crate::target::Target;
use spf_core::geometry::{EnuPosition, Pose};
use spf_core::primitives::Primitives;
use spf_core::time::Time;
use spf_envelope::Envelope;
use spf_motion::executor::Goal;
use spf_space::Space;

/// A motion back by less than this is a correction, metres.
const BACK: f64 = 0.05;
/// A vertical search move shorter than this shows nothing new, metres.
const WORTH_LOOKING: f64 = 0.05;

/// What is known of the way of a move that begins now.
pub(crate) struct Way<'a> {
    pub(crate) now: Time,
    /// Where the craft is.
    pub(crate) pose: Pose,
    pub(crate) senses: &'a Senses,
    pub(crate) space: &'a Space,
    pub(crate) target: &'a Target,
    pub(crate) envelope: &'a Envelope,
    /// Whether obstacles are asked for.
    pub(crate) avoid: bool,
}

/// What of a move may be flown.
#[derive(Debug)]
pub(crate) struct Admitted {
    /// `None` if nothing is left of it.
    pub(crate) motion: Option<Move>,
    /// What limits it, in words.
    pub(crate) limited: Vec<&'static str>,
    /// The climb of a look, wanted and left, metres, if height was what there was to limit.
    pub(crate) climb: Option<(f64, f64)>,
}

impl Way<'_> {
    /// Why what is remembered forbids a vertical search move; `None` if nothing does. The camera sees neither up nor down.
    pub(crate) fn barred(&self, climb: f64) -> Option<&'static str> {
        let at = self.pose.position;
        if self.space.bars_climb(at, climb) {
            return Some("no vertical search move: the map has an obstacle above or below, or beside the way there");
        }
        self.target.is_beside_lost(at, climb).then_some("no vertical search move: the target was last seen beside the way there")
    }

    /// The part of a move that may be flown.
    pub(crate) fn admits(&self, motion: Move) -> Admitted {
        let mut admitted = Admitted { motion: None, limited: Vec::new(), climb: None };
        let mut primitives = motion.primitives;
        let (now, camera) = (self.now, &self.senses.camera);
        if primitives.forward < -BACK && !self.space.shows_back(now, camera, self.path(primitives)) {
            let odometry = self.senses.odometry_at(now);
            let may_lead_aside = motion.then_rest && primitives.right == 0.0;
            let way = self.space.way_back(now, camera, odometry, self.pose, primitives).filter(|_| may_lead_aside);
            if way.is_none() {
                let why = "no motion backwards: not flown through in the last 12 s, and no frame of the last 3 s shows it";
                admitted.limited.push(why);
            }
            primitives = way.unwrap_or(Primitives { forward: 0.0, ..primitives });
        }
        let looks = motion.then_rest && primitives.forward == 0.0 && primitives.right == 0.0 && primitives.climb != 0.0;
        if looks {
            primitives.climb = self.admits_climb(primitives, &mut admitted);
        }
        let nothing = primitives != motion.primitives && primitives == Primitives::default();
        admitted.motion = (!nothing).then_some(Move { primitives, ..motion });
        admitted
    }

    /// How much of a vertical search move may be flown, metres.
    fn admits_climb(&self, primitives: Primitives, admitted: &mut Admitted) -> f64 {
        let mut climb = primitives.climb;
        // A forward camera does not see what is below. Boxes tell nothing of it, and neither does the height above the
        // take-off point.
        let is_blind = climb < 0.0 && self.avoid && !self.envelope.measures_clearance();
        if is_blind && !self.space.shows_below(self.now, &self.senses.camera, self.path(primitives)) {
            climb = 0.0;
            admitted.limited.push("no descent: no frame of the last 3 s shows what is below, and nothing measures it");
        }
        if let Some(why) = self.barred(climb) {
            climb = 0.0;
            admitted.limited.push(why);
        }
        if climb == 0.0 {
            return climb;
        }
        let within = self.within_room(climb);
        admitted.climb = Some((climb, within));
        if within != climb {
            admitted.limited.push("vertical search move limited: it stays 0.5 m from floor and ceiling");
        }
        if within.abs() < WORTH_LOOKING { 0.0 } else { within }
    }

    /// The part of a climb, negative for a descent, that floor and ceiling leave, metres.
    pub(crate) fn within_room(&self, climb: f64) -> f64 {
        let (down, up) = self.envelope.vertical_room();
        climb.clamp(-down.max(0.0), up.max(0.0))
    }

    fn path(&self, primitives: Primitives) -> [EnuPosition; 2] {
        [self.pose.position, Goal::of_primitives(self.pose, primitives).position]
    }
}
