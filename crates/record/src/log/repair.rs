//! Repairs a truncated log.

use std::fs::{File, TryLockError};
use std::io::{self, BufReader, BufWriter, Read, Write};
use std::path::{Path, PathBuf};

use mcap::records::MessageHeader;
use mcap::write::NoSeek;
use mcap::{McapError, Writer};
use spf_core::time::Time;

use super::reader::{Piece, Pieces, ReadError};
use super::writer;

/// Why a log could not be repaired.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RepairError {
    /// The log contains nothing readable.
    #[error("no readable data in `{path}`")]
    Nothing {
        /// The file.
        path: PathBuf,
        /// The cause.
        #[source]
        source: ReadError,
    },
    /// The log is being written by a flight.
    #[error("`{path}` is still being written: repair it after the flight")]
    Busy {
        /// The file.
        path: PathBuf,
    },
    /// The repaired log could not be written.
    #[error("cannot write the repaired log `{path}`")]
    Write {
        /// The file.
        path: PathBuf,
        /// The cause.
        #[source]
        source: io::Error,
    },
}

/// The result of a repair.
#[derive(Debug)]
pub struct Repaired {
    /// Number of messages kept.
    pub messages: u64,
    /// Flight time of the last message.
    pub until: Time,
    /// The error that ended the reading; `None` if the log was complete.
    pub trouble: Option<ReadError>,
}

/// Replaces a log by a complete one with all readable messages; a complete log is not changed. The old file is kept
/// until the new one is complete.
///
/// # Errors
/// [`RepairError`]; the file is then unchanged.
pub fn repair(path: &Path) -> Result<Repaired, RepairError> {
    let nothing = |source| RepairError::Nothing { path: path.to_owned(), source };
    let source = spf_input::open(path).map_err(|error| nothing(ReadError::Read(error)))?;
    if being_written(&source) {
        return Err(RepairError::Busy { path: path.to_owned() });
    }
    let beside = path.with_extension("mcap.part");
    let failed = |source| RepairError::Write { path: beside.clone(), source };
    let part = File::create(&beside).map_err(failed)?;
    let rewritten = rewrite(BufReader::new(source), BufWriter::new(part)).and_then(|(found, mut file)| {
        let synced = file.flush().and_then(|()| file.get_ref().sync_all());
        synced.map(|()| found).map_err(Rewrite::Write)
    });
    let outcome = match rewritten {
        Ok(found) if found.messages == 0 => Err(nothing(found.trouble.unwrap_or(ReadError::Torn))),
        Ok(found) if found.trouble.is_none() => Ok(found),
        Ok(found) => return std::fs::rename(&beside, path).map(|()| found).map_err(failed),
        Err(Rewrite::Write(source)) => Err(failed(source)),
        Err(Rewrite::Form(source)) => Err(nothing(source.into())),
    };
    // The partial copy is useless; a failure to remove it adds nothing to the error.
    std::fs::remove_file(&beside).ok();
    outcome
}

/// Whether another process has a log open for writing. False where file locks are not supported.
fn being_written(file: &File) -> bool {
    matches!(file.try_lock_shared(), Err(TryLockError::WouldBlock))
}

/// Why rewriting failed, except for errors of the source.
#[derive(Debug)]
pub enum Rewrite {
    /// The copy could not be written.
    Write(io::Error),
    /// The messages could not be encoded.
    Form(McapError),
}

impl From<McapError> for Rewrite {
    fn from(error: McapError) -> Self {
        match error {
            McapError::Io(error) => Self::Write(error),
            error => Self::Form(error),
        }
    }
}

/// Copies the readable part of `source` into a complete log. Used by [`repair`], and by tests without files.
///
/// # Errors
/// [`Rewrite`] for errors of the copy. Errors of the source are part of the [result](Repaired).
pub fn rewrite<R: Read, W: Write>(source: R, copy: W) -> Result<(Repaired, W), Rewrite> {
    let mut writer = writer::options().create(NoSeek::new(copy))?;
    let mut found = Repaired { messages: 0, until: Time::ZERO, trouble: None };
    for piece in Pieces::new(source) {
        match piece {
            Ok(Piece::Metadata(metadata)) => writer.write_metadata(&metadata)?,
            Ok(Piece::Message(message)) => {
                copy_message(&mut writer, &message)?;
                found.messages += 1;
                found.until = found.until.max(Time::from_nanos(message.log_time));
            }
            Err(error) => {
                found.trouble = Some(error.into());
                break;
            }
        }
    }
    writer.finish()?;
    Ok((found, writer.into_inner().into_inner()))
}

fn copy_message<W: Write>(writer: &mut Writer<NoSeek<W>>, message: &mcap::Message<'_>) -> Result<(), McapError> {
    let channel = &message.channel;
    let schema = match &channel.schema {
        Some(schema) => writer.add_schema(&schema.name, &schema.encoding, &schema.data)?,
        None => 0,
    };
    let channel_id = writer.add_channel(schema, &channel.topic, &channel.message_encoding, &channel.metadata)?;
    let header =
        MessageHeader { channel_id, sequence: message.sequence, log_time: message.log_time, publish_time: message.publish_time };
    writer.write_to_known_channel(&header, &message.data)
}
