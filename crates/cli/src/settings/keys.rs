//! Declaration of every key: name, type, default, parser, variable, flag and description.
#![allow(rustdoc::broken_intra_doc_links, reason = "`NAME[#MODEL][@URL]` is no link")]

use std::net::{IpAddr, SocketAddr};

use spf_core::craft::CraftKind;
use spf_core::geometry::Pose;
use spf_core::query::DepthAs;
use spf_core::step::StepRule;
use spf_drone::tello::TelloMotion;
use spf_flight::policy::PolicyKind;
use spf_flight::tracking::TrackBy;
use spf_motion::executor::Motion;
use spf_pilot::{AtEnd, Preset, QueryTiming};
use spf_render::effects::Effects;
use spf_scene::{Lighting, Weather};
use spf_sim::wind::Wind;
use spf_vlm::Hedge;
use spf_vlm::setup::KeyHost;
use spf_vlm::table::PerMillion;

use super::reading::{Count, DepthSense, Drone, DroneName, Explained, Joined, Number, Parsed, Start, Step, Switch, Text, Word};
use super::reading::{GimbalPitch, NetworkSize};
use super::setting::{Flag, Key, Row, Setting};
use super::structure::settings;

settings! {
    /// A flight: `[fly]`.
    fly: Fly {
        /// scene: a built-in name, scene file or .glb
        scene: String = "city", Text, "SPF_SCENE", "--scene";
        /// day, overcast, dusk or night; empty: the scene's
        light: Lighting = "", Word, "SPF_LIGHT", "--light";
        /// clear, haze or rain; empty: the scene's
        weather: Weather = "", Word, "SPF_WEATHER", "--weather";
        /// start pose east,north,up,heading_deg[,pitch_deg]; empty: the scene's
        start: Pose = "", Start, "SPF_START", "--start";
        /// the drone: sim, or the name of a real one (spf fly --help lists the forms)
        drone: DroneName = "sim", Drone, "SPF_DRONE", "--drone";
        /// craft to simulate, quad or tello; empty: the scene's
        drone_model: CraftKind = "", Word, "SPF_DRONE_MODEL", "--drone-model";
        /// decision policy: spf, plain[-numeric|-discrete], pivot[-parallel], typefly[-coco|-once]
        policy: PolicyKind = "spf", Word, "SPF_POLICY", "--policy";
        /// preset: default or paper
        preset: Preset = "default", Word, "SPF_PRESET", "--preset";
        /// step length: adaptive[:s=METRES,L=LABELS,p=EXPONENT,min=METRES] or fixed:METRES; empty: the preset's
        step: StepRule = "", Step, "SPF_STEP", "--step";
        /// how the VLM states distances: labels or metres
        depth_as: DepthAs = "labels", Word, "SPF_DEPTH_AS", "--depth-as";
        /// send an enlarged crop of a small target as a second image: true or false
        close_up: bool = "false", Word, "SPF_CLOSE_UP", "--close-up" sets "true";
        /// distance from the target that counts as reached, metres, as told to the VLM; empty: the scene's; with a real drone, 0.8 for a Tello, else 3
        near_m: f64 = "", Number(0.1, 100.0), "SPF_NEAR_M", "--near";
        /// whether yaw, forward motion and climb are flown one after another (sequential) or at once (blended); empty: the preset's
        motion: Motion = "", Word, "SPF_MOTION", "--motion";
        /// whether the craft holds while it waits for a reply (stop) or flies on (continuous); empty: the preset's
        think: QueryTiming = "", Word, "SPF_THINK", "--think";
        /// setpoint rate, 5 to 100 Hz
        rate_hz: f64 = "10", Number(5.0, 100.0), "SPF_RATE_HZ", "--rate";
        /// obstacle mode: on, off, or auto (on with the policy spf and the preset default; off with a depth sensor, a prompt file, and the VLMs human and exec:)
        avoid: Switch = "auto", Word, "SPF_AVOID", "--avoid";
        /// keep an estimate of the target's position between replies: on, off, or auto (on with a depth sensor, and in obstacle mode)
        anchor: Switch = "auto", Word, "SPF_ANCHOR", "--anchor";
        /// keep a map of obstacles from measured depth, and plan around them: on, off, or auto (on with a depth sensor, a depth network, or range sensors of the craft)
        map: Switch = "auto", Word, "SPF_MAP", "--map";
        /// brake for known obstacles: on, off, or auto (on with a depth sensor, a depth network or a tracker)
        brake: Switch = "auto", Word, "SPF_BRAKE", "--brake";
        /// what keeps the target's box between replies: pixels (a tracker in the camera's frames) or off
        track: TrackBy = "off", Word, "SPF_TRACK", "--track";
        /// distance to keep from somebody who is followed with a tracker, 2 to 10 m
        keep_m: f64 = "2.5", Number(2.0, 10.0), "SPF_KEEP_M", "--keep";
        /// with a tracker, end the flight as reached after following for this many seconds, with the target in view; empty: no end
        follow_time_s: f64 = "", Number(1.0, 86_400.0), "SPF_FOLLOW_TIME_S", "--follow-time";
        /// give the simulated craft a depth sensor: on, off, or a fault that begins 10 s into the flight (frozen, half or scale)
        depth_sensor: DepthSense = "off", Word, "SPF_DEPTH_SENSOR", "--depth-sensor";
        /// detector of obstacle mode: FILE.onnx, oracle[:NAME]; empty: the VLM provides the boxes
        detector: String = "", Text, "SPF_DETECTOR", "--detector";
        /// network that estimates the depth of frames for the map: FILE.onnx:KIND, KIND being disparity, relative, metric or canonical[=FOCAL]; empty: none
        depth_model: String = "", Text, "SPF_DEPTH_MODEL", "--depth-model";
        /// width and height of the depth network's input, pixels, such as 336x252; empty: its own if fixed, else 252x196
        depth_model_size: NetworkSize = "", Parsed("WIDTHxHEIGHT in pixels, each from 14 to 4096, such as 336x252"), "SPF_DEPTH_MODEL_SIZE", "--depth-model-size";
        /// how often the depth network is asked at most, times per second
        depth_model_hz: f64 = "2", Number(0.1, 10.0), "SPF_DEPTH_MODEL_HZ", "--depth-model-hz";
        /// VLM: NAME[#MODEL][@URL], auto, replay:FILE, human, oracle, oracle:NAME or oracle:FILE (exec:COMMAND only as a flag); with a real drone the default is auto
        vlm: String = "oracle", Text, "SPF_VLM", "--vlm";
        /// with a real drone, check the VLM's pointing before take-off: true or false
        vlm_check: bool = "true", Word, "SPF_VLM_CHECK", "--no-vlm-check" sets "false";
        /// random seed, a whole number
        seed: u64 = "0", Count(0, u64::MAX), "SPF_SEED", "--seed";
        /// wind as M_S[,from=DEG][,gust=M_S][,gust_time=S], from the north by default; empty: still air
        wind: Wind = "", Explained("a wind such as 3,from=270,gust=1"), "SPF_WIND", "--wind";
        /// battery charge at the start, 0 to 1
        battery: f64 = "1", Number(0.0, 1.0), "SPF_BATTERY", "--battery";
        /// when the instruction has ended, land, hover, or rtl (return by itself and land); empty: hover with a real drone and a terminal, else land
        at_end: AtEnd = "", Word, "SPF_AT_END", "--at-end";
        /// fly a real drone without a terminal: true or false
        unattended: bool = "false", Word, "SPF_UNATTENDED", "--unattended" sets "true";
        /// maximum flight time, seconds, not counting manual flight
        max_time_s: f64 = "180", Number(1.0, 86_400.0), "SPF_MAX_TIME_S", "--max-time";
        /// maximum number of decisions
        max_decisions: u32 = "60", Count(1, 100_000), "SPF_MAX_DECISIONS", "--max-decisions";
        /// timeout of a VLM reply, seconds
        reply_timeout_s: f64 = "20", Number(0.1, 600.0), "SPF_REPLY_TIMEOUT_S";
        /// maximum age of a frame when its reply arrives, seconds; if the frame is older, the reply is ignored unless the craft has hovered in place since
        max_reply_age_s: f64 = "8", Number(0.1, 600.0), "SPF_MAX_REPLY_AGE_S", "--max-reply-age";
        /// VLM cost limit of the flight, US dollars; empty: no limit
        max_cost_usd: f64 = "", Number(0.0, 1e6), "SPF_MAX_COST_USD", "--max-cost";
        /// prompt file (docs/guide/vlm.md), or paper (the VLM's depth label then states how far to fly); empty: built-in
        prompt: String = "", Text, "SPF_PROMPT", "--prompt";
        /// geofence: GeoJSON file with polygons in local east/north metres; empty: none
        geofence: String = "", Text, "SPF_GEOFENCE", "--geofence";
        /// fly in real time: true or false
        realtime: bool = "false", Word, "SPF_REALTIME", "--realtime" sets "true";
        /// record video.mp4: true or false
        video: bool = "true", Word, "SPF_VIDEO", "--no-video" sets "false";
        /// address and port of the Foxglove live view, such as 127.0.0.1:8765; empty: none
        live: SocketAddr = "", Parsed("an address and a port, such as 127.0.0.1:8765"), "SPF_LIVE", "--live";
        /// origin of pages that may connect to the live view, besides Foxglove's: SCHEME://HOST[:PORT]; empty: none
        live_origin: String = "", Text, "SPF_LIVE_ORIGIN", "--live-origin";
        /// address and port of the cockpit's page, such as 127.0.0.1:8700; empty: none
        cockpit: SocketAddr = "", Parsed("an address and a port, such as 127.0.0.1:8700"), "SPF_COCKPIT", "--cockpit";
        /// folder for the flight's files; empty: flights/NNN-instruction
        out: String = "", Text, "SPF_OUT", "--out";
    }

    /// The simulated camera: `[camera]`.
    camera: Camera {
        /// blur=MS, noise=LEVELS, exposure=STOPS, lens=NAME, compression=CODEC:QUALITY, joined by commas; or all, or none
        effects: Effects = "none", Explained("a list of camera effects"), "SPF_CAMERA_EFFECTS", "--camera-effects";
    }

    /// Queries to models: `[vlm]`.
    vlm: Vlm {
        /// new file to record the VLM's replies to; empty: none
        record: String = "", Text, "SPF_VLM_RECORD", "--vlm-record";
        /// fallback VLM, used when the first one fails; empty: none
        fallback: String = "", Text, "SPF_VLM_FALLBACK", "--vlm-fallback";
        /// seconds without a reply after which a second request is sent, or auto: beyond what the replies usually take; empty: never
        hedge_s: Hedge = "", Parsed("seconds, 0 to 600, or auto"), "SPF_VLM_HEDGE_S", "--vlm-hedge";
        /// reply latency in virtual time, seconds; empty: 1.5 for human and for an exec: program; the measured latency for models; a random sample for the oracle
        latency_s: f64 = "", Number(0.0, 600.0), "SPF_VLM_LATENCY_S", "--vlm-latency";
        /// price of the VLM as IN,OUT, US dollars per million input and output tokens, for --max-cost; empty: the price shown by `spf vlm list`
        price: PerMillion = "", Parsed("two prices in US dollars per million tokens, IN,OUT, such as 0.3,2.5"), "SPF_VLM_PRICE", "--vlm-price";
        /// TOML file with additional model definitions; empty: none
        models: String = "", Text, "SPF_VLM_MODELS", "--vlm-models";
        /// servers that may receive an API key in addition to the key's own vendor: HOST or HOST:PORT, joined by commas; empty: none
        send_key_to: Vec<KeyHost> = "", Joined("HOST or HOST:PORT, joined by commas"), "SPF_SEND_KEY_TO", "--send-key-to";
        /// longest side of images sent to the VLM, pixels; empty: the model's own, else 768
        image_long_side: u32 = "", Count(64, 8192), "SPF_VLM_IMAGE_LONG_SIDE";
        /// JPEG quality of images sent to the VLM, 1 to 100; empty: the model's own, else 70
        jpeg_quality: u8 = "", Count(1, 100), "SPF_VLM_JPEG_QUALITY";
        /// longest time that an exec: program may take to answer before it is restarted, in seconds of real time even if the flight runs in virtual time
        exec_timeout_s: f64 = "600", Number(1.0, 86400.0), "SPF_VLM_EXEC_TIMEOUT_S";
    }

    /// A Tello: `[tello]`.
    tello: Tello {
        /// Tello control mode: rc (velocity commands) or go (self-terminating moves; docs/guide/tello.md)
        motion: TelloMotion = "rc", Word, "SPF_TELLO_MOTION", "--tello-motion";
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
        /// replace the autopilot's fence by the geofence, or by a circle of the maximum distance: true or false
        upload_fence: bool = "false", Word, "SPF_MAVLINK_UPLOAD_FENCE", "--upload-fence" sets "true";
        /// pitch of the camera's gimbal at the start, degrees, negative downwards; off: the camera is not on the gimbal; empty: left as it is
        gimbal: GimbalPitch = "", Parsed("a pitch in degrees, such as -15, or off"), "SPF_MAVLINK_GIMBAL", "--gimbal";
    }

    /// Limits of the safety envelope: `[envelope]`.
    envelope: Envelope {
        /// horizontal speed limit, m/s; empty: the limit of the drone's driver if it has one, else 1.5 times the craft's preset speed
        max_speed_m_s: f64 = "", Number(0.1, 30.0), "SPF_MAX_SPEED_M_S", "--max-speed";
        /// climb and descent rate limit, m/s; empty: 1.5 times the craft's preset rate
        max_climb_m_s: f64 = "", Number(0.1, 10.0), "SPF_MAX_CLIMB_M_S";
        /// yaw rate limit, degrees per second; empty: 1.5 times the craft's preset rate
        max_yaw_rate_deg_s: f64 = "", Number(1.0, 360.0), "SPF_MAX_YAW_RATE_DEG_S";
        /// minimum height above take-off, metres; empty: 0.3
        min_altitude_m: f64 = "", Number(0.0, 100.0), "SPF_MIN_ALTITUDE_M";
        /// maximum height above take-off, metres; empty: the limit of the scene or of the drone's driver if there is one, else 120
        max_altitude_m: f64 = "", Number(1.0, 1000.0), "SPF_MAX_ALTITUDE_M", "--max-altitude";
        /// maximum distance from take-off, metres; empty: the limit of the drone's driver if it has one, else 300
        max_distance_m: f64 = "", Number(1.0, 10_000.0), "SPF_MAX_DISTANCE_M", "--max-distance";
        /// battery charge, 0 to 1, below which the flight ends; empty: 0.15
        low_battery: f64 = "", Number(0.0, 1.0), "SPF_LOW_BATTERY";
        /// consecutive failed replies before landing; empty: 5
        max_failed_replies: u32 = "", Count(1, 1000), "SPF_MAX_FAILED_REPLIES";
    }
}
