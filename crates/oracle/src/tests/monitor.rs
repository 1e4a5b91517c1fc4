//! What the oracle says as a monitor.

use spf_core::query::ImageBox;

use super::*;

/// How many of 2000 answers say continue, stop and lost.
fn said(oracle: &Oracle, percept: &Percept, of: &Query) -> [usize; 3] {
    let mut counts = [0; 3];
    for id in 0..2000 {
        let text = oracle.answer(&Query { id: QueryId(id), ..of.clone() }, percept).text;
        counts[["continue", "stop", "lost"].iter().position(|word| text == format!("{{\"state\":\"{word}\"}}")).unwrap()] += 1;
    }
    counts
}

#[test]
fn a_monitor_judges_by_the_same_percept_with_errors_of_its_own() {
    let car = |depth| Painting::new().with(tagged(1, "car", "vehicle", "black"), 430..530, 310..410, depth);
    let of = query(0, QueryKind::Monitor, "go to the black car");
    let perfect = oracle("perfect");
    for (painting, counts) in [(car(20.0), [2000, 0, 0]), (car(2.0), [0, 2000, 0]), (site(), [0, 0, 2000])] {
        assert_eq!(said(&perfect, &painting.percept(&perfect, 5), &of), counts);
    }
    // Of 2000, 5 % are 100 with a standard deviation of 10.
    let poor = oracle("poor");
    let [_, stop, lost] = said(&poor, &car(20.0).percept(&poor, 1), &of);
    assert!(stop.abs_diff(95) < 40 && lost.abs_diff(100) < 40, "{stop} {lost}");
    let [proceed, stop, _] = said(&poor, &site().percept(&poor, 1), &of);
    assert!(proceed == 0 && stop.abs_diff(100) < 40, "{proceed} {stop}");
    // The errors of other answers are drawn as before.
    assert_eq!(ask(&poor, &site(), &query(3, POINT, "fly to the red crane")).status, Status::Navigating);
}

#[test]
fn what_is_small_in_the_monitors_image_is_seen_in_its_enlarged_part() {
    // 20 pixels across of 960 are 8 of 384, which half of the looks notice.
    let painting = Painting::new().with(tagged(1, "car", "vehicle", "black"), 470..490, 350..370, 40.0);
    let oracle = Oracle::new(ErrorFile::default(), 3.0, 3);
    let area = ImageBox { left: 0.3, top: 0.3, right: 0.7, bottom: 0.7 };
    let seen = |close_up| {
        let of = Query { image_size: Some((384, 288)), close_up, ..query(0, QueryKind::Monitor, "go to the black car") };
        let sees = |frame: u64| oracle.answer(&of, &painting.percept(&oracle, frame)).text.contains("continue");
        (0..400).filter(|&frame| sees(frame)).count()
    };
    let (without, within, beside) = (seen(None), seen(Some(area)), seen(Some(ImageBox { left: 0.6, right: 1.0, ..area })));
    assert!(without.abs_diff(200) < 45 && within > 360 && beside == without, "{without} {within} {beside}");
}
