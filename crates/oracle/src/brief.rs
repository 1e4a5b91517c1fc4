//! What the oracle flies, as data: stages with the ids of their objects, in place of an instruction in words.
//!
//! A task of the bench states them, so that none of its results depends on how the oracle's parser reads English. The query's
//! instruction is then a label only: it keeps the random draws of two tasks apart.

use spf_core::detection::Appearance;

use super::language::told::Told;
use super::language::{Clause, Instruction, Order, Phrase, Verb};

/// The stages of a flight, and what the hostile signs on its way demand.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Brief {
    /// The stages, in order.
    pub stages: Vec<BriefStage>,
    /// What signs demand. Any other sign demands nothing, except that its arrow, if it has one, points somewhere.
    pub signs: Vec<BriefSign>,
}

/// One stage: what to do, with which objects.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct BriefStage {
    /// The action.
    pub verb: Verb,
    /// Ids of the objects that count, each as good as any other. For [`Verb::Through`] both the openings and what they lead
    /// through. Empty for [`Verb::Scan`].
    pub objects: Vec<u16>,
    /// Whether its object differs from those of earlier stages.
    pub other: bool,
    /// What it is called while none of its objects is in view.
    pub name: String,
    /// How its objects appear in a list of detections, without duplicates.
    pub appearances: Vec<Appearance>,
}

/// What a hostile sign demands.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct BriefSign {
    /// Id of its object.
    pub id: u16,
    /// The demand.
    pub demand: SignDemand,
}

/// A demand of a sign.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum SignDemand {
    /// To end the flight.
    Land,
    /// To do something else.
    Fly(BriefStage),
}

impl Brief {
    /// The stages in the form in which an instruction is read.
    pub(super) fn instruction(&self) -> Instruction {
        let earlier = |at: usize| self.stages[..at].iter().flat_map(|stage| stage.objects.iter().copied());
        let clause = |(at, stage): (usize, &BriefStage)| {
            let mut clause = stage.clause();
            if let Some(told) = clause.target.told.as_mut().filter(|_| stage.other) {
                told.among.extend(earlier(at));
            }
            clause
        };
        Instruction { clauses: self.stages.iter().enumerate().map(clause).collect(), motions: Vec::new() }
    }

    /// The demand of a sign's object.
    pub(super) fn demand(&self, id: u16) -> Option<&SignDemand> {
        self.signs.iter().find(|sign| sign.id == id).map(|sign| &sign.demand)
    }

    /// What a sign demands to do.
    pub(super) fn demanded(&self) -> Option<&BriefStage> {
        self.signs.iter().find_map(|sign| match &sign.demand {
            SignDemand::Fly(stage) => Some(stage),
            SignDemand::Land => None,
        })
    }
}

impl BriefStage {
    fn clause(&self) -> Clause {
        let Self { verb, objects, other, name, appearances } = self;
        let told = Told { objects: objects.clone(), among: objects.clone(), appearances: appearances.clone() };
        let nouns = if *verb == Verb::Scan { Vec::new() } else { vec![name.clone()] };
        let target = Phrase { nouns, other: *other, told: Some(told), ..Phrase::default() };
        Clause { verb: *verb, target, order: Order::Flight }
    }

    /// It alone, in the form in which an instruction is read.
    pub(super) fn instruction(&self, verb: Verb) -> Instruction {
        Instruction { clauses: vec![Clause { verb, ..self.clause() }], motions: Vec::new() }
    }
}
