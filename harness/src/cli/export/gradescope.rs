//! `results.json` of Gradescope's autograders.

use std::path::Path;

use anyhow::bail;
use serde_json::json;

use super::remarks;
use crate::cli::earlier::StoredReport;
use crate::cli::outputs::shell_path;
use crate::report::harmless;

/// `results.json` of Gradescope's autograders: a test for each part.
pub(super) fn gradescope(report: &StoredReport, output: &Path) -> anyhow::Result<String> {
    let [row] = report.submissions.as_slice() else {
        bail!(
            "Gradescope takes one submission at a time, and there are {}; hint: umbra export FILE --format gradescope \
             --only STUDENT --report {}",
            report.submissions.len(),
            shell_path(output)
        );
    };
    let tests = row.parts.iter().map(|part| {
        let is_said = part.title.contains("(bonus)");
        let bonus = if part.bonus && !is_said { " (bonus)" } else { "" };
        let reason = harmless(&part.reason);
        let is_open = part.points < part.points_max;
        let mut test = json!({
            "number": part.id,
            "name": format!("{}{bonus}", part.title),
            "score": part.points,
            "max_score": part.out_of,
            "output": if is_open {
                format!("not run here, worth {} to {} points: {reason}", part.points, part.points_max)
            } else {
                reason
            },
            "output_format": "text",
            "visibility": "visible",
        });
        // What was not run has neither passed nor failed.
        if !is_open {
            let is_lost = part.points < part.out_of && !part.bonus;
            test["status"] = json!(if is_lost { "failed" } else { "passed" });
        }
        test
    });
    let stages = report.timings.get(&row.slug).into_iter().flatten();
    let wall_s = (stages.map(|stage| stage.wall_s).sum::<f64>() * 100.0).round() / 100.0;
    let results = json!({
        "score": row.points,
        "execution_time": wall_s,
        "output": remarks(row, &report.assignment.rules),
        "output_format": "text",
        "tests": tests.collect::<Vec<_>>(),
    });
    Ok(serde_json::to_string_pretty(&results)? + "\n")
}
