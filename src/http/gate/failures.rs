//! Wrong tokens: how often an address is told so. Whether a token is right is found out first, so
//! that nobody who has one suffers from a neighbour behind the same address who has none.

use std::net::{IpAddr, Ipv4Addr};
use std::num::NonZeroU32;
use std::time::Duration;

use governor::Quota;

use super::rates::Rates;

/// Failures that an address may have at once before it is limited.
const BURST: NonZeroU32 = NonZeroU32::new(10).expect("not zero");

/// Most networks that are counted one by one; all others share one count. So a client with very many
/// addresses can't fill the memory.
const MOST_NETWORKS: usize = 65_536;

/// What happens to those who have no right token.
#[derive(Debug)]
pub struct Failures {
    rates: Rates<Network>,
    lines: Rates<Network>,
}

/// What counts as one address.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
enum Network {
    V4(Ipv4Addr),
    /// A /64: as much as one customer usually gets.
    V6([u8; 8]),
    /// Those beyond [`MOST_NETWORKS`].
    Others,
}

impl Failures {
    /// So many failures per minute and address.
    pub fn new(per_minute: NonZeroU32) -> Failures {
        let quota = Quota::per_minute(per_minute).allow_burst(per_minute.min(BURST));
        let line = Quota::per_second(NonZeroU32::MIN);
        Failures { rates: Rates::new(quota), lines: Rates::new(line) }
    }

    /// Counts a wrong token from an address.
    ///
    /// # Errors
    /// The time until the address may try again, where there are too many.
    pub fn count(&self, address: IpAddr) -> Result<(), Duration> {
        self.rates.count(&network(&self.rates, address))
    }

    /// Whether the log may tell of one more failure of an address: of one a second.
    pub fn is_told(&self, address: IpAddr) -> bool {
        self.lines.count(&network(&self.lines, address)).is_ok()
    }
}

fn network(rates: &Rates<Network>, address: IpAddr) -> Network {
    if rates.held() >= MOST_NETWORKS { Network::Others } else { Network::of(address) }
}

impl Network {
    fn of(address: IpAddr) -> Network {
        match address.to_canonical() {
            IpAddr::V4(address) => Network::V4(address),
            IpAddr::V6(address) => {
                let [a, b, c, d, e, f, g, h, ..] = address.octets();
                Network::V6([a, b, c, d, e, f, g, h])
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn address(text: &str) -> IpAddr {
        text.parse().unwrap()
    }

    #[test]
    fn an_address_is_a_network_of_one_customer() {
        for (one, other, same) in [
            ("192.0.2.1", "192.0.2.1", true),
            ("192.0.2.1", "::ffff:192.0.2.1", true),
            ("192.0.2.1", "192.0.2.2", false),
            ("2001:db8:0:1::1", "2001:db8:0:1:ffff::2", true),
            ("2001:db8:0:1::1", "2001:db8:0:2::1", false),
        ] {
            assert_eq!(Network::of(address(one)) == Network::of(address(other)), same, "{other}");
        }
    }

    #[test]
    fn whoever_has_very_many_addresses_counts_as_one() {
        let failures = Failures::new(NonZeroU32::MIN);
        let mut told = 0;
        for number in 0..200_000u32 {
            told += usize::from(failures.count(IpAddr::from(number.to_be_bytes())).is_ok());
        }
        // Each of them once, until there are too many of them to be told apart.
        assert!((MOST_NETWORKS..MOST_NETWORKS + 20_000).contains(&told), "{told}");
        assert!(failures.rates.held() <= MOST_NETWORKS + 10_000, "{}", failures.rates.held());
        assert!(failures.count(address("203.0.113.9")).is_err(), "they share one rate");
    }
}
