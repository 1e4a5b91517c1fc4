//! `spf screen preview`.

use std::time::{Duration, Instant};

use spf_media::{Jpeg, Rgb};
use spf_screen::area::Region;
use spf_screen::picture::Pictures;
use spf_screen::{Eye, Hidden, Target, WindowName};

use super::{display, profile};
use crate::args::ScreenPreview;
use crate::commands::display::failed;
use crate::commands::sim::write;
use crate::error::CliError;
use crate::exit::Exit;
use crate::printer::{Printer, table};

/// Pictures per second, as in flight.
const RATE: f64 = 20.0;
/// JPEG quality of the picture.
const QUALITY: u8 = 90;

pub(super) fn preview(args: &ScreenPreview, printer: &Printer) -> Result<Exit, CliError> {
    if !(0.0..=3600.0).contains(&args.seconds) {
        return Err(CliError::usage(format!("--seconds: `{}` is not a number of seconds from 0 to 3600", args.seconds)));
    }
    let profile = args.profile.as_deref().map(profile).transpose()?;
    let target = match (&profile, &args.window, &args.monitor) {
        (Some(profile), ..) => profile.target(),
        (_, _, Some(monitor)) => Target::Monitor { name: monitor.clone() },
        (_, title, None) => {
            let name = WindowName { title: title.clone(), class: args.class.clone() };
            Target::Window { name, region: Region::WHOLE }
        }
    };
    let masks = profile.as_ref().map(|profile| profile.camera.masks.clone()).unwrap_or_default();
    let mut eye = Eye::new(display()?, target);
    let mut pictures = Pictures::new(&masks);
    // What cannot be captured is said first.
    let can_be_seen = watch(&mut eye, &mut pictures, Duration::ZERO)?.image.is_some();
    let refuse_to_replace = || {
        if args.overwrite || args.output.symlink_metadata().is_err() {
            return Ok(());
        }
        Err(CliError::usage(format!("--output: `{}` exists", args.output.display()))
            .hint("use --overwrite to replace it, or another file with -o FILE"))
    };
    if can_be_seen {
        refuse_to_replace()?;
    }
    let watched = watch(&mut eye, &mut pictures, Duration::from_secs_f64(args.seconds))?;
    let Some(image) = &watched.image else {
        let why = watched.hidden.map_or_else(|| "nothing was captured".to_owned(), |hidden| hidden.to_string());
        return Err(CliError::failed(why).hint("`spf screen list` lists windows and monitors, and what hides them"));
    };
    let row = |what: &str, found: String| vec![what.to_owned(), found];
    let mut rows =
        vec![row("picture", format!("{}×{}, captured {}×{}", image.width(), image.height(), watched.size.0, watched.size.1))];
    if let Some(profile) = &profile {
        let camera = profile.optics((image.width(), image.height()));
        let (across, down) = camera.half_fov();
        let degrees = |half: f64| (2.0 * half).to_degrees();
        rows.push(row(
            "camera",
            format!("field of view {:.1}° × {:.1}°, tilt {:.1}°", degrees(across), degrees(down), camera.tilt.to_degrees()),
        ));
    }
    rows.push(row(
        "rate",
        format!("{:.1} pictures/s in {:.1} s, {} of them new", watched.rate(), watched.lasted.as_secs_f64(), watched.changed),
    ));
    let mut times = watched.times.clone();
    times.sort_unstable();
    if let (Some(median), Some(worst)) = (times.get(times.len() / 2), times.last()) {
        let ms = |time: &Duration| time.as_secs_f64() * 1e3;
        rows.push(row("time", format!("median {:.1} ms, worst {:.1} ms per picture", ms(median), ms(worst))));
    }
    if watched.unseen > 0 {
        let why = watched.hidden.map_or_else(String::new, |hidden| format!(" ({hidden})"));
        rows.push(row("not seen", format!("{} times{why}", watched.unseen)));
    }
    // It may have been made meanwhile.
    refuse_to_replace()?;
    rows.push(row("file", args.output.display().to_string()));
    printer.result(&table(&rows));
    let jpeg = Jpeg::encode(image, QUALITY).map_err(|error| CliError::internal("cannot encode the picture").because(&error))?;
    write(&args.output, jpeg.bytes())?;
    Ok(Exit::Success)
}

/// What was seen while it was watched.
#[derive(Default)]
struct Watched {
    image: Option<Rgb>,
    /// Size of what was captured.
    size: (u32, u32),
    /// Time taken by each picture.
    times: Vec<Duration>,
    /// Number of pictures that differ from the one before.
    changed: u32,
    unseen: u32,
    hidden: Option<Hidden>,
    lasted: Duration,
}

impl Watched {
    fn rate(&self) -> f64 {
        self.times.len() as f64 / self.lasted.as_secs_f64().max(1e-3)
    }
}

fn watch(eye: &mut Eye, pictures: &mut Pictures, time: Duration) -> Result<Watched, CliError> {
    let mut watched = Watched::default();
    let (begun, period) = (Instant::now(), Duration::from_secs_f64(1.0 / RATE));
    let mut next = begun;
    loop {
        let looked = Instant::now();
        match eye.look().map_err(|error| failed(&error))? {
            Ok(shown) => {
                watched.size = (shown.image.width(), shown.image.height());
                let image = pictures.finish(shown.image);
                watched.times.push(looked.elapsed());
                watched.changed += u32::from(watched.image.as_ref() != Some(&image));
                watched.image = Some(image);
            }
            Err(hidden) => {
                watched.unseen += 1;
                watched.hidden = Some(hidden);
            }
        }
        watched.lasted = begun.elapsed();
        next += period;
        if watched.lasted >= time {
            return Ok(watched);
        }
        std::thread::sleep(next.saturating_duration_since(Instant::now()));
    }
}
