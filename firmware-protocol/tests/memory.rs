//! What the device remembers: leases and commands.

use gonio_protocol::dedup::{Dedup, Seen};
use gonio_protocol::lease::Lease;
use gonio_protocol::message::{Outcome, Reply};
use proptest::prelude::*;
use std::collections::BTreeMap;
use std::time::Duration;

const LENGTH: Duration = Duration::from_millis(150);

fn ms(n: u64) -> Duration {
    Duration::from_millis(n)
}

#[test]
fn a_lease_is_held_as_long_as_it_is_renewed_and_not_a_moment_longer() {
    let mut lease = Lease::new(LENGTH);
    assert!(!lease.is_expired(ms(1_000_000)), "not held");
    lease.take(ms(1000));
    for n in 1..10 {
        lease.renew(ms(1000 + n * 149));
    }
    assert!(!lease.is_expired(ms(1000 + 9 * 149 + 149)));
    assert!(lease.is_expired(ms(1000 + 9 * 149 + 150)));
}

#[test]
fn a_lease_given_back_cannot_be_renewed() {
    let mut lease = Lease::new(LENGTH);
    lease.take(ms(0));
    assert!(lease.is_expired(ms(150)));
    lease.release();
    lease.renew(ms(151));
    assert!(!lease.is_held() && !lease.is_expired(ms(1000)));
}

proptest! {
    /// Against a memory without bounds: nothing is ever executed twice, and what is still remembered is answered with its
    /// latest reply.
    #[test]
    fn no_command_is_executed_twice(ids in proptest::collection::vec(1u32..40, 1..200)) {
        let mut dedup = Dedup::<8>::new();
        let mut executed = BTreeMap::new();
        for (n, id) in ids.into_iter().enumerate() {
            match dedup.begin(id) {
                Seen::New => {
                    prop_assert!(!executed.contains_key(&id), "{} twice", id);
                    let reply = Reply::Done(Outcome::Triggered { count: n as u32 });
                    dedup.record(id, reply);
                    executed.insert(id, reply);
                }
                Seen::Before(reply) => prop_assert_eq!(executed.get(&id), Some(&reply)),
                Seen::Forgotten => prop_assert!(executed.last_key_value().is_some_and(|(last, _)| id <= *last)),
            }
            let recent = executed.iter().rev().take(8);
            for (&id, &reply) in recent {
                prop_assert_eq!(dedup.clone().begin(id), Seen::Before(reply));
            }
        }
    }
}
