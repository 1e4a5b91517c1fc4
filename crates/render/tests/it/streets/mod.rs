//! A path through the city at street height.

/// East, north, up (metres), heading (degrees).
pub(crate) const STREETS: [[f64; 4]; 7] = [
    [0.0, -6.0, 2.0, 10.0],
    [0.0, 30.0, 2.5, 40.0],
    [4.0, 60.0, 2.0, 75.0],
    [20.0, 62.0, 1.7, 120.0],
    [30.0, 40.0, 2.5, 190.0],
    [28.0, 10.0, 2.0, 250.0],
    [4.0, -2.0, 2.0, 300.0],
];
