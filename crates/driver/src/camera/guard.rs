//! A fence around calls of camera libraries: they panic on what some drivers say (names that are no UTF-8, kinds of controls they do not know), on a null
//! pointer after a time-out, and when a stream ends badly.

use std::panic::{AssertUnwindSafe, catch_unwind};

/// Runs `call`; a panic in it becomes an error with its words. Nothing of ours is left half changed: only the library's own state is at stake, and it
/// is dropped.
pub(super) fn guarded<T>(call: impl FnOnce() -> T) -> Result<T, String> {
    catch_unwind(AssertUnwindSafe(call)).map_err(|panic| {
        let words = panic.downcast_ref::<String>().map(String::as_str);
        let words = words.or_else(|| panic.downcast_ref::<&str>().copied()).unwrap_or("without words");
        format!("the camera library panicked: {words}")
    })
}

#[cfg(test)]
mod tests {
    #[test]
    fn a_panic_becomes_an_error() {
        assert_eq!(super::guarded(|| 3), Ok(3));
        let error = super::guarded(|| -> u8 { panic!("no {}", "UTF-8") }).expect_err("it panics");
        assert!(error.contains("no UTF-8"), "{error}");
    }
}
