//! `spf sim scenes`.

use serde_json::Value;

use crate::harness::Lab;

#[test]
fn every_built_in_scene_is_listed_in_one_line() {
    let run = Lab::new().spf(&["sim", "scenes"]);
    assert_eq!((run.code, run.stderr.as_str()), (Some(0), ""));
    let lines: Vec<&str> = run.stdout.lines().collect();
    assert!(lines[0].starts_with("SCENE ") && lines[0].ends_with("DESCRIPTION"), "{}", run.stdout);
    let city = lines.iter().find(|line| line.starts_with("city ")).unwrap_or_else(|| panic!("{}", run.stdout));
    assert!(city.contains(" quad ") && city.contains("260 x 290 x 92 m") && city.contains("crane"), "{city}");
    // The description column is filled for every scene.
    let column = lines[0].find("DESCRIPTION").unwrap();
    assert!(lines[1..].iter().all(|line| line.len() > column + 10), "{}", run.stdout);
}

#[test]
fn stats_count_what_is_there_and_images_are_drawn() {
    let lab = Lab::new();
    let run = lab.spf(&["sim", "scenes", "city", "--stats", "--json", "--pictures", "previews/small"]);
    assert_eq!(run.code, Some(0), "{}", run.stderr);
    let printed: Value = serde_json::from_str(&run.stdout).unwrap();
    let scenes = printed["scenes"].as_array().unwrap();
    assert_eq!(scenes.len(), 1);
    let city = &scenes[0];
    let number = |key: &str| city[key].as_u64().unwrap_or_else(|| panic!("`{key}` in {city}"));
    let objects = number("objects");
    assert!(objects > 50 && number("meshes") > objects && number("triangles") > 10 * number("meshes"), "{city}");
    assert!(number("materials") > 10 && number("openings") >= 1);
    assert!(city["load_s"].as_f64().unwrap() > 0.0 && city["first_picture_s"].as_f64().unwrap() > 0.0);
    if cfg!(target_os = "linux") {
        assert!(number("memory_bytes") > number("triangles"), "{city}");
    }
    let tags = city["tags"].as_array().unwrap();
    assert_eq!(tags.iter().map(|tag| tag["count"].as_u64().unwrap()).sum::<u64>(), objects);
    let path = city["picture"].as_str().unwrap();
    assert_eq!(lab.names("previews/small"), ["city.png"]);
    let image = lab.read(path);
    assert!(image.starts_with(b"\x89PNG") && image.len() > 100_000, "{} bytes", image.len());
}

#[test]
fn without_questions_nothing_is_measured() {
    let run = Lab::new().spf(&["sim", "scenes", "--json"]);
    let printed: Value = serde_json::from_str(&run.stdout).unwrap();
    for scene in printed["scenes"].as_array().unwrap() {
        assert!(scene.get("load_s").is_none() && scene.get("picture").is_none(), "{scene}");
    }
}

#[test]
fn a_scene_that_is_not_there_is_named() {
    let lab = Lab::new();
    let run = lab.spf(&["sim", "scenes", "citty"]);
    assert_eq!((run.code, run.stdout.as_str()), (Some(2), ""));
    assert!(run.stderr.contains("did you mean `city`?"), "{}", run.stderr);
    lab.write("full", "a file");
    let run = lab.spf(&["sim", "scenes", "--pictures", "full"]);
    assert_eq!((run.code, run.stdout.as_str()), (Some(2), ""));
    assert!(run.stderr.contains("--pictures: cannot create the folder `full`"), "{}", run.stderr);
}

#[test]
#[ignore = "long: .ci/interop runs it"]
fn a_contact_sheet_shows_every_light_and_weather() {
    let lab = Lab::new();
    let run = lab.spf(&["sim", "scenes", "city", "--contact-sheet", "sheet.jpg"]);
    assert_eq!(run.code, Some(0), "{}", run.stderr);
    assert!(run.stdout.ends_with("sheet.jpg\n"), "{}", run.stdout);
    let sheet = spf_media::jpeg::decode(&lab.read("sheet.jpg")).unwrap();
    // Four lights across, three weathers down, a title above.
    assert!((990..1100).contains(&sheet.width()) && (570..700).contains(&sheet.height()), "{sheet:?}");
    // Twelve different images.
    let thumb = |index: u32| {
        let (left, top) = (20 + index % 4 * 244, 46 + index / 4 * 184);
        let places = (top..top + 150).flat_map(move |y| (left..left + 220).map(move |x| (x, y)));
        places.map(|(x, y)| sheet.pixel(x, y).unwrap()[1]).collect::<Vec<u8>>()
    };
    for (one, other) in (0..12).flat_map(|one| (0..one).map(move |other| (one, other))) {
        let differ = thumb(one).into_iter().zip(thumb(other)).filter(|(a, b)| a.abs_diff(*b) > 3).count();
        assert!(differ > 220 * 150 / 100, "{one} and {other} differ in {differ} pixels");
    }
    let run = lab.spf(&["sim", "scenes", "city", "--contact-sheet", "sheet.gif"]);
    assert_eq!((run.code, run.stdout.as_str()), (Some(2), ""));
}

#[test]
fn objects_are_listed_with_ids_and_places() {
    let lab = Lab::new();
    let run = lab.spf(&["sim", "scenes", "office", "--objects"]);
    assert_eq!(run.code, Some(0), "{}", run.stderr);
    assert!(
        run.stdout.contains("office: east -9 to 9 m") && run.stdout.contains("start at -6.6,3.3,0.0, heading 90°"),
        "{}",
        run.stdout
    );
    let listed = run.stdout.lines().skip_while(|line| !line.starts_with("ID ")).skip(1).count();
    let run = lab.spf(&["sim", "scenes", "office", "--objects", "--json"]);
    let printed: Value = serde_json::from_str(&run.stdout).unwrap();
    let office = &printed["scenes"][0];
    assert_eq!(office["object_list"].as_array().unwrap().len(), listed);
    assert_eq!(office["objects"].as_u64(), Some(listed as u64));
    assert_eq!(office["start"]["heading_deg"], 90.0);
    let lying = office["object_list"].as_array().unwrap().iter().find(|object| object["key"] == "person_lying").unwrap();
    assert_eq!(lying["colour"], "red");
    assert!(lying["centre_m"][2].as_f64().unwrap() < 0.5 && lying["size_m"][0].as_f64().unwrap() > 1.0, "{lying}");
}

#[test]
fn an_image_from_outside_the_scene_is_warned_about() {
    let lab = Lab::new();
    let run = lab.spf(&["sim", "render", "office", "--pose", "20,0,1.5,0", "--size", "64x48", "-o", "x.png"]);
    assert_eq!(run.code, Some(0), "{}", run.stderr);
    assert!(run.stderr.contains("the pose is outside office: east -9 to 9 m"), "{}", run.stderr);
    let run = lab.spf(&["sim", "render", "office", "--pose", "0,0,1.5,0", "--size", "64x48", "-o", "y.png"]);
    assert_eq!((run.code, run.stderr.as_str()), (Some(0), ""));
}
