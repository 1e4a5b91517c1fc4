//! The kinds of clips, and the scenes in which each is flown.

use spf_scene::Object;

/// Images of a clip, ten a second.
pub(super) const IMAGES: usize = 80;

/// What is hard about a clip.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Condition {
    /// Nothing in particular: by day, a perfect camera.
    Plain,
    /// The sun at the horizon.
    Dusk,
    /// A shutter time of 20 ms.
    Blur,
    /// A standard deviation of 6 of 255 levels.
    Noise,
    /// The video of a Tello.
    H264,
    /// Walls are before or behind the target.
    Walls,
    /// Cranes, masts, fences or scaffolds are.
    Lattice,
    /// Trees and bushes are.
    Trees,
    /// For a moment at least half of the target is hidden.
    Hidden,
}

impl Condition {
    pub(super) const ALL: [Self; 9] =
        [Self::Plain, Self::Dusk, Self::Blur, Self::Noise, Self::H264, Self::Walls, Self::Lattice, Self::Trees, Self::Hidden];

    pub(super) const fn word(self) -> &'static str {
        match self {
            Self::Plain => "plain",
            Self::Dusk => "dusk",
            Self::Blur => "blur",
            Self::Noise => "noise",
            Self::H264 => "H.264",
            Self::Walls => "walls",
            Self::Lattice => "lattice",
            Self::Trees => "trees",
            Self::Hidden => "hidden",
        }
    }

    /// The scenes in which there is something of the kind.
    pub(super) const fn scenes(self) -> &'static [&'static str] {
        match self {
            Self::Walls => &["office", "yard"],
            Self::Lattice => &["city"],
            Self::Trees => &["park", "yard", "city"],
            _ => &["city", "office", "park", "yard"],
        }
    }

    /// Effects of the camera.
    pub(super) const fn effects(self) -> &'static str {
        match self {
            Self::Blur => "blur=20",
            Self::Noise => "noise=6",
            _ => "none",
        }
    }

    /// Whether an object is of those that are before or behind the target.
    pub(super) fn clutters(self, object: &Object) -> bool {
        let meshes: &[&str] = match self {
            Self::Walls => &["wall", "door", "window", "building", "house"],
            Self::Lattice => &["tower_crane", "lattice_mast", "fence", "frame_building", "monorail_beam", "ladder"],
            Self::Trees => &["tree", "grove", "bush", "hedge", "potted_plant"],
            _ => &[],
        };
        meshes.contains(&object.mesh)
    }

    /// The least share of the surroundings of the target that these fill, on average.
    pub(super) const fn least_clutter(self) -> Option<f64> {
        match self {
            Self::Walls => Some(0.6),
            Self::Trees => Some(0.3),
            Self::Lattice => Some(0.1),
            _ => None,
        }
    }
}

/// Which clip of a run: it determines everything about it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Number {
    /// In the run, from 0.
    pub(super) index: usize,
    pub(super) condition: Condition,
    /// Whether the target is a person who walks.
    pub(super) walks: bool,
    /// The scene and the seed of its variant.
    pub(super) scene: &'static str,
    pub(super) seed: u64,
    /// How many images are followed, at most [`IMAGES`].
    pub(super) images: usize,
}

impl Number {
    /// The clips of a run of this many, with scene seeds from `seed` on.
    pub(super) fn all(clips: usize, seed: u64) -> Vec<Self> {
        /// Variants of each scene: loading one takes as long as a clip.
        const VARIANTS: usize = 7;
        let kinds = 2 * Condition::ALL.len();
        let number = |index: usize| {
            let (kind, round) = (index % kinds, index / kinds);
            let (condition, walks) = (Condition::ALL[kind / 2], kind % 2 == 1);
            let scenes = condition.scenes();
            // Where a scene has few people who walk, they are met in several clips, from other sides.
            let scene = scenes[round % scenes.len()];
            let seed = seed + (round / scenes.len() % VARIANTS) as u64;
            Self { index, condition, walks, scene, seed, images: IMAGES }
        };
        (0..clips).map(number).collect()
    }
}
