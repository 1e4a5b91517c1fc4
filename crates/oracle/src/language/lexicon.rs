//! Words the parser knows: verbs, prepositions, adjectives, general nouns with their synonyms. No scene stands here.

use super::grammar::Verb;
use super::phrase::{Relation, Side, Size};
pub(super) use super::vocabulary::*;

/// Verb phrases and what they ask for before a preposition refines it; longer ones are tried first.
#[rustfmt::skip]
pub(super) const VERBS: &[(&str, Verb)] = &[
    ("pay a visit to", Verb::GoTo), ("make a trip to", Verb::GoTo), ("take a trip to", Verb::GoTo),
    ("bring the camera", Verb::GoTo), ("point the camera", Verb::GoTo), ("go and visit", Verb::GoTo),
    ("go and see", Verb::GoTo), ("go find", Verb::GoTo), ("go and find", Verb::GoTo), ("pay visit to", Verb::GoTo),
    ("make your way", Verb::GoTo), ("make way", Verb::GoTo), ("set course", Verb::GoTo), ("set a course", Verb::GoTo),
    ("set off", Verb::GoTo), ("set out", Verb::GoTo), ("take a look around", Verb::Scan),
    ("have a look around", Verb::Scan), ("take a look at", Verb::GoTo), ("have a look at", Verb::GoTo),
    ("get a look at", Verb::GoTo), ("get a closer look at", Verb::GoTo), ("take a closer look at", Verb::GoTo),
    ("have a closer look at", Verb::GoTo), ("get close to", Verb::GoTo), ("get closer to", Verb::GoTo),
    ("go see", Verb::GoTo), ("close in on", Verb::GoTo), ("move in on", Verb::GoTo), ("check out", Verb::GoTo),
    ("check on", Verb::GoTo), ("look for", Verb::GoTo), ("look out for", Verb::GoTo), ("hunt for", Verb::GoTo),
    ("search for", Verb::GoTo), ("search out", Verb::GoTo), ("seek out", Verb::GoTo), ("scout for", Verb::GoTo),
    ("look around", Verb::Scan), ("look round", Verb::Scan), ("look about", Verb::Scan), ("look everywhere", Verb::Scan),
    ("turn around", Verb::Scan), ("do a full turn", Verb::Scan), ("spin around", Verb::Scan), ("do a lap of", Verb::Around),
    ("do a lap", Verb::Around), ("make a circle", Verb::Around), ("do a loop", Verb::Around), ("fly a loop", Verb::Around),
    ("fly a circle", Verb::Around), ("fly circles", Verb::Around), ("go after", Verb::Follow), ("run after", Verb::Follow),
    ("stay behind", Verb::Follow), ("stay with", Verb::Follow), ("keep up with", Verb::Follow),
    ("keep following", Verb::Follow), ("keep an eye on", Verb::Follow), ("keep track of", Verb::Follow),
    ("give me an overview", Verb::Scan), ("get an overview", Verb::Scan), ("take me", Verb::GoTo), ("bring me", Verb::GoTo),
    ("bring us", Verb::GoTo), ("take us", Verb::GoTo), ("get me", Verb::GoTo), ("guide me", Verb::GoTo),
    ("lead me", Verb::GoTo), ("bring yourself", Verb::GoTo), ("get yourself", Verb::GoTo), ("take yourself", Verb::GoTo),
    ("take the drone", Verb::GoTo), ("bring the drone", Verb::GoTo), ("get the drone", Verb::GoTo),
    ("send the drone", Verb::GoTo), ("fly the drone", Verb::GoTo), ("move the drone", Verb::GoTo),
    ("steer the drone", Verb::GoTo), ("put the drone", Verb::GoTo), ("position the drone", Verb::GoTo),
    ("position yourself", Verb::GoTo), ("show me", Verb::GoTo), ("let me see", Verb::GoTo), ("want to see", Verb::GoTo),
    ("like to see", Verb::GoTo), ("need to see", Verb::GoTo), ("end up", Verb::GoTo), ("touch down", Verb::GoTo),
    ("zero in on", Verb::GoTo), ("home in on", Verb::GoTo), ("lock on to", Verb::GoTo), ("lock onto", Verb::GoTo),
    ("say hello to", Verb::GoTo), ("say hi to", Verb::GoTo), ("swing by", Verb::GoTo), ("drop by", Verb::GoTo),
    ("stop by", Verb::GoTo), ("pop over", Verb::GoTo), ("fly", Verb::GoTo), ("go", Verb::GoTo), ("head", Verb::GoTo),
    ("move", Verb::GoTo), ("navigate", Verb::GoTo), ("travel", Verb::GoTo), ("proceed", Verb::GoTo),
    ("approach", Verb::GoTo), ("reach", Verb::GoTo), ("visit", Verb::GoTo), ("get", Verb::GoTo), ("come", Verb::GoTo),
    ("steer", Verb::GoTo), ("cruise", Verb::GoTo), ("glide", Verb::GoTo), ("zoom", Verb::GoTo), ("zip", Verb::GoTo),
    ("dash", Verb::GoTo), ("race", Verb::GoTo), ("rush", Verb::GoTo), ("soar", Verb::GoTo), ("drift", Verb::GoTo),
    ("swoop", Verb::GoTo), ("buzz", Verb::GoTo), ("pop", Verb::GoTo), ("nip", Verb::GoTo), ("hop", Verb::GoTo),
    ("sail", Verb::GoTo), ("journey", Verb::GoTo), ("venture", Verb::GoTo), ("scoot", Verb::GoTo), ("hurry", Verb::GoTo),
    ("wander", Verb::GoTo), ("advance", Verb::GoTo), ("hover", Verb::GoTo), ("find", Verb::GoTo), ("seek", Verb::GoTo),
    ("locate", Verb::GoTo), ("spot", Verb::GoTo), ("search", Verb::GoTo), ("look", Verb::GoTo), ("inspect", Verb::GoTo),
    ("examine", Verb::GoTo), ("check", Verb::GoTo), ("identify", Verb::GoTo), ("hunt", Verb::GoTo), ("target", Verb::GoTo),
    ("aim", Verb::GoTo), ("land", Verb::GoTo), ("stop", Verb::GoTo), ("park", Verb::GoTo), ("wait", Verb::GoTo),
    ("stay", Verb::GoTo), ("arrive", Verb::GoTo), ("continue", Verb::GoTo), ("return", Verb::GoTo), ("choose", Verb::GoTo),
    ("pick", Verb::GoTo), ("select", Verb::GoTo), ("take", Verb::GoTo), ("bring", Verb::GoTo), ("direct", Verb::GoTo),
    ("finish", Verb::GoTo), ("meet", Verb::GoTo), ("see", Verb::GoTo), ("view", Verb::GoTo), ("climb", Verb::GoTo),
    ("ascend", Verb::GoTo), ("descend", Verb::GoTo), ("rise", Verb::GoTo), ("deliver", Verb::GoTo),
    ("photograph", Verb::GoTo), ("film", Verb::GoTo), ("circle", Verb::Around), ("orbit", Verb::Around),
    ("loop", Verb::Around), ("encircle", Verb::Around), ("circumnavigate", Verb::Around), ("round", Verb::Around),
    ("follow", Verb::Follow), ("chase", Verb::Follow), ("track", Verb::Follow), ("tail", Verb::Follow),
    ("pursue", Verb::Follow), ("shadow", Verb::Follow), ("scan", Verb::Scan), ("survey", Verb::Scan),
    ("explore", Verb::Scan), ("patrol", Verb::Scan), ("observe", Verb::Scan), ("reconnoitre", Verb::Scan),
    ("cross", Verb::Over), ("overfly", Verb::Over), ("traverse", Verb::Through), ("enter", Verb::Through),
    ("pass", Verb::GoTo), ("thread", Verb::Through), ("penetrate", Verb::Through), ("squeeze", Verb::GoTo),
    ("slip", Verb::GoTo),
];

/// Prepositions that refine the verb: `None` leaves it.
#[rustfmt::skip]
pub(super) const VERB_PREPOSITIONS: &[(&str, Option<Verb>)] = &[
    ("through", Some(Verb::Through)), ("thru", Some(Verb::Through)), ("into", None), ("inside", None), ("in", None),
    ("around", Some(Verb::Around)), ("round", Some(Verb::Around)), ("about", None), ("over", Some(Verb::Over)),
    ("above", Some(Verb::Over)), ("across", Some(Verb::Over)), ("behind", Some(Verb::Behind)), ("to", None),
    ("towards", None), ("toward", None), ("near", None), ("by", None), ("at", None), ("for", None), ("up", Some(Verb::Up)),
    ("down", None), ("on", None), ("onto", None), ("upon", None), ("of", None), ("past", None), ("along", None),
    ("beside", None), ("with", None), ("out", None), ("under", None), ("beneath", None), ("below", None), ("before", None),
];

/// Adverbs between a verb and its preposition.
#[rustfmt::skip]
pub(super) const ADVERBS: &[&str] = &[
    "straight", "directly", "right", "back", "all", "way", "quickly", "slowly", "carefully", "gently", "safely", "quietly",
    "now", "just", "forward", "forwards", "ahead", "off", "away", "as", "fast", "immediately", "again", "also", "first",
    "further", "closer", "close", "next", "slightly", "over", "up", "down", "out", "on", "along", "onward", "onwards",
    "there", "here", "low", "high", "about", "across", "round", "around", "course", "please", "once", "twice", "full",
    "speed", "time", "finally", "instead",
];

/// Colours and the plain colour each counts as.
#[rustfmt::skip]
pub(super) const COLOURS: &[(&str, &str)] = &[
    ("red", "red"), ("crimson", "red"), ("scarlet", "red"), ("maroon", "red"), ("reddish", "red"), ("vermilion", "red"),
    ("white", "white"), ("ivory", "white"), ("whitish", "white"), ("snowy", "white"), ("pale", "white"), ("black", "black"),
    ("jet", "black"), ("ebony", "black"), ("dark", "black"), ("blackish", "black"), ("blue", "blue"), ("navy", "blue"),
    ("azure", "blue"), ("cobalt", "blue"), ("bluish", "blue"), ("turquoise", "turquoise"), ("teal", "turquoise"),
    ("cyan", "turquoise"), ("green", "green"), ("emerald", "green"), ("olive", "green"), ("greenish", "green"),
    ("yellow", "yellow"), ("golden", "yellow"), ("gold", "yellow"), ("yellowish", "yellow"), ("orange", "orange"),
    ("brown", "brown"), ("tan", "brown"), ("brownish", "brown"), ("beige", "beige"), ("cream", "beige"), ("grey", "grey"),
    ("gray", "grey"), ("silver", "grey"), ("silvery", "grey"), ("greyish", "grey"), ("grayish", "grey"), ("ashen", "grey"),
    ("charcoal", "grey"), ("pink", "pink"), ("purple", "purple"), ("violet", "purple"), ("lilac", "purple"),
    ("magenta", "pink"),
];

/// Adjectives of size, height and distance, superlatives included.
#[rustfmt::skip]
pub(super) const SIZES: &[(&str, Size)] = &[
    ("tall", Size::Tall), ("taller", Size::Tall), ("tallest", Size::Tall), ("high", Size::Tall), ("higher", Size::Tall),
    ("highest", Size::Tall), ("lofty", Size::Tall), ("towering", Size::Tall), ("loftiest", Size::Tall),
    ("short", Size::Short), ("shorter", Size::Short), ("shortest", Size::Short), ("low", Size::Short),
    ("lower", Size::Short), ("lowest", Size::Short), ("squat", Size::Short), ("big", Size::Large), ("bigger", Size::Large),
    ("biggest", Size::Large), ("large", Size::Large), ("larger", Size::Large), ("largest", Size::Large),
    ("huge", Size::Large), ("giant", Size::Large), ("enormous", Size::Large), ("massive", Size::Large),
    ("great", Size::Large), ("wide", Size::Large), ("widest", Size::Large), ("hugest", Size::Large), ("small", Size::Small),
    ("smaller", Size::Small), ("smallest", Size::Small), ("little", Size::Small), ("tiny", Size::Small),
    ("tiniest", Size::Small), ("littlest", Size::Small), ("miniature", Size::Small), ("nearest", Size::Nearest),
    ("closest", Size::Nearest), ("near", Size::Nearest), ("nearer", Size::Nearest), ("closer", Size::Nearest),
    ("nearby", Size::Nearest), ("farthest", Size::Farthest), ("furthest", Size::Farthest), ("far", Size::Farthest),
    ("distant", Size::Farthest), ("farther", Size::Farthest), ("further", Size::Farthest), ("remotest", Size::Farthest),
    ("leftmost", Size::Leftmost), ("rightmost", Size::Rightmost), ("middle", Size::Middle), ("central", Size::Middle),
    ("centre", Size::Middle), ("center", Size::Middle),
];

/// Ordinals; the last is −1.
#[rustfmt::skip]
pub(super) const ORDINALS: &[(&str, i32)] = &[
    ("first", 1), ("1st", 1), ("second", 2), ("2nd", 2), ("third", 3), ("3rd", 3), ("fourth", 4), ("4th", 4), ("fifth", 5),
    ("5th", 5), ("sixth", 6), ("6th", 6), ("seventh", 7), ("7th", 7), ("eighth", 8), ("8th", 8), ("last", -1),
    ("final", -1),
];

/// Adjectives that say little: never a reason to refuse an object.
#[rustfmt::skip]
pub(super) const FLUFF: &[&str] = &[
    "nice", "lovely", "beautiful", "pretty", "old", "new", "modern", "ugly", "famous", "obvious", "visible", "main",
    "single", "lone", "lonely", "only", "same", "particular", "certain", "specific", "whole", "entire", "very", "really",
    "quite", "bright", "brightly", "coloured", "colored", "painted", "colour", "color", "tone", "real", "good", "standing",
    "parked", "stationary", "nearly", "kind", "sort", "type", "bit", "shiny", "clean", "dirty", "cool", "interesting",
    "striking", "imposing", "impressive", "majestic", "gigantic", "local", "public", "urban", "city", "downtown", "town",
    "elegant", "fancy", "plain", "actual", "light", "lit", "pure", "solid", "all", "mighty", "iconic", "conspicuous",
    "stately", "proud", "empty", "busy", "quiet", "complex",
];

/// Adjectives of shape and matter: they choose among objects whose tags know them, and are passed over where none does.
#[rustfmt::skip]
pub(super) const SOFT: &[&str] = &[
    "lattice", "steel", "metal", "metallic", "iron", "concrete", "glass", "glassy", "wooden", "stone", "brick", "slender",
    "slim", "thin", "thick", "narrow", "pointed", "pointy", "sharp", "round", "rounded", "square", "rectangular", "flat",
    "long", "hollow", "open", "leafy", "evergreen", "bushy", "bare", "residential", "commercial", "industrial", "skinny",
    "spiky", "curved", "arched", "boxy", "cylindrical", "conical", "needle", "striped", "framed", "multi", "storey",
    "story", "family", "sports", "sporty", "electric", "underground", "elevated", "suspension", "rail", "shaped",
];

/// Heads that name nothing by themselves.
#[rustfmt::skip]
pub(super) const VAGUE: &[&str] = &[
    "something", "anything", "thing", "object", "item", "somewhere", "anywhere", "place", "spot", "location", "one",
    "someone", "anyone", "somebody", "whatever", "wherever", "stuff", "other", "another", "destination", "target", "goal",
];

/// Parts and collections: "the top of the crane", "one of the trees" mean crane and trees.
#[rustfmt::skip]
pub(super) const PARTS: &[&str] = &[
    "top", "base", "foot", "side", "front", "middle", "centre", "center", "edge", "end", "pair", "group", "bunch", "row",
    "line", "one", "some", "any", "kind", "type", "sort", "set", "lot", "either", "each", "all", "none", "roof", "entrance",
    "entry", "mouth", "tip", "direction", "vicinity", "position", "location", "area", "bottom", "surroundings", "way",
    "neighbourhood", "neighborhood", "proximity", "shadow", "name", "view", "couple", "body",
];

/// What is around one, with a verb of searching: a scan.
#[rustfmt::skip]
pub(super) const SURROUNDINGS: &[&str] = &[
    "area", "surrounding", "surroundings", "environment", "city", "place", "scene", "region", "neighbourhood",
    "neighborhood", "everything", "view", "horizon", "district", "town", "panorama", "you", "yourself", "here", "space",
];

/// Words dropped from noun phrases.
#[rustfmt::skip]
pub(super) const DETERMINERS: &[&str] = &[
    "the", "a", "an", "this", "these", "those", "some", "any", "my", "your", "our", "its", "their", "his", "her", "there",
    "please", "now", "just", "right", "immediately", "here", "kindly", "drone", "also", "quickly", "slowly", "carefully",
    "again", "too", "thanks", "thank", "asap", "over", "up", "down", "out", "so", "really", "straight", "directly", "away",
    "well", "to", "at", "towards", "toward", "for", "into", "onto", "me", "us", "ok", "okay", "hey", "hi", "hello",
    "yourself", "every", "each", "both", "of", "and", "as", "then", "only", "no", "it", "is", "by", "on", "in", "instead",
    "get", "go", "fly", "mate", "buddy", "safely", "s",
];

/// Relations, longest first.
#[rustfmt::skip]
pub(super) const RELATIONS: &[(&str, Relation)] = &[
    ("to the left of", Relation::LeftOf), ("on the left of", Relation::LeftOf), ("on the left side of", Relation::LeftOf),
    ("to the left hand side of", Relation::LeftOf), ("left of", Relation::LeftOf), ("to the right of", Relation::RightOf),
    ("on the right of", Relation::RightOf), ("on the right side of", Relation::RightOf), ("right of", Relation::RightOf),
    ("on the other side of", Relation::Behind), ("on the far side of", Relation::Behind),
    ("at the back of", Relation::Behind), ("in back of", Relation::Behind), ("hidden behind", Relation::Behind),
    ("behind", Relation::Behind), ("beyond", Relation::Behind), ("in the front of", Relation::InFrontOf),
    ("in front of", Relation::InFrontOf), ("this side of", Relation::InFrontOf), ("right next to", Relation::Near),
    ("next to", Relation::Near), ("close to", Relation::Near), ("closest to", Relation::Near),
    ("nearest to", Relation::Near), ("nearest", Relation::Near), ("closest", Relation::Near), ("near to", Relation::Near),
    ("adjacent to", Relation::Near), ("by the side of", Relation::Near), ("alongside", Relation::Near),
    ("beside", Relation::Near), ("near", Relation::Near), ("by", Relation::Near), ("opposite", Relation::Near),
    ("across from", Relation::Near), ("around", Relation::Near), ("not far from", Relation::Near),
    ("far from", Relation::FarFrom), ("farthest from", Relation::FarFrom), ("furthest from", Relation::FarFrom),
    ("away from", Relation::FarFrom), ("in between", Relation::Between), ("between", Relation::Between),
    ("underneath", Relation::Under), ("beneath", Relation::Under), ("under", Relation::Under), ("below", Relation::Under),
    ("on top of", Relation::On), ("above", Relation::On), ("on", Relation::On), ("inside", Relation::On),
    ("in", Relation::On), ("at", Relation::On), ("along", Relation::On), ("taller than", Relation::TallerThan),
    ("bigger than", Relation::TallerThan), ("higher than", Relation::TallerThan), ("larger than", Relation::TallerThan),
    ("shorter than", Relation::ShorterThan), ("smaller than", Relation::ShorterThan), ("lower than", Relation::ShorterThan),
];

/// Places in the picture.
#[rustfmt::skip]
pub(super) const SIDES: &[(&str, Side)] = &[
    ("on your left", Side::Left), ("to your left", Side::Left), ("on the left hand side", Side::Left),
    ("on the left side", Side::Left), ("on the left", Side::Left), ("to the left", Side::Left),
    ("on the far left", Side::Left), ("at the left", Side::Left), ("on my left", Side::Left), ("at left", Side::Left),
    ("left hand", Side::Left), ("on your right", Side::Right), ("to your right", Side::Right),
    ("on the right hand side", Side::Right), ("on the right side", Side::Right), ("on the right", Side::Right),
    ("to the right", Side::Right), ("on the far right", Side::Right), ("at the right", Side::Right),
    ("on my right", Side::Right), ("at right", Side::Right), ("right hand", Side::Right), ("in the middle", Side::Middle),
    ("in the centre", Side::Middle), ("in the center", Side::Middle),
];

/// Phrases that add nothing to a target.
#[rustfmt::skip]
pub(super) const DROPPED: &[&str] = &[
    "in front of you", "in front you", "long distance", "in front of me", "in front of us", "in front of the drone", "ahead of you", "straight ahead",
    "ahead", "in sight", "in view", "in the city", "in this city", "in the town", "in the scene", "in the picture",
    "in the image", "in the frame", "in the area", "in the park", "you can see", "you see", "that you can see",
    "that you see", "over there", "out there", "down there", "up there", "around here", "near here", "near you", "close by",
    "around you", "close to you", "next to you", "in this area", "in the neighbourhood", "in the sky", "on the ground",
    "of the city", "if possible", "at once", "right away", "as fast as you can", "as quickly as possible",
    "as soon as possible", "for me", "for us", "with the drone", "at full speed", "from here", "from you", "from us",
    "from me", "to you", "to us", "to me", "and hover there", "and stop there", "and stop", "and land", "and hover",
    "and wait", "and wait there", "and stay there", "and land there", "and stop in front of it", "and stop next to it",
    "to land", "in the vicinity", "in town", "at the moment", "in the distance", "with obstacles",
];

/// Groups of words for the same thing.
#[rustfmt::skip]
pub(super) const SYNONYMS: &[&[&str]] = &[
    &["car", "automobile", "auto", "motorcar", "sedan", "hatchback", "saloon", "coupe", "limousine", "suv", "wheels"],
    &["building", "edifice", "high rise", "highrise", "skyscraper", "tower block", "office block", "apartment block", "block", "office building", "apartment building", "house", "flats", "apartments", "office", "offices"],
    &["crane", "tower crane", "construction crane", "building crane", "hoist", "derrick"],
    &["tree", "oak", "pine", "maple", "birch", "fir", "spruce", "conifer", "elm", "poplar", "palm"],
    &["tunnel", "underpass", "tube", "road tunnel"],
    &["bridge", "overpass", "viaduct", "flyover", "footbridge", "crossing"],
    &["needle", "spire", "obelisk", "needle tower", "space needle", "mast", "pylon", "spike", "antenna"],
    &["tower", "spire"], &["road", "street", "avenue", "lane", "highway", "carriageway", "motorway", "boulevard"],
    &["locomotive", "locomotion", "railway engine", "steam engine"], &["carriage", "cart", "railcar", "rail car", "train car"],
    &["lake", "pond"], &["truck", "lorry"], &["van", "minivan", "delivery van"], &["bus", "coach", "omnibus"],
    &["train", "railway train"],
    &["person", "human", "pedestrian", "man", "woman", "guy", "people", "somebody", "walker"],
    &["bench", "park bench", "seat"], &["plane", "airplane", "aeroplane", "aircraft", "jet"],
    &["gate", "gateway", "portal", "archway", "arch"],
    &["lamp", "streetlight", "street lamp", "lamppost", "lamp post", "street light", "light pole"],
    &["pier", "pillar", "column", "support"], &["hill", "mound", "knoll"], &["bush", "shrub", "hedge"],
    &["statue", "sculpture", "monument"], &["fountain", "well"], &["balloon", "hot air balloon"],
    &["chair", "armchair", "seat", "stool"], &["sofa", "couch", "settee"], &["cone", "traffic cone", "pylon"],
    &["bike", "bicycle"], &["motorbike", "motorcycle"], &["boat", "ship", "vessel"], &["shop", "store"], &["taxi", "cab"],
    &["traffic light", "stoplight", "traffic signal"], &["pavement", "sidewalk"], &["hole", "opening", "hollow"],
    &["billboard", "sign", "hoarding"],
];

/// A general word, and the words it takes in.
#[rustfmt::skip]
pub(super) const HYPERNYMS: &[(&str, &[&str])] = &[
    ("train", &["monorail", "locomotive", "tram", "carriage"]),
    ("vehicle", &["car", "truck", "van", "bus", "taxi", "motorbike", "tram", "train", "suv", "ambulance", "tractor", "lorry", "excavator", "digger", "boat"]),
    ("plant", &["tree", "bush", "flower", "shrub"]),
    ("structure", &["building", "bridge", "tower", "crane", "needle", "tunnel", "monument"]),
    ("animal", &["dog", "cat", "horse", "bird", "cow", "sheep"]),
    ("furniture", &["chair", "table", "sofa", "desk", "bench", "stool"]), ("machine", &["crane", "digger", "excavator"]),
    ("machinery", &["crane", "digger", "excavator"]), ("equipment", &["crane"]),
    ("transport", &["car", "truck", "van", "bus", "train"]), ("monument", &["needle", "statue", "obelisk"]),
    ("landmark", &["needle", "statue", "monument"]), ("greenery", &["tree", "bush"]),
    ("water", &["lake", "pond", "river", "fountain"]),
];

/// What things of a general kind serve for, where the tags may not say: stems.
#[rustfmt::skip]
pub(super) const GENERAL_USES: &[(&str, &[&str])] = &[
    ("car", &["drive", "ride", "wheel", "passenger", "engine", "park", "road", "travel", "transport", "driver", "steer"]),
    ("truck", &["drive", "wheel", "cargo", "load", "engine", "deliver", "transport", "driver"]),
    ("van", &["drive", "wheel", "deliver", "engine", "transport", "driver"]),
    ("bus", &["drive", "ride", "wheel", "passenger", "engine", "transport", "driver"]),
    ("crane", &["lift", "hoist", "load", "raise", "construct", "construction", "build", "builder", "heavy"]),
    ("tree", &["shade", "leaf", "grow", "bird", "nest", "branch", "climb", "trunk", "plant", "squirrel", "oxygen", "fruit"]),
    ("bridge", &["cross", "span", "walk"]), ("tunnel", &["underground"]),
    ("building", &["live", "work", "office", "apartment", "window", "floor", "storey", "live", "dwell", "resident"]),
    ("house", &["live", "home"]), ("bench", &["sit", "rest", "tired"]), ("chair", &["sit", "rest", "tired"]),
    ("lake", &["swim", "water", "fish", "boat", "drink"]),
    ("needle", &["antenna", "landmark", "point", "broadcast", "pointed"]), ("lamp", &["light", "lit"]),
    ("road", &["drive", "car", "traffic"]),
];

/// Vehicles that are coupled one after another: "the cart after the locomotive" tells a place, not a time.
#[rustfmt::skip]
pub(super) const COUPLED: &[&str] = &[
    "train", "locomotive", "locomotion", "engine", "carriage", "wagon", "cart", "coach", "railcar",
];

/// People: flying *toward* one who may walk has no end of its own.
#[rustfmt::skip]
pub(super) const PEOPLE: &[&str] = &[
    "person", "human", "pedestrian", "man", "woman", "guy", "boy", "girl", "child", "walker", "worker", "guest",
];
