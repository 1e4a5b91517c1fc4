//! Generates a structure from the table of keys: one field per key.

/// Declares [`Settings`](super::Settings) and its tables from rows of
///
/// ```text
/// /// meaning and unit
/// name: Type = "default", Reading, "VARIABLE", "--flag" sets "its value without an argument";
/// ```
///
/// The last two may be omitted. The doc comment is also the key's meaning in hints, `spf config show` and
/// `docs/reference/configuration.md`, so it is one line.
macro_rules! settings {
    ($(
        $(#[$about:meta])*
        $table:ident: $Table:ident {
            $(
                #[doc = $doc:literal]
                $field:ident: $Type:ty = $default:literal, $reading:expr, $env:literal $(, $flag:literal $(sets $sets:literal)?)?;
            )*
        }
    )*) => {
        $(
            $(#[$about])*
            #[derive(Clone)]
            pub(crate) struct $Table {
                $(
                    #[doc = $doc]
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
                                    flag: settings!(@flag $($flag $(sets $sets)?)?),
                                    default: $default,
                                    // A doc comment begins with the space after its slashes.
                                    doc: $doc.trim_ascii_start(),
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

            /// The same, for display.
            pub(super) fn rows_mut(&mut self) -> Vec<&mut dyn Row> {
                vec![$($(&mut self.$table.$field,)*)*]
            }
        }
    };
    (@flag) => { None };
    (@flag $flag:literal) => { Some(Flag { name: $flag, sets: None }) };
    (@flag $flag:literal sets $sets:literal) => { Some(Flag { name: $flag, sets: Some($sets) }) };
}

pub(super) use settings;
