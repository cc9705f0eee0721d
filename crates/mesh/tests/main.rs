//! Tests of the public API in one binary, which links once.

mod faults;
