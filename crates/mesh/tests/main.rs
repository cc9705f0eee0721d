//! Behavior of the crate as seen from outside; one binary, so that the tests link once.

mod faults;
