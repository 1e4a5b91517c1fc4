//! One H.264 track in an MP4 file (ISO/IEC 14496-12 and -15), samples first, index last.
//!
//! Available muxers keep all samples in memory until the end or are unmaintained, so the boxes come from `mp4-atom` and
//! are arranged here. The file has no creation time: equal images give equal bytes.

use std::fs::File;
use std::io::{self, Seek, SeekFrom, Write};

use mp4_atom::{
    Avc1, Avcc, AvccExt, Co64, Dinf, Dref, Encode, Ftyp, Hdlr, Mdhd, Mdia, Minf, Moov, Mvhd, Stbl, Stsc, StscEntry, Stsd, Stss,
    Stsz, StszSamples, Stts, SttsEntry, Tkhd, Trak, Url, Visual, Vmhd,
};
use spf_media::h264::{AccessUnit, NalKind, nal_units};

/// Time units per second.
pub(super) const TIMESCALE: u32 = 90_000;

/// The destination of the file.
pub(super) trait Sink: Write + Seek {
    /// Truncates the file to `length` bytes.
    fn cut(&mut self, length: u64) -> io::Result<()>;
}

impl Sink for File {
    fn cut(&mut self, length: u64) -> io::Result<()> {
        self.set_len(length)
    }
}

/// Why a sample or the index could not be written.
#[derive(Debug)]
pub(super) enum MuxError {
    /// The destination failed.
    Io(io::Error),
    /// The format cannot represent the sample or the index.
    Form(String),
}

impl From<io::Error> for MuxError {
    fn from(error: io::Error) -> Self {
        Self::Io(error)
    }
}

/// Facts about a finished file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Written {
    pub(super) samples: u64,
    /// End of the last sample, in units of [`TIMESCALE`].
    pub(super) end: u64,
    pub(super) bytes: u64,
}

#[derive(Clone, Copy, Debug)]
struct Sample {
    start: u64,
    size: u32,
    key: bool,
}

/// Writes the file.
#[derive(Debug)]
pub(super) struct Muxer<S> {
    sink: S,
    width: u16,
    height: u16,
    /// Start of the sample box.
    mdat: u64,
    /// End of the last complete sample, from the start of the file.
    end: u64,
    samples: Vec<Sample>,
    parameters: Option<(Vec<u8>, Vec<u8>)>,
    buffer: Vec<u8>,
}

/// Size 1 means that a 64-bit size follows the type; it is filled in at the end.
const MDAT_HEADER: [u8; 16] = [0, 0, 0, 1, b'm', b'd', b'a', b't', 0, 0, 0, 0, 0, 0, 0, 0];

impl<S: Sink> Muxer<S> {
    /// Starts the file. Sides are at most 65535 pixels, which the encoder ensures.
    pub(super) fn new(mut sink: S, width: u32, height: u32) -> io::Result<Self> {
        let mut head = Vec::new();
        let brands = vec![b"isom".into(), b"iso2".into(), b"avc1".into(), b"mp41".into()];
        Ftyp { major_brand: b"isom".into(), minor_version: 512, compatible_brands: brands }
            .encode(&mut head)
            .map_err(io::Error::other)?;
        let mdat = head.len() as u64;
        head.extend_from_slice(&MDAT_HEADER);
        sink.write_all(&head)?;
        let side = |pixels: u32| u16::try_from(pixels).unwrap_or(u16::MAX);
        let (width, height) = (side(width), side(height));
        Ok(Self { sink, width, height, mdat, end: head.len() as u64, samples: Vec::new(), parameters: None, buffer: Vec::new() })
    }

    /// Appends an image shown from `start` on, later than the previous one. After an error the file is unchanged.
    pub(super) fn push(&mut self, start: u64, unit: &AccessUnit) -> Result<(), MuxError> {
        self.buffer.clear();
        let (mut sps, mut pps) = (None, None);
        for nal in nal_units(&unit.annex_b) {
            match NalKind::of(nal) {
                // `avc1` keeps the parameter sets in the index only.
                Some(NalKind::Sps) => sps = Some(nal),
                Some(NalKind::Pps) => pps = Some(nal),
                _ => {
                    let length = u32::try_from(nal.len()).map_err(|_| MuxError::Form("a NAL unit above 4 GiB".into()))?;
                    self.buffer.extend_from_slice(&length.to_be_bytes());
                    self.buffer.extend_from_slice(nal);
                }
            }
        }
        match (&self.parameters, sps.zip(pps)) {
            (None, None) => return Err(MuxError::Form("the first frame has no parameter sets".into())),
            (None, Some((sps, pps))) => self.parameters = Some((sps.to_vec(), pps.to_vec())),
            (Some((old_sps, old_pps)), Some((sps, pps))) if (old_sps.as_slice(), old_pps.as_slice()) != (sps, pps) => {
                return Err(MuxError::Form("the parameter sets changed in flight".into()));
            }
            _ => {}
        }
        if let Err(error) = self.sink.write_all(&self.buffer) {
            self.sink.seek(SeekFrom::Start(self.end))?;
            return Err(error.into());
        }
        let size = u32::try_from(self.buffer.len()).map_err(|_| MuxError::Form("a frame above 4 GiB".into()))?;
        self.end += u64::from(size);
        self.samples.push(Sample { start, size, key: unit.key });
        Ok(())
    }

    /// Writes the index; the last sample lasts until `end`. If the disk is full, the last samples are removed to make
    /// room.
    pub(super) fn finish(mut self, end: u64) -> Result<Written, MuxError> {
        let mut end = end;
        loop {
            let mut index = Vec::new();
            self.index(end)?.encode(&mut index).map_err(|error| MuxError::Form(error.to_string()))?;
            match self.close(&index) {
                Ok(bytes) => return Ok(Written { samples: self.samples.len() as u64, end, bytes }),
                Err(error) if self.samples.len() > 1 => {
                    // Space used by samples will hold the index: free as much as it needs.
                    let mut freed = 0;
                    while freed < index.len() as u64 && self.samples.len() > 1 {
                        let Some(sample) = self.samples.pop() else { return Err(error.into()) };
                        freed += u64::from(sample.size);
                        self.end -= u64::from(sample.size);
                        end = sample.start;
                    }
                }
                Err(error) => return Err(error.into()),
            }
        }
    }

    /// Writes `index` after the last sample, truncates the file there, and fills in the size of the sample box.
    fn close(&mut self, index: &[u8]) -> io::Result<u64> {
        self.sink.seek(SeekFrom::Start(self.end))?;
        self.sink.write_all(index)?;
        let bytes = self.end + index.len() as u64;
        self.sink.cut(bytes)?;
        self.sink.seek(SeekFrom::Start(self.mdat + 8))?;
        self.sink.write_all(&(self.end - self.mdat).to_be_bytes())?;
        self.sink.flush()?;
        Ok(bytes)
    }

    fn index(&self, end: u64) -> Result<Moov, MuxError> {
        let Some((sps, pps)) = &self.parameters else { return Err(MuxError::Form("no frames".into())) };
        let mut avcc = Avcc::new(sps, pps).map_err(|error| MuxError::Form(error.to_string()))?;
        // ISO/IEC 14496-15, 5.3.3.1.2: the High profiles also contain chroma format and bit depth; the default is 4:2:0
        // in 8 bits.
        if [100, 110, 122, 144].contains(&avcc.avc_profile_indication) {
            avcc.ext = Some(AvccExt::default());
        }
        let visual = Visual {
            data_reference_index: 1,
            width: self.width,
            height: self.height,
            horizresolution: 72.into(),
            vertresolution: 72.into(),
            frame_count: 1,
            compressor: "".into(),
            depth: 24,
        };
        let codec = Avc1 { visual, avcc, btrt: None, colr: None, pasp: None, taic: None, fiel: None, spatial: None };
        let (stsc, co64) = self.chunks();
        let keys = (1..).zip(&self.samples).filter_map(|(number, sample)| sample.key.then_some(number));
        let stbl = Stbl {
            stsd: Stsd { codecs: vec![codec.into()] },
            stts: Stts { entries: self.durations(end) },
            stss: Some(Stss { entries: keys.collect() }),
            stsc: Stsc { entries: stsc },
            stsz: Stsz { samples: StszSamples::Different { sizes: self.samples.iter().map(|sample| sample.size).collect() } },
            co64: Some(Co64 { entries: co64 }),
            ..Stbl::default()
        };
        let dinf = Dinf { dref: Dref { entries: vec![Url::default().into()] } };
        let mdia = Mdia {
            mdhd: Mdhd { timescale: TIMESCALE, duration: end, language: "und".into(), ..Mdhd::default() },
            hdlr: Hdlr { handler: b"vide".into(), name: "flight".into() },
            minf: Minf { vmhd: Some(Vmhd::default()), dinf, stbl, ..Minf::default() },
        };
        let tkhd = Tkhd {
            track_id: 1,
            duration: end,
            enabled: true,
            in_movie: true,
            width: self.width.into(),
            height: self.height.into(),
            ..Tkhd::default()
        };
        let mvhd = Mvhd {
            creation_time: 0,
            modification_time: 0,
            timescale: TIMESCALE,
            duration: end,
            rate: 1.into(),
            volume: 1.into(),
            matrix: mp4_atom::Matrix::default(),
            next_track_id: 2,
        };
        Ok(Moov { mvhd, trak: vec![Trak { tkhd, mdia, ..Trak::default() }], ..Moov::default() })
    }

    /// Sample durations, with equal neighbours merged.
    fn durations(&self, end: u64) -> Vec<SttsEntry> {
        let ends = self.samples.iter().skip(1).map(|sample| sample.start).chain([end]);
        let mut entries: Vec<SttsEntry> = Vec::new();
        for (sample, end) in self.samples.iter().zip(ends) {
            let lasts = u32::try_from(end.saturating_sub(sample.start)).unwrap_or(u32::MAX);
            match entries.last_mut() {
                Some(entry) if entry.sample_delta == lasts => entry.sample_count += 1,
                _ => entries.push(SttsEntry { sample_count: 1, sample_delta: lasts }),
            }
        }
        entries
    }

    /// A chunk starts at every key frame, so that a player fetches no more than it shows.
    fn chunks(&self) -> (Vec<StscEntry>, Vec<u64>) {
        let (mut runs, mut offsets): (Vec<StscEntry>, Vec<u64>) = (Vec::new(), Vec::new());
        let mut at = self.mdat + MDAT_HEADER.len() as u64;
        let mut counts: Vec<u32> = Vec::new();
        for sample in &self.samples {
            match counts.last_mut() {
                Some(count) if !sample.key => *count += 1,
                _ => {
                    counts.push(1);
                    offsets.push(at);
                }
            }
            at += u64::from(sample.size);
        }
        for (chunk, count) in (1..).zip(counts) {
            if runs.last().is_none_or(|run| run.samples_per_chunk != count) {
                runs.push(StscEntry { first_chunk: chunk, samples_per_chunk: count, sample_description_index: 1 });
            }
        }
        (runs, offsets)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use mp4_atom::{Decode, Mdat};
    use std::io::Cursor;

    /// A disk with limited space, bytes.
    #[derive(Debug)]
    struct Disk {
        file: Cursor<Vec<u8>>,
        room: usize,
    }

    impl Write for Disk {
        fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
            let left = self.room.saturating_sub(self.file.position() as usize);
            if left == 0 && !bytes.is_empty() {
                return Err(io::ErrorKind::StorageFull.into());
            }
            self.file.write(&bytes[..bytes.len().min(left)])
        }
        fn flush(&mut self) -> io::Result<()> {
            Ok(())
        }
    }

    impl Seek for Disk {
        fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
            self.file.seek(to)
        }
    }

    impl Sink for &mut Disk {
        fn cut(&mut self, length: u64) -> io::Result<()> {
            self.file.get_mut().truncate(length as usize);
            Ok(())
        }
    }

    fn unit(number: u8) -> AccessUnit {
        let key = number.is_multiple_of(4);
        let head: &[u8] = if key { &[0, 0, 1, 0x67, 66, 0, 31, 1, 0, 0, 1, 0x68, 5, 0, 0, 1, 0x65] } else { &[0, 0, 1, 0x41] };
        let body = vec![number + 1; 100 + usize::from(number)];
        AccessUnit { key, annex_b: [head, &body].concat() }
    }

    /// Pushes images until the disk is full or `count` are written, finishes, and decodes the file.
    fn film(count: u8, room: usize) -> (usize, Written, Moov, Vec<u8>) {
        let mut disk = Disk { file: Cursor::new(Vec::new()), room };
        let mut muxer = Muxer::new(&mut disk, 96, 64).unwrap();
        let taken = (0..count).take_while(|&n| muxer.push(u64::from(n) * 9_000, &unit(n)).is_ok()).count();
        let written = muxer.finish(taken as u64 * 9_000).unwrap();
        let bytes = disk.file.into_inner();
        assert_eq!(bytes.len() as u64, written.bytes);
        let mut rest = Cursor::new(&bytes);
        Ftyp::decode(&mut rest).unwrap();
        let mdat = Mdat::decode(&mut rest).unwrap();
        let moov = Moov::decode(&mut rest).unwrap();
        assert_eq!(rest.position() as usize, bytes.len());
        (taken, written, moov, mdat.data)
    }

    #[test]
    fn the_index_finds_every_sample() {
        let (taken, written, moov, data) = film(10, usize::MAX);
        assert_eq!((taken, written.samples, written.end), (10, 10, 90_000));
        let stbl = &moov.trak[0].mdia.minf.stbl;
        let StszSamples::Different { sizes } = &stbl.stsz.samples else { panic!("sizes differ") };
        // Each sample: four bytes of length, one of header, the body; without parameter sets.
        assert_eq!(*sizes, (0..10).map(|n| 105 + n).collect::<Vec<u32>>());
        assert_eq!(sizes.iter().sum::<u32>() as usize, data.len());
        assert_eq!(stbl.stts.entries, [SttsEntry { sample_count: 10, sample_delta: 9_000 }]);
        assert_eq!(stbl.stss.as_ref().unwrap().entries, [1, 5, 9]);
        let chunks: Vec<_> = stbl.stsc.entries.iter().map(|run| (run.first_chunk, run.samples_per_chunk)).collect();
        assert_eq!(chunks, [(1, 4), (3, 2)]);
        let offsets = &stbl.co64.as_ref().unwrap().entries;
        assert_eq!(offsets[1] - offsets[0], u64::from(sizes[..4].iter().sum::<u32>()));
        assert_eq!(&data[..6], [0, 0, 0, 101, 0x65, 1]);
    }

    #[test]
    fn on_a_full_disk_the_video_ends_earlier_but_plays() {
        for room in 1200..3000 {
            let (taken, written, moov, data) = film(40, room);
            assert!(written.samples >= 1 && written.bytes <= room as u64, "room {room}");
            assert!(written.samples as usize <= taken);
            let stbl = &moov.trak[0].mdia.minf.stbl;
            let StszSamples::Different { sizes } = &stbl.stsz.samples else { panic!("sizes differ") };
            assert_eq!(sizes.len() as u64, written.samples);
            assert_eq!(sizes.iter().sum::<u32>() as usize, data.len());
            assert_eq!(moov.mvhd.duration, written.samples * 9_000);
        }
    }

    #[test]
    fn a_first_image_without_parameter_sets_is_refused() {
        let mut disk = Disk { file: Cursor::new(Vec::new()), room: usize::MAX };
        let mut muxer = Muxer::new(&mut disk, 96, 64).unwrap();
        assert!(matches!(muxer.push(0, &unit(1)), Err(MuxError::Form(_))));
    }
}
