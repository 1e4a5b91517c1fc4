//! How often a stand-in obeys signs (`docs/explanation/oracle.md`, "A stand-in that obeys signs").

use spf_core::frame::FrameId;
use spf_core::rng::RandomStream;
use spf_core::tags::Tagged;

/// How often the stand-in obeys a legible sign.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Obedience {
    /// The probability.
    pub chance: f64,
    /// For what it is drawn.
    pub per: Per,
    /// Whether the quotation marks around names in its history keep it from going on with what a sign said.
    pub quoted: bool,
}

/// For what a probability is drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Per {
    /// Each sign of a flight: a sign that fools it once does so in every frame.
    Sign,
    /// Each sign in each frame.
    Frame,
}

impl Obedience {
    /// Reads `gullible@Q`, `gullible-frame@Q` and `gullible-quoted@Q`: `None` for other names, `Some(None)` where the probability is missing or none.
    pub(super) fn named(name: &str) -> Option<Option<Self>> {
        let (kind, chance) = name.split_once('@').map_or((name, None), |(kind, chance)| (kind, Some(chance)));
        let (per, quoted) = match kind {
            "gullible" => (Per::Sign, false),
            "gullible-frame" => (Per::Frame, false),
            "gullible-quoted" => (Per::Sign, true),
            _ => return None,
        };
        let chance = chance.and_then(|text| text.parse().ok()).filter(|chance| (0.0..=1.0).contains(chance));
        Some(chance.map(|chance| Self { chance, per, quoted }))
    }

    /// Whether it obeys what is written on, or seen in, an object.
    pub(super) fn draws(self, seed: u64, frame: FrameId, id: u16, words: &str) -> bool {
        let frame = if self.per == Per::Frame { frame.0 } else { 0 };
        RandomStream::new(seed, &format!("oracle obeys {words}"), &[u64::from(id), frame]).chance(self.chance)
    }
}

/// The tags of the real thing for a look-alike that fools the stand-in.
pub(super) fn taken_for(obeys: Option<Obedience>, seed: u64, frame: FrameId, own: &Tagged, tags: &[Tagged]) -> Option<Tagged> {
    let obeys = obeys?;
    let seems = own.looks_like.as_ref()?;
    let real = tags.iter().find(|tags| tags.key == *seems)?;
    let fooled = obeys.draws(seed, frame, own.id, &real.key);
    // Its id too, by which a task states its target.
    fooled.then(|| Tagged { key: own.key.clone(), opening: own.opening, opening_of: own.opening_of.clone(), ..real.clone() })
}
