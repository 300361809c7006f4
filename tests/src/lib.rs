//! What the tests of vgs share.
