//! The tracker, and its stand-in without pixels, on rendered clips of 8 s (`docs/studies/2026-11-26-tracker-filter.md`).

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
use tally::{By, Errors, Share, Tally};

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

/// Twelve clips of 4 s in the yard, none of which the constants were fitted to.
#[test]
fn the_stand_in_errs_as_the_tracker_does() {
    let number =
        |index| Number { index, condition: Condition::Plain, walks: index % 2 == 1, scene: "yard", seed: 50, images: 41 };
    let clips = follow(&(0..12).map(number).collect::<Vec<_>>(), None, None);
    let [pixels, model] = [By::Pixels, By::Model].map(|by| Errors::of(clips.iter(), by));
    let rows = format!("{}\n{}\n{}", Errors::HEAD, pixels.row("pixels"), model.row("stand-in"));
    let lost = |errors: &Errors| Share {
        part: errors.lost.iter().map(|lost| lost.part).sum(),
        of: errors.lost.iter().map(|lost| lost.of).sum(),
    };
    assert!(clips.len() == 12 && lost(&pixels).of >= 16, "{rows}");
    assert!((lost(&pixels).percent() - lost(&model).percent()).abs() <= 25.0, "{rows}");
    let alike = |pixels: f64, model: f64| (0.5..2.0).contains(&(model / pixels));
    assert!(alike(pixels.bias, model.bias) && alike(pixels.noise, model.noise), "{rows}");
    assert!((0.33..3.0).contains(&(model.scale[0] / pixels.scale[0])), "{rows}");
}

/// The figures of the study: `CLIPS=0..504 SEED=100 cargo test -p spf-flight --test it -- --ignored clips::figures --nocapture`.
/// With `EACH=1` clip by clip; with `PICTURES=DIR` a picture of every 25th clip. With
/// `KEPT=DIR` the clips are kept there, 41 MB each, and not drawn again. The stand-in's constants are fitted to the clips
/// from `SEED=0`; no threshold of the tracker was chosen with any of them.
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
            println!("{}", Tally::of(of(Some(condition)), By::Pixels).row(&format!("{who}, {}", condition.word())));
        }
        println!("{}", Tally::of(of(None), By::Pixels).row(&format!("{who}, all")));
    }
    println!("{}", Tally::of(clips.iter(), By::Pixels).row("all"));
    println!("\n{}", Errors::HEAD);
    for (who, walks) in [("static", Some(false)), ("walker", Some(true)), ("all", None)] {
        for (tracker, by) in [("pixels", By::Pixels), ("stand-in", By::Model)] {
            let of = clips.iter().filter(|clip| walks.is_none_or(|walks| clip.number.walks == walks));
            println!("{}", Errors::of(of, by).row(&format!("{who}, {tracker}")));
        }
    }
}

/// A line on a clip.
fn each(clip: &Followed) -> String {
    let one = Tally::of(core::iter::once(clip), By::Pixels);
    let number = clip.number;
    let last = clip.images.last().unwrap();
    format!(
        "  {} {}{} {}@{} {}: good {}, off {}, at the end {:?}, seen {:.2}, overlap {:.2}; stand-in {:?}",
        number.index,
        number.condition.word(),
        if number.walks { ", walker" } else { "" },
        number.scene,
        number.seed,
        clip.target,
        one.good.part,
        one.off.part,
        last.pixels.quality,
        last.sight.share,
        last.sight.visible.map_or(0.0, |area| area.overlap(&last.pixels.area)),
        last.model.quality,
    )
}
