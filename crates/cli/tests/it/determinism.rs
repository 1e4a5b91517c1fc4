//! The same seed gives the same bytes, on any number of threads; another seed does not.

use crate::harness::Lab;

fn files(lab: &Lab, folder: &str, names: &[&str]) -> Vec<Vec<u8>> {
    names.iter().map(|name| lab.read(&format!("{folder}/{name}"))).collect()
}

#[test]
fn a_whole_flight_and_its_files() {
    let names = ["summary.json", "decisions.jsonl", "trajectory.svg"];
    let lab = Lab::new();
    let fly = |folder: &str, seed: &str, threads: &str| {
        let args = ["fly", "fly to the red crane", "--no-video", "--seed", seed, "--out", folder];
        let output = lab.command(&args).env("RAYON_NUM_THREADS", threads).output().unwrap();
        assert!(
            output.status.code().is_some_and(|code| [0, 3, 4].contains(&code)),
            "{}",
            String::from_utf8_lossy(&output.stderr)
        );
        files(&lab, folder, &names)
    };
    let first = fly("folder-one", "5", "2");
    assert!(first[1].len() > 10_000, "a flight of some decisions");
    assert!(first == fly("second", "5", "2"), "the second run differs");
    assert!(first == fly("elsewhere/deep", "5", "1"), "one thread differs");
    let other = fly("other", "6", "2");
    assert!(first[0] != other[0] && first[1] != other[1], "another seed is another flight");

    // They contain neither the folder nor wall-clock times.
    for (name, bytes) in names.iter().zip(&first) {
        let text = String::from_utf8_lossy(bytes);
        assert!(!text.contains("folder-one") && !text.contains("out_dir"), "{name} names its folder");
        let day = spf_vlm::today();
        assert!(!text.contains(&day[..5]), "{name} holds a date");
    }
}

#[test]
fn every_image_of_the_video() {
    let names = ["summary.json", "decisions.jsonl", "video.mp4"];
    let lab = Lab::new();
    let fly = |folder: &str, threads: &str| {
        let args = ["fly", "fly to the red crane", "--max-time", "3", "--out", folder];
        let output = lab.command(&args).env("RAYON_NUM_THREADS", threads).output().unwrap();
        assert_eq!(output.status.code(), Some(3), "{}", String::from_utf8_lossy(&output.stderr));
        files(&lab, folder, &names)
    };
    let first = fly("folder-one", "2");
    assert!(first[2].len() > 50_000, "a video of some pictures");
    assert!(first == fly("second", "1"), "the same seed must give the same bytes on one thread");
}
