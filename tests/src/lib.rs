//! Finds what the stories share: golden tables and, through `GONIO_DATA`, real measurements.
