//! What a frame shows of things that may be in the way, as somebody who looks at it would list them: the named parts of objects,
//! each in pieces where it spans many depths or surrounds an opening.

use libm::sqrt;
use spf_core::query::{ImageBox, ImagePoint};
use spf_core::tags::SURFACES;

use super::errors::ErrorFile;
use super::extent::{BANDS, Distances, Hole, Obstacle, SIDES, band, obstacle_of, side, surrounded};
use super::sight::{GroundTruthView, PerceivedObject, slopes};
use super::slope::slopes_ahead;

/// Rectangle of pixels, and what of it is nearest.
#[derive(Clone, Copy, Debug)]
struct Region {
    left: usize,
    top: usize,
    right: usize,
    bottom: usize,
    pixels: u64,
    /// Squared straight-line distances, square metres.
    nearest: f64,
    farthest: f64,
}

impl Region {
    const EMPTY: Self =
        Self { left: usize::MAX, top: usize::MAX, right: 0, bottom: 0, pixels: 0, nearest: f64::INFINITY, farthest: 0.0 };

    fn take(&mut self, x: usize, y: usize, squared: f64) {
        self.left = self.left.min(x);
        self.right = self.right.max(x);
        self.top = self.top.min(y);
        self.bottom = self.bottom.max(y);
        self.pixels += 1;
        self.nearest = self.nearest.min(squared);
        self.farthest = self.farthest.max(squared);
    }

    fn image_box(&self, width: usize, height: usize) -> ImageBox {
        let (w, h) = (width as f64, height as f64);
        ImageBox {
            left: self.left as f64 / w,
            top: self.top as f64 / h,
            right: (self.right + 1) as f64 / w,
            bottom: (self.bottom + 1) as f64 / h,
        }
    }
}

/// All solid things in the image, and ground that rises. `things` are the perceived objects.
pub(super) fn obstacles(
    errors: &ErrorFile,
    seed: u64,
    frame: u64,
    sight: &GroundTruthView<'_>,
    things: &[PerceivedObject],
) -> Vec<Obstacle> {
    let (w, h) = (sight.width, sight.height);
    let most = sight.ids.iter().fold(0, |most, id| *id.max(&most));
    if w == 0 || sight.ids.len() < w * h || sight.depth.len() < w * h || most == 0 {
        return Vec::new();
    }
    // A leaf is a named part, or what of an object belongs to none.
    let named = sight.pieces.len() + 1;
    let solid: Vec<bool> = {
        let mut solid = vec![false; usize::from(most) + 1];
        for thing in things.iter().filter(|thing| !thing.tags.opening && !thing.tags.is_surface()) {
            solid[usize::from(thing.id)] = true;
        }
        solid
    };
    let leaf = |at: usize| -> usize {
        let id = sight.ids[at];
        if !solid[usize::from(id)] {
            return 0;
        }
        match sight.piece_ids.get(at) {
            Some(&piece) if piece > 0 && usize::from(piece) < named => usize::from(piece),
            _ => named + usize::from(id),
        }
    };
    let distances = Distances::of(sight);
    let mut leaves = vec![Region::EMPTY; named + usize::from(most) + 1];
    for y in 0..h {
        for x in 0..w {
            let at = y * w + x;
            let (leaf, along) = (leaf(at), f64::from(sight.depth[at]));
            if leaf > 0 && along > 0.0 && along.is_finite() {
                leaves[leaf].take(x, y, distances.squared(x, y, along));
            }
        }
    }
    let holes = holes(sight, things);
    let splits = splits(sight, &leaves, &holes);
    let mut out = Vec::new();
    let mut push = |leaf: usize, region: &Region, part: u64| {
        let piece = (leaf < named).then(|| &sight.pieces[leaf - 1]);
        // The road in a tunnel; a rope.
        if piece.is_some_and(|piece| !piece.solid || SURFACES.contains(&piece.name.as_str())) {
            return;
        }
        let object = piece.map_or_else(|| (leaf - named) as u16, |piece| piece.object);
        let Some(thing) = things.iter().find(|thing| thing.id == object && !thing.tags.opening) else { return };
        out.push(obstacle(
            (errors, seed, frame),
            sight,
            thing,
            piece.map(|piece| piece.name.as_str()),
            region,
            (leaf as u64, part),
        ));
    };
    let mut regions = vec![[Region::EMPTY; BANDS * SIDES]; splits.count];
    if splits.count > 0 {
        for y in 0..h {
            for x in 0..w {
                let at = y * w + x;
                let (leaf, along) = (leaf(at), f64::from(sight.depth[at]));
                let Some(split) = splits.of[leaf].filter(|_| along > 0.0 && along.is_finite()) else { continue };
                let squared = distances.squared(x, y, along);
                let band = band(squared, leaves[leaf].nearest);
                let point = ImagePoint { u: (x as f64 + 0.5) / w as f64, v: (y as f64 + 0.5) / h as f64 };
                let Some(side) = split.hole.map_or(Some(0), |hole| side(&holes[hole], point, squared)) else { continue };
                regions[split.slot][band * SIDES + side].take(x, y, squared);
            }
        }
    }
    for (leaf, region) in leaves.iter().enumerate().skip(1).filter(|(_, region)| region.pixels > 0) {
        match splits.of[leaf] {
            Some(split) => {
                let parts = regions[split.slot].iter().enumerate().filter(|(_, region)| region.pixels > 0);
                parts.for_each(|(part, region)| push(leaf, region, part as u64 + 1));
            }
            None => push(leaf, region, 0),
        }
    }
    out.extend(slopes_ahead(errors, seed, frame, sight, things, &holes));
    out
}

/// How a leaf is split.
#[derive(Clone, Copy, Debug)]
struct Split {
    slot: usize,
    /// The opening that it surrounds.
    hole: Option<usize>,
}

struct Splits {
    /// By leaf; `None` if it is listed as one.
    of: Vec<Option<Split>>,
    count: usize,
}

fn splits(sight: &GroundTruthView<'_>, leaves: &[Region], holes: &[Hole]) -> Splits {
    let mut splits = Splits { of: vec![None; leaves.len()], count: 0 };
    for (leaf, region) in leaves.iter().enumerate().filter(|(_, region)| region.pixels > 0) {
        let area = region.image_box(sight.width, sight.height);
        let hole = surrounded(&area, (region.nearest, region.farthest), holes);
        let deep = band(region.farthest, region.nearest) > 0;
        if deep || hole.is_some() {
            splits.of[leaf] = Some(Split { slot: splits.count, hole });
            splits.count += 1;
        }
    }
    splits
}

/// The openings in view.
fn holes(sight: &GroundTruthView<'_>, things: &[PerceivedObject]) -> Vec<Hole> {
    let of = |thing: &PerceivedObject| {
        let (x, y) = (thing.deepest.u * sight.width as f64, thing.deepest.v * sight.height as f64);
        let along = f64::from(*sight.opening_depth.get(y as usize * sight.width + x as usize)?);
        let (right, up) = slopes(sight.camera, thing.deepest);
        Some(Hole { area: thing.bounds, range: along * sqrt(1.0 + right * right + up * up) })
    };
    things.iter().filter(|thing| thing.tags.opening).filter_map(of).collect()
}

fn obstacle(
    draw: (&ErrorFile, u64, u64),
    sight: &GroundTruthView<'_>,
    thing: &PerceivedObject,
    piece: Option<&str>,
    region: &Region,
    (leaf, part): (u64, u64),
) -> Obstacle {
    let (frame, id) = (draw.2, u64::from(thing.id));
    // What is listed as one box is missed or not with its object.
    let key = if piece.is_none() && part == 0 { vec![frame, id] } else { vec![frame, id, leaf, part] };
    let area = region.image_box(sight.width, sight.height);
    let found = obstacle_of(draw, sight, thing, area, (region.nearest, region.pixels), &key);
    Obstacle { name: name_of(&found.name, piece), ..found }
}

/// "red crane jib"; a wall's wall is a wall.
fn name_of(object: &str, piece: Option<&str>) -> String {
    match piece {
        Some(piece) if !object.ends_with(piece) => format!("{object} {piece}"),
        _ => object.to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use spf_core::query::QueryKind;
    use spf_core::reply::Reply;

    use super::*;
    use crate::Oracle;
    use crate::tests::{Painting, ask, query, tagged};

    fn boxes(painting: &Painting, instruction: &str) -> Reply {
        let oracle = Oracle::new(ErrorFile::named("perfect").unwrap(), 3.0, 7);
        ask(&oracle, painting, &query(0, QueryKind::point(true), instruction))
    }

    /// Name, depth and rectangle in pixels of each box.
    fn listed(reply: &Reply) -> Vec<(String, u8, [i32; 4])> {
        let px = |share: f64, of: f64| libm::round(share * of) as i32;
        let rectangle = |a: &ImageBox| [px(a.left, 960.0), px(a.right, 960.0), px(a.top, 720.0), px(a.bottom, 720.0)];
        reply.boxes.iter().map(|b| (b.name.clone(), b.depth, rectangle(&b.area))).collect()
    }

    #[test]
    fn the_parts_of_a_thing_are_listed_each_with_its_own_depth() {
        // Under the deck, between two piers, one sees the crane.
        let painting = Painting::new()
            .with(tagged(1, "crane", "machine", "red"), 440..520, 350..450, 90.0)
            .with(tagged(2, "bridge", "structure", "grey"), 100..860, 200..260, 22.0)
            .with(tagged(2, "bridge", "structure", "grey"), 200..240, 260..600, 13.0)
            .with(tagged(2, "bridge", "structure", "grey"), 700..740, 260..600, 36.0)
            .named(2, "deck", false, 100..860, 200..260)
            .named(2, "pier", false, 200..240, 260..600)
            .named(2, "pier", false, 700..740, 260..600);
        let found = listed(&boxes(&painting, "fly to the red crane"));
        let expected = [
            ("grey bridge pier", 6, [200, 240, 260, 600]),
            ("grey bridge deck", 7, [100, 860, 200, 260]),
            ("grey bridge pier", 8, [700, 740, 260, 600]),
        ];
        assert_eq!(found, expected.map(|(name, depth, area)| (name.to_owned(), depth, area)));
    }

    #[test]
    fn a_wall_into_the_distance_is_listed_in_lengths_of_two_labels() {
        // From 2 m at the left edge to 40 m.
        let far = |column: usize| 2.0 + 38.0 * column as f32 / 600.0;
        let painting = Painting::new()
            .with(tagged(1, "crane", "machine", "red"), 800..880, 200..500, 95.0)
            .with(tagged(2, "wall", "structure", "grey"), 0..600, 300..420, 2.0)
            .deepened(0..600, 300..420, far);
        let found = listed(&boxes(&painting, "fly to the red crane"));
        assert_eq!(found.len(), 3, "{found:?}");
        assert!(found.windows(2).all(|pair| pair[0].2[1] <= pair[1].2[0] + 2 && pair[0].1 + 2 == pair[1].1), "{found:?}");
        assert!(found.iter().all(|(name, _, _)| name == "grey wall"));
        // What spans no more is one box.
        let short = Painting::new()
            .with(tagged(1, "crane", "machine", "red"), 800..880, 200..500, 95.0)
            .with(tagged(2, "wall", "structure", "grey"), 0..600, 300..420, 20.0)
            .deepened(0..600, 300..420, |column| 20.0 + column as f32 / 30.0);
        assert_eq!(listed(&boxes(&short, "fly to the red crane")).len(), 1);
    }

    #[test]
    fn what_surrounds_an_opening_is_listed_by_its_true_edges() {
        let gate = tagged(1, "gate", "structure", "red");
        let way = |id: u16| spf_core::tags::Tagged {
            opening: true,
            opening_of: Some(gate.key.clone()),
            ..tagged(id, "gate", "opening", "")
        };
        let painting = Painting::new()
            .with(gate.clone(), 300..660, 200..560, 10.0)
            .with(tagged(3, "tree", "tree", "green"), 380..580, 280..480, 18.0)
            .with(way(2), 380..580, 280..480, 10.0);
        let found = listed(&boxes(&painting, "fly through the gate"));
        let sides: Vec<[i32; 4]> = found.iter().filter(|(name, _, _)| name == "red gate").map(|(_, _, area)| *area).collect();
        assert_eq!(sides.len(), 4, "{found:?}");
        for [left, right, top, bottom] in sides {
            let inside = left < 579 && right > 381 && top < 479 && bottom > 281;
            assert!(!inside, "{found:?}");
        }
    }

    #[test]
    fn an_opening_seen_past_something_does_not_divide_it() {
        let gate = tagged(1, "gate", "structure", "red");
        let way =
            spf_core::tags::Tagged { opening: true, opening_of: Some(gate.key.clone()), ..tagged(2, "gate", "opening", "") };
        // A column with a wide head, and between head and foot, beside its shaft, a far gate.
        let painting = Painting::new()
            .with(tagged(3, "crane", "machine", "red"), 700..800, 200..500, 90.0)
            .with(gate, 400..450, 300..400, 40.0)
            .with(way, 410..440, 310..390, 40.0)
            .with(tagged(4, "column", "structure", "grey"), 380..560, 100..160, 8.0)
            .with(tagged(4, "column", "structure", "grey"), 460..480, 160..600, 8.0);
        let found = listed(&boxes(&painting, "fly to the red crane"));
        assert_eq!(found.iter().filter(|(name, _, _)| name == "grey column").count(), 1, "{found:?}");
    }

    #[test]
    fn a_band_is_two_labels_deep() {
        assert!((libm::log10(crate::extent::BAND) * 4.5 / 2.0 - 2.0).abs() < 1e-9);
        assert_eq!([4.0f64, 5.5, 5.6, 15.6].map(|range| band(range * range, 4.0)), [0, 0, 1, 2]);
        assert_eq!(band(0.9 * 0.9, 0.1 * 0.1), 0, "up to a metre everything is at label 1");
    }
}
