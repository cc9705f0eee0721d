//! Small files by hand, broken ones, and random ones.
