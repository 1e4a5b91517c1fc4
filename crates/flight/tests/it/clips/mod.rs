//! The tracker on rendered clips of 8 s (`docs/studies/2026-11-26-tracker-filter.md`).

mod clip;
mod film;
mod flight;
mod followed;
mod kinds;
mod sheet;
mod stage;
mod tally;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::LazyLock;

use rayon::prelude::*;

use clip::Clip;
use followed::Followed;
use kinds::{Condition, Number};
use stage::Stage;
use tally::Tally;

/// Draws the clips, or reads them from a folder if they were drawn before, and follows their targets, in order; kinds of which no
/// flight was found are left out.
fn follow(numbers: &[Number], kept: Option<&Path>, pictures: Option<&Path>) -> Vec<Followed> {
    let mut stages: BTreeMap<(String, bool), Vec<Number>> = BTreeMap::new();
    for number in numbers {
        stages.entry(Stage::key(number)).or_default().push(*number);
    }
    let mut clips: Vec<Followed> = Vec::new();
    for (key, numbers) in stages {
        let stage = LazyLock::new(|| Stage::load(&key));
        clips.par_extend(numbers.into_par_iter().filter_map(|number| {
            let file = kept.map(|folder| folder.join(format!("{}-{}.clip", number.seed, number.index)));
            let clip = match &file {
                Some(file) if file.exists() => Clip::read(number, file).unwrap(),
                _ => {
                    let clip = Clip::draw(&stage, number);
                    if let Some(file) = &file {
                        Clip::write(clip.as_ref(), file).unwrap();
                    }
                    clip
                }
            };
            Followed::new(&clip?, |followed, images| {
                if let Some(folder) = pictures.filter(|_| number.index.is_multiple_of(25)) {
                    sheet::write(folder, followed, images);
                }
            })
        }));
    }
    clips.sort_by_key(|clip| clip.number.index);
    clips
}

/// Six clips of 4 s in the yard, none of which a threshold was chosen with.
#[test]
fn the_tracker_holds_its_targets_through_clips() {
    let number =
        |index| Number { index, condition: Condition::Plain, walks: index % 2 == 1, scene: "yard", seed: 50, images: 41 };
    let clips = follow(&(0..6).map(number).collect::<Vec<_>>(), None, None);
    let tally = Tally::of(clips.iter());
    let row = format!("{}\n{}", Tally::HEAD, tally.row("yard"));
    assert!(clips.len() == 6 && tally.good.of >= 150, "{row}");
    assert!(tally.good.percent() >= 50.0 && tally.off.percent() <= 5.0, "{row}");
    assert!(tally.bridged.of >= 3 && tally.bridged.percent() >= 50.0, "{row}");
}

/// The figures of the study: `CLIPS=0..504 SEED=100 cargo test -p spf-flight --test it -- --ignored clips::figures --nocapture`.
/// With `EACH=1` clip by clip; with `PICTURES=DIR` a picture of every 25th clip. With
/// `KEPT=DIR` the clips are kept there, 41 MB each, and not drawn again. No threshold of the tracker was chosen with any of them.
#[test]
#[ignore = "prints figures; takes a minute; 504 clips take 20"]
fn figures() {
    let clips = std::env::var("CLIPS").unwrap_or_else(|_| "0..18".to_owned());
    let (first, end) = clips.split_once("..").unwrap();
    let seed = std::env::var("SEED").map_or(100, |seed| seed.parse().unwrap());
    let numbers = Number::all(end.parse().unwrap(), seed).split_off(first.parse().unwrap());
    let folder = |name: &str| std::env::var_os(name).map(PathBuf::from);
    let clips = follow(&numbers, folder("KEPT").as_deref(), folder("PICTURES").as_deref());
    println!("{} of {} clips", clips.len(), numbers.len());
    if std::env::var_os("EACH").is_some() {
        clips.iter().for_each(|clip| println!("{}", each(clip)));
    }
    println!("{}", Tally::HEAD);
    for walks in [false, true] {
        let who = if walks { "walker" } else { "static" };
        let of = |condition: Option<Condition>| {
            clips.iter().filter(move |clip| {
                clip.number.walks == walks && condition.is_none_or(|condition| clip.number.condition == condition)
            })
        };
        for condition in Condition::ALL {
            println!("{}", Tally::of(of(Some(condition))).row(&format!("{who}, {}", condition.word())));
        }
        println!("{}", Tally::of(of(None)).row(&format!("{who}, all")));
    }
    println!("{}", Tally::of(clips.iter()).row("all"));
}

/// A line on a clip.
fn each(clip: &Followed) -> String {
    let one = Tally::of(core::iter::once(clip));
    let number = clip.number;
    let last = clip.images.last().unwrap();
    format!(
        "  {} {}{} {}@{} {}: good {}, off {}, at the end {:?}, seen {:.2}, overlap {:.2}",
        number.index,
        number.condition.word(),
        if number.walks { ", walker" } else { "" },
        number.scene,
        number.seed,
        clip.target,
        one.good.part,
        one.off.part,
        last.report.quality,
        last.sight.share,
        last.sight.visible.map_or(0.0, |area| area.overlap(&last.report.area)),
    )
}
