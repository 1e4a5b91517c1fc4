//! `spf log video`: a video from the images of a log.

use spf_record::log::{LogVideoError, video as make};

use super::{spare, unreadable};
use crate::args::Video;
use crate::error::CliError;
use crate::exit::Exit;
use crate::printer::Printer;

/// Makes a video.
pub(super) fn video(args: &Video, printer: &Printer) -> Result<Exit, CliError> {
    spare(&args.output, args.overwrite)?;
    printer.log(&format!("encoding the images of {} …", args.file.display()));
    let facts = make(&args.file, &args.output).map_err(|error| match &error {
        LogVideoError::Read(source) => unreadable(&args.file, source),
        LogVideoError::NoImages => CliError::usage(format!("cannot make a video of `{}`", args.file.display()))
            .because(&error)
            .hint("record the flight without `--no-video`"),
        _ => CliError::internal("cannot make the video").because(&error),
    })?;
    let (images, seconds) = (facts.frames, facts.duration.as_secs_f64());
    printer.result(&format!("{}: {images} frames, {seconds:.1} s", args.output.display()));
    Ok(Exit::Success)
}
