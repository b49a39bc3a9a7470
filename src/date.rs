//! Dates and times of files, in UTC.

use std::time::{SystemTime, UNIX_EPOCH};

/// Date and time in UTC.
#[derive(Debug, Clone, Copy)]
pub(crate) struct DateTime {
    /// Time since 1970-01-01 00:00:00 (s).
    pub(crate) seconds: u64,
}

/// The time now.
pub(crate) fn now() -> DateTime {
    DateTime { seconds: SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |elapsed| elapsed.as_secs()) }
}

impl DateTime {
    /// ISO 8601: `2026-05-01T12:00:00Z`.
    pub(crate) fn iso(self) -> String {
        let (year, month, day) = civil(self.seconds / 86400);
        let s = self.seconds;
        format!("{year:04}-{month:02}-{day:02}T{:02}:{:02}:{:02}Z", s / 3600 % 24, s / 60 % 60, s % 60)
    }

    /// `MM_DD_YYYY_HH_MM`, as in the reference's recordings.
    pub(crate) fn of_the_reference(self) -> String {
        let (year, month, day) = civil(self.seconds / 86400);
        format!("{month:02}_{day:02}_{year:04}_{:02}_{:02}", self.seconds / 3600 % 24, self.seconds / 60 % 60)
    }
}

/// Year, month and day of a number of days since 1970-01-01.
fn civil(mut days: u64) -> (u64, usize, u64) {
    let leap = |year: u64| year.is_multiple_of(4) && (!year.is_multiple_of(100) || year.is_multiple_of(400));
    let mut year = 1970;
    while days >= 365 + u64::from(leap(year)) {
        days -= 365 + u64::from(leap(year));
        year += 1;
    }
    let lengths = [31, 28 + u64::from(leap(year)), 31, 30, 31, 30, 31, 31, 30, 31, 30, 31];
    let mut month = 0;
    while days >= lengths[month] {
        days -= lengths[month];
        month += 1;
    }
    (year, month + 1, days + 1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_are_iso_8601_and_in_recordings_as_the_reference_writes_them() {
        let time = DateTime { seconds: 20574 * 86400 + 43_209 };
        assert_eq!(time.iso(), "2026-05-01T12:00:09Z");
        assert_eq!(time.of_the_reference(), "05_01_2026_12_00");
    }

    #[test]
    fn days_become_dates_across_leap_years() {
        assert_eq!(civil(0), (1970, 1, 1));
        assert_eq!(civil(11016), (2000, 2, 29));
        assert_eq!(civil(11017), (2000, 3, 1));
        assert_eq!(civil(20454), (2026, 1, 1));
    }
}
