//! Enums of faults whose rows have a variant and its text.

/// Generates enums. A row has a variant and the text by which it is displayed, with the values of its fields.
macro_rules! described {
    ($(
        $(#[$attribute:meta])+
        pub enum $name:ident {
            $(
                $(#[$doc:meta])+
                $variant:ident
                $(($($part:ident: $part_type:ty),+))?
                $({ $($(#[$field_doc:meta])+ $field:ident: $field_type:ty,)+ })?
                => $text:literal $(, $value:expr)?;
            )+
        }
    )+) => {$(
        $(#[$attribute])+
        pub enum $name {
            $(
                $(#[$doc])+
                $variant
                $(($($part_type),+))?
                $({ $($(#[$field_doc])+ $field: $field_type,)+ })?,
            )+
        }

        impl std::fmt::Display for $name {
            fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                match self {
                    $(Self::$variant $(($($part),+))? $({ $($field),+ })? => {
                        // Not all fields are in the text.
                        $($(_ = $part;)+)? $($(_ = $field;)+)?
                        write!(f, $text $(, $value)?)
                    })+
                }
            }
        }
    )+};
}

pub(crate) use described;
