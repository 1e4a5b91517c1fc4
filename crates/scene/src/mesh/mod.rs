//! Procedural meshes: one generator per kind of object, with a few parameters.
//!
//! A generator is plain data from a scene file. It declares its material slots with default materials, and builds its
//! mesh in its own frame (x right, y forward, z up, metres). The table [`KINDS`] lists all of them.

mod balloon;
mod bridge;
mod building;
mod car;
mod course;
mod crane;
mod flat;
mod furniture;
mod garden;
mod gate;
mod ground;
mod heavy;
mod house;
mod landscape;
mod lookout;
mod monorail;
mod office;
mod person;
mod plane;
mod plant;
mod polygon;
mod railway;
mod room;
mod round;
mod seat;
mod sign;
mod sketch;
mod skin;
mod tower;
mod tree;
mod tunnel;
mod way;
mod yard;

use core::fmt::Debug;

use glam::Vec2;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Deserializer};

pub(crate) use polygon::convex_hull;
pub(crate) use sign::Writing;
pub(crate) use sketch::{Bulb, Sketch, Surface};

/// Material slots of a generator with their default materials.
pub(crate) type Slots = &'static [(&'static str, &'static str)];

/// A kind of object, with its dimensions.
pub(crate) trait Generator: Debug {
    /// The slots that [`Generator::draw`] uses.
    fn slots(&self) -> Slots;
    /// Builds the mesh. `seed` identifies the instance for randomly generated ones (trees).
    fn draw(&self, sketch: &mut Sketch, seed: &str);
    /// Builds the mesh of a walking person at `phase` of its gait, whose cycle runs from 0 to 1 and takes 0.86 of the
    /// height in metres; false for everything else.
    fn draw_walking(&self, _sketch: &mut Sketch, _phase: f32) -> bool {
        false
    }
    /// Whether it is an opening: a tagged surface that neither hides nor collides with anything.
    fn is_opening(&self) -> bool {
        false
    }
    /// What can be read on its front.
    fn writing(&self) -> Option<Writing> {
        None
    }
}

/// A length in metres, 0.01..=2000; checked on reading, so that no generator loops without bound.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Metres(pub(crate) f32);

impl<'de> Deserialize<'de> for Metres {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let value = f64::deserialize(deserializer)?;
        if (0.01..=2000.0).contains(&value) {
            Ok(Self(value as f32))
        } else {
            Err(serde::de::Error::custom(format!("a length must be from 0.01 to 2000 metres, not `{value}`")))
        }
    }
}

/// A coordinate in metres within ±2000.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Offset(pub(crate) f32);

impl<'de> Deserialize<'de> for Offset {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let value = f64::deserialize(deserializer)?;
        if value.abs() <= 2000.0 {
            Ok(Self(value as f32))
        } else {
            Err(serde::de::Error::custom(format!("a coordinate must be from -2000 to 2000 metres, not `{value}`")))
        }
    }
}

/// A count, 1..=100.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Count(pub(crate) u32);

impl<'de> Deserialize<'de> for Count {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let value = u32::deserialize(deserializer)?;
        if (1..=100).contains(&value) {
            Ok(Self(value))
        } else {
            Err(serde::de::Error::custom(format!("a count must be from 1 to 100, not `{value}`")))
        }
    }
}

/// An angle in degrees, 0..=170.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Degrees(pub(crate) f32);

impl<'de> Deserialize<'de> for Degrees {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let value = f64::deserialize(deserializer)?;
        if (0.0..=170.0).contains(&value) {
            Ok(Self(value as f32))
        } else {
            Err(serde::de::Error::custom(format!("an angle must be from 0 to 170 degrees, not `{value}`")))
        }
    }
}

/// A fraction, 0..=1.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Fraction(pub(crate) f32);

impl<'de> Deserialize<'de> for Fraction {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let value = f64::deserialize(deserializer)?;
        if (0.0..=1.0).contains(&value) {
            Ok(Self(value as f32))
        } else {
            Err(serde::de::Error::custom(format!("a fraction must be from 0 to 1, not `{value}`")))
        }
    }
}

/// Width and length, or width, depth and height.
pub(crate) type Size<const N: usize> = [Metres; N];

fn plan(size: Size<2>) -> Vec2 {
    Vec2::new(size[0].0, size[1].0)
}

/// Number of equal parts of about `part` metres that fill `length`: 1..=200.
fn parts(length: f32, part: f32) -> u32 {
    (length / part).round().clamp(1.0, 200.0) as u32
}

type Reader = fn(toml::Table) -> Result<Box<dyn Generator>, toml::de::Error>;

fn read<T: Generator + DeserializeOwned + 'static>(table: toml::Table) -> Result<Box<dyn Generator>, toml::de::Error> {
    table.try_into::<T>().map(|generator| Box::new(generator) as Box<dyn Generator>)
}

/// Every kind of mesh, in alphabetical order.
pub(crate) const KINDS: &[(&str, Reader)] = &[
    ("balloon", read::<balloon::Balloon>),
    ("balloon_arch", read::<balloon::BalloonArch>),
    ("barrel", read::<yard::Barrel>),
    ("bench", read::<furniture::Bench>),
    ("bicycle", read::<yard::Bicycle>),
    ("bin", read::<yard::Bin>),
    ("boat", read::<heavy::Boat>),
    ("bottle", read::<office::Bottle>),
    ("bridge", read::<bridge::Bridge>),
    ("building", read::<building::Building>),
    ("bus", read::<heavy::Bus>),
    ("bus_shelter", read::<furniture::BusShelter>),
    ("bush", read::<plant::Bush>),
    ("canopy", read::<yard::Canopy>),
    ("car", read::<car::Car>),
    ("car_park", read::<ground::CarPark>),
    ("carriage", read::<railway::Carriage>),
    ("carton", read::<office::Carton>),
    ("ceiling_lamp", read::<office::CeilingLamp>),
    ("chair", read::<seat::Chair>),
    ("chimney", read::<tower::Chimney>),
    ("church", read::<house::Church>),
    ("clock", read::<office::Clock>),
    ("clock_tower", read::<lookout::ClockTower>),
    ("computer", read::<office::Computer>),
    ("cone", read::<yard::Cone>),
    ("container", read::<furniture::Container>),
    ("desk", read::<office::Desk>),
    ("door", read::<room::Door>),
    ("excavator", read::<heavy::Excavator>),
    ("extinguisher", read::<office::Extinguisher>),
    ("factory", read::<house::Factory>),
    ("fence", read::<furniture::Fence>),
    ("flagpole", read::<furniture::Flagpole>),
    ("flat", read::<flat::Flat>),
    ("flower_bed", read::<plant::FlowerBed>),
    ("footbridge", read::<garden::Footbridge>),
    ("fountain", read::<ground::Fountain>),
    ("frame_building", read::<building::FrameBuilding>),
    ("gate", read::<gate::Gate>),
    ("grove", read::<landscape::Grove>),
    ("hangar", read::<garden::Hangar>),
    ("hedge", read::<plant::Hedge>),
    ("hill", read::<tunnel::Hill>),
    ("hollow_building", read::<building::HollowBuilding>),
    ("hot_air_balloon", read::<balloon::HotAirBalloon>),
    ("house", read::<house::House>),
    ("jetty", read::<garden::Jetty>),
    ("kiosk", read::<furniture::Kiosk>),
    ("knoll", read::<landscape::Knoll>),
    ("ladder", read::<yard::Ladder>),
    ("lake", read::<landscape::Lake>),
    ("landing_pad", read::<ground::LandingPad>),
    ("lattice_mast", read::<crane::LatticeMast>),
    ("locomotive", read::<railway::Locomotive>),
    ("lookout_tower", read::<lookout::LookoutTower>),
    ("monorail_beam", read::<monorail::MonorailBeam>),
    ("monorail_train", read::<monorail::MonorailTrain>),
    ("needle_tower", read::<tower::NeedleTower>),
    ("opening", read::<tunnel::Opening>),
    ("oval_bed", read::<plant::OvalBed>),
    ("parasol", read::<yard::Parasol>),
    ("patch", read::<landscape::Patch>),
    ("path", read::<way::Path>),
    ("pavilion", read::<garden::Pavilion>),
    ("person", read::<person::Person>),
    ("picnic_table", read::<garden::PicnicTable>),
    ("pile", read::<ground::Pile>),
    ("plane", read::<plane::Plane>),
    ("pond", read::<ground::Pond>),
    ("potted_plant", read::<plant::PottedPlant>),
    ("quay", read::<ground::Quay>),
    ("railway_track", read::<railway::RailwayTrack>),
    ("ring_road", read::<ground::RingRoad>),
    ("shelf", read::<office::Shelf>),
    ("sign", read::<sign::Sign>),
    ("slab", read::<ground::Slab>),
    ("slide", read::<furniture::Slide>),
    ("stream", read::<way::Stream>),
    ("street_lamp", read::<furniture::StreetLamp>),
    ("table", read::<office::Table>),
    ("tower_crane", read::<crane::TowerCrane>),
    ("traffic_light", read::<furniture::TrafficLight>),
    ("tree", read::<tree::Tree>),
    ("truck", read::<heavy::Truck>),
    ("tunnel", read::<tunnel::Tunnel>),
    ("van", read::<car::Van>),
    ("vending_machine", read::<office::VendingMachine>),
    ("wall", read::<room::Wall>),
    ("water_cooler", read::<office::WaterCooler>),
    ("water_tower", read::<tower::WaterTower>),
    ("whiteboard", read::<office::Whiteboard>),
    ("windmill", read::<garden::Windmill>),
    ("window", read::<room::Window>),
    ("windsock", read::<garden::Windsock>),
];
