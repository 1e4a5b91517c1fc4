use super::*;
use spf_core::grounding::{AxisOrder, Scale};
use spf_core::query::ImagePoint;
use spf_core::reply::parse_reply;

const DAY: &str = "2026-11-21";

fn model(name: &str) -> Model {
    Table::shipped().select(name, DAY).unwrap_or_else(|error| panic!("{name}: {error}")).model
}

#[test]
fn every_row_can_be_asked_or_names_its_successor() {
    let table = Table::shipped();
    for row in table.models() {
        let name = format!("{}#{}", row.vendor, row.id);
        match table.select(&name, DAY) {
            Ok(choice) => assert!(choice.model.row.is_some() && !choice.model.assumed, "{name}"),
            Err(SelectError::Retired { successor, .. }) => {
                table.select(&format!("{}#{successor}", row.vendor), DAY).unwrap_or_else(|error| panic!("{name}: {error}"));
            }
            Err(other) => panic!("{name}: {other}"),
        }
    }
    for vendor in table.vendors().iter().filter(|vendor| vendor.default.is_some()) {
        assert!(table.select(&vendor.name, DAY).is_ok(), "{}", vendor.name);
        assert!(vendor.key_page.is_some() || !vendor.key_needed, "{}", vendor.name);
    }
    assert_eq!(table.models().iter().filter(|row| row.paper).count(), 6, "the paper's six");
}

#[test]
fn each_family_is_asked_in_its_own_coordinates() {
    // A camera of 1280×720, and an object a quarter from the left and five eighths down, as each family writes it. The
    // sizes sent: 768×432; in multiples of 28: 27.4 → 27·28 = 756 and 15.4 → 15·28 = 420; of 32: 24·32 = 768 and 13.5 →
    // 14·32 = 448.
    let camera = (1280, 720);
    for (name, size, order, written) in [
        ("gemini", (768, 432), AxisOrder::Yx, "[625,250]"),
        ("openai", (768, 432), AxisOrder::Xy, "[192,270]"),
        ("openai#gpt-4.1", (768, 432), AxisOrder::Xy, "[250,625]"),
        ("anthropic", (768, 432), AxisOrder::Xy, "[192,270]"),
        ("ollama#qwen2.5vl:7b", (756, 420), AxisOrder::Xy, "[189,262.5]"),
        ("ollama", (768, 448), AxisOrder::Xy, "[250,625]"),
        ("openrouter#google/gemma-4-27b", (768, 432), AxisOrder::Yx, "[625,250]"),
        ("vllm#allenai/Molmo-7B-D", (768, 432), AxisOrder::Xy, "[25,62.5]"),
        ("moondream", (768, 432), AxisOrder::Xy, "[0.25,0.625]"),
        ("openrouter#meta-llama/llama-4-maverick", (768, 432), AxisOrder::Xy, "[250,625]"),
    ] {
        let model = model(name);
        assert_eq!(model.image.sent(camera, None), size, "{name}");
        let grounding = model.grounding(size);
        assert_eq!(grounding.order, order, "{name}");
        let text = format!("{{\"status\":\"navigating\",\"point\":{written},\"depth\":4}}");
        assert_eq!(parse_reply(&text, &grounding, false).unwrap().point, Some(ImagePoint { u: 0.25, v: 0.625 }), "{name}");
    }
    assert_eq!(model("anthropic").grounding((768, 432)).scale, Scale::Pixels { width: 768, height: 432 });
}

#[test]
fn names_are_read_in_their_parts() {
    let table = Table::shipped();
    let choice = table.select("vllm#Qwen/Qwen3-VL-30B@http://10.0.0.2:8000/v1/", DAY).unwrap();
    assert_eq!((choice.model.id.as_str(), choice.url.as_deref()), ("Qwen/Qwen3-VL-30B", Some("http://10.0.0.2:8000/v1")));
    assert!(choice.model.assumed);
    let choice = table.select("https://h/v1#my@model", DAY).unwrap();
    assert_eq!((choice.model.id.as_str(), choice.url.as_deref()), ("my@model", Some("https://h/v1")));
    assert!(matches!(table.select("http://h/v1", DAY), Err(SelectError::NoModel { .. })));
    assert!(matches!(table.select("gemmini", DAY), Err(SelectError::Unknown { .. })));
    assert!(matches!(table.select("compatible#x", DAY), Err(SelectError::Url(_))));
}

#[test]
fn a_retired_model_names_its_successor_unless_somebody_else_serves_it() {
    let table = Table::shipped();
    let error = table.select("gemini#gemini-2.0-flash", DAY).unwrap_err();
    assert_eq!(
        error.to_string(),
        "`gemini-2.0-flash` was retired by Google Gemini on 2026-06-01; its successor is `gemini-3.5-flash-lite`"
    );
    assert!(table.select("gemini#gemini-2.0-flash@http://localhost:1/v1", DAY).is_ok());
    // A model is retired on its retirement date.
    assert!(table.select("gemini#gemini-2.5-pro", "2026-11-30").is_ok());
    assert!(table.select("gemini#gemini-2.5-pro", "2026-12-01").is_err());
}

#[test]
fn prices_go_by_their_day() {
    let model = model("gemini#gemini-3.8-flash");
    let tokens = crate::Tokens { input: 1300, output: 60, ..crate::Tokens::default() };
    // 1300·0.75 + 60·3.75 = 1200 millionths; afterwards twice as much.
    let cost = |day: &str| model.price_on(day).map(|price| price.of(&tokens) * 1e6);
    assert!((cost("2026-12-31").unwrap() - 1200.0).abs() < 1e-9);
    assert!((cost("2027-01-01").unwrap() - 2400.0).abs() < 1e-9);
    let cached = crate::Tokens { cached: 1000, thinking: 40, ..tokens };
    // 300·0.75 + 1000·0.075 + 100·3.75 = 675 millionths.
    assert!((model.price_on(DAY).unwrap().of(&cached) * 1e6 - 675.0).abs() < 1e-9);
}

#[test]
fn rows_of_ones_own_add_and_replace() {
    let own = r#"
        [[family]]
        name = "mine"
        match = ["falcon"]
        order = "xy"
        scale = "unit"
        image = { multiple = 14, long_side = 448 }
        [[model]]
        id = "falcon-vl"
        vendor = "vllm"
        status = "current"
        sampling = true
        request = { temperature = 0.0, chat_template_kwargs = { a = true } }
        [[vendor]]
        name = "lab"
        title = "The lab"
        wire = "openai-chat"
        base_url = "http://lab:9000/v1"
        auth = "bearer"
        key_needed = false
        default = "falcon-2"
        family = "mine"
    "#;
    let table = Table::shipped().extended(own).unwrap();
    let model = table.select("vllm#falcon-vl", DAY).unwrap().model;
    assert_eq!((model.grounding((448, 336)).scale, model.image.sent((960, 720), None)), (Scale::Unit, (448, 336)));
    assert_eq!(model.request["stream_options"]["include_usage"], true, "the vendor's part is kept");
    assert_eq!(model.request["chat_template_kwargs"]["a"], true);
    assert_eq!((model.temperature(), Table::shipped().select("openai", DAY).unwrap().model.temperature()), (Some(0.0), None));
    assert_eq!(table.select("lab", DAY).unwrap().model.id, "falcon-2");
}

#[test]
fn wrong_rows_are_refused_with_their_reason() {
    let refused = |text: &str| Table::shipped().extended(text).unwrap_err().to_string();
    let row = "[[model]]\nid = \"x\"\nvendor = \"gemini\"\nstatus = \"current\"\n";
    assert!(refused("[[model]]\nid = \"x\"\nvendor = \"nobody\"\nstatus = \"current\"").contains("vendor `nobody`"));
    assert!(refused(&format!("{row}colour = 1")).contains("unknown field `colour`"));
    assert!(refused(&format!("{row}family = \"none\"")).contains("family `none`"));
    let sampling = format!("{row}request = {{ generationConfig = {{ temperature = 0.0 }} }}");
    assert!(refused(&sampling).contains("does not accept `temperature`"));
    assert!(refused("[[model]]\nid = \"x\"\nvendor = \"gemini\"\nstatus = \"retired\"").contains("no `successor`"));
}

proptest::proptest! {
    #[test]
    fn no_text_panics(text in ".{0,200}", key in "[a-z_.\\[\\]]{0,20}", value in "[-0-9a-z\"'{}\\[\\], =]{0,30}") {
        let _ = Table::from_toml(&text);
        let _ = Table::from_toml(&format!("[[model]]\n{key} = {value}\n"));
        let _ = Table::shipped().select(&text, DAY);
    }
}
