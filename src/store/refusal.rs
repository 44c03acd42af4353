//! What keeps older programs from a newer store: they open a table of rows by a name that is here another
//! one's, of a type whose name tells why.

use std::cmp::Ordering;

use redb::{Key, TableDefinition, TypeName, Value};

/// The table that Firn 0.1 opens first. It reads no format; the error that it ends with names this type.
pub const ROWS: TableDefinition<Refusal, Refusal> = TableDefinition::new("rows");

/// A type that has no values.
#[derive(Debug)]
pub struct Refusal;

impl Value for Refusal {
    type SelfType<'a> = ();
    type AsBytes<'a> = [u8; 0];

    fn fixed_width() -> Option<usize> {
        Some(0)
    }

    fn from_bytes<'a>(_: &'a [u8]) -> Self::SelfType<'a>
    where
        Self: 'a,
    {
    }

    fn as_bytes<'a, 'b: 'a>(_: &'a Self::SelfType<'b>) -> [u8; 0]
    where
        Self: 'b,
    {
        []
    }

    fn type_name() -> TypeName {
        TypeName::new("needs Firn 0.2 or later")
    }
}

impl Key for Refusal {
    fn compare(_: &[u8], _: &[u8]) -> Ordering {
        Ordering::Equal
    }
}
