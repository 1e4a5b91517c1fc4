//! Which flags of the table of settings the commands take.

use clap::Arg;

use crate::settings::Takes;

/// Every flag: `spf fly` and `spf cockpit`.
#[derive(Debug)]
pub(crate) struct OfFlight;

impl Takes for OfFlight {
    const FLAGS: &'static [&'static str] = &[];

    fn takes(_flag: &str) -> bool {
        true
    }

    fn adapted(_flag: &str, arg: Arg) -> Arg {
        arg
    }
}

/// Declares a command's flags, and in which of them it differs.
macro_rules! takes {
    ($($(#[$about:meta])* $Of:ident: [$($flag:literal),*] $(with $adapted:expr)?;)*) => {
        $(
            $(#[$about])*
            #[derive(Debug)]
            pub(crate) struct $Of;

            impl Takes for $Of {
                const FLAGS: &'static [&'static str] = &[$($flag),*];

                $(fn adapted(flag: &str, arg: Arg) -> Arg {
                    $adapted(flag, arg.help_heading(None).hide_short_help(false))
                })?
            }
        )*

        /// The flags of every command but those of a flight.
        #[cfg(test)]
        pub(crate) fn taken() -> Vec<&'static str> {
            [$($Of::FLAGS),*].concat()
        }
    };
}

takes! {
    /// `spf doctor`.
    OfDoctor: ["--drone", "--scene", "--vlm", "--send-key-to", "--detector", "--depth-model"];
    /// `spf tello`.
    OfTello: ["--drone"] with |flag: &str, arg: Arg| match flag {
        "--drone" => arg.help("Drone: tello, or tello@ADDRESS [default: tello]"),
        _ => arg,
    };
    /// `spf ground`.
    OfGround: ["--vlm", "--vlm-models", "--send-key-to", "--max-cost"] with |flag: &str, arg: Arg| match flag {
        "--vlm" => arg.value_name("VLM,…").help(
            "VLMs, comma-separated: NAME[#MODEL][@URL] (see `spf vlm list`), auto, exec:COMMAND, oracle[:NAME|FILE]",
        ),
        "--max-cost" => arg.requires("dataset"),
        _ => arg,
    };
    /// `spf replay`.
    OfReplay: ["--vlm", "--vlm-models", "--send-key-to"] with |flag: &str, arg: Arg| match flag {
        "--vlm" => arg.help(
            "Query this VLM about the same frames, as for `spf fly --vlm`: oracle:NAME, gemini, ollama#qwen2.5vl:7b, a URL…",
        ),
        _ => arg.requires("fly.vlm"),
    };
    /// `spf vlm list`.
    OfVlmList: ["--vlm-models"];
    /// `spf vlm check`.
    OfVlmCheck: ["--vlm-models", "--send-key-to"];
    /// `spf vlm trial`.
    OfVlmTrial: ["--vlm-models", "--vlm-price", "--vlm-latency", "--send-key-to", "--max-cost"];
    /// `spf bench run`.
    OfBenchRun: ["--vlm-models", "--vlm-price", "--vlm-latency", "--send-key-to", "--max-cost", "--detector", "--depth-model"] with |flag: &str, arg: Arg| match flag {
        "--detector" => arg.help("Detector in place of the simulated one, of methods with one: nanodet or FILE.onnx"),
        "--depth-model" => arg.help(
            "Depth network in place of the depth sensor, of methods with one: fastdepth, FILE.onnx:KIND, or stand-in:ERROR",
        ),
        "--max-cost" => arg.help(
            "VLM cost limit of the whole run, including what was flown in the folder before, US dollars [default: no limit]",
        ),
        _ => arg,
    };
    /// `spf bench ask`.
    OfBenchAsk: ["--vlm-latency"] with |flag: &str, arg: Arg| match flag {
        "--vlm-latency" => arg.help("What each answer counts as in the flight's time, seconds, however long it takes [default: 1.5]"),
        _ => arg,
    };
    /// `spf bench show`.
    OfBenchShow: ["--send-key-to", "--detector", "--depth-model"];
}
