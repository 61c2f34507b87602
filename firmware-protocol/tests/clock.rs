//! The estimate of the device's clock is never further off than it says, whatever the line does to the heartbeats.

use gonio_protocol::clock::ClockFilter;
use proptest::prelude::*;
use std::time::Duration;

fn us(n: u64) -> Duration {
    Duration::from_micros(n)
}

proptest! {
    #[test]
    fn the_true_offset_lies_within_the_error_told(
        boot in 0u64..100_000_000,
        ways in prop::collection::vec((50u64..40_000, 50u64..40_000), 1..40),
    ) {
        // the device started `boot` microseconds before the host's clock did
        let mut filter = ClockFilter::new();
        let mut now = 0;
        for (down, up) in ways {
            now += 30_000;
            let (read_at, heard_at) = (now + down, now + down + up);
            let uptime = Duration::from_millis((read_at + boot) / 1000);
            filter.sample(us(now), us(heard_at), uptime);
            let told = filter.offset().expect("a heartbeat was heard");
            let off = told.offset_us.abs_diff(boot as i64);
            prop_assert!(u128::from(off) <= told.error.as_micros() + 1, "{off} µs off, {:?} told", told.error);
            now = heard_at;
        }
    }
}

#[test]
fn the_shortest_round_trip_of_the_latest_eight_is_believed() {
    let mut filter = ClockFilter::new();
    assert_eq!(filter.offset(), None);
    filter.sample(us(0), us(200), Duration::from_millis(5));
    for n in 1..8u64 {
        filter.sample(us(n * 30_000), us(n * 30_000 + 9_000), Duration::from_millis(5 + n * 30));
        assert_eq!(filter.offset().expect("heard").error, us(600));
    }
    filter.sample(us(240_000), us(249_000), Duration::from_millis(245));
    assert_eq!(filter.offset().expect("heard").error, us(5_000), "the good one is too old");
}
