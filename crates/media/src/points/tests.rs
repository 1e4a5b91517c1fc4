use super::*;

/// Speckles seen from a place: those of the lower half move twice as fast as those of the upper one.
fn image(shift: u32) -> TrackImage {
    let speckle = |x: u32, y: u32| ((x / 5 * 7919 + y / 5 * 104_729 + (x / 5) * (y / 5) * 31) % 251) as u8;
    let data = (0..240_u32)
        .flat_map(|y| (0..320_u32).map(move |x| speckle(x + 200 - if y < 120 { shift } else { 2 * shift }, y)))
        .collect();
    TrackImage::from_grey(320, 240, data).unwrap()
}

#[test]
fn points_keep_their_numbers_and_move_with_what_they_show() {
    let mut points = Points::default();
    let first = points.next(&image(0), |_| None).to_vec();
    assert!(first.len() > MOST / 2 && first.windows(2).all(|pair| pair[0].id < pair[1].id), "{}", first.len());
    for shift in 1..=5 {
        points.next(&image(2 * shift), |_| None);
    }
    let mut kept = 0;
    for point in points.points() {
        let Some(start) = first.iter().find(|start| start.id == point.id) else { continue };
        // At the border of the halves there are two motions in a window.
        if (start.y - 120.0).abs() < 24.0 {
            continue;
        }
        let moved = if start.y < 120.0 { 10.0 } else { 20.0 };
        assert!((point.x - start.x - moved).abs() < 0.5 && (point.y - start.y).abs() < 0.5, "{start:?} {point:?}");
        kept += 1;
    }
    assert!(kept > first.len() / 3, "{kept} of {}", first.len());
}

#[test]
fn lost_points_are_replaced_under_new_numbers_and_a_plain_image_has_none() {
    let mut points = Points::default();
    let first = points.next(&image(0), |_| None).to_vec();
    let blank = TrackImage::from_grey(320, 240, vec![90; 320 * 240]).unwrap();
    assert!(points.next(&blank, |_| None).is_empty());
    let again = points.next(&image(0), |_| None);
    assert!(!again.is_empty() && again.iter().all(|point| point.id >= first.len() as u32));
    // Another size begins anew; an image smaller than the grid has no corners.
    let tiny = TrackImage::from_grey(7, 5, vec![90; 35]).unwrap();
    assert!(points.next(&tiny, |_| None).is_empty());
}

#[test]
fn a_predicted_turn_is_a_guess_only() {
    let follow = |guess: Shift| {
        let mut points = Points::default();
        points.next(&image(0), |_| None);
        points.next(&image(4), move |_| Some(guess)).to_vec()
    };
    let (right, none) = (follow(Shift { x: 4.0, y: 0.0 }), follow(Shift::default()));
    let both = right.iter().filter_map(|a| none.iter().find(|b| b.id == a.id).map(|b| (a, b)));
    let mut count = 0;
    for (a, b) in both {
        count += u32::from((a.x - b.x).abs() < 0.1 && (a.y - b.y).abs() < 0.1);
    }
    assert!(count > 60, "{count}");
    assert_eq!(follow(Shift { x: f64::NAN, y: 0.0 }), none);
}

/// The time per image, printed by `cargo test --release -p spf-media points -- --ignored --nocapture`.
#[test]
#[ignore = "a measurement"]
fn time_per_image() {
    let large = |shift: u32| {
        let small = image(shift);
        let data = (0..360_usize).flat_map(|y| (0..480_usize).map(move |x| (x, y)));
        let data = data.map(|(x, y)| small.grey.data()[(y * 2 / 3) * 320 + x * 2 / 3]).collect();
        TrackImage::from_grey(480, 360, data).unwrap()
    };
    let images: Vec<TrackImage> = (0..20).map(|n| large(n * 2)).collect();
    let mut points = Points::default();
    points.next(&images[0], |_| None);
    let start = std::time::Instant::now();
    for image in &images[1..] {
        points.next(image, |_| None);
    }
    println!("{} points, {:.2} ms an image", points.points().len(), start.elapsed().as_secs_f64() * 1000.0 / 19.0);
}
