//! Enums with codes on the wire.

/// Declares an enum with one row per variant: code on the wire, and description.
macro_rules! codes {
    ($(#[$doc:meta])* $visible:vis enum $name:ident {
        $($(#[$of_variant:meta])* $variant:ident = $code:literal, $words:literal;)+
    }) => {
        $(#[$doc])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        $visible enum $name { $($(#[$of_variant])* $variant,)+ }

        impl $name {
            /// All variants, in order of their codes.
            $visible const ALL: [Self; [$($code),+].len()] = [$(Self::$variant),+];

            /// Returns the code on the wire.
            $visible const fn code(self) -> u8 {
                match self { $(Self::$variant => $code,)+ }
            }

            /// Returns the variant with this code.
            $visible fn from_code(code: u8) -> Option<Self> {
                Self::ALL.into_iter().find(|one| one.code() == code)
            }

            /// Returns the description for messages.
            $visible const fn words(self) -> &'static str {
                match self { $(Self::$variant => $words,)+ }
            }
        }

        impl std::fmt::Display for $name {
            fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                f.write_str(self.words())
            }
        }
    };
}
pub(crate) use codes;
