//! Image error.
