//! Tests of the scenes as they are written.
