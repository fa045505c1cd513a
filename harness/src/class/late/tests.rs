use super::*;

const DUE: &str = "2019-10-06T23:59:00-04:00";

fn policy(text: &str) -> LatePolicy {
    let policy: LatePolicy = serde_json::from_str(text).unwrap();
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
fn judged(policy: &LatePolicy, submitted: &str) -> (f64, String) {
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
    let named =
        "; after the cut-off (2019-10-09 23:59 -04:00) it is worth nothing: 0 instead of 90 points";
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
        (r#"{"student": "1", "due": "2019-10-06T23:58:59-04:00"}"#, "0 due", "before the due date"),
        (r#"{"student": "1", "due": "tomorrow"}"#, "0 due", "late.extensions[0].due: "),
        (r#"{"student": "1"}"#, "0 student", "changes nothing"),
        (r#"{"student": " ", "late_days": 1}"#, "0 student", "expected a student number"),
    ] {
        let text = format!(
            r#"{{"penalty": 1, "unit": "points", "per": "day", "extensions": [{}]}}"#,
            extensions.replace("LATE", &late)
        );
        let problem = serde_json::from_str::<LatePolicy>(&text).unwrap().problem(DUE).unwrap();
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
        (r#"{"penalty": 1, "unit": "points", "of": "earned", "per": "day"}"#, "only for percent"),
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
        let policy: LatePolicy = serde_json::from_str(text).unwrap();
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
            let problem = serde_json::from_str::<LatePolicy>(&text).unwrap().problem(due);
            let found = problem.as_ref().map(|own| own.at.join(" "));
            let is_utc = due.ends_with('Z') || due.ends_with("+00:00");
            let expected = if zone == "Europe/Paris" && !is_utc { Some("due") } else { at };
            assert_eq!(found.as_deref(), expected, "{due} {text}");
            if let Some(problem) = problem.filter(|_| zone == "America/Toronto" && due == winter) {
                let said = "due: 2019-11-20T23:59:00-04:00 has another offset than the time zone America/Toronto then, \
                            which is -05:00; hint: 2019-11-20T23:59:00-05:00 if";
                assert!(problem.message.contains(said), "{}", problem.message);
                assert_eq!(problem.other.unwrap().join(" "), "late time_zone");
            }
        }
    }
}
