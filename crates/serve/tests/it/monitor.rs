//! The endpoint answers the monitor's query, from the small image that it sends.

use std::sync::Arc;

use spf_core::craft::CraftKind;
use spf_core::frame::FrameId;
use spf_core::geometry::{EnuPosition, Pose};
use spf_core::monitor::{Verdict, parse_monitor};
use spf_core::prompt::{PromptKind, PromptText};
use spf_core::query::{ImageBox, Query, QueryId, QueryKind};
use spf_core::time::Time;
use spf_flight::sim::{LoadedScene, OracleVlm, SimWorld};
use spf_oracle::ErrorFile;
use spf_serve::vlm::{AnswerForm, Instruction, Memory, Remembered, Responder};

#[test]
fn the_endpoint_says_how_the_flight_goes_on() {
    let loaded = Arc::new(LoadedScene::load("city").unwrap());
    let world = SimWorld::new(loaded.clone(), CraftKind::Quad, loaded.scene.start, 0);
    let pose = Pose { position: EnuPosition { up: 3.0, ..loaded.scene.start.position }, ..loaded.scene.start };
    let snapshot = loaded.snapshot(pose, 0, Time::ZERO);
    let image = world.photograph(&world.still(Time::ZERO, &snapshot).unwrap(), Some((384, 288)));
    let memory = Arc::new(Memory::default());
    memory.push(Time::ZERO, Remembered { frame: FrameId(1), snapshot }, &image);
    let oracle = OracleVlm::new("oracle:perfect".to_owned(), world, ErrorFile::named("perfect").unwrap(), 0);
    let responder = Responder::new(oracle, memory, Instruction::FromPrompt, AnswerForm::Spf);
    let said = |instruction: &str, close_up| {
        let query = Query {
            instruction: instruction.to_owned(),
            close_up,
            near_m: Some(3.0),
            ..Query::new(QueryId(1), FrameId(1), QueryKind::Monitor)
        };
        let prompt = PromptText::shipped(PromptKind::Monitor).write_monitor(&query);
        parse_monitor(&responder.answer(Time::ZERO, 1, &prompt, &image).unwrap().text)
    };
    // The crane stands above the start's view of the city; there is no elephant in it.
    let middle = ImageBox { left: 0.3, top: 0.3, right: 0.7, bottom: 0.7 };
    assert_eq!(said("fly to the red crane", Some(middle)), Ok(Verdict::Continue));
    assert_eq!(said("fly to the elephant", None), Ok(Verdict::Lost));
}
