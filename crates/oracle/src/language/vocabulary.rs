//! Plain word lists of the language: what is known, what carries no meaning, irregular forms. No scene stands here.

/// Nouns of everyday life: known words are never taken for misspelt tags, so that a horse is no house.
#[rustfmt::skip]
pub(super) const KNOWN: &[&str] = &[
    "airport", "alley", "ambulance", "animal", "apple", "bag", "ball", "bank", "barn", "barrel", "basket", "beach", "bear",
    "bed", "bell", "bicycle", "bike", "bin", "bird", "boat", "book", "bottle", "box", "boy", "bread", "brook", "bucket",
    "bull", "cable", "cabin", "cafe", "cage", "cake", "camel", "camera", "camp", "canal", "candle", "canoe", "cart", "case",
    "castle", "cat", "cathedral", "cave", "chapel", "chicken", "child", "chimney", "church", "cinema", "clock", "cliff",
    "cloud", "coast", "coffee", "coin", "computer", "container", "cottage", "couch", "cow", "cross", "crow", "crown", "cup",
    "curtain", "cycle", "dam", "deer", "desk", "dish", "dock", "dog", "doll", "dome", "donkey", "door", "dragon", "drain",
    "drawer", "dress", "drum", "duck", "dune", "eagle", "elephant", "elevator", "engine", "escalator", "excavator",
    "factory", "fan", "farm", "fence", "ferry", "field", "fire", "fish", "flag", "flower", "forest", "fork", "fox",
    "fridge", "frog", "garage", "garden", "gas", "giraffe", "girl", "glass", "goat", "grass", "grave", "ground", "guitar",
    "gun", "hall", "hammer", "harbour", "harbor", "hat", "helicopter", "hen", "home", "horse", "hospital", "hotel", "hut",
    "hydrant", "igloo", "island", "jail", "kangaroo", "key", "kiosk", "kitchen", "kite", "ladder", "lamb", "laptop",
    "library", "lighthouse", "lion", "lizard", "mailbox", "mall", "market", "meadow", "mill", "windmill", "mirror",
    "monkey", "moon", "mosque", "mountain", "mouse", "museum", "net", "ocean", "office", "owl", "palace", "pan", "panda",
    "park", "parachute", "pen", "penguin", "phone", "piano", "pig", "pillow", "pipe", "pizza", "plane", "plate",
    "playground", "police", "pool", "port", "post", "pot", "pyramid", "rabbit", "radio", "rail", "railway", "rat",
    "reservoir", "restaurant", "river", "robot", "rock", "rocket", "roof", "room", "rope", "ruin", "sail", "school", "sea",
    "shark", "sheep", "shed", "shelf", "ship", "shoe", "silo", "snake", "snow", "stadium", "stage", "stair", "stairs",
    "star", "station", "stone", "stream", "submarine", "sun", "supermarket", "swan", "swing", "synagogue", "table", "tank",
    "tap", "taxi", "telescope", "television", "temple", "tent", "theatre", "tiger", "toilet", "tomb", "town", "toy",
    "tractor", "traffic", "trailer", "trampoline", "tram", "tray", "turbine", "turtle", "tv", "umbrella", "university",
    "valley", "vase", "village", "volcano", "wagon", "wall", "warehouse", "watch", "water", "waterfall", "well", "whale",
    "wheel", "windmill", "window", "wolf", "wood", "yacht", "yard", "zebra", "zoo", "cab", "sign", "hydroplane", "ferris",
    "digger", "bulldozer", "scooter", "skateboard", "sofa", "carriage", "caravan", "camper", "jeep", "pickup", "limo",
    "snowman", "snowplough", "fireman", "firefighter", "policeman", "worker", "builder", "driver", "construction",
    "parking", "cargo", "load", "shadow", "corner", "crossroads", "intersection", "roundabout", "junction", "crosswalk",
    "kerb", "curb", "brain", "grain", "rain", "chain", "chains", "plain", "crate", "crane", "flower", "power", "shower",
    "lower", "towel", "bride", "fridge", "ridge", "funnel", "channel", "needles", "noodle", "beetle", "kettle", "bench",
    "beach", "branch", "trench", "three", "knee", "bee", "thee", "treat", "tea", "war", "bar", "jar", "cat", "cap", "can",
    "scar", "cards", "card", "building", "gates", "date", "late", "plate", "skate", "lake", "cake", "rake", "snake",
    "brake", "bread", "road", "toad", "rod", "roads", "people", "passengers", "birds", "leaves", "goods", "loads",
];

/// Words of grammar beyond those in the tables, known so that they are not "corrected".
#[rustfmt::skip]
pub(super) const GRAMMAR: &[&str] = &[
    "and", "but", "then", "or", "not", "dont", "isnt", "arent", "without", "except", "besides", "rather", "than", "instead",
    "avoid", "avoiding", "ignore", "forget", "skip", "never", "neither", "nor", "that", "which", "who", "whose", "where",
    "with", "used", "using", "use", "when", "while", "after", "before", "until", "once", "if", "you", "your", "i", "im",
    "we", "they", "it", "its", "is", "are", "was", "be", "been", "can", "could", "would", "should", "will", "want", "need",
    "like", "likes", "take", "off", "takeoff", "let", "lets", "from", "left", "right", "front", "than", "apart", "other",
    "another", "has", "have", "having", "does", "do", "did", "what", "how", "there", "their", "them", "these", "those",
    "many", "most", "more", "less", "people", "person", "every", "afterwards", "finally", "lastly", "later", "followed",
    "following", "hitting", "touching", "crashing", "colliding", "drive", "drives", "driven", "driving", "lift", "lifts",
    "park", "parking", "cross", "live", "work", "sit", "shade", "hello", "side", "hand", "front", "back", "made", "make",
    "makes", "found", "called", "named", "known", "seen", "see", "give", "given", "keep", "kept", "anything", "everything",
    "nothing", "none", "your", "mine", "yours", "ones", "thats", "theres", "youre", "cant", "cannot", "wont", "ive", "id",
    "ill", "thing", "things", "things", "very", "excluding", "between", "among", "beneath", "underneath", "against",
    "within", "hides", "hide", "where", "stand", "stands", "raining", "thirsty", "hungry", "tired", "hot", "cold", "help",
    "second", "seconds", "third", "number", "two", "three", "four", "five", "meters", "metres", "meter", "metre", "start",
    "begin", "carry", "carries", "transport", "goods", "heavy", "high", "climbing", "swim", "rest", "mission", "task",
    "goal", "job", "instruction", "order", "time", "again", "away", "closely", "top",
];

/// Irregular forms to their stems.
#[rustfmt::skip]
pub(super) const IRREGULAR: &[(&str, &str)] = &[
    ("driven", "drive"), ("drove", "drive"), ("driving", "drive"), ("drives", "drive"), ("driver", "drive"),
    ("drivable", "drive"), ("rode", "ride"), ("ridden", "ride"), ("leaves", "leaf"), ("people", "person"), ("men", "man"),
    ("women", "woman"), ("children", "child"), ("grew", "grow"), ("grown", "grow"), ("sat", "sit"), ("built", "build"),
    ("buildings", "building"), ("swam", "swim"), ("living", "live"), ("lives", "live"), ("lived", "live"),
    ("homes", "home"), ("trees", "tree"), ("bridges", "bridge"), ("houses", "house"), ("buses", "bus"),
    ("branches", "branch"), ("benches", "bench"), ("boxes", "box"), ("vehicles", "vehicle"), ("ones", "one"),
    ("shady", "shade"), ("shadow", "shade"), ("leafy", "leaf"), ("thirsty", "drink"), ("thirst", "drink"),
    ("raining", "dry"), ("rain", "dry"), ("hungry", "eat"), ("sitting", "sit"), ("constructing", "construction"),
    ("construct", "construction"), ("lorries", "lorry"), ("bus", "bus"), ("glass", "glass"), ("grass", "grass"),
    ("parking", "park"), ("parked", "park"), ("building", "building"), ("crossing", "cross"), ("climbing", "climb"),
    ("using", "use"), ("used", "use"), ("flies", "fly"), ("carries", "carry"), ("carried", "carry"), ("carrying", "carry"),
    ("hoists", "hoist"), ("loads", "load"), ("offices", "office"), ("heading", "head"), ("moving", "move"),
];

/// Words without content in a description of use.
#[rustfmt::skip]
pub(super) const EMPTY: &[&str] = &[
    "people", "person", "human", "someone", "somebody", "you", "i", "we", "they", "one", "can", "could", "may", "might",
    "would", "will", "be", "is", "are", "was", "to", "for", "of", "in", "on", "at", "by", "with", "a", "an", "the", "that",
    "which", "who", "it", "its", "them", "from", "and", "or", "your", "my", "me", "us", "our", "use", "used", "using",
    "usually", "often", "normally", "typically", "do", "does", "get", "have", "has", "make", "makes", "made", "thing",
    "object", "something", "anything", "where", "when", "as", "so", "if", "this", "these", "those", "there", "very", "able",
    "help", "helps", "like", "need", "want", "go", "lets", "let", "keep", "around", "about", "up", "down", "out", "off",
    "into", "most", "more", "many", "some", "any", "all", "s", "meant", "designed", "purpose", "purposes", "thats", "kind",
    "im", "ive", "am", "should", "now", "fly", "find", "serve", "serves", "would", "d", "ll", "im", "things", "not", "s",
    "please", "been", "being", "give", "gives", "giving", "provide", "provides", "offer", "offers", "children", "child",
    "kids", "take", "takes", "come", "comes", "put", "he", "she",
];

/// Everyday verbs and adjectives, known so that they are not taken for misspelt words of the grammar.
#[rustfmt::skip]
pub(super) const COMMON_VERBS: &[&str] = &[
    "pray", "play", "pay", "learn", "teach", "study", "eat", "drink", "sleep", "dig", "smoke", "store", "buy", "sell",
    "read", "write", "sing", "dance", "run", "walk", "jump", "float", "swim", "marry", "worship", "broadcast", "transmit",
    "send", "receive", "wash", "cook", "bake", "hide", "hang", "hold", "tie", "open", "close", "shut", "push", "pull",
    "throw", "catch", "kick", "hit", "cut", "burn", "melt", "freeze", "grow", "plant", "feed", "ride", "hire", "rent",
    "moor", "dock", "anchor", "row", "sail", "fish", "splash", "wish", "control", "enclose", "block", "protect", "guard",
    "heal", "cure", "visit", "stay", "overnight", "night", "day", "morning", "sunny", "rainy", "wet", "dry", "warm", "cold",
    "hot", "cool", "soft", "hard", "heavy", "light", "loud", "silent", "slow", "fast", "rich", "poor", "young", "wild",
    "tame", "sweet", "sour", "angry", "happy", "sad", "safe", "dangerous", "deep", "shallow", "steep", "grassy", "sandy",
    "rocky", "muddy", "smoking", "spinning", "moving", "flying", "floating", "shining", "glowing", "wooden", "plastic",
    "paper", "rubber", "leather", "broken", "unfinished", "ruined", "abandoned", "finished", "under", "bricks", "chimneys",
    "tanks", "seat", "seats", "bags", "parcels", "packages", "mail", "letters", "money", "goods", "food", "meal", "lunch",
    "dinner", "kids", "children", "pupils", "students", "teacher", "priest", "tourists", "guests", "passenger", "commuters",
    "crowd", "team", "signal", "signals", "waves", "television", "telly", "programme", "news", "music", "electricity",
    "electric", "gas", "oil", "coal", "steam", "wind", "air", "sky", "space", "earth", "soil", "mud", "dirt", "gravel",
    "tar", "asphalt", "tile", "tiles", "steps", "ladder", "cable", "wire", "wires", "rope", "hook", "arm", "boom", "jib",
    "wing", "tail", "nose", "neck", "leg", "arms", "hands", "eye", "eyes", "ear", "tooth", "teeth", "hair", "skin", "bone",
    "blood", "heart", "head", "face", "back", "name", "word", "number", "letter", "colour", "shape", "size", "weight",
    "height", "width", "length", "speed", "price", "age", "age", "year", "month", "week", "hour", "minute", "built",
    "rises", "hanging", "crossing", "spans", "span", "surrounded", "guarded", "painted", "shaped", "fitted", "filled",
    "covered", "topped", "cone", "ball", "dome", "shell", "skeleton", "frame", "beam", "beams", "girder", "girders",
    "watch", "stand", "lean", "rest", "sit", "lie", "hotel", "guest", "inn", "weather", "storm", "thunder", "lightning",
    "fog", "mist", "haze", "thirst", "hunger", "wait", "queue", "ticket", "driver", "pilot", "captain", "sailor", "worker",
    "builder", "farmer", "doctor", "nurse", "soldier", "king", "queen", "prince", "hero", "ghost", "angel", "god",
    "service", "mass", "sermon", "wedding", "funeral", "class", "lesson", "exam", "office", "desk", "meeting", "job",
    "view", "sightseeing", "panorama", "photo", "picture", "image", "camera", "launch", "helipad", "bored", "sleepy",
    "exhausted", "dizzy", "sick", "ill", "lost", "late", "early", "curious", "scared", "brave", "hate", "love", "prefer",
    "enjoy", "fancy", "admire", "wonder", "think", "know", "believe", "guess", "hear", "listen", "smell", "taste", "feel",
    "touch", "kiss", "hug", "fight", "win", "lose", "score", "race", "train", "practice", "exercise", "jog", "cycle",
    "skate", "ski", "surf", "climb", "dive", "parking", "garage", "petrol", "fuel", "refuel", "charge", "battery",
];

/// Clothes: "the person in the blue coat" is a blue person.
#[rustfmt::skip]
pub(super) const CLOTHES: &[&str] = &[
    "clothes", "clothing", "shirt", "jacket", "coat", "dress", "outfit", "top", "sweater", "jumper", "hoodie", "trousers",
    "suit", "tshirt",
];
