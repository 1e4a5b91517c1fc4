//! What a network says of itself, what it is given, and what it gives.

/// One of a network's outputs.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Outlet {
    /// Its name; empty without one.
    pub(crate) name: String,
    /// Its dimensions; `None` where they depend on the input.
    pub(crate) shape: Vec<Option<usize>>,
}

impl Outlet {
    /// Its dimensions as text.
    pub(crate) fn shown(&self) -> String {
        let side = |side: &Option<usize>| side.map_or_else(|| "?".to_owned(), |side| side.to_string());
        self.shape.iter().map(side).collect::<Vec<_>>().join("×")
    }
}

/// What a network says of itself.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct Description {
    /// Width and height of its input, pixels; `None` where any is accepted.
    pub(crate) input: (Option<usize>, Option<usize>),
    /// Its outputs.
    pub(crate) outputs: Vec<Outlet>,
    /// The model's metadata.
    pub(crate) metadata: Vec<(String, String)>,
}

impl Description {
    /// An entry of the metadata.
    pub(crate) fn metadata(&self, key: &str) -> Option<&str> {
        self.metadata.iter().find(|(name, _)| name == key).map(|(_, value)| value.as_str())
    }
}

/// An image for a network.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Input<'a> {
    /// Width and height, pixels.
    pub(crate) size: (usize, usize),
    /// Planes of red, green and blue, in rows from the top.
    pub(crate) values: &'a [f32],
    /// Number of the wanted output.
    pub(crate) output: usize,
}

impl Input<'_> {
    /// Whether the number of values is that of the pixels.
    pub(crate) fn is_whole(&self) -> bool {
        let (width, height) = self.size;
        width.checked_mul(height).and_then(|pixels| pixels.checked_mul(3)) == Some(self.values.len())
    }
}

/// Output of a network.
#[derive(Debug, PartialEq)]
pub(crate) struct Output {
    /// Its dimensions.
    pub(crate) shape: Vec<usize>,
    /// Its values, last dimension fastest.
    pub(crate) values: Vec<f32>,
}
