//! Colorings against the sequential oracle, a slow model of the rounds, bounds and thread counts.

#![expect(clippy::unwrap_used, reason = "a failed unwrap is a failed test")]

mod balance;
mod generators;
mod oracle;
mod parallel;
mod recoloring;
mod rounds;
mod sequential;
mod within;
