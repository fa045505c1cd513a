//! Time stamps as learning platforms write them. `Oct 5, 2019 1159 PM` says no time zone: it is local to the
//! platform, and the policy says where that is.

use jiff::Timestamp;
use jiff::civil::DateTime;
use jiff::tz::{Offset, TimeZone};

use super::names;

/// What months begin with, without accents, in English, French, Spanish and German; longer beginnings first.
const MONTHS: [(&str, i8); 23] = [
    ("janv", 1),
    ("jan", 1),
    ("ene", 1),
    ("feb", 2),
    ("fev", 2),
    ("mars", 3),
    ("mar", 3),
    ("apr", 4),
    ("avr", 4),
    ("abr", 4),
    ("may", 5),
    ("mai", 5),
    ("juil", 7),
    ("jul", 7),
    ("jui", 6),
    ("jun", 6),
    ("aug", 8),
    ("aou", 8),
    ("ago", 8),
    ("sep", 9),
    ("oct", 10),
    ("okt", 10),
    ("nov", 11),
];
/// December differs most.
const DECEMBER: [&str; 3] = ["dec", "dic", "dez"];

/// A time stamp at the beginning of a text, and what follows it: `Oct 5, 2019 1159 PM`,
/// `Sunday, 6 October 2019, 11:59 PM`, `6 oct. 2019 23 h 59`.
pub fn leading(text: &str) -> Option<(DateTime, &str)> {
    let mut scan = Scan(text);
    let mut month = None;
    let mut day = None;
    // A weekday, month and day in either order, "de" or "of" between them.
    for _ in 0..5 {
        scan.skip(" ,\u{a0}\u{202f}");
        match (scan.number(2), month, day) {
            (Some(number), _, None) => {
                day = Some(number);
                // As German has it.
                scan.skip(".");
            }
            (Some(_), _, Some(_)) => return None,
            (None, ..) => {
                let word = scan.word()?;
                month = month.or_else(|| month_of(word));
            }
        }
        if month.is_some() && day.is_some() {
            break;
        }
    }
    scan.skip(" ,\u{a0}\u{202f}");
    if scan.0.to_lowercase().starts_with("de ") {
        scan.word()?;
        scan.skip(" ");
    }
    let year = scan.number(4).filter(|year| *year >= 1970)?;
    scan.time_of(year, u32::try_from(month?).ok()?, day?)
}

/// A time stamp of numbers at the beginning of a text, and what follows it: `04.11.2019, 09:00`, `25/11/2019 9:00 AM`.
/// None where day and month cannot be told apart: `4/11/2019` is in November or in April.
fn in_numbers(text: &str) -> Option<(DateTime, &str)> {
    let mut scan = Scan(text);
    let first = scan.number(2)?;
    let separator = scan.0.chars().next().filter(|c| ['.', '/', '-'].contains(c))?;
    scan.0 = &scan.0[1..];
    let second = scan.number(2)?;
    scan.0 = scan.0.strip_prefix(separator)?;
    let year = scan.number(4).filter(|year| *year >= 1970)?;
    let [day, month] = match separator {
        '.' => [first, second],
        _ if first > 12 || first == second => [first, second],
        _ if second > 12 => [second, first],
        _ => return None,
    };
    scan.time_of(year, month, day)
}

/// A time stamp as text that [`instant`] reads: with its offset where it has one, else local. None where the text
/// is no time stamp.
pub fn parse(text: &str) -> Option<String> {
    let text = text.trim();
    let in_words = leading(text).or_else(|| in_numbers(text));
    if let Some((when, rest)) = in_words
        && (rest.trim().is_empty() || rest.trim().eq_ignore_ascii_case("uhr"))
    {
        return Some(when.to_string());
    }
    // `2019-02-15 17:33:57.45 Z` and `2019-02-15 17:33 -0500`, as programs write them.
    let mut joined = text.to_owned();
    if let Some((clock, zone)) = text.rsplit_once(' ')
        && (zone == "Z" || zone == "UTC" || zone.starts_with(['+', '-']))
    {
        joined = format!("{clock}{}", if zone == "UTC" { "Z" } else { zone });
    }
    if let Ok(instant) = joined.parse::<Timestamp>() {
        return Some(instant.to_string());
    }
    let has_time = joined.contains(':');
    joined.parse::<DateTime>().ok().filter(|_| has_time).map(|local| local.to_string())
}

/// The moment that a stamp of [`parse`] means; `zone` is where it is local to, unless it says so itself.
pub fn instant(stamp: &str, zone: &TimeZone) -> Option<Timestamp> {
    stamp.parse::<Timestamp>().ok().or_else(|| {
        let local: DateTime = stamp.parse().ok()?;
        // An hour that comes twice when clocks are set back counts as its first.
        zone.to_zoned(local).ok().map(|zoned| zoned.timestamp())
    })
}

/// A time zone by its name (`America/Toronto`) or offset (`-05:00`).
///
/// # Errors
/// When it is neither.
pub fn zone(text: &str) -> Result<TimeZone, String> {
    let offset = || {
        let sign = match text.as_bytes().first()? {
            b'+' => 1,
            b'-' => -1,
            _ => return None,
        };
        let (hours, minutes) = text[1..].split_once(':')?;
        let (hours, minutes): (i32, i32) = (hours.parse().ok()?, minutes.parse().ok()?);
        let valid = (0..=25).contains(&hours) && (0..60).contains(&minutes);
        let offset = Offset::from_seconds(sign * (hours * 3600 + minutes * 60)).ok()?;
        valid.then_some(TimeZone::fixed(offset))
    };
    offset().or_else(|| TimeZone::get(text).ok()).ok_or_else(|| {
        format!(
            "expected a time zone such as \"America/Toronto\" or an offset such as \"-05:00\", found \"{text}\""
        )
    })
}

/// The rest of a text.
#[derive(Clone, Copy)]
struct Scan<'a>(&'a str);

impl<'a> Scan<'a> {
    fn skip(&mut self, signs: &str) {
        self.0 = self.0.trim_start_matches(|c| signs.contains(c));
    }

    /// A number of at most so many digits.
    fn number(&mut self, digits: usize) -> Option<u32> {
        let end = self.0.find(|c: char| !c.is_ascii_digit()).unwrap_or(self.0.len());
        let number = self.0[..end].parse().ok().filter(|_| end <= digits)?;
        self.0 = &self.0[end..];
        Some(number)
    }

    /// Letters, and a dot that ends them.
    fn word(&mut self) -> Option<&'a str> {
        let end = self.0.find(|c: char| !c.is_alphabetic()).unwrap_or(self.0.len());
        let word = &self.0[..end];
        let rest = &self.0[end..];
        self.0 = rest.strip_prefix('.').unwrap_or(rest);
        (!word.is_empty()).then_some(word)
    }

    /// `1159`, `11:59`, `11:59:30`, `23 h 59`: hour, minute, second.
    fn clock(&mut self) -> Option<(u32, u32, u32)> {
        let end = self.0.find(|c: char| !c.is_ascii_digit()).unwrap_or(self.0.len());
        if (3..=4).contains(&end) {
            let together = self.number(4)?;
            return Some((together / 100, together % 100, 0));
        }
        let hour = self.number(2)?;
        let before = *self;
        self.skip(" \u{a0}\u{202f}");
        let Some(rest) = self.0.strip_prefix([':', 'h', 'H', '.']) else {
            *self = before;
            return None;
        };
        self.0 = rest;
        self.skip(" \u{a0}\u{202f}");
        let minute = self.number(2)?;
        let second = match self.0.strip_prefix(':') {
            Some(rest) => {
                self.0 = rest;
                self.number(2)?
            }
            None => 0,
        };
        Some((hour, minute, second))
    }

    /// The moment on a day whose time follows, and the rest.
    fn time_of(mut self, year: u32, month: u32, day: u32) -> Option<(DateTime, &'a str)> {
        self.skip(" ,\u{a0}\u{202f}");
        let (hour, minute, second) = self.clock()?;
        let before_half = self;
        self.skip(" \u{a0}\u{202f}");
        let hour = match self.half_of_day() {
            Some(afternoon) if (1..=12).contains(&hour) => {
                hour % 12 + if afternoon { 12 } else { 0 }
            }
            Some(_) => return None,
            None => {
                self = before_half;
                hour
            }
        };
        let parts = [month, day, hour, minute, second].map(|value| i8::try_from(value).ok());
        let [Some(month), Some(day), Some(hour), Some(minute), Some(second)] = parts else {
            return None;
        };
        let year = i16::try_from(year).ok()?;
        let when = DateTime::new(year, month, day, hour, minute, second, 0);
        Some((when.ok()?, self.0))
    }

    /// Whether `PM` follows, or `AM`.
    fn half_of_day(&mut self) -> Option<bool> {
        for (sign, afternoon) in [("a.m.", false), ("p.m.", true), ("am", false), ("pm", true)] {
            let Some((head, rest)) = self.0.split_at_checked(sign.len()) else { continue };
            if head.eq_ignore_ascii_case(sign) && !rest.starts_with(char::is_alphabetic) {
                self.0 = rest;
                return Some(afternoon);
            }
        }
        None
    }
}

fn month_of(word: &str) -> Option<i8> {
    let plain = names::plain(word);
    // Days of the week are taken for no month: "Mon" is none, and "mardi" is told from March by its letters.
    if plain == "mardi" {
        return None;
    }
    if DECEMBER.iter().any(|start| plain.starts_with(start)) {
        return Some(12);
    }
    MONTHS.iter().find(|(start, _)| plain.starts_with(start)).map(|(_, month)| *month)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stamps_of_platforms() {
        for (text, expected) in [
            ("Oct 5, 2019 1159 PM", "2019-10-05T23:59:00"),
            ("Oct 5, 2019 1205 AM", "2019-10-05T00:05:00"),
            ("Oct. 5, 2019 905 AM", "2019-10-05T09:05:00"),
            ("May 14, 2020 11:29 PM", "2020-05-14T23:29:00"),
            ("févr. 5, 2019 1159 PM", "2019-02-05T23:59:00"),
            ("5 juillet 2019 23 h 59", "2019-07-05T23:59:00"),
            ("5 juin 2019 23:59", "2019-06-05T23:59:00"),
            ("Sunday, 6 October 2019, 11:59 PM", "2019-10-06T23:59:00"),
            ("Monday, December 2, 2019, 12:00 PM", "2019-12-02T12:00:00"),
            ("6 de octubre de 2019, 23:59", "2019-10-06T23:59:00"),
            ("Montag, 4. November 2019, 09:00", "2019-11-04T09:00:00"),
            ("Dienstag, 3. M\u{e4}rz 2020, 23:59 Uhr", "2020-03-03T23:59:00"),
            ("Monday, 4 November 2019, 9:05 PM", "2019-11-04T21:05:00"),
            ("04.11.2019 09:00", "2019-11-04T09:00:00"),
            ("4.11.2019, 09:00:30", "2019-11-04T09:00:30"),
            ("25/11/2019, 09:00", "2019-11-25T09:00:00"),
            ("11/25/2019 9:00 AM", "2019-11-25T09:00:00"),
            ("5/5/2019, 09:00", "2019-05-05T09:00:00"),
            ("2019-02-15 17:33:57.5 Z", "2019-02-15T17:33:57.5Z"),
            ("2019-02-15 17:33:57 -0500", "2019-02-15T22:33:57Z"),
            ("2019-02-15T17:33:57-05:00", "2019-02-15T22:33:57Z"),
            ("2019-02-15 17:33:57", "2019-02-15T17:33:57"),
        ] {
            assert_eq!(parse(text).as_deref(), Some(expected), "{text}");
        }
        for text in ["4/11/2019, 09:00", "04-11-2019 09:00", "43773.375", "31.02.2019 09:00"] {
            assert_eq!(parse(text), None, "{text}");
        }
        for text in ["", "-", "a2.zip", "Oct 35, 2019 1159 PM", "Oct 5, 2019 1359 PM", "Oct 5", "5"]
        {
            assert_eq!(parse(text), None, "{text}");
        }
        assert_eq!(leading("Oct 5, 2019 1159 PM- a2.zip").unwrap().1, "- a2.zip");
    }

    #[test]
    fn a_local_stamp_is_where_the_policy_says() {
        let toronto = zone("America/Toronto").unwrap();
        let at = |stamp: &str, zone: &TimeZone| instant(stamp, zone).unwrap().to_string();
        assert_eq!(at("2019-10-05T23:59:00", &toronto), "2019-10-06T03:59:00Z");
        assert_eq!(at("2019-12-05T23:59:00", &toronto), "2019-12-06T04:59:00Z");
        assert_eq!(at("2019-10-05T23:59:00", &zone("+02:00").unwrap()), "2019-10-05T21:59:00Z");
        assert_eq!(at("2019-10-05T23:59:00Z", &toronto), "2019-10-05T23:59:00Z");
        assert!(zone("Toronto").unwrap_err().contains("found \"Toronto\""));
    }
}
