//! Settings from command line flags, the topmost layer.
//!
//! A flag's name is declared with its key (`keys`); here both are connected by field names. The arguments of `spf fly`
//! are destructured in full, so that the compiler reports new ones.

use std::path::Path;

use super::Settings;
use crate::args::{self, ConditionArgs, FlightArgs, LimitArgs, MethodArgs, OutputArgs, WorldArgs};

/// Arguments of a command that reads the configuration.
pub(crate) trait Flags {
    /// The configuration file given.
    fn file(&self) -> Option<&Path>;

    /// Applies the flags.
    fn apply(&self, settings: &mut Settings);
}

impl Flags for FlightArgs {
    fn file(&self) -> Option<&Path> {
        self.output.config.as_deref()
    }

    fn apply(&self, settings: &mut Settings) {
        // A camera's address may contain a password, which `spf config show` would print.
        let Self { world, method, camera: _, limits, output } = self;
        world.apply(settings);
        method.apply(settings);
        limits.apply(settings);
        output.apply(settings);
    }
}

impl WorldArgs {
    fn apply(&self, Settings { fly, camera, tello, mavlink, .. }: &mut Settings) {
        let Self {
            scene,
            conditions: ConditionArgs { light, weather },
            start,
            drone,
            tello_motion,
            upload_fence,
            gimbal,
            drone_model,
            seed,
            wind,
            depth_sensor,
            battery,
            camera_effects,
            events: _,
            realtime,
        } = self;
        fly.scene.flag(scene.as_deref());
        fly.light.flag(light.as_deref());
        fly.weather.flag(weather.as_deref());
        fly.start.flag(start.as_deref());
        fly.drone.flag(drone.as_deref());
        tello.motion.flag(tello_motion.as_deref());
        mavlink.upload_fence.switch(*upload_fence);
        mavlink.gimbal.flag(gimbal.as_deref());
        fly.drone_model.flag(drone_model.as_deref());
        fly.seed.flag(seed.as_deref());
        fly.wind.flag(wind.as_deref());
        fly.depth_sensor.flag(depth_sensor.as_deref());
        fly.battery.flag(battery.as_deref());
        camera.effects.flag(camera_effects.as_deref());
        fly.realtime.switch(*realtime);
    }
}

impl MethodArgs {
    fn apply(&self, Settings { fly, vlm: models, .. }: &mut Settings) {
        let Self {
            vlm,
            prompt,
            vlm_record,
            vlm_fallback,
            vlm_hedge,
            vlm_latency,
            vlm_price,
            vlm_models,
            send_key_to,
            no_vlm_check,
            policy,
            preset,
            step,
            depth_as,
            close_up,
            near,
            motion,
            think,
            rate,
            avoid,
            anchor,
            map,
            brake,
            track,
            keep,
            follow_time,
            detector,
            depth_model,
            depth_model_size,
            depth_model_hz,
        } = self;
        fly.vlm.flag(vlm.as_deref());
        fly.prompt.flag(prompt.as_deref());
        models.record.flag(vlm_record.as_deref());
        models.fallback.flag(vlm_fallback.as_deref());
        models.hedge_s.flag(vlm_hedge.as_deref());
        models.latency_s.flag(vlm_latency.as_deref());
        models.price.flag(vlm_price.as_deref());
        models.models.flag(vlm_models.as_deref());
        models.send_key_to.flag(send_key_to.as_deref());
        fly.vlm_check.switch(*no_vlm_check);
        fly.policy.flag(policy.as_deref());
        fly.preset.flag(preset.as_deref());
        fly.step.flag(step.as_deref());
        fly.depth_as.flag(depth_as.as_deref());
        fly.close_up.switch(*close_up);
        fly.near_m.flag(near.as_deref());
        fly.motion.flag(motion.as_deref());
        fly.think.flag(think.as_deref());
        fly.rate_hz.flag(rate.as_deref());
        fly.avoid.flag(avoid.as_deref());
        fly.anchor.flag(anchor.as_deref());
        fly.map.flag(map.as_deref());
        fly.brake.flag(brake.as_deref());
        fly.track.flag(track.as_deref());
        fly.keep_m.flag(keep.as_deref());
        fly.follow_time_s.flag(follow_time.as_deref());
        fly.detector.flag(detector.as_deref());
        fly.depth_model.flag(depth_model.as_deref());
        fly.depth_model_size.flag(depth_model_size.as_deref());
        fly.depth_model_hz.flag(depth_model_hz.as_deref());
    }
}

impl LimitArgs {
    fn apply(&self, Settings { fly, envelope, .. }: &mut Settings) {
        let Self {
            at_end,
            unattended,
            max_time,
            max_decisions,
            max_reply_age,
            max_cost,
            geofence,
            max_altitude,
            max_distance,
            max_speed,
        } = self;
        fly.at_end.flag(at_end.as_deref());
        fly.unattended.switch(*unattended);
        fly.max_time_s.flag(max_time.as_deref());
        fly.max_decisions.flag(max_decisions.as_deref());
        fly.max_reply_age_s.flag(max_reply_age.as_deref());
        fly.max_cost_usd.flag(max_cost.as_deref());
        fly.geofence.flag(geofence.as_deref());
        envelope.max_altitude_m.flag(max_altitude.as_deref());
        envelope.max_distance_m.flag(max_distance.as_deref());
        envelope.max_speed_m_s.flag(max_speed.as_deref());
    }
}

impl OutputArgs {
    fn apply(&self, Settings { fly, .. }: &mut Settings) {
        let Self { out, no_video, live, live_origin, cockpit, json: _, config: _ } = self;
        fly.out.flag(out.as_deref());
        fly.video.switch(*no_video);
        fly.live.flag(live.as_deref());
        fly.live_origin.flag(live_origin.as_deref());
        fly.cockpit.flag(cockpit.as_deref());
    }
}

impl Flags for args::Doctor {
    fn file(&self) -> Option<&Path> {
        self.config.as_deref()
    }

    fn apply(&self, Settings { fly, vlm, .. }: &mut Settings) {
        fly.drone.flag(self.drone.as_deref());
        fly.vlm.flag(self.vlm.as_deref());
        vlm.send_key_to.flag(self.send_key_to.as_deref());
        fly.scene.flag(self.scene.as_deref());
        fly.detector.flag(self.detector.as_deref());
        fly.depth_model.flag(self.depth_model.as_deref());
        fly.depth_model_size.flag(self.depth_model_size.as_deref());
    }
}

impl Flags for args::TelloAddress {
    fn file(&self) -> Option<&Path> {
        self.config.as_deref()
    }

    fn apply(&self, Settings { fly, .. }: &mut Settings) {
        fly.drone.flag(self.drone.as_deref());
    }
}

impl Flags for args::Calibrate {
    fn file(&self) -> Option<&Path> {
        self.config.as_deref()
    }

    fn apply(&self, Settings { fly, .. }: &mut Settings) {
        fly.drone.flag(self.drone.as_deref());
    }
}

impl Flags for args::Ground {
    fn file(&self) -> Option<&Path> {
        self.config.as_deref()
    }

    fn apply(&self, Settings { fly, vlm, .. }: &mut Settings) {
        fly.vlm.flag(self.vlm.as_deref());
        vlm.models.flag(self.vlm_models.as_deref());
        vlm.send_key_to.flag(self.send_key_to.as_deref());
        fly.max_cost_usd.flag(self.max_cost.as_deref());
    }
}

impl Flags for args::Replay {
    fn file(&self) -> Option<&Path> {
        self.config.as_deref()
    }

    fn apply(&self, Settings { fly, vlm, .. }: &mut Settings) {
        fly.vlm.flag(self.vlm.as_deref());
        vlm.models.flag(self.vlm_models.as_deref());
        vlm.send_key_to.flag(self.send_key_to.as_deref());
    }
}

impl Flags for args::VlmList {
    fn file(&self) -> Option<&Path> {
        self.config.as_deref()
    }

    fn apply(&self, Settings { vlm, .. }: &mut Settings) {
        vlm.models.flag(self.vlm_models.as_deref());
    }
}

impl Flags for args::VlmTrial {
    fn file(&self) -> Option<&Path> {
        self.config.as_deref()
    }

    fn apply(&self, Settings { fly, vlm, .. }: &mut Settings) {
        vlm.models.flag(self.vlm_models.as_deref());
        vlm.price.flag(self.vlm_price.as_deref());
        vlm.latency_s.flag(self.vlm_latency.as_deref());
        vlm.send_key_to.flag(self.send_key_to.as_deref());
        fly.max_cost_usd.flag(self.max_cost.as_deref());
        fly.vlm.argument("NAME", &self.names);
    }
}

impl Flags for args::VlmCheck {
    fn file(&self) -> Option<&Path> {
        self.config.as_deref()
    }

    fn apply(&self, Settings { fly, vlm, .. }: &mut Settings) {
        vlm.models.flag(self.vlm_models.as_deref());
        vlm.send_key_to.flag(self.send_key_to.as_deref());
        fly.vlm.argument("NAME", &self.name);
    }
}
