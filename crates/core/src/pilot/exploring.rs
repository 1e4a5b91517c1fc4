//! A search leads to where seen free space borders on space that has not been seen, if there is an obstacle map.

use super::{Note, Pilot};
use crate::executor::Goal;
use crate::policy::Move;
use crate::time::Time;

impl Pilot {
    /// Flies to the best frontier of the map; without one, the motion itself.
    pub(super) fn explore(&mut self, now: Time, motion: Move) {
        if !self.is_mapped() || self.link_lost {
            return self.begin_move(now, motion);
        }
        let at = self.known_pose(now).position;
        let Some(frontier) = self.frontier(now, at) else { return self.begin_move(now, motion) };
        self.note(Note::Frontier(frontier));
        let heading = libm::atan2(frontier.position.east - at.east, frontier.position.north - at.north);
        self.fly_planned(now, at, Goal { position: frontier.position, heading }, true);
    }
}
