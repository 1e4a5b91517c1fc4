//! What a source does with what it receives.

use std::sync::Arc;

use spf_core::time::{Duration, Time};
use spf_drone::frames::VideoStats;
use spf_media::Rgb;
use spf_media::h264::AccessUnit;

use crate::arrivals::Arrivals;
use crate::clock::{Arrival, CameraTimes, CaptureClock, is_plausible};
use crate::failure::SourceError;
use crate::inlet::{Coded, Received};
use crate::profile::{has_b_slice, why_undecodable};
use crate::shared::{CameraState, Failure, Shared};

/// Takes the images of a source, with their times.
pub(crate) struct Feed {
    shared: Arc<Shared>,
    latency: Duration,
    times: CameraTimes,
    clock: CaptureClock,
    /// Losses of this connection, and of those before it.
    video: VideoStats,
    video_before: VideoStats,
    packets: Packets,
    packets_before: Packets,
    lost: u64,
}

/// Numbers of packets.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Packets {
    /// Received, where they are counted.
    pub(crate) received: Option<u64>,
    /// Lost, where they are numbered.
    pub(crate) lost: u64,
}

impl Packets {
    fn and(self, other: Self) -> Self {
        let received = self.received.map_or(other.received, |received| Some(received + other.received.unwrap_or(0)));
        Self { received, lost: self.lost + other.lost }
    }
}

impl Feed {
    pub(crate) fn new(shared: Arc<Shared>, latency: Duration, times: CameraTimes) -> Self {
        Self {
            shared,
            latency,
            times,
            clock: CaptureClock::new(latency),
            video: VideoStats::default(),
            video_before: VideoStats::default(),
            packets: Packets::default(),
            packets_before: Packets::default(),
            lost: 0,
        }
    }

    /// Flight time.
    pub(crate) fn now(&self) -> Time {
        self.shared.now()
    }

    pub(crate) fn stopped(&self) -> bool {
        self.shared.stopped()
    }

    pub(crate) fn wait(&self, time: Duration) {
        self.shared.wait(time);
    }

    /// A new connection begins: its timestamps and numbers start anew.
    pub(crate) fn connect(&mut self) {
        self.clock = CaptureClock::new(self.latency);
        self.video_before = sum(self.video_before, std::mem::take(&mut self.video));
        self.packets_before = self.packets_before.and(std::mem::take(&mut self.packets));
        self.lost = 0;
        self.shared.report().connections += 1;
        // What follows does not continue what came before.
        self.shared.inlet.reference_lost();
    }

    pub(crate) fn fail(&self, error: &SourceError) {
        let failure = Failure { why: error.to_string(), hint: error.hint() };
        let mut report = self.shared.report();
        report.state = CameraState::Failed(failure.clone());
        report.last_failure = Some(failure);
        report.lasts = error.waits_long();
    }

    /// Takes an access unit; fails with one that is not damaged but can never be decoded.
    pub(crate) fn unit(&mut self, at: Time, stamp: Option<i64>, age: Option<f64>, unit: AccessUnit) -> Result<(), SourceError> {
        if unit.key
            && let Some(why) = why_undecodable(&unit.annex_b)
        {
            return Err(SourceError::Profile(why));
        }
        if has_b_slice(&unit.annex_b) {
            self.shared.report().b_frames += 1;
        }
        self.put(at, stamp, age, Coded::H264(unit));
        Ok(())
    }

    /// Tells what arrives at a port, and what is missing in it.
    pub(crate) fn arrived(&self, arrivals: &Arrivals, lacks_parameters: bool, other_streams: &[u8]) {
        let mut report = self.shared.report();
        report.arrivals = Some(arrivals.clone());
        report.lacks_parameters = lacks_parameters;
        if report.other_streams != other_streams {
            report.other_streams = other_streams.to_vec();
        }
    }

    /// Tells that what failed was overcome, although there is no image yet.
    pub(crate) fn goes_on(&self) {
        let mut report = self.shared.report();
        if matches!(report.state, CameraState::Failed(_)) {
            report.state = CameraState::Connecting;
            report.lasts = false;
        }
    }

    /// Whether an image was received since the connection began.
    pub(crate) fn has_images(&self) -> bool {
        self.video.units > 0
    }

    /// Takes a JPEG image.
    pub(crate) fn jpeg(&mut self, at: Time, stamp: Option<i64>, age: Option<f64>, jpeg: Vec<u8>) {
        self.put(at, stamp, age, Coded::Jpeg(jpeg));
    }

    /// Counts images that are left out because newer ones are there.
    pub(crate) fn superseded(&self, images: usize) {
        if images > 0 {
            self.shared.frames.count(|tally| tally.superseded += images as u64);
        }
    }

    /// Takes an uncompressed image.
    #[allow(dead_code, reason = "Video4Linux is not there")]
    pub(crate) fn yuyv(&mut self, at: Time, stamp: Option<i64>, age: Option<f64>, image: Vec<u8>, size: (u32, u32)) {
        self.put(at, stamp, age, Coded::Yuyv(image, size));
    }

    /// Takes an image that is decoded; `codec` is how it was coded.
    #[allow(dead_code, reason = "neither Video4Linux nor GStreamer is there")]
    pub(crate) fn decoded(&mut self, at: Time, stamp: Option<i64>, age: Option<f64>, image: Rgb, codec: &'static str) {
        self.put(at, stamp, age, Coded::Decoded(image, codec));
    }

    /// Usual time from the capture of a frame to its arrival.
    #[cfg(feature = "gstreamer")]
    pub(crate) fn latency(&self) -> Duration {
        self.latency
    }

    /// Says that the images are those of a recording, or made up, whatever happens.
    pub(crate) fn is_recording(&self) {
        self.shared.report().recorded = true;
    }

    fn put(&mut self, at: Time, stamp: Option<i64>, age: Option<f64>, coded: Coded) {
        let lost = self.video.gaps + self.video.skipped + self.video.damaged;
        let follows = std::mem::replace(&mut self.lost, lost) == lost;
        let age = age.filter(|_| self.times == CameraTimes::Clock);
        let stamp = stamp.filter(|_| self.times != CameraTimes::Arrival);
        let captured = self.clock.captured(Arrival { at, stamp, age, follows });
        let codec = match coded {
            Coded::H264(_) => "H.264",
            Coded::Jpeg(_) => "JPEG",
            Coded::Yuyv(..) => "YUYV",
            Coded::Decoded(_, codec) => codec,
        };
        self.shared.inlet.put(Received { at, captured, coded });
        let mut report = self.shared.report();
        report.state = CameraState::Receiving;
        report.lasts = false;
        report.codec = Some(codec);
        // The times of a pipeline may be those of an arrival.
        (report.own_age, report.tick_rate) = (self.clock.own_age(), self.clock.tick_rate());
        report.own_clock = age.is_some_and(is_plausible) && codec != "raw";
    }

    /// Takes an image that is decoded already.
    pub(crate) fn image(&self, captured: Time, image: Rgb) {
        let mut report = self.shared.report();
        report.state = CameraState::Receiving;
        report.codec = Some("H.264");
        drop(report);
        self.shared.frames.receive(captured, self.now(), image);
    }

    /// Sets the losses of this connection.
    pub(crate) fn tally(&mut self, video: VideoStats, packets: Packets) {
        let inlet = self.shared.inlet.skipped();
        if (video, packets) != (self.video, self.packets) || inlet > 0 {
            (self.video, self.packets) = (video, packets);
            let mut all = sum(self.video_before, video);
            all.skipped += inlet;
            self.shared.frames.count(|tally| tally.video = all);
            let Packets { received, lost } = self.packets_before.and(packets);
            let mut report = self.shared.report();
            (report.packets, report.packets_lost) = (received, lost);
        }
    }
}

fn sum(a: VideoStats, b: VideoStats) -> VideoStats {
    VideoStats { units: a.units + b.units, gaps: a.gaps + b.gaps, skipped: a.skipped + b.skipped, damaged: a.damaged + b.damaged }
}
