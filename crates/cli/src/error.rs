//! Errors of commands are those of the façade.

pub(crate) use spf_api::error::{Error as CliError, ErrorKind, nearest};
