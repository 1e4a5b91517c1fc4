use super::*;
use spf_core::grounding::{AxisOrder, Habit, Scale};
use spf_core::query::ImagePoint;
use spf_core::reply::parse_reply;

const DAY: &str = "2026-11-21";

fn model(name: &str) -> Model {
    Table::shipped().select(name, DAY).unwrap_or_else(|error| panic!("{name}: {error}")).model
}

#[test]
fn every_row_can_be_queried_or_names_its_successor() {
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
fn families_that_point_by_habit_are_known() {
    for (name, habit, lists_boxes) in [
        ("gemini", Habit::List, true),
        ("gemini#gemini-3.8-flash", Habit::Asked, true),
        ("vllm#allenai/Molmo-7B-D", Habit::Tags, false),
        ("vllm#allenai/Molmo2-8B", Habit::Tags, false),
        ("vllm", Habit::Asked, true),
    ] {
        let model = model(name);
        assert_eq!((model.grounding((960, 720)).habit, model.lists_boxes), (habit, lists_boxes), "{name}");
    }
}

#[test]
fn each_family_is_queried_in_its_own_coordinates() {
    // A camera of 1280×720, and an object a quarter from the left and five eighths down, as each family writes it. The
    // sizes sent: 768×432, for Gemini 960×540; in multiples of 28: 27.4 → 27·28 = 756 and 15.4 → 15·28 = 420; of 32: 24·32 = 768 and 13.5 →
    // 14·32 = 448.
    let camera = (1280, 720);
    for (name, size, order, written) in [
        ("gemini", (960, 540), AxisOrder::Yx, "[625,250]"),
        ("openai", (768, 432), AxisOrder::Xy, "[192,270]"),
        ("openai#gpt-4.1", (768, 432), AxisOrder::Xy, "[250,625]"),
        ("anthropic", (768, 432), AxisOrder::Xy, "[192,270]"),
        ("ollama#qwen2.5vl:7b", (756, 420), AxisOrder::Xy, "[189,262.5]"),
        ("ollama", (768, 448), AxisOrder::Xy, "[250,625]"),
        ("openrouter#google/gemma-4-27b", (960, 540), AxisOrder::Yx, "[625,250]"),
        ("vllm#allenai/Molmo-7B-D", (768, 432), AxisOrder::Xy, "[25,62.5]"),
        ("vllm#allenai/Molmo2-8B", (768, 432), AxisOrder::Xy, "[250,625]"),
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
fn models_without_rows_are_asked_like_their_series() {
    let request = |name: &str, pointer: &str| model(name).request.pointer(pointer).cloned().unwrap_or_default();
    for (name, pointer, value) in [
        ("gemini#gemini-2.5-flash-lite-001", "/generationConfig/thinkingConfig/thinkingBudget", serde_json::json!(0)),
        ("gemini#gemini-3.6-flash-001", "/generationConfig/thinkingConfig/thinkingLevel", serde_json::json!("MINIMAL")),
        ("gemini#gemini-4-argon", "/generationConfig/thinkingConfig/thinkingLevel", serde_json::json!("LOW")),
        ("gemini#gemma-4-27b", "/generationConfig/thinkingConfig", Value::Null),
        ("openai#gpt-5.6-luna", "/reasoning/effort", serde_json::json!("none")),
        ("openai#gpt-6-astra-2", "/reasoning/effort", serde_json::json!("low")),
        ("openai#gpt-4o", "/reasoning", Value::Null),
        ("anthropic#claude-haiku-5-6", "/thinking/type", serde_json::json!("disabled")),
        ("anthropic#claude-fable-5-2", "/thinking", Value::Null),
        ("anthropic#claude-fable-5-2", "/output_config/effort", serde_json::json!("low")),
        ("anthropic#claude-haiku-4-5", "/output_config", Value::Null),
        ("openrouter#some/model", "/provider/require_parameters", Value::Null),
        ("openrouter", "/provider/require_parameters", serde_json::json!(true)),
    ] {
        assert_eq!(request(name, pointer), value, "{name} {pointer}");
    }
    let of = |name: &str| (model(name).thinks, model(name).max_output_tokens, model(name).timeouts);
    for name in ["openai", "anthropic", "openai#gpt-4o", "anthropic#claude-sonnet-4-5", "gemini#gemini-2.5-flash-lite"] {
        assert_eq!(of(name), (false, 1024, Timeouts::QUICK), "{name}");
    }
    for name in ["gemini", "openai#gpt-6-astra", "openai#gpt-7", "openrouter#some/model", "ollama", "http://h/v1#m"] {
        assert_eq!(of(name), (true, 4096, Timeouts::PATIENT), "{name}");
    }
    assert_eq!(model("openai#gpt-5.4-mini").detail.as_deref(), Some("high"));
    assert_eq!(model("openai#gpt-5.4").detail.as_deref(), Some("original"));
    assert_eq!((model("gemini").image.quality, model("openai").image.quality), (75, 70));
}

#[test]
fn a_habit_of_depth_labels_is_corrected() {
    let own =
        "[[model]]\nid = \"x\"\nvendor = \"vllm\"\nstatus = \"current\"\ndepth_m = [0.5, 1.0, 2, 4, 8, 16, 32, 64, 128, 256]";
    let model = Table::shipped().extended(own).unwrap().select("vllm#x", DAY).unwrap().model;
    // 1 + 4.5·log10 of 0.5, 2, 8, 256 m: −0.35, 2.35, 5.06, 11.8.
    assert_eq!([1, 3, 5, 10].map(|label| model.prompt_label(label)), [1, 2, 5, 10]);
    assert_eq!([1, 7, 10].map(|label| self::model("vllm").prompt_label(label)), [1, 7, 10]);
    for wrong in ["[1, 2]", "[1, 2, 3, 4, 5, 6, 7, 8, 9, 8]", "[0, 2, 3, 4, 5, 6, 7, 8, 9, 10]"] {
        let own = format!("[[model]]\nid = \"x\"\nvendor = \"vllm\"\nstatus = \"current\"\ndepth_m = {wrong}");
        assert!(Table::shipped().extended(&own).unwrap_err().to_string().contains("invalid `depth_m` of `x`"), "{wrong}");
    }
}

#[test]
fn an_end_within_a_month_is_announced() {
    let model = model("gemini#gemini-2.5-flash");
    assert_eq!(model.ends_soon("2026-11-24"), Some(("2026-12-01", Some("gemini-3.5-flash-lite"), 7)));
    assert_eq!(model.ends_soon("2026-11-01").map(|(.., days)| days), Some(30));
    assert_eq!((model.ends_soon("2026-10-31"), model.ends_soon("2026-12-01")), (None, None));
    assert_eq!(self::model("gemini").ends_soon("2026-11-24"), None);
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
    assert_eq!(model.clone().greedy().temperature(), Some(0.0));
    let fixed = Table::shipped().select("openai", DAY).unwrap().model;
    assert_eq!(fixed.clone().greedy().request, fixed.request, "its row allows no sampling parameter");
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
    let series = "[[series]]\nvendor = \"gemini\"\nmatch = [\"x\"]\n";
    assert!(refused(&format!("{series}request = {{ temperature = 1.0 }}")).contains("`x` does not accept `temperature`"));
    assert!(refused(&series.replace("gemini", "nobody")).contains("vendor `nobody`"));
    let timeouts = "timeouts = { connect_s = 0.0, first_byte_s = 1.0, whole_s = 1.0 }";
    assert!(refused(&format!("{series}{timeouts}")).contains("invalid `timeouts` of `x`"));
    assert!(refused(&format!("{row}{timeouts}")).contains("invalid `timeouts` of `x`"));
}

proptest::proptest! {
    #[test]
    fn no_text_panics(text in ".{0,200}", key in "[a-z_.\\[\\]]{0,20}", value in "[-0-9a-z\"'{}\\[\\], =]{0,30}") {
        let _ = Table::from_toml(&text);
        let _ = Table::from_toml(&format!("[[model]]\n{key} = {value}\n"));
        let _ = Table::shipped().select(&text, DAY);
    }
}
