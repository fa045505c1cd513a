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
pub struct Policy {
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
pub struct Late {
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

impl Policy {
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
        for (index, Extension { student, due: own, late_days }) in
            self.extensions.iter().enumerate()
        {
            let name = format!("late.extensions[{index}]");
            let index = index.to_string();
            let own_keys = |key: &'static str| ["extensions", index.as_str(), key];
            let number = names::number(student);
            if number.is_empty() {
                let message = format!("{name}.student: expected a student number, found nothing");
                return wrong(&own_keys("student"), message);
            }
            let same = |other: &Extension| names::number(&other.student) == number;
            let first = self.extensions.iter().position(same).map(|at| at.to_string());
            if let Some(first) = first.filter(|first| *first != index) {
                return Some(Problem {
                    at: keys(&own_keys("student")),
                    message: format!("{name}: student \"{student}\" has an extension already"),
                    other: Some(keys(&["extensions", &first, "student"])),
                });
            }
            match own.as_ref().map(|text| text.parse::<Timestamp>()) {
                Some(Err(error)) => {
                    let text = own.as_deref().unwrap_or_default();
                    let message = format!("{name}.due: {}", expected_date(text, &error));
                    return wrong(&own_keys("due"), message);
                }
                Some(Ok(own)) if own < due => {
                    let message = format!(
                        "{name}.due lies before the due date of the class; expected it then or later"
                    );
                    return wrong(&own_keys("due"), message);
                }
                None if late_days.is_none() => {
                    let message =
                        format!("{name} changes nothing; expected \"due\" or \"late_days\"");
                    return wrong(&own_keys("student"), message);
                }
                _ => {}
            }
            let said = own.as_deref();
            if let Some(message) =
                said.and_then(|at| self.contradiction(&format!("{name}.due"), at))
            {
                let other = Some(keys(&["time_zone"]));
                return Some(Problem { at: keys(&own_keys("due")), message, other });
            }
        }
        None
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
    pub fn judge(&self, due: &str, submitted: &str, own: impl Fn(&str) -> bool) -> Option<Late> {
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
        Some(Late { submitted, due, late_s, charged, late_days, cut_off, before, after, words })
    }

    /// Takes the penalty from a grade and notes it before and after.
    pub fn charge(&self, late: &mut Late, grade: &mut Grade) {
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
pub fn shown(at: Timestamp, due: &str, policy: Option<&Policy>) -> String {
    let zone = policy.and_then(|policy| policy.zone(due));
    in_zone(at, &zone.unwrap_or_else(|| zone_of(due)))
}

/// From when on nobody submits any more: the due date, the cut-off and the last extension, with late days and grace.
/// Returns `None` if the due date says no time.
pub fn end(due: &str, policy: Option<&Policy>) -> Option<Timestamp> {
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
mod tests {
    use super::*;

    const DUE: &str = "2019-10-06T23:59:00-04:00";

    fn policy(text: &str) -> Policy {
        let policy: Policy = serde_json::from_str(text).unwrap();
        assert_eq!(policy.problem(DUE), None);
        policy
    }

    fn grade(points: f64, points_max: f64) -> Grade {
        Grade {
            parts: Vec::new(),
            points,
            points_max,
            out_of: 100.0,
            unconfirmed: 0.0,
            remarks: Vec::new(),
        }
    }

    /// Points after the penalty of one who earned 90, and the remark.
    fn judged(policy: &Policy, submitted: &str) -> (f64, String) {
        let mut grade = grade(90.0, 90.0);
        let mut late = policy.judge(DUE, submitted, |own| own == "1").unwrap();
        policy.charge(&mut late, &mut grade);
        assert_eq!((late.before, late.after), ([90.0; 2], [grade.points; 2]));
        (grade.points, grade.remarks.concat())
    }

    #[test]
    fn penalties_by_started_day_and_hour() {
        let percent = policy(
            r#"{"penalty": 10, "unit": "percent", "of": "maximum", "per": "day", "grace_min": 15}"#,
        );
        let earned = policy(r#"{"penalty": 10, "unit": "percent", "of": "earned", "per": "day"}"#);
        let points = policy(r#"{"penalty": 0.5, "unit": "points", "per": "hour"}"#);
        for (submitted, by_percent, by_earned, by_points) in [
            ("2019-10-06T23:58:00", 90.0, 90.0, 90.0),
            ("2019-10-06T23:59:00", 90.0, 90.0, 90.0),
            // Within the grace; after it, all counts from the due date.
            ("2019-10-07T00:14:00", 90.0, 81.0, 89.5),
            ("2019-10-07T00:14:01", 80.0, 81.0, 89.5),
            ("2019-10-07T23:59:00", 80.0, 81.0, 78.0),
            ("2019-10-07T23:59:01", 70.0, 72.0, 77.5),
            // With an offset of its own.
            ("2019-10-07T03:59:01Z", 90.0, 81.0, 89.5),
            ("2019-12-24T00:00:00", 0.0, 0.0, 0.0),
        ] {
            for (policy, expected) in
                [(&percent, by_percent), (&earned, by_earned), (&points, by_points)]
            {
                assert_eq!(judged(policy, submitted).0, expected, "{submitted} {policy:?}");
            }
        }
        assert_eq!(
            judged(&percent, "2019-10-08T01:10:00").1,
            "submitted 2019-10-08 01:10 -04:00, 1 d 1 h 11 min after it was due (2019-10-06 23:59 -04:00): 2 started days; \
             2 x 10 % of the maximum: 70 instead of 90 points"
        );
    }

    #[test]
    fn cut_off_late_days_and_extensions() {
        let text = r#"{"penalty": 10, "unit": "percent", "of": "maximum", "per": "day", "late_days": 1,
            "cut_off": "2019-10-09T23:59:00-04:00", "time_zone": "America/Toronto", "extensions": [EXT]}"#;
        let plain = policy(&text.replace("EXT", ""));
        assert_eq!(judged(&plain, "2019-10-07T12:00:00").0, 90.0);
        assert!(
            judged(&plain, "2019-10-07T12:00:00")
                .1
                .contains("covered by 1 late day; that costs nothing")
        );
        assert_eq!(judged(&plain, "2019-10-08T12:00:00").0, 80.0);
        let (points, words) = judged(&plain, "2019-10-10T12:00:00");
        let named = "; after the cut-off (2019-10-09 23:59 -04:00) it is worth nothing: 0 instead of 90 points";
        assert!(points == 0.0 && words.ends_with(named), "{words}");
        // An extension of five days moves the cut-off by five days, and is one student's.
        let due = r#"{"student": "1", "due": "2019-10-11T23:59:00-04:00", "late_days": 0}"#;
        let own = policy(&text.replace("EXT", due));
        assert_eq!(judged(&own, "2019-10-11T12:00:00").0, 90.0);
        assert_eq!(judged(&own, "2019-10-12T12:00:00").0, 80.0);
        assert_eq!(judged(&own, "2019-10-14T23:59:00").0, 60.0);
        assert_eq!(judged(&own, "2019-10-14T23:59:01").0, 0.0);
        // Also one that ends before the cut-off: by an hour and a half here.
        let short = r#"{"student": "1", "due": "2019-10-07T01:29:00-04:00", "late_days": 0}"#;
        let short = policy(&text.replace("EXT", short));
        assert_eq!(judged(&short, "2019-10-10T01:29:00").0, 60.0);
        assert_eq!(judged(&short, "2019-10-10T01:29:01").0, 0.0);
        assert_eq!(
            judged(
                &policy(&text.replace("EXT", &due.replace("\"1\"", "\"2\""))),
                "2019-10-11T12:00:00"
            )
            .0,
            0.0
        );
    }

    #[test]
    fn a_range_keeps_both_ends_and_winter_time_counts() {
        let policy = policy(
            r#"{"penalty": 10, "unit": "percent", "of": "earned", "per": "day", "time_zone": "America/Toronto"}"#,
        );
        let mut own = grade(50.0, 100.0);
        let mut late =
            policy.judge("2019-11-02T23:59:00-04:00", "2019-11-03T23:00:00", |_| false).unwrap();
        // 25 hours long, that day: 24 h 1 min later is the second day.
        assert_eq!(late.charged, 2);
        policy.charge(&mut late, &mut own);
        assert_eq!((own.points, own.points_max), (40.0, 80.0));
        assert!(policy.judge("2019-11-02T23:59:00-04:00", "", |_| false).is_none());
    }

    #[test]
    fn the_last_of_all_dates_is_the_end() {
        let end = |text: &str| super::end(DUE, Some(&policy(text))).unwrap().to_string();
        let plain = r#""penalty": 1, "unit": "points", "per": "day""#;
        assert_eq!(super::end(DUE, None).unwrap().to_string(), "2019-10-07T03:59:00Z");
        for (more, expected) in [
            ("", "2019-10-07T03:59:00Z"),
            (r#", "grace_min": 15"#, "2019-10-07T04:14:00Z"),
            (r#", "grace_min": 15, "late_days": 2"#, "2019-10-09T03:59:00Z"),
            (r#", "late_days": 2, "cut_off": "2019-10-12T00:00:00Z""#, "2019-10-12T00:00:00Z"),
            (
                r#", "cut_off": "2019-10-12T00:00:00Z",
                    "extensions": [{"student": "1", "due": "2019-10-20T00:00:00Z", "late_days": 1},
                        {"student": "2", "late_days": 0}]"#,
                // The cut-off of that student.
                "2019-10-24T20:01:00Z",
            ),
        ] {
            assert_eq!(end(&format!("{{{plain}{more}}}")), expected, "{more}");
        }
        assert_eq!(super::end("some day", None), None);
    }

    #[test]
    fn how_late_is_said_to_the_second() {
        let policy = policy(r#"{"penalty": 1, "unit": "points", "per": "day"}"#);
        for (submitted, expected) in [
            ("2019-10-08T00:20:00", "submitted 2019-10-08 00:20 -04:00, 1 d 21 min after"),
            ("2019-10-08T23:59:01", "submitted 2019-10-08 23:59:01 -04:00, 2 d 1 s after"),
            ("2019-10-07T03:59:00", "submitted 2019-10-07 03:59 -04:00, 4 h after"),
        ] {
            let words = judged(&policy, submitted).1;
            assert!(words.starts_with(expected), "{words}");
        }
    }

    #[test]
    fn extensions_that_mean_nothing_are_refused_with_their_place() {
        let late = DUE.replace("06T", "09T");
        for (extensions, at, expected) in [
            (
                r#"{"student": "1", "late_days": 1}, {"student": "2", "late_days": 1}, {"student": "1 ", "due": "LATE"}"#,
                "2 student",
                "has an extension already",
            ),
            (
                r#"{"student": "1", "due": "2019-10-06T23:58:59-04:00"}"#,
                "0 due",
                "before the due date",
            ),
            (r#"{"student": "1", "due": "tomorrow"}"#, "0 due", "late.extensions[0].due: "),
            (r#"{"student": "1"}"#, "0 student", "changes nothing"),
            (r#"{"student": " ", "late_days": 1}"#, "0 student", "expected a student number"),
        ] {
            let text = format!(
                r#"{{"penalty": 1, "unit": "points", "per": "day", "extensions": [{}]}}"#,
                extensions.replace("LATE", &late)
            );
            let problem = serde_json::from_str::<Policy>(&text).unwrap().problem(DUE).unwrap();
            assert_eq!(problem.at[1..].join(" "), format!("extensions {at}"), "{text}");
            assert!(problem.message.contains(expected), "{}", problem.message);
            let other = problem.other.map(|keys| keys.join(" "));
            let first = at.starts_with('2').then(|| "late extensions 0 student".to_owned());
            assert_eq!(other, first);
        }
    }

    #[test]
    fn a_policy_that_says_too_little_is_refused() {
        for (text, expected) in [
            (r#"{"penalty": 10, "unit": "percent", "per": "day"}"#, "percent of what?"),
            (
                r#"{"penalty": 1, "unit": "points", "of": "earned", "per": "day"}"#,
                "only for percent",
            ),
            (r#"{"penalty": -1, "unit": "points", "per": "day"}"#, "must be 0 or more"),
            (
                r#"{"penalty": 1, "unit": "points", "per": "day", "time_zone": "Montreal"}"#,
                "late.time_zone",
            ),
            (
                r#"{"penalty": 1, "unit": "points", "per": "day", "cut_off": "2019-10-09"}"#,
                "late.cut_off",
            ),
            (
                r#"{"penalty": 1, "unit": "points", "per": "day", "cut_off": "2019-10-06T23:58:00-04:00"}"#,
                "late.cut_off lies before the due date",
            ),
        ] {
            let policy: Policy = serde_json::from_str(text).unwrap();
            assert!(policy.problem(DUE).unwrap().message.contains(expected), "{text}");
        }
    }

    #[test]
    fn an_offset_that_the_time_zone_does_not_have_then_is_refused() {
        let winter = "2019-11-20T23:59:00-04:00";
        for (due, more, at) in [
            (DUE, "", None),
            // The hour that comes twice, UTC, and winter time.
            ("2019-11-03T01:30:00-04:00", "", None),
            ("2019-11-03T01:30:00-05:00", "", None),
            ("2019-11-21T04:59:00Z", "", None),
            ("2019-11-21T04:59:00+00:00", "", None),
            ("2019-11-20T23:59:00-05:00", "", None),
            (winter, "", Some("due")),
            ("2019-10-06T23:59:00-05:00", "", Some("due")),
            (DUE, r#", "cut_off": "WINTER""#, Some("late cut_off")),
            (
                DUE,
                r#", "extensions": [{"student": "1", "due": "WINTER"}]"#,
                Some("late extensions 0 due"),
            ),
        ] {
            for zone in ["America/Toronto", "Europe/Paris"] {
                let text = format!(
                    r#"{{"penalty": 1, "unit": "points", "per": "day", "time_zone": "{zone}"{}}}"#,
                    more.replace("WINTER", winter)
                );
                let problem = serde_json::from_str::<Policy>(&text).unwrap().problem(due);
                let found = problem.as_ref().map(|own| own.at.join(" "));
                let is_utc = due.ends_with('Z') || due.ends_with("+00:00");
                let expected = if zone == "Europe/Paris" && !is_utc { Some("due") } else { at };
                assert_eq!(found.as_deref(), expected, "{due} {text}");
                if let Some(problem) =
                    problem.filter(|_| zone == "America/Toronto" && due == winter)
                {
                    let said = "due: 2019-11-20T23:59:00-04:00 has another offset than the time zone America/Toronto then, \
                                which is -05:00; hint: 2019-11-20T23:59:00-05:00 if";
                    assert!(problem.message.contains(said), "{}", problem.message);
                    assert_eq!(problem.other.unwrap().join(" "), "late time_zone");
                }
            }
        }
    }
}
