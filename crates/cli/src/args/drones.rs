//! Help texts about drones, from the registry of their drivers.

use spf_drone::registry::{DRIVERS, alternatives, forms};

/// Help of `spf fly --drone`: the forms of names, with descriptions.
pub(super) fn drones() -> String {
    let real: String = DRIVERS.iter().map(|driver| format!("; {} ({})", driver.form, driver.about)).collect();
    format!("The drone: sim (simulated){real} [default: sim]")
}

/// The same without explanations.
pub(super) fn forms_of_drones() -> String {
    format!("The drone: {} [default: sim]", alternatives(&[&["sim"], forms().as_slice()].concat()))
}
