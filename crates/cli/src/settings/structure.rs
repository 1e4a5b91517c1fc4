//! Generates a structure from the table of settings: one field per row.

/// Declares [`Settings`](super::Settings) and its tables from rows of
///
/// ```text
/// /// meaning and unit; empty: what an empty text means
/// name: Type = "default", Reading, "VARIABLE", GROUP.value("--flag", "VALUE");
/// ```
///
/// The last may be omitted: such a key has no flag. The doc comment is the key's meaning in hints, `spf config show`, the help of
/// the flag, and `docs/reference/configuration.md`; `{}` in it stands for the values that the reading accepts.
macro_rules! settings {
    ($(
        $(#[$about:meta])*
        $table:ident: $Table:ident {
            $(
                $(#[doc = $doc:literal])+
                $field:ident: $Type:ty = $default:literal, $reading:expr, $env:literal $(, $flag:expr)?;
            )*
        }
    )*) => {
        $(
            $(#[$about])*
            #[derive(Clone)]
            pub(crate) struct $Table {
                $(
                    $(#[doc = $doc])+
                    pub(crate) $field: Setting<$Type>,
                )*
            }

            impl Default for $Table {
                fn default() -> Self {
                    Self {
                        $($field: Setting::new(
                            const {
                                &Key {
                                    table: stringify!($table),
                                    field: stringify!($field),
                                    name: concat!(stringify!($table), ".", stringify!($field)),
                                    env: $env,
                                    flag: settings!(@flag $($flag)?),
                                    default: $default,
                                    // Each line of a doc comment begins with the space after its slashes.
                                    doc: concat!($($doc),+).trim_ascii_start(),
                                }
                            },
                            const { &$reading },
                        ),)*
                    }
                }
            }
        )*

        /// Every setting, in tables as in `spf.toml`.
        #[derive(Clone, Default)]
        pub(crate) struct Settings {
            $(
                $(#[$about])*
                pub(crate) $table: $Table,
            )*
        }

        impl Settings {
            /// Every setting, in the order of the declaration.
            pub(crate) fn rows(&self) -> Vec<&dyn Row> {
                vec![$($(&self.$table.$field,)*)*]
            }

            /// The same, to be set.
            pub(super) fn rows_mut(&mut self) -> Vec<&mut dyn Row> {
                vec![$($(&mut self.$table.$field,)*)*]
            }
        }
    };
    (@flag) => { None };
    (@flag $flag:expr) => { Some($flag) };
}

pub(super) use settings;
