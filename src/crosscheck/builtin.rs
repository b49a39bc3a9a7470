//! The built-in set: recordings of the reference with their experiments.

/// A recording with its experiment.
#[derive(Debug, Clone, Copy)]
pub struct Builtin {
    /// Name of the recording.
    pub name: &'static str,
    /// The experiment file.
    pub experiment: &'static str,
    /// The recording, as NPZ.
    pub recording: &'static [u8],
}

macro_rules! builtin {
    ($($name:literal)*) => {
        /// All recordings, by name.
        pub static BUILTIN: &[Builtin] = &[$(Builtin {
            name: $name,
            experiment: include_str!(concat!("../../tests/recordings/", $name, ".toml")),
            recording: include_bytes!(concat!("../../tests/recordings/", $name, ".npz")),
        },)*];
    };
}

builtin! {
    "cantilever-ac-m1"
    "cantilever-ac-m3"
    "cantilever-dc-m3"
    "cantilever-dc-m5"
    "cantilever-step-m3"
    "crawl-14hz-m1"
    "crawl-14hz-m3"
    "frog-v2-m1"
    "full-frictional-inchworm-m1"
    "full-frictional-inchworm-m3"
    "inchworm-backward-m1"
    "inchworm-m1"
    "jumper-delay-24ms-m3"
    "static-shape-m1"
}
