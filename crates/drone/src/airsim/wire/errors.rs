//! The texts of errors, as AirSim's server (rpclib) words them: other people's programs look for them.

/// There is no such method, or none that was called.
#[must_use]
pub fn unknown_method(method: &str, given: usize) -> String {
    format!("rpclib: server could not find function '{method}' with argument count {given}.")
}

/// The method takes another number of arguments.
#[must_use]
pub fn wrong_arity(method: &str, expected: usize, given: usize) -> String {
    format!("rpclib: Function '{method}' was called with an invalid number of arguments. Expected: {expected}, got: {given}")
}

/// The method has failed.
#[must_use]
pub fn failed(method: &str, given: usize, why: &str) -> String {
    format!(
        "rpclib: function '{method}' (called with {given} arg(s)) threw an exception. The exception contained this \
         information: {why}."
    )
}
