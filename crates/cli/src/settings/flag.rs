//! A flag that sets a key: its name and form, as declared in the key's row.

/// A flag that sets a key.
#[derive(Clone, Copy)]
pub(crate) struct Flag {
    /// With its dashes.
    pub(crate) name: &'static str,
    /// What it takes.
    pub(crate) form: Form,
    /// The heading of the help of `spf fly` under which it stands.
    pub(super) group: Group,
    /// Whether the short help of `spf fly` has it.
    pub(super) common: bool,
    /// Whether its value may begin with a dash that begins no number.
    pub(super) dashed: bool,
}

/// What a flag takes.
#[derive(Clone, Copy)]
pub(crate) enum Form {
    /// A value, called so in the help.
    Value(&'static str),
    /// A value after an equals sign, called so in the help, or none, which means the second.
    Optional(&'static str, &'static str),
    /// No value: it sets the key to this.
    Switch(&'static str),
}

/// A heading of the help of `spf fly`.
#[derive(Clone, Copy)]
pub(crate) struct Group(pub(crate) &'static str);

impl Group {
    /// A flag with a value.
    pub(super) const fn value(self, name: &'static str, value: &'static str) -> Flag {
        self.flag(name, Form::Value(value))
    }

    /// A flag that also stands alone, which means `alone`.
    pub(super) const fn optional(self, name: &'static str, value: &'static str, alone: &'static str) -> Flag {
        self.flag(name, Form::Optional(value, alone))
    }

    /// A flag without a value, which sets the key to `sets`.
    pub(super) const fn switch(self, name: &'static str, sets: &'static str) -> Flag {
        self.flag(name, Form::Switch(sets))
    }

    const fn flag(self, name: &'static str, form: Form) -> Flag {
        Flag { name, form, group: self, common: false, dashed: false }
    }
}

impl Flag {
    /// The same, in the short help as well.
    pub(super) const fn common(self) -> Self {
        Self { common: true, ..self }
    }

    /// The same, with values such as `-3,4`.
    pub(super) const fn dashed(self) -> Self {
        Self { dashed: true, ..self }
    }
}
