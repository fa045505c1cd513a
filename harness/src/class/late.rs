//! What a late submission costs, by the policy in `config.json` and the submission's own time stamp.

use jiff::tz::TimeZone;
use jiff::{SignedDuration, Timestamp};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{names, stamps};
use crate::columns::{count, point_range, range};
use crate::rubric::Grade;

/// The policy.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LatePolicy {
    /// Minutes after the due date that cost nothing. What is later is late from the due date on.
    #[serde(default)]
    pub grace_min: u32,
    /// What each started day or hour costs, in `unit`.
    pub penalty: f64,
    /// Points or percent.
    pub unit: Unit,
    /// What percent are of; must be there for percent, and only there.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub of: Option<Of>,
    /// What is counted.
    pub per: Per,
    /// From when on a submission is worth nothing, RFC 3339 with offset. An extension moves it by as much as the due
    /// date.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub cut_off: Option<String>,
    /// Days, each of 24 hours, that every student may be late without a penalty.
    #[serde(default)]
    pub late_days: u32,
    /// Where time stamps without an offset are local to: `America/Toronto` or `-05:00`; the due date's offset when
    /// absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub time_zone: Option<String>,
    /// Students with another due date or other late days.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub extensions: Vec<Extension>,
}

/// What a penalty is counted in.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Unit {
    /// Points of the assignment.
    Points,
    /// Percent.
    Percent,
}

/// What percent are of.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Of {
    /// The points of all parts that are no bonus.
    Maximum,
    /// The points that the submission earned, bonus included.
    Earned,
}

/// What is counted, each begun one whole.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Per {
    /// 24 hours.
    Day,
    /// 60 minutes.
    Hour,
}

/// What holds for one student.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Extension {
    /// Student number.
    pub student: String,
    /// Due date, RFC 3339 with offset; everybody's when absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub due: Option<String>,
    /// Late days; everybody's when absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub late_days: Option<u32>,
}

/// How late a submission is, and what that costs.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[schemars(rename = "Late")]
pub struct Lateness {
    /// When it was submitted, RFC 3339.
    pub submitted: String,
    /// When it was due for this student, RFC 3339.
    pub due: String,
    /// Seconds after the due date; 0 within the grace, or before.
    pub late_s: i64,
    /// Started days or hours that are charged, without those that late days cover.
    pub charged: i64,
    /// Late days that it takes.
    pub late_days: u32,
    /// Whether it came after the cut-off.
    pub cut_off: bool,
    /// Points before the penalty, least and most.
    pub before: [f64; 2],
    /// Points after it, least and most.
    pub after: [f64; 2],
    /// All that in a sentence; empty when it was in time.
    pub words: String,
}

/// What is wrong with a policy.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Problem {
    /// The key in `config.json`, as the keys and indices on the way to it.
    pub at: Vec<String>,
    /// What is wrong there.
    pub message: String,
    /// The other key that it contradicts, if there is one.
    pub other: Option<Vec<String>>,
}

/// What to say of a text that is no date; a date that does not exist is told in the words of `error`.
pub fn expected_date(text: &str, error: &jiff::Error) -> String {
    // One with an offset may be out of range.
    let has_offset = text.ends_with(['Z', 'z']) || text.rfind(['+', '-']).is_some_and(|at| at > 10);
    let is_local = !has_offset && text.parse::<jiff::civil::DateTime>().is_ok();
    let said = if is_local { "without an offset from UTC".to_owned() } else { error.to_string() };
    format!("expected a date such as \"2019-10-06T23:59:00-04:00\", found \"{text}\" ({said})")
}

impl LatePolicy {
    /// What is wrong with the policy itself, if anything. `due` is the class's due date.
    pub fn problem(&self, due: &str) -> Option<Problem> {
        let keys = |at: &[&str]| -> Vec<String> {
            ["late"].iter().chain(at).map(|key| (*key).to_owned()).collect()
        };
        let wrong =
            |at: &[&str], message: String| Some(Problem { at: keys(at), message, other: None });
        if !(self.penalty.is_finite() && self.penalty >= 0.0) {
            let message = format!("late.penalty is {} but must be 0 or more", self.penalty);
            return wrong(&["penalty"], message);
        }
        match (self.unit, self.of) {
            (Unit::Percent, None) => {
                let message = "late: percent of what? expected \"of\": \"maximum\" or \"earned\"";
                return wrong(&["unit"], message.into());
            }
            (Unit::Points, Some(_)) => {
                let message = "late.of is only for percent; expected none beside points";
                return wrong(&["of"], message.into());
            }
            _ => {}
        }
        if let Some(error) = self.time_zone.as_ref().and_then(|zone| stamps::zone(zone).err()) {
            return wrong(&["time_zone"], format!("late.time_zone: {error}"));
        }
        if let Some(message) = self.contradiction("due", due) {
            return Some(Problem {
                at: vec!["due".into()],
                message,
                other: Some(keys(&["time_zone"])),
            });
        }
        let due: Timestamp = due.parse().ok()?;
        match self.cut_off.as_ref().map(|text| text.parse::<Timestamp>()) {
            Some(Err(error)) => {
                let text = self.cut_off.as_deref().unwrap_or_default();
                let message = format!("late.cut_off: {}", expected_date(text, &error));
                return wrong(&["cut_off"], message);
            }
            Some(Ok(cut_off)) if cut_off < due => {
                let message = "late.cut_off lies before the due date; expected it then or later";
                return wrong(&["cut_off"], message.into());
            }
            _ => {}
        }
        let cut_off = self.cut_off.as_deref();
        if let Some(message) = cut_off.and_then(|at| self.contradiction("late.cut_off", at)) {
            let other = Some(keys(&["time_zone"]));
            return Some(Problem { at: keys(&["cut_off"]), message, other });
        }
        let problem = |at| self.problem_of_extension(at, due);
        (0..self.extensions.len()).find_map(problem)
    }

    /// What is wrong with an extension, if anything. `class_due` is the class's due date.
    fn problem_of_extension(&self, index: usize, class_due: Timestamp) -> Option<Problem> {
        let Extension { student, due, late_days } = &self.extensions[index];
        let keys = |index: usize, key: &str| {
            ["late", "extensions", &index.to_string(), key].map(str::to_owned).to_vec()
        };
        let wrong = |key: &str, message: String| {
            Some(Problem { at: keys(index, key), message, other: None })
        };
        let name = format!("late.extensions[{index}]");
        let number = names::number(student);
        if number.is_empty() {
            let message = format!("{name}.student: expected a student number, found nothing");
            return wrong("student", message);
        }
        let same = |other: &Extension| names::number(&other.student) == number;
        if let Some(first) = self.extensions.iter().position(same).filter(|first| *first != index) {
            return Some(Problem {
                at: keys(index, "student"),
                message: format!("{name}: student \"{student}\" has an extension already"),
                other: Some(keys(first, "student")),
            });
        }
        match due.as_ref().map(|text| text.parse::<Timestamp>()) {
            Some(Err(error)) => {
                let text = due.as_deref().unwrap_or_default();
                return wrong("due", format!("{name}.due: {}", expected_date(text, &error)));
            }
            Some(Ok(own)) if own < class_due => {
                let message = format!(
                    "{name}.due lies before the due date of the class; expected it then or later"
                );
                return wrong("due", message);
            }
            None if late_days.is_none() => {
                let message = format!("{name} changes nothing; expected \"due\" or \"late_days\"");
                return wrong("student", message);
            }
            _ => {}
        }
        let message = self.contradiction(&format!("{name}.due"), due.as_deref()?)?;
        let zone = ["late", "time_zone"].map(str::to_owned).to_vec();
        Some(Problem { at: keys(index, "due"), message, other: Some(zone) })
    }

    /// That a date has an offset which the time zone does not have then; UTC is every place's.
    fn contradiction(&self, what: &str, date: &str) -> Option<String> {
        let name = self.time_zone.as_ref()?;
        let at: Timestamp = date.parse().ok()?;
        let [said, own] = [zone_of(date), stamps::zone(name).ok()?].map(|zone| at.to_zoned(zone));
        (said.offset() != own.offset() && !said.offset().is_zero()).then(|| {
            let own = own.strftime("%:z");
            format!(
                "{what}: {date} has another offset than the time zone {name} then, which is {own}; hint: {}{own} if the \
                 clock there is meant; it contradicts late.time_zone",
                said.datetime()
            )
        })
    }

    /// Extensions of students who are not on a class list with these numbers.
    pub fn strangers<'a>(&self, numbers: impl Iterator<Item = &'a str>) -> Vec<String> {
        let numbers: Vec<String> = numbers.map(names::number).collect();
        let all = self.extensions.iter().enumerate();
        let own = all.filter(|(_, own)| !numbers.contains(&names::number(&own.student)));
        own.map(|(at, own)| {
            format!(
                "config.json, as this report pins it: late.extensions[{at}]: nobody on the class list has the student \
                 number \"{}\"",
                own.student
            )
        })
        .collect()
    }

    /// When the cut-off is for a student whose work is due at `own`: as long after it as the class's is after the
    /// class's due date.
    fn cut_off(&self, class_due: Timestamp, own: Timestamp) -> Option<Timestamp> {
        let cut_off: Timestamp = self.cut_off.as_ref()?.parse().ok()?;
        cut_off.checked_add(own.duration_since(class_due)).ok()
    }

    /// How late a submission of the stamp `submitted` is, for a student whom the numbers `own` name. The time zone is
    /// the policy's, else the offset of `due`. Returns `None` if the stamp or the due date says nothing.
    pub fn judge(
        &self,
        due: &str,
        submitted: &str,
        own: impl Fn(&str) -> bool,
    ) -> Option<Lateness> {
        let zone = self.zone(due)?;
        let extension = self.extensions.iter().find(|extension| own(&extension.student));
        let class_due: Timestamp = due.parse().ok()?;
        let due = match extension.and_then(|extension| extension.due.as_ref()) {
            Some(due) => due.parse().ok()?,
            None => class_due,
        };
        let when = stamps::instant(submitted, &zone)?;
        let behind = when.duration_since(due);
        let grace = SignedDuration::from_mins(i64::from(self.grace_min));
        let late_s = if behind <= grace {
            0
        } else {
            behind.as_secs() + i64::from(behind.subsec_nanos() > 0)
        };
        let unit_s = match self.per {
            Per::Day => 86_400,
            Per::Hour => 3_600,
        };
        let started = (late_s + unit_s - 1) / unit_s;
        let days = extension.and_then(|extension| extension.late_days).unwrap_or(self.late_days);
        let covered = (i64::from(days) * 86_400 / unit_s).min(started);
        let charged = started - covered;
        let late_days = u32::try_from((covered * unit_s + 86_399) / 86_400).unwrap_or(u32::MAX);
        let cut_off = self.cut_off(class_due, due).filter(|at| late_s > 0 && when > *at);
        let shown = |at: Timestamp| in_zone(at, &zone);
        let unit = match (self.per, started) {
            (Per::Day, 1) => "started day",
            (Per::Day, _) => "started days",
            (Per::Hour, 1) => "started hour",
            (Per::Hour, _) => "started hours",
        };
        let mut words = String::new();
        if late_s > 0 {
            words = format!(
                "submitted {}, {} after it was due ({}): {started} {unit}",
                shown(when),
                span(late_s),
                shown(due)
            );
            if covered > 0 {
                let days = count(late_days as usize, "late day");
                words += &format!(", {covered} of them covered by {days}");
            }
            if let Some(cut_off) = cut_off {
                words += &format!("; after the cut-off ({}) it is worth nothing", shown(cut_off));
            }
        }
        let [submitted, due] = [when, due].map(|at| at.to_string());
        let (before, after) = ([0.0; 2], [0.0; 2]);
        let cut_off = cut_off.is_some();
        Some(Lateness { submitted, due, late_s, charged, late_days, cut_off, before, after, words })
    }

    /// Takes the penalty from a grade and notes it before and after.
    pub fn charge(&self, late: &mut Lateness, grade: &mut Grade) {
        let loss = |points: f64| {
            let each = match (self.unit, self.of) {
                (Unit::Points, _) => self.penalty,
                (Unit::Percent, Some(Of::Earned)) => self.penalty / 100.0 * points,
                (Unit::Percent, _) => self.penalty / 100.0 * grade.out_of,
            };
            each * late.charged as f64
        };
        let after = |points: f64| {
            let rest = if late.cut_off { 0.0 } else { (points - loss(points)).max(0.0) };
            (rest.min(points) * 100.0).round() / 100.0
        };
        late.before = [grade.points, grade.points_max];
        late.after = late.before.map(after);
        [grade.points, grade.points_max] = late.after;
        if late.late_s == 0 {
            return;
        }
        let why = if late.cut_off {
            String::new()
        } else if late.charged == 0 {
            late.words += "; that costs nothing";
            grade.remarks.push(late.words.clone());
            return;
        } else {
            let what = match (self.unit, self.of) {
                (Unit::Points, _) => "points",
                (Unit::Percent, Some(Of::Earned)) => "% of what was earned",
                (Unit::Percent, _) => "% of the maximum",
            };
            format!("; {} x {} {what}", late.charged, self.penalty)
        };
        late.words += &if late.after == late.before {
            "; it earned nothing, so that costs nothing".to_owned()
        } else {
            format!("{why}: {} instead of {}", range(late.after), point_range(late.before))
        };
        grade.remarks.push(late.words.clone());
    }

    fn zone(&self, due: &str) -> Option<TimeZone> {
        match &self.time_zone {
            Some(zone) => stamps::zone(zone).ok(),
            None => Some(zone_of(due)),
        }
    }
}

/// The time zone of a time stamp, such as `...T23:59:00-04:00`.
fn zone_of(due: &str) -> TimeZone {
    let sign = due.rfind(['+', '-']).filter(|at| *at > 10);
    sign.and_then(|at| stamps::zone(&due[at..]).ok()).unwrap_or(TimeZone::UTC)
}

fn in_zone(at: Timestamp, zone: &TimeZone) -> String {
    let at = at.to_zoned(zone.clone());
    let seconds = if at.second() == 0 { "" } else { ":%S" };
    at.strftime(&format!("%Y-%m-%d %H:%M{seconds} %:z")).to_string()
}

/// A time as the class reads it: in the policy's time zone, else in that of the due date.
pub fn shown(at: Timestamp, due: &str, policy: Option<&LatePolicy>) -> String {
    let zone = policy.and_then(|policy| policy.zone(due));
    in_zone(at, &zone.unwrap_or_else(|| zone_of(due)))
}

/// From when on nobody submits any more: the due date, the cut-off and the last extension, with late days and grace.
/// Returns `None` if the due date says no time.
pub fn end(due: &str, policy: Option<&LatePolicy>) -> Option<Timestamp> {
    let class_due: Timestamp = due.parse().ok()?;
    let Some(policy) = policy else { return Some(class_due) };
    let after = |due: Timestamp, days: u32| {
        let late = SignedDuration::from_hours(24 * i64::from(days));
        due.checked_add(late.max(SignedDuration::from_mins(i64::from(policy.grace_min)))).ok()
    };
    let own = policy.extensions.iter().filter_map(|own| {
        let due = own.due.as_ref().map_or(Some(class_due), |due| due.parse().ok())?;
        after(due, own.late_days.unwrap_or(policy.late_days)).max(policy.cut_off(class_due, due))
    });
    let cut_off = policy.cut_off(class_due, class_due);
    after(class_due, policy.late_days).into_iter().chain(own).chain(cut_off).max()
}

/// `1 d 2 h 3 min 4 s`: a second may cost a day, so nothing is rounded.
fn span(seconds: i64) -> String {
    let minutes = seconds / 60;
    let parts = [
        (minutes / 1440, "d"),
        (minutes / 60 % 24, "h"),
        (minutes % 60, "min"),
        (seconds % 60, "s"),
    ];
    let parts = parts.into_iter().filter(|(value, _)| *value > 0);
    let parts = parts.map(|(value, unit)| format!("{value} {unit}"));
    parts.collect::<Vec<_>>().join(" ")
}

#[cfg(test)]
mod tests;
