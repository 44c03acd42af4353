//! Memory that is asked for before it is taken, where a request decides how much it is.

use std::collections::TryReserveError;

/// A vector of equal values.
///
/// # Errors
/// Where there is no memory for it.
pub fn try_filled<T: Clone>(length: usize, value: T) -> Result<Vec<T>, TryReserveError> {
    let mut filled = Vec::new();
    filled.try_reserve_exact(length)?;
    filled.resize(length, value);
    Ok(filled)
}

/// Memory that is left to everybody else \[bytes\].
const SPARE: u64 = 64 << 20;

/// Makes sure that there is memory for something that takes so many bytes, in pieces that are not asked for
/// one by one.
///
/// # Errors
/// Where there is not, or little would be left.
pub fn ask_for(bytes: u64) -> Result<(), TryReserveError> {
    let wanted = usize::try_from(bytes.saturating_add(SPARE)).unwrap_or(usize::MAX);
    let mut room = Vec::<u8>::new();
    room.try_reserve_exact(wanted)?;
    // What nobody looks at need not be there for the compiler.
    std::hint::black_box(room);
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_there_is_no_room_for_is_refused() {
        assert!(ask_for(1 << 20).is_ok());
        assert!(ask_for(u64::MAX).is_err());
        assert!(try_filled(usize::MAX, 0u64).is_err());
        assert_eq!(try_filled(3, 7), Ok(vec![7; 3]));
    }
}
