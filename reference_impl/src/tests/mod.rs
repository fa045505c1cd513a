//! Drawing tests. They need a graphics adapter, and fail where there is none.

mod scenes;
