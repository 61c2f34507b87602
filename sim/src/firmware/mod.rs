//! What the motion controller does, without its motors.
