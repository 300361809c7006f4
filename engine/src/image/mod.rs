//! Pictures: files, measures of difference, lettering.
