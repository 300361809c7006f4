//! A transfer function as a table, for a renderer to upload. `table` has all of it.

mod table;

pub use table::Table;
