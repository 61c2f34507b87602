//! Session journal: write, verify, recover, replay
