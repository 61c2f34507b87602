//! Wire contract between host and motion controller; no_std, no allocation
#![no_std]
