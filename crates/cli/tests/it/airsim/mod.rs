//! AirSim's client from PyPI, unmodified, and `spf sim serve --airsim`.

use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::Command;

use serde_json::Value;

use crate::harness::{Lab, Run};
use crate::python;

/// Python with AirSim's client, whose packages are too old to lie beside others. It imports them while it is built, so that they come
/// first.
fn python() -> Option<PathBuf> {
    let client = ["--no-build-isolation", "--no-deps", "airsim==1.8.1"];
    python::made("airsim", include_str!("requirements.txt"), &client)
}

#[test]
#[ignore = "needs Python: .ci/interop runs it"]
fn the_client_of_pypi_flies_sees_and_steps() {
    let Some(python) = python() else { return };
    let lab = Lab::new();
    let mut child = lab.command(&["sim", "serve", "--airsim", "--airsim-listen", "127.0.0.1:0"]).spawn().unwrap();
    let mut address = String::new();
    BufReader::new(child.stdout.take().unwrap()).read_line(&mut address).unwrap();
    let port = address.trim_end().rsplit(':').next().unwrap().to_owned();
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/it/airsim/client.py");
    let output = Command::new("timeout").args(["-k", "10", "600"]).arg(python).arg(script).arg(&port).output().unwrap();
    child.kill().unwrap();
    child.wait().unwrap();
    let run = Run::of(&output);
    assert_eq!(run.code, Some(0), "{}\n{}", run.stdout, run.stderr);
    let told: Value = serde_json::from_str(run.stdout.lines().last().unwrap()).unwrap();
    println!("{told}");
    let number = |name: &str| told[name].as_f64().unwrap_or_else(|| panic!("{name}: {told}"));
    for name in ["armed", "took_off", "path", "hovered", "png", "relabelled", "nowhere", "paused"] {
        assert_eq!(told[name], true, "{name}: {told}");
    }
    assert_eq!((&told["cancelled"], &told["no_such_kind"]), (&Value::Bool(false), &Value::Null), "{told}");
    assert!((number("z") + 2.0).abs() < 0.2 && (number("yaw_deg") - 90.0).abs() < 6.0, "{told}");
    let end: Vec<f64> = told["end"].as_array().unwrap().iter().map(|part| part.as_f64().unwrap()).collect();
    assert!(end[0].abs() < 0.5 && end[1].abs() < 0.5 && (end[2] + 4.0).abs() < 0.5, "{end:?}");
    let sizes = told["sizes"].as_array().unwrap();
    assert_eq!(sizes[0], serde_json::json!([256, 144, 256 * 144 * 3, 0]));
    assert_eq!(sizes[2], serde_json::json!([256, 144, 0, 256 * 144]));
    assert!((number("continued_s") - 0.5).abs() < 1e-9 && (number("imu") + 9.8).abs() < 0.5, "{told}");
    assert!(told["lidar"].as_str().unwrap().contains("rpclib: function 'getLidarData'"), "{told}");
    assert_eq!((&told["landed"], number("reset_z").abs() < 0.01), (&0.into(), true), "{told}");
}
