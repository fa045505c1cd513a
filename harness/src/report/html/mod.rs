//! stub
use super::{Entry, ReportError, Sheet};
/// stub
pub fn batch(_sheet: &Sheet) -> Result<String, ReportError> {
    Ok(String::new())
}
/// stub
pub fn hand_in(_sheet: &Sheet, _entry: &Entry) -> String {
    String::new()
}
