//! Every setting: one row has its name, type, default, parser, variable, flag and description.
#![allow(rustdoc::broken_intra_doc_links, reason = "`NAME[#MODEL][@URL]` is no link")]

use std::net::{IpAddr, SocketAddr};

use spf_core::craft::CraftKind;
use spf_core::geometry::Pose;
use spf_core::query::DepthAs;
use spf_core::step::StepRule;
use spf_drone::tello::TelloMotion;
use spf_flight::policy::PolicyKind;
use spf_motion::executor::Motion;
use spf_pilot::{AtEnd, Preset, QueryTiming};
use spf_render::effects::Effects;
use spf_scene::{Lighting, Weather};
use spf_sim::wind::Wind;
use spf_vlm::Hedge;
use spf_vlm::setup::KeyHost;
use spf_vlm::table::PerMillion;

use super::flag::Group;
use super::reading::{
    Count, DepthSense, Drone, DroneName, Explained, GimbalPitch, Joined, NetworkSize, Number, Parsed, Policy, Start, Step,
    Switch, Text, Word,
};
use super::setting::{Key, Row, Setting};
use super::structure::settings;

const SIMULATION: Group = Group("Simulation");
const DRONE: Group = Group("Drone");
const VLM: Group = Group("Model");
const METHOD: Group = Group("Method");
const OBSTACLES: Group = Group("Obstacles");
const FOLLOWING: Group = Group("Following");
const LIMITS: Group = Group("Limits");
const OUTPUT: Group = Group("Output");

/// Where the cockpit is served if nothing else is said.
pub(crate) const COCKPIT: &str = "127.0.0.1:8700";

settings! {
    /// A flight: `[fly]`.
    fly: Fly {
        /// the drone: {}
        drone: DroneName = "sim", Drone, "SPF_DRONE", DRONE.value("--drone", "DRONE").common();
        /// scene to fly in: a built-in name, scene file or .glb; city@17 is a variant
        scene: String = "city", Text, "SPF_SCENE", SIMULATION.value("--scene", "SCENE").common();
        /// light of the scene: {}; empty: the scene's
        light: Lighting = "", Word, "SPF_LIGHT", SIMULATION.value("--light", "LIGHT");
        /// weather of the scene, which has no effect on the oracle: {}; empty: the scene's
        weather: Weather = "", Word, "SPF_WEATHER", SIMULATION.value("--weather", "WEATHER");
        /// start pose, on the surface below it: east,north,up,heading_deg; empty: the scene's
        start: Pose = "", Start, "SPF_START", SIMULATION.value("--start", "POSE").dashed();
        /// craft to simulate: {}; empty: the scene's
        drone_model: CraftKind = "", Word, "SPF_DRONE_MODEL", SIMULATION.value("--drone-model", "MODEL");
        /// random seed; the same seed gives the same flight, byte for byte
        seed: u64 = "0", Count(0, u64::MAX), "SPF_SEED", SIMULATION.value("--seed", "N").common();
        /// wind: M_S[,from=DEG][,gust=M_S][,gust_time=S], from the north by default; empty: still air
        wind: Wind = "", Explained("a wind such as 3,from=270,gust=1"), "SPF_WIND", SIMULATION.value("--wind", "WIND").dashed();
        /// battery charge at the start, 0 to 1
        battery: f64 = "1", Number(0.0, 1.0), "SPF_BATTERY";
        /// depth sensor of the simulated craft, or of one of --drone airsim: on, off, or failing after 10 s: frozen, half (left half black) or scale (10 %
        /// too far)
        depth_sensor: DepthSense = "off", Word, "SPF_DEPTH_SENSOR", SIMULATION.value("--depth-sensor", "SENSOR").common();
        /// fly in real time instead of as fast as possible: {}
        realtime: bool = "false", Word, "SPF_REALTIME", SIMULATION.switch("--realtime", "true");
        /// VLM: NAME[#MODEL][@URL] (see `spf vlm list`), auto (the first with an API key set; with a real drone the default),
        /// exec:COMMAND (a program of your own), human (you, typing), replay:FILE, oracle, oracle:NAME (perfect, default, poor,
        /// size, linear, intended; see docs/explanation/oracle.md) or oracle:FILE
        vlm: String = "oracle", Text, "SPF_VLM", VLM.value("--vlm", "VLM").common();
        /// check the VLM's pointing before a real drone takes off: {}
        vlm_check: bool = "true", Word, "SPF_VLM_CHECK", VLM.switch("--no-vlm-check", "false");
        /// prompt for the VLM: a file (see docs/guide/vlm.md), or paper (the VLM's depth label states how far to fly); empty:
        /// built-in
        prompt: String = "", Text, "SPF_PROMPT", VLM.value("--prompt", "FILE");
        /// send an enlarged crop of a small target (its last box was under 24 pixels) as a second image: {}
        close_up: bool = "false", Word, "SPF_CLOSE_UP";
        /// how the VLM states distances, for ablation studies: {}
        depth_as: DepthAs = "labels", Word, "SPF_DEPTH_AS";
        /// distance from the target that counts as reached, metres, as told to the VLM; empty: the scene's; with a real drone, 0.8 for
        /// a Tello, else 3
        near_m: f64 = "", Number(0.1, 100.0), "SPF_NEAR_M";
        /// decision policy: {}
        policy: PolicyKind = "spf", Policy, "SPF_POLICY", METHOD.value("--policy", "POLICY");
        /// preset: default (recommended settings) or paper (constants and behaviour of the SPF paper)
        preset: Preset = "default", Word, "SPF_PRESET", METHOD.value("--preset", "PRESET").common();
        /// step length: adaptive (paper §3.2), adaptive:s=METRES,L=LABELS,p=EXPONENT,min=METRES with other constants, or
        /// fixed:METRES; empty: the preset's
        step: StepRule = "", Step, "SPF_STEP", METHOD.value("--step", "STEP");
        /// how motion primitives are flown: one at a time (sequential) or at once (blended); empty: the preset's
        motion: Motion = "", Word, "SPF_MOTION", METHOD.value("--motion", "MOTION");
        /// what the craft does while it waits for a reply: hold position (stop) or keep flying the last plan (continuous); empty: the
        /// preset's
        think: QueryTiming = "", Word, "SPF_THINK", METHOD.value("--think", "THINK");
        /// setpoints per second, Hz
        rate_hz: f64 = "10", Number(5.0, 100.0), "SPF_RATE_HZ";
        /// obstacle mode, in which the VLM lists obstacles and the craft keeps clear of them: on (also --avoid alone), off, or auto
        /// (on with the policy spf and the preset default; off with a depth sensor, a prompt file, the VLM human, and programs and models
        /// that list no boxes)
        avoid: Switch = "auto", Word, "SPF_AVOID", OBSTACLES.optional("--avoid", "SWITCH", "on");
        /// brake for obstacles that are measured or mapped, whatever the VLM says, and for the boxes of replies while somebody is
        /// followed: on, off, or auto (on with measured depth or --track)
        brake: Switch = "auto", Word, "SPF_BRAKE";
        /// detector of obstacles in the place of the VLM: nanodet (`spf model list`), a YOLO model FILE.onnx (see docs/guide/detector.md),
        /// or, in the simulator, oracle or oracle:NAME (simulates a detector of the COCO classes); empty: the VLM lists them
        detector: String = "", Text, "SPF_DETECTOR", OBSTACLES.value("--detector", "DETECTOR");
        /// network that estimates the depth of frames, for the obstacle map: fastdepth (`spf model list`), or FILE.onnx:KIND, where KIND is
        /// what its output is: disparity, relative, metric, or canonical[=FOCAL] (see docs/guide/obstacles.md), or, in the simulator,
        /// stand-in:ERROR or stand-in:ERROR:relative with a mean relative error such as 0.1; empty: none
        depth_model: String = "", Text, "SPF_DEPTH_MODEL", OBSTACLES.value("--depth-model", "MODEL");
        /// width and height of the depth network's input, pixels, such as 336x252; empty: its own if fixed, else 252x196
        depth_model_size: NetworkSize = "", Parsed("WIDTHxHEIGHT in pixels, each from 14 to 4096, such as 336x252"), "SPF_DEPTH_MODEL_SIZE";
        /// how often the depth network is asked at most, times per second
        depth_model_hz: f64 = "2", Number(0.1, 10.0), "SPF_DEPTH_MODEL_HZ";
        /// when a reply follows somebody, stay with them by a tracker in the camera's frames, and keep a distance: on, off, or auto (on
        /// with the policy spf where the craft flies on while it asks; off with --vlm human)
        track: Switch = "auto", Word, "SPF_TRACK", FOLLOWING.value("--track", "SWITCH").common();
        /// the distance to keep from somebody who is followed, metres
        keep_m: f64 = "2.5", Number(2.0, 10.0), "SPF_KEEP_M", FOLLOWING.value("--keep", "METRES");
        /// end the flight as reached after following for this many seconds, with the target in view; empty: no end
        follow_time_s: f64 = "", Number(1.0, 86_400.0), "SPF_FOLLOW_TIME_S", FOLLOWING.value("--follow-time", "SECONDS");
        /// when the instruction has ended: land; hover for up to 60 s and accept a new instruction; or rtl, return home by the drone's
        /// own navigation and land there; empty: hover with a real drone and a terminal, else land
        at_end: AtEnd = "", Word, "SPF_AT_END", LIMITS.value("--at-end", "ACTION");
        /// refuse instructions that ask for harm, to leave the limits or to spy, before take-off, by one question to the VLM, or by their
        /// words where no model is queried: on, off, or auto (on with a cockpit and for an assistant)
        refuse: Switch = "auto", Word, "SPF_REFUSE", LIMITS.value("--refuse", "SWITCH");
        /// fly a real drone without a terminal, and so without keyboard control; Ctrl-C and SIGTERM land it: {}
        unattended: bool = "false", Word, "SPF_UNATTENDED", LIMITS.switch("--unattended", "true");
        /// maximum flight time, seconds, not counting manual flight; empty: 300, with the preset paper 180
        max_time_s: f64 = "", Number(1.0, 86_400.0), "SPF_MAX_TIME_S", LIMITS.value("--max-time", "S").common();
        /// maximum number of answers in a row without progress: the drone comes nowhere new (1 m from everywhere before), no later
        /// stage begins, and nobody is followed; with the preset paper of all answers; empty: 30, with paper 60
        max_decisions: u32 = "", Count(1, 100_000), "SPF_MAX_DECISIONS", LIMITS.value("--max-decisions", "N");
        /// maximum number of queries to the VLM, second looks included; empty: 120, with the preset paper no limit
        max_queries: u32 = "", Count(1, 100_000), "SPF_MAX_QUERIES", LIMITS.value("--max-queries", "N");
        /// timeout of a VLM reply, seconds
        reply_timeout_s: f64 = "20", Number(0.1, 600.0), "SPF_REPLY_TIMEOUT_S";
        /// maximum age of a frame when its reply arrives, seconds; if the frame is older, the reply is ignored unless the craft has hovered in place since
        max_reply_age_s: f64 = "8", Number(0.1, 600.0), "SPF_MAX_REPLY_AGE_S";
        /// cost limit of the VLM's queries, US dollars; empty: no limit
        max_cost_usd: f64 = "", Number(0.0, 1e6), "SPF_MAX_COST_USD", LIMITS.value("--max-cost", "USD").common();
        /// geofence: GeoJSON file with polygons in local east/north metres; empty: none
        geofence: String = "", Text, "SPF_GEOFENCE", LIMITS.value("--geofence", "FILE").common();
        /// folder for the flight's files, new or empty; empty: flights/NNN-instruction
        out: String = "", Text, "SPF_OUT", OUTPUT.value("--out", "DIR").common();
        /// record video.mp4, which takes far longer than a simulated flight itself: {}
        video: bool = "true", Word, "SPF_VIDEO", OUTPUT.switch("--no-video", "false").common();
        /// address and port of the cockpit, a page to watch, point, stop and instruct (see docs/guide/cockpit.md), 127.0.0.1:8700 with
        /// --cockpit alone; flies in real time; empty: none
        cockpit: SocketAddr = "", Parsed("an address and a port, such as 127.0.0.1:8700"), "SPF_COCKPIT", OUTPUT.optional("--cockpit", "ADDR:PORT", COCKPIT).common();
        /// address and port of the live view, a WebSocket for Foxglove, 127.0.0.1:8765 with --live alone; flies in real time; empty: none
        live: SocketAddr = "", Parsed("an address and a port, such as 127.0.0.1:8765"), "SPF_LIVE", OUTPUT.optional("--live", "ADDR:PORT", "127.0.0.1:8765");
        /// origin of pages that may connect to the live view, besides Foxglove's: SCHEME://HOST[:PORT]; empty: none
        live_origin: String = "", Text, "SPF_LIVE_ORIGIN";
    }

    /// The simulated camera: `[camera]`.
    camera: Camera {
        /// camera effects: blur=MS, noise=LEVELS, exposure=STOPS, lens=NAME, compression=CODEC:QUALITY, joined by commas and each also
        /// without its strength; or all, or none
        effects: Effects = "none", Explained("a list of camera effects"), "SPF_CAMERA_EFFECTS", SIMULATION.value("--camera-effects", "EFFECTS");
    }

    /// Queries to models: `[vlm]`.
    vlm: Vlm {
        /// new file to record the VLM's replies to; `--vlm replay:FILE` repeats the flight; empty: none
        record: String = "", Text, "SPF_VLM_RECORD", VLM.value("--vlm-record", "FILE");
        /// fallback VLM, used when the first one fails; empty: none
        fallback: String = "", Text, "SPF_VLM_FALLBACK";
        /// seconds without a reply after which a second request is sent, or auto: beyond what the replies usually take; empty: never
        hedge_s: Hedge = "", Parsed("seconds, 0 to 600, or auto"), "SPF_VLM_HEDGE_S";
        /// latency of every reply in virtual time, seconds, however long it really took; empty: 1.5 for human and exec:; the measured
        /// latency for models; a random sample for the oracle
        latency_s: f64 = "", Number(0.0, 600.0), "SPF_VLM_LATENCY_S", VLM.value("--vlm-latency", "S");
        /// price in US dollars per million tokens, input and output, for --max-cost; empty: the price shown by `spf vlm list`
        price: PerMillion = "", Parsed("two prices in US dollars per million tokens, IN,OUT, such as 0.3,2.5"), "SPF_VLM_PRICE", VLM.value("--vlm-price", "IN,OUT");
        /// TOML file with additional model definitions (see docs/guide/vlm.md); empty: none
        models: String = "", Text, "SPF_VLM_MODELS", VLM.value("--vlm-models", "FILE");
        /// servers that may receive an API key in addition to the key's own vendor: HOST or HOST:PORT, joined by commas; empty: none
        send_key_to: Vec<KeyHost> = "", Joined("HOST or HOST:PORT, joined by commas"), "SPF_SEND_KEY_TO", VLM.value("--send-key-to", "HOST");
        /// longest side of images sent to the VLM, pixels; empty: the model's own, else 768
        image_long_side: u32 = "", Count(64, 8192), "SPF_VLM_IMAGE_LONG_SIDE";
        /// JPEG quality of images sent to the VLM, 1 to 100; empty: the model's own, else 70
        jpeg_quality: u8 = "", Count(1, 100), "SPF_VLM_JPEG_QUALITY";
        /// longest time that an exec: program may take to answer before it is restarted, in seconds of real time even if the flight runs in virtual time
        exec_timeout_s: f64 = "600", Number(1.0, 86400.0), "SPF_VLM_EXEC_TIMEOUT_S";
    }

    /// A Tello: `[tello]`.
    tello: Tello {
        /// Tello control mode: rc (velocity commands; if the link is lost, the last one stays in force) or go (position moves that the
        /// Tello ends by itself; replaces --motion, and sets --think stop; see docs/guide/tello.md)
        motion: TelloMotion = "rc", Word, "SPF_TELLO_MOTION", DRONE.value("--tello-motion", "MODE");
        /// local address to bind for the Tello; empty: any
        local: IpAddr = "", Parsed("an address of this machine, such as 192.168.10.2"), "SPF_TELLO_LOCAL";
        /// local UDP port for the Tello's state
        state_port: u16 = "8890", Parsed("a port, 1 to 65535"), "SPF_TELLO_STATE_PORT";
        /// local UDP port for the Tello's video
        video_port: u16 = "11111", Parsed("a port, 1 to 65535"), "SPF_TELLO_VIDEO_PORT";
        /// latency of the Tello's video, shutter to arrival, seconds
        video_latency_s: f64 = "0.15", Number(0.0, 2.0), "SPF_TELLO_VIDEO_LATENCY_S";
        /// horizontal speed of `rc 0 100 0 0`, m/s
        speed_m_s: f64 = "1.0", Number(0.1, 10.0), "SPF_TELLO_SPEED_M_S";
        /// climb rate of `rc 0 0 100 0`, m/s
        climb_m_s: f64 = "1.0", Number(0.1, 10.0), "SPF_TELLO_CLIMB_M_S";
        /// descent rate of `rc 0 0 -100 0`, m/s
        sink_m_s: f64 = "0.8", Number(0.1, 10.0), "SPF_TELLO_SINK_M_S";
        /// yaw rate of `rc 0 0 0 100`, degrees per second
        yaw_deg_s: f64 = "95", Number(10.0, 360.0), "SPF_TELLO_YAW_DEG_S";
    }

    /// A PX4 or ArduPilot: `[mavlink]`.
    mavlink: Mavlink {
        /// replace the autopilot's fence by the geofence (one polygon), or by a circle of the maximum distance: {}
        upload_fence: bool = "false", Word, "SPF_MAVLINK_UPLOAD_FENCE";
        /// pitch of the camera's gimbal at the start, degrees, negative downwards; off: the camera is not on the gimbal; empty: left as it is
        gimbal: GimbalPitch = "", Parsed("a pitch in degrees, such as -15, or off"), "SPF_MAVLINK_GIMBAL";
    }

    /// A simulator that speaks AirSim's protocol: `[airsim]`.
    airsim: AirSim {
        /// name of the camera that looks ahead, of AirSim's or of its settings.json
        camera: String = "0", Text, "SPF_AIRSIM_CAMERA";
        /// with --drone airsim, give the pilot the simulator's exact pose and velocity instead of those of satellite navigation and a
        /// compass with their errors, which the log records: {}
        true_pose: bool = "false", Word, "SPF_AIRSIM_TRUE_POSE", DRONE.switch("--true-pose", "true");
        /// with --drone airsim, fly in the simulator's time, which stands still while the pilot thinks: {}
        lockstep: bool = "false", Word, "SPF_AIRSIM_LOCKSTEP", DRONE.switch("--lockstep", "true");
    }

    /// Limits of the safety envelope: `[envelope]`.
    envelope: Envelope {
        /// horizontal speed limit, m/s; empty: the limit of the drone's driver if it has one, else 1.5 times the craft's preset speed
        max_speed_m_s: f64 = "", Number(0.1, 30.0), "SPF_MAX_SPEED_M_S", LIMITS.value("--max-speed", "M_S");
        /// climb and descent rate limit, m/s; empty: 1.5 times the craft's preset rate
        max_climb_m_s: f64 = "", Number(0.1, 10.0), "SPF_MAX_CLIMB_M_S";
        /// yaw rate limit, degrees per second; empty: 1.5 times the craft's preset rate
        max_yaw_rate_deg_s: f64 = "", Number(1.0, 360.0), "SPF_MAX_YAW_RATE_DEG_S";
        /// minimum height above take-off, metres; empty: 0.3
        min_altitude_m: f64 = "", Number(0.0, 100.0), "SPF_MIN_ALTITUDE_M";
        /// maximum height above take-off, metres; empty: the limit of the scene or of the drone's driver if there is one, else 120
        max_altitude_m: f64 = "", Number(1.0, 1000.0), "SPF_MAX_ALTITUDE_M", LIMITS.value("--max-altitude", "M");
        /// maximum distance from take-off, metres; empty: the limit of the drone's driver if it has one, else 300
        max_distance_m: f64 = "", Number(1.0, 10_000.0), "SPF_MAX_DISTANCE_M", LIMITS.value("--max-distance", "M");
        /// battery charge, 0 to 1, below which the flight ends; empty: 0.15
        low_battery: f64 = "", Number(0.0, 1.0), "SPF_LOW_BATTERY";
        /// consecutive failed replies before landing; empty: 5
        max_failed_replies: u32 = "", Count(1, 1000), "SPF_MAX_FAILED_REPLIES";
    }
}
