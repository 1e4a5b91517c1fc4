//! Writes the images of an example.

use spf_flight::dataset::Example;
use spf_flight::dataset::record::Files;
use spf_media::jpeg::{EncodeError, Jpeg};
use spf_media::png;

use super::folder::Folder;
use crate::commands::sim::centimetres;
use crate::error::CliError;

/// How photographs are kept.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum ImageFormat {
    Png,
    Jpeg(u8),
}

impl ImageFormat {
    /// `png` or `jpeg:QUALITY`.
    pub(super) fn parse(text: &str) -> Result<Self, CliError> {
        let quality = |text: &str| text.parse().ok().filter(|quality| (1..=100).contains(quality));
        match text.split_once(':') {
            None if text == "png" => Ok(Self::Png),
            Some(("jpeg", text)) if quality(text).is_some() => Ok(Self::Jpeg(quality(text).unwrap_or(100))),
            _ => Err(CliError::usage(format!("--pictures: invalid image format `{text}`"))
                .hint("use png, or jpeg:QUALITY with a quality from 1 to 100")),
        }
    }
}

/// Writes the images of an example; returns their paths.
pub(super) fn write_example(folder: &Folder, number: u64, example: &Example, format: ImageFormat) -> Result<Files, CliError> {
    let (width, height) = (example.truth.width, example.truth.height);
    let grey = |pixels: &[u16]| encoded(png::encode_grey16(width, height, pixels));
    let put = |folder_name: &str, name: String, bytes: &[u8]| {
        let path = format!("{folder_name}/{name}");
        folder.write(&path, bytes).map(|()| path)
    };
    let name = |end: &str| format!("{number:06}{end}");
    let image = match format {
        ImageFormat::Png => put("pictures", name(".png"), &encoded(png::encode(&example.photograph))?)?,
        ImageFormat::Jpeg(quality) => {
            put("pictures", name(".jpg"), encoded(Jpeg::encode(&example.photograph, quality))?.bytes())?
        }
    };
    let deep = |depth: &[f32]| depth.iter().map(|metres| centimetres(*metres)).collect::<Vec<u16>>();
    let truth = &example.truth;
    let ids = put("ids", name(".png"), &grey(truth.ids.as_deref().unwrap_or_default())?)?;
    let depth = put("depth", name(".png"), &grey(&deep(truth.depth.as_deref().unwrap_or_default()))?)?;
    let openings = truth.opening_ids.as_deref().filter(|ids| ids.iter().any(|id| *id != 0));
    let opening_ids = openings.map(|ids| put("openings", name(".png"), &grey(ids)?)).transpose()?;
    let opening_depth = openings.and(truth.opening_depth.as_deref());
    let opening_depth = opening_depth.map(|depth| put("openings", name("_depth.png"), &grey(&deep(depth))?)).transpose()?;
    let mask = example.mask().map(|mask| {
        let pixels: Vec<u8> = mask.iter().map(|inside| u8::from(*inside) * 255).collect();
        put("masks", name(".png"), &encoded(png::encode_grey8(width, height, &pixels))?)
    });
    Ok(Files { image, ids, depth, opening_ids, opening_depth, mask: mask.transpose()? })
}

fn encoded<T>(file: Result<T, EncodeError>) -> Result<T, CliError> {
    file.map_err(|error| CliError::internal("cannot encode an image").because(&error))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn formats_are_read_or_refused() {
        assert_eq!(ImageFormat::parse("png").ok(), Some(ImageFormat::Png));
        assert_eq!(ImageFormat::parse("jpeg:80").ok(), Some(ImageFormat::Jpeg(80)));
        for text in ["", "jpeg", "jpeg:0", "jpeg:101", "png:3", "gif"] {
            assert!(ImageFormat::parse(text).is_err(), "{text}");
        }
    }
}
