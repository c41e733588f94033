//! Enums with a word per value, for files, menus and listings.

/// Makes an enum with a list of its values and a method that gives each one's word.
///
/// Settings have more: words for serde and sentences for people (`choices!` of `stereolux-settings`).
#[macro_export]
macro_rules! words {
    (
        $(#[$about:meta])*
        pub enum $name:ident: $word:ident {
            $( $(#[$meaning:meta])+ $value:ident = $literal:literal, )+
        }
    ) => {
        $(#[$about])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        pub enum $name {
            $( $(#[$meaning])+ $value, )+
        }

        impl $name {
            /// All values, in the order of listings.
            pub const ALL: [Self; [$($literal),+].len()] = [$(Self::$value),+];

            /// The value's word.
            #[must_use]
            pub const fn $word(self) -> &'static str {
                match self {
                    $(Self::$value => $literal,)+
                }
            }
        }
    };
}
